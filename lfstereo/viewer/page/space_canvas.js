// Draws the points without WebGL: every point a square, nearest wins; a frame of 200 000 points takes some 10 ms.

function canvasRenderer(canvas, scene) {
  const context = canvas.getContext("2d", { alpha: false });
  let pixels = null, target = null, nearest = null;
  const words = Object.fromEntries(Object.entries(scene.colours).map(([name, bytes]) => [name, new Uint32Array(bytes.buffer)]));

  function fit(width, height) {
    if (pixels && canvas.width === width && canvas.height === height) return;
    canvas.width = width;
    canvas.height = height;
    pixels = context.createImageData(width, height);
    target = new Uint32Array(pixels.data.buffer);
    nearest = new Float32Array(width * height);
  }

  return {
    name: "Drawn on a canvas, without WebGL.",
    surface: false,
    draw(orbit, look) {
      const width = Math.round(stage.clientWidth), height = Math.round(stage.clientHeight);
      fit(width, height);
      target.fill(0xff0d0d0c);
      nearest.fill(Infinity);
      const [r0, r1, r2] = orbitRows(orbit), [px, py, pz] = scene.pivot, { points, count } = scene;
      const focal = (GEOMETRY.focal_px * width) / WIDTH, back = orbit.distance * pz;
      const middleX = width / 2 + orbit.panX * width, middleY = height / 2 + orbit.panY * width;
      const colours = words[look.colour], footprint = (look.size * width * pz) / WIDTH;
      for (let i = 0, k = 0; i < count; i++, k += 3) {
        const x = points[k] - px, y = points[k + 1] - py, z = points[k + 2] - pz;
        const depth = r2[0] * x + r2[1] * y + r2[2] * z + back;
        if (depth < 0.02) continue;
        const scale = focal / depth;
        const size = Math.max(1, Math.min(24, Math.round(footprint / depth)));
        const left = Math.round((r0[0] * x + r0[2] * z) * scale + middleX - size / 2);
        const top = Math.round((r1[0] * x + r1[1] * y + r1[2] * z) * scale + middleY - size / 2);
        if (left < 0 || top < 0 || left + size > width || top + size > height) continue;
        const colour = colours[i];
        for (let row = top; row < top + size; row++) {
          for (let at = row * width + left, end = at + size; at < end; at++) {
            if (depth < nearest[at]) { nearest[at] = depth; target[at] = colour; }
          }
        }
      }
      context.putImageData(pixels, 0, 0);
    },
  };
}
