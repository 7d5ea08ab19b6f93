"""Hard cases of glass: total reflection, equal indices, grazing angles, stacks of layers, and furnaces."""

import math

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.core.fresnel import fresnel_dielectric, refract
from raytracer.plugins.materials.principled import Principled
from tests.hard_cases.harness import Measured, hard_case
from tests.nested import picture
from tests.plugins.materials.kernels import packed_row
from tests.small_scenes import mean

Floats = NDArray[np.float64]

EPSILON = 2.0**-53
"""By how much of a number rounding changes it, at most."""

CRITICAL = math.sqrt(5.0) / 3.0
"""Cosine, inside glass of 1.5, from which on light gets out: 41.81 degrees."""

STEEPNESS = 2.0 * (1.5 / CRITICAL + 1.0 / (1.5 * CRITICAL))
"""Near the critical angle the reflectance is 1 less this times the cosine of refraction: Fresnel's equations, to first
order in that cosine."""


@entry
def _fresnel(cosines, eta, reflectances, lengths):
    for index in range(len(cosines)):
        cos_i = cosines[index]
        direction = (math.sqrt((1.0 - cos_i) * (1.0 + cos_i)), 0.0, -cos_i)
        reflectances[index], cos_t = fresnel_dielectric(cos_i, eta)
        x, y, z = refract(direction, (0.0, 0.0, 1.0), cos_i, cos_t, eta)
        # Where all is reflected nothing is refracted.
        lengths[index] = math.sqrt(x * x + y * y + z * z) if reflectances[index] < 1.0 else 1.0


def fresnel(cosines: Floats, eta: float) -> tuple[Floats, Floats]:
    """The product's reflectances, and the lengths of the directions that it refracts to."""
    reflectances, lengths = np.empty(len(cosines)), np.empty(len(cosines))
    _fresnel(np.ascontiguousarray(cosines), eta, reflectances, lengths)
    return reflectances, lengths


def by_formula(cosines: Floats, eta: float, dtype: type) -> Floats:
    """Fresnel's equations as they are in books, without any care, in an arithmetic of one's choice."""
    cos_i, eta = cosines.astype(dtype), dtype(eta)
    with np.errstate(invalid="ignore", divide="ignore"):
        cos_t = np.sqrt(1 - (1 - cos_i**2) / eta**2)
        parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
        perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
        return (parallel**2 + perpendicular**2) / 2


def schlick(cosines: Floats, eta: float) -> Floats:
    """Schlick's fit by the cosine of incidence: CGF 13(3), 1994, eq. 15."""
    head_on = ((eta - 1.0) / (eta + 1.0)) ** 2
    return head_on + (1.0 - head_on) * (1.0 - cosines) ** 5


@hard_case(18, "Hecht 2017, Optics, 5th ed., sec. 4.7; RayTracing/InOneWeekend", scene="18_snells_window.yaml")
def critical_angle(_: int) -> list[Measured]:
    """From glass into air at the critical angle, an ulp inside it, and just outside.

    Outside of it the square root is of a negative number: a naive program has NaN there.  Inside, 1 - R goes with the
    root of the distance to the critical angle.  Three roundings of the sine's square, of half an ulp each, make the
    cosine of refraction wrong by the root of 3 * 2^-53, and R by STEEPNESS times that; in float32 it is the root of
    2^29 times as much, 0.002.
    """
    fine = CRITICAL + np.arange(-1000, 1001) * np.spacing(CRITICAL)
    coarse = np.float32(CRITICAL) + np.arange(-100, 101, dtype=np.float32) * np.spacing(np.float32(CRITICAL))
    cosines = np.concatenate([fine, coarse.astype(np.float64)])
    reflectances, lengths = fresnel(cosines, 1.0 / 1.5)
    naive = by_formula(cosines, 1.0 / 1.5, np.float64)
    exact = by_formula(cosines, np.longdouble(1) / np.longdouble(1.5), np.longdouble)
    exact = np.where(np.isnan(exact), 1, exact)
    single = by_formula(cosines, 1.0 / 1.5, np.float32)
    inside = np.abs(np.where(np.isnan(single), 1, single) - exact)
    bound = STEEPNESS * math.sqrt(3.0 * EPSILON)
    return [
        Measured(
            "reflectances that are no number", float(np.isnan(naive).sum()), float(np.isnan(reflectances).sum()), 0
        ),
        Measured(
            "error of the reflectance, the naive one in float32",
            float(inside.max()),
            float(np.abs(reflectances - exact).max()),
            bound,
        ),
        # The length's square is 1 - cos_t^2 and cos_t^2 summed, each rounded a few times.
        Measured(
            "refracted directions that are not of length 1 to within 8 ulps",
            float(np.isnan(naive).sum()),
            float((np.abs(lengths - 1.0) > 16.0 * EPSILON).sum()),
            0.0,
        ),
    ]


