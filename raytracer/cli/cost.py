"""`rt cost`: measures what accuracy costs in time, and what each effect adds to it."""

import contextlib
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import join_paths, warn
from raytracer.schema.units import parse_duration, parse_percentage
from raytracer.util.errors import InputError, Interrupted
from raytracer.util.progress import Bar
from raytracer.util.signals import WATCH, raise_interrupt

if TYPE_CHECKING:
    from raytracer.analysis.cost.bench import Progress
    from raytracer.analysis.cost.results import Study

EXAMPLE = """\b
Examples:
  rt cost scenes/cover.yaml
  rt cost scenes/cornell.yaml --target 0.5% --budget 60s -o outputs/cost
  rt cost scenes/cover.yaml --variants defocus,accuracy=fast -D film.width=600 -D film.height=338
  rt cost scenes/cover.yaml --no-variants --json
"""

# Columns of a table that goes into a file.
_WIDTH = 100

_LAYOUT = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}"


def cost(
    scene: options.Scene,
    target: Annotated[str, takes("ERROR", "Relative error to reach: 1%, 0.01.")] = "1%",
    budget: Annotated[str | None, takes("TIME", "What can be had in this time: 60s, 5 min.")] = None,
    output: Annotated[
        Path | None, options.output("DIR", "Folder for a page, a plot, an error map, CSV and JSON.")
    ] = None,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    variants: Annotated[
        str | None,
        takes(
            "NAME,...",
            "Which variants to compare, such as defocus,accuracy=fast.  Default: all.",
            "--variants",
            "--arms",
        ),
    ] = None,
    no_variants: Annotated[bool, Option("--no-variants", "--no-arms", help="Only predict, compare nothing.")] = False,
    rounds: Annotated[int, Option(help="How often each variant is rendered, at least 9 times.")] = 9,
    tiles: Annotated[
        int | None,
        Option(help="How many tiles of 16 x 16 pixels to measure, at least 16 or all.  Default: what a minute allows."),
    ] = None,
    threads: options.Threads = None,
    seed: options.Seed = None,
    as_json: options.AsJson = False,
    quiet: options.Findings = False,
) -> None:
    """Measure what a scene's accuracy costs in time, and what each of its effects and settings does to both.

    Some tiles of the picture are rendered, several times over.  Ctrl-C ends the comparison and reports what there is;
    before the prediction is there, nothing is known.
    """
    start = time.perf_counter()
    error = options.parse_value("--target", target, parse_percentage)
    seconds = None if budget is None else options.parse_value("--budget", budget, parse_duration)
    if no_variants and variants is not None:
        raise InputError("--variants and --no-variants exclude each other")
    names = [] if no_variants else _parse_names(variants)

    # Find out what cannot be written before the work, not after.
    if output is not None:
        from raytracer.analysis.cost.page import check_report

        check_report(output)
    spec = options.load_scene(scene, define, allow_files)
    load_seconds = time.perf_counter() - start

    from raytracer.analysis.cost.study import study
    from raytracer.analysis.cost.study_options import StudyOptions

    with contextlib.closing(_Bars(quiet)) as bar, WATCH.on_first_signal(raise_interrupt):
        try:
            wanted = StudyOptions(error, seconds, rounds, names, tiles, threads, seed)
            result = study(spec, wanted, progress=bar.update, name=scene, load_seconds=load_seconds, warn=warn)
        except KeyboardInterrupt:
            bar.close()
            print("nothing is known before the prediction is there", file=sys.stderr)
            raise
    _show(result, as_json)
    if output is not None:
        from raytracer.analysis.cost.page import write_report

        paths = write_report(result, output)
        if not quiet:
            print(f"wrote {join_paths(paths)}", file=sys.stderr)
    if result.interrupted:
        raise Interrupted


def _parse_names(text: str | None) -> list[str] | None:
    if text is None:
        return None
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise InputError(f"--variants {text}: a name is empty; --no-variants compares nothing")
    return names


def _show(result: "Study", as_json: bool) -> None:
    """Print the study."""
    if as_json:
        from raytracer.analysis.cost.export import json_text

        print(json_text(result), end="")
    else:
        import shutil

        from raytracer.analysis.cost.text import study_text
        from raytracer.util.terminal import has_color

        on_terminal = sys.stdout.isatty()
        width = shutil.get_terminal_size((_WIDTH, 24)).columns if on_terminal else _WIDTH
        print(study_text(result, width=width, colour=has_color(sys.stdout)), end="")


class _Bars:
    """A progress bar for each phase of the study."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet
        self._phase = ""
        self._bar: Bar | None = None

    def update(self, progress: "Progress") -> None:
        """Show how far the phase is."""
        if self._bar is None or progress.phase != self._phase:
            self.close()
            self._phase = progress.phase
            self._bar = Bar(quiet=self._quiet, desc=progress.phase, bar_format=_LAYOUT)
        self._bar.update(progress.fraction, 1.0)

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()
