// Puts the page of a calibration together, and keeps one shot chosen in all its parts.

const RIG = CONTENT.rig;
const worst = SHOTS.reduce((k, shot, n) => (Math.max(...shot.rms_px) > Math.max(...SHOTS[k].rms_px) ? n : k), 0);
let chosen = worst;

const signed = (value, digits) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)}`;
// As many digits as the standard deviation allows to tell apart.
const digitsFor = (sd) => clamp(1 - Math.floor(Math.log10(sd || 1e-4)), 1, 5);

const rmsText = (value) => value.toFixed(RIG.sigma_px < 0.1 ? 3 : 2);

function told(name, ...value) {
  return element("div", { className: "control" }, element("div", { className: "name" }, element("span", { textContent: name }), element("output", {}, ...value)));
}

function showRig() {
  const mm = 1000, digits = digitsFor(mm * RIG.baseline_sd_m), turns = digitsFor(Math.max(...RIG.rotation_sd_deg));
  byId("panel").replaceChildren(
    ...heading("Baseline"),
    element("div", { className: "big" }, (mm * RIG.baseline_m).toFixed(digits), " ", element("small", { textContent: "mm" }),
      element("span", { className: "under", textContent: `± ${(mm * RIG.baseline_sd_m).toFixed(digits)} mm, one standard deviation` })),
    element("p", { textContent: `The right camera is turned by ${RIG.turn_deg.toFixed(2)}° against the left one.` }),
    ...["x, right", "y, down", "z, forward"].map((axis, k) =>
      told(`Turn about ${axis}`, `${signed(RIG.rotation_deg[k], turns)}° ± ${RIG.rotation_sd_deg[k].toFixed(turns)}`)),
    told("Residual", `${RIG.sigma_px.toFixed(3)} sensor px`),
    told("Working range", `${metresText(RIG.near_m)} – ${metresText(RIG.far_m)} m`),
    ...CAMERAS.map((camera, side) => told(`${camera.name[0].toUpperCase()}${camera.name.slice(1)} camera`, element("i", { className: `key ${SIDE_CLASS[side]}` }), camera.serial || "any")),
    element("p", { className: "note", textContent: "Drag the picture to orbit, click a board to choose its shot." }));
}

function showShot() {
  const shot = SHOTS[chosen];
  const reading = (name, value, unit) => element("div", {}, element("dt", { textContent: name }),
    element("dd", {}, value, ...(unit ? [" ", element("small", { textContent: unit })] : [])));
  byId("readout").replaceChildren(
    reading("Shot", shot.name, chosen === worst ? "worst" : ""), reading("Left", rmsText(shot.rms_px[0]), "px"), reading("Right", rmsText(shot.rms_px[1]), "px"),
    reading("Distance", metresText(shot.distance_m), "m"), reading("Tilt", shot.tilt_deg.toFixed(0), "°"));
  for (const row of document.querySelectorAll(".shots tbody tr")) row.setAttribute("aria-current", row.dataset.shot === String(chosen));
  for (const places of document.querySelectorAll(".places")) places.classList.toggle("chosen", places.dataset.shot === String(chosen));
}

function choose(number) {
  chosen = clamp(number, 0, SHOTS.length - 1);
  showShot();
  paintSpace();
}

function shotsSheet() {
  const most = Math.max(...SHOTS.flatMap((shot) => shot.rms_px));
  const bar = (value, side) => element("i", { className: `bar ${SIDE_CLASS[side]}`, style: `width:${(100 * value) / most}%` });
  const head = [{ name: "Shot" }, { name: "" }, ...["Left, px", "Right, px", "Corners", "Distance, m", "Tilt, °"].map((name) => ({ name, amount: true }))];
  const made = table(head, SHOTS.map((shot, k) => ({ cells: [
    element("span", {}, shot.name, ...(k === worst ? [element("small", { textContent: "worst" })] : [])),
    element("div", {}, ...shot.rms_px.map(bar)), ...shot.rms_px.map(rmsText),
    shot.corners.join(" / "), metresText(shot.distance_m), shot.tilt_deg.toFixed(0)] })));
  made.classList.add("shots");
  [...made.querySelectorAll("tbody tr")].forEach((row, k) => {
    row.tabIndex = 0;
    row.dataset.shot = k;
    row.children[1].className = "bars";
    row.addEventListener("click", () => choose(k));
    row.addEventListener("focus", () => choose(k));
  });
  return sheet("Shots", "Root mean square of the residuals over all corners and views, sensor px. A shot far above the others was shaken, or its board was not flat; --drop leaves it out.", made);
}

function lensesSheet() {
  const blocks = CAMERAS.map((camera) => pairs(`${camera.name} camera`, camera.settings));
  const told = CAMERAS.filter((camera) => camera.lens);
  const head = [{ name: "Lens" }, { name: "" }, { name: "Found", amount: true }, { name: "Metadata", amount: true }];
  const rows = told.flatMap((camera) => Object.entries(camera.lens).map(([name, [found, written]]) => ({ cells: [camera.name, name, found.toFixed(2), written.toFixed(2)] })));
  return sheet("Cameras", "As rig.toml has them, lengths in px of the raw sensor unless they say otherwise.", element("div", { className: "tables" }, ...blocks), ...(rows.length ? [table(head, rows)] : []));
}

function buildCalibration() {
  byId("sheets").append(shotsSheet(),
    sheet("Coverage", "Corners in the centre view of every shot, those of the chosen one dark. Where a square is shaded no corner was seen: photograph the board there.", bothFrames(coverage)),
    sheet("Residuals", `Median over all shots and views; an arrow as long as a square is high stands for ${(2 * RIG.sigma_px).toFixed(2)} sensor px. A pattern, instead of disorder, is a lens that the model does not follow.`, bothFrames(residualMap)),
    lensesSheet());
  if (CONTENT.left_out.length) {
    byId("sheets").append(sheet("Left out", "Shots that the rig was not made from.", table([{ name: "Shot" }, { name: "Why" }], CONTENT.left_out.map((cells) => ({ cells })))));
  }
  byId("sheets").append(filesSheet());
}

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !",.".includes(event.key)) return;
  choose(chosen + (event.key === "." ? 1 : -1));
});

showRig();
buildCalibration();
choose(worst);
document.documentElement.dataset.ready = "yes";
