"use strict";

/* A light field: a click focuses, a drag moves the viewpoint, a slider opens the aperture.

   The picture is the mean of the views that the aperture lets through, each shifted so that what is at the focus
   distance 1 / w lies over itself: the view at u is taken at x - u (w - w0), as `raytracer.film.light_field.views` has it.  It
   is made of linear light on the pixels of the views, and encoded as sRGB at last.

   data.views: {at: [right, up], share, picture}, the place in the plane of the views (m) and the part of the view that
   the whole aperture lets through; data.code: {unit, share, peak}, how 8 bits hold light; data.depth: {width, height,
   low, high, at, values}, one over the distance for places in the picture seen from `at`, in 16 bits, 0 being unknown. */

const { views, width, height, pixel, code, spacing } = data;
const W0 = data.inverse_focus;

const GLIDE_MS = 220;
const CLICK_PX = { mouse: 4, touch: 10, pen: 6 };
// Points in each direction over a cell, or over an aperture that is smaller than that.
const GRID = 16;
// Planes along which a click is followed to what it hits.
const PLANES = 256;
const CLOSED = 0;

// ---- places of the views ----

const seen = views.filter(({ share }) => share > 0);
const extremes = (axis, of = seen) => [Math.min(...of.map(({ at }) => at[axis])), Math.max(...of.map(({ at }) => at[axis]))];
const bounds = [extremes(0), extremes(1)];
const extent = bounds.map(([low, high], axis) => high - low + spacing[axis]);
const radius = data.aperture === null ? Infinity : 0.5 * data.aperture;
const flat = spacing.filter((step) => step === 0).length > 0;
const alone = views.length === 1;

/* Width and height of the aperture, fully open (m). */
function widest(shape) {
  if (data.aperture !== null) return [data.aperture, data.aperture];
  const round = Math.min(...extent.filter((_, axis) => spacing[axis] > 0));
  return shape === "round" ? [round, round] : extent;
}

/* Clamp the viewpoint to the places of the views. */
function within(eye) {
  const kept = eye.map((place, axis) => Math.min(bounds[axis][1], Math.max(bounds[axis][0], place)));
  const away = Math.hypot(...kept);
  return away > radius ? kept.map((place) => (place * radius) / away) : kept;
}

/* Weights of the views: the part of its cell that the aperture covers.  Of an aperture that is smaller than a cell
   the views around share, so that nothing jumps when it moves; closed, that is linear interpolation between them. */
function weightsOf(eye, opening, shape) {
  const half = widest(shape).map((size) => (0.5 * size * opening) || 0);
  const axes = [0, 1].filter((axis) => spacing[axis] > 0);
  const softness = spacing.map((cell, axis) => cell * Math.max(0, 1 - half[axis] / cell));
  const small = axes.some((axis) => half[axis] < spacing[axis]);
  const inside = (place) => {
    if (shape === "round") return axes.reduce((sum, axis) => sum + (place[axis] / half[axis]) ** 2, 0) <= 1;
    return axes.every((axis) => Math.abs(place[axis]) <= half[axis] * (1 + 1e-9));
  };
  // A box as wide as the cell, drawn through one as wide as the softness.
  const cell = (place) => axes.reduce((product, axis) => {
    const [size, soft] = [spacing[axis], softness[axis]];
    const away = Math.abs(place[axis]);
    const ramp = soft > 0 ? (0.5 * (size + soft) - away) / soft : Number(away <= 0.5 * size);
    return product * Math.min(1, Math.max(0, ramp));
  }, 1);
  const grid = (sizes) => {
    const steps = Array.from({ length: GRID }, (_, step) => (2 * step + 1) / GRID - 1);
    const [across, up] = [0, 1].map((axis) => (spacing[axis] > 0 ? steps.map((step) => step * sizes[axis]) : [0]));
    return up.flatMap((y) => across.map((x) => [x, y]));
  };
  const points = opening <= CLOSED ? [[0, 0]] : small ? grid(half).filter(inside) : grid(spacing.map((size) => 0.5 * size));
  const weights = views.map(({ at, share }) => {
    if (share <= 0) return 0;
    const away = [at[0] - eye[0], at[1] - eye[1]];
    const reach = axes.every((axis) => Math.abs(away[axis]) <= half[axis] + spacing[axis]);
    if (!reach) return 0;
    const one = small || opening <= CLOSED
      ? ([x, y]) => cell([x - away[0], y - away[1]])
      : ([x, y]) => Number(inside([x + away[0], y + away[1]]));
    return Math.min(share, points.reduce((sum, point) => sum + one(point), 0) / points.length);
  });
  if (weights.some((weight) => weight > 0)) return weights;
  // Between views that are far apart the nearest is what there is.
  const away = views.map(({ at, share }) => (share > 0 ? Math.hypot(at[0] - eye[0], at[1] - eye[1]) : Infinity));
  const nearest = away.indexOf(Math.min(...away));
  return views.map((_, number) => Number(number === nearest));
}

