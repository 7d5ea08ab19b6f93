"""Decoder of cameras whose microlenses focus the scene on the sensor, and not the main lens (plenoptic 2.0).

Each pixel is a ray, by the optics that the user gives and the grid that the white picture shows.  Microlenses of three
focal lengths, interleaved, are told apart by the white picture too: the farther from the focal length that would show
the main lens, the softer the edges of its image behind them.

References: Lumsdaine, Georgiev 2009, "The Focused Plenoptic Camera", ICCP; Perwass, Wietzke 2012, "Single Lens
3D-Camera with Extended Depth-of-Field", Proc. SPIE 8291.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
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
from raytracer.lightfield.decoding.decoder import grid_settings, prepare_raw
from raytracer.lightfield.decoding.memory_needs import require_rays
from raytracer.lightfield.decoding.microlens_grid import Grid
from raytracer.lightfield.decoding.raw_image import LEAST_LIGHT, Floats32, Source, source_name
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

    def check(self) -> None:
        """Check that there is such a camera.

        Raises
        ------
        InputError : there is none.
        """
        lengths = dataclasses.asdict(self)
        kinds = lengths.pop("microlens_focal_lengths")
        if len(kinds) not in (1, COUNT):
            raise InputError(f"microlenses have one focal length or {COUNT}, not {len(kinds)}")
        for name, length in (*lengths.items(), *((f"focal length {i + 1}", own) for i, own in enumerate(kinds))):
            if not length > 0.0 or (math.isinf(length) and name != "focus_distance"):
                raise InputError(f"{name.replace('_', ' ')}: must be greater than 0 and finite, got {length:g}")
        self._array_distance()

    def lenslets(self, grid: Grid) -> Lenslets:
        """Lay out the pixels of a camera with this grid; of three kinds in the order in which they are given.

        Raises
        ------
        InputError : there is no such camera.
        """
        self.check()
        pixel, distance = (_MILLIMETRES_PER_MICROMETRE * size for size in (self.pixel_pitch, self.microlens_distance))
        kinds = [_MILLIMETRES_PER_MICROMETRE * size for size in self.microlens_focal_lengths]
        if len(kinds) == COUNT and not grid.lattice.hexagonal:
            raise InputError("microlenses of three kinds stand on hexagons, and those of the grid on squares")
        image = self._array_distance()
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
            blur=sorted(blurs)[len(blurs) // 2],
            kinds=tuple(blurs) if len(kinds) == COUNT else (),
        )

    def _array_distance(self) -> float:
        """Compute the distance of the microlenses from the main lens (mm).

        Raises
        ------
        InputError : there is none.
        """
        middle = sorted(self.microlens_focal_lengths)[len(self.microlens_focal_lengths) // 2]
        plane, sensor = self.focus_distance / METRES_PER_MILLIMETRE, self.microlens_distance
        if middle == sensor:
            raise InputError(f"microlenses {sensor:g} um before the sensor show infinity by a focal length of as much")
        if plane <= self.focal_length:
            raise InputError(
                f"the focus distance, {self.focus_distance:g} m, must be more than the focal length, "
                f"{METRES_PER_MILLIMETRE * self.focal_length:g} m"
            )
        # By Gauss's equation the image of the plane of focus lies so far before the microlenses, or behind them.
        before = _MILLIMETRES_PER_MICROMETRE * middle * sensor / (sensor - middle)
        away = 1.0 / (1.0 / self.focal_length - 1.0 / plane) + before
        if away <= 0.0:
            raise InputError(
                f"microlenses of {middle:g} um, {sensor:g} um before the sensor, would lie before the main lens"
            )
        return away


def _staggered(lattice: Lattice) -> Lattice:
    """Return a lattice whose steps are 60 degrees apart, as `microlens_kinds` needs, and not 120."""
    (x, y), (right, down) = lattice.along, lattice.across
    if not lattice.hexagonal or x * right + y * down > 0.0:
        return lattice
    return replace(lattice, across=(right + x, down + y))


@dataclass(frozen=True, eq=False)
class DecodedFocused:
    """Raw picture of a focused camera that is ready to be sorted by views.

    Attributes
    ----------
    grid : of the microlenses.
    lenslets : layout of the pixels.
    settings : for the light field's file.
    notes : sentences for the user, about what is unusual.
    light : picture without dark and vignetting, in units of `scale`.
    scale : light of one unit of `light`.
    weight : light that each pixel gets, 0..1.
    """

    grid: Grid
    lenslets: Lenslets
    settings: Mapping[str, str | float | int]
    notes: Sequence[str]
    light: Floats32 | NDArray[np.uint16]
    scale: float
    weight: Floats32

    @property
    def views(self) -> Views:
        """Return the geometry of the views."""
        return self.lenslets.views

    def light_field(self) -> LightField:
        """Make the views and the rays."""
        lit = np.where(self.weight >= LEAST_LIGHT, self.weight, 0.0).astype(np.float64)
        gray = self.light.ndim == 2
        picture = np.asarray(np.repeat(self.light[..., None], 3, axis=2) if gray else self.light, dtype=np.float64)
        return self.lenslets.light_field(Image(self.scale * lit[..., None] * picture, settings=self.settings), lit)

    def write(self, path: str | Path, progress: Callable[[int, int], None] | None = None) -> None:
        """Write views and rays to an `.lf` file.

        progress : called once, at the end, with the number of views as both numbers.

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
    optics.check()
    prepared = prepare_raw(raw, white, dark=dark, grid=grid, bayer=bayer, srgb=srgb, has_glints=True)
    found, name, weight = prepared.grid, prepared.name, prepared.weight
    assert weight is not None
    lenslets = optics.lenslets(found)
    if not lenslets.holds_views:
        raise InputError(
            f"{name}: {found.width} x {found.height} pixels hold no view: of a focal length so near to the distance "
            f"from the sensor, {lenslets.overlap:.3g} microlenses in a row would see one place"
        )
    views = lenslets.views
    require_rays(name, found.width * found.height, views.rows * views.columns * views.width * views.height)
    if lenslets.kinds:
        lenslets = _order_kinds(lenslets, weight.astype(np.float64), name)
    settings = grid_settings(found, name)
    return DecodedFocused(found, lenslets, settings, prepared.notes, prepared.light, prepared.scale, weight)


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
            # A focal length that is far too short lets none through.
            alike = (seen @ said) ** 2 / (said @ said) if said.any() else 0.0
            error[kind, column] = seen @ seen - alike
    orders = list(itertools.permutations(range(COUNT)))
    errors = np.array([error[np.arange(COUNT), order].sum() for order in orders])
    best, second = np.sort(errors)[:2]
    if not second - best > _DISTINCT * second:
        raise InputError(
            f"{name}: the white picture does not tell which microlenses have which of the focal lengths: those given "
            "let nearly the same light through"
        )
    return replace(lenslets, kinds=tuple(lenslets.kinds[kind] for kind in orders[int(errors.argmin())]))
