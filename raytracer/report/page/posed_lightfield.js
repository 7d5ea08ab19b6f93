"use strict";

/* A light field of views with poses of their own: a drag goes round what they look at, a wheel comes nearer.

   The surfaces that the views most like the camera see are drawn into its picture as small quads, the nearest of them;
   what another view sees through is taken away; the point of each pixel is looked up in the views that see it, and the
   best are blended (Buehler et al. 2001), as in `raytracer.lightfield.views.unstructured`.

   data.views: {pose: [position, right, up, forward], plane: [pixel right, pixel down, left, top], picture, depth, high,
   probes}; depth as 16 bits in two bytes: 0 where it is not known, then squares up to `high` (1/m); without it a plane
   through data.center stands for all surfaces. */

const { views, width, height, code } = data;
const [WIDE, TALL] = data.picture;
const canvas = find("#picture");

// Times that surfaces are drawn, each without what views saw through in the last.
const ROUNDS = 2;
const VFOV = [5, 120];
const PROBES = 5;
// Of the picture, in a row and in a column, of which views see something or not.
const CELLS = 8;
const KEY_TURN = Math.PI / 36;
const KEY_ZOOM = 1.1;
const HIGHEST = (89 / 180) * Math.PI;
const NEAREST = 1e-3;

// ---- vectors ----

const add = (a, b, times = 1) => a.map((value, axis) => value + times * b[axis]);
const minus = (a, b) => add(a, b, -1);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((value) => value / Math.hypot(...a));
const clamp = (value, [low, high]) => Math.min(high, Math.max(low, value));

/* A vector turned about an axis. */
function turned(vector, axis, angle) {
  const along = axis.map((value) => value * dot(axis, vector));
  return add(add(along, minus(vector, along), Math.cos(angle)), cross(axis, vector), Math.sin(angle));
}

// ---- state ----

const initial = { from: data.start.from, toward: data.start.toward, vfov: data.start.vfov, ev: data.exposure };
const state = { ...initial };

function choose(values) {
  const next = { ...state, ...values };
  const sight = minus(next.toward, next.from);
  // Along the axis that is up, nothing is up in the picture.
  if (!(Math.hypot(...cross(sight, data.up)) > 1e-6 * Math.hypot(...sight))) return;
  Object.assign(state, next, { vfov: clamp(next.vfov, VFOV) });
  update();
}

/* Turn right and up by angles: the camera about what it looks at, or its sight about the camera. */
function turn(right, up) {
  const arm = data.inward ? minus(state.from, state.toward) : minus(state.toward, state.from);
  const height = Math.asin(clamp(dot(unit(arm), data.up), [-1, 1]));
  const raised = clamp(height + up, [-HIGHEST, HIGHEST]) - height;
  const across = unit(cross(data.up, arm));
  const moved = turned(turned(arm, across, -raised), data.up, right);
  choose(data.inward ? { from: add(state.toward, moved) } : { toward: add(state.from, moved) });
}

/* Come nearer by a factor, or go forward in a room, not beyond where cameras stand. */
function approach(factor) {
  const sight = minus(state.toward, state.from);
  if (data.inward) {
    const distance = clamp(Math.hypot(...sight) / factor, [0.02 * data.reach, 20 * data.reach]);
    choose({ from: add(state.toward, unit(sight), -distance) });
    return;
  }
  const step = data.reach * Math.log(factor);
  const from = add(state.from, unit(sight), step);
  const away = minus(from, data.center);
  const kept = Math.hypot(...away) > data.reach ? add(data.center, unit(away), data.reach) : from;
  choose({ from: kept, toward: add(kept, sight) });
}

// ---- cameras ----

/* The camera of the picture, in the form of the views. */
function cameraOf({ from, toward, vfov }) {
  const forward = unit(minus(toward, from));
  const right = unit(cross(forward, data.up));
  const top = Math.tan((vfov * Math.PI) / 360);
  const pixel = (2 * top) / TALL;
  return { pose: [from, right, cross(right, forward), forward], plane: [pixel, pixel, -0.5 * pixel * WIDE, top] };
}