// ---- depth ----

const depth = data.depth && (() => {
  const bytes = bytesOf(data.depth.values);
  const numbers = new DataView(bytes.buffer);
  const { low, high } = data.depth;
  const codes = Float32Array.from({ length: bytes.length / 2 }, (_, place) => numbers.getUint16(2 * place, true));
  return { ...data.depth, values: codes.map((value) => (value === 0 ? NaN : low + ((value - 1) / 65534) * (high - low))) };
})();

/* One over the distance at a place (0..1, right and down) of the map; NaN where it is not known. */
function mapped(x, y) {
  const column = Math.min(depth.width - 1, Math.max(0, Math.floor(x * depth.width)));
  const row = Math.min(depth.height - 1, Math.max(0, Math.floor(y * depth.height)));
  return depth.values[row * depth.width + column];
}

/* One over the distance of the point at a place of the picture; NaN if it is not known.

   From the nearest plane to the farthest: the first that lies behind what is in the map at its place. */
function hit(x, y) {
  if (!depth) return NaN;
  const moved = (w) => [0, 1].map((axis) => (state.eye[axis] * (w - state.w) - depth.at[axis] * (w - W0)) / pixel);
  const at = (w) => {
    const [right, up] = moved(w);
    return mapped(x + right / width, y - up / height);
  };
  let last = NaN;
  for (let plane = 0; plane <= PLANES; plane++) {
    const w = depth.high + (plane / PLANES) * (depth.low - depth.high);
    const found = at(w);
    if (found >= w) return found;
    if (!Number.isNaN(found)) last = found;
  }
  return last;
}

// ---- state ----

const start = { w: data.start, opening: 1, shape: data.aperture === null ? "square" : "round", eye: within([0, 0]), ev: data.exposure };
const state = { ...start, eye: start.eye.slice() };
let opened = 1;

function choose(values) {
  Object.assign(state, values);
  state.eye = within(state.eye);
  state.w = Math.min(data.nearest, Math.max(data.farthest, state.w));
  if (state.opening > CLOSED) opened = state.opening;
  update();
}

let gliding = null;

/* Move the focus smoothly, as a lens does. */
function focusOn(w) {
  halt();
  if (Number.isNaN(w)) return;
  const from = state.w;
  const began = performance.now();
  const quick = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const step = (now) => {
    const part = quick ? 1 : Math.min(1, Math.max(0, (now - began) / GLIDE_MS));
    choose({ w: part === 1 ? w : from + (w - from) * part * part * (3 - 2 * part) });
    gliding = part < 1 ? requestAnimationFrame(step) : null;
  };
  gliding = requestAnimationFrame(step);
}

function halt() {
  cancelAnimationFrame(gliding);
  gliding = null;
}

const toggleSharp = () => choose({ opening: state.opening > CLOSED ? CLOSED : opened });

// ---- the picture ----

const canvas = find("#picture");

