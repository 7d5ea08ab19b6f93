"""`rt sweep`: a scene with every combination of some values, as pictures, numbers and a page to slide through."""

import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import print_json, say
from raytracer.rendering.options import OPTIONS
from raytracer.report.wording import count
from raytracer.util.errors import InputError, Interrupted, OutputError
from raytracer.util.signals import WATCH, raise_interrupt

if TYPE_CHECKING:
    from raytracer.analysis.sweep.results import PointResult, Sweep

EXAMPLE = """\b
Examples:
  rt sweep scenes/cover.yaml -D camera.defocus_angle=0,0.6,2 -D camera.focus_distance=5:15:5 --preview
  rt sweep portrait.yaml -D camera.f_number=1.4..22 -D camera.focus_on=eye,ear,wall
  rt sweep portrait.yaml -D camera.f_number=1.4..22/3 --noise 2% --animate webp
  rt sweep night.yaml -D camera.shutter=1/1000..1/30 -D camera.iso=3200..100 --zip
  rt sweep sweep.yaml -o outputs/lesson --format exr

\b
Values of a key (docs/sweeps.md):
  1.4,2,2.8        a list; of anything: ball,cube or [1,0,0],[0,1,0] or 1/125 s,1/60 s
  2:10:5           5 numbers from 2 to 10, equally far apart;  1:100:5:log by equal ratios
  1.4..22          full stops; halves 1.4..22/2, thirds 1.4..22/3

Run it again to go on: points that are done are kept.
"""


@options.render_options(
    *OPTIONS,
    noise="Stop each point when its relative error is down to this: 1%, 0.01.",
    time_limit="Time for each point, from its first sample to its picture: 30s.",
    aovs="What else to record, as layers of .exr files; see docs/aovs.md.",
    denoise="Take out the noise with Intel Open Image Denoise.",
    strict="Take warnings for errors: such a point fails.",
)
def sweep(
    scene: Annotated[str, options.scene_argument("Scene file, or file of a sweep (docs/sweeps.md).")],
    *,
    define: Annotated[
        list[str] | None,
        takes(
            "KEY=VALUES",
            "Values of a key of the scene, see below; a single one is the same for all points.  May repeat: all "
            "combinations are rendered.",
            "--define",
            "-D",
        ),
    ] = None,
    allow_files: options.AllowFiles = None,
    zipped: Annotated[
        bool, Option("--zip", help="Take the values of all keys in pairs, in place of all combinations.")
    ] = False,
    output: Annotated[
        Path | None,
        options.output("FOLDER", "Where images, manifest, contact sheet and page go.  Default: outputs/<scene>_sweep"),
    ] = None,
    formats: Annotated[str, takes("SUFFIX,...", "Images of each point: png, jpg, exr, hdr, npy.", "--format")] = "png",
    animate: Annotated[
        list[str] | None, takes("SUFFIX,...", "Write an animation of all points too: gif, webp, png.  May repeat.")
    ] = None,
    fps: Annotated[float, Option(help="Frames a second of the animation.")] = 5.0,
    given: options.GivenOptions,
    preview: options.Preview = False,
    max_points: Annotated[int, Option(help="Points that a sweep may have.", min=1)] = 1000,
    cluster: Annotated[
        str | None, takes("URL", "Dask scheduler whose workers render: tcp://host:8786; see docs/cluster.md.")
    ] = None,
    dry_run: Annotated[
        bool, Option("--dry-run", help="Print the points and their exact values, and render nothing.")
    ] = False,
    as_json: Annotated[bool, Option("--json", help="Print the manifest as JSON.")] = False,
    quiet: options.Quiet = False,
) -> None:
    """Render a scene with every combination of some values.

    Writes an image for each, manifest.csv and .json, a contact sheet, and index.html, a page to slide through.  Ctrl-C
    ends it early, and the same command goes on where it was.
    """
    if dry_run:
        _print_dry_run(scene, define or [], zipped=zipped, max_points=max_points, allow_files=allow_files or [])
        return
    from raytracer.analysis.sweep.output_layout import normalize_formats, stale_images
    from raytracer.analysis.sweep.plan import parse_definitions
    from raytracer.analysis.sweep.run import sweep as run
    from raytracer.util.progress import BatchBar

    suffixes = normalize_formats(formats.split(","))
    wanted = given.parse([f".{suffix}" for suffix in suffixes], "--format exr")
    stem = Path(scene).stem
    folder = output or Path("outputs") / (stem if stem.endswith("sweep") else f"{stem}_sweep")
    with ExitStack() as stack:
        bar = stack.enter_context(BatchBar())
        stack.enter_context(WATCH.on_first_signal(raise_interrupt))
        result = run(
            scene,
            parse_definitions(define or []),
            folder=folder,
            allow_files=allow_files or [],
            zipped=zipped,
            preview=preview,
            formats=suffixes,
            animate=[suffix.strip() for text in animate or [] for suffix in text.split(",")],
            fps=fps,
            max_points=max_points,
            cluster=stack.enter_context(options.connect_cluster(cluster, bar.say)),
            progress=None if quiet else bar,
            report=lambda point: _report(point, bar.say),
            warn=lambda sentence: bar.say(f"rt: warning: {sentence}"),
            **wanted.as_keywords(),
        )
    if as_json:
        from raytracer.analysis.sweep.manifest import to_json

        print_json(to_json(result), ensure_ascii=False)
    _conclude(result, folder, stale_images(result), quiet=quiet)


