"""Render a scene: prepare it (pack, build, compile), take its samples, and develop the picture."""

import contextlib
import os
import warnings
from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass

from raytracer.core.compiler.compile_progress import watch_compilation
from raytracer.core.compiler.lock import compiler_lock
from raytracer.film.image import Image
from raytracer.rendering import memory_budget
from raytracer.rendering.checked_options import check_options
from raytracer.rendering.checkpoint import CheckpointWriter
from raytracer.rendering.compilation import PreparedScene, compile_kernel
from raytracer.rendering.develop import check_development
from raytracer.rendering.live_image import LiveImage
from raytracer.rendering.observer import RenderObserver
from raytracer.rendering.options import RenderOptions, called_with
from raytracer.rendering.progress import CompileBar, Progress, SampleBar
from raytracer.rendering.session import Rendered, RenderSession
from raytracer.rendering.statistics import PhaseTimer
from raytracer.rendering.worker_pool import ClusterClient
from raytracer.scene.cache import RenderCache
from raytracer.scene.effects import effects_of
from raytracer.scene.files import file_stamps
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from raytracer.scene.spec import SceneSpec
from raytracer.scene.warnings import emit_warnings
from raytracer.util.errors import InputError, OutputError, SceneWarning


@dataclass(frozen=True)
class ImageOptions(RenderOptions):
    """Options of `render_image`; see there."""

    scene: SceneSpec | str | os.PathLike[str]
    _: KW_ONLY
    progress: bool | Callable[[Progress], None] = False
    live: bool = False
    cache: RenderCache | None = None
    stock: RenderCache | None = None
    cluster: ClusterClient | None = None
    checkpoint: str | os.PathLike[str] | None = None
    resume: bool = False


@called_with(ImageOptions)
def render_image(call: ImageOptions) -> Image:
    """Render a scene, or a scene file, to an image: `image.radiance` is float64 (height, width, 3), row 0 at the top.

    What makes the scene doubtful is a SceneWarning, or an error if `strict`.

    Parameters
    ----------
    spp, seed, threads, crop, noise, time_limit, aovs, denoise, strict, max_memory : see `RenderOptions`.
    progress : True to show a bar, also in a notebook; or a function that is called with a `Progress`.
    live : True to show the picture in a notebook while it is rendered, two times a second at most; the image that is
        returned is not shown once more if the call ends in a semicolon.  Elsewhere it does nothing.
    cache : what renders of similar scenes share, an `rt.Cache`.
    stock : old name of `cache`, still accepted.
    cluster : the cluster that takes the samples, an `rt.Cluster`; this machine if None.
    checkpoint : file in which all samples are kept, once a minute and at the end.
    resume : True to go on from that file.

    Raises
    ------
    InputError : see `render`.
    OutputError : a cluster was lost before the picture was there.
    """
    with SampleBar(always=True) as bar, _compile_bar(call.progress is True):
        spec = load(call.scene) if isinstance(call.scene, str | os.PathLike) else call.scene
        if call.resume and call.checkpoint is None:
            raise InputError("resume needs checkpoint, the file to go on from")
        writer = None
        if call.checkpoint is not None:
            writer = CheckpointWriter(call.checkpoint, resume=call.resume, always=True, say=_warn_of_checkpoint)
        prepared = prepare_scene(
            spec,
            call,
            warn=_warn,
            cache=call.stock if call.cache is None else call.cache,
            cluster=call.cluster,
            with_checkpoints=writer is not None,
        )
        progress = bar.show if call.progress is True else call.progress or None
        live = LiveImage(progress) if call.live else None
        if live is not None:
            progress = live.tick
        rendered = render_prepared(prepared, progress=progress, checkpoint_writer=writer, observer=live)
    if rendered.failure is not None:
        raise OutputError(rendered.failure)
    return rendered.image


@dataclass(frozen=True)
class SceneOptions(RenderOptions):
    """Options of `render`; see there."""

    scene: SceneSpec
    _: KW_ONLY
    progress: Callable[[Progress], None] | None = None
    dry_run_save: Callable[[Image], object] | None = None
    warn: Callable[[str], object] | None = None
    cache: RenderCache | None = None
    cluster: ClusterClient | None = None
    checkpoint_writer: CheckpointWriter | None = None


