/* The live view: what its socket sends is drawn here, in linear light, so that exposure and colours need no server. */

const STOP_LOW = -14;
const STOP_STEPS = 256;
const LIGHT = new Set(["radiance", "refocused", "standard error", "direct", "indirect", "albedo", "variance"]);
// Anchors of the colours of numbers, dark to bright: of Matplotlib's viridis.
const COLOURS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const GREY = 0.18;
const FALSE_STOPS = 6;

const socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
socket.binaryType = "arraybuffer";
const send = (message) => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); };

const wipe = new Wipe(find("#look"));
const canvas = make("canvas");
const small = make("canvas");
let state = {};
let frame = null;
let before = null;
let mode = "look";
let comparing = false;

// ---- Frames

/* A frame is a line of JSON and its pixels, rows of 32-bit floats. */
function decode(buffer) {
  const bytes = new Uint8Array(buffer);
  const end = bytes.indexOf(10) + 1;
  const head = JSON.parse(new TextDecoder().decode(bytes.subarray(0, end)));
  return { ...head, pixels: new Float32Array(buffer, end) };
}

function keepBefore(next) {
  if (frame === null || frame.job === next.job || frame.step !== 1 || frame.layer !== next.layer) return;
  before = make("canvas", { width: canvas.width, height: canvas.height });
  before.getContext("2d").drawImage(canvas, 0, 0);
  before.dataset.layer = frame.layer;
  find("#compare").disabled = false;
}

function take(next) {
  const began = performance.now();
  keepBefore(next);
  frame = next;
  draw_frame();
  Object.assign(document.body.dataset, { job: next.job, step: next.step, done: next.done, samples: next.samples, layer: next.layer });
  document.body.dataset.first ??= performance.now();
  if (next.done && pointed !== null) askValues(...pointed);
  send({ do: "ready", drawing: performance.now() - began });
}

/* The display's value, 0..255, by sixteenths of sixteenths of stops from STOP_LOW on. */
function displayTable(curve) {
  const table = new Uint8ClampedArray(20 * STOP_STEPS + 1);
  for (let i = 0; i < table.length; i++) {
    let value = 2 ** (STOP_LOW + i / STOP_STEPS);
    if (curve) {
      const place = Math.min((i / STOP_STEPS) * 16, curve.length - 1.001);
      const at = Math.floor(place);
      value = curve[at] + (place - at) * (curve[at + 1] - curve[at]);
    }
    value = Math.min(1, value);
    table[i] = 255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
  }
  return table;
}

function colour(t, out, at) {
  const place = Math.min(0.9999, Math.max(0, t)) * (COLOURS.length - 1);
  const low = Math.floor(place);
  for (let c = 0; c < 3; c++) out[at + c] = COLOURS[low][c] + (place - low) * (COLOURS[low + 1][c] - COLOURS[low][c]);
}

const luminance = (pixels, at, channels) => (channels === 3 ? 0.2126 * pixels[at] + 0.7152 * pixels[at + 1] + 0.0722 * pixels[at + 2] : pixels[at]);

