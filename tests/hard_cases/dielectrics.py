"""Hard cases of glass: total reflection, equal indices, grazing angles, stacks of layers, and furnaces."""

import math

import numpy as np

from raytracer.core.fresnel import fresnel_dielectric, refract
from raytracer.plugins.materials.principled import Principled
from tests.hard_cases.harness import ROUNDING, hard_case
from tests.nested import picture
from tests.plugins.materials.kernels import packed_row
from tests.small_scenes import mean
from tests.vectorised import rows, vectorised

CRITICAL = math.sqrt(5.0) / 3.0
"""Cosine, inside glass of 1.5, from which on light gets out: 41.81 degrees."""

STEEPNESS = 2.0 * (1.5 / CRITICAL + 1.0 / (1.5 * CRITICAL))
"""Near the critical angle the reflectance is 1 less this times the cosine of refraction: Fresnel's equations, to first
order in that cosine."""


def fresnel(cosines, eta):
    """The product's reflectances (n,), and cosines (n,) of refraction."""
    return vectorised(fresnel_dielectric)(rows(cosines), eta).T


def by_formula(cosines, eta, dtype):
    """Fresnel's equations as they are in books, without any care, in an arithmetic of one's choice."""
    cos_i, eta = cosines.astype(dtype), dtype(eta)
    cos_t = np.sqrt(1 - (1 - cos_i**2) / eta**2)
    parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return (parallel**2 + perpendicular**2) / 2


def schlick(cosines, eta):
    """Schlick's fit by the cosine of incidence: CGF 13(3), 1994, eq. 15."""
    head_on = ((eta - 1.0) / (eta + 1.0)) ** 2
    return head_on + (1.0 - head_on) * (1.0 - cosines) ** 5


@hard_case(18, "Hecht 2017, Optics, 5th ed., sec. 4.7; RayTracing/InOneWeekend", "snells_window")
def critical_angle(_):
    """From glass into air at the critical angle, an ulp inside it, and just outside.

    Outside of it the square root is of a negative number: a naive program has NaN there.  Inside, 1 - R goes with the
    root of the distance to the critical angle.  Three roundings of the sine's square, of half an ulp each, make the
    cosine of refraction wrong by the root of 3 * 2^-53, and R by STEEPNESS times that; in float32 it is the root of
    2^29 times as much, 0.002.
    """
    fine = CRITICAL + np.arange(-1000, 1001) * np.spacing(CRITICAL)
    coarse = np.float32(CRITICAL) + np.arange(-100, 101, dtype=np.float32) * np.spacing(np.float32(CRITICAL))
    cosines = np.concatenate([fine, coarse.astype(np.float64)])
    reflectances, cos_t = fresnel(cosines, 1.0 / 1.5)
    ways = np.stack([np.sqrt((1.0 - cosines) * (1.0 + cosines)), 0.0 * cosines, -cosines], axis=1)
    refracted = vectorised(refract)(rows(ways), (0.0, 0.0, 1.0), rows(cosines), rows(cos_t), 1.0 / 1.5)
    naive = np.isnan(by_formula(cosines, 1.0 / 1.5, np.float64))
    exact = by_formula(cosines, np.longdouble(1) / np.longdouble(1.5), np.longdouble)
    exact, single = (np.where(np.isnan(r), 1, r) for r in (exact, by_formula(cosines, 1.0 / 1.5, np.float32)))
    yield "reflectances that are no number", naive, np.isnan(reflectances)
    bound = STEEPNESS * math.sqrt(3.0 * ROUNDING)
    yield "error of the reflectance, the naive one in float32", single - exact, reflectances - exact, bound
    # The length's square is 1 - cos_t^2 and cos_t^2 summed, each rounded a few times; all reflected, none is refracted.
    wrong = (reflectances < 1.0) & ~(np.abs(np.linalg.norm(refracted, axis=1) - 1.0) <= 16.0 * ROUNDING)
    yield "refracted directions that are not of length 1 to within 8 ulps", naive, wrong


FLOOR = "  - {type: quad, corner: [-9, -9, 0], edges: [[18, 0, 0], [0, 18, 0]], material: {type: lambertian}}\n"
LIT = (
    "camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0], vfov: 10}\n"
    "environment: {type: constant, radiance: 1.0e-12}\nobjects:\n"
    "  - {type: quad, corner: [4, -1, 5], edges: [[0, 2, 0], [2, 0, -2]], material: {type: emitter, radiance: 10}}\n"
) + FLOOR


def ball(keys, height=1.0, radius=1.0):
    glass = f"{{type: dielectric, {keys}}}"
    return f"  - {{type: sphere, center: [0, 0, {height}], radius: {radius}, material: {glass}}}\n"


