"""Measure what a real lens costs against the ideal one, on the cover scene.

    python bench/lenses.py

The cover is seen by the thin lens that is equivalent to the double Gauss of scenes/lenses (the same focal length,
f-number, sensor and focus), and by that lens itself: as it is shipped, whose glasses disperse; with glasses of one
index each; and with the light that its surfaces reflect. The renderers are warm and take turns (warm.py); what is
printed is the median of the ratios to the thin lens within a round, with a bootstrap interval. A second thin lens, "the
same again", shows what the machine's noise alone makes of two equal renders.
Prints Markdown, and writes every figure to outputs/lenses.json.
"""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from typing import Any

from warm import (
    MEGA,
    QUICK_ROUNDS,
    ROUNDS,
    SCENES,
    Renderers,
    arguments_for,
    figures,
    measured,
    our_command,
    publish,
    say,
    table,
    with_interval,
)

from raytracer.core.error_estimate.intervals import ratio_interval

WIDTH, HEIGHT, SPP, QUICK_SPP = 400, 225, 64, 16

LENS = SCENES / "lenses" / "double-gauss-50mm.yaml"

_FILM = "look_from: [13, 2, 3], look_at: [0, 0, 0], sensor: full_frame, f_number: 2, focus_distance: 10"

THIN, AGAIN = "thin lens", "the same again"
DISPERSING = "double Gauss as shipped, dispersing"
ONE_INDEX = "double Gauss, an index for all colours"
FLARE = "double Gauss, dispersing, with flare"

CAMERAS: Mapping[str, str] = {
    THIN: f"{{type: thin_lens, focal_length: 50, {_FILM}}}",
    AGAIN: f"{{type: thin_lens, focal_length: 50, {_FILM}}}",
    ONE_INDEX: f"{{type: lens, lens: {LENS}, dispersion: false, {_FILM}}}",
    DISPERSING: f"{{type: lens, lens: {LENS}, {_FILM}}}",
    FLARE: f"{{type: lens, lens: {LENS}, flare: true, {_FILM}}}",
}


def measure(rounds: int, threads: int, quick: bool) -> dict[str, Any]:
    """Warm renders by all cameras in turn, and their ratios to the thin lens."""
    say("lenses")
    spp = QUICK_SPP if quick else SPP
    with Renderers() as renderers:
        for name, camera in CAMERAS.items():
            size = (SCENES / "cover.yaml", WIDTH, HEIGHT, spp, threads)
            renderers.start(name, [*our_command(*size), "--define", f"camera={camera}"])
        answers = renderers.take_turns(rounds, 1, dict.fromkeys(renderers, spp))
    variants = {
        name: {
            "seconds": figures(answers[name]).tolist(),
            "rays": statistics.median(figures(answers[name], "rays")),
            "time_ratio": ratio_interval(figures(answers[name]), figures(answers[THIN])),
            "noise_ratio": ratio_interval(figures(answers[name], "noise"), figures(answers[THIN], "noise")).value,
        }
        for name in renderers
    }
    about = {"width": WIDTH, "height": HEIGHT, "spp": spp, "threads": threads, "rounds": rounds}
    return {"lenses": {**about, "arms": variants, "failed": renderers.failed}}


def report(found: Mapping[str, Any]) -> str:
    """Write the figures as Markdown."""
    rows = [
        [
            name,
            f"{statistics.median(variant['seconds']):.3f}",
            f"{variant['rays'] / MEGA:.1f}",
            with_interval(variant["time_ratio"]),
            f"{variant['noise_ratio']:.2f}",
        ]
        for name, variant in found["arms"].items()
    ]
    rows += [[name, f"not measured: {reason}", "", "", ""] for name, reason in found["failed"].items()]
    head = ("camera", "seconds", "M rays", "time / the thin lens's", "relMSE / the thin lens's")
    size = f"the cover, {found['width']} x {found['height']}, {found['spp']} spp, {found['threads']} threads"
    return f"### What a real lens costs: {size}\n\n" + table(head, rows)


def main() -> None:
    """Measure, write, print."""
    arguments = arguments_for(__doc__, "lenses").parse_args()
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    result = measured(lambda: measure(rounds, arguments.threads, arguments.quick))
    publish(result, report(result["lenses"]), arguments.out)


if __name__ == "__main__":
    main()
