/* Depth of field: lengths are millimetres, but for places along the axis, which are inverse distances (1/m). */

const state = Object.fromEntries(Object.entries(data.settings).map(([name, setting]) => [name, setting.value]));
state.sensor = data.sensor;

const PLOT = { left: 48, right: 1008, top: 30, bottom: 290 };
const STRIP = { top: 330, height: 96 };
const NEAREST = data.strip.focus.at(-1);
// Targets stand in the middles of equal parts of the strip, the nearest at the left.
const across = (diopters) => PLOT.right - (PLOT.right - PLOT.left) * diopters / NEAREST;

/* What follows from the settings: the sizes of the opening and of the circle that is allowed, and where both meet. */
function follow({ sensor, focal_length: f, stop, focus, part }) {
  const diagonal = Math.hypot(...data.sensors[sensor]);
  const [distance, f_number, allowed] = [focus > 0 ? 1000 / focus : Infinity, 2 ** (stop / 2), diagonal / part];
  const aperture = f / f_number;
  const image = Number.isFinite(distance) ? f * distance / (distance - f) : f;
  // C = A z_i |1/F - 1/s|: the allowed circle is reached this far from the focus, in inverse metres.
  const reach = 1000 * allowed / (aperture * image);
  const near = 1 / (focus + reach);
  const far = focus > reach ? 1 / (focus - reach) : Infinity;
  return { f_number, aperture, allowed, image, reach, near, far, depth: far - near, hyperfocal: (f * f / (f_number * allowed) + f) / 1000 };
}

const metres = (value) => (Number.isFinite(value) ? `${shortNumber(value)} m` : "infinity");

/* The number of the strip that was rendered nearest to the settings. */
function stripNumber({ aperture }) {
  const nearest = (values, value) => values.reduce((best, other, k) => (Math.abs(other - value) < Math.abs(values[best] - value) ? k : best), 0);
  const row = nearest(data.strip.aperture.map(Math.log2), Math.log2(aperture));
  return row * data.strip.focus.length + nearest(data.strip.focus, state.focus);
}

function show() {
  const facts = follow(state);
  const circle = (diopters) => facts.aperture * facts.image * Math.abs(diopters - state.focus) / 1000;
  // The allowed circle is always at the same height.
  const up = (millimetres) => PLOT.bottom - Math.min(1, millimetres / (10 * facts.allowed)) * (PLOT.bottom - PLOT.top);
  const top = Math.min(NEAREST, state.focus + 10 * facts.reach);
  const low = Math.max(0, state.focus - 10 * facts.reach);
  const [begin, end] = [Math.min(NEAREST, state.focus + facts.reach), Math.max(0, state.focus - facts.reach)];
  const { height, width, image, count } = data.strip;
  const strip = draw("svg", { x: 0, y: STRIP.top, width: PLOT.left + PLOT.right, height: STRIP.height, viewBox: `0 ${height * stripNumber(facts)} ${width} ${height}`, preserveAspectRatio: "none" },
    draw("image", { href: image, width, height: height * count, preserveAspectRatio: "none" }));
  find("#range").replaceChildren(
    draw("rect", { class: "field", x: across(begin), y: PLOT.top, width: across(end) - across(begin), height: PLOT.bottom - PLOT.top }),
    ...data.strip.focus.flatMap((diopters) => [
      line("tick", [across(diopters), PLOT.top], [across(diopters), PLOT.bottom]),
      draw("text", { class: "middle", x: across(diopters), y: PLOT.bottom + 22 }, diopters > 0 ? `${shortNumber(1 / diopters, 2)} m` : "∞"),
    ]),
    line("allowed", [PLOT.left, up(facts.allowed)], [PLOT.right, up(facts.allowed)]),
    draw("text", { x: PLOT.left + 6, y: up(facts.allowed) - 6 }, "allowed circle"),
    line("circle", [across(top), up(circle(top))], [across(state.focus), up(0)], [across(low), up(circle(low))]),
    line("focus", [across(state.focus), PLOT.top - 8], [across(state.focus), PLOT.bottom]),
    draw("text", { class: "middle", x: across(state.focus), y: PLOT.top - 12 }, "focus"),
    strip,
  );
  showNumbers([
    ["near limit", metres(facts.near), "near", facts.near],
    ["far limit", metres(facts.far), "far", facts.far],
    ["depth of field", metres(facts.depth), "depth", facts.depth],
    ["hyperfocal distance", metres(facts.hyperfocal), "hyperfocal", facts.hyperfocal],
    ["allowed circle", `${shortNumber(facts.allowed)} mm`, "allowed", facts.allowed],
    ["opening", `${shortNumber(facts.aperture)} mm`, "aperture", facts.aperture],
  ]);
  showSetting("focal_length", state.focal_length, `${shortNumber(state.focal_length)} mm`);
  showSetting("stop", state.stop, `f/${shortNumber(facts.f_number, 2)}`);
  showSetting("focus", state.focus, metres(1 / state.focus));
  showSetting("part", state.part, `1/${state.part} of the diagonal`);
}

function set(name, value) {
  state[name] = value;
  show();
}

const choice = make("select", { id: "sensor", onchange: () => set("sensor", choice.value) }, ...Object.keys(data.sensors).map((name) => make("option", { value: name }, name.replaceAll("_", " "))));
choice.value = state.sensor;
find("#controls").append(make("label", {}, "sensor ", choice));
addSliders(data.settings, set);
find("#range").addEventListener("click", (event) => {
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(find("#range").getScreenCTM().inverse());
  const { low, high, step } = data.settings.focus;
  set("focus", Math.min(high, Math.max(low, step * Math.round((PLOT.right - point.x) / (PLOT.right - PLOT.left) * NEAREST / step))));
});
show();
