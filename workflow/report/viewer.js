// The surface viewer: WebGL 2, no dependency.
//
// Why not a library: this page needs one opaque mesh or two, some lines, a colour scale and a turntable.
// k3d's stand-alone bundle is 1.6 MB, vtk.js 1 MB and three.js 0.5 MB of script; none comes with the
// packages the pipeline already installs, and each per-structure page of a cohort would carry its own copy.
// What follows is 16 kB. The projection is orthographic, so that the scale bar is true everywhere.
"use strict";

const VIEWER_MESH_VERTEX = `#version 300 es
in vec3 position; in vec3 normal; in float value;
uniform mat3 turn; uniform vec3 centre; uniform vec3 view; uniform vec2 pan; // view: 1 / (half extent in mm)
out vec3 n; out float t;
void main() {
  vec3 p = turn * (position - centre);
  gl_Position = vec4((p.xy + pan) * view.xy, -p.z * view.z, 1.0);
  n = turn * normal; t = value;
}`;

const VIEWER_MESH_FRAGMENT = `#version 300 es
precision highp float;
in vec3 n; in float t;
uniform sampler2D scale; uniform vec3 plain; uniform float mapped;
out vec4 colour;
void main() {
  vec3 m = normalize(gl_FrontFacing ? n : -n);
  vec3 base = mix(plain, texture(scale, vec2(t, 0.5)).rgb, mapped);
  float key = max(dot(m, normalize(vec3(-0.4, 0.55, 0.75))), 0.0);
  float fill = 0.5 + 0.5 * m.y;
  float shine = pow(max(dot(m, normalize(vec3(-0.2, 0.3, 0.93))), 0.0), 24.0) * 0.14 * (1.0 - 0.6 * mapped);
  float edge = 1.0 - 0.35 * pow(1.0 - abs(m.z), 3.0);
  colour = vec4((base * (0.42 + 0.46 * key + 0.2 * fill) + shine) * edge, 1.0);
}`;

// Lines are quads of constant width on the screen: one instance is one segment.
const VIEWER_LINE_VERTEX = `#version 300 es
in vec2 corner; in vec3 from; in vec3 to;
uniform mat3 turn; uniform vec3 centre; uniform vec3 view; uniform vec2 pan;
uniform vec2 size; uniform float width; uniform float lift;
out float across; out float far;
void main() {
  vec3 a = turn * (from - centre), b = turn * (to - centre);
  vec2 p = (a.xy + pan) * view.xy * size, q = (b.xy + pan) * view.xy * size;
  vec2 along = q - p; float len = length(along);
  along = len > 0.0 ? along / len : vec2(1.0, 0.0);
  float depth = -mix(a.z, b.z, corner.x) * view.z - lift;
  across = corner.y * (width + 1.0);
  vec2 at = mix(p, q, corner.x) + vec2(-along.y, along.x) * across;
  gl_Position = vec4(at / size, depth, 1.0);
  far = 0.5 + depth;
}`;

const VIEWER_LINE_FRAGMENT = `#version 300 es
precision highp float;
in float across; in float far; uniform vec4 tint; uniform float width; out vec4 colour;
void main() {
  float alpha = tint.a * mix(1.0, 0.25, clamp(far, 0.0, 1.0)) * clamp(width + 0.5 - abs(across), 0.0, 1.0);
  colour = vec4(tint.rgb * alpha, alpha);
}`;

