"""`rt render`: from a scene file to images."""

import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer
from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import (
    ResumeInfo,
    check_files,
    dry_run_save,
    find_checkpoint_path,
    parse_checkpoint_interval,
    print_json,
    save_picture_so_far,
    say,
    write_outputs,
)
from raytracer.cli.base.render_report import DebugCommand, RenderReport, describe_delay
from raytracer.cli.base.viewer import connect_viewer, parse_viewer
from raytracer.rendering.options import OPTIONS, RenderOptions
from raytracer.scene.preview import SPP, preview_scene
from raytracer.util.errors import InputError, Interrupted
from raytracer.util.signals import WATCH, defer_interrupt, on_hangup

if TYPE_CHECKING:
    from raytracer.rendering.checkpoint import CheckpointWriter
    from raytracer.rendering.progress import Progress, SampleBar
    from raytracer.rendering.session import Rendered
    from raytracer.rendering.tev.viewer import Address
    from raytracer.scene.spec import SceneSpec

EXAMPLE = """\b
Examples:
  rt render scenes/cover.yaml
  rt render scenes/cover.yaml -o cover.png -o cover.exr --spp 1000
  rt render scenes/cover.yaml -D camera.defocus_angle=2 --preview
  rt render scenes/cornell.yaml --noise 2% -o cornell.exr --aov samples
  rt render scenes/cornell.yaml --crop 200,200,400,400 --time-limit 30s --stats stats.json
  rt render scenes/cornell.yaml -o cornell.exr --aov depth,normal,albedo --denoise
  rt render scenes/cornell.yaml --pixel 212,140 --sample 3 --debug
  rt render scenes/cover.yaml --spp 4096 --cluster tcp://head:8786
  rt render scenes/cover.yaml --spp 4096 --checkpoint 5min
  rt render scenes/cover.yaml --spp 4096 --resume
  rt render scenes/cover.yaml --spp 1024 --tev
"""

# What the interpreter takes to end.
_EXIT_SECONDS = 0.05


