"""Compare the error of our pictures with that of Mitsuba 3's at equal time, on the scenes of bench/peers/compare.py.

    python bench/equal_time.py --peer .venv-peers/bin/python

1. Trial: Mitsuba renders each scene with each of its samplers that takes any of the sample counts used here, and we
   render it as its file says (Sobol samples). Two of Mitsuba's go on: its default, independent sampling, and that of
   the others with the least relMSE x seconds.
2. Time: against each of the two we get as many samples per pixel as fit in the median time that it took. Both are warm
   and take turns on equally many threads (warm.py); only rendering is timed.
3. Error: relMSE against a reference of the same program with many more samples of other seeds, whose own noise is
   subtracted. Each program has a reference of its own since the two differ a little in what they define, such as how
   far rays leave a surface; how much that is, is printed as well. Both errors have the same weights.

The ratio of errors is that of the means over the rounds, times that of the times (MSE falls as 1/N, so that a per cent
of time more would have bought a per cent of error), with a bootstrap interval over the rounds. Below 1 we are better.
Prints Markdown, and writes every figure to outputs/equal_time.json.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from warm import (
    PEER_PYTHON,
    QUICK_ROUNDS,
    ROUNDS,
    Array,
    Failed,
    Renderers,
    arguments_for,
    figures,
    measured,
    our_command,
    peer_command,
    pictures_of,
    publish,
    say,
    table,
    with_interval,
)

from raytracer.core.error_estimate.intervals import bootstrap_intervals, ratio_interval
from raytracer.core.error_estimate.metric import error_weights

OURS, INDEPENDENT = "rt", "Mitsuba, independent"
BETTER = ("Mitsuba, stratified", "Mitsuba, multijitter", "Mitsuba, ldsampler")
"""Mitsuba's other samplers. (Its orthogonal one takes squares of primes only.)"""

SPP, QUICK_SPP = 256, 16
"""Mitsuba's; squares of powers of two, which all of its samplers take as they are."""

TRIALS = 3
REFERENCE, QUICK_REFERENCE = 12, 4
"""Renders, with as many samples each as those that are timed, in a reference."""

FIRST_SEED, FIRST_OF_TRIAL, FIRST_OF_REFERENCE = 1, 501, 1001


class Reference(NamedTuple):
    """A picture of many renders, and the variance of each of its values; (pixels, 3)."""

    mean: Array
    variance: Array


def cases() -> Sequence[Any]:
    """List the scenes that bench/peers/compare.py compares, each with `scene`, `width` and `height`."""
    from peers.compare import CASES

    return tuple(CASES)


def reference(renderers: Renderers, name: str, spp: int, renders: int) -> Reference:
    """Average renders of other seeds than those that are timed."""
    say(f"  reference of {renders} x {spp} spp")
    answers = renderers.take_turns(renders, FIRST_OF_REFERENCE, {name: spp}, pictures=True)
    pictures = pictures_of(answers[name])
    return Reference(pictures.mean(axis=0), pictures.var(axis=0, ddof=1) / renders)


def trial(renderers: Renderers, spp: int) -> tuple[str, dict[str, int]]:
    """Find the best of Mitsuba's other samplers, and our spp that fit in the time of it and of the default."""
    answers = renderers.take_turns(TRIALS, FIRST_OF_TRIAL, dict.fromkeys(renderers, spp))
    best = min(BETTER, key=lambda name: float(np.median(figures(answers[name], "noise") * figures(answers[name]))))
    times = {name: np.median(figures(answers[name]) / figures(answers[OURS])) for name in (INDEPENDENT, best)}
    return best, {name: max(1, int(spp * time)) for name, time in times.items()}


def error_ratio(sums: Array) -> Array:
    """Compute the ratio of errors at equal time, from sums over rounds.

    sums (n, 4) : our errors, theirs, logarithms of ratios of times, and 1.
    """
    return np.asarray(sums[:, 0] / sums[:, 1] * np.exp(sums[:, 2] / sums[:, 3]))


def play(renderers: Renderers, spp: dict[str, int], rounds: int, references: dict[str, Reference]) -> dict[str, Any]:
    """Render by us and a rival in turn, in about the same time: seconds, errors, and their ratios."""
    (rival,) = set(spp) - {OURS}
    answers = renderers.take_turns(rounds, FIRST_SEED, spp, pictures=True)
    w = error_weights((references[OURS].mean + references[rival].mean) / 2.0)
    relmse, seconds = {}, {}
    for name in spp:
        mean, variance = references[name]
        relmse[name] = np.mean(w * ((pictures_of(answers[name]) - mean) ** 2 - variance), axis=(1, 2))
        seconds[name] = figures(answers[name])
    times = np.log(seconds[OURS] / seconds[rival])
    (ratio,) = bootstrap_intervals(np.stack([relmse[OURS], relmse[rival], times, np.ones(rounds)], axis=1), error_ratio)
    return {
        "rival": rival,
        "spp": spp,
        "seconds": {name: values.tolist() for name, values in seconds.items()},
        "relmse": {name: values.tolist() for name, values in relmse.items()},
        "time_ratio": ratio_interval(seconds[OURS], seconds[rival]),
        "error_ratio": ratio,
    }