/* The range of the finite values of a layer that is not light. */
function rangeOf(pixels) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of pixels) {
    if (!Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low < high ? [low, high] : [low - 0.5, low + 0.5];
}

/* Turn the frame's pixels into the display's. */
function develop(out) {
  const { pixels, channels } = frame;
  const gain = 2 ** Number(find("#exposure").value);
  const isLight = LIGHT.has(frame.layer);
  const isFalse = find("#colours").value === "false";
  const count = pixels.length / channels;
  const [low, high] = isLight ? [0, 1] : rangeOf(pixels);
  const table = displayTable(["radiance", "refocused"].includes(frame.layer) ? state.curve : null);
  for (let i = 0; i < count; i++) {
    const [from, to] = [i * channels, 4 * i];
    out[to + 3] = 255;
    if (isLight && isFalse) {
      const stops = Math.log2((gain * luminance(pixels, from, channels)) / GREY);
      colour((stops + FALSE_STOPS) / (2 * FALSE_STOPS), out, to);
    } else if (!isLight && channels === 1) {
      colour((pixels[from] - low) / (high - low), out, to);
    } else {
      for (let c = 0; c < 3; c++) {
        const value = pixels[from + (channels === 3 ? c : 0)];
        if (!isLight) out[to + c] = (255 * (value - low)) / (high - low);
        else out[to + c] = value > 0 ? table[Math.max(0, Math.min(table.length - 1, Math.round((Math.log2(gain * value) - STOP_LOW) * STOP_STEPS)))] : 0;
      }
    }
  }
}

function draw_frame() {
  if (frame === null) return;
  const image = new ImageData(frame.width, frame.height);
  develop(image.data);
  Object.assign(small, { width: frame.width, height: frame.height });
  small.getContext("2d").putImageData(image, 0, 0);
  // A preview is shown in the full picture's size.
  const [width, height] = frame.step === 1 ? [frame.width, frame.height] : [state.width ?? frame.width, state.height ?? frame.height];
  Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  context.imageSmoothingEnabled = false;
  context.drawImage(small, 0, 0, width, height);
  show();
  drawHistogram();
}

function show() {
  if (comparing && before !== null && before.dataset.layer === frame.layer) wipe.show(before, canvas, "before", "now");
  else wipe.show(canvas);
}

function drawHistogram() {
  const plot = find("#histogram");
  const context = plot.getContext("2d");
  context.clearRect(0, 0, plot.width, plot.height);
  const isLight = LIGHT.has(frame.layer);
  const gain = 2 ** Number(find("#exposure").value);
  const bins = new Float64Array(80);
  const [low, high] = isLight ? [-12, 4] : rangeOf(frame.pixels);
  let [clipped, count] = [0, 0];
  for (let at = 0; at < frame.pixels.length; at += frame.channels) {
    const value = luminance(frame.pixels, at, frame.channels);
    const place = isLight ? Math.log2(gain * value) : value;
    count += 1;
    if (isLight && gain * value >= 1) clipped += 1;
    if (place >= low && place < high) bins[Math.floor(((place - low) / (high - low)) * bins.length)] += 1;
  }
  const most = Math.max(1, ...bins);
  const style = getComputedStyle(document.body);
  bins.forEach((bin, i) => {
    context.fillStyle = style.getPropertyValue(isLight && low + ((i + 0.5) / bins.length) * (high - low) >= 0 ? "--bad" : "--accent");
    const tall = (bin / most) * plot.height;
    context.fillRect((i * plot.width) / bins.length, plot.height - tall, plot.width / bins.length - 1, tall);
  });
  find("#histogram-words").textContent = isLight
    ? `2^${low} to 2^${high}; ${((100 * clipped) / count).toFixed(1)} % at 1 or above`
    : `${shortNumber(low)} to ${shortNumber(high)}`;
}

// ---- The pixel under the pointer

let asked = null;
let pointed = null;

function placeOf(event) {
  const box = find(".wipe-stage").getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
}

const isInside = ([x, y]) => x >= 0 && x < 1 && y >= 0 && y < 1;

function point(event) {
  const [x, y] = placeOf(event);
  pointed = frame !== null && isInside([x, y]) ? [x, y] : null;
  if (pointed === null) return;
  clearTimeout(asked);
  asked = setTimeout(() => askValues(x, y), 80);
}

/* A refocused picture has no pixels of the film, of which the server could tell more. */
function askValues(x, y) {
  if (frame.layer !== "refocused") {
    send({ do: "values", x, y });
    return;
  }
  const [column, row] = [Math.floor(x * frame.width), Math.floor(y * frame.height)];
  const first = frame.channels * (row * frame.width + column);
  const numbers = [...frame.pixels.subarray(first, first + frame.channels)].map((number) => shortNumber(number));
  find("#readout").textContent = `x ${column}, y ${row}: ${numbers.join("  ")}`;
}

function showValues({ x, y, values }) {
  const words = (numbers) => numbers.map((number) => shortNumber(number)).join("  ");
  const { radiance, "standard error": error, samples, ...aovs } = values;
  const lines = [`x ${Math.floor(x * (state.width ?? 0))}, y ${Math.floor(y * (state.height ?? 0))}: ${words(radiance)} \u00b1 ${words(error)}, ${words(samples)} samples`];
  for (const [name, numbers] of Object.entries(aovs)) lines.push(`${name} ${words(numbers)}`);
  find("#readout").textContent = lines.join("\n");
}

let pressed = null;
find("#look").addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; }, true);
find("#look").addEventListener("pointermove", point);
find("#look").addEventListener("click", (event) => {
  const place = placeOf(event);
  if (mode === "look" || comparing || !event.target.closest(".wipe-stage") || !isInside(place)) return;
  if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
  const [x, y] = place;
  send(mode === "path" ? { do: "path", x, y } : { do: "focus", x, y, on: mode === "object", layer: frame.layer });
  if (mode === "path") notice("tracing");
});