/* `list` has for each view how far it moves, right and down in pictures per 1/m, its weight and its layer. */
const DRAW = `#version 300 es
precision highp float;
precision highp sampler2DArray;
uniform sampler2DArray views;
uniform highp sampler2D list;
uniform int count;
uniform vec2 size;
uniform float defocus, gain;
out vec4 shown;
${ENCODE}
void main() {
  vec2 at = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y) / size;
  vec3 sum = vec3(0.0);
  float weight = 0.0;
  for (int number = 0; number < count; number++) {
    vec4 entry = texelFetch(list, ivec2(number, 0), 0);
    vec2 place = at + entry.xy * defocus;
    if (any(lessThan(place, vec2(0.0))) || any(greaterThan(place, vec2(1.0)))) continue;
    sum += entry.z * texture(views, vec3(place, entry.w)).rgb;
    weight += entry.z;
  }
  shown = weight > 0.0 ? vec4(encode(gain * sum / max(weight, 1e-20)), 1.0) : vec4(0.0);
}`;

/* What draws the views. */
class Painter {
  constructor() {
    const gl = (this.gl = webglOf(canvas, "focusing and looking around"));
    this.draws = programOf(gl, DRAW);
    this.views = new ViewTextures(gl, width, height, views.length, code);
    this.list = textureOf(gl, gl.TEXTURE_2D, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, views.length, 1);
    if (gl.getError() === gl.OUT_OF_MEMORY) throw new Trouble("The graphics memory of this device does not hold these views.");
  }

  draw(weights) {
    const gl = this.gl;
    const rows = views.flatMap(({ at }, number) => (weights[number] > 0 && this.views.there.has(number)
      ? [[at[0] / (pixel * width), -at[1] / (pixel * height), weights[number], number]] : []));
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.list);
    if (rows.length) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, rows.length, 1, gl.RGBA, gl.FLOAT, new Float32Array(rows.flat()));
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.views.layers);
    gl.viewport(0, 0, width, height);
    gl.useProgram(this.draws.program);
    gl.uniform1i(this.draws.place("views"), 0);
    gl.uniform1i(this.draws.place("list"), 1);
    gl.uniform1i(this.draws.place("count"), rows.length);
    gl.uniform2f(this.draws.place("size"), width, height);
    gl.uniform1f(this.draws.place("defocus"), W0 - state.w);
    gl.uniform1f(this.draws.place("gain"), code.unit * 2 ** state.ev);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

let painter = null;
let weights = [];
let frame = null;

function paint() {
  frame = null;
  if (painter === null || painter.views.there.size === 0 || painter.gl.isContextLost()) return;
  painter.draw(weights);
  document.body.dataset.shown = addressOf();
}

/* The picture as it is, on the pixels of the views, in a canvas of its own. */
function picture() {
  paint();
  return copyOf(canvas);
}

const save = () => saveAs(picture(), data.name);

// ---- loading ----

/* Decode all views, those nearest to the middle first, into a texture. */
async function load() {
  const away = ({ at }) => Math.hypot(...at.map((place, axis) => (extent[axis] ? place / extent[axis] : 0)));
  const order = views.map((_, number) => number).sort((a, b) => away(views[a]) - away(views[b]));
  await loadOnto(() => (painter = new Painter()), order, (number) => [views[number].picture], (mine, number, picture) => mine.views.put(number, picture));
}

canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
canvas.addEventListener("webglcontextrestored", () => { load(); });

// ---- texts ----

const metric = data.unit === "m";

function distanceText(w) {
  if (!metric) return `slope ${shortNumber(w, 3)} px`;
  if (w <= 1e-9) return "\u221e";
  return lengthText(1 / w);
}

function lengthText(metres) {
  if (!metric) return shortNumber(metres, 3);
  const size = Math.abs(metres);
  if (size < 0.1) return `${Number((1000 * metres).toPrecision(3))} mm`;
  return `${size < 100 ? metres.toPrecision(3) : shortNumber(metres, 3)} m`;
}

function apertureText() {
  const used = weights.filter((weight) => weight > 0).length;
  const count = used === views.length ? `all ${used} views` : `${used} ${used === 1 ? "view" : "views"}`;
  if (state.opening <= CLOSED) return "closed: everything is sharp";
  const sizes = widest(state.shape).map((size) => size * state.opening);
  if (data.focal_length !== null && data.aperture !== null) return `f/${shortNumber(data.focal_length / (1000 * sizes[0]), 3)}, ${count}`;
  if (!metric) return count;
  const words = sizes.filter((_, axis) => spacing[axis] > 0).map((size) => Number((1000 * size).toPrecision(3)));
  return `${[...new Set(words)].join(" \u00d7 ")} mm, ${count}`;
}

