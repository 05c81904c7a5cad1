// Boards and cameras in space: drag to orbit, scroll or pinch to come nearer, click a board to choose its shot.

const SHOTS = CONTENT.shots;
const CAMERAS = CONTENT.cameras;
const stage = byId("stage");
const canvas = byId("space");
const START = { yaw: 0.62, pitch: 0.36, distance: 1 };
const orbit = { ...START };
const PICTURED = ["rgb(108 176 238)", "rgb(255 125 79)"];

const everything = [...SHOTS.flatMap((shot) => shot.outline), ...CAMERAS.flatMap((camera) => camera.seen)];
const bound = (choose, axis) => choose(...everything.map((place) => place[axis]));
const LOW = [0, 1, 2].map((axis) => bound(Math.min, axis)), HIGH = [0, 1, 2].map((axis) => bound(Math.max, axis));
const PIVOT = LOW.map((low, axis) => (low + HIGH[axis]) / 2);
const RADIUS = Math.hypot(...LOW.map((low, axis) => HIGH[axis] - low)) / 2;

// Places on the screen (CSS px) and distances from the eye; the eye stands three radii away.
function projected(places, fit) {
  const [r0, r1, r2] = orbitRows(orbit), back = 3 * RADIUS * orbit.distance;
  return places.map((place) => {
    const [x, y, z] = place.map((value, axis) => value - PIVOT[axis]);
    const depth = Math.max(0.05 * RADIUS, r2[0] * x + r2[1] * y + r2[2] * z + back);
    return {
      x: fit.x + (fit.scale * (r0[0] * x + r0[2] * z)) / depth,
      y: fit.y + (fit.scale * (r1[0] * x + r1[1] * y + r1[2] * z)) / depth, depth,
    };
  });
}

// The largest scale at which all stays on the stage in the first view.
function fitted() {
  const kept = { ...orbit };
  Object.assign(orbit, START);
  const seen = projected([...everything, ...floorCorners()], { x: 0, y: 0, scale: 1 });
  Object.assign(orbit, kept);
  const span = (axis) => [Math.min(...seen.map((p) => p[axis])), Math.max(...seen.map((p) => p[axis]))];
  const [left, right] = span("x"), [top, bottom] = span("y"), edge = 28;
  const scale = Math.min((stage.clientWidth - 2 * edge) / (right - left), (stage.clientHeight - 2 * edge) / (bottom - top));
  return { scale, x: stage.clientWidth / 2 - (scale * (left + right)) / 2, y: stage.clientHeight / 2 - (scale * (top + bottom)) / 2 };
}

// A floor of round squares below everything, so that distances can be read.
const [, STEP] = roundTicks(0, HIGH[2], 7);
const FLOOR = { left: Math.floor(LOW[0] / STEP) * STEP, right: Math.ceil(HIGH[0] / STEP) * STEP, near: 0, far: Math.ceil(HIGH[2] / STEP) * STEP, y: HIGH[1] + 0.04 * RADIUS };

function floorCorners() {
  return [[FLOOR.left, FLOOR.y, FLOOR.near], [FLOOR.right, FLOOR.y, FLOOR.far], [FLOOR.left, FLOOR.y, FLOOR.far], [FLOOR.right, FLOOR.y, FLOOR.near]];
}

function drawFloor(context, fit) {
  const line = (a, b) => {
    const [from, to] = projected([a, b], fit);
    context.beginPath();
    context.moveTo(from.x, from.y);
    context.lineTo(to.x, to.y);
    context.stroke();
  };
  context.lineWidth = 1;
  context.strokeStyle = "rgb(255 255 255 / .17)";
  for (let x = FLOOR.left; x < FLOOR.right + STEP / 2; x += STEP) line([x, FLOOR.y, FLOOR.near], [x, FLOOR.y, FLOOR.far]);
  context.fillStyle = "rgb(255 255 255 / .5)";
  context.font = "11px ui-monospace, 'DejaVu Sans Mono', monospace";
  for (let z = FLOOR.near; z < FLOOR.far + STEP / 2; z += STEP) {
    line([FLOOR.left, FLOOR.y, z], [FLOOR.right, FLOOR.y, z]);
    const [at] = projected([[FLOOR.right, FLOOR.y, z]], fit);
    if (z > STEP / 2) context.fillText(`${Number(z.toPrecision(3))} m`, at.x + 7, at.y + 4);
  }
}

