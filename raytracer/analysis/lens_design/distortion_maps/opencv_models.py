"""OpenCV's models of distortion, and their fit to traced rays.

References: OpenCV 4, "Camera Calibration and 3D Reconstruction" and "Fisheye camera model"; Brown 1966, "Decentering
Distortion of Lenses"; Kannala, Brandt 2006, "A Generic Camera Model and Calibration Method for Conventional,
Wide-Angle, and Fish-Eye Lenses".
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from raytracer.analysis.lens_design.distortion_maps.tables import (
    GRAZING,
    FloatArray,
    PixelGrid,
    TracedTables,
    fitted_points,
    scale_radially,
)

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

    Parameters
    ----------
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
