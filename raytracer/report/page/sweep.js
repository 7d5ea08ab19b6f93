"use strict";

/* A sweep: sliders choose a point (A), or two of them to compare (A and B); all that is on the page follows.

   data.axes: {key, name, labels}; data.points, in order of their index (the last axis changes fastest): {index, status,
   reason, picture, thumb, files, numbers, warnings}; data.columns: {key, words, unit, digits}, of what is in `numbers`. */

const { axes, points, columns } = data;

const PLAY_MS = 160;

// ---- chosen points ----

const state = { a: points[0].index.slice(), b: null, sides: axes.map((_, axis) => axis).slice(-2) };
if (axes.length > 1) state.sides = [0, 1];

const strides = axes.map((_, axis) => axes.slice(axis + 1).reduce((product, { labels }) => product * labels.length, 1));
const pointAt = (index) => points[index.reduce((sum, number, axis) => sum + number * strides[axis], 0)];
const titleOf = (index) => axes.map(({ name, labels }, axis) => `${name} ${labels[index[axis]]}`).join(", ");

/* Choose values of A or B by axis, and show them. */
function choose(which, values) {
  const index = (state[which] ?? state.a).slice();
  for (const [axis, number] of Object.entries(values)) {
    index[axis] = Math.min(axes[axis].labels.length - 1, Math.max(0, number));
  }
  state[which] = index;
  update();
}

function compare(on) {
  // Start at the other end of the first axis, where the difference is large.
  if (on && state.b === null) {
    const last = axes[0].labels.length - 1;
    state.b = [state.a[0] > last / 2 ? 0 : last, ...state.a.slice(1)];
  } else if (!on) state.b = null;
  update();
}

function swap() {
  if (state.b !== null) [state.a, state.b] = [state.b, state.a];
  update();
}

// ---- pictures ----

const gallery = new Gallery(points);
const wipe = new Wipe(find("#wipe"));

/* Placeholder of a missing picture. */
const hatched = (() => {
  const canvas = make("canvas", { width: data.size[0], height: data.size[1] });
  const context = canvas.getContext("2d");
  const step = Math.max(8, Math.round(data.size[0] / 24));
  context.fillStyle = "#8884";
  context.fillRect(0, 0, ...data.size);
  context.strokeStyle = "#888";
  context.lineWidth = step / 3;
  for (let x = -data.size[1]; x < data.size[0]; x += step) {
    context.beginPath();
    context.moveTo(x, data.size[1]);
    context.lineTo(x + data.size[1], 0);
    context.stroke();
  }
  return canvas;
})();

let showing = 0;

async function showPictures() {
  const mine = ++showing;
  const chosen = [state.a, state.b].filter((index) => index !== null);
  const wanted = chosen.map(pointAt);
  if (wanted.some((point) => gallery.at(point) === undefined)) await Promise.all(wanted.map((point) => gallery.decode(point)));
  if (mine !== showing) return;
  const [left, right] = wanted.map((point) => gallery.at(point) ?? hatched);
  if (state.b === null) wipe.show(left);
  else wipe.show(left, right, `A: ${titleOf(state.a)}`, `B: ${titleOf(state.b)}`);
  document.body.dataset.shown = wanted.map(({ name }) => name).join(" | ");
  gallery.near(state.a);
}

// ---- sliders ----

const sliders = axes.map(({ key, name, labels }, axis) => {
  const rows = {};
  const box = make("div", { class: "axis" });
  const outputs = ["a", "b"].map((which) => make("output", { class: which, "data-axis": key }));
  const play = make("button", { type: "button", title: "run through the values (p)", "aria-label": `run through ${name}`, onclick: () => toggle(axis) }, "\u25b6\ufe0e");
  box.append(make("div", { class: "axis-head" }, make("span", { class: "name", title: key }, name), ...outputs, play));
  for (const [number, which] of ["a", "b"].entries()) {
    const slider = make("input", {
      type: "range", class: which, min: "0", max: String(labels.length - 1), step: "1", "data-axis": key,
      "aria-label": `${name}, point ${which.toUpperCase()}`,
      oninput: () => { halt(); choose(which, { [axis]: slider.valueAsNumber }); },
    });
    slider.disabled = labels.length === 1;
    box.append(slider);
    rows[which] = { slider, output: outputs[number] };
  }
  find("#sliders").append(box);
  return { rows, play };
});

