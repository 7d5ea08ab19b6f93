"use strict";

/* Two images and their difference.  The values of both are here as codes, 16 bits for linear light (halves) and 8 for
   display values, with a table of what they stand for; all that is shown is made of those tables. */

const SIZE_COLOURS = data.colours.size;
const SIGNED_COLOURS = data.colours.signed;

/* Values of the 65536 halves (IEEE 754). */
const HALVES = Float32Array.from({ length: 65536 }, (_, bits) => {
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  const size = exponent === 0 ? fraction * 2 ** -24 : exponent === 31 ? (fraction ? NaN : Infinity) : (1 + fraction / 1024) * 2 ** (exponent - 15);
  return bits & 32768 ? -size : size;
});
const BYTES = Float32Array.from({ length: 256 }, (_, byte) => byte / 255);

const VIEWS = {
  a: "A",
  b: "B",
  signed: "A \u2212 B, red and blue",
  size: "size of A \u2212 B",
  relative: "relative to B",
  flip: "FLIP",
  z: "A \u2212 B in standard deviations",
};

const wipe = new Wipe(find("#wipe"));
let shownPair = null;

/* sRGB of a linear value, as a byte. */
function encoded(value) {
  const x = Math.min(1, Math.max(0, value || 0));
  return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
}

async function decoded(address) {
  const image = new Image();
  image.src = address;
  await image.decode();
  return image;
}

/* The bytes of a picture, red, green, blue, opaque. */
async function bytesOf(address) {
  const image = await decoded(address);
  const canvas = make("canvas", { width: image.naturalWidth, height: image.naturalHeight });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, canvas.width, canvas.height);
}

/* The codes of a picture: three for each pixel. */
async function codesOf(address, isLinear) {
  const picture = await bytesOf(address);
  const width = picture.width;
  const height = isLinear ? picture.height / 2 : picture.height;
  const codes = new Uint16Array(3 * width * height);
  const lower = 4 * width * height;
  for (let i = 0, from = 0; i < codes.length; from += 4) {
    for (let c = 0; c < 3; c++, i++) {
      codes[i] = isLinear ? (picture.data[from + c] << 8) | picture.data[lower + from + c] : picture.data[from + c];
    }
  }
  return { width, height, codes };
}

class Pair {
  constructor(described) {
    Object.assign(this, described);
    this.table = this.linear ? HALVES : BYTES;
    this.canvases = new Map();
    this.ready = Promise.all(this.images.map((address) => codesOf(address, this.linear)))
      .then((pictures) => { this.pictures = pictures; });
  }

  /* List the views of it. */
  get views() {
    return Object.keys(VIEWS).filter((view) => !["flip", "z"].includes(view) || view in this.maps);
  }

  /* A canvas with a view. */
  async draw(view, exposure, gain) {
    await this.ready;
    if (view in this.maps) return decoded(this.maps[view].image);
    const { width, height } = this.pictures[0];
    const pixels = new ImageData(width, height);
    if (view === "a" || view === "b") this.#fill(pixels.data, this.pictures[view === "a" ? 0 : 1].codes, exposure);
    else this.#compare(pixels.data, view, this.scaleOf(view, gain));
    let canvas = this.canvases.get(view);
    if (canvas === undefined) {
      canvas = make("canvas", { width, height });
      this.canvases.set(view, canvas);
    }
    canvas.getContext("2d").putImageData(pixels, 0, 0);
    return canvas;
  }

  scaleOf(view, gain) {
    return this.scale[view === "relative" ? "relative" : "absolute"] * 2 ** -gain;
  }

