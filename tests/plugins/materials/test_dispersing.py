"""Glass whose index depends on the wavelength: where it sends light, how often, and how it is put together."""

import math

import numpy as np
import pytest

from raytracer.core.fresnel import fresnel_dielectric
from raytracer.core.geometry import Site
from raytracer.core.spectra import TERMINATE_ON_HIT, TERMINATE_ON_REFRACTION, PathWavelengths, basis_at, spectra
from raytracer.optics.glass import CATALOGUE, parse_glass
from raytracer.plugins.materials.base.clear import eta_at, pack_dispersion
from raytracer.plugins.materials.base.interface import row
from raytracer.plugins.materials.dielectric import Dielectric, DielectricRow
from raytracer.plugins.materials.rough_dielectric import RoughDielectric
from raytracer.plugins.materials.thin_dielectric import ThinDielectric
from raytracer.plugins.textures.base.interface import ParameterPacker
from tests.plugins.materials.kernels import UP, evaluate_row, incoming, scatter_row
from tests.vectorised import rows, vectorised

WAVES = (450.0, 550.0, 650.0)


def hue_of(*wavelengths, number=0):
    """Light of one wavelength or three (nm), of which one is refracted."""
    waves = (*wavelengths, *wavelengths, *wavelengths)[:3]
    return PathWavelengths(
        float(len(wavelengths)), np.int64(number), waves, *(basis_at(spectra(), wavelength) for wavelength in waves)
    )


def site_of(*wavelengths, distance=1.0, number=0):
    return Site((0.0, 0.0, 0.0), 0.0, 0.0, distance, hue_of(*wavelengths, number=number))


def row_of(spec, site, *others):
    return row(type(spec).pack([spec, *others], ParameterPacker()), 0, None, site)


def scattered(material, direction, count, front=True, normal=UP):
    return scatter_row(material, direction, count, front=front, seed=7, normal=normal)


@pytest.mark.parametrize("wavelength", [400.0, 486.1327, 587.5618, 706.5188])
def test_a_prism_bends_light_by_the_formula_of_least_deviation(wavelength):
    apex = math.radians(60.0)
    index = float(CATALOGUE["N-SF11"].ior(wavelength))
    incidence = math.asin(index * math.sin(apex / 2.0))
    prism = row_of(Dielectric(ior="N-SF11"), site_of(wavelength))
    # Through the first face, whose normal is z; and out of the second one, at which the prism is 60 degrees thick.
    direction = (math.sin(incidence), 0.0, -math.cos(incidence))
    within = next(tuple(out) for out in scattered(prism, direction, 100)[0] if out[2] < 0.0)
    second = (-math.sin(apex), 0.0, math.cos(apex))
    assert np.dot(within, second) < 0.0
    result = scattered(prism, within, 50, False, second)[0]
    out = result[result @ second < 0.0][0]
    deviation = math.acos(np.clip(np.dot(direction, out), -1.0, 1.0))
    # The table of indices is linear between half nanometres.
    assert deviation == pytest.approx(2.0 * incidence - apex, abs=3e-6)


