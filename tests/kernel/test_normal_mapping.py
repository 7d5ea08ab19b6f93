"""Bump and normal maps: the normals that they make, and that what is scattered keeps its energy and its side."""

from typing import Any, NamedTuple

import numpy as np
import PIL.Image
import pytest

from raytracer.core.geometry import Hit, Interaction, Site
from raytracer.core.shading_normals import into_wedge, normal_tilt, out_of_wedge, turn_towards_viewer
from raytracer.core.vec import neg
from raytracer.kernel.normal_mapping import (
    NormalMapping,
    evaluate_surface,
    from_tangent_space,
    perturb_normal,
    scatter_surface,
)
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.rendering.render import render
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import MATERIALS
from tests.small_scenes import assert_mean, image, scene
from tests.statistics import chi2_counts
from tests.vectorised import random_draws, rows, vectorised

SIGNIFICANCE = 1e-4
UP, ZERO = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


class Stage(NamedTuple):
    """The parts of a scene that scattering looks at."""

    materials: Any
    selectors: Any
    textures: Any


RELIEF = NormalMapping(None, None)
"""Says that shading normals differ from the true ones; they are then given by hand."""


def unit(*vector):
    return tuple((np.array(vector) / np.linalg.norm(vector)).tolist())


def stage_of(kind, **parameters):
    spec = MATERIALS.specs()[kind].model_validate({"type": kind, **parameters})
    return Stage((type(spec).pack([spec], ParameterPacker()),), None, None)


def surface_of(direction, normal, front=True):
    """A surface with the normal +z, or -z if it is met from behind: what comes from above comes to +z."""
    outside = (0.0, 0.0, 1.0 if front else -1.0)
    hit, site = Hit(ZERO, outside, outside, 0.0, 0.0, 0.0, 0, ZERO, ZERO, ZERO), Site(ZERO, 0.0, 0.0, 1.0)
    return Interaction(-1, 0, 0, hit, site, 0, front, normal, neg(direction), direction, 1.0, None)


def scattered(stage, surface, count):
    """Directions (count, 3), weights (count, 3) and pdfs (count,)."""
    out = vectorised(scatter_surface)(RELIEF, stage, surface, random_draws(count, seed=3))
    return out.direction, out.weight, out.pdf


def evaluated(stage, surface, outgoing):
    """f |cos| (n, 3) and pdf (n,)."""
    return vectorised(evaluate_surface)(RELIEF, stage, surface, rows(outgoing))


def sphere_grid(size=16, fine=16):
    """Midpoints of directions (size, size, fine^2, 3) by equal steps of z and azimuth, and the area of each."""
    middles = (np.arange(size * fine) + 0.5) / (size * fine)
    z, phi = np.meshgrid(2.0 * middles - 1.0, np.pi * (2.0 * middles - 1.0), indexing="ij")
    sine = np.sqrt(1.0 - z * z)
    points = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    cells = points.reshape(size, fine, size, fine, 3).transpose(0, 2, 1, 3, 4).reshape(size, size, fine**2, 3)
    return cells, 4.0 * np.pi / (size * size * fine**2)


SURFACES = pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        pytest.param("lambertian", {"albedo": 1.0}, id="matte"),
        pytest.param("metal", {"albedo": 1.0, "fuzz": 1.0}, id="fuzzy metal"),
        pytest.param("rough_dielectric", {"ior": 1.5, "roughness": 0.5}, id="frosted glass"),
    ],
)

TILTED = [
    pytest.param(unit(0.3, 0.2, -1.0), unit(0.8, 0.3, 0.6), id="tilted"),
    pytest.param(unit(1.0, 0.2, -0.5), unit(-0.9, 0.3, 0.35), id="steep"),
    pytest.param(unit(-1.0, 0.4, -0.1), unit(1.2, 0.1, -0.2), id="past the horizon"),
]
TILTS = pytest.mark.parametrize(("direction", "normal"), [pytest.param(unit(0.9, 0.1, -0.8), UP, id="level"), *TILTED])


@SURFACES
@TILTS
@pytest.mark.parametrize("front", [True, False])
def test_directions_follow_the_pdf_that_evaluate_tells(kind, parameters, direction, normal, front):
    stage, surface, count = stage_of(kind, **parameters), surface_of(direction, normal, front), 50_000
    outgoing, weight, pdf = scattered(stage, surface, count)
    is_scattered = weight.any(axis=1)
    x, y, z = outgoing[is_scattered].T
    edges = np.linspace(-1.0, 1.0, 17)
    observed, _, _ = np.histogram2d(z, np.arctan2(y, x), [edges, np.pi * edges])
    cells, area = sphere_grid()
    _, density = evaluated(stage, surface, cells.reshape(-1, 3))
    expected = count * density.reshape(cells.shape[:3]).sum(axis=2) * area
    # Midpoints are off where a lobe ends within a cell, by less than shows here; what is absorbed has a cell too.
    expected *= min(1.0, count / expected.sum())
    some = expected >= 1.0
    observed, expected = observed[some], expected[some]
    chi2_counts(np.append(observed, count - observed.sum()), np.append(expected, count - expected.sum()), SIGNIFICANCE)

    # And the sample's own pdf is that one.
    _, repeated = evaluated(stage, surface, outgoing[is_scattered][:5000])
    assert np.isclose(repeated, pdf[is_scattered][:5000], rtol=1e-5).mean() > 0.995


