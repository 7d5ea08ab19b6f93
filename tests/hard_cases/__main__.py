"""Measure the hard cases, and print what the naive way gets wrong, what we do, and what that costs: `make hard-cases`.

    python -m tests.hard_cases             all, with as many trials as `make test-slow` makes, into docs/hard-cases.md
    python -m tests.hard_cases 3 11 --quick --no-times      those alone, with few trials, to the terminal

The exact setting costs the time that a scene takes by it over that by `accuracy: fast`, the median of renders
that take turns.
"""

import argparse
import math
import statistics
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from raytracer.analysis.cost.machine import load_average, processor
from raytracer.film.window import Window
from raytracer.rendering.compilation import CompiledScene, compile_scene
from raytracer.rendering.tile_renderer import render_tiles
from raytracer.rendering.tile_scheduler import split_into_tiles
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.load import load
from tests.hard_cases.harness import SCENES, HardCase, Measured, cases

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "hard-cases.md"
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

    def __str__(self) -> str:
        return f"{self.median:.2f} ({self.low:.2f} .. {self.high:.2f})"


class Finding(NamedTuple):
    """What a case measured, or in `error` why it did not; cost, of its scene, or None."""

    case: HardCase
    measured: Sequence[Measured]
    error: str
    seconds: float
    cost: Cost | None

    @property
    def passes(self) -> bool:
        """Tell if all is within its tolerance, and told apart from the naive way."""
        return bool(self.measured) and all(row.passes and row.tells for row in self.measured)


def say(text: str) -> None:
    """Tell how far the work is."""
    print(text, file=sys.stderr, flush=True)


# ---- Measuring


def measured(case: HardCase, *, quick: bool) -> Finding:
    """Measure a case."""
    start = time.perf_counter()
    rows: Sequence[Measured] = ()
    error = ""
    try:
        rows = list(case.measure(case.quick if quick else case.thorough))
    except Exception as exception:  # noqa: BLE001  # the others are to be measured all the same
        error = f"{type(exception).__name__}: {exception}".splitlines()[0]
    return Finding(case, rows, error, time.perf_counter() - start, None)


def _windows(prepared: CompiledScene) -> list[Window]:
    film = prepared.spec.film
    return split_into_tiles(Window(0, 0, film.width, film.height))


def cost_of(path: Path, rounds: int, threads: int) -> Cost:
    """Measure the cost of `exact` over `fast` in a scene, whose picture is made smaller if it is large."""
    film = load(path).film
    factor = min(1.0, math.sqrt(PIXELS / (film.width * film.height)))
    size = {"film.width": round(factor * film.width), "film.height": round(factor * film.height)}
    ready = [compile_scene(load(path, {**size, "render.accuracy": accuracy})) for accuracy in ("exact", "fast")]
    windows = _windows(ready[0])

    def seconds(prepared: CompiledScene, spp: int, seed: int) -> float:
        return render_tiles(prepared, windows, spp, seed, threads).seconds

    # Warm up, and find out how many samples take as long as wanted.
    seconds(ready[0], _FIRST_SPP, 0)
    spp = max(1, round(_FIRST_SPP * SECONDS / seconds(ready[0], _FIRST_SPP, 0)))
    ratios = []
    for turn in range(rounds):
        order = (0, 1) if turn % 2 == 0 else (1, 0)
        took = {which: seconds(ready[which], spp, 1 + turn) for which in order}
        ratios.append(took[0] / took[1])
    low, _, high = statistics.quantiles(ratios, n=4)
    return Cost(statistics.median(ratios), low, high)


def survey(chosen: Sequence[HardCase], *, quick: bool, rounds: int, threads: int) -> list[Finding]:
    """Measure cases, and the cost of their scenes if `rounds` is not 0."""
    findings, costs = [], dict[str, Cost]()
    for case in chosen:
        finding = measured(case, quick=quick)
        if rounds and case.scene is not None and case.scene not in costs:
            costs[case.scene] = cost_of(SCENES / case.scene, rounds, threads)
        finding = finding._replace(cost=costs.get(case.scene or ""))
        say(f"{case.name}: {verdict_of(finding)}, {finding.seconds:.1f} s")
        findings.append(finding)
    return findings


# ---- Showing

HEAD = ("case", "what", "naive", "ours", "tolerance", "verdict", "exact / fast")


def figure(value: float) -> str:
    """A number, short."""
    if value == 0.0 or not math.isfinite(value):
        return {0.0: "0", math.inf: "inf"}.get(value, "NaN")
    return f"{value:,.0f}" if value == round(value) and abs(value) < 1e7 else f"{value:.2g}"


def verdict_of(finding: Finding) -> str:
    """One word, or why there is none."""
    if finding.error:
        return finding.error
    return "passes" if finding.passes else "FAILS"


