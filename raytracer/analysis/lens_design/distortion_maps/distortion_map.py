"""Distortion map of a lens: between its picture and the one that an ideal projection would give.

A point of the scene is where its chief ray lands.  Ideal is the rectilinear projection, x = f tan(angle), as of a
pinhole; or, of lenses that see too wide for it, the equidistant one, f angle.  f is that of the middle of the picture,
so that both agree there.  Points on the film are millimetres from its middle, x to the right and y down in the picture.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.lens_design.distortion_maps.opencv_models import DistortionModel, fit_models
from raytracer.analysis.lens_design.distortion_maps.pixel_grid import FloatArray, PixelGrid, fitted_points
from raytracer.analysis.lens_design.distortion_maps.tables import Ideal, PointTable, quadrant_tables, radial_tables
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench

# Half field (degrees) from which on an equidistant picture is the ideal one.
_WIDE = 65.0


# Rows of a map that are made at a time, since intermediate arrays take many times their memory.
_BAND = 64


@dataclass(frozen=True)
class DistortionMap:
    """Distortion map of a lens.

    name : of the lens.
    setting : of the lens, for files.
    scale : f in x and in y (mm).
    grid : pixels of the film.
    ideal : projection that the picture is compared with.
    models : those that fit, the one to be taken first.
    missing : reasons, by the names of models that do not fit.
    """

    name: str
    setting: Mapping[str, Any]
    scale: tuple[float, float]
    grid: PixelGrid
    ideal: Ideal
    models: tuple[DistortionModel, ...]
    missing: Mapping[str, str]
    _table: "PointTable"

    def undistorted(self, points: FloatArray) -> FloatArray:
        """Map points of the film to the ideal picture (mm, (..., 2)); NaN where no light lands."""
        return self._table.ideal(np.asarray(points, np.float64))

    def distorted(self, points: FloatArray) -> FloatArray:
        """Map points of the ideal picture to the film (mm, (..., 2)); NaN where the film has none."""
        return self._table.real(np.asarray(points, np.float64))

    def camera_matrix(self) -> FloatArray:
        """Return OpenCV's camera matrix, (3, 3), in pixels."""
        (fx, fy), (cx, cy) = self.scale, self.grid.centre
        return np.array([[fx / self.grid.pitch, 0.0, cx], [0.0, fy / self.grid.pitch, cy], [0.0, 0.0, 1.0]])

    def maps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Make the maps for `cv2.remap` that undo the distortion and that make it, in pixels, (height, width, 2).

        The first has for each pixel of the ideal picture its place in the lens's, the second the reverse.
        """
        grid = self.grid
        there = np.empty((grid.height, grid.width, 2), np.float32)
        back = np.empty_like(there)
        for first in range(0, grid.height, _BAND):
            points = grid.points(first, first + _BAND)
            there[first : first + _BAND] = grid.pixels(self.distorted(points))
            back[first : first + _BAND] = grid.pixels(self.undistorted(points))
        return there, back

    def largest_px(self) -> float:
        """Return the greatest distance of a point of the film from its ideal place (pixels)."""
        edge = fitted_points(self.grid)
        moved = np.linalg.norm(self.undistorted(edge) - edge, axis=-1) / self.grid.pitch
        return float(np.nanmax(moved)) if np.isfinite(moved).any() else math.nan


def trace_distortion_map(bench: OpticalBench, width: int, *, ideal: Ideal | None = None) -> DistortionMap:
    """Trace the distortion map of a lens on the bench, and fit OpenCV's models to it.

    Parameters
    ----------
    width : pixels across the film.
    ideal : the projection to compare with; by default the rectilinear one, up to 65 degrees from the axis.

    Raises
    ------
    ValueError : no chief ray reaches the film.
    """
    across, down = bench.settings.sensor_mm
    pitch = across / width
    grid = PixelGrid(width, max(1, round(down / pitch)), pitch)
    traced = radial_tables(bench) if bench.lens.is_round() else quadrant_tables(bench)
    tables, scale, widest = traced
    chosen: Ideal = ideal or ("rectilinear" if widest < _WIDE else "equidistant")
    models, missing = fit_models(traced, grid)
    settings = bench.settings
    setting = {
        "f_number": settings.f_number,
        "focus_distance_mm": settings.focus_distance_mm,
        "sensor_mm": settings.sensor_mm,
        "wavelength_nm": bench.primary,
    }
    return DistortionMap(bench.lens.name, setting, scale, grid, chosen, models, missing, tables(chosen))