function showSliders() {
  document.body.classList.toggle("comparing", state.b !== null);
  find("#compare").setAttribute("aria-pressed", String(state.b !== null));
  find("#swap").hidden = state.b === null;
  axes.forEach(({ labels }, axis) => {
    for (const which of ["a", "b"]) {
      const index = state[which];
      if (index === null) continue;
      const { slider, output } = sliders[axis].rows[which];
      slider.value = String(index[axis]);
      slider.setAttribute("aria-valuetext", labels[index[axis]]);
      output.textContent = labels[index[axis]];
    }
  });
}

// ---- running through the values ----

let running = null;

function halt() {
  if (running === null) return;
  clearInterval(running.timer);
  sliders[running.axis].play.setAttribute("aria-pressed", "false");
  running = null;
}

function toggle(axis) {
  const was = running?.axis;
  halt();
  const last = axes[axis].labels.length - 1;
  if (was === axis || last === 0) return;
  let step = 1;
  const go = () => {
    if (state.a[axis] + step < 0 || state.a[axis] + step > last) step = -step;
    choose("a", { [axis]: state.a[axis] + step });
  };
  running = { axis, timer: setInterval(go, PLAY_MS) };
  sliders[axis].play.setAttribute("aria-pressed", "true");
}

// ---- numbers ----

const valueOf = (point, { key }) => point.numbers[key];
const textOf = (value, { digits }) => shortNumber(value, digits);
const rendered = points.filter(({ status }) => status === "done");
const differs = (column) => rendered.some((point) => valueOf(point, column) !== valueOf(rendered[0], column));
const differing = columns.filter(differs);
const constant = columns.filter((column) => !differs(column));

const numberRows = differing.map((column) => {
  const cells = ["a", "b"].map((which) => make("td", { class: `number ${which}` }));
  find("#differing").append(make("tr", { "data-key": column.key, title: column.key }, make("td", {}, column.words), ...cells, make("td", {}, column.unit)));
  return { column, cells };
});
const fileCells = ["a", "b"].map((which) => make("td", { class: `number ${which}` }));
find("#differing").append(make("tr", { "data-key": "files" }, make("td", {}, "file"), ...fileCells, make("td")));

find("#same").hidden = constant.length === 0;
find("#same summary").textContent = `The same at all points (${constant.length})`;
for (const column of constant) {
  const value = valueOf(rendered[0], column);
  find("#same tbody").append(
    make("tr", { "data-key": column.key, title: column.key }, make("td", {}, column.words), make("td", { class: "number", title: value }, textOf(value, column)), make("td", {}, column.unit)),
  );
}

function showNumbers() {
  const chosen = [state.a, state.b].map((index) => index && pointAt(index));
  for (const { column, cells } of numberRows) {
    chosen.forEach((point, side) => {
      const value = point ? valueOf(point, column) : undefined;
      cells[side].textContent = textOf(value, column);
      cells[side].title = value ?? "";
    });
  }
  const trouble = [];
  const warnings = new Set();
  chosen.forEach((point, side) => {
    const files = point?.files ?? [];
    const links = files.map((file) => make("a", { href: encodeURIComponent(file), title: file }, `.${file.split(".").at(-1)}`));
    fileCells[side].replaceChildren(...links.flatMap((link, number) => (number ? [" ", link] : [link])));
    if (point === null) return;
    const which = state.b === null ? "" : `${"AB"[side]}: `;
    if (point.status === "failed") trouble.push(`${which}failed: ${point.reason}`);
    if (point.status === "missing") trouble.push(`${which}not rendered: the sweep was ended before it`);
    if (point.status === "done" && point.picture === null) trouble.push(`${which}its picture could not be read`);
    for (const warning of point.warnings) warnings.add(warning);
  });
  find("#trouble").hidden = trouble.length === 0;
  find("#trouble").textContent = trouble.join("; ");
  find("#warnings").replaceChildren(...[...warnings].map((warning) => make("p", { class: "warning" }, warning)));
}

