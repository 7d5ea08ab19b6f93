"""Bump and normal maps: the normals that they make, and that what is scattered keeps its energy and its side."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import PIL.Image
import pytest
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.core.geometry import Hit, Interaction, Site
from raytracer.core.sampling import SAMPLERS, pixel_key
from raytracer.core.shading_normals import into_wedge, normal_tilt, out_of_wedge, turn_towards_viewer
from raytracer.core.vec import neg
from raytracer.kernel.normal_mapping import (
    NormalMapping,
    evaluate_surface,
    from_tangent_space,
    perturb_normal,
    scatter_surface,
)
from raytracer.plugins.materials.base.interface import Draws
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import MATERIALS
from tests.small_scenes import assert_mean, image, scene
from tests.statistics import chi2_counts

Vector = tuple[float, float, float]

SIGNIFICANCE = 1e-4


class Stage(NamedTuple):
    """The parts of a scene that scattering looks at."""

    materials: tuple[Any, ...]
    selectors: Any
    textures: Any


def unit(*vector: float) -> Vector:
    x, y, z = np.array(vector) / np.linalg.norm(vector)
    return float(x), float(y), float(z)


def stage_of(kind: str, **parameters: Any) -> Stage:
    spec = MATERIALS.specs()[kind].model_validate({"type": kind, **parameters})
    return Stage((type(spec).pack([spec], ParameterPacker()),), None, None)


RELIEF = NormalMapping(None, None)
"""Says that shading normals differ from the true ones; they are then given by hand."""


@entry
def _scatter(normal_mapping, stage, surface, sampler, outgoing, weight, pdf):
    key = pixel_key(sampler, 0, 0)
    for index in range(len(pdf)):
        draws = Draws(sampler, key, index, 8)
        out = scatter_surface(normal_mapping, stage, surface, draws)
        for axis in range(3):
            outgoing[index, axis] = out.direction[axis]
            weight[index, axis] = out.weight[axis]
        pdf[index] = out.pdf


@entry
def _evaluate(normal_mapping, stage, surface, outgoing, value, pdf):
    for index in range(len(pdf)):
        toward = (outgoing[index, 0], outgoing[index, 1], outgoing[index, 2])
        f_cos, density = evaluate_surface(normal_mapping, stage, surface, toward)
        for axis in range(3):
            value[index, axis] = f_cos[axis]
        pdf[index] = density


def surface_of(direction: Vector, normal: Vector, front: bool) -> Interaction:
    """A surface with the normal +z, or -z if it is met from behind: what comes from above comes to +z."""
    outside = (0.0, 0.0, 1.0 if front else -1.0)
    zero = (0.0, 0.0, 0.0)
    hit, site = Hit(zero, outside, outside, 0.0, 0.0, 0.0, 0, zero, zero, zero), Site(zero, 0.0, 0.0, 1.0)
    return Interaction(-1, 0, 0, hit, site, 0, front, normal, neg(direction), direction, 1.0, None)


def scattered(stage: Stage, direction: Vector, normal: Vector, count: int, *, front: bool = True) -> Any:
    """Directions (count, 3), weights (count, 3) and pdfs (count,)."""
    outgoing, weight, pdf = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    sampler = SAMPLERS["independent"](3, 1)
    _scatter(RELIEF, stage, surface_of(direction, normal, front), sampler, outgoing, weight, pdf)
    return outgoing, weight, pdf


def evaluated(stage: Stage, direction: Vector, normal: Vector, outgoing: NDArray[Any], *, front: bool = True) -> Any:
    """f |cos| (n, 3) and pdf (n,)."""
    value, pdf = np.empty((len(outgoing), 3)), np.empty(len(outgoing))
    _evaluate(RELIEF, stage, surface_of(direction, normal, front), np.ascontiguousarray(outgoing), value, pdf)
    return value, pdf


def sphere_grid(rows: int, columns: int, fine: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Midpoints of directions (rows, columns, fine^2, 3) by equal steps of z and azimuth, and the area of each."""
    z = -1.0 + 2.0 * (np.arange(rows * fine) + 0.5) / (rows * fine)
    phi = -np.pi + 2.0 * np.pi * (np.arange(columns * fine) + 0.5) / (columns * fine)
    z, phi = np.meshgrid(z, phi, indexing="ij")
    sine = np.sqrt(1.0 - z * z)
    points = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    cells = points.reshape(rows, fine, columns, fine, 3).transpose(0, 2, 1, 3, 4).reshape(rows, columns, fine**2, 3)
    return cells, np.array(4.0 * np.pi / (rows * columns * fine**2))


