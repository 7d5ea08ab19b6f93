"use strict";

const CHANNELS = ["red", "green", "blue"];
const TESTS = { means: "means of channels", tiles: "means of tiles", pixels: "single pixels", exceeding: "pixels beyond 2" };

const OUTCOMES = { error: "cannot be checked", skipped: "left out" };
const FINE = new Set(["passed", "skipped"]);

/* Show a result's verdict in colour. */
const badge = (result) =>
  make("strong", { class: FINE.has(result.verdict) ? "good" : "bad" }, OUTCOMES[result.verdict] ?? result.verdict);

function figure(source, caption, legend = null) {
  const image = make("img", { src: source, alt: caption });
  const bar = legend && make("div", { class: "legend", title: legend.title },
    legend.low, make("img", { src: data.legend, alt: "" }), legend.high);
  return make("figure", {}, image, ...(bar ? [bar] : []), make("figcaption", {}, caption));
}

function pictures(result) {
  const shown = result.pictures;
  const scale = shortNumber(result.difference_scale, 2);
  const z = { low: `−${data.z_scale}`, high: `+${data.z_scale}`, title: "standard deviations" };
  return make("div", { class: "pictures" },
    figure(shown.reference, "reference"),
    figure(shown.picture, "picture now"),
    figure(shown.difference, "difference of luminance, red: brighter now", { low: `−${scale}`, high: `+${scale}`, title: "luminance" }),
    figure(shown.pixels, "z of pixels, the farthest channel", z),
    figure(shown.tiles, "z of tiles, the farthest channel", z));
}

function numbers(result) {
  const means = table(["mean", "reference", "now", "change", "z"], CHANNELS.map((name, channel) => {
    const [before, now] = [result.means.reference[channel], result.means.picture[channel]];
    const change = before ? `${shortNumber(100 * (now - before) / before, 2)} %` : "";
    return [name, shortNumber(before, 5), shortNumber(now, 5), change, shortNumber(result.means.z[channel], 2)];
  }));
  const tests = table(["test", "p"], Object.entries(TESTS).map(([key, text]) => {
    const p = result.p[key];
    return [text, make("span", { class: p < result.alpha / 4 ? "bad" : null }, p === 0 ? "< 1e-300" : shortNumber(p, 2))];
  }));
  return make("div", { class: "tables" }, means, tests);
}

function about(result) {
  const parts = [];
  if (result.scene) parts.push(result.scene);
  if (result.size) parts.push(`${result.size[0]} × ${result.size[1]} pixels`);
  if (result.kept) parts.push(`reference of rt ${result.kept.version}: ${result.kept.spp} spp, seed ${result.kept.seed}`);
  if (result.spp) parts.push(`now: ${result.spp} spp, seed ${result.seed}`);
  if (result.finds !== null) parts.push(`finds ${shortNumber(100 * result.finds, 2)} % more or less light`);
  if (result.brightness && result.brightness !== 1) parts.push(`shown with ${shortNumber(result.brightness)} times its light`);
  const overrides = Object.entries(result.overrides ?? {}).map(([key, value]) => `${key}=${JSON.stringify(value)}`);
  if (overrides.length) parts.push(overrides.join(" "));
  return parts.join(" · ");
}

function body(result) {
  const parts = [make("p", {}, result.reason)];
  if (!FINE.has(result.verdict) && result.changes.length) {
    const have = result.changes.length === 1 ? "has" : "have";
    parts.push(make("p", { class: "warning" }, `${result.changes.join(", ")} ${have} changed since the reference was rendered.`));
  }
  parts.push(make("p", { class: "faint" }, about(result)));
  if (!result.pictures) return parts;
  const wiped = make("div", { class: "wiped" });
  parts.push(pictures(result), wiped, numbers(result));
  return parts;
}

const failed = data.results.filter((result) => !FINE.has(result.verdict));
find("#heading").textContent = failed.length
  ? `${failed.length} of ${data.results.length} failed`
  : `${data.results.filter((result) => result.verdict === "passed").length} passed`;
find("#about").textContent = `Scenes against their references, checked by rt ${data.version}.`;

if (data.results.length > 1) {
  find("#contents").append(table(["scene", "verdict", "z of the means", "spp"], data.results.map((result, index) => [
    make("a", { href: `#result-${index}` }, result.name), badge(result),
    result.means ? result.means.z.map((z) => shortNumber(z, 2)).join(", ") : "", String(result.spp || ""),
  ])));
}

/* Add the wipe of a result once it is visible, since a wipe measures its place. */
function wipe(section, result) {
  const place = find(".wiped", section);
  if (!place || place.childElementCount) return;
  new Wipe(place, result.pictures.reference, result.pictures.picture, { leftLabel: "reference", rightLabel: "now" });
}

data.results.forEach((result, index) => {
  const heading = make("h2", {}, result.name, " ", badge(result));
  const section = make("section", { class: "result", id: `result-${index}` });
  if (FINE.has(result.verdict)) {
    const details = make("details", { ontoggle: () => wipe(section, result) }, make("summary", {}, result.line), ...body(result));
    section.append(details);
  } else {
    section.append(heading, ...body(result));
  }
  find("#results").append(section);
  if (!FINE.has(result.verdict)) wipe(section, result);
});

/* Open the result that the address names. */
function follow() {
  const section = location.hash && document.getElementById(location.hash.slice(1));
  const details = section && find("details", section);
  if (details) details.open = true;
}
window.addEventListener("hashchange", follow);
follow();
