// Shows a mesh that can be turned (drag, arrow keys), enlarged (wheel, + and -) and put back (double click).
// Expects a canvas "mesh" and JSON "mesh-data": { positions: [x, y, z, ...], triangles: [i, j, k, ...] }.
(() => {
  "use strict";
  const canvas = document.getElementById("mesh");
  const { positions: P, triangles: T } = JSON.parse(document.getElementById("mesh-data").textContent);
  const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) {
    canvas.replaceWith("The mesh cannot be shown: this browser has no WebGL.");
    return;
  }

  // The middle and the radius of the ball around the mesh's box.
  const low = [1 / 0, 1 / 0, 1 / 0], high = [-1 / 0, -1 / 0, -1 / 0];
  P.forEach((x, i) => { low[i % 3] = Math.min(low[i % 3], x); high[i % 3] = Math.max(high[i % 3], x); });
  const middle = low.map((x, i) => (x + high[i]) / 2);
  const radius = Math.hypot(...low.map((x, i) => high[i] - x)) / 2 || 1;

  // A normal for each corner: the mean over faces at the same place that meet at less than 40 degrees.
  const count = T.length / 3, face = new Float32Array(T.length), around = new Map(), place = new Array(P.length / 3);
  for (let v = 0; v < place.length; v++) {
    const key = P.slice(3 * v, 3 * v + 3).join();
    if (!around.has(key)) around.set(key, []);
    place[v] = around.get(key);
  }
  for (let t = 0; t < count; t++) {
    const [a, b, c] = [0, 1, 2].map(k => 3 * T[3 * t + k]);
    const e = [0, 1, 2].map(k => P[b + k] - P[a + k]), f = [0, 1, 2].map(k => P[c + k] - P[a + k]);
    const n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    const length = Math.hypot(...n) || 1;
    for (let k = 0; k < 3; k++) {
      face[3 * t + k] = n[k] / length;
      place[T[3 * t + k]].push(t);
    }
  }
  const corners = new Float32Array(6 * T.length);
  for (let i = 0; i < T.length; i++) {
    const own = 3 * Math.floor(i / 3), n = [0, 0, 0];
    for (const t of place[T[i]]) {
      const dot = face[own] * face[3 * t] + face[own + 1] * face[3 * t + 1] + face[own + 2] * face[3 * t + 2];
      if (dot > 0.766) for (let k = 0; k < 3; k++) n[k] += face[3 * t + k];
    }
    for (let k = 0; k < 3; k++) {
      corners[6 * i + k] = (P[3 * T[i] + k] - middle[k]) / radius;
      corners[6 * i + 3 + k] = n[k] || 0;
    }
  }

  const program = gl.createProgram();
  const shader = (type, text) => {
    const s = gl.createShader(type);
    gl.shaderSource(s, text);
    gl.compileShader(s);
    gl.attachShader(program, s);
  };
  shader(gl.VERTEX_SHADER, `
    attribute vec3 at; attribute vec3 normal; uniform mat3 turn; uniform float zoom; varying vec3 n;
    void main() {
      n = turn * normal;
      vec3 p = turn * at;
      gl_Position = vec4(p.xy * zoom, -p.z * 0.3, 1.0 - 0.2 * p.z);
    }`);
  shader(gl.FRAGMENT_SHADER, `
    precision mediump float; varying vec3 n;
    void main() {
      vec3 u = length(n) > 0.0 ? normalize(n) : vec3(0.0, 0.0, 1.0);
      if (u.z < 0.0) u = -u;
      float light = 0.72 * max(dot(u, vec3(-0.45, 0.55, 0.7)), 0.0) + 0.22 * u.z + 0.06;
      gl_FragColor = vec4(mix(vec3(0.12, 0.16, 0.26), vec3(0.81, 0.91, 1.0), light), 1.0);
    }`);
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW);
  ["at", "normal"].forEach((name, i) => {
    const slot = gl.getAttribLocation(program, name);
    gl.enableVertexAttribArray(slot);
    gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 24, 12 * i);
  });
  gl.enable(gl.DEPTH_TEST);
  // Behind the mesh is what the page has behind its pictures, bright or dark.
  const dark = matchMedia("(prefers-color-scheme: dark)");
  function behind() {
    const [r, g, b] = getComputedStyle(canvas).backgroundColor.match(/[\d.]+/g).map(x => x / 255);
    gl.clearColor(r, g, b, 1);
  }
  behind();
  dark.addEventListener("change", () => { behind(); draw(); });

  const start = { yaw: 0.4, pitch: 0.25, zoom: 0.85 };
  let view = { ...start }, drag = null;
  function draw() {
    const ratio = window.devicePixelRatio || 1, side = Math.round(canvas.clientWidth * ratio) || 384;
    if (canvas.width !== side) canvas.width = canvas.height = side;
    gl.viewport(0, 0, side, side);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    // Columns of the turn about y, then about x.
    const turn = [cy, sp * sy, -cp * sy, 0, cp, sp, sy, -sp * cy, cp * cy];
    gl.uniformMatrix3fv(gl.getUniformLocation(program, "turn"), false, turn);
    gl.uniform1f(gl.getUniformLocation(program, "zoom"), view.zoom);
    gl.drawArrays(gl.TRIANGLES, 0, T.length);
  }
  const change = (yaw, pitch, factor) => {
    view.yaw += yaw;
    view.pitch = Math.max(-1.57, Math.min(1.57, view.pitch + pitch));
    view.zoom = Math.max(0.2, Math.min(20, view.zoom * factor));
    draw();
  };
  canvas.onpointerdown = e => { drag = e; canvas.setPointerCapture(e.pointerId); };
  canvas.onpointerup = canvas.onpointercancel = () => { drag = null; };
  canvas.onpointermove = e => {
    if (!drag) return;
    change((e.clientX - drag.clientX) / 120, (e.clientY - drag.clientY) / 120, 1);
    drag = e;
  };
  canvas.addEventListener("wheel", e => { e.preventDefault(); change(0, 0, Math.exp(-e.deltaY / 600)); }, { passive: false });
  canvas.ondblclick = () => { view = { ...start }; draw(); };
  const keys = {
    ArrowLeft: [-0.1, 0, 1], ArrowRight: [0.1, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1],
    "+": [0, 0, 1.1], "-": [0, 0, 1 / 1.1],
  };
  canvas.onkeydown = e => { if (keys[e.key]) { e.preventDefault(); change(...keys[e.key]); } };
  draw();
})();
