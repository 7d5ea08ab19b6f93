"""Lenses against textbook formulas: Snell's law, focal lengths, dispersion, and worked numbers of a singlet."""

import math

import numpy as np
import pytest

from raytracer.optics.glass import AIR, CATALOGUE, LINE_C, LINE_D, LINE_F, constant_index_glass, glass_from_abbe
from raytracer.optics.lens_system.lens import Element, Lens
from raytracer.scene.assets.lenses import read_lens
from tests.optics.lens_system.kernels import backs, gone_through, parallel, unit
from tests.optics.lens_system.test_shipped_lenses import SHIPPED, every_lens

SURFACES = {
    "flat": Element(0.0, 0.0, constant_index_glass(1.7), 9.0, "flat"),
    "spherical": Element(0.05, 0.0, constant_index_glass(1.7), 9.0),
    "hollow": Element(-0.08, 0.0, constant_index_glass(1.4), 9.0),
    "conic": Element(0.06, 0.0, constant_index_glass(1.9), 9.0, "conic", conic=-2.3),
    "oblate": Element(-0.04, 0.0, constant_index_glass(1.6), 9.0, "conic", conic=1.5),
    "asphere": Element(
        0.03, 0.0, constant_index_glass(1.5), 9.0, "asphere", conic=-0.6, coefficients=(1e-5, -3e-8, 2e-10)
    ),
    "cylindrical along x": Element(0.05, 0.0, constant_index_glass(1.7), 9.0, "cylindrical", axis="x"),
    "cylindrical along y": Element(-0.05, 0.0, constant_index_glass(1.7), 9.0, "cylindrical", axis="y"),
}


def _sag(element, x, y):
    """Sags (n,) and normals (n, 3), not of length 1, by the definitions of the surfaces."""
    x, y = (np.zeros_like(a) if element.axis == name else a for name, a in (("x", x), ("y", y)))
    c, square = element.curvature, x * x + y * y
    root = np.sqrt(1.0 - (1.0 + element.conic) * c * c * square)
    powers = [a * square ** (2 + k) for k, a in enumerate(element.coefficients)]
    # By r dr, so that the middle is no exception.
    slopes = [(4.0 + 2.0 * k) * a * square ** (1 + k) for k, a in enumerate(element.coefficients)]
    slope = c / root + sum(slopes)
    sag = c * square / (1.0 + root) + sum(powers)
    return sag, np.stack([-slope * x, -slope * y, np.ones_like(x)], axis=1)


@pytest.mark.parametrize("towards_film", [True, False])
@pytest.mark.parametrize("kind", SURFACES)
def test_snells_law_in_vector_form(kind, towards_film):
    """n d x N is the same before and behind a surface: the sines by the indices, in the plane of incidence."""
    element, rng, count = SURFACES[kind], np.random.default_rng(1), 4000
    side = 1.0 if towards_film else -1.0
    origins = np.stack([*rng.uniform(-7.0, 7.0, (2, count)), np.full(count, -side * 30.0)], axis=1)
    ways = unit(np.stack([*rng.uniform(-0.25, 0.25, (2, count)), np.full(count, side)], axis=1))
    found = gone_through(Lens("a surface", (element,)), origins, ways, towards_film=towards_film)
    passed = found.weights == 1.0
    assert passed.mean() > 0.3
    points, onward, ways = found.points[passed], found.directions[passed], ways[passed]
    sag, normals = _sag(element, points[:, 0], points[:, 1])
    np.testing.assert_allclose(points[:, 2], sag, rtol=0.0, atol=1e-12)
    near, far = (1.0, float(element.glass.ior())) if towards_film else (float(element.glass.ior()), 1.0)
    normals = unit(normals)
    np.testing.assert_allclose(near * np.cross(ways, normals), far * np.cross(onward, normals), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(onward, axis=1), 1.0, rtol=0.0, atol=1e-12)
    # Refracted, not reflected.
    assert (np.sign((onward * normals).sum(axis=1)) == side).all()


