"""A scene that is ready to be rendered with the options that were asked for."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from raytracer.core.embree import Accel
from raytracer.film.window import Window
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.checked_options import CheckedOptions
from raytracer.rendering.film_region import FilmRegion, empty_region
from raytracer.rendering.tile_scheduler import TILE_SIZE
from raytracer.rendering.worker_pool import RemoteExecutor
from raytracer.scene.files import FileStamp
from raytracer.scene.pack.scene import PackedScene


@dataclass(frozen=True)
class PreparedScene:
    """A scene that is packed, built and compiled, and can be rendered, several times if need be.

    Attributes
    ----------
    packed : the scene as arrays, its camera focused at a distance.
    accel : the ray caster's structure, which lives as long as this does.
    scene : as kernels take it, with the structure's address.
    effects : names of the camera effects that are simulated.
    options : of the render.
    remote : the cluster that takes the samples; the threads of this process if None.
    seconds (s) : time so far by phase: load, pack, build and compile.
    stamps : of the files of the scene, before they were read (`input_files.file_stamps`); empty without checkpoints.
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
        return self.empty_region(Window(0, 0, TILE_SIZE, TILE_SIZE)).view()
