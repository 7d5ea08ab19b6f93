"""Measure what it takes to render all views of a camera array, against as many samples in one picture.

    python bench/lightfield.py
    python bench/lightfield.py --whole

In turns, each round a row of views of scenes/lightfield/array.yaml is rendered and written into a file, and the scene
as the one large lens sees it that all of the array's are together, with as many samples as the row of views has: once
with as many pixels, and once with the pixels of one view, of which each gets more samples.  All are packed, built and
compiled before; the views' time counts writing them.  Printed are the medians of the ratios within rounds, with
bootstrap intervals.  With `--whole` all views are rendered besides, and the one picture with as many
samples, each once.
Prints Markdown, and writes every figure to outputs/lightfield.json.
"""

from __future__ import annotations

import math
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from warm import MEGA, QUICK_ROUNDS, ROUNDS, SCENES, arguments_for, measured, publish, say, table, with_interval

from raytracer.core.error_estimate.intervals import ratio_interval
from raytracer.film.light_field import lf
from raytracer.lightfield.capturing.bands import ViewBand
from raytracer.lightfield.capturing.capture import capture
from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import prepare_scene, render, render_prepared
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec

SCENE = SCENES / "lightfield" / "array.yaml"

GIGA = 1e9

VIEWS, AS_MANY_PIXELS, ONE_VIEW = "a row of views", "a picture of as many pixels", "a picture of one view's pixels"

QUICK = {"film.width": 128, "film.height": 96}


def one_lens(spec: SceneSpec, overrides: dict[str, Any]) -> SceneSpec:
    """Build the scene before the one square lens that all lenses of the array make up."""
    camera: Any = spec.camera
    side = 1e3 * camera.spacing[0] * camera.columns
    keys = {
        "type": "thin_lens",
        "look_from": list(camera.look_from),
        "look_at": list(camera.look_at),
        "vfov": camera.vfov,
        "focus_on": camera.focus_on,
        "aperture": 2.0 * side / math.sqrt(math.pi),
        "aperture_shape": {"type": "polygon", "blades": 4, "rotation": 45},
    }
    return load(SCENE, {**overrides, "camera": keys})


def seconds_of_row(views: PreparedScene, row: int, path: Path) -> float:
    """Time rendering and writing a row of views (s)."""
    layout: Any = views.packed.spec.camera.layout(views.packed.spec.film.width, views.packed.spec.film.height)
    band = ViewBand(row, row + 1, 0, layout.views.columns)
    part = band.layout(layout)
    begin = time.perf_counter()
    image = render_prepared(views.for_window(band.window(layout.views))).image
    lf.write(path, part.light_field(image))
    return time.perf_counter() - begin


def seconds_of_picture(picture: PreparedScene) -> float:
    """Time rendering the one picture (s)."""
    begin = time.perf_counter()
    render_prepared(picture)
    return time.perf_counter() - begin


def measure(rounds: int, threads: int, overrides: dict[str, Any], *, whole: bool) -> dict[str, Any]:
    """Measure rounds of a row of views and of one picture in turns."""
    spec = load(SCENE, overrides)
    camera: Any = spec.camera
    single = one_lens(spec, overrides)
    spp = spec.render.spp
    width, height = spec.film.width, spec.film.height
    edge = math.sqrt(camera.columns)
    large = {**overrides, "film.width": round(edge * width), "film.height": round(edge * height)}
    views = prepare_scene(spec, RenderOptions(threads=threads))
    pictures = {
        AS_MANY_PIXELS: prepare_scene(one_lens(spec, large), RenderOptions(spp=spp, threads=threads)),
        ONE_VIEW: prepare_scene(single, RenderOptions(spp=spp * camera.columns, threads=threads)),
    }
    seconds: dict[str, list[float]] = {name: [] for name in (VIEWS, *pictures)}
    found: dict[str, Any] = {
        "views": [camera.columns, camera.rows, width, height],
        "spp": spp,
        "samples_a_round": spp * camera.columns * width * height,
        "threads": threads,
    }
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.lf"
        for number in range(rounds):
            row = number * camera.rows // rounds
            for name in list(seconds)[:: -1 if number % 2 else 1]:
                taken = seconds_of_row(views, row, path) if name == VIEWS else seconds_of_picture(pictures[name])
                seconds[name].append(taken)
            say(f"round {number + 1}: " + ", ".join(f"{name} {taken[-1]:.2f} s" for name, taken in seconds.items()))
        if whole:
            begin = time.perf_counter()
            captured = capture(spec, path, threads=threads)
            middle = time.perf_counter()
            render(single, spp=spp * camera.columns * camera.rows, threads=threads)
            found["whole"] = {
                "views_seconds": middle - begin,
                "picture_seconds": time.perf_counter() - middle,
                "bands": captured.bands,
                "band_bytes": captured.band_bytes,
                "peak_rss_bytes": captured.stats.peak_rss_bytes,
            }
    return {
        **found,
        "seconds": seconds,
        "ratios": {name: ratio_interval(seconds[VIEWS], seconds[name]) for name in pictures},
    }


def text_of(result: dict[str, Any]) -> str:
    """Write the figures as Markdown."""
    columns, rows, width, height = result["views"]
    rows_of_table = []
    for name, seconds in result["seconds"].items():
        rate = result["samples_a_round"] * len(seconds) / sum(seconds) / MEGA
        ratio = with_interval(result["ratios"][name]) if name in result["ratios"] else "1"
        rows_of_table.append([name, f"{sum(seconds) / len(seconds):.2f}", f"{rate:.3g}", ratio])
    lines = [
        f"{columns} x {rows} views of {width} x {height}, {result['spp']} spp; {result['threads']} threads",
        "",
        table(["", "seconds", "M samples/s", "time of the views over it"], rows_of_table),
    ]
    if "whole" in result:
        found = result["whole"]
        peak, bands = found["peak_rss_bytes"] / GIGA, f"{found['bands']} parts of {found['band_bytes'] / GIGA:.2f} GB"
        ratio = found["views_seconds"] / found["picture_seconds"]
        lines += [
            f"all views, in {bands}: {found['views_seconds']:.1f} s, peak of the process {peak:.2f} GB",
            f"one picture with as many samples: {found['picture_seconds']:.1f} s; ratio {ratio:.3f}",
        ]
    return "\n".join(lines)


def main() -> None:
    """Measure, and publish."""
    parser = arguments_for(__doc__, "lightfield")
    parser.add_argument("--whole", action="store_true", help="also all views, and one picture with as many samples")
    given = parser.parse_args()
    overrides = QUICK if given.quick else {}
    rounds = given.rounds or (QUICK_ROUNDS if given.quick else ROUNDS)
    result = measured(lambda: measure(rounds, given.threads, overrides, whole=given.whole))
    publish(result, text_of(result), given.out)


if __name__ == "__main__":
    main()
