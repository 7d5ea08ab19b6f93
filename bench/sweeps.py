"""Measure what a sweep takes beside the renders that it is made of.

    python bench/sweeps.py

The cover by seven apertures and five distances of focus, at 320 x 180 pixels and 64 samples each, in two ways that take
turns, the kernel being compiled:

- sweep: as `rt sweep` does it, from reading the scene's file to the last byte of its page, into an empty folder;
- apart: every point by itself, loaded, packed, built, rendered and saved. Of that, *renders alone* is the time in which
  samples are taken.

What is compared is the median of the ratios of the sweep's time to that of the renders alone, within a round. What the
sweep has made is counted: files read, scenes packed, structures built.
Prints Markdown, and writes every figure to outputs/sweeps.json.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from warm import QUICK_ROUNDS, ROUNDS, SCENES, arguments_for, measured, publish, say, table, with_interval

from raytracer.analysis.sweep.run import sweep
from raytracer.core.error_estimate.intervals import ratio_interval
from raytracer.rendering.render import render
from raytracer.scene.cache import RenderCache
from raytracer.scene.load import load

SCENE = SCENES / "cover.yaml"
APERTURE, FOCUS = "camera.defocus_angle", "camera.focus_distance"
APERTURES = tuple(0.6 * 2.0 ** (-0.5 * stop) for stop in range(7))
"""Angles (deg) of the cover's own aperture, and of those stopped down by one to six stops."""

DISTANCES = (6.0, 8.0, 10.0, 12.0, 14.0)
WIDTH, HEIGHT, SPP, QUICK_SPP = 320, 180, 64, 8


def size(spp: int) -> dict[str, Any]:
    """Return the overrides that all points have in common."""
    return {"film.width": WIDTH, "film.height": HEIGHT, "render.spp": spp}


def swept(spp: int, threads: int) -> tuple[float, RenderCache]:
    """Time a sweep (s); return that and the cache that its points share."""
    cache = RenderCache()
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        values = {APERTURE: list(APERTURES), FOCUS: list(DISTANCES), **size(spp)}
        done = sweep(SCENE, values, folder=Path(folder) / "sweep", threads=threads, cache=cache)
        seconds = time.perf_counter() - begin
    assert all(taken.status == "done" for taken in done.results)
    return seconds, cache


def apart(spp: int, threads: int) -> tuple[float, float]:
    """Time all points one by one (s), and the part in which samples were taken."""
    samples = 0.0
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        for number, (aperture, focus) in enumerate(product(APERTURES, DISTANCES)):
            done = render(load(SCENE, {APERTURE: aperture, FOCUS: focus, **size(spp)}), threads=threads)
            done.image.save(Path(folder) / f"{number}.png")
            samples += done.stats.seconds["render"]
        seconds = time.perf_counter() - begin
    return seconds, samples


def measure(rounds: int, threads: int, quick: bool) -> dict[str, Any]:
    """Measure sweeps and single renders in turns."""
    say("sweeps")
    spp = QUICK_SPP if quick else SPP
    render(load(SCENE, size(1)), threads=threads)
    sweeps: list[float] = []
    wholes: list[float] = []
    samples: list[float] = []
    for turn in range(rounds):
        for way in ("sweep", "apart")[:: 1 if turn % 2 else -1]:
            if way == "sweep":
                seconds, cache = swept(spp, threads)
                sweeps.append(seconds)
            else:
                whole, alone = apart(spp, threads)
                wholes.append(whole)
                samples.append(alone)
        say(f"  sweep {sweeps[-1]:.2f} s, apart {wholes[-1]:.2f} s, of these renders {samples[-1]:.2f} s")
    return {
        "sweeps": {
            "scene": SCENE.stem,
            "points": len(APERTURES) * len(DISTANCES),
            "width": WIDTH,
            "height": HEIGHT,
            "spp": spp,
            "threads": threads,
            "sweep": sweeps,
            "apart": wholes,
            "alone": samples,
            "to_alone": ratio_interval(np.array(sweeps), np.array(samples)),
            "to_apart": ratio_interval(np.array(sweeps), np.array(wholes)),
            "counts": cache.counts._asdict(),
        }
    }


def report(item: dict[str, Any]) -> str:
    """Write the figures as Markdown."""
    seconds = (f"{statistics.median(item[key]):.2f}" for key in ("sweep", "alone", "apart"))
    counts = item["counts"]
    row = [
        f"{item['scene']}, {item['points']} points, {item['width']} x {item['height']}, {item['spp']} spp",
        *seconds,
        with_interval(item["to_alone"]),
        with_interval(item["to_apart"]),
        f"{counts['worlds_packed']}, {counts['structures_built']}, {counts['kernels']}",
    ]
    head = (
        "sweep",
        "sweep (s)",
        "renders alone (s)",
        "points apart (s)",
        "sweep / alone",
        "sweep / apart",
        "packed, built, compiled besides the first render's",
    )
    return "### What a sweep takes beside its renders\n\n" + table(head, [row])


def main() -> None:
    """Measure, write, print."""
    arguments = arguments_for(__doc__, "sweeps").parse_args()
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    result = measured(lambda: measure(rounds, arguments.threads, arguments.quick))
    publish(result, report(result["sweeps"]), arguments.out)


if __name__ == "__main__":
    main()
