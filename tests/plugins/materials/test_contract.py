"""Contract of materials, tested for every kind that there is."""

import numpy as np
import pytest

from raytracer.core.microfacet import CellBlend
from raytracer.plugins.materials.base.interface import SelectorSpec, row
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.schema.registry import MATERIALS
from tests.plugins.materials.kernels import (
    SITE,
    emitted,
    evaluate_many,
    frame,
    incoming,
    mirrored,
    packed_row,
    scatter_many,
)
from tests.statistics import chi2_counts

EXAMPLES = {
    "boundary": [{}],
    "cutout": [{"material": {"type": "lambertian"}, "opacity": 0.5}],
    "dielectric": [{"ior": 1.5}, {"ior": 1.33, "outside_ior": 1.5}, {"ior": 1.0}],
    "emitter": [{"radiance": 2.0}, {"radiance": [1.0, 2.0, 3.0], "two_sided": True}],
    "lambertian": [{"albedo": [0.2, 0.5, 1.0]}, {"albedo": 0.0}],
    "metal": [
        {"albedo": [0.9, 0.6, 0.3], "fuzz": 0.0},
        {"albedo": 1.0, "fuzz": 0.05},
        {"albedo": 0.8, "fuzz": 0.5},
        {"albedo": [1.0, 0.6, 0.3], "fuzz": 1.0},
    ],
    "mixture": [{"materials": [{"type": "lambertian"}, {"type": "metal"}], "weight": 0.25}],
    "principled": [
        {"base_color": [0.8, 0.3, 0.1], "roughness": 0.4},
        {"base_color": 1.0, "roughness": 1.0, "ior": 2.4},
        {"base_color": [1.0, 0.7, 0.3], "metallic": 1.0, "roughness": 0.6},
        {"base_color": [0.9, 0.5, 0.2], "metallic": 0.3, "transmission": 0.5, "roughness": 0.7, "emission": 2.0},
        {"base_color": 0.0, "roughness": 0.0},
    ],
    "rough_conductor": [
        {"metal": "gold", "roughness": 0.5},
        {"eta": [3.1, 1.5, 0.2], "k": [3.3, 0.0, 4.0], "roughness": 1.0},
        {"albedo": [1.0, 0.6, 0.1], "roughness": 0.7},
        {"albedo": 1.0, "roughness": 0.6, "multiple_scattering": False},
        {"metal": "aluminium", "roughness": 0.02},
    ],
    "rough_dielectric": [
        {"ior": 1.5, "roughness": 0.5},
        {"ior": 1.0, "outside_ior": 1.5, "roughness": 0.8},
        {"ior": 2.4, "roughness": 1.0},
        {"ior": 1.5, "roughness": 0.7, "multiple_scattering": False},
        {"ior": 1.5, "roughness": 0.01},
        {"ior": 1.5, "outside_ior": 1.5, "roughness": 0.5},
    ],
    "thin_dielectric": [{"ior": 1.5}, {"ior": 1.0}, {"ior": 0.6, "color": [0.2, 0.5, 1.0]}],
    "two_sided": [{"front": {"type": "metal"}, "back": {"type": "lambertian"}}],
}
"""Parameters of at least one material of each kind."""

LOBES = {"principled"}
"""Kinds that choose among lobes: a weight may be above 1 where another lobe would have been the better choice."""

FACETS = {"principled", "rough_conductor", "rough_dielectric"}
"""Kinds whose lobes, seen at grazing incidence, are narrower than quadrature can tell: 85 degrees have to do."""

ANGLES = (0.0, 30.0, 75.0, 89.9)

# Probability with which any one test of this file rejects what is right; its seeds are fixed.
SIGNIFICANCE = 1e-4


def spec_of(kind, parameters):
    return MATERIALS.specs()[kind].model_validate({"type": kind, **parameters})


CASES = [
    pytest.param(spec_of(kind, parameters), id=f"{kind} {parameters}")
    for kind, examples in EXAMPLES.items()
    for parameters in examples
    # Selectors only name another material.
    if not issubclass(MATERIALS.specs()[kind], SelectorSpec)
]

every_material = pytest.mark.parametrize("spec", CASES)
every_lit_material = pytest.mark.parametrize("spec", [case for case in CASES if case.values[0].has_non_delta_bsdf()])
every_other_material = pytest.mark.parametrize(
    "spec", [case for case in CASES if not case.values[0].has_non_delta_bsdf()]
)
every_angle = pytest.mark.parametrize("degrees", ANGLES)


