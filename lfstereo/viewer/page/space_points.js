// Points and surface of the scene, computed from disparity: metres, x right, y down, z away from the left camera.

const EDGE_STEP = 0.02;

// A pixel becomes a point where its neighbours lie within 2 % of its depth: others hang between near and far.
async function buildScene() {
  const colour = await pixelsOf(CONTENT.pictures.sharp);
  const depth = new Float32Array(WIDTH * HEIGHT);
  for (let i = 0; i < depth.length; i++) {
    depth[i] = VALID[i] ? metresOf(DISPARITY[i] * CONTENT.disparity.px_per_code) ?? 0 : 0;
  }
  const number = new Int32Array(WIDTH * HEIGHT).fill(-1);
  const places = [], colours = [], shades = [];
  for (let v = 0; v < HEIGHT; v++) {
    for (let u = 0; u < WIDTH; u++) {
      const i = v * WIDTH + u, z = depth[i];
      if (!(z > 0) || !smooth(depth, u, v)) continue;
      number[i] = places.length / 3;
      places.push(((u - GEOMETRY.principal_px[0]) * z) / GEOMETRY.focal_px, ((v - GEOMETRY.principal_px[1]) * z) / GEOMETRY.focal_px, z);
      colours.push(colour[4 * i], colour[4 * i + 1], colour[4 * i + 2], 255);
      const from = turboIndex(DISPARITY[i] * CONTENT.disparity.px_per_code);
      shades.push(TURBO[from], TURBO[from + 1], TURBO[from + 2], 255);
    }
  }
  const points = new Float32Array(places);
  return {
    points, count: points.length / 3, number, depth,
    colours: { image: new Uint8Array(colours), depth: new Uint8Array(shades) },
    pivot: pivotOf(points),
  };
}

function smooth(depth, u, v) {
  const z = depth[v * WIDTH + u];
  let near = z, far = z;
  for (let y = Math.max(0, v - 1); y <= Math.min(HEIGHT - 1, v + 1); y++) {
    for (let x = Math.max(0, u - 1); x <= Math.min(WIDTH - 1, u + 1); x++) {
      const other = depth[y * WIDTH + x];
      if (other > 0) { near = Math.min(near, other); far = Math.max(far, other); }
    }
  }
  return far - near <= EDGE_STEP * z;
}

// The middle of the picture at the median depth: what the orbit turns about.
function pivotOf(points) {
  const sample = [];
  for (let i = 0; i < points.length; i += 3 * 17) sample.push(points[i + 2]);
  sample.sort((a, b) => a - b);
  const z = sample.length ? sample[sample.length >> 1] : 1;
  const middle = (size, principal) => (((size - 1) / 2 - principal) * z) / GEOMETRY.focal_px;
  return [middle(WIDTH, GEOMETRY.principal_px[0]), middle(HEIGHT, GEOMETRY.principal_px[1]), z];
}

// Triangles between neighbouring points, none across a jump in depth.
function buildTriangles(scene) {
  const { number, depth } = scene, corners = [];
  const add = (a, b, c) => {
    if (number[a] < 0 || number[b] < 0 || number[c] < 0) return;
    const near = Math.min(depth[a], depth[b], depth[c]), far = Math.max(depth[a], depth[b], depth[c]);
    if (far - near <= EDGE_STEP * near) corners.push(number[a], number[b], number[c]);
  };
  for (let v = 0; v + 1 < HEIGHT; v++) {
    for (let u = 0; u + 1 < WIDTH; u++) {
      const a = v * WIDTH + u, b = a + 1, c = a + WIDTH, d = c + 1;
      const falling = number[b] < 0 || number[c] < 0 || Math.abs(depth[a] - depth[d]) < Math.abs(depth[b] - depth[c]);
      if (falling) { add(a, c, d); add(a, d, b); } else { add(a, c, b); add(b, c, d); }
    }
  }
  return new Uint32Array(corners);
}