SURFACES = [
    pytest.param("lambertian", {"albedo": 1.0}, id="matte"),
    pytest.param("metal", {"albedo": 1.0, "fuzz": 1.0}, id="fuzzy metal"),
    pytest.param("rough_dielectric", {"ior": 1.5, "roughness": 0.5}, id="frosted glass"),
]

TILTS = [
    pytest.param(unit(0.9, 0.1, -0.8), unit(0.0, 0.0, 1.0), id="level"),
    pytest.param(unit(0.3, 0.2, -1.0), unit(0.8, 0.3, 0.6), id="tilted"),
    pytest.param(unit(1.0, 0.2, -0.5), unit(-0.9, 0.3, 0.35), id="steep"),
    pytest.param(unit(-1.0, 0.4, -0.1), unit(1.2, 0.1, -0.2), id="past the horizon"),
]


@pytest.mark.parametrize(("kind", "parameters"), SURFACES)
@pytest.mark.parametrize(("direction", "normal"), TILTS)
@pytest.mark.parametrize("front", [True, False])
def test_directions_follow_the_pdf_that_evaluate_tells(
    kind: str, parameters: dict[str, Any], direction: Vector, normal: Vector, front: bool
) -> None:
    stage = stage_of(kind, **parameters)
    count, rows, columns = 100_000, 16, 16
    outgoing, weight, pdf = scattered(stage, direction, normal, count, front=front)
    is_scattered = weight.any(axis=1)
    observed, _, _ = np.histogram2d(
        outgoing[is_scattered, 2],
        np.arctan2(outgoing[is_scattered, 1], outgoing[is_scattered, 0]),
        [np.linspace(-1.0, 1.0, rows + 1), np.linspace(-np.pi, np.pi, columns + 1)],
    )
    cells, area = sphere_grid(rows, columns, 24)
    _, density = evaluated(stage, direction, normal, cells.reshape(-1, 3), front=front)
    expected = count * density.reshape(cells.shape[:3]).sum(axis=2) * area
    # Midpoints are off where a lobe ends within a cell, by less than shows here; what is absorbed has a cell too.
    expected *= min(1.0, count / expected.sum())
    some = expected >= 1.0
    observed, expected = observed[some], expected[some]
    chi2_counts(np.append(observed, count - observed.sum()), np.append(expected, count - expected.sum()), SIGNIFICANCE)

    # And the sample's own pdf is that one.
    _, repeated = evaluated(stage, direction, normal, outgoing[is_scattered][:5000], front=front)
    close = np.isclose(repeated, pdf[is_scattered][:5000], rtol=1e-5)
    assert close.mean() > 0.995


@pytest.mark.parametrize(("kind", "parameters"), SURFACES)
@pytest.mark.parametrize(("direction", "normal"), TILTS)
def test_tilted_normals_lose_no_energy(
    kind: str, parameters: dict[str, Any], direction: Vector, normal: Vector
) -> None:
    # What leaves is what leaves a level surface that is met at the angle to the shading normal.
    stage = stage_of(kind, **parameters)
    cells, area = sphere_grid(16, 16, 24)
    value, _ = evaluated(stage, direction, normal, cells.reshape(-1, 3))
    _, weight, _ = scattered(stage, direction, normal, 100_000)
    cosine = -float(np.dot(direction, normal))
    level = (float(np.sqrt(1.0 - cosine**2)), 0.0, -cosine)
    _, flat, _ = scattered(stage, level, (0.0, 0.0, 1.0), 100_000)
    noise = np.hypot(weight.std(), flat.std()) / np.sqrt(len(weight))
    assert weight[:, 0].mean() == pytest.approx(flat[:, 0].mean(), abs=5.0 * noise + 1e-9)
    assert value[:, 0].sum() * area == pytest.approx(weight[:, 0].mean(), abs=5.0 * noise + 3e-3)
    if kind == "lambertian":
        assert (weight == 1.0).all()


@pytest.mark.parametrize(("direction", "normal"), TILTS)
def test_what_is_reflected_stays_above_the_surface(direction: Vector, normal: Vector) -> None:
    for stage in (stage_of("lambertian", albedo=1.0), stage_of("metal", albedo=1.0), stage_of("metal", fuzz=0.6)):
        outgoing, weight, _ = scattered(stage, direction, normal, 5000)
        assert (outgoing[weight.any(axis=1), 2] >= 0.0).all()
        below = outgoing * (1.0, 1.0, -1.0)
        value, pdf = evaluated(stage, direction, normal, below)
        assert not value.any()
        assert not pdf.any()


