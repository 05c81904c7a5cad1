// Modes that show disparity: the map with its overlays, and the swipe between two pictures.

const depthMode = {
  id: "depth",
  label: "Disparity",
  available: Boolean(DISPARITY),
  opacity: 1,
  hide: true,
  overlay: null,
  layers: {},
  // Colours are computed once per setting and kept as canvases.
  colours(hide) {
    const name = `colours ${hide}`;
    this.layers[name] ||= painted((data, i, k) => {
      const from = turboIndex(DISPARITY[i] * CONTENT.disparity.px_per_code), shown = VALID[i] || !hide;
      for (let c = 0; c < 3; c++) data[k + c] = shown ? TURBO[from + c] : 46;
      data[k + 3] = 255;
    });
    return this.layers[name];
  },
  // What an overlay tells, over the dimmed image: clear at 0, amber, then pale from its full scale on.
  told(overlay) {
    this.layers[overlay.id] ||= painted((data, i, k) => {
      const code = overlay.codes[i], share = clamp((code * overlay.px_per_code) / overlay.full_px, 0, 1);
      if (code === 255) data[k + 3] = 150;
      else {
        data[k] = 255;
        data[k + 1] = 150 + 90 * share;
        data[k + 2] = 30 + 190 * share * share;
        data[k + 3] = 255 * Math.min(1, 1.5 * share);
      }
    });
    return this.layers[overlay.id];
  },
  draw(context) {
    context.filter = this.overlay ? "grayscale(1) brightness(.62)" : "none";
    drawPicture(context, CONTENT.pictures.sharp);
    context.filter = "none";
    context.globalAlpha = this.overlay ? 1 : this.opacity;
    context.drawImage(this.overlay ? this.told(this.overlay) : this.colours(this.hide), 0, 0);
    context.globalAlpha = 1;
  },
  panel() {
    const ofMap = element("div", {},
      rangeControl("Disparity over image", { min: 0, max: 1, step: 0.01, value: this.opacity },
        (value) => `${Math.round(100 * value)} %`, (value) => { this.opacity = value; redraw(); }),
      switchControl("Hide what is not valid", this.hide, (on) => { this.hide = on; redraw(); }));
    const ofOverlay = element("div", { id: "overlay" });
    const show = (id) => {
      this.overlay = OVERLAYS.find((overlay) => overlay.id === id) || null;
      ofMap.hidden = Boolean(this.overlay);
      ofOverlay.replaceChildren(...(this.overlay ? legendOf(this.overlay) : []));
      redraw();
    };
    const names = [["", "Disparity"], ...OVERLAYS.map((overlay) => [overlay.id, overlay.name])];
    const choice = OVERLAYS.length ? [choiceControl("Show", names, this.overlay ? this.overlay.id : "", show)] : [];
    show(this.overlay ? this.overlay.id : "");
    return [
      ...heading("Disparity", "How far each point lies apart in the two views, warm for near. The scale below the picture gives the colours in metres and px."),
      ...choice, ofMap, ofOverlay,
    ];
  },
  arrow(dx, dy) { moveCursor(dx, dy); },
  fileName: "disparity",
};

function legendOf(overlay) {
  return [element("div", { className: "actions" },
    element("div", { className: "legend doubtful" }),
    element("div", {}, element("span", { textContent: "0" }), element("span", { textContent: `≥ ${overlay.full_px} px` })),
    element("p", { className: "note", textContent: overlay.label }))];
}

function painted(paint) {
  const canvas = offscreen(WIDTH, HEIGHT), context = canvas.getContext("2d");
  const pixels = context.createImageData(WIDTH, HEIGHT);
  for (let i = 0; i < WIDTH * HEIGHT; i++) paint(pixels.data, i, 4 * i);
  context.putImageData(pixels, 0, 0);
  return canvas;
}

// Swipe between two pictures.
const SWIPES = [
  ["sharp", "All in focus", (context) => drawPicture(context, CONTENT.pictures.sharp)],
  ["disparity", "Disparity", (context) => context.drawImage(depthMode.colours(true), 0, 0)],
  ["view", "Single view", (context) => drawPicture(context, CONTENT.pictures.centre_left)],
  ["focus", "Refocused", (context) => focusMode.draw(context)],
  ...(CONTENT.pictures.centre_right ? [["right", "Right camera", (context) => drawPicture(context, CONTENT.pictures.centre_right)]] : []),
];

const swipeMode = {
  id: "compare",
  label: "Compare",
  available: Boolean(DISPARITY),
  swipe: true,
  share: 0.5,
  left: "sharp",
  right: "disparity",
  enter() { this.show(true); },
  leave() { this.show(false); },
  show(on) {
    for (const id of ["divider", "side-left", "side-right"]) byId(id).hidden = !on;
    if (!on) return;
    byId("side-left").textContent = this.part("left")[1];
    byId("side-right").textContent = this.part("right")[1];
  },
  part(side) { return SWIPES.find(([id]) => id === this[side]); },
  draw(context) {
    const at = (this.share * stage.clientWidth - view().left) / view().scale;
    byId("divider").style.left = `${100 * this.share}%`;
    this.part("right")[2](context);
    context.save();
    context.beginPath();
    context.rect(0, 0, at, HEIGHT);
    context.clip();
    this.part("left")[2](context);
    context.restore();
  },
  move(point) {
    this.share = clamp((point.x * view().scale + view().left) / stage.clientWidth, 0, 1);
    redraw();
  },
  press(point) { this.move(point); },
  drag(dx, dy, point) { this.move(point); },
  arrow(dx) {
    this.share = clamp(this.share + 0.02 * Math.sign(dx), 0, 1);
    redraw();
  },
  panel() {
    const select = (side, name) => {
      const chosen = element("select", {}, ...SWIPES.map(([id, text]) => element("option", { value: id, textContent: text })));
      chosen.value = this[side];
      chosen.addEventListener("change", () => { this[side] = chosen.value; this.show(true); redraw(); });
      return element("label", { className: "control", style: "display:block" }, element("span", { textContent: name }), chosen);
    };
    return [...heading("Compare", "Drag the line across the picture."), select("left", "Left of the line"), select("right", "Right of the line")];
  },
  fileName: "compare",
};