// ---- The state

function notice(text, isBad = false) {
  find("#notice").textContent = text;
  find("#notice").className = isBad ? "bad" : "";
}

function statusWords() {
  const spp = state.wanted ? `${Math.floor(state.samples)} of ${state.wanted} spp` : `${Math.floor(state.samples ?? 0)} spp`;
  const error = typeof state.error === "number" ? `, error ${shortNumber(100 * state.error, 2)} %` : "";
  if (state.errors.length) return "wrong: the last picture stays";
  if (state.status === "preparing" || state.samples === undefined) return "preparing; compiled anew where the scene's effects are new";
  if (state.step > 1) return `1/${state.step} of the size`;
  return `${state.status}: ${spp}${error}, ${shortNumber(state.seconds, 3)} s`;
}

function sentencesIn(element, sentences, name) {
  element.replaceChildren(...sentences.map((text) => make("p", { class: name }, text)));
}

function takeState(next) {
  const curve = JSON.stringify(state.curve ?? null);
  state = next;
  find("#file").textContent = state.file;
  document.title = `${state.file} \u2013 rt view`;
  find("#status").textContent = statusWords();
  find("#progress").value = state.step === 1 && state.wanted ? state.samples / state.wanted : 0;
  sentencesIn(find("#errors"), state.errors, null);
  find("#errors").hidden = state.errors.length === 0;
  sentencesIn(find("#warnings"), state.warnings, "warning");
  find("#pause").setAttribute("aria-pressed", String(state.paused));
  const isTried = Object.keys(state.tried).length > 0;
  find("#write").disabled = find("#forget").disabled = !isTried;
  showLayers(state.layers ?? []);
  showControls(state.controls ?? []);
  showSharpness(state.sharpness ?? {});
  document.body.dataset.status = state.status;
  if (curve !== JSON.stringify(state.curve ?? null)) draw_frame();
}

function showLayers(layers) {
  const choice = find("#layer");
  if ([...choice.options].map((option) => option.value).join() === layers.join()) return;
  choice.replaceChildren(...layers.map((name) => make("option", { value: name }, name)));
}

// ---- The camera

const positionOf = (control, value) => (control.is_logarithmic ? Math.log(value / control.low) / Math.log(control.high / control.low) : (value - control.low) / (control.high - control.low));
const valueOf = (control, t) => Number((control.is_logarithmic ? control.low * (control.high / control.low) ** t : control.low + t * (control.high - control.low)).toPrecision(3));

function valueWords(control, value) {
  if (control.key === "shutter" && value < 0.5) return `1/${shortNumber(1 / value, 3)} s`;
  if (control.key === "f_number") return `f/${shortNumber(value, 3)}`;
  return `${shortNumber(value)} ${control.unit}`.trim();
}

let waiting = {};
let timer = null;

/* Values are sent at most every 50 ms, the last of each key. */
function trySoon(key, value) {
  waiting[key] = value;
  timer ??= setTimeout(() => {
    send({ do: "set", values: waiting });
    waiting = {};
    timer = null;
  }, 50);
}

function showControls(controls) {
  const box = find("#controls");
  for (const label of [...box.children]) if (!controls.some(({ key }) => label.htmlFor === `camera-${key}`)) label.remove();
  for (const control of controls) {
    let input = find(`#camera-${control.key}`);
    if (input === null) {
      input = make("input", { type: "range", id: `camera-${control.key}`, min: 0, max: 1, step: 0.001 });
      input.addEventListener("input", () => {
        const value = valueOf(input.control, Number(input.value));
        find("output", input.parentElement).textContent = valueWords(input.control, value);
        input.moved = performance.now();
        trySoon(input.control.key, value);
      });
      box.append(make("label", { for: input.id }, control.label, make("output"), input));
    }
    // The hand that holds a slider is not moved.
    if (performance.now() - (input.moved ?? -1e9) < 1000 && state.shown !== state.job) continue;
    if (performance.now() - (input.moved ?? -1e9) >= 1000 || input.control === undefined) {
      input.control = control;
      input.value = positionOf(control, control.value);
      find("output", input.parentElement).textContent = valueWords(control, control.value);
      input.setAttribute("aria-valuetext", valueWords(control, control.value));
    }
    input.parentElement.classList.toggle("tried", control.key in state.tried);
  }
}

