"""Decoder of cameras whose microlenses focus the scene on the sensor, and not the main lens (plenoptic 2.0).

Each pixel is a ray, by the optics that the user gives and the grid that the white picture shows.  Microlenses of three
focal lengths, interleaved, are told apart by the white picture too: the farther from the focal length that would show
the main lens, the softer the edges of its image behind them.

References: Lumsdaine, Georgiev 2009, "The Focused Plenoptic Camera", ICCP; Perwass, Wietzke 2012, "Single Lens
3D-Camera with Extended Depth-of-Field", Proc. SPIE 8291.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raytracer.film.image import Image
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.lattice import Lattice
from raytracer.film.light_field.lenslet_kinds import COUNT
from raytracer.film.light_field.lenslets import Lenslets
from raytracer.film.light_field.views import Views
from raytracer.lightfield.decoding.decoder import PreparedRaw, grid_settings, prepare_raw
from raytracer.lightfield.decoding.memory_needs import require_rays
from raytracer.lightfield.decoding.microlens_grid import Grid
from raytracer.lightfield.decoding.raw_image import LEAST_LIGHT, Source, source_name
from raytracer.schema.units import METRES_PER_MILLIMETRE
from raytracer.util.errors import InputError

FloatArray = NDArray[np.float64]

_MILLIMETRES_PER_MICROMETRE = 1e-3

_DISTINCT = 0.01
"""Least part of the error of the second best order of kinds by which that of the best must be smaller."""


@dataclass(frozen=True)
class FocusedOptics:
    """Optics of a camera with focused microlenses, behind a thin lens.

    Attributes
    ----------
    pixel_pitch : distance of the sensor's pixels (um).
    focal_length : of the main lens (mm).
    f_number : of the main lens.
    focus_distance : of the plane that the microlenses show sharply, those of the middle kind, from the lens (m).
    microlens_distance : from the microlenses to the sensor (um).
    microlens_focal_lengths : of one kind, or of three (um).
    """

    pixel_pitch: float
    focal_length: float
    f_number: float
    focus_distance: float
    microlens_distance: float
    microlens_focal_lengths: tuple[float, ...]

    def lenslets(self, grid: Grid) -> Lenslets:
        """Lay out the pixels of a camera with this grid; of three kinds in the order in which they are given.

        Raises
        ------
        InputError : there is no such camera.
        """
        pixel, distance = (_MILLIMETRES_PER_MICROMETRE * size for size in (self.pixel_pitch, self.microlens_distance))
        kinds = [_MILLIMETRES_PER_MICROMETRE * size for size in self.microlens_focal_lengths]
        if len(kinds) not in (1, COUNT):
            raise InputError(f"microlenses have one focal length or {COUNT}, not {len(kinds)}")
        if len(kinds) == COUNT and not grid.lattice.hexagonal:
            raise InputError("microlenses of three kinds stand on hexagons, and those of the grid on squares")
        middle = sorted(kinds)[len(kinds) // 2]
        image = self._array_distance(middle, distance)
        spread = 1.0 + distance / image
        blurs = [METRES_PER_MILLIMETRE * pixel / spread * (1.0 + image / distance - image / own) for own in kinds]
        return Lenslets(
            lattice=_staggered(grid.lattice),
            width=grid.width,
            height=grid.height,
            middle=(0.5 * grid.width, 0.5 * grid.height),
            slope=pixel / (image * spread),
            stride=METRES_PER_MILLIMETRE * pixel * image / distance,
            inverse_distance=(1.0 / self.focal_length - 1.0 / image) / METRES_PER_MILLIMETRE,
            inverse_focus=1.0 / self.focus_distance,
            aperture=METRES_PER_MILLIMETRE * self.focal_length / self.f_number,
            focal_length=self.focal_length,
            blur=blurs[kinds.index(middle)],
            kinds=tuple(blurs) if len(kinds) == COUNT else (),
        )

    def _array_distance(self, microlens: float, sensor: float) -> float:
        """Compute the distance of the microlenses from the main lens (mm).

        microlens, sensor (mm) : focal length of the microlenses that show the plane of focus, and distance behind them.

        Raises
        ------
        InputError : there is none.
        """
        plane = self.focus_distance / METRES_PER_MILLIMETRE
        if microlens == sensor:
            raise InputError(
                f"microlenses whose focal length is their distance, {self.microlens_distance:g} um, show infinity: "
                "such a camera is decoded without their focal length"
            )
        if plane <= self.focal_length:
            raise InputError(
                f"the focus distance, {self.focus_distance:g} m, must be more than the focal length, "
                f"{METRES_PER_MILLIMETRE * self.focal_length:g} m"
            )
        # By Gauss's equation the image of the plane of focus lies so far before the microlenses, or behind them.
        before = microlens * sensor / (sensor - microlens)
        away = 1.0 / (1.0 / self.focal_length - 1.0 / plane) + before
        if away <= 0.0:
            raise InputError(
                f"microlenses of {1e3 * microlens:g} um, {self.microlens_distance:g} um before the sensor, would lie "
                "before the main lens"
            )
        return away


def _staggered(lattice: Lattice) -> Lattice:
    """Return a lattice with the rows of which `microlens_kinds` counts: to the next one it goes half way along."""
    (x, y), (right, down) = lattice.along, lattice.across
    if not lattice.hexagonal or x * right + y * down > 0.0:
        return lattice
    return replace(lattice, across=(right + x, down + y))


@dataclass(frozen=True, eq=False)
class DecodedFocused:
    """Raw picture of a focused camera that is ready to be sorted by views.

    Attributes
    ----------
    prepared : the picture without dark and vignetting, with the light of each pixel.
    lenslets : layout of its pixels.
    """

    prepared: PreparedRaw
    lenslets: Lenslets

    @property
    def grid(self) -> Grid:
        """Return the grid of the microlenses."""
        return self.prepared.grid

    @property
    def notes(self) -> Sequence[str]:
        """Return sentences for the user, about what is unusual."""
        return self.prepared.notes

    @property
    def views(self) -> Views:
        """Return the geometry of the views."""
        return self.lenslets.views

    def light_field(self) -> LightField:
        """Make the views and the rays."""
        light, name, weight = self.prepared.light, self.prepared.name, self.prepared.weight
        assert weight is not None
        lit = np.where(weight >= LEAST_LIGHT, weight, 0.0).astype(np.float64)
        picture = np.asarray(light if light.ndim == 3 else np.repeat(light[..., None], 3, axis=2), dtype=np.float64)
        radiance = self.prepared.scale * lit[..., None] * picture
        return self.lenslets.light_field(Image(radiance, settings=grid_settings(self.grid, name)), lit)

    def write(self, path: str | Path, progress: Callable[[int, int], None] | None = None) -> None:
        """Write views and rays to an `.lf` file.

        progress : called at the end with the number of views, twice.

        Raises
        ------
        OutputError : the file cannot be written.
        """
        from raytracer.film.light_field import lf

        lf.write(path, self.light_field())
        if progress is not None:
            progress(self.views.rows * self.views.columns, self.views.rows * self.views.columns)


def decode_focused(
    raw: Source,
    white: Source | None,
    optics: FocusedOptics,
    *,
    dark: Source | None = None,
    grid: Grid | None = None,
    bayer: str | None = None,
    srgb: bool = False,
) -> DecodedFocused:
    """Find the microlenses of a focused camera, and their kinds, and make its raw picture ready to be sorted by rays.

    Parameters
    ----------
    white : picture of something evenly bright with the same camera at the same settings.
    optics : of the camera; three kinds may have any order.
    dark, grid, bayer, srgb : as of `decode`.

    Raises
    ------
    InputError : as of `decode`; and there is no white picture, it does not tell three kinds apart, there is no such
        camera, or the picture holds no view.
    """
    if white is None:
        name = source_name(raw, "raw")
        raise InputError(f"{name}: focused microlenses are found by a white picture, and none is given")
    prepared = prepare_raw(raw, white, dark=dark, grid=grid, bayer=bayer, srgb=srgb)
    require_rays(prepared.name, prepared.grid.width, prepared.grid.height)
    lenslets = optics.lenslets(prepared.grid)
    assert prepared.weight is not None
    if lenslets.kinds:
        lenslets = _order_kinds(lenslets, prepared.weight.astype(np.float64), prepared.name)
    if not lenslets.holds_views:
        raise InputError(f"{prepared.name}: {prepared.grid.width} x {prepared.grid.height} pixels hold no view")
    return DecodedFocused(prepared, lenslets)


def _order_kinds(lenslets: Lenslets, white: FloatArray, name: str) -> Lenslets:
    """Find which of the interleaved microlenses has which of the focal lengths, by the light of the white picture.

    Each kind of pixels is compared with the light that each focal length lets through, up to its brightness.
    """
    error = np.zeros((COUNT, COUNT))
    for column, blur in enumerate(lenslets.kinds):
        through = lenslets.lit_through(blur)
        for kind in range(COUNT):
            is_own = lenslets.pixel_kinds == kind
            seen, said = white[is_own], through[is_own]
            error[kind, column] = seen @ seen - (seen @ said) ** 2 / (said @ said)
    orders = list(itertools.permutations(range(COUNT)))
    errors = np.array([error[np.arange(COUNT), order].sum() for order in orders])
    best, second = np.sort(errors)[:2]
    if not second - best > _DISTINCT * second:
        raise InputError(
            f"{name}: the white picture does not tell which microlenses have which of the focal lengths: those given "
            "let nearly the same light through"
        )
    return replace(lenslets, kinds=tuple(lenslets.kinds[kind] for kind in orders[int(errors.argmin())]))
