"""The request for a render, parsed from its command line and checked before the work."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

from raytracer.cli.base.outputs import check_files, join_paths, say
from raytracer.cli.base.render_report import DebugCommand
from raytracer.rendering.options import RenderOptions
from raytracer.scene.preview import SPP, preview_scene
from raytracer.util.atomic_write import is_standard_output
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.rendering.progress import CompileBar, ProgressLines, SampleBar
    from raytracer.rendering.tev.viewer import Address
    from raytracer.scene.spec import SceneSpec

ProgressForm = Literal["bar", "json", "off"]


class Said(NamedTuple):
    """The messages of a render, and their form.

    quiet, verbose : less, or more.
    as_json : print the statistics on stdout.
    progress : its form; None for a bar, unless it is to be quiet.
    """

    quiet: bool
    verbose: bool
    as_json: bool
    progress: ProgressForm | None

    def bars(self, scene: str) -> "tuple[SampleBar | ProgressLines, CompileBar | ProgressLines]":
        """Make what shows samples, and what shows the compiler."""
        from raytracer.rendering.progress import CompileBar, ProgressLines, SampleBar

        if self.progress == "json":
            return ProgressLines("render", scene), ProgressLines("compile", scene)
        is_off = self.progress == "off" or (self.quiet and self.progress is None)
        return SampleBar(quiet=is_off), CompileBar(quiet=is_off)


class Request(NamedTuple):
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
    said: Said
    tev: "Address | None"


class Job(NamedTuple):
    """The render of one scene; `command` is that of its samples."""

    request: Request
    spec: "SceneSpec"
    command: DebugCommand


def check_together(request: Request, scenes: list[str], *, no_clobber: bool, debug: bool) -> None:
    """Refuse options that exclude each other."""
    if request.resume and request.checkpoint is None:
        raise InputError("--resume goes on from a checkpoint, and with --checkpoint off there is none")
    if request.resume and no_clobber:
        raise InputError("--resume and --no-clobber exclude each other")
    if request.said.quiet and request.said.verbose:
        raise InputError("--quiet and --verbose exclude each other")
    if request.said.as_json and not debug and any(map(is_standard_output, request.outputs)):
        raise InputError("--json and -o - are both for standard output; --stats FILE.json takes the statistics")
    if len(scenes) > 1 and (debug or request.stats is not None):
        raise InputError(f"{'--debug' if debug else '--stats'} is for one scene, and here are {len(scenes)}")


def skip_existing(named: Mapping[str, list[Path]], *, quiet: bool) -> dict[str, list[Path]]:
    """Leave out files that are there, and scenes without others."""
    existing = {path for paths in named.values() for path in paths if path.exists()}
    if existing and not quiet:
        verb = (
            "is there already, and stays as it is" if len(existing) == 1 else "are there already, and stay as they are"
        )
        say(f"{join_paths(sorted(existing))} {verb}")
    left = {scene: [path for path in paths if path not in existing] for scene, paths in named.items()}
    return {scene: paths for scene, paths in left.items() if paths}


def preview_job(job: Job) -> Job:
    """Make the quick look of a render."""
    spec, wanted = preview_scene(job.spec), job.request.options
    if wanted.noise is None:
        wanted = replace(wanted, spp=min(wanted.spp or spec.render.spp, SPP))
    return job._replace(spec=spec, request=job.request._replace(options=wanted))


def check_outputs(request: Request, spec: "SceneSpec") -> None:
    """Check that all files can be written before the work, not after."""
    from raytracer.film.image_file import check_writable

    for path in request.outputs:
        check_writable(path)
        if path.suffix.lower() == ".lf":
            _check_light_field(path, spec, request)
    if request.stats is not None:
        check_files([request.stats])


def _check_light_field(path: Path, spec: "SceneSpec", request: Request) -> None:
    """Make sure that the picture of a scene holds a light field."""
    from raytracer.film.light_field.layout import NO_LIGHT_FIELD_MESSAGE

    layout = spec.camera.layout(spec.film.width, spec.film.height)
    has_views = layout is not None and (layout.views.rows * layout.views.columns > 1 or "rays" in request.options.aovs)
    if not has_views or request.options.crop is not None:
        reason = spec.camera.why_no_views(spec.film.width, spec.film.height) or NO_LIGHT_FIELD_MESSAGE
        raise InputError(f"{path}: {reason}")