/* Four times four numbers for shaders; places are told from the middle, for the sake of 32 bits. */
function numbersOf({ pose: [origin, right, up, forward], plane: [pixel, pixelDown, left, top] }) {
  return [...minus(origin, data.center), pixel, ...right, left, ...up, top, ...forward, pixelDown];
}

/* The point that a view sees at a place of its picture, at one over a depth: with that as its last coordinate. */
function pointAt({ pose, plane }, x, y, inverse) {
  const ahead = add(add(pose[3], pose[1], plane[2] + plane[0] * x), pose[2], plane[3] - plane[1] * y);
  return { ahead, point: add(ahead, pose[0], inverse) };
}

/* One over the depth of a view at one of its probes; NaN where it is not known. */
function probe(view, number, camera) {
  if (hasDepth) return Number(view.probes[number]);
  const { ahead } = pointAt(view, ...probePlace(number), 0);
  const inverse = dot(camera.pose[3], ahead) / dot(camera.pose[3], minus(data.center, view.pose[0]));
  return inverse > 0 && Number.isFinite(inverse) ? inverse : NaN;
}

function probePlace(number) {
  const middle = (place, size) => Math.floor(((place + 0.5) * size) / PROBES) + 0.5;
  return [middle(number % PROBES, width), middle(Math.floor(number / PROBES), height)];
}

/* How a view compares with the camera: the median angle between their rays to what both see, infinite if they see
   nothing alike, and the cells of the picture that it sees something of. */
function compared(number, camera) {
  const view = views[number];
  const angles = [];
  const cells = new Set();
  for (let at = 0; at < PROBES * PROBES; at++) {
    const inverse = probe(view, at, camera);
    if (Number.isNaN(inverse)) continue;
    const { ahead, point } = pointAt(view, ...probePlace(at), inverse);
    const ray = add(point, camera.pose[0], -inverse);
    const depth = dot(ray, camera.pose[3]);
    if (depth <= 0) continue;
    const place = [dot(ray, camera.pose[1]) / -camera.plane[2], -dot(ray, camera.pose[2]) / camera.plane[3]].map((part) => part / depth);
    if (!place.every((part) => Math.abs(part) <= 1)) continue;
    angles.push(Math.atan2(Math.hypot(...cross(ahead, ray)), dot(ahead, ray)));
    const [x, y] = place.map((part) => Math.min(CELLS - 1, Math.floor((0.5 + 0.5 * part) * CELLS)));
    cells.add(y * CELLS + x);
  }
  const angle = angles.length ? angles.sort((a, b) => a - b)[Math.floor(angles.length / 2)] : Infinity;
  return { number, angle, cells };
}

/* Views compared with the camera, those most like it first. */
const mostAlike = (camera, numbers) => numbers.map((number) => compared(number, camera)).sort((a, b) => a.angle - b.angle);

/* Numbers of the views that a picture is drawn of, those most like the camera first: some that are, and further ones
   that see parts of the picture that these do not. */
function chosenViews(camera, numbers) {
  const alike = mostAlike(camera, numbers).filter(({ angle }) => angle < Infinity);
  const chosen = alike.slice(0, ALIKE);
  const covered = new Set(chosen.flatMap(({ cells }) => [...cells]));
  for (const view of alike.slice(ALIKE)) {
    if (chosen.length === SLOTS) break;
    if ([...view.cells].every((cell) => covered.has(cell))) continue;
    chosen.push(view);
    for (const cell of view.cells) covered.add(cell);
  }
  for (const view of alike.slice(ALIKE)) if (chosen.length < SLOTS && !chosen.includes(view)) chosen.push(view);
  return chosen.sort((a, b) => a.angle - b.angle).map(({ number }) => number);
}

// ---- the picture ----