// ---- overview ----

const cells = new Map();
let slice = null;

function cellOf(index, caption) {
  const point = pointAt(index);
  const source = point.thumb ?? point.picture;
  const picture = source
    ? make("img", { src: source, alt: "", decoding: "async", draggable: "false" })
    : make("span", { class: "none" }, point.status === "failed" ? "failed" : "none");
  const cell = make("button", {
    type: "button", class: "cell", title: point.reason || titleOf(index), "aria-label": `${titleOf(index)}${source ? "" : `, ${point.status}`}`,
    onclick: (event) => { halt(); choose(event.shiftKey ? "b" : "a", { ...index }); },
  }, picture);
  if (caption) cell.append(make("span", { class: "caption" }, caption));
  cells.set(point, cell);
  return cell;
}

/* Points whose other axes are as A's: a table of two axes, or one after the other. */
function buildOverview() {
  const others = state.a.map((number, axis) => (state.sides.includes(axis) ? null : number));
  const wanted = JSON.stringify([state.sides, others]);
  if (wanted === slice) return;
  slice = wanted;
  cells.clear();
  const overview = find("#overview");
  const at = (...numbers) => others.map((number, axis) => number ?? numbers[state.sides.indexOf(axis)]);
  if (axes.length === 1) {
    overview.style.setProperty("--cell", "10rem");
    overview.replaceChildren(make("div", { class: "flow" }, ...axes[0].labels.map((label, number) => cellOf([number], label))));
    return;
  }
  const [row, column] = state.sides.map((axis) => axes[axis]);
  // As wide as the page allows, and no wider than a thumb is sharp.
  overview.style.setProperty("--cell", `clamp(3.4rem, calc((min(100vw, 90rem) - 6.5rem) / ${column.labels.length} - 4px), 12rem)`);
  const head = make("tr", {}, make("td"));
  head.append(...column.labels.map((label) => make("th", { scope: "col" }, label)));
  const body = row.labels.map((label, down) => make("tr", {},
    make("th", { scope: "row" }, label), ...column.labels.map((_, across) => make("td", {}, cellOf(at(down, across)))),
  ));
  overview.replaceChildren(make("table", {}, make("thead", {}, head), make("tbody", {}, ...body)));
}

function mark(elements) {
  const [a, b] = [state.a, state.b].map((index) => index && pointAt(index));
  for (const [point, element] of elements) {
    const at = [point === a && "a", point === b && "b"].filter(Boolean).join(" ");
    if (at) element.dataset.at = at;
    else delete element.dataset.at;
  }
}

if (axes.length > 2) {
  ["rows", "columns"].forEach((words, side) => {
    const select = make("select", { id: words, onchange: () => {
      const chosen = Number(select.value);
      const other = state.sides[1 - side];
      if (chosen === other) state.sides.reverse();
      else state.sides[side] = chosen;
      update();
    } }, ...axes.map(({ name }, axis) => make("option", { value: axis }, name)));
    find("#sides").append(make("label", {}, `${words} `, select));
  });
  find("#sides").append("the others as the sliders are");
} else if (axes.length === 2) {
  find("#sides").append(`${axes[0].name} \u2193 ${axes[1].name} \u2192`);
}

// ---- table of all points ----

const rows = new Map();

const sortKey = (value) => (value === "inf" ? "Infinity" : String(value ?? ""));

