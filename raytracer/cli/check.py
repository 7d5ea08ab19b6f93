"""`rt check`: tests whether scenes still look like their references."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import print_json, say
from raytracer.util.errors import Interrupted
from raytracer.util.signals import WATCH, raise_interrupt

if TYPE_CHECKING:
    from raytracer.analysis.regression.check import CheckResult

EXAMPLE = """\b
Examples:
  rt check tests/references
  rt check tests/references cover cornell --spp 4096
  rt check tests/references --report check.html --json
"""

_REPORT = Path("outputs") / "check.html"
_SPP = "Samples per pixel.  Default: as many as it takes to find 1 % more or less light, 256 at least."


def check(
    folder: Annotated[Path, Argument(metavar="DIR", help="Folder of references that `rt reference` made.")],
    names: Annotated[list[str] | None, Argument(metavar="NAME", help="Names of references.  Default: all.")] = None,
    spp: Annotated[int | None, options.declare("spp", _SPP)] = None,
    seed: Annotated[
        int | None, options.declare("seed", "Seed of all random numbers.  Default: the one after the reference's.")
    ] = None,
    alpha: Annotated[float, Option(help="How often a scene that has not changed may fail.", min=1e-12, max=0.5)] = 1e-3,
    report: Annotated[
        Path | None,
        takes("FILE.html", f"Page of all verdicts.  Default: {_REPORT.as_posix()}, and only if something fails."),
    ] = None,
    allow_files: options.AllowFiles = None,
    threads: options.Threads = None,
    as_json: options.AsJson = False,
    quiet: Annotated[bool, Option("--quiet", "-q", help="No progress; only failures are printed.")] = False,
) -> None:
    """Render scenes again, with other random numbers, and judge by the noise whether they look as their references do.

    Prints a line a scene.  The exit status is 1 if one has changed, and 2 if one could not be rendered or its reference
    could not be read.
    """
    from raytracer.analysis.regression.check import CheckOptions, check_reference, find_references
    from raytracer.rendering.progress import show_in_batch
    from raytracer.scene.cache import RenderCache
    from raytracer.util.atomic_write import check_file, write_bytes
    from raytracer.util.progress import BatchBar

    paths = find_references(folder, names or [])
    page = report or _REPORT
    check_file(page)

    wanted, cache = CheckOptions(spp, seed, alpha), RenderCache()
    results, is_interrupted = list["CheckResult"](), False
    with BatchBar(quiet=quiet) as bar, WATCH.on_first_signal(raise_interrupt):
        for number, path in enumerate(paths):
            try:
                show = show_in_batch(bar, number, len(paths), path.stem)
                result = check_reference(
                    path, wanted, threads=threads, allow_files=allow_files or [], cache=cache, progress=show
                )
            except KeyboardInterrupt:
                is_interrupted = True
                break
            results.append(result)
            if not as_json and not (quiet and result.passed):
                bar.say(result.sentence(), sys.stdout)

    has_failed = any(not result.passed and not result.error for result in results)
    if as_json:
        print_json([result.json() for result in results])
    if results and (report is not None or has_failed):
        from raytracer.analysis.regression.report import check_page as page_of

        write_bytes(page, page_of(results))
        say(f"{page} shows {'what has failed' if has_failed else 'the pictures'}")
    if is_interrupted:
        say(f"interrupted; {len(paths) - len(results)} of {len(paths)} were not checked")
        raise Interrupted
    if any(result.error for result in results):
        raise typer.Exit(2)
    if has_failed:
        raise typer.Exit(1)