@pytest.mark.parametrize("front", [True, False])
def test_what_glass_lets_through_is_below_and_what_it_reflects_above(front: bool) -> None:
    direction, normal = unit(0.3, 0.1, -0.9), unit(0.3, 0.2, 0.9)
    outgoing, weight, pdf = scattered(stage_of("dielectric"), direction, normal, 20_000, front=front)
    assert (weight == 1.0).all()
    assert np.isinf(pdf).all()
    # Two directions only, one on each side, each the material's own or its mirror image.
    assert len(np.unique(np.round(outgoing, 9), axis=0)) == 2
    assert set(np.sign(outgoing[:, 2])) == {-1.0, 1.0}


def test_a_mirror_that_leans_too_far_reflects_at_the_mirror_image() -> None:
    direction = unit(1.0, 0.0, -0.3)
    leaning = unit(1.0, 0.0, 1.2)
    assert np.dot(leaning, direction) > 0.0
    bent = turn_towards_viewer(leaning, tuple(-x for x in direction), (0.0, 0.0, 1.0))
    outgoing, _, _ = scattered(stage_of("metal"), direction, bent, 1)
    # At a normal across the ray the mirror leaves the ray as it is, and the true surface turns it up.
    np.testing.assert_allclose(outgoing[0], np.array(direction) * (1.0, 1.0, -1.0), atol=1e-7)


@pytest.mark.parametrize("transmitted", [False, True])
@pytest.mark.parametrize(("direction", "normal"), TILTS[1:])
def test_the_wedge_goes_to_the_right_side_and_back(direction: Vector, normal: Vector, transmitted: bool) -> None:
    geometric, sign = np.array([0.0, 0.0, 1.0]), -1.0 if transmitted else 1.0
    tilt = normal_tilt(tuple(geometric), normal, direction, transmitted)
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    right = (sign * directions @ normal > 0.0) & (sign * directions @ geometric > 0.0)
    wedge = (sign * directions @ normal > 0.0) & (sign * directions @ geometric < 0.0)
    back = []
    for away in directions[wedge]:
        turned = out_of_wedge(tilt, tuple(away))
        assert sign * np.dot(turned, geometric) > 0.0
        assert sign * np.dot(turned, normal) > 0.0
        np.testing.assert_allclose(np.linalg.norm(turned), 1.0, atol=1e-14)
        inner, spread = into_wedge(tilt, turned)
        np.testing.assert_allclose(inner, away, atol=1e-12)
        back.append(spread)
    assert back == [tilt.spread] * len(back)
    # As much solid angle is turned to as a density that is `spread` times as high makes the same light.
    reached = sum(into_wedge(tilt, tuple(up))[1] > 0.0 for up in directions[right])
    assert reached * tilt.spread == pytest.approx(wedge.sum(), rel=5.0 / np.sqrt(min(reached, wedge.sum())))


def test_normals_are_bent_no_more_than_to_the_horizon() -> None:
    rng = np.random.default_rng(8)
    for _ in range(200):
        normal, viewer = (unit(*rng.normal(size=3)) for _ in range(2))
        bent = np.array(turn_towards_viewer(normal, viewer, viewer))
        if np.dot(normal, viewer) >= 0.0:
            assert tuple(bent) == normal
            continue
        assert np.linalg.norm(bent) == pytest.approx(1.0)
        assert 0.0 < np.dot(bent, viewer) < 1e-7
        # The angle to the nearest vector of the plane across the viewer is asin |normal . viewer|.
        assert np.arccos(np.clip(np.dot(bent, normal), -1, 1)) == pytest.approx(
            np.arcsin(-np.dot(normal, viewer)), abs=1e-6
        )
    assert turn_towards_viewer((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.0, 0.6, 0.8)) == (0.0, 0.6, 0.8)


def test_a_slope_of_heights_tilts_the_normal_by_its_angle() -> None:
    # z = a x + b y has the normal (-a, -b, 1), whatever the parameters: here u, v oblique, long, and left-handed.
    a, b = 0.7, -0.4
    for tangent, bitangent in (
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((2.0, 1.0, 0.0), (-1.0, 3.0, 0.0)),
        ((0.0, 0.5, 0.0), (4.0, 1.0, 0.0)),
    ):
        along = [a * t[0] + b * t[1] for t in (tangent, bitangent)]
        np.testing.assert_allclose(
            perturb_normal((0.0, 0.0, 1.0), tangent, bitangent, *along), unit(-a, -b, 1.0), atol=1e-15
        )
        # Raised to the other side, its slopes are seen from below.
        np.testing.assert_allclose(
            perturb_normal((0.0, 0.0, -1.0), tangent, bitangent, *along), unit(-a, -b, -1.0), atol=1e-15
        )


