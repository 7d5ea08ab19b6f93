"""Plot error against time, for each scene that Mitsuba 3 can show too: ours, and Mitsuba's with all of its samplers.

    python bench/convergence.py --peer .venv-peers/bin/python

Renderers are warm and take turns, from 4 to 256 samples per pixel; only rendering is timed.  The error is relMSE
against a reference of the same program with many more samples of other seeds, as in equal_time.py.  Writes the plot as
SVG and as PNG, and every figure as JSON.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from equal_time import (
    BETTER,
    FIRST_OF_REFERENCE,
    FIRST_SEED,
    INDEPENDENT,
    OURS,
    QUICK_SPP,
    SPP,
    cases,
    start_all,
)
from warm import (
    OUTPUTS,
    PEER_PYTHON,
    Failed,
    Renderers,
    arguments_for,
    figures,
    measured,
    pictures_of,
    publish,
    say,
    table,
)

from raytracer.core.error_estimate.metric import error_weights

REFERENCES, QUICK_REFERENCES = 8, 4
"""Renders, with as many samples each as the longest that is timed, in a reference."""

ROUNDS, QUICK_ROUNDS = 3, 2
STEP = 4
"""Factor from one number of samples to the next; squares of powers of two, which all of Mitsuba's samplers take."""

COLORS = ("#c8102e", "#9aa5b1", "#4c78a8", "#2a9d8f", "#8e6c8a")


def measure_case(case: Any, peer: str, rounds: int, threads: int, most: int, renders: int) -> dict[str, Any]:
    """Measure a scene: by renderer, rows of spp, seconds and relMSE.

    Raises
    ------
    Failed : a program did not start, or rendered what is not a number.
    """
    size = (case.scene, case.width, case.height, most, threads)
    with Renderers() as renderers:
        start_all(renderers, peer, *size)
        references = {
            name: pictures_of(renderers.take_turns(renders, FIRST_OF_REFERENCE, {name: most}, pictures=True)[name])
            for name in (OURS, BETTER[1])
        }
        means = {name: pictures.mean(axis=0) for name, pictures in references.items()}
        noise = {name: pictures.var(axis=0, ddof=1) / renders for name, pictures in references.items()}
        weights = error_weights(sum(means.values()) / len(means))
        curves: dict[str, list[dict[str, float]]] = {name: [] for name in renderers}
        spp = STEP
        while spp <= most:
            answers = renderers.take_turns(rounds, FIRST_SEED, dict.fromkeys(renderers, spp), pictures=True)
            for name in renderers:
                of = OURS if name == OURS else BETTER[1]
                error = np.mean(weights * ((pictures_of(answers[name]) - means[of]) ** 2 - noise[of]))
                seconds = float(np.median(figures(answers[name])))
                curves[name].append({"spp": spp, "seconds": seconds, "relmse": float(error)})
            spp *= STEP
    return curves


def measure(peer: str, rounds: int | None, threads: int, quick: bool, scenes: Sequence[str] = ()) -> dict[str, Any]:
    """Measure all scenes that both programs can show, or those named."""
    most, renders = (QUICK_SPP, QUICK_REFERENCES) if quick else (SPP, REFERENCES)
    rounds = rounds or (QUICK_ROUNDS if quick else ROUNDS)
    items = []
    for case in cases():
        if scenes and case.scene.stem not in scenes:
            continue
        say(f"{case.scene.stem}, {case.width} x {case.height}, error against time")
        try:
            curves = measure_case(case, peer, rounds, threads, most, renders)
            items.append({"scene": case.scene.stem, "curves": curves})
        except Failed as error:
            items.append({"scene": case.scene.stem, "failed": str(error)})
            say(f"  {error}")
    return {"convergence": items}


def plot(items: Sequence[dict[str, Any]], stem: Path) -> None:
    """Draw the error of each renderer against its time, a panel a scene, as `stem`.svg and `stem`.png."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = [item for item in items if "curves" in item]
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(3.4 * columns, 2.7 * rows + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    for number, item in enumerate(shown):
        axes = figure.add_subplot(rows, columns, number + 1)
        for (name, points), color in zip(item["curves"].items(), COLORS, strict=True):
            seconds, errors = ([point[key] for point in points] for key in ("seconds", "relmse"))
            width, order = (2.2, 3) if name == OURS else (1.2, 2)
            axes.loglog(seconds, errors, "o-", color=color, label=name, markersize=3.5, linewidth=width, zorder=order)
        # Of stratified samples in fog some are of another order of magnitude; all others would be a line.
        axes.set_ylim(top=3.0 * statistics.median(points[0]["relmse"] for points in item["curves"].values()))
        axes.set_title(item["scene"], fontsize=10)
        axes.tick_params(labelsize=8)
        axes.grid(visible=True, which="major", linewidth=0.4, alpha=0.6)
        if number % columns == 0:
            axes.set_ylabel("relMSE", fontsize=9)
        if number >= len(shown) - columns:
            axes.set_xlabel("seconds of rendering", fontsize=9)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    for suffix in (".svg", ".png"):
        figure.savefig(stem.with_suffix(suffix), dpi=110)


def report(items: Sequence[dict[str, Any]]) -> str:
    """Write the figures of the most samples as Markdown: seconds times relMSE, which more samples leave as it is."""
    rows = []
    for item in items:
        if "failed" in item:
            rows.append([item["scene"], item["failed"], *[""] * len(BETTER)])
            continue
        ends = {name: points[-1]["seconds"] * points[-1]["relmse"] for name, points in item["curves"].items()}
        rows.append([item["scene"], *(f"{value:.2e}" for value in ends.values())])
    head = ("scene", OURS, INDEPENDENT, *BETTER)
    return "### Error against time: seconds x relMSE at the most samples\n\n" + table(head, rows)


def main() -> None:
    """Measure, write, plot, print."""
    parser = arguments_for(__doc__, "convergence")
    parser.add_argument("scenes", nargs="*", help="names of scenes (default: all that are compared)")
    parser.add_argument("--peer", default=str(PEER_PYTHON), help="Python of the environment that has mitsuba")
    arguments = parser.parse_args()
    work = (arguments.peer, arguments.rounds, arguments.threads, arguments.quick, arguments.scenes)
    result = measured(lambda: measure(*work))
    OUTPUTS.mkdir(parents=True, exist_ok=True)
    plot(result["convergence"], arguments.out.with_suffix(""))
    publish(result, report(result["convergence"]), arguments.out)


if __name__ == "__main__":
    main()
