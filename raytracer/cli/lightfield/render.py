"""`rt lightfield render`: all views of a camera array, in no more memory than is given."""

import glob
import json
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import check_files, parse_checkpoint_interval, report_faults, resume_command
from raytracer.schema.units import parse_bytes
from raytracer.util.errors import InputError, Interrupted
from raytracer.util.signals import WATCH, defer_interrupt, raise_interrupt

if TYPE_CHECKING:
    from raytracer.lightfield.capturing.capture import Captured
    from raytracer.rendering.progress import Progress

EXAMPLE = """\b
Examples:
  rt lightfield render scenes/lightfield/array.yaml -o array.lf
  rt lightfield render scenes/lightfield/array.yaml -o array.lf --spp 64 --memory 500MB --dtype float16
  rt lightfield render scenes/lightfield/array.yaml -o array.lf --aov depth --stats stats.json
  rt lightfield render scenes/lightfield/array.yaml -o array.lf --spp 4096 --resume
"""


@options.render_options(
    "spp",
    "seed",
    "threads",
    "aovs",
    "denoise",
    "strict",
    "max_memory",
    aovs="What else to record of each view: depth, albedo, ...; see docs/aovs.md.",
    denoise="Take out the noise of each view with Intel Open Image Denoise.",
)
def render(
    context: typer.Context,
    scene: Annotated[str, options.scene_argument("Scene file, of a camera with many views.")],
    *,
    output: Annotated[Path, options.output("FILE.lf", "Light field to write.")],
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    memory: Annotated[
        str,
        takes(
            "SIZE",
            "Memory that pictures may take, besides the scene: 2GB, 500MB.  Where all views take more, they are "
            "rendered in parts.",
        ),
    ] = "2GB",
    size: options.Size = None,
    scale: options.Scale = None,
    given: options.GivenOptions,
    dtype: Annotated[
        str,
        takes(
            "TYPE",
            "Numbers of the radiance in the file: float16, float32 or float64.",
            autocompletion=complete_from("float16", "float32", "float64"),
        ),
    ] = "float32",
    compress: Annotated[
        bool, Option("--compress", help="Compress the file: a fifth smaller, and slower to read.")
    ] = False,
    cluster: Annotated[
        str | None, takes("URL", "Have the samples taken by the workers of this Dask scheduler.")
    ] = None,
    checkpoint: Annotated[
        str | None,
        takes(
            "TIME|off",
            "How often to write all samples so far to files beside the output, FILE.lf.1.checkpoint for the first "
            "part, until the light field is there: 5min.  Default: 60s.",
        ),
    ] = None,
    resume: Annotated[bool, Option("--resume", help="Go on from these files, after an interrupt or a crash.")] = False,
    stats: options.Stats = None,
    quiet: options.Quiet = False,
) -> None:
    """Render all views of a camera array, or the picture behind microlenses, into a light field.

    The file is that of `rt render SCENE -o FILE.lf`, but the memory is bounded: views are rendered some rows at a time,
    and written as they come.  Ctrl-C leaves no light field, but what --resume goes on from.
    """
    interval = parse_checkpoint_interval(checkpoint)
    if resume and interval is None:
        raise InputError("--resume goes on from checkpoints, and with --checkpoint off there are none")
    picture_memory = int(options.parse_value("--memory", memory, parse_bytes))
    _check_format(output, dtype)
    wanted = given.parse()
    spec = options.load_scene(scene, define, allow_files, options.parse_sizing(size, scale))
    check_files([output, *([] if stats is None else [stats])])
    from raytracer.lightfield.capturing.capture import capture
    from raytracer.rendering.checkpoint import SUFFIX
    from raytracer.rendering.progress import SampleBar

    with ExitStack() as stack:
        stack.enter_context(WATCH.on_first_signal(raise_interrupt))
        bar = stack.enter_context(SampleBar(quiet=quiet))
        client = stack.enter_context(options.connect_cluster(cluster))

        def show(progress: "Progress") -> None:
            # From the first sample on there is something to lose.
            if WATCH.handles_first(raise_interrupt):
                stack.enter_context(WATCH.on_first_signal(defer_interrupt))
            WATCH.raise_if_interrupted()
            bar.show(progress)

        def warn(sentence: str) -> None:
            bar.say(f"rt: warning: {sentence}")

        try:
            captured = capture(
                spec,
                output,
                memory=picture_memory,
                dtype=dtype,
                compress=compress,
                progress=show,
                load_seconds=time.perf_counter() - context.obj.began,
                warn=warn,
                cluster=client,
                every=interval,
                resume=resume,
                say=warn,
                **wanted.as_keywords(),
            )
        except KeyboardInterrupt:
            has_samples = any(output.parent.glob(f"{glob.escape(output.name)}.*{SUFFIX}"))
            further = f"; this goes on: {resume_command(context.obj.words)}" if has_samples else ""
            bar.say(f"rt: interrupted; {output} is not written{further}")
            raise Interrupted from None
        bar.close()
        _report(captured, output, stats, quiet=quiet, strict=wanted.strict)


