"use strict";

/* Charts answer the pointer, and are saved as files.

   <figure class="chart" data-chart="KEY"> holds the picture; data.charts[KEY]: {title, labels: [x, y], box: [left, right,
   bottom, top] of the axes in the picture, ranges: [[low, high], [low, high]], log: [x, y], series: [{label, x, y}],
   grid: {label, step, values}}.  In the picture the curve of a number is the group KEY-series-NUMBER; a grid has values
   of blocks of so many units along both axes, in rows, instead. */

const SVG = "http://www.w3.org/2000/svg";

// From how near, in units of the picture, the pointer picks a curve.
const REACH = 18;

/* One of a chart's two axes: from numbers to places in the picture, and back. */
function axisOf(chart, which) {
  const [from, to] = chart.box.slice(2 * which, 2 * which + 2);
  const scaled = chart.log[which] ? Math.log10 : (value) => value;
  const [low, high] = chart.ranges[which].map(scaled);
  return {
    place: (value) => (typeof value === "number" ? from + ((to - from) * (scaled(value) - low)) / (high - low) : NaN),
    number: (place) => {
      const value = low + ((high - low) * (place - from)) / (to - from);
      return chart.log[which] ? 10 ** value : value;
    },
    holds: (place) => place >= Math.min(from, to) && place <= Math.max(from, to),
  };
}

/* The point of a chain of places that is nearest to another: {at, away}. */
function nearest(places, [x, y]) {
  let best = { at: null, away: Infinity };
  const offer = (at) => {
    const away = Math.hypot(at[0] - x, at[1] - y);
    if (away < best.away) best = { at, away };
  };
  places.forEach((at, number) => {
    if (!at.every(Number.isFinite)) return;
    offer(at);
    const before = places[number - 1];
    if (!before || !before.every(Number.isFinite)) return;
    const along = [at[0] - before[0], at[1] - before[1]];
    const part = ((x - before[0]) * along[0] + (y - before[1]) * along[1]) / (along[0] ** 2 + along[1] ** 2);
    if (part > 0 && part < 1) offer([before[0] + part * along[0], before[1] + part * along[1]]);
  });
  return best;
}

function answer(figure, key, chart) {
  const picture = find("svg", figure);
  const axes = [axisOf(chart, 0), axisOf(chart, 1)];
  const curves = chart.series.map(({ label, x, y }, number) => ({
    label,
    places: x.map((value, index) => [axes[0].place(value), axes[1].place(y[index])]),
    drawn: document.getElementById(`${key}-series-${number}`),
  }));
  const said = make("output", { class: "pointed", "aria-live": "off" });
  said.hidden = true;
  const dot = document.createElementNS(SVG, "circle");
  dot.setAttribute("r", "3");
  figure.append(said);

  const hide = () => {
    said.hidden = true;
    dot.remove();
    picture.classList.remove("picking");
    for (const { drawn } of curves) drawn?.classList.remove("picked");
  };
  const show = (event) => {
    hide();
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(picture.getScreenCTM().inverse());
    if (!axes[0].holds(point.x) || !axes[1].holds(point.y)) return;
    const near = curves.map((curve) => ({ ...curve, ...nearest(curve.places, [point.x, point.y]) }));
    const picked = near.reduce((a, b) => (b.away < a.away ? b : a), { away: REACH });
    const at = picked.at ?? [point.x, point.y];
    if (picked.at) {
      picture.classList.add("picking");
      picked.drawn?.classList.add("picked");
      dot.setAttribute("cx", at[0]);
      dot.setAttribute("cy", at[1]);
      picture.append(dot);
    }
    const numbers = axes.map((axis, which) => `${chart.labels[which]}: ${shortNumber(axis.number(at[which]), 3)}`);
    if (chart.grid) {
      const [column, row] = axes.map((axis, which) => Math.floor(axis.number(at[which])));
      const value = chart.grid.values[Math.floor(row / chart.grid.step)]?.[Math.floor(column / chart.grid.step)];
      numbers.splice(0, 2, `x ${column}, y ${row}`, `${chart.grid.label}: ${value === null ? "not measured" : shortNumber(value, 3)}`);
    }
    said.replaceChildren(...[picked.label, ...numbers].filter(Boolean).map((line) => make("span", {}, line)));
    said.hidden = false;
    // Beside the pointer, on the side that has room, and within the window.
    const box = figure.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const beside = x > box.width / 2 ? x - said.offsetWidth - 12 : x + 12;
    const last = document.documentElement.clientWidth - said.offsetWidth - box.left;
    said.style.left = `${Math.max(-box.left, Math.min(beside, last))}px`;
    said.style.top = `${Math.max(0, y - said.offsetHeight - 8)}px`;
  };
  picture.addEventListener("pointermove", show);
  picture.addEventListener("pointerdown", show);
  picture.addEventListener("pointerleave", hide);
}

/* Save a string as a file. */
function save(name, type, text) {
  const address = URL.createObjectURL(new Blob([text], { type }));
  make("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

/* A picture as a file of its own: dark on white, in light and dark mode. */
function standalone(picture) {
  const copy = picture.cloneNode(true);
  const [, , width, height] = copy.getAttribute("viewBox").split(" ");
  const paper = document.createElementNS(SVG, "rect");
  for (const [key, value] of Object.entries({ width, height, fill: "#ffffff" })) paper.setAttribute(key, value);
  for (const [key, value] of Object.entries({ width, height, color: "#1b1d21" })) copy.setAttribute(key, value);
  copy.prepend(paper);
  return new XMLSerializer().serializeToString(copy);
}

/* A string as a cell of CSV. */
const cell = (value) => (/[",\n]/.test(String(value)) ? `"${String(value).replaceAll('"', '""')}"` : String(value ?? ""));

function numbers(chart) {
  const lines = [["series", ...chart.labels]];
  for (const series of chart.series) series.x.forEach((x, index) => lines.push([series.label, x, series.y[index]]));
  return lines.map((line) => line.map(cell).join(",")).join("\r\n") + "\r\n";
}

for (const figure of document.querySelectorAll("figure[data-chart]")) {
  const key = figure.dataset.chart;
  const chart = data.charts[key];
  if (chart) answer(figure, key, chart);
  const place = find(".tools", figure);
  if (!place) continue;
  const of = chart ? `, ${chart.title}` : "";
  const button = (what, name, type, text) => place.append(make("button",
    { type: "button", "aria-label": `Save ${what}${of}`, onclick: () => save(`${key}.${name}`, type, text()) }, `Save ${what}`));
  button("SVG", "svg", "image/svg+xml", () => standalone([...figure.querySelectorAll("svg")].find((one) => one.getClientRects().length)));
  if (chart?.series.length) button("CSV", "csv", "text/csv", () => numbers(chart));
}
