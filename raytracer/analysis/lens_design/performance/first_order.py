"""First-order properties of a lens, by ray transfer matrices and by real rays near the axis.

References: Gerrard, Burch 1975, "Introduction to Matrix Methods in Optics", ch. II; Smith 2008, "Modern Optical
Engineering", 4th ed., chs. 2 (cardinal points) and 9 (pupils, f-number).
"""

import math

import numpy as np

from raytracer.analysis.lens_design.performance.beams import aim_fan, axis_beam, open_stop_fraction
from raytracer.analysis.lens_design.performance.chief_rays import chief_rays_at_heights
from raytracer.analysis.lens_design.performance.illumination import largest_height
from raytracer.analysis.lens_design.performance.optical_bench import (
    MERIDIANS,
    OpticalBench,
    crossing,
    meridian_vector,
    paraxial_ray,
    vertex_curvatures,
)
from raytracer.analysis.lens_design.performance.results import Curve, FirstOrder
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces

# Height of real rays as a part of the focal length: from this and its half the quadratic part is eliminated.
_SMALL = 1e-3


def traced_focus(surfaces: LensSurfaces, focal_length: float, meridian: str = "y") -> tuple[float, float]:
    """Trace focal length and place of the rear focus (mm), of real rays in the limit of small height.

    Raises
    ------
    ValueError : the rays leave the lens parallel.
    """
    column = MERIDIANS[meridian]
    height = _SMALL * abs(focal_length) * np.array([1.0, 0.5])
    origins = meridian_vector(meridian, 0.0, height, surfaces.vertex[0])
    # The stop may be narrower than that.
    open_ = surfaces._replace(radius=np.full_like(surfaces.radius, np.inf))
    _, points, onward = trace_rays(open_, origins, np.array([0.0, 0.0, 1.0]))
    slopes = onward[:, column] / onward[:, 2]
    if not slopes.all():
        raise ValueError("parallel light leaves the lens parallel: it makes no image")
    lengths = -height / slopes / surfaces.ior[-1]
    places = points[:, 2] - points[:, column] / slopes
    return _limit(lengths), _limit(places)


def _limit(pair: Curve) -> float:
    """Extrapolate values at a height and its half to height 0."""
    return float((4.0 * pair[1] - pair[0]) / 3.0)


def petzval_curvature(surfaces: LensSurfaces, meridian: str = "y") -> float:
    """Return the curvature of the Petzval surface (1/mm); Welford 1986, ch. 8."""
    curvature, ior = vertex_curvatures(surfaces, meridian), surfaces.ior
    return float(ior[-1] * (curvature * np.diff(1.0 / ior)).sum())


