// The 3-D mode: orbit about the scene.

const START = { yaw: -0.2, pitch: 0.1, distance: 1.04, panX: 0, panY: 0 };

const spaceMode = {
  id: "space",
  label: "3-D",
  available: Boolean(DISPARITY),
  grab: true,
  ownZoom: true,
  orbit: { ...START },
  look: { form: "points", size: 1.8, colour: "image" },
  scene: null,
  renderer: null,
  async enter() {
    byId("space-canvas").hidden = false;
    pictureCanvas.hidden = true;
    setCursor(null);
    if (!this.scene) {
      this.scene = await buildScene();
      const wanted = new URLSearchParams(location.search).get("draw");
      const canvas = byId("space-canvas");
      this.renderer = (wanted !== "canvas" && webglRenderer(canvas, this.scene, wanted === "webgl")) || canvasRenderer(canvas, this.scene);
      if (mode === this) showPanel();
    }
    this.paint();
  },
  leave() {
    byId("space-canvas").hidden = true;
    pictureCanvas.hidden = false;
  },
  paint: oncePerFrame(() => { if (spaceMode.renderer && mode === spaceMode) spaceMode.renderer.draw(spaceMode.orbit, spaceMode.look); }),
  resized() { this.paint(); },
  panel() {
    const controls = [
      choiceControl("Colour", [["image", "Image"], ["depth", "Depth"]], this.look.colour, (colour) => { this.look.colour = colour; this.paint(); }),
      rangeControl("Point size", { min: 0.5, max: 5, step: 0.1, value: this.look.size, id: "point-size" },
        (value) => value.toFixed(1), (value) => { this.look.size = value; this.paint(); }),
    ];
    if (this.renderer && this.renderer.surface) {
      controls.unshift(choiceControl("Form", [["points", "Points"], ["surface", "Surface"]], this.look.form, (form) => { this.look.form = form; this.paint(); }));
    }
    const count = this.scene ? `${grouped(this.scene.count)} points. ` : "";
    return [
      ...heading("3-D", "Drag to orbit, scroll or pinch to come nearer, Shift and drag to move."), ...controls,
      element("div", { className: "actions" }, element("button", {
        type: "button", className: "action", textContent: "Back to the start",
        onclick: () => { Object.assign(this.orbit, START); this.paint(); },
      })),
      element("p", { className: "note", id: "renderer", textContent: count + (this.renderer ? this.renderer.name : "") }),
    ];
  },
  drag(dx, dy, point, event) {
    if (event.shiftKey) {
      this.orbit.panX += dx / stage.clientWidth;
      this.orbit.panY += dy / stage.clientWidth;
    } else this.turn(-dx * 0.006, dy * 0.006);
    this.paint();
  },
  turn(yaw, pitch) {
    this.orbit.yaw += yaw;
    this.orbit.pitch = clamp(this.orbit.pitch + pitch, -1.45, 1.45);
  },
  wheel(factor) {
    this.orbit.distance = clamp(this.orbit.distance / factor, 0.15, 5);
    this.paint();
  },
  arrow(dx, dy) {
    this.turn(-0.06 * Math.sign(dx), 0.06 * Math.sign(dy));
    this.paint();
  },
  fileName: "scene",
};