/* The axis from the lens to infinity, with the plane of focus in its middle. */
function showSharpness({ focus, near, far, pupil_mm: pupil, circle_mm: circle, circle_px: pixels }) {
  const plot = find("#sharpness");
  plot.toggleAttribute("hidden", near === undefined);
  find("#sharpness-words").textContent = "";
  if (near === undefined) return;
  const metres = (value) => (typeof value === "number" && value > 0 ? value : Infinity);
  const [left, right, middle] = [20, 300, 48];
  const scale = Number.isFinite(metres(focus)) ? metres(focus) : metres(near);
  const across = (value) => left + (right - left) * (Number.isFinite(value) ? value / (value + scale) : 1);
  const [sharpNear, plane, sharpFar] = [near, focus, far].map((value) => across(metres(value)));
  plot.replaceChildren(
    line("axis", [left, middle], [right, middle]),
    draw("rect", { class: "sharp", x: sharpNear, y: 10, width: Math.max(1, sharpFar - sharpNear), height: 76 }),
    line("cone", [left, middle - 26], [plane, middle], [left, middle + 26]),
    draw("ellipse", { class: "lens", cx: left, cy: middle, rx: 5, ry: 28 }),
    line("focus", [plane, 8], [plane, 88]),
    draw("text", { x: plane, y: 104 }, `${shortNumber(focus, 3)} m`),
  );
  const depth = `sharp from ${shortNumber(near, 3)} to ${far === "inf" ? "infinity" : `${shortNumber(far, 3)} m`}`;
  const size = circle === undefined ? `${shortNumber(pixels, 3)} px` : `${shortNumber(circle, 2)} mm`;
  find("#sharpness-words").textContent = `${depth}, by a circle of confusion of ${size}; opening ${shortNumber(pupil, 3)} mm`;
}

// ---- What is pressed

find("#pause").addEventListener("click", () => send({ do: "pause", on: !state.paused }));
for (const name of ["save", "write", "forget"]) find(`#${name}`).addEventListener("click", () => send({ do: name }));
find("#compare").addEventListener("click", () => {
  comparing = !comparing;
  find("#compare").setAttribute("aria-pressed", String(comparing));
  show();
});
find("#exposure").addEventListener("input", () => {
  const stops = Number(find("#exposure").value);
  find("#exposure-words").textContent = `${stops > 0 ? "+" : ""}${shortNumber(stops, 2)} EV`;
  draw_frame();
});
find("#colours").addEventListener("change", draw_frame);
find("#layer").addEventListener("change", () => send({ do: "layer", name: find("#layer").value }));

function chooseLayer(name) {
  if (find("#layer").value === name) return;
  find("#layer").value = name;
  send({ do: "layer", name });
}
for (const button of document.querySelectorAll("#modes button")) {
  button.addEventListener("click", () => {
    mode = button.dataset.mode;
    document.body.classList.toggle("aiming", mode !== "look");
    for (const other of document.querySelectorAll("#modes button")) other.setAttribute("aria-pressed", String(other === button));
  });
}

// ---- The socket

const TAKEN = {
  state: takeState,
  values: showValues,
  notice: ({ text, layer }) => {
    notice(text);
    if (layer) chooseLayer(layer);
  },
  refused: ({ text }) => notice(text, true),
  path: ({ text }) => {
    notice("");
    find("#path").hidden = false;
    find("#path").textContent = text;
  },
};
socket.addEventListener("message", ({ data: content }) => {
  if (typeof content !== "string") return take(decode(content));
  const message = JSON.parse(content);
  return TAKEN[message.kind]?.(message);
});
socket.addEventListener("close", () => {
  document.body.dataset.status = "ended";
  find("#status").textContent = "rt view has ended; the picture is the last one";
});
