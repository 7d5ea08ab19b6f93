"""How far chief rays land from where an ideal projection puts them.

References: Welford 1986, "Aberrations of Optical Systems", ch. 7; Kannala, Brandt 2006, "A Generic Camera Model
and Calibration Method", PAMI 28(8), eqs. 1 to 5 (projections).
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from raytracer.lens_report.analysis.bench import Bench
from raytracer.lens_report.analysis.fields import row
from raytracer.lens_report.analysis.paraxial import chief_ray
from raytracer.lens_report.analysis.results import Curve, Distortion

PROJECTIONS: Mapping[str, Callable[[Curve], Curve]] = {
    "f tan": np.tan,
    "2f tan(theta/2)": lambda angle: 2.0 * np.tan(0.5 * angle),
    "f theta": lambda angle: angle,
    "2f sin(theta/2)": lambda angle: 2.0 * np.sin(0.5 * angle),
    "f sin theta": np.sin,
}
"""Image height over focal length, of an angle from the axis (radians), by name."""


def distortion(bench: Bench, meridian: str = "y") -> Distortion:
    """Over the field, at the primary wavelength."""
    parts, degrees, heights = row(bench, meridian)
    angles = np.radians(degrees)
    scale = _scale(bench, meridian)
    found = {name: _percent(heights, scale * ideal(angles)) for name, ideal in PROJECTIONS.items()}
    beyond = angles >= math.pi / 2.0
    for name in ("f tan", "f sin theta"):
        found[name][beyond] = np.nan
    known = np.isfinite(angles)
    best = min(found, key=lambda name: _worst(found[name][known]))
    return Distortion(meridian, parts, degrees, heights, found["f tan"], found["f theta"], best, found[best])


def _scale(bench: Bench, meridian: str) -> float:
    """Image height over angle near the axis (mm), on the film: the focal length, if that is at the paraxial focus."""
    surfaces = bench.surfaces()
    ray = chief_ray(bench, surfaces, meridian)
    scale = -float(ray.heights[-1] + ray.slopes[-1] * (bench.film - surfaces.vertex[-1]))
    if math.isinf(bench.distance):
        return scale
    # Angles are told from one pupil; lenses with cylinders have another in the other meridian.
    behind = float(surfaces.vertex[0] + ray.heights[0]) - bench.pupil
    return scale * bench.distance / (bench.distance + behind)


def _percent(heights: Curve, ideal: Curve) -> Curve:
    with np.errstate(divide="ignore", invalid="ignore"):
        found: Curve = 100.0 * (heights / ideal - 1.0)
    found[heights == 0.0] = 0.0
    return found


def _worst(percent: Curve) -> float:
    """The largest; infinite where there is none, so that nothing is best that is not defined everywhere."""
    return float(np.abs(percent).max(initial=0.0)) if np.isfinite(percent).all() else math.inf