function eyeText() {
  const near = (axis) => Math.abs(state.eye[axis]) < 1e-3 * Math.max(...extent);
  if (near(0) && near(1)) return "the middle";
  const words = [["right", "left"], ["up", "down"]].flatMap(([more, less], axis) => (near(axis) ? []
    : [`${lengthText(Math.abs(state.eye[axis]))} ${state.eye[axis] > 0 ? more : less}`]));
  return words.join(", ");
}

// ---- controls ----

const sliders = { focus: find("#focus-slider"), aperture: find("#aperture-slider"), exposure: find("#exposure-slider") };

function tell(name, value, text) {
  sliders[name].value = String(value);
  sliders[name].setAttribute("aria-valuetext", text);
  find(`#${name} output`).textContent = text;
}

const SVG = "http://www.w3.org/2000/svg";
const pupil = find("#pupil svg");
const span = Math.max(...extent) || 1;
const dots = [];
let outline = null;
const spot = document.createElementNS(SVG, "circle");

function svg(tag, attributes) {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

const shown = extent.map((size) => Math.max(size, 0.12 * span) / span);
pupil.setAttribute("viewBox", [-0.55 * shown[0], -0.55 * shown[1], 1.1 * shown[0], 1.1 * shown[1]].join(" "));
const middle = bounds.map(([low, high]) => 0.5 * (low + high));
const onPupil = ([right, up]) => [(right - middle[0]) / span, -(up - middle[1]) / span];
const dot = 0.33 * (Math.min(...spacing.filter((step) => step > 0), span) / span);
for (const { at, share } of views) {
  const [cx, cy] = onPupil(at);
  const element = svg("circle", { cx, cy, r: Math.min(0.03, dot), class: "view" });
  element.style.visibility = share > 0 ? "" : "hidden";
  dots.push(element);
  pupil.append(element);
}

function showPupil() {
  const most = Math.max(...weights);
  dots.forEach((element, number) => {
    element.setAttribute("class", weights[number] > 0 ? "used" : "view");
    element.setAttribute("fill-opacity", weights[number] > 0 ? 0.25 + (0.75 * weights[number]) / most : 0.3);
  });
  const [cx, cy] = onPupil(state.eye);
  const half = widest(state.shape).map((size, axis) => Math.max(0.5 * state.opening * (spacing[axis] > 0 ? size : 0.04 * span), 0.008 * span) / span);
  outline?.remove();
  outline = state.shape === "round" && !flat
    ? svg("circle", { cx, cy, r: half[0], class: "opening" })
    : svg("rect", { x: cx - half[0], y: cy - half[1], width: 2 * half[0], height: 2 * half[1], class: "opening" });
  pupil.append(outline);
  for (const [key, value] of Object.entries({ cx, cy, r: 0.012, class: "eye" })) spot.setAttribute(key, value);
  pupil.append(spot);
}

const sliderOf = (w) => (1000 * (data.nearest - w)) / (data.nearest - data.farthest);

function showControls() {
  tell("focus", sliderOf(state.w), distanceText(state.w));
  tell("aperture", 100 * state.opening, apertureText());
  tell("exposure", state.ev, evText(state.ev));
  find("#pupil output").textContent = eyeText();
  find("#shape select").value = state.shape;
  find("#sharp").setAttribute("aria-pressed", String(state.opening <= CLOSED));
  find("#middle").disabled = eyeText() === "the middle";
  canvas.setAttribute("aria-label", alone ? "picture"
    : `picture, focused at ${distanceText(state.w)}, seen from ${eyeText()}, aperture ${apertureText()}`);
}

sliders.focus.addEventListener("input", ({ target }) => {
  halt();
  choose({ w: data.nearest + (target.valueAsNumber / 1000) * (data.farthest - data.nearest) });
});
sliders.aperture.addEventListener("input", ({ target }) => choose({ opening: target.valueAsNumber / 100 }));
sliders.exposure.addEventListener("input", ({ target }) => choose({ ev: target.valueAsNumber }));
find("#shape select").addEventListener("change", ({ target }) => choose({ shape: target.value }));
find("#sharp").addEventListener("click", toggleSharp);
find("#middle").addEventListener("click", () => choose({ eye: [0, 0] }));
find("#save").addEventListener("click", save);

// ---- pointers ----

let drag = null;

const placeOf = (event) => {
  const box = canvas.getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
};

function focusAt(x, y) {
  const w = hit(x, y);
  const mark = find("#mark");
  mark.style.left = `${100 * x}%`;
  mark.style.top = `${100 * y}%`;
  mark.classList.remove("set");
  void mark.offsetWidth;
  mark.classList.add("set");
  find("#here").textContent = Number.isNaN(w) ? "distance not known here" : distanceText(w);
  focusOn(w);
}

canvas.addEventListener("pointerdown", (event) => {
  if (event.button !== 0 || alone) return;
  // A second finger zooms the page.
  if (drag !== null && event.pointerId !== drag.id) {
    drag = null;
    find("#stage").classList.remove("dragging");
    return;
  }
  canvas.setPointerCapture(event.pointerId);
  drag = { id: event.pointerId, from: [event.clientX, event.clientY], eye: state.eye.slice(), moved: false };
});
canvas.addEventListener("pointermove", (event) => {
  if (drag === null || drag.id !== event.pointerId) {
    if (event.pointerType === "mouse" && depth) {
      const w = hit(...placeOf(event));
      find("#here").textContent = Number.isNaN(w) ? "" : distanceText(w);
    }
    return;
  }
  const by = [event.clientX - drag.from[0], event.clientY - drag.from[1]];
  if (!drag.moved && Math.hypot(...by) < (CLICK_PX[event.pointerType] ?? CLICK_PX.mouse)) return;
  drag.moved = true;
  find("#stage").classList.add("dragging");
  find("#here").textContent = "";
  halt();
  // What is nearer than the focus goes with the hand; across the picture is from one end of the views to the other.
  const across = canvas.getBoundingClientRect().width;
  const range = Math.max(...bounds.map(([low, high]) => high - low));
  choose({ eye: [drag.eye[0] - (range * by[0]) / across, drag.eye[1] + (range * by[1]) / across] });
});
canvas.addEventListener("pointerup", (event) => {
  if (drag === null || drag.id !== event.pointerId) return;
  const { moved } = drag;
  drag = null;
  find("#stage").classList.remove("dragging");
  if (!moved) focusAt(...placeOf(event));
});
canvas.addEventListener("pointercancel", () => { drag = null; find("#stage").classList.remove("dragging"); });
canvas.addEventListener("pointerleave", () => { if (drag === null) find("#here").textContent = ""; });
canvas.addEventListener("dblclick", () => { if (!alone) toggleSharp(); });

function lookFrom(event) {
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(pupil.getScreenCTM().inverse());
  choose({ eye: [point.x * span + middle[0], -point.y * span + middle[1]] });
}
pupil.addEventListener("pointerdown", (event) => {
  if (alone) return;
  pupil.setPointerCapture(event.pointerId);
  lookFrom(event);
});
pupil.addEventListener("pointermove", (event) => { if (pupil.hasPointerCapture(event.pointerId)) lookFrom(event); });

// ---- keys ----

const MOVES = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select") || painter === null) return;
  const step = (data.nearest - data.farthest) / 50;
  if (event.key === "s") save();
  else if (alone) return;
  else if (event.key in MOVES) {
    // Sliders have these keys for themselves.
    if (event.target.closest("input")) return;
    choose({ eye: state.eye.map((place, axis) => place + 0.5 * spacing[axis] * MOVES[event.key][axis]) });
  } else if (event.key === "Enter" || event.key === " ") {
    if (event.target.closest("button, input")) return;
    focusAt(0.5, 0.5);
  } else if (event.key === "+" || event.key === "=") { halt(); choose({ w: state.w + step }); }
  else if (event.key === "-") { halt(); choose({ w: state.w - step }); }
  else if (event.key === "]") choose({ opening: Math.min(1, state.opening + 0.05) });
  else if (event.key === "[") choose({ opening: Math.max(CLOSED, state.opening - 0.05) });
  else if (event.key === "Home") { if (event.target.closest("input")) return; choose({ eye: [0, 0] }); }
  else if (event.key === "a") toggleSharp();
  else return;
  event.preventDefault();
});