def test_every_kind_has_an_example():
    assert set(EXAMPLES) == set(MATERIALS.specs())


@every_material
def test_tables_are_contiguous_float64(spec):
    table = type(spec).pack([spec, spec, spec], ParameterPacker())
    for column in columns(table):
        assert column.flags.c_contiguous
        assert column.dtype in (np.dtype(np.float64), np.dtype(np.int32), np.dtype(np.bool_))


def columns(table):
    """The arrays of a packed table and of the tables in it."""
    for column in table:
        if isinstance(column, tuple):
            yield from columns(column)
        elif column is not None:
            yield column


@every_material
@every_angle
def test_directions_are_unit_vectors_and_weights_keep_energy(spec, degrees):
    for front in (True, False):
        outgoing, weight, pdf = scatter_many(spec, incoming(degrees), 4096, front=front)
        np.testing.assert_allclose(np.linalg.norm(outgoing, axis=1), 1.0, rtol=0.0, atol=1e-12)
        assert (weight >= 0.0).all()
        most = weight.mean(axis=0) - 5.0 * weight.std(axis=0) / 64.0 if spec.type in LOBES else weight
        assert (most <= 1.0 + 1e-9).all()
        assert (pdf > 0.0).all()


def cells(axis, lowest, rows, columns, fine):
    """Quadrature over directions within arccos(lowest) of `axis`: points and weights, (rows, columns, fine^2, 4).

    The cosine runs as lowest + (1 - lowest) s^2, so that a pdf with a pole of 1 / sqrt at `lowest` is smooth in s; over
    the whole sphere as +-(2 s - 1)^2, so that rows are narrow at the horizon and none is cut by it.
    """
    nodes, weights = np.polynomial.legendre.leggauss(fine)
    s = (np.arange(rows)[:, None] + 0.5 + 0.5 * nodes) / rows
    phi = 2.0 * np.pi * (np.arange(columns)[:, None] + 0.5 + 0.5 * nodes) / columns
    if lowest == -1.0:
        cosine = (2.0 * s - 1.0) * np.abs(2.0 * s - 1.0)
        area_s = 0.5 * weights / rows * 4.0 * np.abs(2.0 * s - 1.0)
    else:
        cosine = lowest + (1.0 - lowest) * s * s
        area_s = 0.5 * weights / rows * 2.0 * (1.0 - lowest) * s
    areas = area_s[:, None, :, None] * (np.pi * weights / columns)
    cosine, phi = cosine[:, None, :, None], phi[None, :, None, :]
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    local = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), cosine, areas), axis=-1)
    local[..., :3] = local[..., :3] @ frame(axis)
    return local.reshape(rows, columns, fine * fine, 4)


def place(cosine, lowest):
    """The s of `cells` in 0..1 where the cosine is this."""
    if lowest == -1.0:
        return 0.5 + 0.5 * np.sign(cosine) * np.sqrt(np.abs(cosine))
    return np.sqrt(np.maximum(0.0, (cosine - lowest) / (1.0 - lowest)))


def support(spec, direction):
    """An axis, and the lowest cosine to it at which the pdf is not zero."""
    fuzz = getattr(spec, "fuzz", None)
    if fuzz is None:
        return np.array([0.0, 0.0, 1.0]), -1.0
    return mirrored(direction), float(np.sqrt(max(0.0, 1.0 - fuzz**2)))


@every_lit_material
@every_angle
def test_directions_follow_the_pdf_and_weights_the_albedo_that_evaluate_tells(spec, degrees):
    count, rows, columns = 200_000, 16, 24
    direction = incoming(min(degrees, 85.0) if spec.type in FACETS else degrees)
    axis, lowest = support(spec, direction)
    # By 24 x 24 points, cells that the horizon cuts, as it does those of a cap, are known to 1e-3; few do where neither
    # that, a narrow lobe, nor the rim of total reflection is in a cell.
    smooth = degrees < 80.0 and lowest == -1.0 and spec.type != "rough_dielectric"
    grid = cells(axis, lowest, rows, columns, 8 if smooth else 24)
    value, pdf = evaluate_many(spec, direction, grid[..., :3].reshape(-1, 3))
    outgoing, weight, _ = scatter_many(spec, direction, count)

    # Pearson's chi-square over cells of directions, plus one for what is absorbed or falls outside of them.
    local = outgoing[weight.any(axis=1)] @ frame(axis).T
    s = place(local[:, 2], lowest)
    phi = np.arctan2(local[:, 1], local[:, 0]) % (2.0 * np.pi)
    assert (local[:, 2] >= lowest - 1e-12).all()
    observed, _, _ = np.histogram2d(
        s, phi, [np.linspace(0.0, 1.0 + 1e-12, rows + 1), np.linspace(0.0, 2.0 * np.pi, columns + 1)]
    )
    areas = grid[..., 3]
    expected = count * (pdf.reshape(areas.shape) * areas).sum(axis=2)
    assert expected.sum() <= count * (1.0 + 1e-3)
    # A sliver above the horizon may fall between its points: cells where less than one is expected join the absorbed.
    expected *= min(1.0, count / expected.sum())
    some = expected >= 1.0
    observed, expected = observed[some], expected[some]
    absorbed = count - expected.sum()
    chi2_counts(np.append(observed, count - observed.sum()), np.append(expected, absorbed), SIGNIFICANCE)

    # The directional albedo, the integral of f |cos|, is at most 1, and the mean weight is an estimate of it.
    albedo = areas.ravel() @ value
    assert (albedo <= 1.0 + 1e-3).all()
    deviation = weight.std(axis=0) / np.sqrt(count)
    np.testing.assert_array_less(np.abs(weight.mean(axis=0) - albedo), 5.0 * deviation + 1e-3)