def _word(row: Measured) -> str:
    if not row.passes:
        return "FAILS"
    return "passes" if row.tells else "FAILS: the naive way passes"


def rows_of(findings: Iterable[Finding]) -> list[tuple[str, ...]]:
    """The table, with a row for each thing measured; a case is named in its first one."""
    rows = []
    for finding in findings:
        case = f"{finding.case.number}. {finding.case.title}"
        cost = "" if finding.cost is None else str(finding.cost)
        if finding.error:
            rows.append((case, finding.error, "", "", "", "FAILS", cost))
        for row in finding.measured:
            numbers = tuple(figure(value) for value in (row.naive, row.ours, row.tolerance))
            rows.append((case, row.what, *numbers, _word(row), cost))
            case, cost = "", ""
    return rows


def printed(findings: Sequence[Finding], large: dict[str, Cost]) -> None:
    """Show the table in the terminal, with each case's title above what it measured."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDTH)
    table = Table("", *HEAD[1:], title="Hard cases", title_justify="left", box=SIMPLE_HEAD)
    for column in table.columns[2:5]:
        column.justify = "right"
    for finding in findings:
        rows = rows_of([finding])
        table.add_row(str(finding.case.number), Text(finding.case.title, "bold"), "", "", "", "", rows[0][-1])
        for row in rows:
            style = "red" if row[5] != "passes" else None
            table.add_row("", Text(row[1]), *row[2:6], "", style=style)
    console.print(table)
    console.print(summary(findings))
    for name, cost in large.items():
        console.print(f"{name}: exact takes {cost} times as long as fast")


def summary(findings: Sequence[Finding]) -> str:
    """One sentence."""
    numbers = {finding.case.number for finding in findings}
    failed = [finding.case.name for finding in findings if not finding.passes]
    count = sum(len(finding.measured) for finding in findings)
    if failed:
        return f"{len(numbers)} cases, {count} measurements; these fail: {', '.join(failed)}."
    return f"{len(numbers)} cases, {count} measurements: all pass, and the naive way passes none."


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def markdown(findings: Sequence[Finding], large: dict[str, Cost], machine: str) -> str:
    """The table and the rest of what was measured."""
    lines = [summary(findings), ""]
    lines += ["| " + " | ".join(HEAD) + " |", "|---|---|---:|---:|---:|---|---|"]
    lines += ["| " + " | ".join(map(_cell, row)) + " |" for row in rows_of(findings)]
    if large:
        lines += ["", "| scene | exact / fast |", "|---|---|"]
        lines += [f"| `scenes/{name}.yaml` | {cost} |" for name, cost in large.items()]
    lines += ["", f"Measured on {machine}.", "", "Where the cases are known from, and where they are measured:", ""]
    for finding in findings:
        case = finding.case
        module = case.measure.__module__.rpartition(".")[2]
        scene = "" if case.scene is None else f", [scene](../tests/hard_cases/scenes/{case.scene})"
        lines.append(f"- {case.number}: {case.source} ([{module}](../tests/hard_cases/{module}.py){scene})")
    return "\n".join(lines) + "\n"


def write(page: Path, text: str) -> None:
    """Put what was measured into its place in a page.

    Raises
    ------
    ValueError : the page does not say where that is.
    """
    whole = page.read_text(encoding="utf-8")
    before, begin, rest = whole.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page} has no place for a table, between {BEGIN!r} and {END!r}")
    page.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def main() -> int:
    """Measure, print, write; 1 if a case fails."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", nargs="*", type=int, help="cases (default: all)")
    parser.add_argument("--quick", action="store_true", help="with as many trials as `make test` makes")
    parser.add_argument("--no-times", action="store_true", help="without what the exact setting costs")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"of renders that are timed (default: {ROUNDS})")
    parser.add_argument("--threads", type=int, default=available_threads(), help="default: all processors")
    parser.add_argument("--page", type=Path, help="where the table goes as Markdown (default: docs/hard-cases.md)")
    arguments = parser.parse_args()
    chosen = [case for case in cases() if not arguments.numbers or case.number in arguments.numbers]
    rounds = 0 if arguments.no_times else arguments.rounds
    loads = [load_average()]
    findings = survey(chosen, quick=arguments.quick, rounds=rounds, threads=arguments.threads)
    large = {}
    if rounds and not arguments.numbers:
        large = {name: cost_of(ROOT / "scenes" / f"{name}.yaml", rounds, arguments.threads) for name in LARGE}
    loads.append(load_average())
    printed(findings, large)
    before, after = ("unknown" if load is None else f"{load:.1f}" for load in loads)
    machine = f"{processor()}, {arguments.threads} threads, load average {before} before and {after} after"
    page = arguments.page or (PAGE if not arguments.numbers else None)
    if page is not None:
        write(page, markdown(findings, large, machine))
    return 0 if all(finding.passes for finding in findings) else 1


if __name__ == "__main__":
    sys.exit(main())
