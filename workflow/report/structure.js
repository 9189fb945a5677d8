// One structure: its packed data, its surface viewer and its slices. Nothing is inflated before it is opened.
"use strict";

// What cccd.report.payload.pack wrote: base64 of deflated bytes; a JSON header, then byte-shuffled deltas.
async function unpack(text) {
  const packed = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const { meta, arrays } = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const kinds = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array }, data = { meta };
  for (const [name, { type, count, columns, offset }] of Object.entries(arrays)) {
    const array = new kinds[type](count), width = array.BYTES_PER_ELEMENT;
    const raw = new Uint8Array(array.buffer), from = bytes.subarray(4 + length + offset);
    for (let byte = 0; byte < width; byte++) for (let n = 0; n < count; n++) raw[n * width + byte] = from[byte * count + n];
    for (let n = columns; n < count; n++) array[n] += array[n - columns]; // wraps like the subtraction did
    data[name] = array;
  }
  return data;
}

class Structure {
  constructor(element) {
    this.element = element;
    this.open = false;
    const toggle = () => (element.open ? this.start() : this.stop());
    element.addEventListener("toggle", toggle);
    if (element.open) toggle();
  }

  find(name) { return this.element.querySelector(`[data-part="${name}"]`); }

  async start() {
    if (this.open) return;
    this.open = true;
    try {
      if (!this.data) this.data = await unpack(this.find("data").textContent);
      if (!this.open) return;
      if (this.data.surface_points) this.startViewer();
      if (this.data.meta.slices && !this.slices) this.slices = new SliceViewer(this);
      this.element.dataset.state = "ready";
    } catch (error) {
      this.element.dataset.state = "failed";
      this.find("message").textContent = `The interactive view could not start: ${error.message}.`;
    }
  }

  stop() {
    this.open = false;
    if (this.viewer) { this.viewer.dispose(); this.viewer = null; }
    // A lost context stays lost: the next opening draws on a fresh canvas.
    const canvas = this.find("surface");
    if (canvas) canvas.replaceWith(canvas.cloneNode());
  }

  mm(quantised, { origin, step }) {
    const points = new Float32Array(quantised.length);
    for (let n = 0; n < points.length; n++) points[n] = origin[n % 3] + step * quantised[n];
    return points;
  }

  // In-plane points and their slices to the world.
  world(points, k) {
    const { stack_affine: m, pixels } = this.data.meta, out = new Float32Array((points.length / 2) * 3);
    for (let n = 0; n < points.length / 2; n++) {
      const i = pixels.origin[0] + pixels.step * points[2 * n], j = pixels.origin[1] + pixels.step * points[2 * n + 1];
      for (let r = 0; r < 3; r++) out[3 * n + r] = m[r][0] * i + m[r][1] * j + m[r][2] * k[n] + m[r][3];
    }
    return out;
  }

