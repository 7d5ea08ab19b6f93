"""Microlens grid of a camera, the JSON file that holds it, and the optics, without which views have no metres."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from raytracer.film.light_field.lattice import Lattice
from raytracer.film.light_field.resampling import Resampler
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.formats.geometry import regular_grid
from raytracer.schema.units import METRES_PER_MILLIMETRE
from raytracer.util.errors import InputError
from raytracer.util.safe_open import read_json

_LARGEST_FILE, _LARGEST_NUMBER = 1 << 20, 1e9
"""Most bytes of a file with a grid, and most pixels of its lengths: far above those of any camera."""


@dataclass(frozen=True)
class Grid:
    """Grid of microlenses of a camera.

    Attributes
    ----------
    lattice : centres of the sub-images, counted from the one nearest to the picture's middle.
    width, height : pixels of the raw pictures.
    residual : distance of sub-images from the lattice (raw pixels, RMS of those that were used).
    microlenses : number of those that were used, and of those that were measured.
    diameter : of a sub-image (raw pixels): of the disc as large as the part that is at least half as bright as its
        middle.
    """

    lattice: Lattice
    width: int
    height: int
    residual: float = 0.0
    microlenses: tuple[int, int] = (0, 0)
    diameter: float = 0.0

    @property
    def layout(self) -> str:
        """Layout of the microlenses: `square` or `hexagonal`."""
        return "hexagonal" if self.lattice.hexagonal else "square"

    def as_dict(self) -> dict[str, Any]:
        """Convert to JSON values: lengths in raw pixels, right and down from the top left corner, angles in degrees."""
        lattice = self.lattice
        return {
            "layout": self.layout,
            "pitch": lattice.pitch,
            "rotation": lattice.rotation,
            "offset": list(lattice.origin),
            "along": list(lattice.along),
            "across": list(lattice.across),
            "diameter": self.diameter,
            "residual": self.residual,
            "microlenses_used": self.microlenses[0],
            "microlenses_measured": self.microlenses[1],
            "width": self.width,
            "height": self.height,
        }


def grid_from_dict(values: Mapping[str, Any], name: str) -> Grid:
    """Read a grid from the values of `Grid.as_dict`; an InputError, which begins with `name`, says what is wrong."""

    def vector(key: str) -> tuple[float, float]:
        pair = values.get(key)
        if not (isinstance(pair, list | tuple) and len(pair) == 2):
            raise InputError(f"{name}: {key}: must be two numbers, right and down in pixels")
        return number(key, pair[0]), number(key, pair[1])

    def number(key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST_NUMBER:
            raise InputError(f"{name}: {key}: must be a number, of at most {_LARGEST_NUMBER:g} pixels")
        return float(value)

    if not isinstance(values, Mapping):
        raise InputError(f"{name}: a grid is a JSON object with offset, along, across, width and height")
    missing = [key for key in ("offset", "along", "across", "width", "height") if key not in values]
    if missing:
        raise InputError(f"{name}: {missing[0]} is missing: a grid has offset, along, across, width and height")
    try:
        lattice = Lattice(vector("offset"), vector("along"), vector("across"))
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if lattice.pitch < 1.0 or lattice.area < 1.0:
        raise InputError(f"{name}: along, across: microlenses must be at least a pixel apart")
    width, height = number("width", values["width"]), number("height", values["height"])
    diameter = number("diameter", values.get("diameter", lattice.pitch))
    return Grid(lattice, int(width), int(height), number("residual", values.get("residual", 0.0)), (0, 0), diameter)


def read_grid(path: str | Path) -> Grid:
    """Read a grid from a JSON file, as `rt lightfield decode --json` prints it.

    Raises
    ------
    InputError : the file is missing, or holds no grid.
    """
    return grid_from_dict(read_json(Path(path), _LARGEST_FILE), str(path))


_METRES_PER_MICROMETRE = 1e-6


@dataclass(frozen=True)
class Optics:
    """Optics of a camera with microlenses at the distance of the image, as far as they are known.

    Attributes
    ----------
    pixel_pitch : distance of the sensor's pixels (um).
    focal_length : of the main lens (mm).
    f_number : of the main lens.
    microlens_distance : from the microlenses to the sensor (um), which is their focal length; by default what makes
        the aperture of the f-number as large as sub-images are.
    focus_distance : of the plane that is sharp on the microlenses, from the lens (m); by default infinity, or what a
        photograph's metadata say.
    """

    pixel_pitch: float | None = None
    focal_length: float | None = None
    f_number: float | None = None
    microlens_distance: float | None = None
    focus_distance: float | None = None

    @property
    def missing(self) -> str:
        """Lengths that are missing for metres, as a phrase; empty if none is."""
        needed = {"the pitch of the sensor's pixels": self.pixel_pitch, "the lens's focal length": self.focal_length}
        names = [name for name, value in needed.items() if value is None]
        if self.f_number is None and self.microlens_distance is None:
            names.append("its f-number or the distance of the microlenses to the sensor")
        return ", ".join(names[:-1]) + (" and " if names[1:] else "") + "".join(names[-1:])

    def views(self, grid: Grid, resampler: Resampler) -> Views:
        """Compute the geometry of the views that `resampler` makes: in metres, or else in steps of one view.

        Raises ValueError: no lens is sharp so near, or none has its exit pupil there.
        """
        steps = regular_grid(resampler.count, resampler.count)
        if self.missing:
            plane = Plane(1.0, -0.5 * resampler.width, 0.5 * resampler.height)
            return Views(steps, plane, resampler.width, resampler.height, cell=(1.0, 1.0), aperture=grid.diameter)

        assert self.pixel_pitch is not None
        assert self.focal_length is not None
        focal_length, pitch = self.focal_length * METRES_PER_MILLIMETRE, self.pixel_pitch * _METRES_PER_MICROMETRE
        inverse_focus = 0.0 if self.focus_distance is None else 1.0 / self.focus_distance
        image, pupil = self._image_and_pupil(focal_length, inverse_focus)

        # A pixel sees through its microlens's middle: similar triangles give its place on the main lens.
        if self.microlens_distance is not None:
            behind = self.microlens_distance * _METRES_PER_MICROMETRE
            on_lens = pitch * image / behind
        else:
            assert self.f_number is not None
            on_lens = focal_length / self.f_number / grid.diameter
            behind = pitch * image / on_lens
        aperture = grid.diameter * on_lens if self.f_number is None else focal_length / self.f_number

        # Sub-images are spread by 1 + behind / pupil, as they are seen from the main lens (Ng 2006, sec. 3.3).
        spread = 1.0 + behind / pupil
        # Microlenses are 1 / spread as far apart as their sub-images, which is less than a sensor.
        if not grid.lattice.pitch < spread * resampler.raw_width < math.inf:
            raise ValueError(
                f"exitPupilOffset.z of its metadata, an exit pupil {pupil:g} m before the microlenses, does not go "
                f"with a sensor {behind:g} m behind them"
            )
        tangent = pitch / spread / image
        half = 0.5 * resampler.pixel
        left = (resampler.first[0] - half - 0.5 * resampler.raw_width) * tangent
        top = (0.5 * resampler.raw_height - resampler.first[1] + half) * tangent
        return Views(
            steps * on_lens,
            Plane(resampler.pixel * tangent, left, top),
            resampler.width,
            resampler.height,
            inverse_focus=inverse_focus,
            cell=(on_lens, on_lens),
            aperture=aperture,
            focal_length=self.focal_length,
        )

    def _image_and_pupil(self, focal_length: float, inverse_focus: float) -> tuple[float, float]:
        """Compute the image distance of a thin lens, and the distance from the exit pupil to the microlenses (m).

        A thin lens is its own exit pupil.  Raises ValueError: the plane that is sharp is within the focal length.
        """
        inverse_image = 1.0 / focal_length - inverse_focus
        if not inverse_image > 0.0:
            distance = 1.0 / inverse_focus
            raise ValueError(
                f"the focus distance, {distance:g} m, must be more than the focal length, {focal_length:g} m"
            )
        return 1.0 / inverse_image, 1.0 / inverse_image