function buildTable() {
  const heads = axes.map(({ name, key }, axis) => ({
    words: name, key, value: (point) => point.index[axis], text: (point) => axes[axis].labels[point.index[axis]],
  }));
  if (rendered.length < points.length) {
    const why = (point) => (point.status === "done" ? "" : point.reason || point.status);
    heads.push({ words: "status", key: "status", value: why, text: why });
  }
  heads.push(...differing.map((column) => ({
    words: column.words, key: column.key, unit: column.unit,
    value: (point) => valueOf(point, column), text: (point) => textOf(valueOf(point, column), column),
  })));
  const body = find("#all tbody");
  for (const point of points) {
    const row = make("tr", { onclick: (event) => choose(event.shiftKey ? "b" : "a", { ...point.index }) },
      ...heads.map(({ text, key, value }) => make("td", { class: key === "status" ? "bad" : "number", "data-sort": sortKey(value(point)) }, text(point))));
    rows.set(point, row);
    body.append(row);
  }
  find("#all thead").append(make("tr", {}, ...heads.map(({ words, key, unit }) => make("th",
    { scope: "col", class: key === "status" ? "" : "number", title: key, "aria-sort": "none" },
    make("button", { type: "button" }, unit ? `${words} (${unit})` : words)))));
  sortable(find("#all table"));
}

find("#all").addEventListener("toggle", () => {
  if (rows.size === 0) buildTable();
  mark(rows);
});

// ---- the address ----

const addressOf = () => ["a", "b"].filter((which) => state[which] !== null).flatMap((which) => axes.map(
  ({ key, labels }, axis) => `${which === "b" ? "vs." : ""}${encodeURIComponent(key)}=${encodeURIComponent(labels[state[which][axis]])}`)).join("&");

const writeAddress = addressWriter(addressOf);

/* Choose the points of the address; an axis that it does not name stays as it is. */
function readAddress() {
  const address = new URLSearchParams(location.hash.slice(1).replaceAll("+", "%2B"));
  const read = (prefix, from) => axes.map(({ key, labels }, axis) => {
    const number = labels.indexOf(address.get(prefix + key) ?? "");
    return number < 0 ? from[axis] : number;
  });
  state.a = read("", state.a);
  state.b = [...address.keys()].some((key) => key.startsWith("vs.")) ? read("vs.", state.a) : state.b;
  update();
}

// ---- keys ----

/* Up and down go along the rows of the overview, left and right along its columns. */
const KEYS = { ArrowLeft: [1, -1], ArrowRight: [1, 1], ArrowUp: [0, -1], ArrowDown: [0, 1] };

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select")) return;
  if (event.key in KEYS) {
    // Sliders have these keys for themselves.
    if (event.target.closest("[role=slider], input")) return;
    const [side, step] = KEYS[event.key];
    const axis = axes.length === 1 ? 0 : state.sides[side];
    const which = event.shiftKey ? "b" : "a";
    halt();
    choose(which, { [axis]: (state[which] ?? state.a)[axis] + step });
    // Who goes from cell to cell takes the focus along.
    if (event.target.closest(".cell")) cells.get(pointAt(state[which]))?.focus();
    event.preventDefault();
  } else if (event.key === "c") compare(state.b === null);
  else if (event.key === "x") swap();
  else if (event.key === "p") toggle(running?.axis ?? (axes.length === 1 ? 0 : state.sides[1]));
});

// ---- page ----

function update() {
  showSliders();
  showNumbers();
  buildOverview();
  ["rows", "columns"].forEach((id, side) => { if (axes.length > 2) find(`#${id}`).value = String(state.sides[side]); });
  mark(cells);
  mark(rows);
  showPictures();
  writeAddress();
}

find("#scene").textContent = data.scene;
find("#extent").textContent = data.extent;
find("#notes").replaceChildren(...data.notes.map((note) => make("p", { class: "warning" }, note)));
find("#overview").style.setProperty("--shape", `${data.size[0]} / ${data.size[1]}`);
find("#files").hidden = data.files.length === 0;
find("#files").append(...data.files.map((file) => make("a", { href: encodeURIComponent(file) }, file)));
find("#compare").addEventListener("click", () => compare(state.b === null));
find("#swap").addEventListener("click", swap);
const keys = [["\u2190 \u2191 \u2192 \u2193", "next point"], ["Shift", "with an arrow or a click: second point"], ["c", "compare"], ["x", "swap"], ["p", "run"], ["0 1 2 4 8 + \u2212", "zoom"]];
find("#keys").append(...keyHints(keys));
window.addEventListener("hashchange", readAddress);
readAddress();