  scene() {
    const { meta } = this.data, scene = {};
    for (const name of ["surface", "cubes"]) {
      if (!this.data[`${name}_points`]) continue;
      const values = {};
      for (const key of ["distance", "band", "curvature"]) if (this.data[`${name}_${key}`]) values[key] = this.data[`${name}_${key}`];
      scene[name] = { points: this.mm(this.data[`${name}_points`], meta.mm), faces: this.data[`${name}_faces`], values };
    }
    if (this.data.net_points)
      for (const name of ["edges", "creases"]) scene[name] = this.netSegments(this.data[`net_${name}`]);
    if (this.data.curve_points) scene.curves = this.curveSegments();
    const bounds = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]], { points } = scene.surface;
    for (let n = 0; n < points.length; n++) {
      bounds[0][n % 3] = Math.min(bounds[0][n % 3], points[n]);
      bounds[1][n % 3] = Math.max(bounds[1][n % 3], points[n]);
    }
    return { ...scene, bounds };
  }

  netSegments(ends) {
    const points = this.mm(this.data.net_points, this.data.meta.net_mm), segments = new Float32Array(3 * ends.length);
    ends.forEach((point, n) => segments.set(points.subarray(3 * point, 3 * point + 3), 3 * n));
    return segments;
  }

  curveSegments() {
    const { curve_points: points, curve_offsets: offsets, curve_slice: slices } = this.data;
    const k = new Float32Array(points.length / 2);
    for (let c = 0; c + 1 < offsets.length; c++) k.fill(slices[c], offsets[c], offsets[c + 1]);
    const world = this.world(points, k), segments = new Float32Array(6 * k.length);
    for (let c = 0; c + 1 < offsets.length; c++) for (let n = offsets[c]; n < offsets[c + 1]; n++) {
      const next = n + 1 < offsets[c + 1] ? n + 1 : offsets[c];
      segments.set(world.subarray(3 * n, 3 * n + 3), 6 * n);
      segments.set(world.subarray(3 * next, 3 * next + 3), 6 * n + 3);
    }
    return segments;
  }

  startViewer() {
    const scales = JSON.parse(document.getElementById("scales").textContent), viewer = new SurfaceViewer(
      this.find("surface"), this.scene(), scales);
    this.viewer = viewer;
    viewer.onpaint = () => {
      const sides = viewer.sides();
      for (const [side, letters] of Object.entries(sides)) this.find(`side-${side}`).textContent = letters;
      this.drawRuler(viewer.resolution);
    };
    for (const input of this.element.querySelectorAll("input[data-show]")) {
      viewer.show(input.dataset.show, input.checked);
      input.onchange = () => viewer.show(input.dataset.show, input.checked);
    }
    const colour = this.find("colour"), paint = () => {
      viewer.colourBy(colour.value);
      for (const legend of this.element.querySelectorAll("[data-legend]")) legend.hidden = legend.dataset.legend !== colour.value;
    };
    colour.onchange = paint;
    paint();
    for (const button of this.element.querySelectorAll("button[data-look]"))
      button.onclick = () => { if (button.dataset.look === "reset") viewer.reset(); else viewer.look(button.dataset.look); };
  }

  drawRuler(mmPerPixel) {
    const wanted = 90 * mmPerPixel, power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((n) => n * power).find((n) => n <= wanted) || power, ruler = this.find("ruler");
    ruler.style.width = `${length / mmPerPixel}px`;
    ruler.textContent = `${length} mm`;
  }
}

