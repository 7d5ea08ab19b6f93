/* Shared by the pages that can be played with: drawings, and sliders of settings ({label, low, high, step, value}). */

/* An element of SVG. */
function draw(tag, attributes, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

const line = (name, ...points) => draw("polyline", { class: name, points: points.map((point) => point.join(",")).join(" ") });

/* Add a slider of each setting to the controls; `set(name, value)` is called when one is moved. */
function addSliders(settings, set) {
  for (const [name, setting] of Object.entries(settings)) {
    const input = make("input", { type: "range", id: name, min: setting.low, max: setting.high, step: setting.step, value: setting.value, oninput: () => set(name, Number(input.value)) });
    find("#controls").append(make("label", { for: name }, setting.label, make("output"), input));
  }
}

/* Show a setting on its slider, in words beside it. */
function showSetting(name, value, words) {
  const input = find(`#${name}`);
  input.value = value;
  input.setAttribute("aria-valuetext", words);
  find("output", input.parentElement).textContent = words;
}

/* Fill the table of what follows from the settings: rows of a label, words, an id, and the number behind the words. */
function showNumbers(rows) {
  find("#numbers").replaceChildren(table(["what follows", "value"], rows.map(([label, words, id, value]) => [label, make("span", { id, "data-value": String(value) }, words)])));
}