@every_lit_material
@every_angle
def test_weight_is_f_cos_over_pdf(spec, degrees):
    direction = incoming(degrees)
    outgoing, weight, pdf = scatter_many(spec, direction, 20_000)
    value, density = evaluate_many(spec, direction, outgoing)
    kept = weight.any(axis=1)
    assert kept.any()
    # At the rim of the lobe of fuzzy metal the pdf has a pole.  A cosine wrong by 2^-53 is 2^-53 / (2 * 1e-6 * 1.25e-3)
    # of the square of its distance from the pole there, for the narrowest lobe: 5e-8.
    axis, lowest = support(spec, direction)
    clear = kept & (outgoing @ axis > lowest + 1e-6 * (1.0 - lowest))
    assert clear.sum() > 0.99 * kept.sum()
    np.testing.assert_allclose(density[clear], pdf[clear], rtol=2e-7)
    np.testing.assert_allclose(value[clear], weight[clear] * density[clear, None], rtol=1e-12)


@every_other_material
@every_angle
def test_what_cannot_be_lit_by_choice_has_no_value(spec, degrees):
    # Mirrors, glass, emitters, and what is black: aiming at a light would bring nothing.
    direction = incoming(degrees)
    outgoing, weight, pdf = scatter_many(spec, direction, 1000)
    value, density = evaluate_many(spec, direction, outgoing)
    assert not value.any()
    if np.isinf(pdf).all():
        assert not density.any()
    else:
        assert not weight.any()


@every_lit_material
def test_normal_and_frame_do_not_matter_but_for_turning_along(spec):
    # A surface turned by a rotation has the same pdf for directions turned with it.
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    direction = incoming(40.0)
    outgoing, _, _ = scatter_many(spec, direction, 100)
    value, pdf = evaluate_many(spec, direction, outgoing)
    turned = tuple(map(float, turn @ direction)), tuple(map(float, turn @ (0.0, 0.0, 1.0)))
    value_turned, pdf_turned = evaluate_many(spec, turned[0], outgoing @ turn.T, normal=turned[1])
    np.testing.assert_allclose(pdf_turned, pdf, rtol=1e-7)
    np.testing.assert_allclose(value_turned, value, rtol=1e-7)


@every_material
def test_only_emitters_emit(spec):
    radiance = {front: emitted(spec, front) for front in (True, False)}
    assert (
        (spec.emitted_power(ParameterPacker()) > 0.0)
        == spec.is_emissive()
        == any(any(value) for value in radiance.values())
    )
    if spec.type == "emitter":
        assert radiance[True] == spec.radiance
        assert radiance[False] == (spec.radiance if spec.two_sided else (0.0, 0.0, 0.0))


def test_a_row_is_that_of_its_material():
    kinds = {case.values[0].type for case in CASES}
    for kind in sorted(kinds):
        specs = [case.values[0] for case in CASES if case.values[0].type == kind]
        table = type(specs[0]).pack(specs, ParameterPacker())
        for number, spec in enumerate(specs):
            assert_same(row(table, number, None, SITE), packed_row(spec))


def assert_same(a, b):
    """Rows are equal in all but where they stand in tables."""
    if isinstance(a, CellBlend):
        assert a.blend == b.blend
    elif isinstance(a, tuple) and hasattr(a, "_fields"):
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    elif not isinstance(a, np.ndarray):
        assert a == b