function outlined(context, corners) {
  context.beginPath();
  corners.forEach((at, k) => (k ? context.lineTo(at.x, at.y) : context.moveTo(at.x, at.y)));
  context.closePath();
}

function drawCamera(context, camera, colour, fit) {
  const [pupil, ...corners] = projected(camera.seen, fit);
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 1.25;
  context.globalAlpha = 0.1;
  outlined(context, corners);
  context.fill();
  context.globalAlpha = 0.85;
  outlined(context, corners);
  for (const corner of corners) {
    context.moveTo(pupil.x, pupil.y);
    context.lineTo(corner.x, corner.y);
  }
  context.stroke();
  context.globalAlpha = 1;
  context.beginPath();
  context.arc(pupil.x, pupil.y, 3.5, 0, 2 * Math.PI);
  context.fill();
}

let boards = [];

const paintSpace = oncePerFrame(() => {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(stage.clientWidth * ratio);
  canvas.height = Math.round(stage.clientHeight * ratio);
  const context = canvas.getContext("2d"), fit = fitted();
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.lineJoin = "round";
  drawFloor(context, fit);
  boards = SHOTS.map((shot, number) => ({ number, corners: projected(shot.outline, fit) }))
    .sort((a, b) => Math.max(...b.corners.map((c) => c.depth)) - Math.max(...a.corners.map((c) => c.depth)));
  for (const { number, corners } of [...boards.filter((b) => b.number !== chosen), ...boards.filter((b) => b.number === chosen)]) {
    const here = number === chosen;
    outlined(context, corners);
    context.fillStyle = here ? "rgb(255 255 255 / .3)" : "rgb(255 255 255 / .045)";
    context.strokeStyle = here ? "#fff" : "rgb(255 255 255 / .38)";
    context.lineWidth = here ? 2 : 1;
    context.fill();
    context.stroke();
  }
  CAMERAS.forEach((camera, side) => drawCamera(context, camera, PICTURED[side], fit));
});

function boardAt(event) {
  const box = stage.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
  const inside = (corners) => corners.reduce((within, a, k) => {
    const b = corners[(k + 1) % corners.length];
    return (a.y > y) !== (b.y > y) && x < ((b.x - a.x) * (y - a.y)) / (b.y - a.y) + a.x ? !within : within;
  }, false);
  return [...boards].reverse().find(({ corners }) => inside(corners));
}

function turn(yaw, pitch) {
  orbit.yaw += yaw;
  orbit.pitch = clamp(orbit.pitch + pitch, -1.5, 1.5);
  paintSpace();
}

function approach(factor) {
  orbit.distance = clamp(orbit.distance / factor, 0.3, 4);
  paintSpace();
}

const held = new Map();
let moved = 0;
stage.addEventListener("pointerdown", (event) => {
  stage.setPointerCapture(event.pointerId);
  held.set(event.pointerId, event);
  moved = 0;
});
stage.addEventListener("pointermove", (event) => {
  const last = held.get(event.pointerId);
  if (!last) {
    stage.style.cursor = boardAt(event) ? "pointer" : "";
    return;
  }
  const other = [...held.values()].find((one) => one.pointerId !== event.pointerId);
  const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY) || 1;
  const dx = event.clientX - last.clientX, dy = event.clientY - last.clientY;
  moved += Math.hypot(dx, dy);
  if (other) approach(apart(event) / apart(last));
  else turn(-0.006 * dx, 0.006 * dy);
  held.set(event.pointerId, event);
});
for (const kind of ["pointerup", "pointercancel"]) {
  stage.addEventListener(kind, (event) => {
    const board = held.delete(event.pointerId) && moved < 5 && boardAt(event);
    if (board) choose(board.number);
  });
}
stage.addEventListener("wheel", (event) => {
  if (!event.ctrlKey && document.activeElement !== stage) return;
  event.preventDefault();
  approach(Math.exp(-event.deltaY * 0.0015));
}, { passive: false });
stage.addEventListener("keydown", (event) => {
  const arrow = { ArrowLeft: [-0.08, 0], ArrowRight: [0.08, 0], ArrowUp: [0, -0.08], ArrowDown: [0, 0.08] }[event.key];
  if (arrow) turn(...arrow);
  else if (event.key === "+" || event.key === "=") approach(1.2);
  else if (event.key === "-" || event.key === "−") approach(1 / 1.2);
  else return;
  event.preventDefault();
});
new ResizeObserver(paintSpace).observe(stage);