class SurfaceViewer {
  // canvas: where to draw; scene: {surface, cubes: {points, faces, values: {name: Uint8Array}}, edges, creases (of
  // the control net), curves: Float32Array of segments (6 numbers each), bounds: [[x, y, z], [x, y, z]]}; scales: {name: [[r, g, b], ...]}
  constructor(canvas, scene, scales) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser offers no WebGL 2");
    this.gl = gl; this.canvas = canvas;
    this.shown = { surface: true, cubes: false, net: false, curves: false };
    this.colour = "plain";
    const [low, high] = scene.bounds;
    this.centre = low.map((x, a) => (x + high[a]) / 2);
    this.radius = Math.hypot(...low.map((x, a) => high[a] - x)) / 2 || 1;
    this.mesh = this.program(VIEWER_MESH_VERTEX, VIEWER_MESH_FRAGMENT);
    this.line = this.program(VIEWER_LINE_VERTEX, VIEWER_LINE_FRAGMENT);
    this.scales = {};
    for (const [name, stops] of Object.entries(scales)) this.scales[name] = this.texture(stops);
    this.parts = {};
    for (const name of ["surface", "cubes"]) if (scene[name]) this.parts[name] = this.upload(scene[name]);
    for (const name of ["edges", "creases", "curves"]) if (scene[name]) this.parts[name] = this.uploadSegments(scene[name]);
    this.reset();
    this.listen();
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(canvas);
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text); gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = {}, attributes = {};
    for (let n = 0; n < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); n++) {
      const { name } = gl.getActiveUniform(program, n);
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    for (let n = 0; n < gl.getProgramParameter(program, gl.ACTIVE_ATTRIBUTES); n++) {
      const { name } = gl.getActiveAttrib(program, n);
      attributes[name] = gl.getAttribLocation(program, name);
    }
    return { program, uniforms, attributes };
  }

  texture(stops) {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const bytes = new Uint8Array(stops.flatMap((rgb) => [...rgb, 255]));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, stops.length, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    for (const key of ["MIN", "MAG"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${key}_FILTER`], gl.LINEAR);
    for (const key of ["S", "T"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_WRAP_${key}`], gl.CLAMP_TO_EDGE);
    return texture;
  }

  buffer(data, target = this.gl.ARRAY_BUFFER) {
    const buffer = this.gl.createBuffer();
    this.gl.bindBuffer(target, buffer);
    this.gl.bufferData(target, data, this.gl.STATIC_DRAW);
    return buffer;
  }

  upload({ points, faces, values }) {
    const gl = this.gl, array = gl.createVertexArray(), { attributes } = this.mesh;
    gl.bindVertexArray(array);
    this.buffer(points);
    this.attribute(attributes.position, 3, gl.FLOAT);
    this.buffer(SurfaceViewer.normals(points, faces));
    this.attribute(attributes.normal, 3, gl.FLOAT);
    this.buffer(faces, gl.ELEMENT_ARRAY_BUFFER);
    const buffers = {};
    for (const [name, bytes] of Object.entries(values || {})) buffers[name] = this.buffer(bytes);
    return { array, count: faces.length, values: buffers };
  }

  attribute(place, size, type, normalised = false) {
    if (place === undefined || place < 0) return;
    this.gl.enableVertexAttribArray(place);
    this.gl.vertexAttribPointer(place, size, type, normalised, 0, 0);
  }

  uploadSegments(segments) {
    const gl = this.gl, array = gl.createVertexArray(), { attributes } = this.line;
    gl.bindVertexArray(array);
    this.buffer(new Float32Array([0, -1, 0, 1, 1, -1, 1, 1]));
    this.attribute(attributes.corner, 2, gl.FLOAT);
    this.buffer(segments);
    for (const [name, offset] of [["from", 0], ["to", 12]]) {
      gl.enableVertexAttribArray(attributes[name]);
      gl.vertexAttribPointer(attributes[name], 3, gl.FLOAT, false, 24, offset);
      gl.vertexAttribDivisor(attributes[name], 1);
    }
    return { array, count: segments.length / 6 };
  }

  // Area-weighted vertex normals.
  static normals(points, faces) {
    const normals = new Float32Array(points.length);
    for (let f = 0; f < faces.length; f += 3) {
      const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
      const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
      const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
      const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
      for (const at of [a, b, c]) { normals[at] += x; normals[at + 1] += y; normals[at + 2] += z; }
    }
    return normals; // the shader normalises
  }

  // Seen from in front (patient upright, his left on the right), turned a little for depth.
  reset() { this.zoom = 1; this.pan = [0, 0]; this.look("anterior"); this.rotate(0.35, 0.2); }

  look(side) {
    this.turn = {
      anterior: [-1, 0, 0, 0, 0, 1, 0, 1, 0],
      left: [0, -1, 0, 0, 0, 1, -1, 0, 0],
      superior: [1, 0, 0, 0, 1, 0, 0, 0, 1],
    }[side].slice(); // rows: right, up, towards the eye, in RAS
    this.draw();
  }

  // Turn about the screen's vertical axis by x and about its horizontal one by y (radians).
  rotate(x, y) {
    const [cx, sx, cy, sy] = [Math.cos(x), Math.sin(x), Math.cos(y), Math.sin(y)];
    const by = [cx, 0, sx, sy * sx, cy, -sy * cx, -cy * sx, sy, cy * cx], old = this.turn, turned = [];
    for (let r = 0; r < 3; r++) for (let c = 0; c < 3; c++)
      turned.push(by[3 * r] * old[c] + by[3 * r + 1] * old[3 + c] + by[3 * r + 2] * old[6 + c]);
    for (let r = 0; r < 3; r++) { // rows stay orthonormal after thousands of small turns
      for (let q = 0; q < r; q++) {
        const dot = turned[3 * r] * turned[3 * q] + turned[3 * r + 1] * turned[3 * q + 1] + turned[3 * r + 2] * turned[3 * q + 2];
        for (let c = 0; c < 3; c++) turned[3 * r + c] -= dot * turned[3 * q + c];
      }
      const length = Math.hypot(turned[3 * r], turned[3 * r + 1], turned[3 * r + 2]);
      for (let c = 0; c < 3; c++) turned[3 * r + c] /= length;
    }
    this.turn = turned;
    this.draw();
  }

  scaleBy(factor) { this.zoom = Math.min(40, Math.max(0.4, this.zoom * factor)); this.draw(); }

  // Millimetres per CSS pixel.
  get resolution() {
    const side = Math.min(this.canvas.clientWidth, this.canvas.clientHeight) || 1;
    return (1.8 * this.radius) / (side * this.zoom);
  }

  show(part, on) { this.shown[part] = on; this.draw(); }

  colourBy(name) { this.colour = name; this.draw(); }

  listen() {
    const canvas = this.canvas, fingers = new Map();
    let spread = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      spread = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const dx = event.clientX - before[0], dy = event.clientY - before[1];
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 1 && !event.shiftKey) return this.rotate(dx * 0.009, dy * 0.009);
      const share = 1 / fingers.size;
      this.pan = [this.pan[0] + dx * share * this.resolution, this.pan[1] - dy * share * this.resolution];
      if (fingers.size === 2) {
        const [a, b] = [...fingers.values()], now = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (spread) this.zoom = Math.min(40, Math.max(0.4, (this.zoom * now) / spread));
        spread = now;
      }
      this.draw();
    });
    for (const end of ["pointerup", "pointercancel"])
      canvas.addEventListener(end, (event) => { fingers.delete(event.pointerId); spread = 0; });
    // A page that zooms a picture instead of scrolling is a trap: the wheel zooms only where the viewer has the focus.
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.scaleBy(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("keydown", (event) => {
      const step = 0.12, actions = {
        ArrowLeft: () => this.rotate(-step, 0), ArrowRight: () => this.rotate(step, 0),
        ArrowUp: () => this.rotate(0, -step), ArrowDown: () => this.rotate(0, step),
        "+": () => this.scaleBy(1.2), "=": () => this.scaleBy(1.2), "-": () => this.scaleBy(1 / 1.2), "0": () => this.reset(),
      };
      if (!actions[event.key] || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      actions[event.key]();
    });
  }

  // Letters of the patient's sides at the screen's left, right, top and bottom.
  sides() {
    const letters = [["R", "L"], ["A", "P"], ["S", "I"]];
    const name = (row, sign) => [0, 1, 2].map((a) => [sign * this.turn[3 * row + a], a])
      .filter(([x]) => Math.abs(x) > 0.38).sort((p, q) => Math.abs(q[0]) - Math.abs(p[0]))
      .map(([x, a]) => letters[a][x > 0 ? 0 : 1]).join("");
    return { right: name(0, 1), left: name(0, -1), top: name(1, 1), bottom: name(1, -1) };
  }

  draw() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => { this.pending = 0; this.paint(); });
  }

  paint() {
    const gl = this.gl, canvas = this.canvas, dots = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * dots), height = Math.round(canvas.clientHeight * dots);
    if (!width || !height || gl.isContextLost()) return;
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const mm = this.resolution / dots, view = [2 / (width * mm), 2 / (height * mm), 1 / (2 * this.radius)];
    const columns = [0, 3, 6, 1, 4, 7, 2, 5, 8].map((n) => this.turn[n]); // GLSL matrices are column-major
    const place = ({ program, uniforms }) => {
      gl.useProgram(program);
      gl.uniformMatrix3fv(uniforms.turn, false, columns);
      gl.uniform3fv(uniforms.centre, this.centre);
      gl.uniform3fv(uniforms.view, view);
      gl.uniform2fv(uniforms.pan, this.pan);
    };
    place(this.mesh);
    for (const [name, plain] of [["surface", [0.83, 0.70, 0.60]], ["cubes", [0.62, 0.68, 0.74]]]) {
      const part = this.parts[name];
      if (!part || !this.shown[name]) continue;
      const { uniforms, attributes } = this.mesh, values = part.values[this.colour];
      gl.bindVertexArray(part.array);
      gl.uniform3fv(uniforms.plain, plain);
      gl.uniform1f(uniforms.mapped, values ? 1 : 0);
      gl.bindTexture(gl.TEXTURE_2D, this.scales[values ? this.colour : Object.keys(this.scales)[0]]);
      if (values) {
        gl.bindBuffer(gl.ARRAY_BUFFER, values);
        this.attribute(attributes.value, 1, gl.UNSIGNED_BYTE, true);
      } else gl.disableVertexAttribArray(attributes.value);
      gl.drawElements(gl.TRIANGLES, part.count, gl.UNSIGNED_INT, 0);
    }
    place(this.line);
    gl.uniform2f(this.line.uniforms.size, width / 2, height / 2);
    for (const [name, box, tint, pen] of [["curves", "curves", [0.10, 0.36, 0.62], 0.55],
      ["edges", "net", [0.0, 0.56, 0.42], 0.45], ["creases", "net", [0.84, 0.37, 0.0], 0.6]]) {
      const part = this.parts[name];
      if (!part || !this.shown[box]) continue;
      gl.bindVertexArray(part.array);
      gl.uniform1f(this.line.uniforms.width, pen * dots);
      // First faintly through everything, then at full strength where the line lies in front.
      for (const [alpha, hidden] of [[0.1, true], [0.9, false]]) {
        if (hidden) gl.disable(gl.DEPTH_TEST); else gl.enable(gl.DEPTH_TEST);
        gl.depthMask(!hidden);
        gl.uniform4f(this.line.uniforms.tint, ...tint, alpha);
        gl.uniform1f(this.line.uniforms.lift, hidden ? 0 : 0.004);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, part.count);
      }
      gl.depthMask(true);
    }
    gl.bindVertexArray(null);
    if (this.onpaint) this.onpaint(this);
  }

  // Give the graphics memory back; browsers keep only some sixteen contexts alive.
  dispose() {
    this.observer.disconnect();
    cancelAnimationFrame(this.pending);
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}