def _check_format(output: Path, dtype: str) -> None:
    """Make sure that the output is a light field, of numbers that it can hold."""
    from raytracer.film.light_field.lf import SUFFIX, TYPES

    if output.suffix.lower() != SUFFIX:
        raise InputError(f"{output}: a light field is written as {SUFFIX}, such as {output.with_suffix(SUFFIX)}")
    if dtype not in TYPES:
        raise InputError(f"--dtype {dtype}: must be {', '.join(TYPES)}")


def _report(captured: "Captured", output: Path, stats: Path | None, *, quiet: bool, strict: bool) -> None:
    """Write the statistics, and say on stderr what was made, and what is wrong with it, which fails if `strict`."""
    from raytracer.film.negative_pixels import describe_negative_pixels
    from raytracer.util.atomic_write import write_bytes

    numbers = captured.stats
    if stats is not None:
        write_bytes(stats, (json.dumps(numbers.json(), indent=2) + "\n").encode())
    if not quiet:
        print(_summarize(captured, output), file=sys.stderr)
    faults = []
    if numbers.nan_samples:
        count = "1 sample was" if numbers.nan_samples == 1 else f"{numbers.nan_samples} samples were"
        fault = f"{count} not finite, and dropped"
        if numbers.first_nan is not None:
            fault += f"; the first one is sample {numbers.first_nan['sample']} of pixel {numbers.first_nan['pixel']}"
        faults.append(fault)
    if numbers.negative_pixels and not numbers.negative["causes"]:
        negative = describe_negative_pixels(numbers.negative_pixels, numbers.negative)
        faults.append(f"{negative}; pixel {numbers.negative['pixel']}")
    report_faults(faults, strict=strict)


def _summarize(captured: "Captured", output: Path) -> str:
    """Return the line about every light field: views, samples, seconds, rates, error and memory."""
    from raytracer.core.error_estimate.intervals import Interval
    from raytracer.film.negative_pixels import describe_negative_pixels
    from raytracer.report.wording import format_percent_interval

    stats, views = captured.stats, captured.views
    seconds = stats.seconds["render"]
    size = f"{views.columns} x {views.rows} views of {views.width} x {views.height}"
    rates = f"{stats.samples / seconds / 1e6:.3g} M samples/s, {stats.rays / seconds / 1e6:.3g} M rays/s"
    parts = [f"{output}: {size}, {stats.spp['most']} spp in {seconds:.2f} s ({rates})"]
    if stats.error:
        interval = Interval(*(stats.error[key] for key in ("relative", "low", "high")))
        parts.append(f"relative error {format_percent_interval(interval)}")
    times = "at once" if captured.bands == 1 else f"in {captured.bands} parts"
    parts.append(f"{times}, in at most {captured.band_bytes / 1e9:.2g} GB besides the scene")
    if stats.negative_pixels and stats.negative["causes"]:
        parts.append(describe_negative_pixels(stats.negative_pixels, stats.negative))
    return ", ".join(parts)
