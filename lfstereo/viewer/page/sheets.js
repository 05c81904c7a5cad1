// Below the stage: quality figures, settings and files.

const total = (table) => Object.values(table).reduce((sum, value) => sum + value, 0);
const shortSpan = ([low, high], digits) => `${low.toFixed(digits)} – ${high.toFixed(digits)}`;

function figuresSheet() {
  const { summary, seconds, peak_gib: peak, geometry } = RECORD;
  const middle = Math.sqrt(summary.depth_m[0] * summary.depth_m[1]);
  const perPixel = (1000 * middle * middle) / (geometry.focal_px * geometry.baseline_m);
  const numbers = element("dl", { className: "numbers" },
    figure("Depth", shortSpan(summary.depth_m, 2), "m"),
    figure("Disparity", shortSpan(summary.disparity_px, 1), "px"),
    figure("Valid", (100 * summary.valid_share).toFixed(1), "%"),
    figure("Points", grouped(summary.points)),
    figure(`1 px of disparity at ${middle.toFixed(2)} m`, perPixel.toFixed(1), "mm"),
    figure("Baseline", (1000 * geometry.baseline_m).toFixed(1), "mm"),
    figure("Time", total(seconds).toFixed(1), "s"),
    figure("Peak memory", Math.max(...Object.values(peak)).toFixed(2), "GiB"));
  return sheet("Figures", "Depth and disparity from the 1st to the 99th percentile of what is valid: seen by both cameras, and sure where the network tells.", numbers, histogram());
}

// How much of the picture lies at which disparity, in the colours of the map.
function histogram() {
  const bins = 90, width = 900, height = 104, counts = new Float64Array(bins);
  for (let i = 0; i < DISPARITY.length; i++) {
    if (!VALID[i]) continue;
    const share = axisShare(DISPARITY[i] * CONTENT.disparity.px_per_code);
    if (share >= 0 && share <= 1) counts[Math.min(bins - 1, Math.floor(share * bins))]++;
  }
  const most = Math.max(...counts) || 1;
  const chart = drawing("svg", { class: "histogram", viewBox: `0 0 ${width} 130`, preserveAspectRatio: "none", role: "img", "aria-label": "Share of the picture at each distance" });
  counts.forEach((count, i) => {
    const tall = (count / most) * height, from = turboIndex(axisValue((i + 0.5) / bins));
    chart.append(drawing("rect", {
      x: (i * width) / bins + 1, width: width / bins - 2, y: height - tall, height: tall,
      fill: `rgb(${TURBO[from]} ${TURBO[from + 1]} ${TURBO[from + 2]})`,
    }));
  });
  chart.append(drawing("line", { x1: 0, x2: width, y1: height + 0.5, y2: height + 0.5, "vector-effect": "non-scaling-stroke" }));
  const ends = [AXIS.near, AXIS.far].map((value) => `${metresText(metresOf(value))} m`);
  return element("div", {}, chart, element("div", { className: "legend-ends", style: "display:flex;justify-content:space-between;font:11px/1 var(--mono);color:var(--soft);margin-top:-18px" },
    element("span", { textContent: ends[0] }), element("span", { textContent: ends[1] })));
}

function errorsSheet() {
  const head = ["", "Pixels", "Mean error", "off > 1 px", "> 2 px", "> 4 px", "Median of depth"].map((name, k) => ({ name, amount: k > 0 }));
  const rows = Object.entries(RECORD.error).map(([name, e]) => ({
    own: name.startsWith("lfstereo"),
    cells: [name, `${(e.judged_percent ?? 100).toFixed(0)} %`, `${e.mae_px.toFixed(2)} px`, ...[1, 2, 4].map((n) => `${e[`bad_${n}_percent`].toFixed(1)} %`), `${(100 * e.median_depth_error).toFixed(2)} %`],
  }));
  return sheet("Against the truth", "Every pixel that both cameras can see and whose true disparity is known, or the share of them that a line tells. Other methods ran on the rectified centre views, holes filled.", table(head, rows));
}

function timesSheet() {
  const { seconds, peak_gib: peak } = RECORD, longest = Math.max(...Object.values(seconds));
  const head = [{ name: "Stage" }, { name: "" }, { name: "Seconds", amount: true }, { name: "Peak GiB", amount: true }];
  const rows = Object.entries(seconds).map(([name, value]) => ({
    cells: [name, element("i", { className: "bar", style: `width:${(100 * value) / longest}%` }), value.toFixed(2), peak[name].toFixed(2)],
  }));
  const made = table(head, rows);
  for (const row of made.querySelectorAll("tr")) row.children[1].style.width = "46%";
  return sheet("Work", "Wall time and largest memory of each stage.", made);
}

function settingsSheet() {
  const titles = { run: "Options", inputs: "Inputs", geometry: "Rectified geometry", field: "Light field", versions: "Versions", sha256: "SHA-256" };
  const groups = Object.entries(titles).filter(([name]) => RECORD[name]).map(([name, title]) => pairs(title, RECORD[name]));
  const about = DISPARITY ? "All that is needed to make this result again; run.toml holds it in full." : "";
  return sheet("Settings", about, element("div", { className: "tables" }, ...groups));
}

function buildSheets() {
  const sheets = byId("sheets");
  if (RECORD.summary) sheets.append(figuresSheet());
  if (RECORD.error) sheets.append(errorsSheet());
  if (RECORD.seconds) sheets.append(timesSheet());
  sheets.append(settingsSheet());
  if (CONTENT.files.length) sheets.append(filesSheet());
}
