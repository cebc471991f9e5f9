// Shows the layers of a page in three dimensions: WebGL 2, no libraries, no network.
// The data's layout is written by `viewer/data.rs`.
"use strict";

const MESH_VERTEX = `#version 300 es
uniform mat4 camera;
uniform float blend, top;
layout(location = 0) in vec3 from;
layout(location = 1) in vec3 to;
layout(location = 2) in vec3 fromNormal;
layout(location = 3) in vec3 toNormal;
layout(location = 4) in float fromValue;
layout(location = 5) in float toValue;
out vec3 place, normal;
out float value;
void main() {
  place = mix(from, to, blend);
  normal = mix(fromNormal, toNormal, blend);
  value = mix(fromValue, toValue, blend) / top;
  gl_Position = camera * vec4(place, 1.0);
}`;
const MESH_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 color, eye;
uniform vec4 section;
uniform vec3 ramp[5];
uniform bool byValue;
in vec3 place, normal;
in float value;
out vec4 shown;
void main() {
  if (dot(section.xyz, place) > section.w) discard;
  float x = 4.0 * clamp(value, 0.0, 1.0);
  int k = int(min(floor(x), 3.0));
  vec3 base = byValue ? mix(ramp[k], ramp[k + 1], x - float(k)) : color;
  vec3 n = normalize(normal), sight = normalize(eye - place);
  if (!gl_FrontFacing) { n = -n; base *= 0.5; }
  float light = 0.28 + 0.52 * max(dot(n, sight), 0.0) + 0.2 * (0.5 + 0.5 * n.y);
  shown = vec4(base * light, 1.0);
}`;
// Lines lie in two surfaces: a little nearer to the eye they are in front of both.
const LINE_VERTEX = `#version 300 es
uniform mat4 camera;
uniform vec3 eye;
layout(location = 0) in vec3 from;
out vec3 place;
void main() {
  place = from;
  gl_Position = camera * vec4(mix(from, eye, 5e-4), 1.0);
}`;
const LINE_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 section, color;
in vec3 place;
out vec4 shown;
void main() {
  if (dot(section.xyz, place) > section.w) discard;
  shown = color;
}`;
// Five colours of matplotlib's viridis, in sRGB.
const RAMP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const FIELD_OF_VIEW = 0.5; // radians

// ---- data

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Numbers come as planes of bytes, lowest first; each number is the difference to another one.
class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }
  differences(count) {
    const out = new Int32Array(count);
    for (let plane = 0; plane < 4; plane++) {
      for (let k = 0; k < count; k++) out[k] |= this.bytes[this.at + k] << (8 * plane);
      this.at += count;
    }
    for (let k = 0; k < count; k++) out[k] = (out[k] >>> 1) ^ -(out[k] & 1);
    return out;
  }
  // Each number follows the one `step` before it.
  chain(count, step) {
    const out = this.differences(count);
    for (let k = step; k < count; k++) out[k] += out[k - step];
    return out;
  }
}

function decoded(head, bytes) {
  const reader = new Reader(bytes);
  const places = (grid) => Float32Array.from(grid, (x, k) => head.low[k % 3] + x * head.step);
  const layers = head.layers.map(({ name, color, states }) => {
    let triangles = null;
    let grid = null;
    const shapes = states.map(({ vertices, triangles: count }) => {
      if (count === undefined) {
        const moved = reader.differences(3 * vertices);
        grid = grid.map((x, k) => x + moved[k]);
      } else {
        triangles = Uint32Array.from(reader.chain(3 * count, 1));
        grid = reader.chain(3 * vertices, 3);
      }
      return { triangles, places: places(grid) };
    });
    return { name, color: color.map((c) => c / 255), shapes, isShown: true };
  });
  const lines = head.lines.map((count) => places(reader.chain(6 * count, 3)));
  return { states: head.states, layers, lines };
}

function normals({ triangles, places }) {
  const sums = new Float32Array(places.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const u = [0, 1, 2].map((k) => places[b + k] - places[a + k]);
    const v = [0, 1, 2].map((k) => places[c + k] - places[a + k]);
    const n = cross(u, v);
    for (const corner of [a, b, c]) for (let k = 0; k < 3; k++) sums[corner + k] += n[k];
  }
  for (let k = 0; k < sums.length; k += 3) {
    const length = Math.hypot(sums[k], sums[k + 1], sums[k + 2]) || 1;
    for (let c = 0; c < 3; c++) sums[k + c] /= length;
  }
  return sums;
}

