// The stage: shows the mode in use, zooms, and tells where in the picture the pointer is.

const stage = byId("stage");
const pictureCanvas = byId("picture");
const zoomed = { scale: 1, x: WIDTH / 2, y: HEIGHT / 2 };
const MODES = [];
let mode = null;
let cursor = null;

const modeById = (id) => MODES.find((candidate) => candidate.id === id);

stage.style.aspectRatio = `${WIDTH} / ${HEIGHT}`;
document.documentElement.style.setProperty("--aspect", WIDTH / HEIGHT);

// Image px (pixel corners at integers) to CSS px of the stage and back.
function view() {
  const scale = (zoomed.scale * stage.clientWidth) / WIDTH;
  return { scale, left: stage.clientWidth / 2 - zoomed.x * scale, top: stage.clientHeight / 2 - zoomed.y * scale };
}

function imagePoint(event) {
  const box = stage.getBoundingClientRect(), { scale, left, top } = view();
  return { x: (event.clientX - box.left - left) / scale, y: (event.clientY - box.top - top) / scale };
}

function stagePoint(x, y) {
  const { scale, left, top } = view();
  return { left: x * scale + left, top: y * scale + top };
}

const redraw = oncePerFrame(() => {
  if (!mode || !mode.draw) return;
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(stage.clientWidth * ratio), height = Math.round(stage.clientHeight * ratio);
  if (pictureCanvas.width !== width || pictureCanvas.height !== height) {
    pictureCanvas.width = width;
    pictureCanvas.height = height;
  }
  const context = pictureCanvas.getContext("2d"), { scale, left, top } = view();
  context.setTransform(ratio * scale, 0, 0, ratio * scale, ratio * left, ratio * top);
  context.imageSmoothingEnabled = ratio * scale < 4;
  context.imageSmoothingQuality = "high";
  mode.draw(context);
  placeCross();
});

function zoomTo(scale, x = WIDTH / 2, y = HEIGHT / 2) {
  if (!mode || mode.ownZoom) return;
  const before = view(), old = zoomed.scale;
  const atLeft = x * before.scale + before.left, atTop = y * before.scale + before.top;
  zoomed.scale = clamp(scale, 1, 16);
  if (old === zoomed.scale) return;
  const after = view();
  zoomed.x += (atLeft - stage.clientWidth / 2) / before.scale - (atLeft - stage.clientWidth / 2) / after.scale;
  zoomed.y += (atTop - stage.clientHeight / 2) / before.scale - (atTop - stage.clientHeight / 2) / after.scale;
  keepInside();
}

function keepInside() {
  const halfX = WIDTH / 2 / zoomed.scale, halfY = HEIGHT / 2 / zoomed.scale;
  zoomed.x = clamp(zoomed.x, halfX, WIDTH - halfX);
  zoomed.y = clamp(zoomed.y, halfY, HEIGHT - halfY);
  touchRule();
  redraw();
}

// A finger scrolls the page over the stage unless the mode, or a zoomed picture, wants its movement.
function touchRule() {
  stage.style.touchAction = (mode && mode.drag) || zoomed.scale > 1 ? "none" : "pan-y";
  stage.classList.toggle("grab", Boolean(mode && mode.grab) || (zoomed.scale > 1 && !(mode && mode.drag)));
  stage.classList.toggle("swipe", Boolean(mode && mode.swipe));
}

function setCursor(point) {
  const inside = point && point.x >= 0 && point.y >= 0 && point.x < WIDTH && point.y < HEIGHT;
  cursor = inside ? { x: Math.floor(point.x), y: Math.floor(point.y) } : null;
  showReadout();
}

function placeCross() {
  const cross = byId("cross");
  cross.hidden = !(cursor && cursor.byKey) || mode.id === "space";
  if (cross.hidden) return;
  const { left, top } = stagePoint(cursor.x + 0.5, cursor.y + 0.5);
  cross.style.left = `${left}px`;
  cross.style.top = `${top}px`;
}

