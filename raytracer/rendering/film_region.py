"""A part of the picture in memory: its film, and what is recorded besides radiance."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from raytracer.film.film import Film
from raytracer.film.window import Window
from raytracer.kernel.packed_scene import Scene
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.rendering.tile_scheduler import TILE_SIZE
from raytracer.scene.pack.scene import PackedScene

if TYPE_CHECKING:
    from raytracer.kernel.aovs.base.interface import AovRecorder

DENOISER_GUIDES = ("albedo", "normal", "coverage")
"""AOVs that guide the denoiser; the last is the part of a pixel that they hold for."""


class FilmRegion(NamedTuple):
    """A film for a part of the picture.

    film : radiance and its statistics.
    recording : AOVs; None if there are none.
    left, top (px) : place of the first pixel in the picture.
    """

    film: Film
    recording: "AovRecorder | None"
    left: int = 0
    top: int = 0

    @property
    def window(self) -> Window:
        """Return the pixels of the picture that this region holds."""
        height, width = self.film.count.shape
        return Window(self.left, self.top, self.left + width, self.top + height)

    def view(self) -> FilmView:
        """Return the region as kernels see it."""
        return film_view(self.film, self.left, self.top, None if self.recording is None else self.recording.view)


def empty_film(scene: Scene, width: int, height: int) -> Film:
    """Make an empty film with the buffers that a scene needs."""
    return Film.empty(width, height, is_clamped=scene.clamp is not None)


def film_view(film: Film, left: int = 0, top: int = 0, aovs: object = None) -> FilmView:
    """Return a film as kernels see it, its first pixel being (left, top) of the picture."""
    return FilmView(film.mean, film.m2, film.count, film.nan_count, left, top, aovs, film.removed)


def empty_region(packed: PackedScene, window: Window, aovs: Sequence[str], *, denoise: bool = False) -> FilmRegion:
    """Make an empty film for a part of a scene's picture, with these AOVs and those that the denoiser needs.

    Raises
    ------
    InputError : there is no AOV of that name.
    """
    width, height = window.right - window.left, window.bottom - window.top
    recording = None
    if aovs or denoise:
        from raytracer.kernel.aovs.base.interface import AovRecorder, unique_aovs
        from raytracer.scene.pack.scene import scene_ids

        names = unique_aovs([*aovs, *(DENOISER_GUIDES if denoise else ())])
        recording = AovRecorder(names, height, width, scene_ids(packed.spec, packed))
    return FilmRegion(empty_film(packed.scene, width, height), recording, window.left, window.top)


def empty_tile(packed: PackedScene, aovs: Sequence[str], *, denoise: bool = False) -> FilmView:
    """Make an empty film of one tile, of the same type as those of a scene's picture, as kernels see it.

    Raises
    ------
    InputError : there is no AOV of that name.
    """
    return empty_region(packed, Window(0, 0, TILE_SIZE, TILE_SIZE), aovs, denoise=denoise).view()
