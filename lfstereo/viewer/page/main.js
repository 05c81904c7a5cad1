// Puts the page together: title, modes, keys.

MODES.push(...[sharpMode, focusMode, viewsMode, depthMode, swipeMode, spaceMode].filter((candidate) => candidate.available));

function showPanel() {
  byId("panel").replaceChildren(...mode.panel());
}

function enterMode(id) {
  const next = modeById(id) || MODES[0];
  if (mode === next) return;
  if (mode && mode.leave) mode.leave();
  mode = next;
  for (const tab of byId("modes").children) {
    const chosen = tab.dataset.mode === mode.id;
    tab.setAttribute("aria-selected", chosen);
    tab.tabIndex = chosen ? 0 : -1;
    if (chosen) tab.scrollIntoView({ block: "nearest", inline: "nearest" });
  }
  touchRule();
  showPanel();
  if (mode.enter) mode.enter();
  history.replaceState(null, "", `#${mode.id}`);
  redraw();
}

function buildModes() {
  byId("modes").append(...MODES.map((candidate) => {
    const tab = element("button", { type: "button", role: "tab", id: `mode-${candidate.id}`, textContent: candidate.label, onclick: () => enterMode(candidate.id) });
    tab.dataset.mode = candidate.id;
    return tab;
  }));
  byId("modes").addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    const next = MODES[(MODES.indexOf(mode) + step + MODES.length) % MODES.length];
    enterMode(next.id);
    byId(`mode-${next.id}`).focus();
  });
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const typing = event.target.closest("input, select, textarea"), arrow = ARROWS[event.key];
  if (typing && (arrow || event.target.tagName !== "INPUT")) return;
  if (arrow && mode.arrow && (event.target === stage || event.target === document.body)) {
    const far = event.shiftKey ? 10 : 1;
    mode.arrow(arrow[0] * far, arrow[1] * far);
  } else if (event.key === "Enter" && event.target === stage && mode.tap && cursor) mode.tap(cursor.x, cursor.y);
  else if (/^[1-9]$/.test(event.key) && MODES[event.key - 1]) enterMode(MODES[event.key - 1].id);
  else if (event.key === "+" || event.key === "=") nearer(1.25);
  else if (event.key === "-" || event.key === "−") nearer(0.8);
  else if (event.key === "s" || event.key === "S") savePicture();
  else return;
  event.preventDefault();
});

function nearer(factor) {
  if (mode.wheel) mode.wheel(factor);
  else zoomTo(zoomed.scale * factor);
}

// What is shown, at the pixels of the result rather than those of the screen.
function savePicture() {
  let canvas = byId("space-canvas");
  if (mode !== spaceMode) {
    canvas = offscreen(WIDTH, HEIGHT);
    mode.draw(canvas.getContext("2d"));
  }
  canvas.toBlob((blob) => {
    const link = element("a", { href: URL.createObjectURL(blob), download: `${mode.fileName}.png` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

buildModes();
buildScale();
buildReadout();
buildSheets();
focusInput.hidden = true;
byId("zoom-in").addEventListener("click", () => nearer(1.5));
byId("zoom-out").addEventListener("click", () => nearer(1 / 1.5));
byId("save").addEventListener("click", savePicture);
window.addEventListener("resize", buildReadout);
window.addEventListener("hashchange", () => enterMode(location.hash.slice(1)));
if (CONTENT.live) startLive(CONTENT.live);
enterMode(location.hash.slice(1) || "sharp");
document.documentElement.dataset.ready = "yes";