def _print_dry_run(scene: str, define: list[str], *, zipped: bool, max_points: int, allow_files: list[str]) -> None:
    """Print a line for each point, and fail if one of them could not be rendered."""
    from raytracer.analysis.sweep.plan import enumerate_points, make_plan, parse_definitions
    from raytracer.scene.overrides import as_yaml

    plan = make_plan(scene, parse_definitions(define), zipped=zipped, allow_files=allow_files)
    points = enumerate_points(plan.axes, zipped=plan.zipped, most=max_points)
    wrong = 0
    for point in points:
        print("  ".join([point.name, *(f"{key}={as_yaml(value)}" for key, value in point.values.items())]))
        try:
            plan.spec.replace(point.values)
        except InputError as error:
            wrong += 1
            say(f"{point.name} would fail: {error}")
    if wrong:
        raise OutputError(f"{wrong} of {count(len(points), 'point')} would fail")


def _report(result: "PointResult", say: Callable[[str], object]) -> None:
    """Warn of what is wrong with a point."""
    name = result.point.name
    if result.status == "failed":
        say(f"rt: {name} failed: {result.reason}")
    elif not result.complete:
        say(f"rt: {name} has {result.samples:.4g} samples per pixel, fewer than were asked for")
    if result.nan_samples:
        say(f"rt: {name}: {result.nan_samples} samples were not finite and were dropped")


def _conclude(result: "Sweep", folder: Path, others: list[str], *, quiet: bool) -> None:
    """Summarize the sweep on stderr, and fail if a point has failed."""
    points = count(len(result.results), "point")
    done, failed = (sum(point.status == status for point in result.results) for status in ("done", "failed"))
    if result.interrupted:
        say(f"interrupted; {done} of {points} done; the same command goes on")
        raise Interrupted
    if not quiet:
        reused = f", {result.reused} of them before" if result.reused else ""
        names = (", " if result.zipped else " x ").join(f"{len(axis.values)} {axis.key}" for axis in result.axes)
        print(f"{folder / 'index.html'}: {count(done, 'picture')} ({names}){reused}", file=sys.stderr)
    if others and not quiet:
        note = f"{folder} also holds {count(len(others), 'image')} that this sweep did not make, such as {others[0]}"
        say(f"{note}; -o names another folder")
    if failed:
        raise OutputError(f"{failed} of {points} failed; {folder / 'manifest.csv'} says why")