  #fill(to, codes, exposure) {
    const shades = this.linear ? Uint8Array.from(this.table, (value) => encoded(value * 2 ** exposure)) : Uint8Array.from({ length: 256 }, (_, byte) => byte);
    for (let i = 0, at = 0; i < codes.length; at += 4) {
      to[at] = shades[codes[i++]];
      to[at + 1] = shades[codes[i++]];
      to[at + 2] = shades[codes[i++]];
      to[at + 3] = 255;
    }
  }

  #compare(to, view, scale) {
    const [a, b] = this.pictures.map((picture) => picture.codes);
    const colours = view === "signed" ? SIGNED_COLOURS : SIZE_COLOURS;
    const last = colours.length / 3 - 1;
    for (let i = 0, at = 0; i < a.length; i += 3, at += 4) {
      let largest = 0;
      let squares = 0;
      for (let c = i; c < i + 3; c++) {
        const reference = this.table[b[c]];
        const difference = this.table[a[c]] - reference;
        squares += (difference * difference) / (reference * reference + 0.01);
        if (Math.abs(difference) > Math.abs(largest) || Number.isNaN(difference)) largest = difference;
      }
      const value = view === "relative" ? Math.sqrt(squares / 3) : view === "size" ? Math.abs(largest) : largest;
      const place = view === "signed" ? (1 + value / scale) / 2 : value / scale;
      to[at + 3] = 255;
      if (Number.isNaN(value)) {
        to[at] = view === "signed" ? 0 : 255;
        continue;
      }
      const colour = 3 * Math.round(last * Math.min(1, Math.max(0, place)));
      to[at] = colours[colour];
      to[at + 1] = colours[colour + 1];
      to[at + 2] = colours[colour + 2];
    }
  }
}

const pairs = new Map();

function pairAt(number) {
  if (!pairs.has(number)) pairs.set(number, new Pair(data.pairs[number]));
  return pairs.get(number);
}

const exposure = () => Number(find("#exposure").value);
const gain = () => Number(find("#gain").value);
const signs = (value) => `${value > 0 ? "+" : value < 0 ? "\u2212" : "\u00b1"}${Math.abs(value)}`;

let asked = 0;

/* Draw the chosen views. */
async function show() {
  const turn = ++asked;
  const pair = shownPair;
  const [left, right] = [find("#left").value, find("#right").value];
  find("#exposure-value").textContent = `${signs(exposure())} stops`;
  find("#gain-value").textContent = `\u00d7 ${shortNumber(2 ** gain(), 3)}`;
  find("#gains").hidden = ![left, right].some((view) => ["signed", "size", "relative"].includes(view));
  find("#exposures").hidden = !pair.linear;
  const drawn = [await pair.draw(left, exposure(), gain()), right === "" ? null : await pair.draw(right, exposure(), gain())];
  if (turn !== asked) return;
  const label = (view) => (view === "a" ? pair.labels[0] : view === "b" ? pair.labels[1] : VIEWS[view] ?? "");
  wipe.show(...drawn, label(left), label(right));
  find("#legends").replaceChildren(...[...new Set([left, right])].map((view) => legend(pair, view)).filter((part) => part !== null));
  document.body.dataset.shown = `${left} ${right} ${exposure()} ${gain()}`;
}

/* The scale of a view's colours. */
function legend(pair, view) {
  if (["", "a", "b"].includes(view)) return null;
  const isSigned = view === "signed" || view === "z";
  const colours = isSigned ? SIGNED_COLOURS : SIZE_COLOURS;
  const steps = colours.length / 3;
  const canvas = make("canvas", { width: steps, height: 1 });
  const pixels = new ImageData(steps, 1);
  for (let i = 0; i < steps; i++) pixels.data.set([colours[3 * i], colours[3 * i + 1], colours[3 * i + 2], 255], 4 * i);
  canvas.getContext("2d").putImageData(pixels, 0, 0);
  const scale = pair.scaleOf(view, gain());
  const text = view === "relative" ? `${shortNumber(100 * scale, 3)} %` : shortNumber(scale, 3);
  const ends = view in pair.maps ? pair.maps[view].ends : isSigned ? [`\u2212${text}`, "0", `+${text}`] : ["0", text];
  const caption = {
    signed: "A \u2212 B in the channel that differs most: red where A is brighter",
    size: "|A \u2212 B| in the channel that differs most",
    relative: "root of the relative squared error",
  }[view] ?? pair.maps[view]?.caption;
  return make("div", { class: "legend" }, canvas, make("div", {}, ...ends.map((end) => make("span", {}, end))), make("span", { class: "faint" }, caption));
}

