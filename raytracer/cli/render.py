"""`rt render`: from a scene file to images."""

import sys
import time
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import (
    ResumeInfo,
    dry_run_save,
    find_checkpoint_path,
    parse_checkpoint_interval,
    print_json,
    save_picture_so_far,
    say,
    write_outputs,
)
from raytracer.cli.base.picture_names import name_pictures
from raytracer.cli.base.render_report import DebugCommand, RenderReport, describe_delay, describe_phases
from raytracer.cli.base.render_request import (
    Job,
    ProgressForm,
    Request,
    Said,
    check_outputs,
    check_together,
    preview_job,
    skip_existing,
)
from raytracer.cli.base.viewer import connect_viewer, parse_viewer
from raytracer.rendering.options import OPTIONS
from raytracer.util.errors import InputError, Interrupted
from raytracer.util.signals import WATCH, defer_interrupt, on_hangup

if TYPE_CHECKING:
    from raytracer.rendering.checkpoint import CheckpointWriter
    from raytracer.rendering.progress import Progress, ProgressLines, SampleBar
    from raytracer.rendering.session import Rendered

EXAMPLE = """\b
Examples:
  rt render scenes/cover.yaml
  rt render scenes/cover.yaml -o cover.png -o cover.exr --spp 1000
  rt render scenes/cover.yaml -D camera.defocus_angle=2 --preview
  rt render scenes/cover.yaml --size 640x360 -o - > cover.png
  rt render scenes/cover.yaml scenes/cornell.yaml --scale 50% -o small/ --no-clobber
  rt render scenes/cornell.yaml --json --progress json
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
    scenes: Annotated[list[str], options.scene_argument("Scene files; - for standard input.")],
    *,
    output: Annotated[
        list[str] | None,
        options.output(
            "FILE",
            "Image to write, .png .jpg for display, .exr .hdr .npy linear; .lf holds a light field; may repeat.  A "
            "folder, FOLDER/, takes images named for the scenes; - is standard output.  Default: outputs/<scene>.png",
        ),
    ] = None,
    image_format: Annotated[
        str | None,
        takes(
            "SUFFIX",
            "Format of images that -o gives no name: png, exr, ...  Default: png.",
            "--format",
            autocompletion=complete_from("png", "jpg", "exr", "hdr", "npy", "lf"),
        ),
    ] = None,
    no_clobber: Annotated[
        bool, Option("--no-clobber", help="Leave images that are there, and what would make them.")
    ] = False,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    given: options.GivenOptions,
    size: options.Size = None,
    scale: options.Scale = None,
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
    as_json: Annotated[
        bool, Option("--json", help="Print what the render took as JSON, as --stats writes it; with --debug, the path.")
    ] = False,
    progress: Annotated[
        ProgressForm | None,
        takes(
            "FORM",
            "How progress is told on standard error: bar; json, one object a line; off.  Default: bar, on terminals.",
        ),
    ] = None,
    verbose: Annotated[
        bool, Option("--verbose", "-v", help="Say also what each phase took, and what was compiled.")
    ] = False,
    quiet: options.Quiet = False,
) -> None:
    """Render scenes, one after the other.

    Ctrl-C or SIGTERM ends the render early and writes the picture so far, and what --resume goes on from; a second one
    ends it at once.  SIGHUP writes the picture so far, and the render goes on.
    """
    if debug != (pixel is not None) or (sample is not None and not debug):
        raise InputError(_describe_half_of_debug(pixel, debug=debug))
    if debug and (resume or checkpoint is not None):
        raise InputError(f"--{'resume' if resume else 'checkpoint'} is for pictures, and --debug makes none")
    if debug and tev is not None:
        raise InputError("--tev is for pictures, and --debug makes none")
    sizing = options.parse_sizing(size, scale)
    named = name_pictures(scenes, output or [], image_format)
    request = Request(
        outputs=[path for paths in named.values() for path in paths],
        stats=stats,
        options=given.parse([path.suffix for paths in named.values() for path in paths], "-o NAME.exr"),
        cluster=cluster,
        checkpoint=parse_checkpoint_interval(checkpoint),
        keeps_checkpoint=checkpoint is not None,
        resume=resume,
        said=Said(quiet=quiet, verbose=verbose, as_json=as_json, progress=progress),
        tev=parse_viewer(tev),
    )
    check_together(request, scenes, no_clobber=no_clobber, debug=debug)
    jobs = list[Job]()
    for scene, outputs in skip_existing(named, quiet=quiet).items() if no_clobber and not debug else named.items():
        spec = options.load_scene(scene, define, allow_files, sizing)
        job = Job(request._replace(outputs=outputs), spec, DebugCommand(scene, define or [], sizing, preview, given))
        if not debug:
            check_outputs(job.request, spec)
        jobs.append(preview_job(job) if preview else job)
    if pixel is not None:
        _print_path(jobs[0], _parse_pixel(pixel), sample)
        return
    for job in jobs:
        began = context.obj.began if job is jobs[0] else time.perf_counter()
        words = tuple(word for word in context.obj.words if word not in scenes or word == job.command.scene)
        _run(job, options.Invocation(began, words))


def _describe_half_of_debug(pixel: str | None, *, debug: bool) -> str:
    """Say what is missing of the options that print the path of a sample."""
    if debug:
        return "--debug needs --pixel X,Y, the pixel whose path it is to print"
    return f"{'--sample' if pixel is None else '--pixel'} needs --debug, which prints the path of one sample"


def _parse_pixel(text: str) -> tuple[int, int]:
    try:
        x, y = map(int, text.split(","))
    except ValueError:
        raise InputError(f"--pixel {text}: must be two integers, X,Y") from None
    return x, y


def _print_path(job: "Job", pixel: tuple[int, int], sample: int | None) -> None:
    """Print the path of one sample; see `path_debug.trace_sample`."""
    from raytracer.rendering.path_debug import trace_sample
    from raytracer.rendering.path_text import format_path

    path = trace_sample(job.spec, pixel, sample, job.request.options)
    if job.request.said.as_json:
        print_json(path.json())
    else:
        print(format_path(path), end="")


def _run(job: Job, call: options.Invocation) -> None:
    """Render one scene, and end the command if that was interrupted."""
    rendered = _render(job, call)
    seconds = time.perf_counter() - call.began
    is_interrupted = rendered.interrupted or WATCH.signal_number is not None
    if (limit := job.request.options.time_limit) is not None and not is_interrupted and seconds > 1.05 * limit:
        say(describe_delay(rendered, limit, seconds))
    if is_interrupted:
        raise Interrupted


def _render(job: Job, call: options.Invocation) -> "Rendered":
    """Render the picture, write its files, and report."""
    from raytracer.core.compiler.compile_progress import COMPILATION, watch_compilation
    from raytracer.rendering.progress import Progress
    from raytracer.rendering.render import prepare_scene, render_prepared

    request, spec, command = job
    compiled = COMPILATION.count
    samples_shown, compiler_shown = request.said.bars(command.scene)
    with samples_shown as bar, compiler_shown as compile_bar:

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
                if request.said.progress == "json":
                    samples, seconds = rendered.stats.samples, rendered.stats.seconds["render"]
                    bar.show(Progress(samples, samples, seconds))
                bar.close()
                resume = ResumeInfo(writer, call.words)
                write_outputs(rendered, request.outputs, request.stats, resume, warn)
                spp = request.options.spp_limit(spec)
                report = RenderReport(rendered, request.outputs, request.options, spp, resume, command, call.began)
                report.show(quiet=request.said.quiet)
                if request.said.verbose:
                    print(describe_phases(rendered.stats, COMPILATION.count - compiled), file=sys.stderr)
                if request.said.as_json:
                    print_json(rendered.stats.json())
    return rendered


def _make_checkpoint_writer(request: Request, bar: "SampleBar | ProgressLines") -> "CheckpointWriter":
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
    if path is not None and not (request.resume or request.said.quiet) and path.exists():
        say(
            f"{path} has the samples of an earlier render, from which --resume would go on; "
            "without it they may be replaced"
        )
    return writer