const between = (p, a, b) =>
  Math.hypot(p[3 * a] - p[3 * b], p[3 * a + 1] - p[3 * b + 1], p[3 * a + 2] - p[3 * b + 2]);

// A value for each vertex, from the first state to this one: millimetres, or the largest change of
// an edge's length in percent. Nothing is known where the triangles have changed.
const MEASURES = {
  displacement: (first, shape) =>
    Float32Array.from({ length: shape.places.length / 3 }, (_, v) => {
      const [p, q] = [first.places, shape.places];
      return 1e3 * Math.hypot(...[0, 1, 2].map((k) => q[3 * v + k] - p[3 * v + k]));
    }),
  strain: (first, shape) => {
    const out = new Float32Array(shape.places.length / 3);
    for (let t = 0; t < shape.triangles.length; t += 3) {
      for (let k = 0; k < 3; k++) {
        const [a, b] = [shape.triangles[t + k], shape.triangles[t + ((k + 1) % 3)]];
        const rest = between(first.places, a, b);
        const strain = rest > 0 ? 100 * Math.abs(between(shape.places, a, b) / rest - 1) : 0;
        for (const v of [a, b]) out[v] = Math.max(out[v], strain);
      }
    }
    return out;
  },
};
const UNITS = { displacement: "mm", strain: "%" };

function measured(layer, state, measure) {
  const shape = layer.shapes[state];
  shape.values ??= {};
  shape.values[measure] ??=
    shape.triangles === layer.shapes[0].triangles
      ? MEASURES[measure](layer.shapes[0], shape)
      : new Float32Array(shape.places.length / 3);
  return shape.values[measure];
}

const largest = (values) => values.reduce((a, b) => Math.max(a, b), 0);

// ---- geometry

const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

function bounds(layers) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const layer of layers)
    for (const { places } of layer.shapes)
      places.forEach((x, k) => {
        low[k % 3] = Math.min(low[k % 3], x);
        high[k % 3] = Math.max(high[k % 3], x);
      });
  return { low, high };
}

class Camera {
  constructor({ low, high }) {
    this.home = low.map((x, k) => (x + high[k]) / 2);
    this.radius = Math.hypot(...low.map((x, k) => high[k] - x)) / 2 || 1;
    this.reset();
  }
  reset() {
    this.target = [...this.home];
    [this.azimuth, this.elevation] = [0.5, 0.1];
    this.distance = (0.95 * this.radius) / Math.sin(FIELD_OF_VIEW / 2);
  }
  axes() {
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    return { right: [ca, 0, -sa], up: [-se * sa, ce, -se * ca], back: [ce * sa, se, ce * ca] };
  }
  eye() {
    const { back } = this.axes();
    return this.target.map((x, k) => x + this.distance * back[k]);
  }
  turn(dx, dy) {
    this.azimuth -= dx;
    this.elevation = Math.max(-1.55, Math.min(1.55, this.elevation + dy));
  }
  // Shares of the picture's height.
  shift(dx, dy) {
    const { right, up } = this.axes();
    const scale = 2 * this.distance * Math.tan(FIELD_OF_VIEW / 2);
    this.target = this.target.map((x, k) => x + scale * (dy * up[k] - dx * right[k]));
  }
  zoom(factor) {
    const [least, most] = [0.02 * this.radius, 20 * this.radius];
    this.distance = Math.max(least, Math.min(most, this.distance * factor));
  }
  matrix(aspect) {
    const { right, up, back } = this.axes();
    const eye = this.eye();
    const f = 1 / Math.tan(FIELD_OF_VIEW / 2);
    const [wide, high] = [f * Math.min(1, 1 / aspect), f * Math.min(1, aspect)];
    const far = this.distance + 3 * this.radius;
    const near = Math.max(this.distance - 3 * this.radius, far / 2000);
    const row = (axis, scale, shift) => [
      ...axis.map((x) => scale * x),
      shift - scale * dot(axis, eye),
    ];
    const rows = [
      row(right, wide, 0),
      row(up, high, 0),
      row(back, (far + near) / (near - far), (2 * far * near) / (near - far)),
      row(back, -1, 0),
    ];
    return new Float32Array([0, 1, 2, 3].flatMap((column) => rows.map((r) => r[column])));
  }
}