def start_all(renderers: Renderers, peer: str, *size: Any) -> None:
    """Start our renderer, and Mitsuba's with each of its samplers.

    Raises
    ------
    Failed : a program did not start.
    """
    renderers.start(OURS, our_command(*size))
    for name in (INDEPENDENT, *BETTER):
        renderers.start(name, peer_command(peer, *size, sampler=name.rpartition(" ")[2]))
    renderers.check()


def measure_case(case: Any, peer: str, rounds: int, threads: int, spp: int, renders: int) -> dict[str, Any]:
    """Measure a scene in both programs.

    Raises
    ------
    Failed : a program did not start, or rendered what is not a number.
    """
    size = (case.scene, case.width, case.height, spp, threads)
    with Renderers() as renderers:
        start_all(renderers, peer, *size)
        best, fitting = trial(renderers, spp)
        for name in set(BETTER) - {best}:
            renderers.pop(name).close()

        theirs = reference(renderers, best, spp, renders)
        ours = reference(renderers, OURS, fitting[best], renders)
        references = {OURS: ours, INDEPENDENT: theirs, best: theirs}
        matches = [play(renderers, {OURS: mine, rival: spp}, rounds, references) for rival, mine in fitting.items()]
        w = error_weights((ours.mean + theirs.mean) / 2.0)
        return {
            "about": {name: worker.about for name, worker in renderers.items()},
            "matches": matches,
            "references_differ": float(np.mean(w * ((ours.mean - theirs.mean) ** 2 - ours.variance - theirs.variance))),
        }


def measure(peer: str, rounds: int, threads: int, quick: bool, scenes: Sequence[str] = ()) -> dict[str, Any]:
    """Measure all scenes that both programs can show, or those named."""
    spp, renders = (QUICK_SPP, QUICK_REFERENCE) if quick else (SPP, REFERENCE)
    items = []
    for case in cases():
        if scenes and case.scene.stem not in scenes:
            continue
        say(f"{case.scene.stem}, {case.width} x {case.height}, against Mitsuba at equal time")
        item = {"scene": case.scene.stem, "width": case.width, "height": case.height, "threads": threads}
        try:
            items.append({**item, **measure_case(case, peer, rounds, threads, spp, renders)})
        except Failed as error:
            items.append({**item, "failed": str(error)})
            say(f"  {error}")
    return {"equal_time": items}


def report(items: Sequence[dict[str, Any]]) -> str:
    """Write the figures as Markdown."""
    rows = []
    for item in items:
        scene = f"{item['scene']}, {item['width']} x {item['height']}"
        if "failed" in item:
            rows.append([scene, f"not compared: {item['failed']}", *[""] * 7])
        for match in item.get("matches", ()):
            rival = match["rival"]
            relmse = {name: statistics.fmean(values) for name, values in match["relmse"].items()}
            rows.append(
                [
                    scene,
                    rival,
                    f"{match['spp'][rival]} / {match['spp'][OURS]}",
                    f"{statistics.median(match['seconds'][rival]):.2f}",
                    with_interval(match["time_ratio"]),
                    f"{relmse[rival]:.2e}",
                    f"{relmse[OURS]:.2e}",
                    with_interval(match["error_ratio"]),
                    f"{math.sqrt(max(item['references_differ'], 0.0)):.2%}",
                ]
            )
    head = (
        "scene",
        "against",
        "spp: theirs / ours",
        "their seconds",
        "our time / theirs",
        "their relMSE",
        "our relMSE",
        "ratio at equal time",
        "programs differ by",
    )
    return "### Error at equal time, against Mitsuba 3\n\n" + table(head, rows)


def main() -> None:
    """Measure, write, print."""
    parser = arguments_for(__doc__, "equal_time")
    parser.add_argument("scenes", nargs="*", help="names of scenes (default: all that are compared)")
    parser.add_argument("--peer", default=str(PEER_PYTHON), help="Python of the environment that has mitsuba")
    arguments = parser.parse_args()
    rounds = arguments.rounds or (QUICK_ROUNDS if arguments.quick else ROUNDS)
    work = (arguments.peer, rounds, arguments.threads, arguments.quick, arguments.scenes)
    result = measured(lambda: measure(*work))
    publish(result, report(result["equal_time"]), arguments.out)


if __name__ == "__main__":
    main()
