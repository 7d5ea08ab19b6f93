"""`rt lightfield render`: all views of a camera array, in no more memory than is given."""

import glob
import json
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from raytracer.cli import options
from raytracer.errors import InputError, Interrupted, OutputError
from raytracer.interrupts import WATCH, stop, wait
from raytracer.units import parse_bytes

if TYPE_CHECKING:
    from raytracer.lightfield.bands import Captured
    from raytracer.rendering import Progress

EXAMPLE = """\b
Examples:
  rt lightfield render scenes/lightfield/array.yaml -o array.lf
  rt lightfield render scenes/lightfield/array.yaml -o array.lf --spp 64 --memory 500MB --dtype float16
  rt lightfield render scenes/lightfield/array.yaml -o array.lf --aov depth --stats stats.json
  rt lightfield render scenes/lightfield/array.yaml -o array.lf --spp 4096 --resume
"""


def render(
    context: typer.Context,
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="Scene file, of a camera with many views.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE.lf", help="Light field to write.", show_default=False)
    ],
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    memory: Annotated[
        str,
        typer.Option(
            metavar="SIZE",
            help="Memory that pictures may take, besides the scene: 2GB, 500MB.  Where all views take more, they are "
            "rendered in parts.",
        ),
    ] = "2GB",
    spp: options.Spp = None,
    seed: options.Seed = None,
    threads: options.Threads = None,
    aov: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,...", help="What else to record of each view: depth, albedo, ...; see docs/aovs.md."
        ),
    ] = None,
    denoise: Annotated[
        bool, typer.Option("--denoise", help="Take out the noise of each view with Intel Open Image Denoise.")
    ] = False,
    dtype: Annotated[
        str, typer.Option(metavar="TYPE", help="Numbers of the radiance in the file: float16, float32 or float64.")
    ] = "float32",
    compress: Annotated[
        bool, typer.Option("--compress", help="Compress the file: a fifth smaller, and slower to read.")
    ] = False,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Have the samples taken by the workers of this Dask scheduler."),
    ] = None,
    max_memory: options.MaxMemory = None,
    checkpoint: Annotated[
        str | None,
        typer.Option(
            metavar="TIME|off",
            help="How often to write all samples so far to files beside the output, FILE.lf.1.checkpoint for the first "
            "part, until the light field is there: 5min.  Default: 60s.",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from these files, after an interrupt or a crash.")
    ] = False,
    stats: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write what the render took as JSON.")] = None,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Take warnings for errors, and fail if a sample is not finite, or a pixel below zero without a "
            "reason.",
        ),
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")] = False,
) -> None:
    """Render all views of a camera array, or the picture behind microlenses, into a light field.

    The file is that of `rt render SCENE -o FILE.lf`, but the memory is bounded: views are rendered some rows at a time,
    and written as they come.  Ctrl-C leaves no light field, but what --resume goes on from.
    """
    every = options.checkpoint(checkpoint)
    if resume and every is None:
        raise InputError("--resume goes on from checkpoints, and with --checkpoint off there are none")
    size, most = int(options.number("--memory", memory, parse_bytes)), options.size("--max-memory", max_memory)
    from raytracer.film.output import check_file
    from raytracer.plenoptic.lf import SUFFIX, TYPES

    if output.suffix.lower() != SUFFIX:
        raise InputError(f"{output}: a light field is written as {SUFFIX}, such as {output.with_suffix(SUFFIX)}")
    if dtype not in TYPES:
        raise InputError(f"--dtype {dtype}: must be {', '.join(TYPES)}")
    layers = options.aovs(aov or [], None)
    from raytracer.scene.load import load, parse_overrides

    spec = load(scene, parse_overrides(define or []), allow_files=allow_files or [])
    for path in (output, *([stats] if stats is not None else [])):
        check_file(path)
    from raytracer.checkpoints import SUFFIX as SUFFIX_OF_CHECKPOINTS
    from raytracer.lightfield.bands import capture
    from raytracer.rendering import SampleBar

    with ExitStack() as stack:
        stack.enter_context(WATCH.on_first(stop))
        bar = stack.enter_context(SampleBar(quiet=quiet))
        machines = stack.enter_context(options.machines(cluster))

        def show(progress: "Progress") -> None:
            # From the first sample on there is something to lose.
            if WATCH.is_first(stop):
                stack.enter_context(WATCH.on_first(wait))
            WATCH.heed()
            bar.show(progress)

        def warn(sentence: str) -> None:
            bar.say(f"rt: warning: {sentence}")

        try:
            captured = capture(
                spec,
                output,
                memory=size,
                dtype=dtype,
                compress=compress,
                spp=spp,
                seed=seed,
                threads=threads,
                aovs=layers,
                denoise=denoise,
                progress=show,
                load_seconds=time.perf_counter() - context.obj.began,
                warn=warn,
                strict=strict,
                cluster=machines,
                max_memory=most,
                every=every,
                resume=resume,
                say=warn,
            )
        except KeyboardInterrupt:
            kept = any(output.parent.glob(f"{glob.escape(output.name)}.*{SUFFIX_OF_CHECKPOINTS}"))
            further = f"; this goes on: {options.resuming(context.obj.words)}" if kept else ""
            bar.say(f"rt: interrupted; {output} is not written{further}")
            raise Interrupted from None
        bar.close()
        _report(captured, output, stats, quiet=quiet, strict=strict)


def _report(captured: "Captured", output: Path, stats: Path | None, *, quiet: bool, strict: bool) -> None:
    """Say on stderr what was made; what is wrong with it also when quiet."""
    from raytracer.film.negative import describe_negatives
    from raytracer.film.output import write_bytes
    from raytracer.noise import Interval
    from raytracer.noise.wording import percent_interval

    found, views = captured.stats, captured.views
    if stats is not None:
        write_bytes(stats, (json.dumps(found.json(), indent=2) + "\n").encode())
    if not quiet:
        seconds = found.seconds["render"]
        size = f"{views.columns} x {views.rows} views of {views.width} x {views.height}"
        rates = f"{found.samples / seconds / 1e6:.3g} M samples/s, {found.rays / seconds / 1e6:.3g} M rays/s"
        parts = [f"{output}: {size}, {found.spp['most']} spp in {seconds:.2f} s ({rates})"]
        if found.error:
            interval = Interval(*(found.error[key] for key in ("relative", "low", "high")))
            parts.append(f"relative error {percent_interval(interval)}")
        times = "at once" if captured.bands == 1 else f"in {captured.bands} parts"
        parts.append(f"{times}, in at most {captured.band_bytes / 1e9:.2g} GB besides the scene")
        if found.negative_pixels and found.negative["causes"]:
            parts.append(describe_negatives(found.negative_pixels, found.negative))
        print(", ".join(parts), file=sys.stderr)
    if found.nan_samples:
        count = "1 sample was" if found.nan_samples == 1 else f"{found.nan_samples} samples were"
        sentence = f"{count} not finite, and dropped"
        if found.first_nan is not None:
            sentence += f"; the first one is sample {found.first_nan['sample']} of pixel {found.first_nan['pixel']}"
        if strict:
            raise OutputError(sentence)
        print(f"rt: {sentence}", file=sys.stderr)
    if found.negative_pixels and not found.negative["causes"]:
        sentence = f"{describe_negatives(found.negative_pixels, found.negative)}; pixel {found.negative['pixel']}"
        if strict:
            raise OutputError(sentence)
        print(f"rt: {sentence}", file=sys.stderr)


def register(group: typer.Typer) -> None:
    """Add the command to `group`."""
    group.command(epilog=EXAMPLE)(render)
