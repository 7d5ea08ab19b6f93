"use strict";

/* Shared by all pages: the data, and functions that make elements and strings of them. */

const data = JSON.parse(document.getElementById("data").textContent);

/* The first element that a selector finds. */
const find = (selector, within = document) => within.querySelector(selector);

/* An element with attributes ("class", "aria-label", ...; those that are null are left out) and listeners ("onclick": a
   function), holding strings and elements. */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined) element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

/* A table of strings and elements, which scrolls where it is wide; all columns but the first are numbers. */
function table(head, rows) {
  const cells = (tag, row) => row.map((cell, column) => make(tag, { class: column ? "number" : null }, cell));
  return make("div", { class: "scroll" }, make("table", {},
    make("thead", {}, make("tr", {}, ...cells("th", head))),
    make("tbody", {}, ...rows.map((row) => make("tr", {}, ...cells("td", row))))));
}

/* Have the buttons in a table's head sort its rows by the numbers, or else the strings, in `data-sort` of their cells;
   what has none comes last. */
function sortable(table) {
  const body = find("tbody", table);
  for (const head of table.querySelectorAll("thead th")) {
    find("button", head).addEventListener("click", () => {
      const descending = head.getAttribute("aria-sort") === "ascending";
      for (const other of head.parentElement.children) other.setAttribute("aria-sort", "none");
      head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      const key = (row) => row.cells[head.cellIndex].dataset.sort;
      const order = (x, y) => (Number.isNaN(Number(x)) || Number.isNaN(Number(y)) ? x.localeCompare(y) : Number(x) > Number(y) ? 1 : Number(x) < Number(y) ? -1 : 0);
      body.append(...[...body.rows].sort((a, b) => {
        const [x, y] = [key(a), key(b)];
        return x === "" || y === "" ? (x === "") - (y === "") : (descending ? -1 : 1) * order(x, y);
      }));
    });
  }
}

/* Elements for keys of the keyboard, each with what it does. */
const keyHints = (keys) => keys.flatMap(([key, words]) => [make("span", {}, make("kbd", {}, key), ` ${words}`), " "]);

/* A number for reading: significant digits without trailing zeros; strings (inf, nan) stay. */
function shortNumber(value, digits = 4) {
  if (typeof value !== "number") return value === null || value === undefined ? "" : String(value);
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-4 || size >= 1e9) return value.toExponential(digits - 1).replace(/\.?0+e/, "e");
  // Digits before the point are all written.
  const rounded = size >= 10 ** digits ? Math.round(value) : Number(value.toPrecision(digits));
  return rounded.toLocaleString("en-US", { maximumFractionDigits: 12, useGrouping: size >= 1e5 });
}

/* Returns a function that writes the page's state into its address, so that it can be shared. */
function addressWriter(addressOf) {
  let written = null;
  return () => {
    clearTimeout(written);
    const before = location.hash;
    // Browsers grow impatient with an address that changes all the time.
    written = setTimeout(() => {
      // An address that someone has set since then is about to be read: it stays.
      if (location.hash === before && before.slice(1) !== addressOf()) history.replaceState(null, "", `#${addressOf()}`);
    }, 250);
  };
}