@pytest.mark.parametrize("kind", SURFACES)
def test_what_misses_or_is_totally_reflected_weighs_nothing(kind):
    element, rng, count = SURFACES[kind]._replace(radius=8.0), np.random.default_rng(2), 4000
    glass = float(element.glass.ior())
    origins = np.stack([*rng.uniform(-20.0, 20.0, (2, count)), np.full(count, 20.0)], axis=1)
    ways = unit(np.stack([*rng.uniform(-3.0, 3.0, (2, count)), np.full(count, -1.0)], axis=1))
    found = gone_through(Lens("a surface", (element,)), origins, ways, towards_film=False)
    assert set(np.unique(found.weights)) == {0.0, 1.0}
    assert np.isfinite(found.points).all()
    assert np.isfinite(found.directions).all()
    passed = found.weights == 1.0
    # Those that pass are within the rim and the critical angle, and on the way that the ray had.
    points = found.points[passed]
    _, normals = _sag(element, points[:, 0], points[:, 1])
    assert (np.hypot(points[:, 0], points[:, 1]) <= 8.0 * (1.0 + 1e-12)).all()
    sines = np.linalg.norm(np.cross(ways[passed], unit(normals)), axis=1)
    assert (glass * sines <= 1.0 + 1e-12).all()
    # Of those that do not, such as meet the surface in its rim are beyond the critical angle.
    if kind == "flat":
        at = origins - origins[:, 2:] / ways[:, 2:] * ways
        within = np.hypot(at[:, 0], at[:, 1]) < 8.0
        steep = glass * np.hypot(ways[:, 0], ways[:, 1]) > 1.0
        np.testing.assert_array_equal(passed, within & ~steep)
        assert (within & steep).any()


def lens_lengths(lens):
    """Paraxial focal lengths (mm) in x and in y, by products of matrices written anew."""
    glasses = [1.0, *(float(element.glass.ior(LINE_D)) for element in lens.elements)]
    lengths = []
    for axis in (0, 1):
        height, slope = 1.0, 0.0
        for element, near, far in zip(lens.elements, glasses, glasses[1:], strict=False):
            curvature = element.quadric()[axis]
            slope = (near * slope - height * curvature * (far - near)) / far
            height += element.thickness * slope
        lengths.append(-1.0 / slope)
    return lengths


@every_lens
@pytest.mark.parametrize("axis", [0, 1])
def test_traced_focal_lengths_go_to_the_paraxial_ones(path, axis):
    """f = h / tan(u'), whose error falls with h^2: two heights tell it to the fourth order.

    At h = f / 5000 and half of that, what is left is about (1 / 5000)^4, and rounding 1e-16 * 5000.
    """
    lens = read_lens(path)
    paraxial = lens_lengths(lens)[axis]
    heights = np.array([1.0, 0.5]) * abs(paraxial) / 5000.0
    found = gone_through(lens, *parallel(heights, 100.0, axis=axis))
    assert found.weights.all()
    traced = -heights * found.directions[:, 2] / found.directions[:, axis]
    limit = (4.0 * traced[1] - traced[0]) / 3.0
    assert limit == pytest.approx(paraxial, rel=1e-6)


@every_lens
def test_first_order_data_are_those_of_rays(path):
    from raytracer.optics.lens_system.first_order import cardinal_points

    lens = read_lens(path)
    if not lens.is_round():
        pytest.skip("an anamorphic lens has two of each")
    points = cardinal_points(lens.packed())
    assert points.focal_length == pytest.approx(lens_lengths(lens)[0], rel=1e-12)
    heights = np.array([1.0, 0.5]) * abs(points.focal_length) / 5000.0
    crossing = backs(lens, heights)
    assert (4.0 * crossing[1] - crossing[0]) / 3.0 == pytest.approx(
        points.rear_focus - lens.packed().vertex[-1], rel=1e-6
    )


def test_the_achromat_brings_two_colours_together():
    """The back focus of F and C through the zone of 0.7 of its opening: f / 2000 or less apart, of a singlet's f / 60.

    They meet in one zone; nearer to the axis and farther out they part, by spherochromatism, one way and the other.
    """
    lens = read_lens(SHIPPED["achromat-100mm"])
    f = lens_lengths(lens)[0]
    rim = 0.5 * f / 4.0
    heights = np.array([1e-3, math.sqrt(0.5) * rim, rim])
    blue, yellow, red = (backs(lens, heights, wavelength=line) for line in (LINE_F, LINE_D, LINE_C))
    assert abs(red - blue)[1] < f / 2000.0
    assert (red - blue)[0] * (red - blue)[2] < 0.0
    # The secondary spectrum of ordinary glasses is about f / 2000 (Kingslake, Johnson 2010, sec. 5.5).
    assert 0.0 < (0.5 * (red + blue) - yellow)[1] < f / 1000.0


