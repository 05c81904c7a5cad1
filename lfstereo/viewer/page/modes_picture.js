// Modes that show one picture: all in focus, refocus, perspective.

const drawPicture = (context, source) => {
  const image = source && picture(source, redraw);
  if (image) context.drawImage(image, 0, 0, WIDTH, HEIGHT);
  return Boolean(image);
};

// All in focus.
const sharpMode = {
  id: "sharp",
  label: CONTENT.pictures.sharp ? "All in focus" : "Centre view",
  captured: false,
  available: true,
  source() {
    return this.captured || !CONTENT.pictures.sharp ? CONTENT.pictures.centre_left : CONTENT.pictures.sharp;
  },
  draw(context) { drawPicture(context, this.source()); },
  panel() {
    if (!CONTENT.pictures.sharp) {
      return heading("Centre view", "What the lens showed through the middle of its aperture. Go to Refocus and click a point to bring it into focus.");
    }
    return [
      ...heading("All in focus", "The left view with every distance sharp, put together from the focal stack."),
      switchControl("Single view as captured", this.captured, (on) => { this.captured = on; redraw(); }),
    ];
  },
  arrow(dx, dy) { moveCursor(dx, dy); },
  fileName: "all_in_focus",
};

// Refocus: the slices of the focal stack, or any focus where the page is served live.
const focusMode = {
  id: "focus",
  label: "Refocus",
  share: 0.4,
  pulling: 0,
  live: null,
  available: SLICES.length > 0 || Boolean(CONTENT.live && CONTENT.live.refocus),
  slice() { return clamp(Math.round(this.share * (SLICES.length - 1)), 0, SLICES.length - 1); },
  value() { return this.live || !SLICES.length ? axisValue(this.share) : SLICES[this.slice()].disparity; },
  enter() {
    focusInput.hidden = false;
    focusInput.value = this.share;
    for (const slice of SLICES) picture(slice.picture, redraw);
    if (this.live) this.live.ask();
  },
  leave() {
    focusInput.hidden = true;
    this.pulling = 0;
  },
  draw(context) {
    if (this.live && this.live.draw(context)) return;
    if (SLICES.length) drawPicture(context, SLICES[this.slice()].picture);
    else drawPicture(context, CONTENT.pictures.centre_left);
  },
  panel() {
    this.big = element("div", { className: "big", id: "focus-reading" });
    this.tell();
    return [
      ...heading("Refocus", "Click a point to bring it into focus, or move the scale."), this.big,
      ...(this.live ? this.live.controls() : [element("p", { className: "note", textContent: `${SLICES.length} slices, each the mean of the views within the round aperture of the left camera.` })]),
    ];
  },
  tell() {
    if (!this.big) return;
    const value = this.value(), metres = AXIS.metric ? metresOf(value) : null;
    const under = [AXIS.metric ? `${value.toFixed(1)} px` : "", this.live || !SLICES.length ? "" : `slice ${this.slice() + 1} of ${SLICES.length}`];
    this.big.replaceChildren(
      AXIS.metric ? metresText(metres) : value.toFixed(3).replace("-", "−"), " ", element("small", { textContent: AXIS.metric ? "m" : AXIS.unit }),
      element("span", { className: "under", textContent: under.filter(Boolean).join(" · ") || "0 = plane the lens was focused at" }));
    focusInput.setAttribute("aria-valuetext", AXIS.metric ? `${metresText(metres)} m` : `${value.toFixed(3)} ${AXIS.unit}`);
  },
  set(share) {
    this.share = clamp(share, 0, 1);
    focusInput.value = this.share;
    if (this.live) this.live.ask();
    this.tell();
    redraw();
  },
  // Turn the focus ring to its new place instead of jumping there.
  pull(target) {
    const from = this.share, began = performance.now(), run = ++this.pulling;
    const lasts = matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : 260 + 340 * Math.abs(target - from);
    const step = (now) => {
      if (run !== this.pulling || mode !== this) return;
      const t = lasts ? clamp((now - began) / lasts, 0, 1) : 1;
      this.set(from + (target - from) * t * t * (3 - 2 * t));
      if (t < 1) requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  },
  tap(x, y) {
    showRing(x + 0.5, y + 0.5);
    const value = DISPARITY ? disparityAt(x, y) : slopeAt(x, y);
    if (value !== null) this.pull(clamp(axisShare(value), 0, 1));
  },
  arrow(dx, dy) {
    this.pulling++;
    const step = this.live || !SLICES.length ? 0.01 : 1 / (SLICES.length - 1);
    const from = this.live || !SLICES.length ? this.share : this.slice() * step;
    this.set(from + step * Math.sign(dx - dy || 0));
  },
  get fileName() { return `focus_${this.value().toFixed(2)}px`; },
};
focusInput.addEventListener("input", () => { focusMode.pulling++; focusMode.set(Number(focusInput.value)); });

// Perspective: the views through the pupil of the left camera.
const VIEWS = CONTENT.views;
const RADIUS = Math.max(1, ...VIEWS.map((at) => Math.hypot(at.s, at.t)));

const viewsMode = {
  id: "views",
  label: "Perspective",
  available: VIEWS.length > 1,
  s: 0,
  t: 0,
  grab: true,
  swaying: false,
  nearest() {
    return VIEWS.reduce((best, at) =>
      (Math.hypot(at.s - this.s, at.t - this.t) < Math.hypot(best.s - this.s, best.t - this.t) - 1e-9 ? at : best));
  },
  enter() { for (const at of VIEWS) picture(at.picture, redraw); },
  leave() { this.swaying = false; },
  draw(context) { drawPicture(context, this.nearest().picture); },
  panel() {
    const dots = VIEWS.map((at) => drawing("circle", { cx: at.s, cy: at.t, r: 0.17 * Math.max(1, CONTENT.view_step), class: "view" }));
    const reach = RADIUS + 0.8 * Math.max(1, CONTENT.view_step);
    this.here = drawing("circle", { r: 0.42 * Math.max(1, CONTENT.view_step), class: "here" });
    const pupil = drawing("svg", { class: "pupil", viewBox: `${-reach} ${-reach} ${2 * reach} ${2 * reach}`, role: "img", "aria-label": "Place in the pupil" });
    pupil.append(drawing("circle", { r: reach - 0.03, class: "rim", "stroke-width": 0.012 * reach }), ...dots, this.here);
    const point = (event) => {
      const box = pupil.getBoundingClientRect();
      this.go(((event.clientX - box.left) / box.width * 2 - 1) * reach, ((event.clientY - box.top) / box.height * 2 - 1) * reach);
    };
    pupil.addEventListener("pointerdown", (event) => { this.swaying = false; pupil.setPointerCapture(event.pointerId); point(event); });
    pupil.addEventListener("pointermove", (event) => { if (event.buttons) point(event); });
    this.go(this.s, this.t);
    this.swaySwitch = switchControl("Sway", this.swaying, (on) => this.sway(on));
    const all = CONTENT.views_in_all;
    return [
      ...heading("Perspective", "Drag the picture: your eye moves about the pupil of the left lens."), pupil, this.swaySwitch,
      element("p", { className: "note", textContent: all > VIEWS.length ? `${VIEWS.length} of ${all} views are on this page.` : `${VIEWS.length} views.` }),
    ];
  },
  go(s, t) {
    const away = Math.hypot(s, t), share = away > RADIUS ? RADIUS / away : 1;
    this.s = s * share;
    this.t = t * share;
    if (this.here) {
      this.here.setAttribute("cx", this.s);
      this.here.setAttribute("cy", this.t);
    }
    redraw();
  },
  sway(on) {
    this.swaying = on;
    const began = performance.now();
    const step = (now) => {
      if (!this.swaying || mode !== this) return;
      const angle = (now - began) / 700;
      this.go(0.85 * RADIUS * Math.sin(angle), 0.55 * RADIUS * Math.sin(2 * angle));
      requestAnimationFrame(step);
    };
    if (on) requestAnimationFrame(step);
  },
  stopSway() {
    this.swaying = false;
    const input = this.swaySwitch && this.swaySwitch.querySelector("input");
    if (input) input.checked = false;
  },
  // The eye follows the hand: across the whole pupil over half of the stage.
  drag(dx, dy) {
    this.stopSway();
    const reach = (4 * RADIUS) / stage.clientWidth;
    this.go(this.s - dx * reach, this.t - dy * reach);
  },
  arrow(dx, dy) {
    this.stopSway();
    this.go(this.s + Math.sign(dx) * CONTENT.view_step, this.t + Math.sign(dy) * CONTENT.view_step);
  },
  get fileName() { const at = this.nearest(); return `view_${at.t}_${at.s}`; },
};
