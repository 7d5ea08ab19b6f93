"""Distortion map of a lens: between its picture and the one that an ideal projection would give.

A point of the scene is where its chief ray lands.  Ideal is the rectilinear projection, x = f tan(angle), as of a
pinhole; or, of lenses that see too wide for it, the equidistant one, f angle.  f is that of the middle of the picture,
so that both agree there.  Points on the film are millimetres from its middle, x to the right and y down in the picture.

References: OpenCV 4, "Camera Calibration and 3D Reconstruction" and "Fisheye camera model"; Brown 1966, "Decentering
Distortion of Lenses"; Kannala, Brandt 2006, "A Generic Camera Model and Calibration Method for Conventional,
Wide-Angle, and Fish-Eye Lenses".
"""

import io
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.lens_design.distortion_maps.tables import (
    GRAZING,
    FloatArray,
    Ideal,
    PixelGrid,
    PointTable,
    TracedTables,
    fitted_points,
    quadrant_tables,
    radial_tables,
    scale_radially,
)
from raytracer.analysis.lens_design.performance.lens_study import to_plain
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench

# Greatest half field (degrees) of a pinhole's model.
_WIDEST_PINHOLE = 80.0

# A model with a smaller error (pixels) is good enough, and the order of preference.
_FINE_PX = 0.1
_PLAINEST = ("pinhole", "fisheye", "rational")


_Distort = Callable[[FloatArray], FloatArray]
"""Function of a model's coefficients."""


class DistortionModel(NamedTuple):
    """Model of OpenCV's, fitted to a lens.

    name : "pinhole" (k1, k2, p1, p2, k3), "rational" (k1, k2, p1, p2, k3, k4, k5, k6) or "fisheye" (k1 ... k4).
    coefficients : in OpenCV's order.
    rms_px, largest_px : distance of its points from those of traced chief rays (pixels).
    """

    name: str
    coefficients: FloatArray
    rms_px: float
    largest_px: float


def pinhole(coefficients: FloatArray, points: FloatArray) -> FloatArray:
    """Distort points x / z, y / z (..., 2) as OpenCV does, by k1, k2, p1, p2, k3[, k4, k5, k6]."""
    k1, k2, p1, p2, k3, k4, k5, k6 = np.concatenate([coefficients, np.zeros(8 - len(coefficients))])
    x, y = points[..., 0], points[..., 1]
    s = x * x + y * y
    radial = (1.0 + s * (k1 + s * (k2 + s * k3))) / (1.0 + s * (k4 + s * (k5 + s * k6)))
    across = x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x)
    down = y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([across, down], axis=-1)


def fisheye(coefficients: FloatArray, angles: FloatArray) -> FloatArray:
    """Map angles (radians) to OpenCV's distances from the middle, for f = 1, by k1 to k4."""
    k1, k2, k3, k4 = coefficients
    s = angles * angles
    return np.asarray(angles * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))))


def fit_models(traced: TracedTables, grid: PixelGrid) -> tuple[tuple[DistortionModel, ...], dict[str, str]]:
    """Fit all models to traced rays.

    Returns
    -------
    The models, the one to be taken first, and the reasons for which others are missing.
    """
    tables, scale, widest = traced
    points = fitted_points(grid)
    seen = tables("equidistant").ideal(points) / np.array(scale)
    lit = np.isfinite(seen).all(axis=1)
    points, seen = points[lit], seen[lit]
    angles = np.linalg.norm(seen, axis=1)
    real = points / np.array(scale)
    focal = np.array(scale) / grid.pitch

    def fit(name: str, free: tuple[int, ...], radius: float, model: _Distort) -> DistortionModel:
        return _fit(name, free, radius, lambda values: np.asarray((model(values) - real) * focal))

    models: dict[str, DistortionModel] = {}
    missing: dict[str, str] = {}
    radius = max(float(angles.max()), GRAZING)
    models["fisheye"] = fit("fisheye", (0, 1, 2, 3), radius, lambda k: _in_directions(seen, fisheye(k, angles)))
    if widest > _WIDEST_PINHOLE:
        reason = f"the lens sees {widest:.1f}° from the axis, and a pinhole's model ends before 90°"
        missing |= {"pinhole": reason, "rational": reason}
    else:
        tangent = _in_directions(seen, np.tan(angles))
        radius = math.tan(radius)
        models["pinhole"] = fit("pinhole", (0, 1, 4), radius, lambda k: pinhole(k, tangent))
        models["rational"] = fit("rational", (0, 1, 4, 5, 6, 7), radius, lambda k: pinhole(k, tangent))

    # The simplest model that is good enough, or about as good as the best.
    least = min(model.rms_px for model in models.values())
    by_simplicity = sorted(models.values(), key=lambda model: _PLAINEST.index(model.name))
    first = next(model for model in by_simplicity if model.largest_px <= _FINE_PX or model.rms_px <= 1.1 * least)
    return (first, *(model for model in models.values() if model is not first)), missing


def _in_directions(seen: FloatArray, lengths: FloatArray) -> FloatArray:
    """Move points along their directions from the middle, to other distances."""
    return scale_radially(seen, np.linalg.norm(seen, axis=-1), lengths)


_POWERS = {"fisheye": (1, 2, 3, 4), "pinhole": (1, 2, 0, 0, 3), "rational": (1, 2, 0, 0, 3, 1, 2, 3)}
"""Power of the squared radius that each coefficient multiplies."""


def _fit(name: str, free: tuple[int, ...], radius: float, error_px: _Distort) -> DistortionModel:
    """Fit the free coefficients by least squares of pixels; a lens that is centred has no tangential ones.

    radius : of the outermost points.
    error_px : errors (n, 2), in pixels, of the points by the coefficients.
    """
    from scipy.optimize import least_squares

    # Coefficients are scaled by their effect at the corner, so that they are alike in size.
    powers = _POWERS[name]
    units = np.array([radius ** (-2.0 * powers[index]) for index in free])

    def spread(values: FloatArray) -> FloatArray:
        whole = np.zeros(len(powers))
        whole[list(free)] = units * values
        return whole

    def missed(values: FloatArray) -> FloatArray:
        return np.asarray(error_px(spread(values)).ravel())

    best = least_squares(missed, np.zeros(len(free)), method="trf", xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=300)
    off = np.linalg.norm(missed(best.x).reshape(-1, 2), axis=1)
    return DistortionModel(name, spread(best.x), float(np.sqrt(np.mean(off**2))), float(off.max()))


# ---- Maps

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