class SliceViewer {
  constructor(structure) {
    this.data = structure.data;
    this.layout = structure.data.meta.slices;
    this.canvas = structure.find("slice");
    this.slider = structure.find("slider");
    this.label = structure.find("slice-label");
    this.counts = structure.find("slice-counts");
    this.shown = {};
    for (const input of structure.element.querySelectorAll("input[data-overlay]")) {
      this.shown[input.dataset.overlay] = input.checked;
      input.onchange = () => { this.shown[input.dataset.overlay] = input.checked; this.paint(); };
    }
    this.slider.max = this.layout.k.length - 1;
    this.slider.value = Math.floor(this.layout.k.length / 2);
    this.slider.oninput = () => this.paint();
    this.canvas.onkeydown = (event) => {
      const step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageUp: 10, PageDown: -10 }[event.key];
      if (!step) return;
      event.preventDefault();
      this.slider.value = Number(this.slider.value) + step;
      this.paint();
    };
    new ResizeObserver(() => this.paint()).observe(this.canvas);
    const sprite = structure.find("sprite");
    if (sprite) this.decode(sprite.textContent.trim());
    this.paint();
  }

  async decode(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    this.sprite = await createImageBitmap(new Blob([bytes], { type: "image/webp" }));
    this.paint();
  }

  // Points of one slice of a ragged overlay, in the picture's pixels (x right, y down).
  *points(name, index) {
    const points = this.data[`${name}_points`], offsets = this.data[`${name}_offsets`];
    if (!points) return;
    const { origin, step } = this.data.meta.pixels, m = this.layout.to_picture;
    for (let n = offsets[index]; n < offsets[index + 1]; n++) {
      const i = origin[0] + step * points[2 * n], j = origin[1] + step * points[2 * n + 1];
      yield [m[0][0] * i + m[0][1] * j + m[0][2], m[1][0] * i + m[1][1] * j + m[1][2]];
    }
  }

  count(name, index) {
    const offsets = this.data[`${name}_offsets`];
    return offsets ? offsets[index + 1] - offsets[index] : null;
  }

  paint() {
    const { k, width, height, aspect, tile } = this.layout, index = Number(this.slider.value), { canvas } = this;
    const dots = window.devicePixelRatio || 1, side = canvas.clientWidth, zoom = (side * dots) / width;
    if (!side) return;
    canvas.style.aspectRatio = `${width} / ${height * aspect}`;
    const size = [Math.round(width * zoom), Math.round(height * aspect * zoom)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    const pen = canvas.getContext("2d");
    pen.fillStyle = "#101214";
    pen.fillRect(0, 0, ...size);
    if (this.sprite) {
      const column = index % tile.columns, row = Math.floor(index / tile.columns);
      pen.imageSmoothingEnabled = tile.shrink > 1;
      pen.globalAlpha = 0.9;
      pen.drawImage(this.sprite, column * tile.width, row * tile.height, tile.width, tile.height,
        0, 0, tile.width * tile.shrink * zoom, tile.height * tile.shrink * zoom * aspect);
      pen.globalAlpha = 1;
    }
    const at = ([x, y]) => [(x + 0.5) * zoom, (y + 0.5) * zoom * aspect];
    const style = getComputedStyle(canvas), tint = (name) => style.getPropertyValue(`--${name}`).trim();
    const box = (name, alpha) => {
      pen.fillStyle = tint(name);
      pen.globalAlpha = alpha;
      for (const [x, y] of this.points(name, index)) pen.fillRect(x * zoom, y * zoom * aspect, Math.max(zoom - 0.5, 1), Math.max(zoom * aspect - 0.5, 1));
      pen.globalAlpha = 1;
    };
    const ring = (name, radius, filled) => {
      pen.strokeStyle = pen.fillStyle = tint(name);
      pen.lineWidth = 1.6 * dots;
      for (const point of this.points(name, index)) {
        pen.beginPath();
        pen.arc(...at(point), radius * dots, 0, 2 * Math.PI);
        if (filled) pen.fill(); else pen.stroke();
      }
    };
    if (this.shown.boundary) box("boundary", 0.75);
    if (this.shown.junctions) box("junctions", 0.95);
    if (this.shown.dropped) box("dropped", 0.95);
    if (this.shown.bridged) box("bridged", 0.95);
    if (this.shown.band) for (const side of ["inner", "outer"]) this.paintLines(side, pen, k[index], at, tint("band"), 1.2 * dots);
    if (this.shown.curve) this.paintLines("curve", pen, k[index], at, tint("curve"), 1.6 * dots);
    if (this.shown.corners) ring("corners", 2.4, true);
    if (this.shown.isolated_corners) ring("isolated_corners", 5, false);
    this.label.textContent = `Slice ${k[index]} · ${index + 1} of ${k.length}`;
    this.slider.setAttribute("aria-valuetext", this.label.textContent);
    canvas.dataset.slice = k[index];
    const named = [["boundary", "boundary pixels"], ["junctions", "junction pixels"], ["isolated_corners", "isolated corners"],
      ["dropped", "dropped"], ["bridged", "bridged"], ["corners", "corners"]];
    this.counts.textContent = named.map(([name, words]) => [this.count(name, index), words])
      .filter(([count]) => count !== null).map(([count, words]) => `${count} ${words}`).join(" · ");
  }

  paintLines(name, pen, slice, at, colour, width) {
    const [points, offsets, slices] = ["points", "offsets", "slice"].map((part) => this.data[`${name}_${part}`]), { meta } = this.data;
    if (!points) return;
    const { origin, step } = meta.pixels, m = this.layout.to_picture;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    for (let c = 0; c < slices.length; c++) {
      if (slices[c] !== slice) continue;
      pen.beginPath();
      for (let n = offsets[c]; n < offsets[c + 1]; n++) {
        const i = origin[0] + step * points[2 * n], j = origin[1] + step * points[2 * n + 1];
        const where = at([m[0][0] * i + m[0][1] * j + m[0][2], m[1][0] * i + m[1][1] * j + m[1][2]]);
        if (n === offsets[c]) pen.moveTo(...where); else pen.lineTo(...where);
      }
      pen.closePath();
      pen.stroke();
    }
  }
}

document.addEventListener("DOMContentLoaded", () => {
  window.structures = [...document.querySelectorAll("details.structure")].map((element) => new Structure(element));
});