// ---- drawing

class Program {
  constructor(gl, vertex, fragment) {
    this.program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(gl.getProgramInfoLog(this.program));
    this.places = {};
    const count = gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS);
    for (let k = 0; k < count; k++) {
      const { name } = gl.getActiveUniform(this.program, k);
      this.places[name.replace("[0]", "")] = gl.getUniformLocation(this.program, name);
    }
  }
}

class Painter {
  constructor(canvas) {
    this.gl = canvas.getContext("webgl2", { antialias: true });
    if (!this.gl) throw new Error("WebGL 2 is not available");
    this.begin();
  }
  // Also after the context was lost.
  begin() {
    this.mesh = new Program(this.gl, MESH_VERTEX, MESH_FRAGMENT);
    this.line = new Program(this.gl, LINE_VERTEX, LINE_FRAGMENT);
    this.buffers = new Map();
    this.array = this.gl.createVertexArray();
  }
  buffer(data, target) {
    const gl = this.gl;
    if (!this.buffers.has(data)) {
      this.buffers.set(data, gl.createBuffer());
      gl.bindBuffer(target, this.buffers.get(data));
      gl.bufferData(target, data, gl.STATIC_DRAW);
    }
    gl.bindBuffer(target, this.buffers.get(data));
  }
  attribute(place, data, size) {
    this.buffer(data, this.gl.ARRAY_BUFFER);
    this.gl.enableVertexAttribArray(place);
    this.gl.vertexAttribPointer(place, size, this.gl.FLOAT, false, 0, 0);
  }
  paint(scene, camera, look) {
    const gl = this.gl;
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const matrix = camera.matrix(gl.drawingBufferWidth / gl.drawingBufferHeight);
    gl.bindVertexArray(this.array);
    for (const layer of scene.layers) if (layer.isShown) this.paintLayer(layer, matrix, camera, look);
    if (look.lines && scene.lines.length) this.paintLines(scene.lines[Math.round(look.state)], matrix, camera, look);
  }
  paintLayer(layer, matrix, camera, look) {
    const gl = this.gl;
    const { program, places } = this.mesh;
    let [from, blend] = [Math.floor(look.state), look.state % 1];
    let to = Math.min(from + 1, layer.shapes.length - 1);
    if (layer.shapes[from].triangles !== layer.shapes[to].triangles) {
      from = to = Math.round(look.state); // no vertex has a counterpart
      blend = 0;
    }
    const [a, b] = [layer.shapes[from], layer.shapes[to]];
    for (const shape of [a, b]) shape.normals ??= normals(shape);
    gl.useProgram(program);
    gl.uniformMatrix4fv(places.camera, false, matrix);
    gl.uniform3fv(places.eye, camera.eye());
    gl.uniform3fv(places.color, layer.color);
    gl.uniform4fv(places.section, look.section);
    gl.uniform1f(places.blend, blend);
    gl.uniform1f(places.top, look.top || 1);
    gl.uniform1i(places.byValue, look.measure ? 1 : 0);
    gl.uniform3fv(places.ramp, RAMP.flat().map((x) => x / 255));
    this.attribute(0, a.places, 3);
    this.attribute(1, b.places, 3);
    this.attribute(2, a.normals, 3);
    this.attribute(3, b.normals, 3);
    for (const [place, state] of [[4, from], [5, to]]) {
      if (look.measure) this.attribute(place, measured(layer, state, look.measure), 1);
      else gl.disableVertexAttribArray(place);
    }
    this.buffer(a.triangles, gl.ELEMENT_ARRAY_BUFFER);
    gl.drawElements(gl.TRIANGLES, a.triangles.length, gl.UNSIGNED_INT, 0);
  }
  // Lines in front, and fainter those that something hides.
  paintLines(lines, matrix, camera, look) {
    if (!lines.length) return;
    const gl = this.gl;
    const { program, places } = this.line;
    gl.useProgram(program);
    gl.uniformMatrix4fv(places.camera, false, matrix);
    gl.uniform3fv(places.eye, camera.eye());
    gl.uniform4fv(places.section, look.section);
    for (let k = 1; k < 6; k++) gl.disableVertexAttribArray(k);
    this.attribute(0, lines, 3);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    for (const [isHidden, alpha] of [[true, 0.35], [false, 1]]) {
      (isHidden ? gl.disable : gl.enable).call(gl, gl.DEPTH_TEST);
      gl.uniform4fv(places.color, [0.88, 0.05, 0.1, alpha]);
      gl.drawArrays(gl.LINES, 0, lines.length / 3);
    }
    gl.disable(gl.BLEND);
  }
}

