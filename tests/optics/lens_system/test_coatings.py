"""Coatings: textbook formulas of thin layers, and bare surfaces."""

import cmath
import math

import numpy as np
import pytest

from raytracer.core.fresnel import fresnel_dielectric
from raytracer.optics.lens_system.coatings import Coating, pack_coatings, reflectance
from tests.vectorised import rows, vectorised

MGF2 = Coating()


def reflected(coating, cosines, near, far, wavelength=550.0):
    """Reflectances and cosines of refraction (n, 2) of a surface, for cosines of incidence (n,)."""
    coatings = pack_coatings([coating], [near, far])
    return vectorised(reflectance)(coatings, 0, rows(np.atleast_1d(cosines)), near, far, float(wavelength))


def by_matrices(coating, angle, near, far, wavelength):
    """Unpolarised reflectance of one layer, by the characteristic matrix.

    References: Macleod 2010, "Thin-Film Optical Filters", 4th ed., sec. 2.6; Born, Wolf 1999, sec. 1.6.2.
    """
    sine = near * math.sin(angle)
    cosines = [cmath.sqrt(1.0 - (sine / index) ** 2) for index in (near, coating.ior, far)]
    phase = 2.0 * math.pi / wavelength * coating.ior * (coating.wavelength / (4.0 * coating.ior)) * cosines[1]
    total = 0.0
    for power in (1, -1):
        admittances = [index * cosine**power for index, cosine in zip((near, coating.ior, far), cosines, strict=True)]
        matrix = np.array(
            [
                [cmath.cos(phase), 1j * cmath.sin(phase) / admittances[1]],
                [1j * admittances[1] * cmath.sin(phase), cmath.cos(phase)],
            ]
        )
        b, c = matrix @ np.array([1.0, admittances[2]])
        total += 0.5 * abs((admittances[0] * b - c) / (admittances[0] * b + c)) ** 2
    return total


ANGLES = np.radians([0.0, 1.0, 20.0, 45.0, 60.0, 75.0, 89.0, 89.99])


@pytest.mark.parametrize("glass", [1.45, 1.5168, 1.7847, 2.1])
def test_head_on_at_its_wavelength_is_the_formula_of_the_quarter_wave(glass):
    # ((n0 n2 - n1^2) / (n0 n2 + n1^2))^2: Born, Wolf 1999, sec. 1.6.4, eq. 62; 1.26 % of 4.2 % of N-BK7.
    expected = ((glass - 1.38**2) / (glass + 1.38**2)) ** 2
    for near, far in ((1.0, glass), (glass, 1.0)):
        assert reflected(MGF2, 1.0, near, far)[0, 0] == pytest.approx(expected, rel=1e-13)
    assert reflected(MGF2, 1.0, 1.0, 1.5168)[0, 0] == pytest.approx(0.01285, abs=5e-5)


def test_a_layer_of_the_mean_index_leaves_nothing():
    assert reflected(Coating(550.0, math.sqrt(1.69)), 1.0, 1.0, 1.69)[0, 0] == pytest.approx(0.0, abs=1e-30)


@pytest.mark.parametrize("wavelength", [360.0, 550.0, 587.56, 700.0, 830.0])
@pytest.mark.parametrize(("near", "far"), [(1.0, 1.5168), (1.0, 1.9), (1.5168, 1.0), (1.9, 1.0)])
def test_at_any_angle_and_wavelength_it_is_that_of_the_matrices(near, far, wavelength):
    angles = [angle for angle in ANGLES if near * math.sin(angle) < far]
    expected = [by_matrices(MGF2, angle, near, far, wavelength) for angle in angles]
    found = reflected(MGF2, np.cos(angles), near, far, wavelength)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-9)
    # The layer changes how much is refracted, and not where to.
    np.testing.assert_allclose(near * np.sin(angles), far * np.sqrt(1.0 - found[:, 1] ** 2), rtol=0.0, atol=1e-7)


@pytest.mark.parametrize(("near", "far"), [(1.0, 1.5168), (1.5168, 1.0), (1.62, 1.7)])
def test_without_a_coating_it_is_fresnel(near, far):
    cosines = np.cos(ANGLES)
    expected = [fresnel_dielectric(cosine, far / near) for cosine in cosines]
    np.testing.assert_array_equal(reflected(None, cosines, near, far), expected)


@pytest.mark.parametrize("index", [1.0, 1.5168])
def test_a_layer_of_the_index_of_either_side_is_none(index):
    cosines = np.cos(ANGLES)
    for near, far in ((1.0, 1.5168), (1.5168, 1.0)):
        bare = reflected(None, cosines, near, far)
        np.testing.assert_allclose(reflected(Coating(550.0, index), cosines, near, far), bare, rtol=1e-12, atol=1e-13)


def test_beyond_the_critical_angle_everything_is_reflected():
    critical = math.asin(1.0 / 1.5168)
    found = reflected(MGF2, np.cos([critical + 1e-9, 0.5 * (critical + 1.5), 1.57]), 1.5168, 1.0)
    np.testing.assert_array_equal(found, [[1.0, 0.0]] * 3)


def test_bare_lenses_have_no_coatings():
    assert pack_coatings([None, None], [1.0, 1.5, 1.0]) is None
    packed = pack_coatings([None, MGF2], [1.0, 1.5, 1.0])
    assert packed is not None
    np.testing.assert_array_equal(packed.wavelength, [0.0, 550.0])


@pytest.mark.parametrize(
    ("coating", "ior", "words"),
    [
        (Coating(0.0), [1.0, 1.5], "surface 1 has a coating for the wavelength 0 nm"),
        (Coating(math.nan), [1.0, 1.5], "for the wavelength nan nm"),
        (Coating(550.0, 0.5), [1.0, 1.5], "of the index 0.5"),
        (MGF2, [1.0, 1.0], "no glass: the index is 1 on both sides"),
        (MGF2, [1.6, 1.5], "between two glasses"),
    ],
)
def test_what_cannot_be_coated_is_named(coating, ior, words):
    with pytest.raises(ValueError, match=words):
        pack_coatings([coating], ior)