/* Show the metrics of a pair. */
function tell(pair) {
  const verdict = find("#verdict");
  verdict.replaceChildren();
  if (pair.passed !== null) {
    verdict.append(make("p", { class: pair.passed ? "good" : "bad" }, pair.passed ? "Passed" : `Failed: ${pair.failures.join("; ")}`));
  }
  if (pair.test) verdict.append(make("p", {}, pair.test));
  verdict.append(...pair.notes.map((note) => make("p", { class: "faint" }, note)));
  find("#tests").replaceChildren(...pair.tests.length ? [
    make("thead", {}, make("tr", {}, make("th", {}, "Test of the noise"), make("th", { class: "number" }, "p"), make("th", {}))),
    make("tbody", {}, ...pair.tests.map((test) => make(
      "tr",
      {},
      make("td", {}, test.label),
      make("td", { class: "number" }, shortNumber(test.p, 2)),
      make("td", { class: test.failed ? "bad" : "faint" }, test.failed ? "failed" : "passed"),
    ))),
  ] : []);
  find("#metrics").replaceChildren(
    make("thead", {}, make("tr", {}, make("th", {}, "Metric"), make("th", { class: "number" }, "A against B"), make("th", {}, "of"))),
    make(
      "tbody",
      {},
      ...pair.metrics.map((metric) => make(
        "tr",
        {},
        make("td", {}, metric.label),
        make("td", { class: "number", "data-metric": metric.key }, shortNumber(metric.value, 6) + (metric.key === "psnr" ? " dB" : "")),
        make("td", { class: "faint" }, metric.domain === "linear" ? "linear light" : "display values"),
      )),
      ...pair.unmeasured.map((metric) => make("tr", {}, make("td", {}, metric.label), make("td", { class: "number" }, "\u2013"), make("td", { class: "faint" }, metric.reason))),
    ),
  );
}

/* Show a pair. */
function turnTo(number) {
  shownPair = pairAt(number);
  find("#pair").value = String(number);
  find("#previous").disabled = number === 0;
  find("#next").disabled = number === data.pairs.length - 1;
  for (const [id, usual] of [["#left", "a"], ["#right", "b"]]) {
    const select = find(id);
    const kept = select.value;
    select.replaceChildren(
      ...shownPair.views.map((view) => make("option", { value: view }, VIEWS[view])),
      ...(id === "#right" ? [make("option", { value: "" }, "nothing")] : []),
    );
    select.value = shownPair.views.includes(kept) ? kept : usual;
  }
  tell(shownPair);
  show();
}

function swap() {
  const [left, right] = [find("#left"), find("#right")];
  if (right.value === "") return;
  [left.value, right.value] = [right.value, left.value];
  show();
}

find("h1").textContent = data.title;
find("#subtitle").textContent = "Drag the divider. B is the reference.";
find("#choice").hidden = data.pairs.length < 2;
find("#pair").append(...data.pairs.map((pair, number) => make("option", { value: String(number) }, (pair.passed === false ? "\u2717 " : "") + pair.name)));
find("#pair").addEventListener("change", (event) => turnTo(Number(event.target.value)));
const turnBy = (step) => {
  const number = Number(find("#pair").value) + step;
  if (number >= 0 && number < data.pairs.length) turnTo(number);
};
find("#previous").addEventListener("click", () => turnBy(-1));
find("#next").addEventListener("click", () => turnBy(1));
find("#swap").addEventListener("click", swap);
for (const id of ["#left", "#right"]) find(id).addEventListener("change", show);
for (const id of ["#exposure", "#gain"]) find(id).addEventListener("input", show);
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select")) return;
  const key = event.key.toLowerCase();
  if (key === "x") swap();
  else if (key === "[") turnBy(-1);
  else if (key === "]") turnBy(1);
  else if (key === "e" && shownPair.linear) {
    find("#exposure").value = String(exposure() + (event.shiftKey ? -0.5 : 0.5));
    show();
  } else if (key === "d") {
    const right = find("#right");
    right.value = right.value === "signed" ? "b" : "signed";
    show();
  }
});
turnTo(0);
