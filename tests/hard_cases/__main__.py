"""Measure the hard cases, and print what the naive way gets wrong, what we do, and what that costs: `make hard-cases`.

    python -m tests.hard_cases             all, as thoroughly as `make test-slow`, into docs/hard-cases-table.md
    python -m tests.hard_cases 3 11 --quick --no-times      those alone, with few trials, to the terminal

The exact setting costs the time that a scene takes by it over that by `accuracy: fast`, the median of renders
that take turns.
"""

import argparse
import math
import statistics
import sys
import time
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.markdown import Markdown

from raytracer.analysis.cost.machine import load_average, processor
from raytracer.film.window import Window
from raytracer.rendering.compilation import compile_scene
from raytracer.rendering.tile_renderer import render_tiles
from raytracer.rendering.tile_scheduler import split_into_tiles
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.load import load
from tests.hard_cases.harness import SCENES, HardCase, Measured, cases
from tests.repository import ROOT

PAGE = ROOT / "docs" / "hard-cases-table.md"
BEGIN, END = "<!-- what `make hard-cases` measured -->\n", "<!-- as measured until here -->\n"

LARGE = ("cover", "million")
"""Scenes of scenes/ whose cost is measured too."""

PIXELS = 60_000
SECONDS = 0.3
"""Of one render, by which its samples are chosen."""

ROUNDS = 7
_FIRST_SPP = 4
_WIDTH = 140


class Cost(NamedTuple):
    """How many times as long `exact` takes as `fast`: the median over rounds, and their quartiles."""

    median: float
    low: float
    high: float

    def __str__(self):
        return f"{self.median:.2f} ({self.low:.2f} .. {self.high:.2f})"


class Finding(NamedTuple):
    """What a case measured, or in `error` why it did not; cost, of its scene, or None."""

    case: HardCase
    measured: list[Measured]
    error: str
    seconds: float
    cost: Cost | None

    @property
    def passes(self):
        """Tell if all is within its tolerance, and told apart from the naive way."""
        return bool(self.measured) and all(row.passes and row.tells for row in self.measured)


# ---- Measuring


def measured(case, *, quick):
    """Measure a case."""
    start, rows, error = time.perf_counter(), [], ""
    try:
        rows = case.measure(case.quick if quick else case.thorough)
    except Exception as exception:  # noqa: BLE001  # the others are to be measured all the same
        error = f"{type(exception).__name__}: {exception}".splitlines()[0]
    return Finding(case, rows, error, time.perf_counter() - start, None)


def cost_of(path, rounds, threads):
    """Measure the cost of `exact` over `fast` in a scene, whose picture is made smaller if it is large."""
    film = load(path).film
    factor = min(1.0, math.sqrt(PIXELS / (film.width * film.height)))
    width, height = round(factor * film.width), round(factor * film.height)
    size = {"film.width": width, "film.height": height}
    ready = [compile_scene(load(path, {**size, "render.accuracy": accuracy})) for accuracy in ("exact", "fast")]
    windows = split_into_tiles(Window(0, 0, width, height))

    def seconds(which, spp, seed):
        return render_tiles(ready[which], windows, spp, seed, threads).seconds

    # Warm up, and find out how many samples take as long as wanted.
    seconds(0, _FIRST_SPP, 0)
    spp = max(1, round(_FIRST_SPP * SECONDS / seconds(0, _FIRST_SPP, 0)))
    ratios = []
    for turn in range(rounds):
        took = {which: seconds(which, spp, 1 + turn) for which in (turn % 2, 1 - turn % 2)}
        ratios.append(took[0] / took[1])
    low, _, high = statistics.quantiles(ratios, n=4)
    return Cost(statistics.median(ratios), low, high)


def survey(chosen, *, quick, rounds, threads):
    """Measure cases, and the cost of their scenes if `rounds` is not 0."""
    findings, costs = [], {}
    for case in chosen:
        finding = measured(case, quick=quick)
        if rounds and case.scene is not None and case.scene not in costs:
            costs[case.scene] = cost_of(SCENES / case.scene, rounds, threads)
        findings.append(finding._replace(cost=costs.get(case.scene)))
        word = finding.error or ("passes" if finding.passes else "FAILS")
        print(f"{case.name}: {word}, {finding.seconds:.1f} s", file=sys.stderr, flush=True)
    return findings