@pytest.mark.parametrize("name", [name for name, glass in CATALOGUE.items() if glass.disperses()])
def test_indices_between_those_of_the_table_are_right_to_a_millionth(name):
    dispersion = pack_dispersion([Dielectric(ior=name)])
    assert dispersion is not None
    wavelengths = np.random.default_rng(2).uniform(380.0, 780.0, 2000)
    result = vectorised(eta_at)(dispersion, 0, rows(wavelengths))
    np.testing.assert_allclose(result, CATALOGUE[name].ior(wavelengths), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("front", [True, False])
@pytest.mark.parametrize(("degrees", "number"), [(0.0, 0), (30.0, 1), (33.7, 2), (80.0, 0)])
def test_each_wavelength_is_reflected_as_often_as_fresnel_says(degrees, number, front):
    spec = Dielectric(ior={"index": 1.785, "abbe": 25.7})
    direction, count = incoming(degrees), 400_000
    outgoing, weight, pdf = scattered(row_of(spec, site_of(*WAVES, number=number)), direction, count, front)
    etas = [spec.eta(wavelength) if front else 1.0 / spec.eta(wavelength) for wavelength in WAVES]
    expected = np.array([fresnel_dielectric(abs(direction[2]), eta)[0] for eta in etas])
    back = outgoing[:, 2] > 0.0
    assert np.isinf(pdf).all()
    result = np.where(back[:, None], weight, 0.0).mean(axis=0)
    np.testing.assert_allclose(result, expected, rtol=0.0, atol=5.0 * math.sqrt(0.25 / count))
    # Each has a way of its own where it is refracted.
    through = weight[~back]
    assert not np.delete(through, number, axis=1).any()
    assert through[:, number].sum() / count == pytest.approx(1.0 - expected[number], abs=0.005)
    if through.any():
        sines = np.hypot(outgoing[~back, 0], outgoing[~back, 1])
        np.testing.assert_allclose(sines, math.hypot(*direction[:2]) / etas[number], atol=1e-5)


def test_light_of_one_wavelength_is_met_as_by_plain_glass():
    outgoing, weight, _ = scattered(row_of(Dielectric(ior="N-SF11"), site_of(450.0)), incoming(50.0), 1000)
    np.testing.assert_allclose(weight[:, 0], 1.0, rtol=1e-12)
    assert {*np.sign(outgoing[:, 2])} == {1.0, -1.0}


def test_what_has_one_index_takes_no_part_in_it():
    plain, flint = Dielectric(ior=1.5, absorption=[1.0, 2.0, 3.0]), Dielectric(ior="N-SF11")
    beside = row_of(plain, site_of(*WAVES), flint)
    alone = row(Dielectric.pack([plain], ParameterPacker()), 0, None, Site((0.0, 0.0, 0.0), 0.0, 0.0, 1.0))
    assert isinstance(alone, DielectricRow)
    for front in (True, False):
        for one, other in zip(*(scattered(one, incoming(40.0), 1000, front) for one in (beside, alone)), strict=True):
            np.testing.assert_array_equal(one, other)


def test_coloured_glass_takes_of_each_wavelength_what_its_colour_says():
    spec = Dielectric(ior="N-BK7", attenuation_color=[0.9, 0.3, 0.1], attenuation_distance=0.5)
    result = row_of(spec, site_of(*WAVES, distance=0.5)).transmittance_inside
    expected = [basis_at(spectra(), wavelength) @ np.array([0.9, 0.3, 0.1]) for wavelength in WAVES]
    np.testing.assert_allclose(result, expected, rtol=1e-12)


def test_rough_glass_draws_by_its_pdf_at_each_wavelength():
    spec = RoughDielectric(ior="N-SF11", roughness=0.5)
    for wavelength in (420.0, 680.0):
        material = row_of(spec, site_of(wavelength))
        assert material.eta == pytest.approx(spec.eta(wavelength), abs=1e-6)
        outgoing, weight, pdf = scattered(material, incoming(30.0), 1000)
        value, density = evaluate_row(material, incoming(30.0), outgoing)
        np.testing.assert_allclose(density, pdf, rtol=1e-9)
        np.testing.assert_allclose(value, density[:, None] * weight, rtol=1e-9)


def test_rough_glass_between_one_index_and_many_keeps_its_own_deficits():
    plain, flint = RoughDielectric(ior=1.5, roughness=0.5), RoughDielectric(ior="N-SF11", roughness=0.5)
    table = RoughDielectric.pack([flint, plain], ParameterPacker())
    site = site_of(420.0)
    beside, alone = row(table, 1, None, site), row_of(plain, site)
    outgoing, _, pdf = scattered(alone, incoming(30.0), 100)
    np.testing.assert_array_equal(scattered(beside, incoming(30.0), 100)[0], outgoing)
    np.testing.assert_array_equal(evaluate_row(beside, incoming(30.0), outgoing)[1], pdf)


def test_materials_say_how_they_part_wavelengths():
    assert Dielectric(ior="N-SF11").dispersion_mode() == TERMINATE_ON_REFRACTION
    assert RoughDielectric(ior="N-SF11").dispersion_mode() == TERMINATE_ON_HIT
    assert Dielectric(ior=1.3, outside_ior="water").dispersion_mode() == TERMINATE_ON_REFRACTION
    assert Dielectric(ior=1.5, outside_ior=1.3).dispersion_mode() == 0
    # A plain number is the index that it was, to the bit.
    assert Dielectric(ior=2.4, outside_ior=1.1).eta() == 2.4 / 1.1


def test_boundaries_between_what_disperses():
    flint, water = CATALOGUE["N-SF11"], CATALOGUE["water"]
    solid = Dielectric(ior="N-SF11", priority=2)
    filling = solid.interior_medium()
    assert filling is not None
    assert filling.ior == flint
    # The same glass on both sides is no boundary.
    assert solid.as_boundary_to(flint) is None
    assert Dielectric(ior="N-SF11", outside_ior="N-SF11").is_index_matched()
    wet = solid.as_boundary_to(water)
    assert isinstance(wet, Dielectric)
    assert wet.eta(450.0) == pytest.approx(float(flint.ior(450.0)) / float(water.ior(450.0)), rel=1e-15)
    assert wet.as_boundary_to(parse_glass(1.0)).eta(450.0) == float(flint.ior(450.0))


def test_a_pane_has_one_index():
    with pytest.raises(ValueError, match="must be a number"):
        ThinDielectric(ior="N-BK7")
