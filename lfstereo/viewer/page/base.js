// Small helpers that every other part uses.

const byId = (id) => document.getElementById(id);

// What the page shows, as it was written into it.
const CONTENT = JSON.parse(byId("content").textContent);
const RECORD = CONTENT.record;

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name in made && name !== "list" && name !== "form") made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

const SVG = "http://www.w3.org/2000/svg";

function drawing(tag, attributes = {}, text = "") {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text) made.textContent = text;
  return made;
}

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

function metresText(metres) {
  if (metres === null || !Number.isFinite(metres)) return "—";
  return metres < 10 ? metres.toFixed(3) : metres < 100 ? metres.toFixed(2) : metres.toFixed(0);
}

function sizeText(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  const unit = bytes < 999500 ? [1e3, "kB"] : [1e6, "MB"];
  const value = bytes / unit[0];
  return `${value < 10 ? value.toFixed(1) : value.toFixed(0)} ${unit[1]}`;
}

const grouped = (count) => String(Math.round(count)).replace(/\B(?=(\d{3})+$)/g, "\u2009");

// Round numbers (1, 2 or 5 times a power of ten apart) inside a range, at most as many as wanted.
function roundTicks(low, high, most) {
  const power = 10 ** Math.floor(Math.log10((high - low) / most));
  for (const factor of [1, 2, 5, 10, 20]) {
    const step = power * factor;
    const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
    if (last - first < most) {
      return Array.from({ length: last - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(12)));
    }
  }
  return [];
}

function offscreen(width, height) {
  return element("canvas", { width, height });
}

// Calls of the returned function are gathered into one per drawn frame.
function oncePerFrame(work) {
  let waiting = false;
  return () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; work(); });
  };
}

// Rows of the rotation of an orbit: a turn about the vertical, then a nod.
function orbitRows(orbit) {
  const cy = Math.cos(orbit.yaw), sy = Math.sin(orbit.yaw), cp = Math.cos(orbit.pitch), sp = Math.sin(orbit.pitch);
  return [[cy, 0, sy], [sp * sy, cp, -sp * cy], [-cp * sy, sp, cp * cy]];
}
