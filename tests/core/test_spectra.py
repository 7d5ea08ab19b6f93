"""Colours and spectra: the tables are the published ones, and the way there and back changes no colour."""

import colour
import numpy as np
import pytest

from raytracer.core import spectra
from raytracer.core.compiler.dispatch import kernel
from raytracer.core.spectra import (
    FIRST,
    LAST,
    STEP,
    basis_at,
    companion_number,
    published_tables,
    response,
    response_at,
    sample_hero_wavelength,
    spectrum_of,
)
from raytracer.core.vec import dot
from tests.vectorised import rows, vectorised

WAVELENGTHS = np.arange(FIRST, LAST + 1.0, STEP)


@kernel
def _draw(tables, u, number):
    return sample_hero_wavelength(tables, companion_number(u, number, 3))


@kernel
def _looked_up(tables, wavelength, rgb):
    return response_at(tables, wavelength), dot(basis_at(tables, wavelength), rgb)


def drawn(u, number=0):
    """Wavelengths (nm) and densities (1/nm) that numbers draw."""
    return vectorised(_draw)(spectra.spectra(), rows(u), number).T


def test_the_tables_are_the_published_ones():
    rows = published_tables()
    np.testing.assert_array_equal(rows[:, 0], WAVELENGTHS)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    daylight = colour.SDS_ILLUMINANTS["D65"]
    primaries = colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    np.testing.assert_allclose(rows[:, 1:4], observer[WAVELENGTHS], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(rows[:, 4], daylight[WAVELENGTHS], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(rows[:, 5:], primaries[WAVELENGTHS], rtol=0.0, atol=1e-8)


def test_primaries_have_spectra_of_their_colours():
    tables = spectra.spectra()
    np.testing.assert_allclose(
        spectra.spectrum_products(tables.response, tables.basis), np.eye(3), rtol=0.0, atol=1e-12
    )


def test_the_response_is_that_of_linear_rec_709():
    # By what colour-science integrates: XYZ of a reflectance in the light of D65, and the matrix of IEC 61966-2-1.
    for rgb in ((0.8, 0.1, 0.05), (0.1, 0.6, 0.2), (0.02, 0.1, 0.7), (0.5, 0.5, 0.5)):
        values = spectrum_of(rgb, WAVELENGTHS)
        reflectance = colour.SpectralDistribution(dict(zip(WAVELENGTHS, values, strict=True)))
        xyz = colour.sd_to_XYZ(
            reflectance,
            colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(reflectance.shape),
            colour.SDS_ILLUMINANTS["D65"].copy().align(reflectance.shape),
            method="Integration",
        )
        linear = colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB @ (xyz / 100.0)
        np.testing.assert_allclose(linear, rgb, rtol=0.0, atol=4e-3)


def test_kernels_look_up_what_python_does_between_the_entries_too():
    waves, rgb = np.array([FIRST, 412.0, 551.3, 623.9, LAST - 0.1]), (0.9, 0.2, 0.4)
    seen, tint = vectorised(_looked_up)(spectra.spectra(), rows(waves), rgb)
    np.testing.assert_allclose(seen, response(waves), rtol=1e-12)
    np.testing.assert_allclose(tint, spectrum_of(rgb, waves), rtol=1e-12)


def test_grey_is_the_same_at_all_wavelengths():
    waves = np.linspace(FIRST, LAST, 1001)
    np.testing.assert_allclose(vectorised(_looked_up)(spectra.spectra(), rows(waves), (0.3,) * 3)[1], 0.3, rtol=1e-14)


def test_spectra_of_colours_are_neither_negative_nor_beyond_all():
    wavelengths = np.linspace(FIRST, LAST, 1001)
    for rgb in np.eye(3):
        assert spectrum_of(rgb, wavelengths).min() > 0.0
    assert spectrum_of((1.0, 1.0, 0.0), wavelengths).max() < 1.0


@pytest.mark.parametrize("number", [0, 1, 2])
def test_wavelengths_are_drawn_by_their_density(number):
    u = (np.arange(307_200) + 0.5) / 307_200
    wavelength, pdf = drawn(u, number)
    assert wavelength.min() >= FIRST
    assert wavelength.max() <= LAST
    # The integral of 1, and of colours of all primaries.
    assert np.mean(1.0 / pdf) == pytest.approx(LAST - FIRST, rel=1e-6)
    seen = (
        response(wavelength)[:, :, None]
        * np.stack([spectrum_of(rgb, wavelength) for rgb in np.eye(3)], axis=1)[:, None]
    )
    np.testing.assert_allclose(np.mean(seen / pdf[:, None, None], axis=0), np.eye(3), rtol=0.0, atol=1e-4)


def test_companions_lie_in_strata_of_their_own():
    u = np.random.default_rng(3).random(1000)
    edges = drawn(np.array([0.0, 1.0 / 3.0, 2.0 / 3.0]))[0]
    strata = [np.searchsorted(edges, drawn(u, number)[0], side="right") for number in range(3)]
    np.testing.assert_array_equal(np.sort(strata, axis=0), np.tile([[1], [2], [3]], 1000))


def test_three_wavelengths_show_white_with_less_noise_than_one():
    u = np.random.default_rng(5).random(100_000)
    one = [response(wavelength) / pdf[:, None] for wavelength, pdf in (drawn(u, number) for number in range(3))]
    alone, together = one[0].var(axis=0), np.mean(one, axis=0).var(axis=0)
    # Three that are drawn by themselves would have a third of it.
    assert (together < alone / 20.0).all()