// ---- controls

function element(tag, attributes, ...children) {
  const made = Object.assign(document.createElement(tag), attributes);
  made.append(...children);
  return made;
}

const SECTIONS = [["no section", null], ["section: left", 0], ["section: top", 1], ["section: front", 2]];

class Viewer {
  constructor(root, scene) {
    Object.assign(this, { root, scene, box: bounds(scene.layers) });
    this.canvas = element("canvas", { tabIndex: 0, ariaLabel: "The layers in three dimensions" });
    this.painter = new Painter(this.canvas);
    this.camera = new Camera(this.box);
    this.build();
    this.listen();
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    this.resize();
  }

  build() {
    const redraw = () => this.redraw();
    const layers = this.scene.layers.map((layer) => {
      const box = element("input", { type: "checkbox", checked: true });
      box.onchange = () => ((layer.isShown = box.checked), this.redraw());
      const chip = element("i", {});
      chip.style.background = `rgb(${layer.color.map((c) => 255 * c).join(" ")})`;
      layer.box = box;
      return element("label", {}, box, chip, layer.name);
    });
    const last = this.scene.states.length - 1;
    this.state = element("input", { type: "range", min: 0, max: last, step: last > 1 ? 0.1 : 0.01 });
    this.state.value = last === 1 ? 1 : 0;
    this.name = element("output", {});
    this.colors = element("select", { ariaLabel: "Colours" });
    for (const [text, value] of [["colours of layers", ""], ["displacement", "displacement"], ["strain", "strain"]])
      this.colors.append(element("option", { value }, text));
    this.top = element("output", {});
    this.legend = element("span", { className: "legend", hidden: true }, "0", element("b", {}), this.top);
    this.axis = element("select", { ariaLabel: "Section" });
    SECTIONS.forEach(([text], value) => this.axis.append(element("option", { value }, text)));
    this.depth = element("input", { type: "range", min: 0, max: 1, step: 0.002, value: 0.5 });
    this.depth.ariaLabel = "Place of the section";
    this.lines = element("input", { type: "checkbox", checked: true });
    this.count = element("span", {});
    for (const input of [this.state, this.colors, this.axis, this.depth, this.lines]) input.oninput = redraw;
    const home = element("button", { type: "button", onclick: () => (this.camera.reset(), redraw()) }, "reset");
    const row = (...children) => element("div", {}, ...children);
    const rows = [row(...layers)];
    if (last > 0) rows.push(row(element("label", {}, "state ", this.state), this.name));
    // In a motion the way from the first state is the pose's, and says nothing about cloth.
    this.isCompared = last === 1;
    if (this.isCompared) rows.push(row(this.colors, this.legend));
    // Of parts of one surface none were looked for.
    const lines = this.scene.lines.length ? [element("label", {}, this.lines, "intersections ", this.count)] : [];
    rows.push(row(this.axis, this.depth, ...lines, home));
    const help = "Drag to turn, with Shift or two fingers to shift, wheel or pinch to zoom. Keys: arrows, + −, [ ] state, digits layers, c colours, s section, 0 reset.";
    this.root.replaceChildren(this.canvas, ...rows, element("small", {}, help));
  }

