/* The thin lens as a bench: all lengths are millimetres, along the axis from left to right, the lens at 0. */

const MIDDLE = { x: 560, y: 205 };
const SCALE = 1.9;
const state = Object.fromEntries(Object.entries(data.settings).map(([name, setting]) => [name, setting.value]));

const x = (millimetres) => MIDDLE.x + SCALE * millimetres;
const y = (millimetres) => MIDDLE.y - SCALE * millimetres;

/* What follows from the settings: Gauss's equation, and the similar triangles of the circle of confusion. */
function follow({ focal_length: f, subject, diameter, film }) {
  const image = subject === f ? Infinity : f * subject / (subject - f);
  const circle = Number.isFinite(image) ? diameter * Math.abs(film - image) / Math.abs(image) : diameter;
  const focus = film > f ? f * film / (film - f) : Infinity;
  return { image, magnification: image / subject, circle, focus, f_number: f / diameter };
}

/* Put words at a place, in millimetres. */
const words = (at, text, shift = [0, 0]) => draw("text", { x: x(at[0]) + shift[0], y: y(at[1]) + shift[1], "text-anchor": "middle" }, text);

function lensOutline(radius) {
  const bulge = Math.max(5, 0.14 * SCALE * radius);
  const [top, bottom] = [y(radius), y(-radius)];
  return draw("path", { class: "lens", d: `M ${x(0)} ${top} Q ${x(0) + 2 * bulge} ${MIDDLE.y} ${x(0)} ${bottom} Q ${x(0) - 2 * bulge} ${MIDDLE.y} ${x(0)} ${top} Z` });
}

function rays({ image }) {
  const { subject, object_height: height, diameter, film, focal_length: f } = state;
  const end = Math.max(film, Math.min(Number.isFinite(image) && image > 0 ? image : 0, 220), 60) + 8;
  const drawn = [];
  for (const part of [1, 0.5, 0, -0.5, -1]) {
    const at = part * diameter / 2;
    // A thin lens turns a ray by its height over the focal length.
    const slope = (at - height) / subject - at / f;
    drawn.push(line("ray", [x(-subject), y(height)], [x(0), y(at)], [x(end), y(at + slope * end)]));
  }
  return drawn;
}

function show() {
  const facts = follow(state);
  const { subject, object_height: height, diameter, film, focal_length: f } = state;
  const bench = find("#bench");
  const low = -height * film / subject;
  // The image of the arrow's tip on the film is the middle of its disc.
  const isOnBench = facts.image > 0 && facts.image < 225;
  const imageHeight = -height * facts.magnification;
  bench.replaceChildren(
    draw("defs", {}, draw("marker", { id: "tip", viewBox: "0 0 10 10", refX: 6, refY: 5, markerWidth: 3, markerHeight: 3, orient: "auto-start-reverse" }, draw("path", { d: "M 0 0 L 10 5 L 0 10 Z", class: "thing", "stroke-width": 0 }))),
    line("axis", [0, MIDDLE.y], [1000, MIDDLE.y]),
    ...rays(facts),
    lensOutline(diameter / 2),
    draw("line", { class: "thing", x1: x(-subject), y1: y(0), x2: x(-subject), y2: y(height), "marker-end": "url(#tip)" }),
    ...(isOnBench ? [draw("line", { class: "thing", x1: x(facts.image), y1: y(0), x2: x(facts.image), y2: y(imageHeight), "marker-end": "url(#tip)" }), words([facts.image, imageHeight], "image", [0, imageHeight < 0 ? 28 : -18])] : []),
    line("film", [x(film), y(72)], [x(film), y(-72)]),
    line("disc", [x(film), y(low + facts.circle / 2)], [x(film), y(low - facts.circle / 2)]),
    ...[-f, f].map((at) => draw("circle", { class: "focus", cx: x(at), cy: y(0), r: 5 })),
    words([-subject, height], "object", [0, -18]), words([0, diameter / 2], "lens", [0, -12]), words([film, 72], "film", [0, -8]),
    words([f, 0], "F'", [0, 24]), words([-f, 0], "F", [0, 24]),
    ...handles(),
  );
  showNumbers([
    ["image distance", `${shortNumber(facts.image)} mm`, "image", facts.image],
    ["magnification", shortNumber(facts.magnification), "magnification", facts.magnification],
    ["circle of confusion", `${shortNumber(facts.circle)} mm`, "circle", facts.circle],
    ["in focus on the film", Number.isFinite(facts.focus) ? `${shortNumber(facts.focus)} mm away` : "nothing", "focus", facts.focus],
    ["f-number", `f/${shortNumber(facts.f_number, 3)}`, "f_number", facts.f_number],
  ]);
  for (const [name, { unit }] of Object.entries(data.settings)) showSetting(name, state[name], `${shortNumber(state[name])} ${unit}`);
}

/* Places that can be dragged, each with the setting that it changes and how. */
function handles() {
  const places = {
    subject: [-state.subject, state.object_height, (at) => -at.x],
    diameter: [0, state.diameter / 2, (at) => 2 * at.y],
    focal_length: [state.focal_length, 0, (at) => at.x],
    film: [state.film, -60, (at) => at.x],
  };
  return Object.entries(places).map(([name, [across, up, meaning]]) => {
    const handle = draw("circle", { class: "handle", cx: x(across), cy: y(up), r: 16, "data-setting": name });
    handle.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      dragged = { name, meaning };
    });
    return handle;
  });
}

let dragged = null;

function set(name, value) {
  const { low, high, step } = data.settings[name];
  state[name] = Math.min(high, Math.max(low, step * Math.round(value / step)));
  show();
}

window.addEventListener("pointermove", (event) => {
  if (!dragged) return;
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(find("#bench").getScreenCTM().inverse());
  set(dragged.name, dragged.meaning({ x: (point.x - MIDDLE.x) / SCALE, y: (MIDDLE.y - point.y) / SCALE }));
});
window.addEventListener("pointerup", () => { dragged = null; });

addSliders(data.settings, set);
find("#controls").append(make("button", { type: "button", id: "sharp", onclick: () => set("film", follow(state).image) }, "Focus: put the film where the image is"));
show();
