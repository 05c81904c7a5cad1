// Draws points or surface with WebGL2; null where there is none, or only one that is slower than the canvas.

const VERTEX_SHADER = `#version 300 es
in vec3 place; in vec4 colour; out vec4 shade;
uniform mat3 turn; uniform vec3 pivot; uniform vec4 lens; uniform vec2 pan; uniform float size;
void main() {
  vec3 p = turn * (place - pivot);
  float depth = p.z + lens.z;
  float near = 0.02 * lens.z, far = 12.0 * lens.z;
  gl_Position = vec4(lens.x * p.x + pan.x * depth, -lens.y * p.y - pan.y * depth, (far + near - 2.0 * near * far / depth) / (far - near) * depth, depth);
  gl_PointSize = max(1.0, size / depth);
  shade = colour;
}`;
const FRAGMENT_SHADER = `#version 300 es
precision mediump float;
in vec4 shade; out vec4 result; uniform bool round;
void main() {
  if (round && dot(gl_PointCoord - 0.5, gl_PointCoord - 0.5) > 0.25) discard;
  result = shade;
}`;

// Whether a graphics processor does the work: asked of another canvas, since a canvas keeps its first context.
function webglIsFast() {
  const gl = offscreen(1, 1).getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (!gl) return false;
  const hidden = /^WebKit/.test(gl.getParameter(gl.RENDERER)) && gl.getExtension("WEBGL_debug_renderer_info");
  const name = gl.getParameter(hidden ? hidden.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  return !/swiftshader|llvmpipe|software|basic render/i.test(name);
}

function webglRenderer(canvas, scene, evenIfSlow) {
  if (!evenIfSlow && !webglIsFast()) return null;
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, preserveDrawingBuffer: true });
  if (!gl) return null;
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
  gl.useProgram(program);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const attribute = (name, data, size, type, normalised) => {
    const buffer = gl.createBuffer(), at = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(at);
    const use = () => { gl.bindBuffer(gl.ARRAY_BUFFER, buffer); gl.vertexAttribPointer(at, size, type, normalised, 0, 0); };
    use();
    return use;
  };
  attribute("place", scene.points, 3, gl.FLOAT, false);
  const useColours = {
    depth: attribute("colour", scene.colours.depth, 4, gl.UNSIGNED_BYTE, true),
    image: attribute("colour", scene.colours.image, 4, gl.UNSIGNED_BYTE, true),
  };
  let corners = 0;
  gl.enable(gl.DEPTH_TEST);
  gl.clearColor(0.047, 0.051, 0.051, 1);

  return {
    name: "Drawn with WebGL2.",
    surface: true,
    draw(orbit, look) {
      const ratio = Math.min(2, window.devicePixelRatio || 1);
      const width = Math.round(stage.clientWidth * ratio), height = Math.round(stage.clientHeight * ratio);
      if (canvas.width !== width || canvas.height !== height) {
        canvas.width = width;
        canvas.height = height;
      }
      const back = orbit.distance * scene.pivot[2], focal = (GEOMETRY.focal_px * width) / WIDTH;
      gl.viewport(0, 0, width, height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix3fv(uniform("turn"), true, orbitRows(orbit).flat());
      gl.uniform3fv(uniform("pivot"), scene.pivot);
      gl.uniform4f(uniform("lens"), (2 * focal) / width, (2 * focal) / height, back, 0);
      gl.uniform2f(uniform("pan"), 2 * orbit.panX, (2 * orbit.panY * width) / height);
      gl.uniform1f(uniform("size"), (look.size * width * scene.pivot[2]) / WIDTH);
      gl.uniform1i(uniform("round"), look.form === "points" ? 1 : 0);
      useColours[look.colour]();
      if (look.form === "points") gl.drawArrays(gl.POINTS, 0, scene.count);
      else {
        if (!corners) {
          const triangles = buildTriangles(scene);
          gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
          gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
          corners = triangles.length;
        }
        gl.drawElements(gl.TRIANGLES, corners, gl.UNSIGNED_INT, 0);
      }
    },
  };
}
