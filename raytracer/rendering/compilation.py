"""Make a scene ready to be rendered: pack it, build the ray caster's structure, and compile the path tracer for it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from raytracer.core.compiler.compile_progress import COMPILATION
from raytracer.core.compiler.entry import needs_compiling
from raytracer.core.compiler.lock import compiler_lock
from raytracer.core.embree import Accel
from raytracer.film.window import Window
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.path_state import Workspace
from raytracer.kernel.path_state import workspace as make_workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.checked_options import CheckedOptions
from raytracer.rendering.film_region import FilmRegion, empty_film, empty_region, empty_tile, film_view
from raytracer.rendering.statistics import PhaseTimer
from raytracer.rendering.worker_pool import RemoteExecutor
from raytracer.scene.files import FileStamp
from raytracer.scene.pack.scene import PackedScene, pack
from raytracer.scene.spec import SceneSpec
from raytracer.util.signals import run_in_thread


class CompiledScene(NamedTuple):
    """A scene that is ready to be rendered, and compiled for plain radiance.

    spec : the scene, its camera focused at a distance.
    packed : the scene as arrays.
    accel : the ray caster's structure, which lives as long as this does.
    scene : the packed scene with the structure's address.
    seconds (s) : time by phase: pack, build and compile.
    """

    spec: SceneSpec
    packed: PackedScene
    accel: Accel
    scene: Scene
    seconds: dict[str, float]


def compile_scene(spec: SceneSpec, packed: PackedScene | None = None) -> CompiledScene:
    """Pack, build and compile a scene; only the latter two if it is `packed` already.

    Raises
    ------
    InputError : the scene cannot be packed.
    """
    seconds: dict[str, float] = {}
    timer = PhaseTimer(seconds)
    packed = packed or pack(spec)
    timer.lap("pack")
    accel = packed.build()
    scene = packed.scene._replace(accel=accel.address)
    timer.lap("build")
    compile_kernel(scene, film_view(empty_film(scene, 1, 1)))
    timer.lap("compile")
    return CompiledScene(packed.spec, packed, accel, scene, seconds)


def compile_kernel(scene: Scene, target: FilmView, workspace: Workspace | None = None) -> int:
    """Compile the path tracer for a scene, a film and a workspace of these types, or take it from the cache.

    Returns
    -------
    The number of kernels that this process has now and did not have before.

    Raises
    ------
    KeyboardInterrupt : at once; what is being compiled is finished all the same.
    """

    def work() -> int:
        with compiler_lock:
            before = _kernel_count()
            render_tile(*_no_pixels(scene, target, workspace))
            return _kernel_count() - before

    return run_in_thread(work, COMPILATION.report)


def has_kernel(scene: Scene, target: FilmView) -> bool:
    """Tell if the path tracer for a scene and a film of these types is compiled already, by this process or on disk."""
    return not needs_compiling(render_tile, *_no_pixels(scene, target))


def _no_pixels(scene: Scene, target: FilmView, workspace: Workspace | None = None) -> tuple[Any, ...]:
    """Return the arguments with which `render_tile` renders nothing."""
    return (scene, target, workspace or make_workspace(scene), 0, 0, 0, 0, 0, 0)


def _kernel_count() -> int:
    """Count the compiled versions of the path tracer; 0 where it is not compiled at all."""
    return len(getattr(render_tile, "signatures", ()))


@dataclass(frozen=True)
class PreparedScene:
    """A scene that is packed, built and compiled, and can be rendered, several times if need be.

    packed : the scene as arrays, its camera focused at a distance.
    accel : the ray caster's structure, which lives as long as this does.
    scene : as kernels take it, with the structure's address.
    effects : names of the camera effects that are simulated.
    options : of the render.
    remote : the cluster that takes the samples; the threads of this process if None.
    seconds (s) : time so far by phase: load, pack, build and compile.
    stamps : of the files of the scene, before they were read (`scene.files.file_stamps`); empty without checkpoints.
    """

    packed: PackedScene
    accel: Accel
    scene: Scene
    effects: tuple[str, ...]
    options: CheckedOptions
    remote: RemoteExecutor | None
    seconds: dict[str, float]
    stamps: Mapping[Path, FileStamp]

    def for_window(self, window: Window) -> "PreparedScene":
        """Return the same scene for a part of the picture; its pixels are those of the whole."""
        return replace(self, options=replace(self.options, window=window))

    def empty_region(self, window: Window) -> FilmRegion:
        """Make an empty film for a part of the picture."""
        return empty_region(self.packed, window, self.options.aovs, denoise=self.options.denoise)

    def empty_tile(self) -> FilmView:
        """Make an empty film of one tile, of the same type as the picture's, as kernels see it."""
        return empty_tile(self.packed, self.options.aovs, denoise=self.options.denoise)