def first_order(bench: OpticalBench, meridian: str = "y") -> FirstOrder:
    """Compute paraxial data at the primary wavelength.

    Raises
    ------
    ValueError : the lens has no power.
    """
    surfaces = bench.surfaces()
    last, behind = float(surfaces.vertex[-1]), float(surfaces.ior[-1])
    parallel = paraxial_ray(surfaces, 1.0, 0.0, meridian)
    tilted = paraxial_ray(surfaces, 0.0, 1.0, meridian)
    if parallel.slopes[-1] == 0.0:
        raise ValueError("parallel light leaves the lens parallel: it makes no image")
    focal_length = float(-1.0 / (behind * parallel.slopes[-1]))
    rear_focus = crossing(surfaces, parallel)
    front_focus = float(surfaces.vertex[0] + tilted.slopes[-1] / parallel.slopes[-1])
    length_traced, focus_traced = traced_focus(surfaces, focal_length, meridian)

    # Pupils: where the chief ray meets the axis on both sides, and the marginal ray's height there.
    chief = bench.chief_ray(surfaces, meridian)
    entrance, exit_ = float(surfaces.vertex[0] + chief.heights[0]), crossing(surfaces, chief)
    radius = abs(bench.marginal_ray(surfaces, meridian, math.inf).heights[0])
    marginal = bench.marginal_ray(surfaces, meridian)
    exit_radius = abs(marginal.heights[-1] + marginal.slopes[-1] * (exit_ - last)) if math.isfinite(exit_) else math.inf

    film = bench.film
    petzval = petzval_curvature(surfaces, meridian)
    largest = largest_height(bench, meridian)
    angles = _angles_of_view(bench)
    published = bench.lens.focal_length
    return FirstOrder(
        meridian=meridian,
        wavelength_nm=bench.primary,
        focal_length_mm=focal_length,
        focal_length_traced_mm=length_traced,
        focal_length_difference=length_traced / focal_length - 1.0,
        published_focal_length_mm=math.nan if published is None else published,
        back_focus_mm=rear_focus - last,
        back_focus_traced_mm=focus_traced - last,
        back_focus_difference=(focus_traced - rear_focus) / focal_length,
        front_focus_z_mm=front_focus,
        rear_focus_z_mm=rear_focus,
        front_principal_z_mm=front_focus + focal_length,
        rear_principal_z_mm=rear_focus - behind * focal_length,
        front_nodal_z_mm=front_focus + behind * focal_length,
        rear_nodal_z_mm=rear_focus - focal_length,
        entrance_pupil_z_mm=entrance,
        entrance_pupil_diameter_mm=2.0 * float(radius),
        exit_pupil_z_mm=exit_,
        exit_pupil_diameter_mm=2.0 * float(exit_radius),
        stop_z_mm=float(surfaces.vertex[bench.stop]),
        stop_diameter_mm=2.0 * bench.stop_radius,
        f_number=abs(focal_length) / (2.0 * float(radius)),
        working_f_number=working_f_number(bench, meridian),
        magnification=float(marginal.slopes[0] / (behind * marginal.slopes[-1])) + 0.0,
        film_z_mm=film,
        image_distance_mm=film - last,
        total_track_mm=film - float(surfaces.vertex[0]),
        half_field_deg=float(chief_rays_at_heights(bench, meridian, bench.primary, np.array([largest])).field_deg[0]),
        half_field_image_height_mm=largest,
        field_of_view_width_deg=angles[0],
        field_of_view_height_deg=angles[1],
        field_of_view_diagonal_deg=angles[2],
        petzval_radius_mm=1.0 / petzval if petzval else math.inf,
    )


def _angles_of_view(bench: OpticalBench) -> tuple[float, float, float]:
    """Compute the full angles of view (degrees) of the picture's width, height and diagonal.

    The last is NaN for a lens with cylinders.
    """
    width, height = bench.settings.sensor_mm
    sizes = [("y", width), ("y", height), ("y", math.hypot(width, height))]
    if not bench.lens.is_round():
        sizes = [("x", width), ("y", height)]
    angles = []
    for meridian, size in sizes:
        reach = np.array([min(size / 2.0, largest_height(bench, meridian))])
        angles.append(2.0 * float(chief_rays_at_heights(bench, meridian, bench.primary, reach).field_deg[0]))
    return angles[0], angles[1], angles[2] if len(angles) == 3 else math.nan


def working_f_number(bench: OpticalBench, meridian: str = "y") -> float:
    """Compute the working f-number, 1 / (2 n' sin u') of the outermost axial ray that passes; NaN if none does."""
    axis = axis_beam(bench, meridian)
    if axis is None:
        return math.nan
    rim = aim_fan(bench, axis, np.array([open_stop_fraction(bench, meridian)]), up=True)
    weights, _, onward = trace_rays(bench.surfaces(), *axis.rays(rim, np.zeros(1)))
    if not weights[0] > 0.0:
        return math.nan
    sine = abs(float(onward[0, MERIDIANS[meridian]]))
    return 1.0 / (2.0 * float(bench.surfaces().ior[-1]) * sine) if sine else math.inf