FLOOR = "  - {type: quad, corner: [-9, -9, 0], edges: [[18, 0, 0], [0, 18, 0]], material: {type: lambertian}}\n"
LIT = (
    "camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0], vfov: 10}\n"
    "environment: {type: constant, radiance: 1.0e-12}\nobjects:\n"
    "  - {type: quad, corner: [4, -1, 5], edges: [[0, 2, 0], [2, 0, -2]], material: {type: emitter, radiance: 10}}\n"
) + FLOOR


def ball(material: str, height: float = 1.0, radius: float = 1.0) -> str:
    return f"  - {{type: sphere, center: [0, 0, {height}], radius: {radius}, material: {material}}}\n"


@hard_case(19, "pbrt-v4, FrDielectric; Schlick 1994", quick=256, thorough=16384, scene="19_no_boundary.yaml")
def equal_indices(spp: int) -> list[Measured]:
    """Glass of the index that is around it: no reflection, no shadow, and no path segment.

    The formula is 0/0 along the surface, and Schlick's fit still reflects 0.031 at 60 degrees.  A boundary that bends
    nothing still ends shadow rays and takes a segment of the path: a floor below it is black at max_depth 2.  Renders
    with and without the ball have different random numbers; four standard deviations of their difference are allowed.
    """
    cosines = np.array([0.0, 5e-324, 1e-300, 1e-16, 0.5, 1.0])
    reflectances, _ = fresnel(cosines, 1.0)
    naive = by_formula(cosines, 1.0, np.float64)
    coat = packed_row(Principled(ior=1.0, roughness=0.0))

    with_nothing, noise = mean(picture(LIT, spp=spp, max_depth=2, seed=1))
    with_ball, other = mean(picture(LIT + ball("{type: dielectric, ior: 1}"), spp=spp, max_depth=2, seed=2))
    with_boundary, _ = mean(picture(LIT + ball("{type: dielectric, ior: 1.0000001}"), spp=spp, max_depth=2, seed=2))
    share = 4.0 * np.hypot(noise, other).max() / with_nothing.max()
    return [
        Measured("reflectances that are not 0", float((naive != 0.0).sum()), float((reflectances != 0.0).sum()), 0.0),
        Measured(
            "reflectance of a coat at 60 degrees",
            float(schlick(np.array([0.5]), 1.0)[0]),
            coat.coat_base + coat.coat_rise * 0.5**5,
            0.0,
        ),
        Measured(
            "light that a ball takes from the floor below it",
            float(np.abs(with_boundary / with_nothing - 1.0).max()),
            float(np.abs(with_ball / with_nothing - 1.0).max()),
            float(share),
        ),
    ]


