"""Measure what the samplers are worth: how error falls with samples, and the time to equal error.

    python bench/samplers.py

Each scene is rendered, as it is but for its size, by warm renderers that take turns (warm.py), one for each sampler, at
rising samples per pixel, in each round with another seed. Scrambled with other seeds, pictures of any sampler are
independent of each other, so their spread over the rounds is the error of one: it takes no reference.

*Time to equal error* is the time that Sobol or stratified samples need for the error that they have at the most
samples, over that which independent ones need for it: the ratio of squared errors at equal samples, since those of
independent samples fall as 1/N, times that of the times. Its interval is a bootstrap over tiles of 16 x 16 pixels.
Prints Markdown, and writes every figure to outputs/samplers.json.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from warm import (
    QUICK_ROUNDS,
    ROUNDS,
    Array,
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

from raytracer.core.error_estimate.intervals import ratio_interval, ratio_of_sums
from raytracer.core.error_estimate.metric import error_weights, mse_by_tile

INDEPENDENT, OTHERS = "independent", ("sobol", "stratified")
LEVELS, QUICK_LEVELS = (16, 64, 256), (4, 16)
PIXELS, QUICK_PIXELS = 12_000, 3_000


def slope(levels: Sequence[int], squared_errors: Sequence[float]) -> float:
    """Fit the exponent with which error falls as samples grow: 1/2 if independent."""
    return float(-0.5 * np.polyfit(np.log(levels), np.log(squared_errors), 1)[0])


def measure_scene(path: Path, rounds: int, threads: int, levels: Sequence[int], pixels: int) -> dict[str, Any]:
    """Warm renders of a scene with each sampler in turn.

    Raises
    ------
    Failed : a renderer did not start, or rendered what is not a number.
    """
    width, height = reduced(path, pixels)
    say(f"{path.stem}, {width} x {height}, by samplers")
    with Renderers() as renderers:
        for name in (INDEPENDENT, *OTHERS):
            renderers.start(name, our_command(path, width, height, levels[0], threads, sampler=name))
        renderers.check()
        pictures: list[dict[str, Array]] = []
        for level in levels:
            answers = renderers.take_turns(rounds, 1 + level * rounds, dict.fromkeys(renderers, level), pictures=True)
            pictures.append({name: pictures_of(answers[name]) for name in renderers})

    # The most samples tell the brightness of pixels best.
    w = error_weights(np.mean([stack.mean(axis=0) for stack in pictures[-1].values()], axis=0))
    tiles = tiles_of(width, height)
    samplers = {}
    for name in (INDEPENDENT, *OTHERS):
        squared = [mse_by_tile(level[name], w, tiles) for level in pictures]
        reference = mse_by_tile(pictures[-1][INDEPENDENT], w, tiles)
        time = ratio_interval(figures(answers[name]), figures(answers[INDEPENDENT]))
        error = ratio_of_sums(squared[-1].sums, reference.sums)
        samplers[name] = {
            "relmse": [level.mean for level in squared],
            "slope": slope(levels, [level.mean for level in squared]),
            "time_ratio": time,
            "error_ratio": error,
            "time_to_equal_error": [time.value * value for value in error],
        }
    return {"width": width, "height": height, "levels": levels, "rounds": rounds, "samplers": samplers}


def measure(rounds: int, threads: int, quick: bool, scenes: Sequence[str] = ()) -> dict[str, Any]:
    """Measure all scenes of scenes/, or those named."""
    levels, pixels = (QUICK_LEVELS, QUICK_PIXELS) if quick else (LEVELS, PIXELS)
    items = []
    for path in scene_files(scenes):
        try:
            items.append({"scene": path.stem, **measure_scene(path, rounds, threads, levels, pixels)})
        except Failed as error:
            items.append({"scene": path.stem, "failed": str(error)})
            say(f"  {error}")
    return {"samplers": items}


def report(items: Sequence[dict[str, Any]]) -> str:
    """Write the figures as Markdown."""
    rows = []
    for item in items:
        if "failed" in item:
            rows.append([item["scene"], f"not measured: {item['failed']}", *[""] * 6])
            continue
        samplers = item["samplers"]
        rows.append(
            [
                item["scene"],
                f"{item['levels'][-1]}",
                *(f"{samplers[name]['slope']:.2f}" for name in samplers),
                *(
                    cell
                    for name in OTHERS
                    for cell in (
                        f"{samplers[name]['time_ratio'][0]:.2f}",
                        with_interval(samplers[name]["time_to_equal_error"]),
                    )
                ),
            ]
        )
    head = ["scene", "spp", *(f"slope, {name}" for name in (INDEPENDENT, *OTHERS))]
    head += [words for name in OTHERS for words in (f"time of {name} samples", f"{name}: time to equal error")]
    return (
        "### What the samplers are worth: relative error falls as N^-slope; times are over those of independent samples"
        "\n\n" + table(head, rows)
    )


def main() -> None:
    """Measure, write, print."""
    parser = arguments_for(__doc__, "samplers")
    parser.add_argument("scenes", nargs="*", help="names of scenes (default: all of scenes/)")
    arguments = parser.parse_args()
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    result = measured(lambda: measure(rounds, arguments.threads, arguments.quick, arguments.scenes))
    publish(result, report(result["samplers"]), arguments.out)


if __name__ == "__main__":
    main()