@SURFACES
@TILTS
def test_tilted_normals_lose_no_energy(kind, parameters, direction, normal):
    # What leaves is what leaves a level surface that is met at the angle to the shading normal.
    stage = stage_of(kind, **parameters)
    cells, area = sphere_grid()
    value, _ = evaluated(stage, surface_of(direction, normal), cells.reshape(-1, 3))
    _, weight, _ = scattered(stage, surface_of(direction, normal), 50_000)
    cosine = -float(np.dot(direction, normal))
    _, flat, _ = scattered(stage, surface_of((float(np.sqrt(1.0 - cosine**2)), 0.0, -cosine), UP), 50_000)
    noise = np.hypot(weight.std(), flat.std()) / np.sqrt(len(weight))
    assert weight[:, 0].mean() == pytest.approx(flat[:, 0].mean(), abs=5.0 * noise + 1e-9)
    assert value[:, 0].sum() * area == pytest.approx(weight[:, 0].mean(), abs=5.0 * noise + 3e-3)
    assert kind != "lambertian" or (weight == 1.0).all()


@TILTS
def test_what_is_reflected_stays_above_the_surface(direction, normal):
    for stage in (stage_of("lambertian", albedo=1.0), stage_of("metal", albedo=1.0), stage_of("metal", fuzz=0.6)):
        outgoing, weight, _ = scattered(stage, surface_of(direction, normal), 5000)
        assert (outgoing[weight.any(axis=1), 2] >= 0.0).all()
        value, pdf = evaluated(stage, surface_of(direction, normal), outgoing * (1.0, 1.0, -1.0))
        assert not value.any()
        assert not pdf.any()


@pytest.mark.parametrize("front", [True, False])
def test_what_glass_lets_through_is_below_and_what_it_reflects_above(front):
    surface = surface_of(unit(0.3, 0.1, -0.9), unit(0.3, 0.2, 0.9), front)
    outgoing, weight, pdf = scattered(stage_of("dielectric"), surface, 20_000)
    assert (weight == 1.0).all()
    assert np.isinf(pdf).all()
    # Two directions only, one on each side, each the material's own or its mirror image.
    assert len(np.unique(np.round(outgoing, 9), axis=0)) == 2
    assert set(np.sign(outgoing[:, 2])) == {-1.0, 1.0}


def test_a_mirror_that_leans_too_far_reflects_at_the_mirror_image():
    direction, leaning = unit(1.0, 0.0, -0.3), unit(1.0, 0.0, 1.2)
    assert np.dot(leaning, direction) > 0.0
    bent = turn_towards_viewer(leaning, neg(direction), UP)
    outgoing, _, _ = scattered(stage_of("metal"), surface_of(direction, bent), 1)
    # At a normal across the ray the mirror leaves the ray as it is, and the true surface turns it up.
    np.testing.assert_allclose(outgoing[0], np.array(direction) * (1.0, 1.0, -1.0), atol=1e-7)


@pytest.mark.parametrize("transmitted", [False, True])
@pytest.mark.parametrize(("direction", "normal"), TILTED)
def test_the_wedge_goes_to_the_right_side_and_back(direction, normal, transmitted):
    sign = -1.0 if transmitted else 1.0
    tilt = normal_tilt(UP, normal, direction, transmitted)
    directions = np.random.default_rng(4).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    above, beyond = sign * directions @ normal > 0.0, sign * directions[:, 2] > 0.0
    right, wedge = directions[above & beyond], directions[above & ~beyond]
    turned = vectorised(out_of_wedge)(tilt, rows(wedge))
    assert (sign * turned[:, 2] > 0.0).all()
    assert (sign * turned @ normal > 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-14)
    inner, spread = vectorised(into_wedge)(tilt, rows(turned))
    np.testing.assert_allclose(inner, wedge, atol=1e-12)
    assert (spread == tilt.spread).all()
    # As much solid angle is turned to as a density that is `spread` times as high makes the same light.
    reached = (vectorised(into_wedge)(tilt, rows(right))[1] > 0.0).sum()
    assert reached * tilt.spread == pytest.approx(len(wedge), rel=5.0 / np.sqrt(min(reached, len(wedge))))


