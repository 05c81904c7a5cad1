// The distance scale under the stage, like the one on a lens barrel, and the readings below it.

const focusInput = byId("focus-scale");
const needle = byId("needle");

function buildScale() {
  if (!AXIS) {
    byId("scale").hidden = true;
    return;
  }
  focusInput.min = 0;
  focusInput.max = 1;
  focusInput.step = "any";
  const rail = byId("rail").getContext("2d"), row = rail.createImageData(256, 1);
  for (let i = 0; i < 256; i++) {
    const from = AXIS.metric ? 3 * (255 - i) : -1;
    for (let c = 0; c < 3; c++) row.data[4 * i + c] = from < 0 ? 128 : TURBO[from + c];
    row.data[4 * i + 3] = 255;
  }
  rail.putImageData(row, 0, 0);
  drawTicks();
  new ResizeObserver(drawTicks).observe(byId("scale"));
}

function drawTicks() {
  const upper = byId("ticks-upper"), lower = byId("ticks-lower"), room = upper.clientWidth;
  const unit = (text) => element("span", { className: "unit", textContent: text, style: "left:100%;transform:translateX(-100%)" });
  const places = (marks, gap) => {
    let free = -Infinity;
    return marks.filter(({ share }) => {
      const at = share * room;
      if (share < -0.001 || share > 1.001 || at < free || at > room - 30) return false;
      free = at + gap;
      return true;
    });
  };
  const spans = (marks) => marks.map(({ share, text }) => element("span", { textContent: text, style: `left:${100 * share}%` }));
  const low = Math.min(AXIS.near, AXIS.far), high = Math.max(AXIS.near, AXIS.far);
  const plain = roundTicks(low, high, clamp(Math.round(room / 70), 2, 11))
    .map((value) => ({ share: axisShare(value), text: String(value).replace("-", "−") }))
    .sort((a, b) => a.share - b.share);
  lower.replaceChildren(...spans(places(plain, 34)), unit(AXIS.unit));
  if (!AXIS.metric) {
    upper.replaceChildren(
      element("span", { className: "unit", textContent: "near", style: "left:0;transform:none" }), unit("far"));
    return;
  }
  const near = metresOf(AXIS.near), far = metresOf(AXIS.far) ?? 50 * near;
  const steps = new Set(roundTicks(near, Math.min(far, 60 * near), clamp(Math.round(room / 60), 3, 12)));
  for (const step of [1, 1.5, 2, 3, 5, 10, 20, 50]) if (step > near && step < far) steps.add(step);
  const metric = [...steps].sort((a, b) => a - b).map((metres) => {
    const disparity = (GEOMETRY.focal_px * GEOMETRY.baseline_m) / metres - GEOMETRY.doffs_px;
    return { share: axisShare(disparity), text: String(metres) };
  });
  upper.replaceChildren(...spans(places(metric, 38)), unit("m"));
}

function placeNeedle(value) {
  needle.classList.toggle("shown", value !== null && Boolean(AXIS));
  if (value === null || !AXIS) return;
  const share = clamp(axisShare(value), 0, 1);
  needle.style.left = `calc(8px + ${share} * (100% - 16px))`;
}

// Readings of the pixel under the cursor.
const READINGS = [
  { name: "Column, row", of: (at) => `${at.x},\u2002${at.y}`, unit: "px" },
  { name: "Disparity", of: (at) => disparityAt(at.x, at.y).toFixed(2), unit: "px", shown: Boolean(DISPARITY), id: "disparity" },
  { name: "Depth", of: (at) => metresText(metresOf(disparityAt(at.x, at.y))), unit: "m", shown: Boolean(DISPARITY), id: "depth" },
  { name: "Slope", of: (at) => slopeAt(at.x, at.y).toFixed(3).replace("-", "−"), unit: "px per view", shown: Boolean(SLOPES), id: "slope" },
  ...OVERLAYS.map((overlay) => ({
    name: overlay.name, of: (at) => overlayAt(overlay, at.x, at.y)?.toFixed(2) ?? "—", unit: "px", id: overlay.id, optional: true,
  })),
  { name: "Valid", of: (at) => (isValid(at.x, at.y) ? "yes" : "no"), unit: "", shown: Boolean(DISPARITY), id: "valid", optional: true },
].filter((reading) => reading.shown !== false);

function buildReadout() {
  byId("readout").style.gridTemplateColumns = window.innerWidth > 600 ? `repeat(${READINGS.length}, minmax(0, 1fr))` : "";
  byId("readout").replaceChildren(...READINGS.map((reading) => {
    reading.target = element("dd", { className: "none", textContent: "—", id: reading.id ? `reading-${reading.id}` : "" });
    return element("div", { className: reading.optional ? "optional" : "" }, element("dt", { textContent: reading.name }), reading.target);
  }));
  showReadout();
}

function showReadout() {
  for (const reading of READINGS) {
    const text = cursor ? reading.of(cursor) : "—";
    reading.target.className = text === "—" ? "none" : "";
    reading.target.replaceChildren(text, ...(text === "—" || !reading.unit ? [] : [" ", element("small", { textContent: reading.unit })]));
  }
  placeNeedle(cursor ? disparityAt(cursor.x, cursor.y) ?? slopeAt(cursor.x, cursor.y) : null);
}
