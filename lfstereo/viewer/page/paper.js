// What every page is made of: title, dark or light, sheets with figures and tables.

function buildTitle() {
  const title = byId("title");
  CONTENT.title.forEach((part, k) => title.append(...(k ? [element("span", { textContent: " / " })] : []), part));
  byId("lede").textContent = CONTENT.lede;
  byId("made").textContent = CONTENT.made;
}

function switchTheme() {
  const root = document.documentElement;
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark";
  try { localStorage.setItem("lfstereo-theme", root.dataset.theme); } catch { /* no storage for this page: lasts until it closes */ }
}

function recallTheme() {
  try {
    const kept = localStorage.getItem("lfstereo-theme");
    if (kept === "dark" || kept === "light") document.documentElement.dataset.theme = kept;
  } catch { /* as above */ }
}

function sheet(title, about, ...content) {
  return element("section", { className: "sheet" },
    element("h2", {}, title, ...(about ? [element("small", { textContent: about })] : [])),
    element("div", {}, ...content));
}

function figure(name, value, unit = "") {
  return element("div", {}, element("dt", { textContent: name }),
    element("dd", {}, value, ...(unit ? [" ", element("small", { textContent: unit })] : [])));
}

function table(head, rows) {
  const cell = (tag, content, k) => {
    const amount = head[k].amount ? "amount" : "";
    return element(tag, { className: amount }, content);
  };
  return element("div", { className: "scroll" }, element("table", {},
    element("thead", {}, element("tr", {}, ...head.map((column, k) => cell("th", column.name, k)))),
    element("tbody", {}, ...rows.map((row) => element("tr", { className: row.own ? "own" : "" }, ...row.cells.map((content, k) => cell("td", content, k)))))));
}

function pairs(title, values) {
  const rows = Object.entries(values).map(([name, value]) => element("tr", {},
    element("td", { textContent: name }), element("td", {}, valueText(value))));
  return element("div", {}, element("h3", { textContent: title }), element("table", {}, element("tbody", {}, ...rows)));
}

function valueText(value) {
  if (Array.isArray(value)) {
    return value.length > 4 ? `${valueText(value[0])} … ${valueText(value[value.length - 1])} (${value.length})` : value.map(valueText).join(", ");
  }
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(6)));
  if (typeof value === "string" && /^[0-9a-f]{64}$/.test(value)) return element("code", { title: value, textContent: `${value.slice(0, 12)}…` });
  return String(value);
}

function filesSheet() {
  const head = [{ name: "File" }, { name: "Holds" }, { name: "Size", amount: true }];
  const rows = CONTENT.files.map((file) => ({
    cells: [file.href === null ? file.name : element("a", { href: file.href, textContent: file.name }), file.about, file.bytes === null ? "" : sizeText(file.bytes)],
  }));
  return sheet("Files", "Beside this page.", table(head, rows));
}

byId("theme").addEventListener("click", switchTheme);
document.addEventListener("keydown", (event) => {
  const typing = event.target.closest("input, select, textarea");
  if (!typing && !event.ctrlKey && !event.metaKey && !event.altKey && event.key.toLowerCase() === "t") switchTheme();
});
recallTheme();
buildTitle();