def test_normals_are_bent_no_more_than_to_the_horizon():
    normals, viewers = np.random.default_rng(8).normal(size=(2, 200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    viewers /= np.linalg.norm(viewers, axis=1, keepdims=True)
    bent = vectorised(turn_towards_viewer)(rows(normals), rows(viewers), rows(viewers))
    facing = (normals * viewers).sum(axis=1)
    np.testing.assert_array_equal(bent[facing >= 0.0], normals[facing >= 0.0])
    away = facing < 0.0
    np.testing.assert_allclose(np.linalg.norm(bent, axis=1), 1.0, rtol=1e-6)
    after = (bent * viewers).sum(axis=1)[away]
    assert ((after > 0.0) & (after < 1e-7)).all()
    # The angle to the nearest vector of the plane across the viewer is asin |normal . viewer|.
    angles = np.arccos(np.clip((bent * normals).sum(axis=1), -1, 1))
    np.testing.assert_allclose(angles[away], np.arcsin(-facing[away]), atol=1e-6)
    assert turn_towards_viewer((0.0, 0.0, -1.0), UP, (0.0, 0.6, 0.8)) == (0.0, 0.6, 0.8)


@pytest.mark.parametrize(
    ("tangent", "bitangent"), [((1, 0, 0), (0, 1, 0)), ((2, 1, 0), (-1, 3, 0)), ((0, 0.5, 0), (4, 1, 0))]
)
def test_a_slope_of_heights_tilts_the_normal_by_its_angle(tangent, bitangent):
    # z = a x + b y has the normal (-a, -b, 1), whatever the parameters: here u, v oblique, long, and left-handed.
    a, b = 0.7, -0.4
    along = [a * t[0] + b * t[1] for t in (tangent, bitangent)]
    # Raised to the other side, its slopes are seen from below.
    for z in (1.0, -1.0):
        found = perturb_normal((0.0, 0.0, z), tangent, bitangent, *along)
        np.testing.assert_allclose(found, unit(-a, -b, z), atol=1e-15)


def test_without_a_frame_the_normal_stays():
    normal = unit(1, 2, 3)
    assert perturb_normal(normal, ZERO, (0.0, 1.0, 0.0), 5.0, 5.0) == normal
    assert from_tangent_space((0.5, 0.5, 0.7), normal, ZERO, ZERO) == normal


def test_normal_maps_point_along_u_v_and_the_normal():
    tangent, bitangent = (3.0, 0.0, 0.0), (0.5, 2.0, 0.0)
    for given in (UP, (0.6, 0.0, 0.8), (0.0, 0.6, 0.8)):
        np.testing.assert_allclose(from_tangent_space(given, UP, tangent, bitangent), given)
    # In a mirrored frame v still runs along dp/dv.
    mirrored = from_tangent_space((0.0, 0.6, 0.8), UP, tangent, (0.5, -2.0, 0.0))
    np.testing.assert_allclose(mirrored, (0.0, -0.6, 0.8))


# ---- Whole scenes

CAMERA = "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 30}\n"
SKY = "environment: {type: constant, radiance: 1}\n"
ROUGH = "bump: {type: noise, scale: 6, octaves: 3}, bump_height: 0.3"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lambertian, albedo: 1", "metal, albedo: 1", "dielectric"])
@pytest.mark.parametrize("surroundings", ["sky", "lamp"])
def test_white_furnace(kind, surroundings):
    lamp = "  - {type: sphere, center: [0, 0, 0], radius: -9, material: {type: emitter, radiance: 1}}\n"
    text = CAMERA + (SKY + "objects:\n" if surroundings == "sky" else "objects:\n" + lamp)
    text += f"  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {{type: {kind}, {ROUGH}}}}}\n"
    assert_mean(image(text, lit=True, spp=64, max_depth=1000), 1.0, relative_noise=0.005)


def test_bright_parts_of_a_bump_map_stand_out(tmp_path):
    # Between the middles of a black and a white pixel, 1 m apart along x, heights rise by 1 m, smoothly: 45 degrees at
    # the most.
    PIL.Image.fromarray(np.array([[0, 255]], np.uint8)).save(tmp_path / "ramp.png")
    material = "{type: lambertian, bump: {type: image, file: ramp.png}, bump_height: 1}"
    wall = f"  - {{type: quad, corner: [-1, -1, 0], edges: [[2, 0, 0], [0, 2, 0]], material: {material}}}\n"
    spec = scene(CAMERA + SKY + "objects:\n" + wall, width=5, height=5, max_depth=1, base=tmp_path, filled=False)
    normal = render(spec, spp=16, aovs=["normal"]).image.layers["normal"]
    assert -np.sqrt(0.5) <= normal[2, 2, 0] < -0.5
    assert normal[2, 2, 1] == pytest.approx(0.0, abs=1e-6)


def normal_mapping_of(material):
    text = CAMERA + f"objects:\n  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {material}}}\n"
    return pack(scene(text, filled=False)).scene.normal_mapping


def test_normal_mapping_is_packed_only_where_there_are_maps():
    assert normal_mapping_of("{type: lambertian}") is None
    assert normal_mapping_of("{type: lambertian, bump: {type: noise}, bump_height: 0}") is None
    bumped = normal_mapping_of(f"{{type: lambertian, {ROUGH}}}")
    assert (bumped.normal_maps, bumped.bumps.height.tolist()) == (None, [0.3])
    mapped = normal_mapping_of("{type: metal, normal_map: {type: checker, even: [0.5, 0.5, 1]}}")
    assert (mapped.bumps, mapped.normal_maps.texture.tolist()) == (None, [0])
