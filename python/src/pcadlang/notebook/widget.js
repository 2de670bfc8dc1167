// A mesh that is turned by dragging (or the arrow keys) and zoomed by the wheel; a double click resets it.
// Plain WebGL 2: nothing is loaded from elsewhere.

const VERTEX = `#version 300 es
uniform mat3 turn; uniform vec3 middle; uniform float size, zoom, aspect;
in vec3 position, normal; out vec3 n;
void main() {
  vec3 p = turn * (position - middle) / size;
  n = turn * normal;
  // The eye is at distance 4; the mesh is within 1 of its middle.
  float z = 4.0 - p.z;
  gl_Position = vec4(p.x * zoom * 3.6 / max(aspect, 1.0), p.y * zoom * 3.6 * min(aspect, 1.0),
                     (z - 4.0) * z / 8.0, z);
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
in vec3 n; out vec4 colour;
void main() {
  vec3 m = normalize(n);
  if (!gl_FrontFacing) m = -m;
  float key = max(dot(m, normalize(vec3(-0.5, 0.7, 0.8))), 0.0);
  float fill = max(dot(m, normalize(vec3(0.8, -0.2, 0.5))), 0.0);
  vec3 base = gl_FrontFacing ? vec3(0.80, 0.66, 0.50) : vec3(0.50, 0.55, 0.62);
  colour = vec4(base * (0.25 + 0.75 * key + 0.2 * fill), 1.0);
}`;

const CREASE = Math.cos((40 * Math.PI) / 180);

// Bytes from Python may lie at any offset of their buffer; typed arrays need multiples of four.
function numbers(view, type) {
  return new type(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
}

// Three corners a triangle, with normals that are smooth except at creases.
function corners(vertices, triangles) {
  const count = triangles.length / 3;
  const faces = new Float32Array(3 * count); // longer for larger triangles
  for (let f = 0; f < count; f++) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * triangles[3 * f + k]);
    const u = [0, 1, 2].map((i) => vertices[b + i] - vertices[a + i]);
    const v = [0, 1, 2].map((i) => vertices[c + i] - vertices[a + i]);
    faces.set([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], 3 * f);
  }
  const length = Float32Array.from({ length: count }, (_, f) => Math.hypot(...faces.subarray(3 * f, 3 * f + 3)));
  // The faces at each vertex: those of vertex v are at[from[v]] to at[from[v + 1] - 1].
  const from = new Uint32Array(vertices.length / 3 + 1);
  for (const v of triangles) from[v + 1]++;
  for (let v = 1; v < from.length; v++) from[v] += from[v - 1];
  const next = from.slice();
  const at = new Uint32Array(triangles.length);
  triangles.forEach((v, corner) => (at[next[v]++] = Math.floor(corner / 3)));

  const out = new Float32Array(6 * triangles.length);
  triangles.forEach((v, corner) => {
    const f = Math.floor(corner / 3);
    let [x, y, z] = [0, 0, 0];
    for (let i = from[v]; i < from[v + 1]; i++) {
      const g = at[i];
      const dot = faces[3 * f] * faces[3 * g] + faces[3 * f + 1] * faces[3 * g + 1] + faces[3 * f + 2] * faces[3 * g + 2];
      if (g !== f && dot < CREASE * length[f] * length[g]) continue;
      x += faces[3 * g];
      y += faces[3 * g + 1];
      z += faces[3 * g + 2];
    }
    out.set([vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2], x, y, z], 6 * corner);
  });
  return out;
}

function bounds(vertices) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  vertices.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  const middle = low.map((x, i) => (x + high[i]) / 2);
  return { middle, size: Math.hypot(...low.map((x, i) => (high[i] - x) / 2)) || 1 };
}

function compiled(gl) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}

function render({ model, el }) {
  const canvas = document.createElement("canvas");
  canvas.style.cssText = "width:100%;max-width:480px;height:360px;display:block;cursor:grab;touch-action:none";
  canvas.tabIndex = 0;
  canvas.setAttribute("aria-label", "A solid. Drag or use the arrow keys to turn it, the wheel to zoom.");
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) {
    const image = document.createElement("img");
    image.src = URL.createObjectURL(new Blob([model.get("picture")], { type: "image/png" }));
    el.append(image);
    return () => URL.revokeObjectURL(image.src);
  }
  el.append(canvas);
  const program = compiled(gl);
  const buffer = gl.createBuffer();
  const start = { yaw: 0.5, pitch: 0.25, zoom: 1 };
  const state = { ...start, count: 0, middle: [0, 0, 0], size: 1 };

  function load() {
    const vertices = numbers(model.get("vertices"), Float32Array);
    const drawn = corners(vertices, numbers(model.get("triangles"), Uint32Array));
    Object.assign(state, bounds(vertices), { count: drawn.length / 6 });
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, drawn, gl.STATIC_DRAW);
    later();
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    const uniform = (name) => gl.getUniformLocation(program, name);
    const [cy, sy, cp, sp] = [Math.cos(state.yaw), Math.sin(state.yaw), Math.cos(state.pitch), Math.sin(state.pitch)];
    // About the vertical axis, then about the horizontal one; columns.
    gl.uniformMatrix3fv(uniform("turn"), false, [cy, sp * sy, -cp * sy, 0, cp, sp, sy, -sp * cy, cp * cy]);
    gl.uniform3fv(uniform("middle"), state.middle);
    gl.uniform1f(uniform("size"), state.size);
    gl.uniform1f(uniform("zoom"), state.zoom);
    gl.uniform1f(uniform("aspect"), canvas.width / canvas.height);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    ["position", "normal"].forEach((name, i) => {
      const place = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 24, 12 * i);
    });
    gl.drawArrays(gl.TRIANGLES, 0, state.count);
  }

  let due = 0;
  function later() {
    due ||= requestAnimationFrame(() => {
      due = 0;
      draw();
    });
  }
  function turn(yaw, pitch) {
    state.yaw += yaw;
    state.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, state.pitch + pitch));
    later();
  }

  canvas.addEventListener("pointerdown", (e) => canvas.setPointerCapture(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    if (canvas.hasPointerCapture(e.pointerId)) turn(0.01 * e.movementX, 0.01 * e.movementY);
  });
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    state.zoom = Math.max(0.3, Math.min(10, state.zoom * Math.exp(-0.001 * e.deltaY)));
    later();
  }, { passive: false });
  canvas.addEventListener("dblclick", () => {
    Object.assign(state, start);
    later();
  });
  canvas.addEventListener("keydown", (e) => {
    const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[e.key];
    if (!by) return;
    e.preventDefault();
    e.stopPropagation();
    turn(...by);
  });
  const resized = new ResizeObserver(later);
  resized.observe(canvas);
  // Both parts of a mesh change together.
  model.on("change:vertices", load);
  load();
  return () => {
    resized.disconnect();
    model.off("change:vertices", load);
    gl.getExtension("WEBGL_lose_context")?.loseContext();
  };
}

export default { render };