@options.render_options(*OPTIONS)
def render(
    context: typer.Context,
    scene: options.Scene,
    *,
    output: Annotated[
        list[Path] | None,
        options.output(
            "FILE",
            "Image to write, .png .jpg for display, .exr .hdr .npy linear; .lf holds a light field; may repeat.  "
            "Default: outputs/<scene>.png",
        ),
    ] = None,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    given: options.GivenOptions,
    preview: options.Preview = False,
    cluster: Annotated[
        str | None,
        takes(
            "URL",
            "Have the samples taken by the workers of this Dask scheduler, tcp://host:8786 "
            "(pip install 'raytracer[cluster]').  The picture is bit-identical to one rendered here, if their "
            "instruction sets are alike; see docs/cluster.md.",
        ),
    ] = None,
    checkpoint: Annotated[
        str | None,
        takes(
            "TIME|off",
            "How often to write all samples so far to a file beside the first output, FILE.checkpoint, from which "
            "--resume goes on: 30s, 5min.  If given, it is kept after the render, too.  Default: 60s, and kept "
            "after renders that take longer.",
        ),
    ] = None,
    resume: Annotated[
        bool,
        Option(
            "--resume",
            help="Go on from the samples in FILE.checkpoint: after an interrupt, a crash, or with a larger --spp.  The "
            "picture is bit-identical to that of an uninterrupted render.",
        ),
    ] = False,
    stats: options.Stats = None,
    tev: Annotated[
        str | None,
        takes(
            "[HOST:PORT]",
            "Show the picture in the viewer tev while it is rendered, as it is in linear files.  Default: tev's own "
            "address, 127.0.0.1:14158.  The render does not wait for a viewer; see docs/tev.md.",
        ),
    ] = None,
    pixel: Annotated[str | None, takes("X,Y", "With --debug: the pixel, from 0,0 in the top left corner.")] = None,
    sample: Annotated[
        int | None,
        Option(
            help="With --debug: the sample of the pixel, from 0.  Default: the first that is not finite, or else the "
            "brightest.",
            min=0,
            max=2**31 - 1,
        ),
    ] = None,
    debug: Annotated[
        bool,
        Option(
            "--debug",
            help="Write no picture: print the path of one sample, vertex by vertex, as it is in the picture that these "
            "options make.",
        ),
    ] = False,
    as_json: Annotated[bool, Option("--json", help="With --debug: print JSON.")] = False,
    quiet: options.Quiet = False,
) -> None:
    """Render a scene.

    Ctrl-C or SIGTERM ends the render early and writes the picture so far, and what --resume goes on from; a second one
    ends it at once.  SIGHUP writes the picture so far, and the render goes on.
    """
    position = None if pixel is None else _parse_pixel(pixel)
    if debug and position is None:
        raise InputError("--debug needs --pixel X,Y, the pixel whose path it is to print")
    for name, is_given in (("--pixel", pixel is not None), ("--sample", sample is not None), ("--json", as_json)):
        if is_given and not debug:
            raise InputError(f"{name} needs --debug, which prints the path of one sample")
    if debug and (resume or checkpoint is not None):
        raise InputError(f"--{'resume' if resume else 'checkpoint'} is for pictures, and --debug makes none")
    if debug and tev is not None:
        raise InputError("--tev is for pictures, and --debug makes none")
    outputs = output or [Path("outputs") / f"{Path(scene).stem}.png"]
    request = _Request(
        outputs=outputs,
        stats=stats,
        options=given.parse([path.suffix for path in outputs], "-o NAME.exr"),
        cluster=cluster,
        checkpoint=parse_checkpoint_interval(checkpoint),
        keeps_checkpoint=checkpoint is not None,
        resume=resume,
        quiet=quiet,
        tev=parse_viewer(tev),
    )
    if resume and request.checkpoint is None:
        raise InputError("--resume goes on from a checkpoint, and with --checkpoint off there is none")

    spec = options.load_scene(scene, define, allow_files)
    if not debug:
        _check_outputs(request, spec)
    if preview:
        spec = preview_scene(spec)
        if request.options.noise is None:
            spp = min(request.options.spp or spec.render.spp, SPP)
            request = request._replace(options=replace(request.options, spp=spp))
    if position is not None:
        _print_path(spec, position, sample, request.options, as_json=as_json)
        return
    command = DebugCommand(scene, define or [], preview, given)
    rendered = _render(request, spec, context.obj, command)
    seconds = time.perf_counter() - context.obj.began
    is_interrupted = rendered.interrupted or WATCH.signal_number is not None
    if (limit := request.options.time_limit) is not None and not is_interrupted and seconds > 1.05 * limit:
        say(describe_delay(rendered, limit, seconds))
    if is_interrupted:
        raise Interrupted


def _parse_pixel(text: str) -> tuple[int, int]:
    try:
        x, y = map(int, text.split(","))
    except ValueError:
        raise InputError(f"--pixel {text}: must be two integers, X,Y") from None
    return x, y


def _print_path(
    spec: "SceneSpec", pixel: tuple[int, int], sample: int | None, options: RenderOptions, *, as_json: bool
) -> None:
    """Print the path of one sample; see `path_debug.trace_sample`."""
    from raytracer.rendering.path_debug import trace_sample
    from raytracer.rendering.path_text import format_path

    path = trace_sample(spec, pixel, sample, options)
    if as_json:
        print_json(path.json())
    else:
        print(format_path(path), end="")


class _Request(NamedTuple):
    """The options of a render, parsed.

    outputs, stats : files to write.
    options : of the picture; its time limit is from the start of the command to its written files.
    cluster : address of its scheduler.
    checkpoint (s) : time between checkpoints; None for no checkpoints.
    keeps_checkpoint : the checkpoint stays after a render that is complete.
    resume : go on from the checkpoint.
    tev : address of a viewer.
    """

    outputs: list[Path]
    stats: Path | None
    options: RenderOptions
    cluster: str | None
    checkpoint: float | None
    keeps_checkpoint: bool
    resume: bool
    quiet: bool
    tev: "Address | None"