@called_with(SceneOptions)
def render(call: SceneOptions) -> Rendered:
    """Render a scene.  The same scene, seed and spp, or noise, give the same bits for any number of threads.

    It may be called by several threads at once.

    Parameters
    ----------
    spp, seed, threads, crop, noise, time_limit, aovs, denoise, strict, max_memory : see `RenderOptions`.
    progress : called about ten times a second; a KeyboardInterrupt out of it, or out of a signal, ends the render
        early with the samples taken so far.
    dry_run_save : does with an early image what the caller will do with the last one, so that `time_limit` leaves the
        time for it.
    warn : called with each warning about the scene, a sentence, before anything is rendered (docs/warnings.md).
    cache : what renders of similar scenes share; nothing if None.
    cluster : the cluster that takes the samples; this machine if None.
    checkpoint_writer : keeps all samples in a file, and goes on from those that are there; None to keep none.

    Raises
    ------
    StrictError : there is a warning, and `strict`.
    InputError : a crop outside the film, a noise or limit out of range, a scene that cannot be packed, an unknown AOV,
        no denoiser, what `check_development` refuses, a cluster that cannot render this, more memory needed than there
        is (`memory_budget.check_memory`), or a checkpoint of another picture.
    """
    prepared = prepare_scene(
        call.scene,
        call,
        warn=call.warn,
        cache=call.cache,
        cluster=call.cluster,
        with_checkpoints=call.checkpoint_writer is not None,
    )
    return render_prepared(
        prepared, progress=call.progress, dry_run_save=call.dry_run_save, checkpoint_writer=call.checkpoint_writer
    )


def render_prepared(
    prepared: PreparedScene,
    *,
    progress: Callable[[Progress], None] | None = None,
    dry_run_save: Callable[[Image], object] | None = None,
    checkpoint_writer: CheckpointWriter | None = None,
    observer: RenderObserver | None = None,
) -> Rendered:
    """Render a prepared scene, and develop the picture; parameters are those of `render`.

    observer : looks at the picture while it is rendered, and takes it at the end; None for nobody.

    Raises
    ------
    InputError : the picture has too many pixels to be rendered at once, or a checkpoint is of another one.
    """
    session = RenderSession(prepared, progress, dry_run_save, checkpoint_writer)
    if observer is None:
        return session.run()
    with observer.observe(session):
        rendered = session.run()
    observer.finish(rendered.image)
    return rendered


def prepare_scene(
    spec: SceneSpec,
    options: RenderOptions | None = None,
    *,
    warn: Callable[[str], object] | None = None,
    cache: RenderCache | None = None,
    cluster: ClusterClient | None = None,
    load_seconds: float = 0.0,
    max_pixels: int | None = None,
    with_checkpoints: bool = False,
) -> PreparedScene:
    """Prepare a render up to its first sample, so that the next scene can be prepared while one is rendered.

    Parameters and errors are those of `render`, and besides:

    Parameters
    ----------
    options : what is asked for; all defaults if None.
    load_seconds (s) : time that reading the scene has taken; it counts towards the time limit.
    max_pixels : pixels that are rendered at once, where the picture is made in parts.
    with_checkpoints : True if there will be checkpoints, which need memory for a copy of the film.
    """
    options = options or RenderOptions()
    spec, checked = check_options(spec, options)
    seconds = {"load": load_seconds}
    timer = PhaseTimer(seconds)
    remote = None if cluster is None else cluster.connect(spec, options, warn)
    stamps = file_stamps(spec) if with_checkpoints else {}
    packed = pack(spec, provider=cache)
    emit_warnings(packed, warn, strict=options.strict)
    check_development(packed.spec, checked.window)
    effects = effects_of(packed.spec, packed.scene)
    timer.lap("pack")
    if checked.is_adaptive and checked.aovs:
        from raytracer.kernel.aovs.base.interface import per_sample_aovs

        for name in per_sample_aovs(checked.aovs):
            raise InputError(f"the AOV {name} needs as many samples in every pixel: give spp and no noise")
    pixels = checked.window.pixels if max_pixels is None else min(checked.window.pixels, max_pixels)
    picture = memory_budget.picture_memory(
        packed, pixels, checked.max_spp, checked.aovs, denoise=checked.denoise, with_checkpoints=with_checkpoints
    )
    structure = memory_budget.structure_memory(packed, cache)
    # A cluster's workers have kernels of their own.
    kernel = memory_budget.kernel_bytes(packed, checked.aovs, denoise=checked.denoise) if remote is None else 0
    needed = memory_budget.estimate_memory(structure, picture, kernel, checked.threads)
    memory_budget.check_memory(needed, options.max_memory)
    timer.lap("pack")
    accel = packed.build(cache)
    timer.lap("build")
    names = tuple(name for name, effect in effects.items() if effect.active)
    scene = packed.scene._replace(accel=accel.address)
    prepared = PreparedScene(packed, accel, scene, names, checked, remote, seconds, stamps)
    if remote is None:
        kernels = compile_kernel(prepared.scene, prepared.empty_tile())
        if cache is not None:
            cache.count_kernels(kernels)
    timer.lap("compile")
    return prepared


@contextlib.contextmanager
def _compile_bar(is_shown: bool) -> Iterator[None]:
    """Show the compiler's progress in a `with` block, if there is to be a bar."""
    with CompileBar(always=True, quiet=not is_shown) as bar, watch_compilation(bar.show):
        yield


def _warn_of_checkpoint(sentence: str) -> None:
    """Warn about the checkpoint: it could not be written, can be again, or is damaged."""
    with compiler_lock:
        warnings.warn(sentence, RuntimeWarning, stacklevel=2)


def _warn(sentence: str) -> None:
    """Warn at the line that called `render_image`."""
    with compiler_lock:
        warnings.warn(sentence, SceneWarning, stacklevel=6)