# ---- Showing

HEAD = ("case", "what", "naive", "ours", "tolerance", "verdict", "exact / fast")


def figure(value):
    """A number, short."""
    if value == 0.0 or not math.isfinite(value):
        return {0.0: "0", math.inf: "inf"}.get(value, "NaN")
    return f"{value:,.0f}" if value == round(value) and abs(value) < 1e7 else f"{value:.2g}"


def rows_of(finding):
    """The table's rows of a case, one for each thing measured; the first one names it, with its cost."""
    named = f"{finding.case.number}. {finding.case.title}", "" if finding.cost is None else str(finding.cost)
    if finding.error:
        return [(named[0], finding.error, "", "", "", "FAILS", named[1])]
    rows = []
    for row in finding.measured:
        word = "FAILS" if not row.passes else "passes" if row.tells else "FAILS: the naive way passes"
        case, cost = ("", "") if rows else named
        rows.append((case, row.what, *map(figure, (row.naive, row.ours, row.tolerance)), word, cost))
    return rows


def tables(findings, large):
    """What was measured, as Markdown: a sentence and the tables."""

    def line(cells):
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    numbers = {finding.case.number for finding in findings}
    failed = [finding.case.name for finding in findings if not finding.passes]
    verdict = f"; these fail: {', '.join(failed)}" if failed else ": all pass, and the naive way passes none"
    count = sum(len(finding.measured) for finding in findings)
    lines = [
        f"{len(numbers)} cases, {count} measurements{verdict}.",
        "",
        line(HEAD),
        "|---|---|---:|---:|---:|---|---|",
    ]
    lines += [line(row) for finding in findings for row in rows_of(finding)]
    if large:
        lines += ["", "| scene | exact / fast |", "|---|---|"]
        lines += [f"| `scenes/{name}.yaml` | {cost} |" for name, cost in large.items()]
    return "\n".join(lines) + "\n"


def markdown(findings, large, machine):
    """The tables and the rest of what the page tells."""
    lines = ["", f"Measured on {machine}.", "", "Where the cases are known from, and where they are measured:", ""]
    for finding in findings:
        case = finding.case
        module = case.errors.__module__.rpartition(".")[2]
        scene = "" if case.scene is None else f", [scene](../tests/hard_cases/scenes/{case.scene})"
        lines.append(f"- {case.number}: {case.source} ([{module}](../tests/hard_cases/{module}.py){scene})")
    return tables(findings, large) + "\n".join(lines) + "\n"


def write(page, text):
    """Put what was measured into its place in a page.

    Raises
    ------
    ValueError : the page does not say where that is.
    """
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page} has no place for a table, between {BEGIN!r} and {END!r}")
    page.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def main():
    """Measure, print, write; 1 if a case fails."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", nargs="*", type=int, help="cases (default: all)")
    parser.add_argument("--quick", action="store_true", help="with as many trials as `make test` makes")
    parser.add_argument("--no-times", action="store_true", help="without what the exact setting costs")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"of renders that are timed (default: {ROUNDS})")
    parser.add_argument("--threads", type=int, default=available_threads(), help="default: all processors")
    parser.add_argument(
        "--page", type=Path, help="where the table goes as Markdown (default: docs/hard-cases-table.md)"
    )
    arguments = parser.parse_args()
    numbers, threads = arguments.numbers, arguments.threads
    chosen = [case for case in cases() if not numbers or case.number in numbers]
    rounds = 0 if arguments.no_times else arguments.rounds
    loads = [load_average()]
    findings = survey(chosen, quick=arguments.quick, rounds=rounds, threads=threads)
    names = LARGE if rounds and not numbers else ()
    large = {name: cost_of(ROOT / "scenes" / f"{name}.yaml", rounds, threads) for name in names}
    loads.append(load_average())
    console = Console()
    console = console if console.is_terminal else Console(width=_WIDTH)
    console.print(Markdown(tables(findings, large)))
    before, after = ("unknown" if load is None else f"{load:.1f}" for load in loads)
    machine = f"{processor()}, {threads} threads, load average {before} before and {after} after"
    page = arguments.page or (PAGE if not numbers else None)
    if page is not None:
        write(page, markdown(findings, large, machine))
    return 0 if all(finding.passes for finding in findings) else 1


if __name__ == "__main__":
    sys.exit(main())