// ---- the address ----

// Lengths across are written in mm where they are known.
const SCALE = metric ? 1000 : 1;

function addressOf() {
  const focus = !metric ? roundedNumber(state.w) : state.w <= 1e-9 ? "inf" : roundedNumber(1 / state.w);
  const eye = state.eye.map((place) => roundedNumber(Math.abs(place) < 1e-6 * span ? 0 : SCALE * place, 4));
  return [`focus=${focus}`, `aperture=${roundedNumber(state.opening, 3)}`, `from=${eye.join(",")}`, `ev=${state.ev}`,
    ...(flat || alone ? [] : [`shape=${state.shape}`])].join("&");
}

const writeAddress = addressWriter(addressOf);

/* Set the state that the address holds; the rest stays. */
function readAddress() {
  const said = new URLSearchParams(location.hash.slice(1));
  const chosen = {};
  const focus = said.get("focus") === "inf" && metric ? Infinity : numberIn(said.get("focus"));
  if (!Number.isNaN(focus) && (!metric || focus > 0)) chosen.w = metric ? 1 / focus : focus;
  const opening = numberIn(said.get("aperture"));
  if (opening >= 0 && opening <= 1) chosen.opening = opening;
  const eye = (said.get("from") ?? "").split(",").map(numberIn);
  if (eye.length === 2 && eye.every(Number.isFinite)) chosen.eye = eye.map((place) => place / SCALE);
  const ev = numberIn(said.get("ev"));
  if (Number.isFinite(ev)) chosen.ev = Math.min(data.exposure + EV_RANGE, Math.max(data.exposure - EV_RANGE, ev));
  if (["round", "square"].includes(said.get("shape")) && !flat) chosen.shape = said.get("shape");
  choose(chosen);
}