def test_without_a_frame_the_normal_stays() -> None:
    normal, zero = unit(1, 2, 3), (0.0, 0.0, 0.0)
    assert perturb_normal(normal, zero, (0.0, 1.0, 0.0), 5.0, 5.0) == normal
    assert from_tangent_space((0.5, 0.5, 0.7), normal, zero, zero) == normal


def test_normal_maps_point_along_u_v_and_the_normal() -> None:
    up, tangent, bitangent = (0.0, 0.0, 1.0), (3.0, 0.0, 0.0), (0.5, 2.0, 0.0)
    np.testing.assert_allclose(from_tangent_space((0.0, 0.0, 1.0), up, tangent, bitangent), up)
    np.testing.assert_allclose(from_tangent_space((0.6, 0.0, 0.8), up, tangent, bitangent), (0.6, 0.0, 0.8))
    np.testing.assert_allclose(from_tangent_space((0.0, 0.6, 0.8), up, tangent, bitangent), (0.0, 0.6, 0.8))
    # In a mirrored frame v still runs along dp/dv.
    np.testing.assert_allclose(from_tangent_space((0.0, 0.6, 0.8), up, tangent, (0.5, -2.0, 0.0)), (0.0, -0.6, 0.8))


# ---- Whole scenes

CAMERA = "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 30}\n"
ROUGH = "bump: {type: noise, scale: 6, octaves: 3}, bump_height: 0.3"


@pytest.mark.slow
@pytest.mark.parametrize(
    "material",
    [
        f"{{type: lambertian, albedo: 1, {ROUGH}}}",
        f"{{type: metal, albedo: 1, {ROUGH}}}",
        f"{{type: dielectric, {ROUGH}}}",
    ],
)
@pytest.mark.parametrize(
    "light",
    [
        "environment: {type: constant, radiance: 1}\nobjects:\n",
        "objects:\n  - {type: sphere, center: [0, 0, 0], radius: -9, material: {type: emitter, radiance: 1}}\n",
    ],
    ids=["environment", "lamp"],
)
def test_white_furnace(material: str, light: str) -> None:
    text = CAMERA + light + f"  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {material}}}\n"
    assert_mean(image(text, spp=64, max_depth=1000, filled=False), 1.0, relative_noise=0.005)


def normal_mapping_of(material: str) -> Any:
    text = CAMERA + f"objects:\n  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {material}}}\n"
    return pack(scene(text, filled=False)).scene.normal_mapping


def test_bright_parts_of_a_bump_map_stand_out(tmp_path: Path) -> None:
    # Between the middles of a black and a white pixel, 1 m apart along x, heights rise by 1 m, smoothly: 45 degrees at
    # the most.
    PIL.Image.fromarray(np.array([[0, 255]], np.uint8)).save(tmp_path / "ramp.png")
    text = f"""
film: {{width: 5, height: 5}}
{CAMERA}environment: {{type: constant, radiance: 1}}
objects:
  - type: quad
    corner: [-1, -1, 0]
    edges: [[2, 0, 0], [0, 2, 0]]
    material: {{type: lambertian, bump: {{type: image, file: ramp.png}}, bump_height: 1}}
"""
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    normal = render(load(path), spp=16, aovs=["normal"]).image.layers["normal"]
    assert -np.sqrt(0.5) <= normal[2, 2, 0] < -0.5
    assert normal[2, 2, 1] == pytest.approx(0.0, abs=1e-6)


def test_normal_mapping_is_packed_only_where_there_are_maps() -> None:
    assert normal_mapping_of("{type: lambertian}") is None
    assert normal_mapping_of("{type: lambertian, bump: {type: noise}, bump_height: 0}") is None
    bumped = normal_mapping_of(f"{{type: lambertian, {ROUGH}}}")
    assert bumped.normal_maps is None
    assert bumped.bumps.height.tolist() == [0.3]
    mapped = normal_mapping_of("{type: metal, normal_map: {type: checker, even: [0.5, 0.5, 1]}}")
    assert mapped.bumps is None
    assert mapped.normal_maps.texture.tolist() == [0]
