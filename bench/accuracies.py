"""Measure what `accuracy: exact | robust | fast` costs on every scene.

    python bench/accuracies.py

Each scene is rendered as it is but for its size, by warm renderers that take turns (warm.py): one for each accuracy,
and a second one of `exact`, whose ratio to the first shows what the machine's noise alone makes of two equal renders.
All have the same seed in a round, and so the same camera rays. What is printed is the median of the ratios to `exact`
within a round, with a bootstrap interval, and that of the repeat of the same; and by how much the pictures differ
without their noise (relative, root mean square over the pixels).
Prints Markdown, and writes every figure to outputs/accuracies.json.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warm import (
    MEGA,
    QUICK_ROUNDS,
    ROUNDS,
    Failed,
    Renderers,
    arguments_for,
    figures,
    measured,
    our_command,
    pictures_of,
    publish,
    reduced,
    say,
    scene_files,
    table,
    tiles_of,
    with_interval,
)

from raytracer.core.error_estimate.intervals import Interval, ratio_interval, ratio_of_sums, sqrt_interval
from raytracer.core.error_estimate.metric import error_weights, squared_bias_by_tile

EXACT, AGAIN = "exact", "exact again"
ARMS = {EXACT: "exact", "robust": "robust", "fast": "fast", AGAIN: "exact"}

PIXELS, QUICK_PIXELS = 90_000, 10_000
SECONDS, QUICK_SECONDS = 0.6, 0.1
"""Of one render, by which its samples are chosen."""

FIRST_SPP = 8


def measure_scene(path: Path, rounds: int, threads: int, pixels: int, seconds: float) -> dict[str, Any]:
    """Warm renders of a scene by each accuracy in turn.

    Raises
    ------
    Failed : a renderer did not start, or rendered what is not a number.
    """
    width, height = reduced(path, pixels)
    say(f"{path.stem}, {width} x {height}")
    with Renderers() as renderers:
        for name, accuracy in ARMS.items():
            renderers.start(name, our_command(path, width, height, FIRST_SPP, threads, accuracy=accuracy))
        renderers.check()
        warm = renderers.take_turns(1, 1, dict.fromkeys(renderers, FIRST_SPP))
        spp = max(1, round(FIRST_SPP * seconds / warm[EXACT][0]["render"]))
        answers = renderers.take_turns(rounds, 2, dict.fromkeys(renderers, spp), pictures=True)
    pictures = {name: pictures_of(answers[name]) for name in renderers}
    w = error_weights(pictures[EXACT].mean(axis=0))

    def bias(name: str) -> Interval:
        """Compute the squared bias, without noise."""
        squares = squared_bias_by_tile(pictures[name], pictures[EXACT], w, tiles_of(width, height))
        return ratio_of_sums(squares.sums, squares.pixels)

    return {
        "width": width,
        "height": height,
        "spp": spp,
        "rounds": rounds,
        "threads": threads,
        "arms": {
            name: {
                "seconds": figures(answers[name]).tolist(),
                "rays": figures(answers[name], "rays").tolist(),
                "time_ratio": ratio_interval(figures(answers[name]), figures(answers[EXACT])),
                "squared_bias": bias(name),
            }
            for name in renderers
        },
    }


def measure(rounds: int, threads: int, quick: bool, scenes: Sequence[str] = ()) -> dict[str, Any]:
    """Measure all scenes of scenes/, or those named."""
    pixels, seconds = (QUICK_PIXELS, QUICK_SECONDS) if quick else (PIXELS, SECONDS)
    items = []
    for path in scene_files(scenes):
        try:
            items.append({"scene": path.stem, **measure_scene(path, rounds, threads, pixels, seconds)})
        except Failed as error:
            items.append({"scene": path.stem, "failed": str(error)})
            say(f"  {error}")
    return {"accuracies": items}


def difference(squared_bias: Interval) -> str:
    """Format a bias."""
    value, low, high = (f"{100.0 * x:.2g}" for x in sqrt_interval(Interval(*squared_bias)))
    return f"{value} % ({low} .. {high})" if squared_bias[1] > 0.0 else f"none seen (< {high} %)"


def report(items: Sequence[dict[str, Any]]) -> str:
    """Write the figures as Markdown."""
    compared = ("robust", "fast", AGAIN)
    rows = []
    for item in items:
        if "failed" in item:
            rows.append([item["scene"], f"not measured: {item['failed']}", "", "", *[""] * (len(compared) + 2)])
            continue
        variants = item["arms"]
        exact = variants[EXACT]
        seconds = statistics.median(exact["seconds"])
        rows.append(
            [
                item["scene"],
                f"{item['width']} x {item['height']}, {item['spp']} spp",
                f"{seconds:.2f}",
                f"{statistics.median(exact['rays']) / seconds / MEGA:.1f}",
                *(with_interval(variants[name]["time_ratio"]) for name in compared),
                *(difference(variants[name]["squared_bias"]) for name in compared[:2]),
            ]
        )
    head = (
        "scene",
        "film",
        "exact: seconds",
        "exact: M rays/s",
        "robust / exact",
        "fast / exact",
        "repeat of the same: exact / exact",
        "robust differs by",
        "fast differs by",
    )
    return "### What `accuracy` costs, in time\n\n" + table(head, rows)


def main() -> None:
    """Measure, write, print."""
    parser = arguments_for(__doc__, "accuracies")
    parser.add_argument("scenes", nargs="*", help="names of scenes (default: all of scenes/)")
    arguments = parser.parse_args()
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    result = measured(lambda: measure(rounds, arguments.threads, arguments.quick, arguments.scenes))
    publish(result, report(result["accuracies"]), arguments.out)


if __name__ == "__main__":
    main()