// ---- all together ----

function update() {
  weights = weightsOf(state.eye, state.opening, state.shape);
  showControls();
  showPupil();
  frame ??= requestAnimationFrame(paint);
  writeAddress();
}

// Beyond four screen pixels for each of theirs small views are enlarged no more, unless they are very small.
const stage = fillStage(width, height, Math.max(4 * width, 640));
sliders.exposure.min = String(data.exposure - EV_RANGE);
sliders.exposure.max = String(data.exposure + EV_RANGE);
stage.classList.toggle("pixels", 4 * width < 640);
stage.classList.toggle("still", alone);
const [nearEnd, farEnd] = find("#focus .ends").children;
nearEnd.textContent = distanceText(data.nearest);
farEnd.textContent = distanceText(data.farthest);
find("#shape").hidden = flat || alone;
if (alone) {
  for (const id of ["focus", "aperture", "pupil"]) find(`#${id}`).hidden = true;
  find("#sharp").hidden = find("#middle").hidden = true;
}
const helps = alone ? [] : [
  depth ? "Click to focus there." : "No distances are known: focus with the slider.",
  `Drag to look around${flat ? (spacing[0] > 0 ? ", left and right: there is one row of views" : ", up and down: there is one column of views") : ""}.`,
  "Double-click to make everything sharp, and again to open the aperture.",
];
find("#help").textContent = helps.join(" ");
const keys = alone ? [["s", "save"]] : [["\u2190 \u2191 \u2192 \u2193", "look around"], ["+ \u2212", "focus nearer, farther"], ["Enter", "focus on the middle"], ["[ ]", "aperture"], ["a", "everything sharp"], ["Home", "from the middle"], ["s", "save"]];
find("#keys").append(...keyHints(keys));
window.addEventListener("hashchange", readAddress);
readAddress();
load();
