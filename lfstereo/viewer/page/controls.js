// Headings, switches, ranges and choices of the panel beside the picture.

function heading(title, ...text) {
  return [element("h2", { textContent: title }), ...text.map((line) => element("p", { textContent: line }))];
}

function switchControl(name, checked, change, id = "") {
  const input = element("input", { type: "checkbox", className: "switch", checked, id, onchange: () => change(input.checked) });
  input.setAttribute("role", "switch");
  return element("label", { className: "control row" }, element("span", { textContent: name }), input);
}

function rangeControl(name, settings, text, change) {
  const output = element("output", { textContent: text(settings.value) });
  const input = element("input", { type: "range", min: settings.min, max: settings.max, step: settings.step, id: settings.id || "" });
  input.value = settings.value;
  input.setAttribute("aria-label", name);
  input.addEventListener("input", () => {
    output.textContent = text(Number(input.value));
    change(Number(input.value));
  });
  const control = element("div", { className: "control" },
    element("div", { className: "name" }, element("span", { textContent: name }), output), input);
  control.set = (value) => {
    input.value = value;
    output.textContent = text(value);
  };
  return control;
}

function choiceControl(name, options, chosen, change) {
  const buttons = options.map(([value, text]) => element("button", {
    type: "button", textContent: text,
    onclick: () => { press(value); change(value); },
  }));
  const press = (value) => buttons.forEach((button, i) => button.setAttribute("aria-pressed", options[i][0] === value));
  press(chosen);
  const row = element("div", { className: "choice", role: "group" }, ...buttons);
  row.setAttribute("aria-label", name);
  return element("div", { className: "control" }, element("div", { className: "name" }, element("span", { textContent: name })), row);
}