  listen() {
    const canvas = this.canvas;
    const pointers = new Map();
    canvas.onpointerdown = (e) => {
      pointers.set(e.pointerId, [e.clientX, e.clientY]);
      canvas.setPointerCapture(e.pointerId);
      canvas.focus({ preventScroll: true });
    };
    canvas.onpointerup = canvas.onpointercancel = (e) => pointers.delete(e.pointerId);
    canvas.onpointermove = (e) => {
      const before = pointers.get(e.pointerId);
      if (!before) return;
      const height = canvas.clientHeight;
      const [dx, dy] = [(e.clientX - before[0]) / height, (e.clientY - before[1]) / height];
      if (pointers.size === 2) {
        const [other] = [...pointers].filter(([id]) => id !== e.pointerId).map(([, at]) => at);
        const span = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]) || 1;
        this.camera.zoom(span(before) / span([e.clientX, e.clientY]));
        this.camera.shift(dx / 2, dy / 2);
      } else if (e.shiftKey || e.buttons & 6) this.camera.shift(dx, dy);
      else this.camera.turn(4 * dx, 4 * dy);
      pointers.set(e.pointerId, [e.clientX, e.clientY]);
      this.redraw();
    };
    canvas.oncontextmenu = (e) => e.preventDefault();
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.camera.zoom(Math.exp(Math.max(-0.5, Math.min(0.5, e.deltaY / 500))));
      this.redraw();
    }, { passive: false });
    canvas.onkeydown = (e) => this.key(e);
    canvas.addEventListener("webglcontextlost", (e) => e.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => (this.painter.begin(), this.redraw()));
  }

  key(e) {
    const next = (select) => (select.selectedIndex = (select.selectedIndex + 1) % select.options.length);
    const layer = this.scene.layers[Number(e.key) - 1];
    const keys = {
      ArrowLeft: () => this.camera.turn(0.1, 0),
      ArrowRight: () => this.camera.turn(-0.1, 0),
      ArrowUp: () => this.camera.turn(0, 0.1),
      ArrowDown: () => this.camera.turn(0, -0.1),
      "+": () => this.camera.zoom(0.9),
      "=": () => this.camera.zoom(0.9),
      "-": () => this.camera.zoom(1 / 0.9),
      "[": () => this.state.stepDown(Math.round(Math.max(1, 0.1 / this.state.step))),
      "]": () => this.state.stepUp(Math.round(Math.max(1, 0.1 / this.state.step))),
      c: () => this.isCompared && next(this.colors),
      s: () => next(this.axis),
      0: () => this.camera.reset(),
    };
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    if (layer) layer.box.checked = layer.isShown = !layer.isShown;
    else if (keys[e.key]) keys[e.key]();
    else return;
    e.preventDefault();
    this.redraw();
  }

  look() {
    const axis = SECTIONS[this.axis.selectedIndex][1];
    const section = [0, 0, 0, 1];
    if (axis !== null) {
      const { low, high } = this.box;
      section[axis] = 1;
      section[3] = low[axis] + this.depth.value * (high[axis] - low[axis]);
    }
    const measure = this.colors.value;
    let top = 0;
    if (measure)
      for (const layer of this.scene.layers.filter((l) => l.isShown))
        for (const state of layer.shapes.keys()) top = Math.max(top, largest(measured(layer, state, measure)));
    return { state: Number(this.state.value), section, measure, top, lines: this.lines.checked };
  }

  redraw() {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      const look = this.look();
      const nearest = Math.round(look.state);
      this.depth.disabled = this.axis.selectedIndex === 0;
      this.name.textContent = this.scene.states[nearest];
      const count = (this.scene.lines[nearest]?.length ?? 0) / 6;
      this.count.textContent = count ? `(red, ${count} pairs)` : "(none)";
      this.legend.hidden = !look.measure;
      if (look.measure) this.top.textContent = `${look.top.toPrecision(3)} ${UNITS[look.measure]}`;
      this.painter.paint(this.scene, this.camera, look);
      this.root.dataset.ready ??= Math.round(performance.now());
    });
  }

  resize() {
    const scale = Math.min(2, window.devicePixelRatio || 1);
    this.canvas.width = Math.max(1, Math.round(this.canvas.clientWidth * scale));
    this.canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * scale));
    this.redraw();
  }
}

for (const root of document.querySelectorAll(".viewer")) {
  const [head, data] = [...root.querySelectorAll("script")].map((script) => script.textContent);
  const unavailable = (error) => {
    root.replaceChildren(element("p", {}, `The meshes cannot be shown here: ${error.message}.`));
  };
  if (typeof DecompressionStream === "undefined") unavailable(new Error("this browser is too old"));
  else
    inflated(data)
      .then((bytes) => new Viewer(root, decoded(JSON.parse(head), bytes)))
      .catch(unavailable);
}
