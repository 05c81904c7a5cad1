// The pairs of a batch: sorted by any column, searched, sieved by how they ended.

const PAIRS = CONTENT.pairs;
const STATES = [["", "All"], ["done", "Done"], ["failed", "Failed"], ["not done", "Not done"]]
  .map(([state, name]) => ({ state, name, count: PAIRS.filter((pair) => !state || pair.state === state).length }))
  .filter(({ state, count }) => !state || count);
const shown = { state: "", words: "", by: null, falling: false };

const COLUMNS = [
  { head: "pair", of: (pair) => pair.name, text: true },
  { head: "all in focus, disparity" },
  { head: "seconds", of: (pair) => pair.seconds, show: (value) => value.toFixed(1) },
  { head: "peak GiB", of: (pair) => pair.peak_gib, show: (value) => value.toFixed(2) },
  ...CONTENT.columns.map(({ head, factor, digits }, k) => ({
    head, of: (pair) => pair.figures && pair.figures[k], show: (value) => (factor * value).toFixed(digits),
  })),
];

function middle(values) {
  const sorted = values.filter((value) => value !== null && value !== undefined).sort((a, b) => a - b);
  return sorted.length ? (sorted[(sorted.length - 1) >> 1] + sorted[sorted.length >> 1]) / 2 : null;
}

function showNumbers() {
  const done = PAIRS.filter((pair) => pair.state === "done");
  const of = (name) => middle(done.map((pair) => pair.figures[CONTENT.columns.findIndex((column) => column.name === name)]));
  const medians = [["valid_share", "Valid, median", (v) => [(100 * v).toFixed(1), "%"]], ["mae_px", "Mean error, median", (v) => [v.toFixed(2), "px"]],
    ["depth_low_m", "Nearest, median", (v) => [v.toFixed(2), "m"]], ["depth_high_m", "Farthest, median", (v) => [v.toFixed(2), "m"]]];
  byId("numbers").append(
    figure("Done", `${done.length} of ${PAIRS.length}`),
    ...(done.length ? [
      figure("A pair, median", middle(done.map((pair) => pair.seconds)).toFixed(1), "s"),
      figure("Largest memory", Math.max(...done.map((pair) => pair.peak_gib)).toFixed(2), "GiB"),
      ...medians.map(([name, title, words]) => (of(name) === null ? null : figure(title, ...words(of(name))))).filter(Boolean),
    ] : []));
}

function wanted() {
  const words = shown.words.toLowerCase();
  const told = (pair) => [pair.name, pair.reason, ...(pair.warnings || [])].join(" ").toLowerCase();
  const found = PAIRS.filter((pair) => (!shown.state || pair.state === shown.state) && told(pair).includes(words));
  if (!shown.by) return found;
  const turn = shown.falling ? -1 : 1;
  const value = (pair) => shown.by.of(pair) ?? null;
  return found.sort((a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === null || y === null) return (x === null) - (y === null);
    return turn * (shown.by.text ? x.localeCompare(y, undefined, { numeric: true }) : x - y);
  });
}

function sortBy(column) {
  shown.falling = shown.by === column ? !shown.falling : false;
  shown.by = column;
  showPairs();
  [...byId("pairs").querySelectorAll("th button")].find((button) => button.textContent === column.head).focus();
}

function headOf(column) {
  const cell = element("th", { className: column.show ? "amount" : "" },
    column.of ? element("button", { type: "button", textContent: column.head, onclick: () => sortBy(column) }) : column.head);
  if (shown.by === column) cell.setAttribute("aria-sort", shown.falling ? "descending" : "ascending");
  return cell;
}

function rowOf(pair) {
  if (pair.state !== "done") {
    const failed = pair.state === "failed";
    return element("tr", {}, element("td", { textContent: pair.name }),
      element("td", { colSpan: COLUMNS.length - 1, className: failed ? "failed" : "waiting", textContent: failed ? pair.reason : "not done" }));
  }
  const name = element("td", {}, element("a", { href: pair.page, textContent: pair.name }),
    ...pair.warnings.map((warning) => element("span", { className: "warning", textContent: warning })));
  const small = element("a", { href: pair.page, tabIndex: -1 }, element("img", { src: pair.picture, alt: `All in focus and disparity of ${pair.name}`, loading: "lazy" }));
  return element("tr", {}, name, element("td", {}, small), ...COLUMNS.slice(2).map((column) => {
    const value = column.of(pair);
    return element("td", { className: "amount", textContent: value === null || value === undefined ? "" : column.show(value) });
  }));
}

function showPairs() {
  const rows = wanted().map(rowOf);
  const nothing = element("tr", {}, element("td", { className: "nothing", colSpan: COLUMNS.length, textContent: "No pair fits." }));
  byId("pairs").replaceChildren(element("table", {},
    element("thead", {}, element("tr", {}, ...COLUMNS.map(headOf))), element("tbody", {}, ...(rows.length ? rows : [nothing]))));
  for (const button of byId("states").children) button.setAttribute("aria-pressed", button.dataset.state === shown.state);
}

byId("states").append(...STATES.map(({ state, name, count }) => {
  const button = element("button", { type: "button", onclick: () => { shown.state = state; showPairs(); } }, name, element("small", { textContent: count }));
  button.dataset.state = state;
  return button;
}));
byId("search").addEventListener("input", () => { shown.words = byId("search").value; showPairs(); });
document.addEventListener("keydown", (event) => {
  if (event.key !== "/" || event.target === byId("search")) return;
  event.preventDefault();
  byId("search").focus();
});

showNumbers();
showPairs();
if (CONTENT.left_out.length) {
  const head = ["What", "Captures", "Why"].map((name) => ({ name }));
  byId("sheets").append(sheet("In no pair", "Captures that were left over.", table(head, CONTENT.left_out.map((cells) => ({ cells })))));
}
byId("sheets").append(filesSheet());
document.documentElement.dataset.ready = "yes";
