"""Distortion: image heights of chief rays against ideal projections.

References: Welford 1986, "Aberrations of Optical Systems", ch. 7; Kannala, Brandt 2006, "A Generic Camera Model
and Calibration Method", PAMI 28(8), eqs. 1 to 5 (projections).
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from raytracer.analysis.lens_design.performance.field_points import field_samples
from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench
from raytracer.analysis.lens_design.performance.paraxial import chief_ray
from raytracer.analysis.lens_design.performance.results import Curve, DistortionCurve

PROJECTIONS: Mapping[str, Callable[[Curve], Curve]] = {
    "f tan": np.tan,
    "2f tan(theta/2)": lambda angle: 2.0 * np.tan(0.5 * angle),
    "f theta": lambda angle: angle,
    "2f sin(theta/2)": lambda angle: 2.0 * np.sin(0.5 * angle),
    "f sin theta": np.sin,
}
"""Image height over focal length as a function of the angle from the axis (radians), by name."""


def distortion(bench: OpticalBench, meridian: str = "y") -> DistortionCurve:
    """Compute distortion over the field, at the primary wavelength."""
    parts, degrees, heights = field_samples(bench, meridian)
    angles = np.radians(degrees)
    scale = _scale(bench, meridian)
    percent = {name: _percent(heights, scale * ideal(angles)) for name, ideal in PROJECTIONS.items()}
    beyond = angles >= math.pi / 2.0
    for name in ("f tan", "f sin theta"):
        percent[name][beyond] = np.nan
    known = np.isfinite(angles)
    best = min(percent, key=lambda name: _worst(percent[name][known]))
    return DistortionCurve(meridian, parts, degrees, heights, percent["f tan"], percent["f theta"], best, percent[best])


def _scale(bench: OpticalBench, meridian: str) -> float:
    """Return image height over angle near the axis (mm), on the film: the focal length, if that is at the focus."""
    surfaces = bench.surfaces()
    ray = chief_ray(bench, surfaces, meridian)
    scale = -float(ray.heights[-1] + ray.slopes[-1] * (bench.film - surfaces.vertex[-1]))
    if math.isinf(bench.distance):
        return scale
    # Angles are measured from one pupil; lenses with cylinders have another in the other meridian.
    behind = float(surfaces.vertex[0] + ray.heights[0]) - bench.pupil
    return scale * bench.distance / (bench.distance + behind)


def _percent(heights: Curve, ideal: Curve) -> Curve:
    """Compare heights with ideal ones (%); 0 on the axis."""
    with np.errstate(divide="ignore", invalid="ignore"):
        percent: Curve = 100.0 * (heights / ideal - 1.0)
    percent[heights == 0.0] = 0.0
    return percent


def _worst(percent: Curve) -> float:
    """Return the largest magnitude; infinite where a value is missing, so that such a projection is never the best."""
    return float(np.abs(percent).max(initial=0.0)) if np.isfinite(percent).all() else math.inf
