"""Distortion map of a lens: between its picture and the one that an ideal projection would give.

A point of the scene is where its chief ray lands.  Ideal is the rectilinear projection, x = f tan(angle), as of a
pinhole; or, of lenses that see too wide for it, the equidistant one, f angle.  f is that of the middle of the picture,
so that both agree there.  Points on the film are millimetres from its middle, x to the right and y down in the picture.
"""

import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.lens_design.distortion_maps.opencv_models import DistortionModel, fit_models
from raytracer.analysis.lens_design.distortion_maps.tables import (
    FloatArray,
    Ideal,
    PixelGrid,
    PointTable,
    fitted_points,
    quadrant_tables,
    radial_tables,
)
from raytracer.analysis.lens_design.performance.lens_study import to_plain
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


# ---- Files: JSON values, NumPy's archive, OpenCV's YAML, and text for a terminal


def as_dict(distortion: DistortionMap) -> dict[str, Any]:
    """Convert all but the maps to JSON values."""
    radii = np.linspace(
        0.0, 0.5 * distortion.grid.pitch * math.hypot(distortion.grid.width, distortion.grid.height), 65
    )
    across = np.stack([radii, np.zeros_like(radii)], axis=-1)
    content = {
        "lens": distortion.name,
        **distortion.setting,
        "ideal": distortion.ideal,
        "image_width": distortion.grid.width,
        "image_height": distortion.grid.height,
        "pixel_mm": distortion.grid.pitch,
        "focal_length_mm": distortion.scale,
        "camera_matrix": distortion.camera_matrix(),
        "largest_px": distortion.largest_px(),
        "models": [model._asdict() for model in distortion.models],
        "missing": dict(distortion.missing),
        "film_mm": radii,
        "ideal_mm": distortion.undistorted(across)[:, 0],
    }
    values: dict[str, Any] = to_plain(content)
    return values


def to_npz(distortion: DistortionMap) -> bytes:
    """Write maps and models as NumPy's archive.

    `map_x`, `map_y`, `inverse_x`, `inverse_y` are float32 (height, width), as `cv2.remap` takes them.
    """
    there, back = distortion.maps()
    arrays: dict[str, Any] = {
        "map_x": there[..., 0],
        "map_y": there[..., 1],
        "inverse_x": back[..., 0],
        "inverse_y": back[..., 1],
        "camera_matrix": distortion.camera_matrix(),
        **{model.name: model.coefficients for model in distortion.models},
        "about": np.array(json.dumps(as_dict(distortion), allow_nan=False)),
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def to_opencv_yaml(distortion: DistortionMap) -> bytes:
    """Write the first model as `cv2.FileStorage` reads it."""
    model = distortion.models[0]
    lines = [
        "%YAML:1.0",
        "---",
        f"lens: {json.dumps(distortion.name)}",
        f"image_width: {distortion.grid.width}",
        f"image_height: {distortion.grid.height}",
        f"distortion_model: {model.name}",
        *_matrix("camera_matrix", distortion.camera_matrix()),
        *_matrix("distortion_coefficients", model.coefficients[None, :]),
        f"rms_px: {model.rms_px!r}",
        f"largest_px: {model.largest_px!r}",
    ]
    return ("\n".join(lines) + "\n").encode()


def _matrix(name: str, values: FloatArray) -> list[str]:
    """Write a matrix as lines of OpenCV's YAML."""
    rows, columns = values.shape
    numbers = ", ".join(repr(float(value)) for value in values.ravel())
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {columns}",
        "   dt: d",
        f"   data: [ {numbers} ]",
    ]


def to_text(distortion: DistortionMap) -> str:
    """Describe a distortion map for a terminal."""
    (fx, fy), grid = distortion.scale, distortion.grid
    f = f"{fx:.6g} mm" if fx == fy else f"{fx:.6g} mm across and {fy:.6g} mm down"
    lines = [
        distortion.name,
        f"{grid.width} x {grid.height} pixels of {1000.0 * grid.pitch:.4g} µm",
        f"against the {distortion.ideal} projection, principal distance {f}",
        f"the farthest that a point of the film is off: {distortion.largest_px():.4g} px",
    ]
    for number, model in enumerate(distortion.models):
        names = {4: "k1 k2 k3 k4", 5: "k1 k2 p1 p2 k3", 8: "k1 k2 p1 p2 k3 k4 k5 k6"}[len(model.coefficients)].split()
        numbers = "  ".join(f"{n} = {value:.9g}" for n, value in zip(names, model.coefficients, strict=True))
        chosen = ", which is taken" if number == 0 and len(distortion.models) > 1 else ""
        lines += [
            f"{model.name}: off by {model.rms_px:.3g} px RMS, {model.largest_px:.3g} px at most{chosen}",
            f"  {numbers}",
        ]
    lines += [f"no {name}: {reason}" for name, reason in distortion.missing.items()]
    return "\n".join(lines) + "\n"
