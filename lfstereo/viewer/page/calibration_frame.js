// What was seen over the frame of each camera: places of corners, and how far off they are.

const SIDE_CLASS = ["left", "right-camera"];
const [ACROSS, DOWN] = CONTENT.cells;

function frameOf(camera, side, label) {
  const [width, height] = camera.size_px;
  const frame = drawing("svg", { class: `frame ${SIDE_CLASS[side]}`, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label });
  return { frame, width, height, cell: [width / ACROSS, height / DOWN] };
}

function coverage(camera, side) {
  const { frame, width, height, cell } = frameOf(camera, side, `Corners seen by the ${camera.name} camera`);
  const seen = new Set(camera.residual_places.map(([x, y]) => Math.floor(y / cell[1]) * ACROSS + Math.floor(x / cell[0])));
  for (let k = 0; k < ACROSS * DOWN; k++) {
    if (!seen.has(k)) frame.append(drawing("rect", { class: "empty", x: (k % ACROSS) * cell[0], y: Math.floor(k / ACROSS) * cell[1], width: cell[0], height: cell[1] }));
  }
  for (const [number, shot] of SHOTS.entries()) {
    const r = width / 320;
    const dots = shot.places[side].map(([x, y]) => `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`);
    frame.append(drawing("path", { class: "places", "data-shot": number, d: dots.join("") }));
  }
  frame.append(drawing("rect", { class: "edge", width, height }));
  return captioned(frame, camera, side, `${Math.round(100 * camera.covered)} % of the frame`);
}

// Arrows of the median residual; one as long as a cell is wide stands for two standard deviations.
function residualMap(camera, side) {
  const { frame, width, height, cell } = frameOf(camera, side, `Residuals over the frame of the ${camera.name} camera`);
  const full = 2 * CONTENT.rig.sigma_px, longest = Math.min(...cell), head = 0.16 * longest;
  camera.residual_places.forEach(([x, y], k) => {
    const [dx, dy] = camera.residuals[k].map((value) => clamp(value / full, -1, 1) * longest);
    const length = Math.hypot(dx, dy), tip = [x + dx, y + dy];
    frame.append(drawing("circle", { class: "foot", cx: x, cy: y, r: width / 500 }));
    if (length < head) return;
    const wing = (angle) => {
      const towards = Math.atan2(dy, dx) + Math.PI + angle;
      return `${tip[0] + head * Math.cos(towards)} ${tip[1] + head * Math.sin(towards)}`;
    };
    frame.append(drawing("path", { class: "arrow", d: `M${x} ${y}L${tip[0]} ${tip[1]}M${wing(0.5)}L${tip[0]} ${tip[1]}L${wing(-0.5)}` }));
  });
  frame.append(drawing("rect", { class: "edge", width, height }));
  return captioned(frame, camera, side, "");
}

function captioned(frame, camera, side, words) {
  const name = camera.serial ? `${camera.name} camera, ${camera.serial}` : `${camera.name} camera`;
  return element("figure", {}, frame, element("figcaption", {},
    element("span", {}, element("i", { className: `key ${SIDE_CLASS[side]}` }), name[0].toUpperCase() + name.slice(1)),
    element("span", { textContent: words })));
}

const bothFrames = (draw) => element("div", { className: "frames" }, ...CAMERAS.map(draw));