@pytest.mark.parametrize("glass", ["N-BK7", "N-SF10", "F2"])
def test_longitudinal_colour_of_a_singlet_is_f_over_v(glass):
    """delta f = f / V for a thin lens (Kingslake, Johnson 2010, sec. 5.1): to the part that n_F and n_C differ by."""
    material = CATALOGUE[glass]
    lens = Lens("singlet", (Element(1.0 / 100.0, 1e-6, material, 9.0), Element(-1.0 / 100.0, 0.0, AIR, 9.0)))
    blue, yellow, red = (float(backs(lens, np.array([1e-3]), wavelength=line)[0]) for line in (LINE_F, LINE_D, LINE_C))
    assert red - blue == pytest.approx(yellow / material.abbe(), rel=0.02)


def test_a_doublet_by_the_formulas_of_achromats_has_one_focus_for_two_colours():
    """phi_a = phi V_a / (V_a - V_b), phi_b = -phi V_b / (V_a - V_b): Kingslake, Johnson 2010, sec. 5.2."""
    crown, flint, f = glass_from_abbe(1.5168, 64.17), glass_from_abbe(1.6200, 36.37), 100.0
    apart = crown.abbe() - flint.abbe()
    powers = crown.abbe() / apart / f, -flint.abbe() / apart / f
    first = powers[0] / 2.0 / (float(crown.ior()) - 1.0)
    last = -first - powers[1] / (float(flint.ior()) - 1.0)
    lens = Lens(
        "doublet",
        (Element(first, 1e-6, crown, 9.0), Element(-first, 1e-6, flint, 9.0), Element(last, 0.0, AIR, 9.0)),
    )
    blue, yellow, red = (float(backs(lens, np.array([1e-3]), wavelength=line)[0]) for line in (LINE_F, LINE_D, LINE_C))
    assert yellow == pytest.approx(f, rel=1e-5)
    assert red == pytest.approx(blue, rel=1e-5)
    # And without the flint they are f / V of the crown's part apart.
    assert abs(red - blue) < 1e-2 * f / crown.abbe()


RADIUS, INDEX = 50.0, 1.5
SINGLET = Lens(
    "plano-convex",
    (Element(0.0, 5.0, constant_index_glass(INDEX), 12.0, "flat"), Element(-1.0 / RADIUS, 0.0, AIR, 12.0)),
)


def back_focus(h):
    """Find where parallel light at the height h crosses the axis, behind the vertex of the round side (mm)."""
    bent = np.arcsin(INDEX * h / RADIUS) - np.arcsin(h / RADIUS)
    return h / np.tan(bent) - (RADIUS - np.sqrt(RADIUS**2 - h**2))


def test_the_plano_convex_singlet():
    assert back_focus(10.0) == pytest.approx(95.41798, abs=5e-6)
    heights = np.linspace(0.01, 11.9, 60)
    np.testing.assert_allclose(backs(SINGLET, heights), back_focus(heights), rtol=0.0, atol=1e-10)
    assert backs(SINGLET, np.array([10.0]))[0] == pytest.approx(95.41798, abs=1e-5)
    # Longitudinal spherical aberration: 4.582 mm at 10 mm, and n^2 / (2 (n - 1)^2) h^2 / f near the axis.
    axis = RADIUS / (INDEX - 1.0)
    assert axis - backs(SINGLET, np.array([10.0]))[0] == pytest.approx(4.582, abs=1e-3)
    small = 0.5
    expected = INDEX**2 / (2.0 * (INDEX - 1.0) ** 2) * small**2 / axis
    assert axis - backs(SINGLET, np.array([small]))[0] == pytest.approx(expected, rel=2e-3)
    # The flat side first is the worse way round.
    turned = Lens(
        "turned", (Element(1.0 / RADIUS, 5.0, constant_index_glass(INDEX), 12.0), Element(0.0, 0.0, AIR, 12.0, "flat"))
    )
    spread = np.ptp(backs(turned, np.array([1e-3, 10.0])))
    assert spread < 0.3 * 4.582


def test_lenses_are_their_mirror_images_turned_round():
    """A focal length in air is the same from both sides, and so are rays near the axis, for every shipped lens."""
    for path in SHIPPED.values():
        lens = read_lens(path)
        if not lens.is_round():
            continue
        h = 1e-4 * abs(lens_lengths(lens)[0])
        front = gone_through(lens, *parallel(np.array([h]), 100.0))
        back = gone_through(lens, *parallel(np.array([h]), 500.0, towards_film=False), towards_film=False)
        there, here = (-h * abs(found.directions[0, 2]) / found.directions[0, 0] for found in (front, back))
        assert there == pytest.approx(here, rel=1e-6), path.stem
        assert math.isfinite(there)
