"use strict";

const SVG = "http://www.w3.org/2000/svg";

/* Draw a picture from its description: [name, attributes, ...children], children being the same or strings. */
function draw([name, attributes, ...children]) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  for (const child of children) element.append(typeof child === "string" ? child : draw(child));
  return element;
}

/* A region that scrolls where its content is wider than the window, by keys too. */
const scrolled = (label, ...children) =>
  make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": label }, ...children);

/* Save a string as a file. */
function save(name, type, text) {
  const address = URL.createObjectURL(new Blob([text], { type }));
  make("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

/* A picture as a file of its own: black on white, in light and dark mode. */
function standalone(picture) {
  const copy = picture.cloneNode(true);
  const [, , width, height] = copy.getAttribute("viewBox").split(" ");
  copy.setAttribute("width", width);
  copy.setAttribute("height", height);
  copy.setAttribute("color", "#222222");
  copy.setAttribute("font-family", "system-ui, 'DejaVu Sans', sans-serif");
  const paper = document.createElementNS(SVG, "rect");
  for (const [key, value] of Object.entries({ width, height, fill: "#ffffff" })) paper.setAttribute(key, value);
  copy.prepend(paper);
  return new XMLSerializer().serializeToString(copy);
}

/* A string as a cell of CSV. */
const cell = (value) => (/[",\n]/.test(String(value)) ? `"${String(value).replaceAll('"', '""')}"` : String(value ?? ""));

function numbers(chart) {
  const lines = [["series", chart.x_label, chart.y_label]];
  for (const series of chart.series) series.x.forEach((x, index) => lines.push([series.label, x, series.y[index]]));
  return lines.map((line) => line.map(cell).join(",")).join("\r\n") + "\r\n";
}

function tools(name, picture, chart = null) {
  const of = chart ? `, ${chart.title}` : "";
  const buttons = [make("button", { type: "button", "aria-label": `Save SVG${of}`, onclick: () => save(`${name}.svg`, "image/svg+xml", standalone(picture)) }, "Save SVG")];
  if (chart) {
    buttons.push(make("button", { type: "button", "aria-label": `Save CSV${of}`, onclick: () => save(`${name}.csv`, "text/csv", numbers(chart)) }, "Save CSV"));
  }
  return make("div", { class: "tools" }, ...buttons);
}

function figure(chart) {
  const picture = draw(chart.picture);
  const said = chart.note ? [make("br"), chart.note] : [];
  const caption = make("figcaption", {}, make("strong", {}, chart.title), ...said);
  return chart.series
    ? make("figure", {}, caption, picture, tools(chart.key, picture, chart))
    : make("figure", {}, picture, caption);
}

function table(content) {
  const head = make("tr", {}, ...content.head.map((text, column) => make("th", { scope: "col", class: column ? "number" : null }, text)));
  const rows = content.rows.map((row) => {
    const meaning = row.meaning ? [make("span", { class: "meaning" }, row.meaning)] : [];
    const cells = row.cells.map((text) => make("td", { class: "number" }, text));
    return make("tr", { class: row.name === "sum" ? "sum" : null }, make("th", { scope: "row", class: "name" }, row.name, ...meaning), ...cells);
  });
  const shown = content.head.some((text) => text) ? [make("thead", {}, head)] : [];
  return scrolled(content.title, make("table", {}, ...shown, make("tbody", {}, ...rows)));
}

/* Add a section, and a link to it. */
function section(key, title, ...children) {
  find("#contents").append(make("a", { href: `#${key}` }, title));
  find("#report").append(make("section", { id: key }, make("h2", {}, title), ...children));
}

const paragraph = (text) => (text ? [make("p", { class: "faint" }, text)] : []);

find("h1").textContent = data.name;
find("#source").textContent = data.source;
find("#setting").textContent = data.setting;

section("drawing", "Cross-section", ...data.drawings.flatMap((drawing, index) => {
  const picture = draw(drawing.picture);
  const caption = make("figcaption", {}, drawing.caption);
  return [
    ...(data.drawings.length > 1 ? [make("h3", {}, drawing.title)] : []),
    make("div", { class: "wide" }, scrolled(drawing.title, make("figure", {}, picture))),
    make("figure", {}, caption, tools(`cross-section-${index + 1}`, picture)),
  ];
}));

for (const content of data.tables_before) section(content.key, content.title, ...paragraph(content.text), table(content));

for (const group of data.groups) {
  const figures = group.charts.map(figure);
  const place = group.columns
    ? scrolled(group.title, make("div", { class: "frames", style: `grid-template-columns: repeat(${group.columns}, minmax(0, 1fr))` }, ...figures))
    : make("div", { class: "charts" }, ...figures);
  section(group.key, group.title, ...paragraph(group.text), place);
}

for (const content of data.tables_after) section(content.key, content.title, ...paragraph(content.text), table(content));

if (data.notes.length) {
  section("notes", "Notes", make("ul", {}, ...data.notes.map((note) => make("li", {}, make("strong", {}, note.topic), `: ${note.reason}`))));
}
find("#report").append(make("p", { class: "faint" }, `Made by rt ${data.version}. Rays follow geometrical optics: no diffraction, no manufacturing tolerances, and glasses by their formulas.`));