def _check_outputs(request: _Request, spec: "SceneSpec") -> None:
    """Check that all files can be written before the work, not after."""
    from raytracer.film.image_file import check_writable

    for path in request.outputs:
        check_writable(path)
        if path.suffix.lower() == ".lf":
            _check_light_field(path, spec, request)
    if request.stats is not None:
        check_files([request.stats])


def _check_light_field(path: Path, spec: "SceneSpec", request: _Request) -> None:
    """Make sure that the picture of a scene holds a light field."""
    from raytracer.film.light_field.layout import NO_LIGHT_FIELD_MESSAGE

    layout = spec.camera.layout(spec.film.width, spec.film.height)
    has_views = layout is not None and (layout.views.rows * layout.views.columns > 1 or "rays" in request.options.aovs)
    if not has_views or request.options.crop is not None:
        raise InputError(f"{path}: {NO_LIGHT_FIELD_MESSAGE}")


def _render(request: _Request, spec: "SceneSpec", call: options.Invocation, command: DebugCommand) -> "Rendered":
    """Render the picture, write its files, and report."""
    from raytracer.core.compiler.compile_progress import watch_compilation
    from raytracer.rendering.progress import CompileBar, SampleBar
    from raytracer.rendering.render import prepare_scene, render_prepared

    with SampleBar(quiet=request.quiet) as bar, CompileBar(quiet=request.quiet) as compile_bar:

        def warn(sentence: str) -> None:
            bar.say(f"rt: warning: {sentence}")

        def show(progress: "Progress") -> None:
            WATCH.raise_if_interrupted()
            bar.show(progress)

        # The picture is done before the command is to end.
        wanted = request.options
        if (limit := wanted.time_limit) is not None:
            wanted = replace(wanted, time_limit=max(limit - _EXIT_SECONDS, 0.5 * limit))
        writer = _make_checkpoint_writer(request, bar)
        shown = connect_viewer(request.tev, request.outputs[0], warn)
        with on_hangup(writer.request_preview), options.connect_cluster(request.cluster) as cluster, shown as viewer:
            with watch_compilation(compile_bar.show):
                prepared = prepare_scene(
                    spec,
                    wanted,
                    load_seconds=time.perf_counter() - call.began,
                    warn=warn,
                    cluster=cluster,
                    with_checkpoints=writer.path is not None,
                )
            compile_bar.close()
            # From here on there is something to lose.
            with WATCH.on_first_signal(defer_interrupt):
                try_saving = partial(dry_run_save, outputs=request.outputs)
                rendered = render_prepared(
                    prepared, progress=show, dry_run_save=try_saving, checkpoint_writer=writer, observer=viewer
                )
                bar.close()
                resume = ResumeInfo(writer, call.words)
                write_outputs(rendered, request.outputs, request.stats, resume, warn)
                spp = request.options.spp_limit(spec)
                report = RenderReport(rendered, request.outputs, request.options, spp, resume, command, call.began)
                report.show(quiet=request.quiet)
    return rendered


def _make_checkpoint_writer(request: _Request, bar: "SampleBar") -> "CheckpointWriter":
    """Find the checkpoint's place, and say if an earlier render's lies there."""
    from raytracer.rendering.checkpoint import DEFAULT_INTERVAL, CheckpointWriter

    def say(sentence: str) -> None:
        bar.say(f"rt: {sentence}")

    def warn(sentence: str) -> None:
        say(f"warning: {sentence}")

    path = None
    if request.checkpoint is not None:
        is_required = request.resume or request.keeps_checkpoint
        path = find_checkpoint_path(request.outputs, is_required=is_required, warn=warn)
    writer = CheckpointWriter(
        path,
        every=request.checkpoint or DEFAULT_INTERVAL,
        resume=request.resume,
        always=request.keeps_checkpoint,
        say=warn,
        show=lambda image: save_picture_so_far(image, request.outputs, say),
    )
    if path is not None and not (request.resume or request.quiet) and path.exists():
        say(
            f"{path} has the samples of an earlier render, from which --resume would go on; "
            "without it they may be replaced"
        )
    return writer