class Painter {
  constructor() {
    const gl = (this.gl = webglOf(canvas, "pictures from any side"));
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Trouble("This browser's WebGL cannot hold depth, which looking around needs.");
    this.slopes = programOf(gl, SLOPES);
    this.corner = programOf(gl, CORNERS);
    this.quads = programOf(gl, SURFACE, QUADS);
    this.false = programOf(gl, FALSE);
    this.blend = programOf(gl, BLEND);
    this.views = new ViewTextures(gl, width, height, views.length, code);
    const layers = (format, count) => {
      const texture = textureOf(gl, gl.TEXTURE_2D_ARRAY, gl.NEAREST);
      gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, format, width, height, count);
      return texture;
    };
    this.depths = layers(gl.RG8, hasDepth ? views.length : 1);
    this.surfaces = layers(gl.RGBA32F, SLOTS);
    this.marks = layers(gl.RGBA8, SLOTS);
    this.corners = layers(gl.RGBA32F, SLOTS);
    const flat = (format) => {
      const texture = textureOf(gl, gl.TEXTURE_2D, gl.NEAREST);
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, WIDE, TALL);
      return texture;
    };
    this.surface = flat(gl.RGBA32F);
    this.limits = [flat(gl.R32F), flat(gl.R32F)];
    this.target = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, flat(gl.DEPTH_COMPONENT32F), 0);
    this.plain = gl.createFramebuffer();
    if (gl.getError() === gl.OUT_OF_MEMORY) throw new Trouble("The graphics memory of this device does not hold these views.");
    gl.frontFace(gl.CW);
    const quads = Uint32Array.from({ length: 6 * width * height }, (_, place) => 4 * Math.floor(place / 6) + [0, 1, 2, 1, 3, 2][place % 6]);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, quads, gl.STATIC_DRAW);
    this.held = Array(SLOTS).fill(-1);
  }

  put(number, picture, depth) {
    const gl = this.gl;
    if (hasDepth) {
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.depths);
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, number, width, height, 1, gl.RG, gl.UNSIGNED_BYTE, depth);
    }
    this.views.put(number, picture);
  }

  /* Use a program with what all have in common, and textures by name. */
  #use(program, textures) {
    const gl = this.gl;
    gl.useProgram(program.program);
    gl.uniform4fv(program.place("cameras"), this.cameras);
    gl.uniform2i(program.place("size"), width, height);
    gl.uniform2f(program.place("target"), WIDE, TALL);
    for (const [unit, [name, kind, texture]] of textures.entries()) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(kind, texture);
      gl.uniform1i(program.place(name), unit);
    }
  }

  /* Give the views most like the camera the slots, in which the others stay; return them in the order of likeness. */
  #fill(camera) {
    const gl = this.gl;
    const alike = chosenViews(camera, [...this.views.there]);
    const wanted = new Set(alike);
    const fresh = alike.filter((number) => !this.held.includes(number));
    const renewed = [];
    for (let slot = 0; slot < SLOTS; slot++) {
      if (!wanted.has(this.held[slot])) {
        this.held[slot] = fresh.shift() ?? -1;
        renewed.push(slot);
      } else if (!hasDepth) renewed.push(slot);
    }
    this.cameras = new Float32Array([...this.held.map((number) => numbersOf(views[Math.max(number, 0)])), numbersOf(camera)].flat());
    this.#use(this.slopes, this.#stacks("depths"));
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.plain);
    gl.viewport(0, 0, width, height);
    for (const slot of renewed) {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.surfaces, 0, slot);
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, this.marks, 0, slot);
      gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
      if (this.held[slot] < 0) {
        gl.clearBufferfv(gl.COLOR, 0, [-1, 0, 0, 0]);
        gl.clearBufferfv(gl.COLOR, 1, [0, 0, 0, 0]);
        continue;
      }
      gl.uniform1i(this.slopes.place("number"), this.held[slot]);
      gl.uniform1i(this.slopes.place("slot"), slot);
      gl.uniform1f(this.slopes.place("high"), views[this.held[slot]].high ?? 0);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT1, null, 0, 0);
    gl.drawBuffers([gl.COLOR_ATTACHMENT0]);
    this.#use(this.corner, this.#stacks("surfaces", "marks"));
    for (const slot of renewed) {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, this.corners, 0, slot);
      gl.uniform1i(this.corner.place("slot"), slot);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    return alike.map((number) => this.held.indexOf(number));
  }

  #stacks(...names) {
    return names.map((name) => [name, this.gl.TEXTURE_2D_ARRAY, this[name]]);
  }

  #into(framebuffer, texture) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    if (texture) gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    gl.viewport(0, 0, WIDE, TALL);
  }

  #drawSurfaces(slots, limit, near) {
    const gl = this.gl;
    this.#into(this.target, this.surface);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.depthFunc(gl.LEQUAL);
    gl.clearBufferfv(gl.COLOR, 0, [-1, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    this.#use(this.quads, [...this.#stacks("surfaces", "corners"), ["limit", gl.TEXTURE_2D, limit]]);
    gl.uniform1f(this.quads.place("near"), near);
    for (const [rank, slot] of slots.entries()) {
      gl.uniform1i(this.quads.place("slot"), slot);
      gl.uniform1f(this.quads.place("push"), (2 * rank) / SLOTS);
      gl.drawElements(gl.TRIANGLES, 6 * width * height, gl.UNSIGNED_INT, 0);
    }
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
  }

  draw() {
    const gl = this.gl;
    const camera = cameraOf(state);
    const slots = this.#fill(camera);
    const stacks = this.#stacks("surfaces", "marks");
    let [limit, next] = this.limits;
    this.#into(this.plain, limit);
    gl.clearBufferfv(gl.COLOR, 0, [1e30, 0, 0, 0]);
    for (let round = 0; round < ROUNDS; round++) {
      if (round > 0) {
        this.#into(this.plain, next);
        this.#use(this.false, [...stacks, ["limit", gl.TEXTURE_2D, limit], ["surface", gl.TEXTURE_2D, this.surface]]);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
        [limit, next] = [next, limit];
      }
      this.#drawSurfaces(slots, limit, NEAREST * data.reach);
    }
    this.#into(null, null);
    this.#use(this.blend, [...stacks, ["views", gl.TEXTURE_2D_ARRAY, this.views.layers], ["surface", gl.TEXTURE_2D, this.surface]]);
    gl.uniform1iv(this.blend.place("numbers"), this.held.map((number) => Math.max(number, 0)));
    gl.uniform1f(this.blend.place("gain"), code.unit * 2 ** state.ev);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

let painter = null;
let frame = null;

function paint() {
  frame = null;
  if (painter === null || painter.views.there.size === 0 || painter.gl.isContextLost()) return;
  painter.draw();
  document.body.dataset.shown = addressOf();
}

/* The picture as it is, in a canvas of its own. */
function picture() {
  paint();
  return copyOf(canvas);
}

const save = () => saveAs(picture(), data.name);

/* Decode all views, those most like the camera first, into textures. */
async function load() {
  const order = mostAlike(cameraOf(state), views.map((_, number) => number)).map(({ number }) => number);
  const picturesOf = ({ picture, depth }) => (hasDepth ? [picture, depth] : [picture]);
  await loadOnto(() => (painter = new Painter()), order, (number) => picturesOf(views[number]), (mine, ...view) => mine.put(...view));
}

canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
canvas.addEventListener("webglcontextrestored", () => { load(); });

// ---- controls ----

const sliders = { vfov: find("#vfov-slider"), exposure: find("#exposure-slider") };

function tell(name, value, text) {
  sliders[name].value = String(value);
  sliders[name].setAttribute("aria-valuetext", text);
  find(`#${name} output`).textContent = text;
}

const placeText = (place) => place.map((value) => shortNumber(Math.abs(value) < 1e-6 * data.reach ? 0 : value, 3)).join(", ");

function showControls() {
  tell("vfov", state.vfov, `${shortNumber(state.vfov, 3)}\u00b0`);
  tell("exposure", state.ev, evText(state.ev));
  find("#place output").textContent = placeText(state.from);
  find("#aim output").textContent = placeText(state.toward);
  find("#distance output").textContent = `${shortNumber(Math.hypot(...minus(state.toward, state.from)), 3)} m`;
  canvas.setAttribute("aria-label", `picture, seen from ${placeText(state.from)}`);
}

sliders.vfov.addEventListener("input", ({ target }) => choose({ vfov: target.valueAsNumber }));
sliders.exposure.addEventListener("input", ({ target }) => choose({ ev: target.valueAsNumber }));
find("#first").addEventListener("click", () => choose(initial));
find("#save").addEventListener("click", save);

// ---- pointers: one drags, two pinch ----

const pointers = new Map();
const apart = () => {
  const [a, b] = [...pointers.values()];
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
};

canvas.addEventListener("pointerdown", (event) => {
  if (event.button !== 0) return;
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
  find("#stage").classList.add("dragging");
});
canvas.addEventListener("pointermove", (event) => {
  const last = pointers.get(event.pointerId);
  if (last === undefined) return;
  const before = pointers.size === 2 ? apart() : 0;
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
  if (pointers.size === 2) {
    if (before > 0) approach(apart() / before);
    return;
  }
  if (pointers.size > 2) return;
  // Across the picture is half a turn about an object; in a room what is under the hand stays there.
  const tall = canvas.getBoundingClientRect().height;
  const rate = data.inward ? Math.PI / tall : ((state.vfov / 180) * Math.PI) / tall;
  turn(-(event.clientX - last[0]) * rate * (data.inward ? 1 : -1), (event.clientY - last[1]) * rate);
});
for (const kind of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(kind, (event) => {
    pointers.delete(event.pointerId);
    if (pointers.size === 0) find("#stage").classList.remove("dragging");
  });
}
canvas.addEventListener("wheel", (event) => {
  if (event.ctrlKey) return;
  event.preventDefault();
  // Lines and pages in pixels.
  approach(Math.exp((-0.0015) * event.deltaY * [1, 20, 400][event.deltaMode]));
}, { passive: false });

// ---- keys ----

const MOVES = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || painter === null) return;
  // Sliders have these keys for themselves.
  const taken = event.target.closest("input") !== null;
  if (event.key === "s") save();
  else if (event.key in MOVES && !taken) {
    const [right, up] = MOVES[event.key];
    turn(KEY_TURN * right * (data.inward ? 1 : -1), KEY_TURN * up);
  } else if (event.key === "+" || event.key === "=") approach(KEY_ZOOM);
  else if (event.key === "-") approach(1 / KEY_ZOOM);
  else if (event.key === "Home" && !taken) choose(initial);
  else return;
  event.preventDefault();
});

