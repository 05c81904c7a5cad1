// The arrays in the content of a result or light field, and what is computed from them.

const [HEIGHT, WIDTH] = CONTENT.size;
const GEOMETRY = CONTENT.geometry;
const TURBO = bytesOf(CONTENT.turbo);

const DISPARITY = CONTENT.disparity && new Uint16Array(bytesOf(CONTENT.disparity.values).buffer);
const VALID = CONTENT.disparity && unpacked(bytesOf(CONTENT.disparity.valid), WIDTH * HEIGHT);
const OVERLAYS = CONTENT.overlays.map((overlay) => ({ ...overlay, codes: bytesOf(overlay.values) }));

function unpacked(bytes, count) {
  const bits = new Uint8Array(count);
  for (let i = 0; i < count; i++) bits[i] = (bytes[i >> 3] >> (7 - (i & 7))) & 1;
  return bits;
}

function disparityAt(x, y) {
  return DISPARITY ? DISPARITY[y * WIDTH + x] * CONTENT.disparity.px_per_code : null;
}

// Slope in focus at a pixel of a single light field, px per view.
const SLOPES = CONTENT.slopes && new Uint16Array(bytesOf(CONTENT.slopes.values).buffer);

function slopeAt(x, y) {
  return SLOPES ? CONTENT.slopes.lowest + SLOPES[y * WIDTH + x] * CONTENT.slopes.slope_per_code : null;
}

const isValid = (x, y) => Boolean(VALID && VALID[y * WIDTH + x]);

function metresOf(disparity) {
  if (!GEOMETRY || disparity === null) return null;
  const shift = disparity + GEOMETRY.doffs_px;
  return shift > 0 ? (GEOMETRY.focal_px * GEOMETRY.baseline_m) / shift : null;
}

// Px that an overlay tells of a pixel, or null where it has no answer.
function overlayAt(overlay, x, y) {
  const code = overlay.codes[y * WIDTH + x];
  return code === 255 ? null : code * overlay.px_per_code;
}

// Pictures are decoded when first asked for and kept.
const decoded = new Map();

function picture(source, whenReady) {
  let entry = decoded.get(source);
  if (!entry) {
    const image = new Image();
    entry = { image, ready: false };
    decoded.set(source, entry);
    image.src = source;
    entry.promise = image.decode().then(() => { entry.ready = true; return image; });
  }
  if (!entry.ready && whenReady) entry.promise.then(whenReady);
  return entry.ready ? entry.image : null;
}

async function pixelsOf(source) {
  picture(source);
  const image = await decoded.get(source).promise;
  const canvas = offscreen(WIDTH, HEIGHT);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, WIDTH, HEIGHT).data;
}

const turboIndex = (disparity) =>
  3 * Math.round(255 * clamp((disparity - AXIS.far) / (AXIS.near - AXIS.far), 0, 1));

// The focus scale runs from near to far: over disparity where depth is known, over slope otherwise.
const AXIS = CONTENT.axis;
const SLICES = CONTENT.slices;

const axisShare = (value) => (AXIS.near - value) / (AXIS.near - AXIS.far);
const axisValue = (share) => AXIS.near + share * (AXIS.far - AXIS.near);