function moveCursor(dx, dy) {
  const from = cursor || { x: WIDTH >> 1, y: HEIGHT >> 1 };
  cursor = { x: clamp(from.x + dx, 0, WIDTH - 1), y: clamp(from.y + dy, 0, HEIGHT - 1), byKey: true };
  byId("readout").setAttribute("aria-live", "polite");
  showReadout();
  placeCross();
}

function showRing(x, y) {
  const ring = byId("ring"), { left, top } = stagePoint(x, y);
  ring.style.left = `${left}px`;
  ring.style.top = `${top}px`;
  ring.classList.remove("shown");
  void ring.getBoundingClientRect();
  ring.classList.add("shown");
}

// Pointers: one drags or taps, two pinch.
const TAP_PX = 5;
const pointers = new Map();
let pressed = null;

stage.addEventListener("pointerdown", (event) => {
  if (event.target.closest(".tools") || event.button > 0) return;
  stage.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, event);
  pressed = pointers.size === 1 ? { x: event.clientX, y: event.clientY, moved: false } : null;
  if (mode.press && pressed) mode.press(imagePoint(event));
});

stage.addEventListener("pointermove", (event) => {
  const last = pointers.get(event.pointerId);
  if (last && pointers.size === 2) pinch(last, event);
  else if (last && pressed) {
    pressed.moved ||= Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) > TAP_PX;
    const dx = event.clientX - last.clientX, dy = event.clientY - last.clientY;
    if (pressed.moved && mode.drag) mode.drag(dx, dy, imagePoint(event), event);
    else if (pressed.moved && zoomed.scale > 1) pan(dx, dy);
  }
  if (last) pointers.set(event.pointerId, event);
  if (pointers.size < 2 && mode.id !== "space") {
    setCursor(imagePoint(event));
    placeCross();
  }
});

for (const kind of ["pointerup", "pointercancel"]) {
  stage.addEventListener(kind, (event) => {
    if (!pointers.delete(event.pointerId)) return;
    const wasTap = kind === "pointerup" && pressed && !pressed.moved;
    pressed = null;
    if (mode.release) mode.release();
    if (wasTap && mode.tap) {
      setCursor(imagePoint(event));
      if (cursor) mode.tap(cursor.x, cursor.y);
    }
  });
}

stage.addEventListener("pointerleave", () => { if (!pointers.size) setCursor(null); });

function pan(dx, dy) {
  const { scale } = view();
  zoomed.x -= dx / scale;
  zoomed.y -= dy / scale;
  keepInside();
}

function pinch(last, event) {
  const other = [...pointers.values()].find((pointer) => pointer.pointerId !== event.pointerId);
  const distance = (a, b) => Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) || 1;
  const factor = distance(event, other) / distance(last, other);
  if (mode.wheel) mode.wheel(factor);
  else {
    const middle = imagePoint({ clientX: (event.clientX + other.clientX) / 2, clientY: (event.clientY + other.clientY) / 2 });
    zoomTo(zoomed.scale * factor, middle.x, middle.y);
    if (zoomed.scale > 1) pan((event.clientX - last.clientX) / 2, (event.clientY - last.clientY) / 2);
  }
}

stage.addEventListener("wheel", (event) => {
  const factor = Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015));
  if (mode.wheel) mode.wheel(factor);
  else if (event.ctrlKey || event.metaKey) {
    const at = imagePoint(event);
    zoomTo(zoomed.scale * factor, at.x, at.y);
  } else return;
  event.preventDefault();
}, { passive: false });

stage.addEventListener("dblclick", (event) => {
  if (event.target.closest(".tools") || mode.tap || mode.ownZoom) return;
  const at = imagePoint(event);
  zoomTo(zoomed.scale > 1 ? 1 : 3, at.x, at.y);
});

new ResizeObserver(() => { keepInside(); if (mode && mode.resized) mode.resized(); }).observe(stage);