@hard_case(20, "Shirley, Ray Tracing in One Weekend, sec. 11.4", scene="20_inside_glass.yaml")
def exact_inside_glass(_: int) -> list[Measured]:
    """Inside glass, from straight on to the critical angle: where Schlick's fit says 0.041, 0.932 is reflected.

    The cosine of refraction is wrong by three roundings of its square, over twice itself, and the reflectance by
    STEEPNESS times that, besides eight roundings of its own.
    """
    cosines = np.linspace(0.7454, 1.0, 1000)
    reflectances, _ = fresnel(cosines, 1.0 / 1.5)
    exact = by_formula(cosines, np.longdouble(1) / np.longdouble(1.5), np.longdouble)
    refraction = np.sqrt(1.0 - (1.0 - cosines[0] ** 2) * 2.25)
    bound = STEEPNESS * 3.0 * EPSILON / (2.0 * refraction) + 8.0 * EPSILON
    return [
        Measured(
            "error of the reflectance",
            float(np.abs(schlick(cosines, 1.0 / 1.5) - exact).max()),
            float(np.abs(reflectances - exact).max()),
            float(bound),
        )
    ]


def _panes(count: int) -> str:
    """Panes of glass seen head on, before a lamp."""
    head = (
        "camera: {type: pinhole, look_from: [0, 0, 1], look_at: [0, 0, 0], vfov: 0.1}\n"
        "environment: {type: constant, radiance: 1.0e-12}\nobjects:\n"
        "  - {type: quad, corner: [-9, -9, -9], edges: [[18, 0, 0], [0, 18, 0]], "
        "material: {type: emitter, radiance: 1}}\n"
    )
    panes = (
        f"  - {{type: box, min: [-9, -9, {-1.0 - k}], max: [9, 9, {-0.5 - k}], material: {{type: dielectric}}}}\n"
        for k in range(count)
    )
    return head + "".join(panes)


@hard_case(21, "Stokes 1862, Proc. R. Soc. 11, 545", quick=1024, thorough=65536, scene="21_panes.yaml")
def pile_of_panes(spp: int) -> list[Measured]:
    """N lossless interfaces let (1 - R) / (1 + (N - 1) R) of the light through, since it goes to and fro between them.

    One that follows it straight through has (1 - R)^N: 0.721 in place of 0.75 for four panes.  Each of the samples is a
    path that reaches the lamp or not, so four standard deviations are 4 sqrt(T (1 - T) / n).  A single pane, 0.923077
    and not 0.9216, takes 4 million samples to tell.
    """
    found = []
    for panes in (4, 1) if spp > 1024 else (4,):
        interfaces, reflected = 2 * panes, 0.04
        expected = (1.0 - reflected) / (1.0 + (interfaces - 1) * reflected)
        value, _ = mean(picture(_panes(panes), spp=spp))
        naive = (1.0 - reflected) ** interfaces
        bound = 4.0 * math.sqrt(expected * (1.0 - expected) / (64 * spp))
        error = float(np.abs(value - expected).max())
        found.append(Measured(f"transmittance of {interfaces} interfaces", abs(naive - expected), error, bound))
    return found


GLASSES = {
    "glass": ball("{type: dielectric, ior: 1.5}"),
    "ice in water in glass, which overlap": ball("{type: dielectric, ior: 1.5, priority: 1}")
    + ball("{type: dielectric, ior: 1.33, priority: 2}", radius=0.8)
    + ball("{type: dielectric, ior: 1.31, priority: 3}", height=0.5, radius=0.6),
}


@hard_case(22, "white furnace: Veach 1997, thesis, sec. 3.7", quick=64, thorough=1024, scene="22_furnace.yaml")
def furnace_of_glass(spp: int) -> list[Measured]:
    """Balls of clear glass in an environment of 1 send 1 along each ray, exactly, if paths may be as long as they need.

    Paths that are cut after five segments lose light; radiance that is not carried as L / n^2 differs by a factor.
    Nothing may be lost and nothing made, so the tolerance is 0: products of ones are one.
    """
    view = (
        "camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 1], vfov: 16}\n"
        "environment: {type: constant, radiance: 1}\nobjects:\n"
    )
    found = []
    for name, objects in GLASSES.items():
        full = picture(view + objects, spp=spp, max_depth=100_000).radiance
        cut = picture(view + objects, spp=spp, max_depth=5).radiance
        naive, ours = (float(np.abs(pixels - 1.0).max()) for pixels in (cut, full))
        found.append(Measured(f"error of the brightest or darkest pixel of {name}", naive, ours, 0.0))
    return found