// ---- the address ----

function addressOf() {
  const place = (values) => values.map((value) => roundedNumber(Math.abs(value) < 1e-6 * data.reach ? 0 : value)).join(",");
  return [`from=${place(state.from)}`, `toward=${place(state.toward)}`, `vfov=${roundedNumber(state.vfov, 4)}`, `ev=${state.ev}`].join("&");
}

const writeAddress = addressWriter(addressOf);

/* Set the state that the address holds; the rest stays. */
function readAddress() {
  const said = new URLSearchParams(location.hash.slice(1));
  const chosen = {};
  for (const key of ["from", "toward"]) {
    const place = (said.get(key) ?? "").split(",").map(numberIn);
    if (place.length === 3 && place.every(Number.isFinite)) chosen[key] = place;
  }
  const vfov = numberIn(said.get("vfov"));
  if (vfov > 0) chosen.vfov = vfov;
  const ev = numberIn(said.get("ev"));
  if (Number.isFinite(ev)) chosen.ev = clamp(ev, [data.exposure - EV_RANGE, data.exposure + EV_RANGE]);
  choose(chosen);
}

// ---- all together ----

function update() {
  showControls();
  frame ??= requestAnimationFrame(paint);
  writeAddress();
}

fillStage(WIDE, TALL, Math.max(2 * WIDE, 640));
sliders.vfov.min = String(VFOV[0]);
sliders.vfov.max = String(VFOV[1]);
sliders.exposure.min = String(data.exposure - EV_RANGE);
sliders.exposure.max = String(data.exposure + EV_RANGE);
find("#help").textContent = data.inward
  ? "Drag to go round, and turn the wheel or pinch to come nearer."
  : "Drag to look around, and turn the wheel or pinch to go forward.";
find("#keys").append(...keyHints([["\u2190 \u2191 \u2192 \u2193", data.inward ? "go round" : "look around"], ["+ \u2212", "nearer, farther"], ["Home", "as at first"], ["s", "save"]]));
window.addEventListener("hashchange", readAddress);
readAddress();
load();
