// Where the page is served by lfstereo view: any focus, aperture and tilt, rendered by the program.

function startLive(served) {
  if (served.items.length > 1) offerItems(served);
  if (!served.refocus) return;
  const look = { radius: served.radius_views, tilt_x: 0, tilt_y: 0 };
  let asked = "", running = false, shown = null;

  const query = () => new URLSearchParams({
    slope: slopeOf(axisValue(focusMode.share)).toFixed(5),
    radius: look.radius.toFixed(2), tilt_x: look.tilt_x.toFixed(4), tilt_y: look.tilt_y.toFixed(4),
  }).toString();
  const slopeOf = (value) => served.slope_from_axis[0] * value + served.slope_from_axis[1];

  // One request at a time; the newest wish follows when it is answered.
  async function pump() {
    if (running) return;
    running = true;
    stage.classList.add("busy");
    while (asked !== query()) {
      asked = query();
      try {
        const answer = await fetch(`${served.base}refocus?${asked}`);
        if (!answer.ok) break;
        shown = await createImageBitmap(await answer.blob());
      } catch { break; }
      redraw();
    }
    running = false;
    stage.classList.remove("busy");
  }

  focusMode.live = {
    ask() { pump(); },
    draw(context) {
      if (shown) context.drawImage(shown, 0, 0, WIDTH, HEIGHT);
      return Boolean(shown);
    },
    controls() {
      const degrees = (value) => (value === 0 ? "none" : `${value > 0 ? "+" : "−"}${Math.abs(value).toFixed(2)}`);
      const change = (name) => (value) => { look[name] = value; pump(); };
      const steepest = served.largest_tilt;
      const save = element("a", { className: "action", textContent: "Save as 16-bit PNG", href: "", download: "" });
      save.addEventListener("pointerenter", () => { save.href = `${served.base}export?${query()}`; });
      save.addEventListener("focus", () => { save.href = `${served.base}export?${query()}`; });
      save.addEventListener("click", () => { save.href = `${served.base}export?${query()}`; });
      return [
        rangeControl("Aperture", { min: 0.5, max: served.radius_views, step: 0.25, value: look.radius, id: "aperture" },
          (value) => `${Math.round((100 * value) / served.radius_views)} %`, change("radius")),
        rangeControl("Tilt left to right", { min: -steepest, max: steepest, step: steepest / 50, value: look.tilt_x, id: "tilt-x" }, degrees, change("tilt_x")),
        rangeControl("Tilt top to bottom", { min: -steepest, max: steepest, step: steepest / 50, value: look.tilt_y, id: "tilt-y" }, degrees, change("tilt_y")),
        element("div", { className: "actions" }, save),
        element("p", { className: "note", textContent: `Rendered live from ${served.views} views. Tilt is in px per view from edge to edge.` }),
      ];
    },
  };
}

function offerItems(served) {
  const chooser = element("select", { id: "chooser" }, ...served.items.map((name, k) => element("option", { value: k, textContent: name })));
  chooser.value = served.item;
  byId("theme").before(element("label", { className: "chooser" }, element("span", { className: "label", textContent: "Capture" }), chooser));
  chooser.addEventListener("change", () => {
    chooser.disabled = true;
    location.href = `${served.root}?item=${chooser.value}${location.hash}`;
  });
}