@hard_case(19, "pbrt-v4, FrDielectric; Schlick 1994", "no_boundary", quick=256, thorough=16384)
def equal_indices(spp):
    """Glass of the index that is around it: no reflection, no shadow, and no path segment.

    The formula is 0/0 along the surface, and Schlick's fit still reflects 0.031 at 60 degrees.  A boundary that bends
    nothing still ends shadow rays and takes a segment of the path: a floor below it is black at max_depth 2.  Renders
    with and without the ball have different random numbers; four standard deviations of their difference are allowed.
    """
    cosines = np.array([0.0, 5e-324, 1e-300, 1e-16, 0.5, 1.0])
    reflectances, _ = fresnel(cosines, 1.0)
    yield "reflectances that are not 0", by_formula(cosines, 1.0, np.float64) != 0.0, reflectances != 0.0
    coat = packed_row(Principled(ior=1.0, roughness=0.0))
    yield "reflectance of a coat at 60 degrees", schlick(0.5, 1.0), coat.coat_base + coat.coat_rise * 0.5**5

    nothing, noise = mean(picture(LIT, spp=spp, max_depth=2, seed=1))
    with_ball, other = mean(picture(LIT + ball("ior: 1"), spp=spp, max_depth=2, seed=2))
    boundary, _ = mean(picture(LIT + ball("ior: 1.0000001"), spp=spp, max_depth=2, seed=2))
    share = 4.0 * np.hypot(noise, other).max() / nothing.max()
    yield "light that a ball takes from the floor below it", boundary / nothing - 1.0, with_ball / nothing - 1.0, share


@hard_case(20, "Shirley, Ray Tracing in One Weekend, sec. 11.4", "inside_glass")
def exact_inside_glass(_):
    """Inside glass, from straight on to the critical angle: where Schlick's fit says 0.041, 0.932 is reflected.

    The cosine of refraction is wrong by three roundings of its square, over twice itself, and the reflectance by
    STEEPNESS times that, besides eight roundings of its own.
    """
    cosines = np.linspace(0.7454, 1.0, 1000)
    reflectances, _ = fresnel(cosines, 1.0 / 1.5)
    exact = by_formula(cosines, np.longdouble(1) / np.longdouble(1.5), np.longdouble)
    refraction = np.sqrt(1.0 - (1.0 - cosines[0] ** 2) * 2.25)
    bound = STEEPNESS * 3.0 * ROUNDING / (2.0 * refraction) + 8.0 * ROUNDING
    yield "error of the reflectance", schlick(cosines, 1.0 / 1.5) - exact, reflectances - exact, bound


PANES = (
    "camera: {type: pinhole, look_from: [0, 0, 1], look_at: [0, 0, 0], vfov: 0.1}\n"
    "environment: {type: constant, radiance: 1.0e-12}\nobjects:\n"
    "  - {type: quad, corner: [-9, -9, -9], edges: [[18, 0, 0], [0, 18, 0]], material: {type: emitter, radiance: 1}}\n"
)
"""A lamp, before which there are panes of glass, seen head on."""


@hard_case(21, "Stokes 1862, Proc. R. Soc. 11, 545", "panes", quick=1024, thorough=65536)
def pile_of_panes(spp):
    """N lossless interfaces let (1 - R) / (1 + (N - 1) R) of the light through, since it goes to and fro between them.

    One that follows it straight through has (1 - R)^N: 0.721 in place of 0.75 for four panes.  Each of the samples is a
    path that reaches the lamp or not, so four standard deviations are 4 sqrt(T (1 - T) / n).  A single pane, 0.923077
    and not 0.9216, takes 4 million samples to tell.
    """
    pane = "  - {{type: box, min: [-9, -9, {}], max: [9, 9, {}], material: {{type: dielectric}}}}\n"
    for panes in (4, 1) if spp > 1024 else (4,):
        interfaces, reflected = 2 * panes, 0.04
        expected = (1.0 - reflected) / (1.0 + (interfaces - 1) * reflected)
        value, _ = mean(picture(PANES + "".join(pane.format(-1.0 - k, -0.5 - k) for k in range(panes)), spp=spp))
        errors = (found - expected for found in ((1.0 - reflected) ** interfaces, value))
        bound = 4.0 * math.sqrt(expected * (1.0 - expected) / (64 * spp))
        yield f"transmittance of {interfaces} interfaces", *errors, bound


FURNACE = (
    "camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 1], vfov: 16}\n"
    "environment: {type: constant, radiance: 1}\nobjects:\n"
    "  - {type: quad, corner: [0, -93, 0], edges: [[1e-9, 0, 0], [0, 0, 1e-9]], "
    "material: {type: emitter, radiance: 1}}\n"
)
"""With a speck of a lamp, as others of these scenes have one, so that they share a kernel."""

GLASSES = {
    "glass": ball("ior: 1.5"),
    "ice in water in glass, which overlap": ball("ior: 1.5, priority: 1")
    + ball("ior: 1.33, priority: 2", radius=0.8)
    + ball("ior: 1.31, priority: 3", height=0.5, radius=0.6),
}


@hard_case(22, "white furnace: Veach 1997, thesis, sec. 3.7", "furnace", quick=64, thorough=1024)
def furnace_of_glass(spp):
    """Balls of clear glass in an environment of 1 send 1 along each ray, exactly, if paths may be as long as they need.

    Paths that are cut after five segments lose light; radiance that is not carried as L / n^2 differs by a factor.
    Nothing may be lost and nothing made, so the tolerance is 0: products of ones are one.
    """
    for name, objects in GLASSES.items():
        errors = (picture(FURNACE + objects, spp=spp, max_depth=depth).radiance - 1.0 for depth in (5, 100_000))
        yield f"error of the brightest or darkest pixel of {name}", *errors
