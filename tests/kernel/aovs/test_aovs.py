"""AOVs: each against the formula of what it measures, in scenes simple enough to have one."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from raytracer.core.geometry import Hit, Interaction, Site
from raytracer.film import load_layers
from raytracer.film.image import Image
from raytracer.kernel.aovs.base.interface import SceneIds
from raytracer.kernel.aovs.base.layers import measure
from raytracer.rendering.render import render
from raytracer.schema.registry import AOVS
from raytracer.util.errors import InputError
from tests.small_scenes import scene

ALL = tuple(name for name, spec in AOVS.specs().items() if not spec.is_per_sample)
RECORDED = (*ALL, "rays")
"""One kernel for most scenes here, and for tests/rendering/test_checkpoint.py, whatever they are about."""

SIZE = 24
VFOV = 40.0
PIXEL = 2.0 * math.tan(math.radians(VFOV / 2.0)) / SIZE

SKY = "environment: {type: constant, radiance: 1}\n"


def lens(aperture=1e-6, rim=1e3, more=""):
    """A lens with an opening and a rim (mm), or what is as good as a pinhole, 4 m from the origin."""
    rims = f"vignetting: {{diameter: {rim}, distance: 30}}"
    given = f"vfov: {VFOV}, focus_distance: 4, aperture: {aperture}, {rims}{more}"
    return f"camera: {{type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], {given}}}\n{SKY}"


CAMERA = lens()
WALL = "{type: quad, name: wall, corner: [-9, -9, 0], edges: [[18, 0, 0], [0, 18, 0]], material: {type: lambertian}}"

BALL = f"""
{CAMERA}
materials:
  red: {{type: lambertian, albedo: [0.8, 0.2, 0.1]}}
  grey: {{type: lambertian, albedo: 0.5}}
objects:
  - {{type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: red}}
  - {{type: quad, name: wall, corner: [-1.2, -5, -2], edges: [[9, 0, 0], [0, 10, 0]], material: grey}}
  - {{type: sphere, center: [0.75, 0.75, 1.2], radius: 0.25, material: {{type: emitter, radiance: 20}}}}
"""


def layers(text, *, aovs=RECORDED, threads=2, crop=None, **settings):
    settings = {"width": SIZE, "height": SIZE, "sampler": "sobol", "lit": True, **settings}
    return render(scene(text, **settings), threads=threads, seed=1, aovs=aovs, crop=crop).image


@pytest.fixture(scope="module")
def ball():
    return layers(BALL)


def centres():
    """Slopes right and up of the rays through the middles of the pixels, each (SIZE, SIZE)."""
    middle = (np.arange(SIZE) + 0.5 - SIZE / 2.0) * PIXEL
    return np.broadcast_to(middle, (SIZE, SIZE)), np.broadcast_to(-middle[:, None], (SIZE, SIZE))


def inside():
    """Pixels that see the ball alone, and that see the wall alone."""
    x, y = centres()
    # The sphere's outline is a cone of half angle asin(1 / 4): its tangent is 1 / sqrt(15).
    radius, lamp = np.hypot(x, y), np.hypot(x - 0.75 / 2.8, y - 0.75 / 2.8)
    outline = 1.0 / math.sqrt(15.0)
    # The wall's left edge is at -1.2, 6 m away.
    wall = (radius > outline + PIXEL) & (x > -0.2 + PIXEL) & (lamp > 0.13)
    return radius < outline - PIXEL, wall


# ---- What is seen


def test_depth_is_along_the_axis_and_distance_along_the_ray():
    # A wall that faces the camera, 4 m away: all of it has depth 4; the ray through slopes (x, y) is 4 sqrt(1 + x^2 +
    # y^2) long, and its mean over a pixel of width w is more by half the curvature times w^2 / 12 each way.
    picture = layers(f"{CAMERA}objects:\n  - {WALL}", spp=1024)
    np.testing.assert_allclose(picture.layers["depth"], 4.0, rtol=1e-15)
    x, y = centres()
    length = np.sqrt(1.0 + x**2 + y**2)
    mean = length + (1.0 / length + 1.0 / length**3) * PIXEL**2 / 24.0
    np.testing.assert_allclose(picture.layers["distance"], 4.0 * mean, rtol=1e-5)
    # The point that is seen lies on the ray of the pixel's middle, on average.
    np.testing.assert_allclose(picture.layers["position"][..., 0], 4.0 * x, atol=1e-4)
    np.testing.assert_allclose(picture.layers["position"][..., 1], 4.0 * y, atol=1e-4)
    np.testing.assert_allclose(picture.layers["position"][..., 2], 0.0, atol=1e-15)
    np.testing.assert_array_equal(picture.layers["motion"], 0.0)


def test_the_normal_of_a_unit_sphere_is_the_position(ball):
    seen, _ = inside()
    assert seen.sum() > 100
    for name in ("normal", "geometric_normal"):
        np.testing.assert_allclose(ball.layers[name][seen], ball.layers["position"][seen], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(ball.layers["depth"][seen], 4.0 - ball.layers["position"][seen][:, 2], rtol=1e-14)


def test_normals_face_the_camera_and_only_one_of_them_is_bent():
    # A surface seen from behind, whose shading normal is not its own.
    up, bent = (0.0, 1.0, 0.0), (0.0, 0.8, 0.6)
    zero = (0.0, 0.0, 0.0)
    hit = Hit(zero, up, bent, 0.0, 0.0, 0.0, 0, zero, zero, zero)
    site = Site(zero, 0.0, 0.0, 2.0)
    seen = Interaction(-1, 0, 0, hit, site, 0, False, (0.0, -0.8, -0.6), (0.0, -2.0, 0.0), up, 2.0, None)
    nobody = SceneIds((), *(np.zeros(1, np.int64),) * 3, np.zeros(0, np.int32), (), np.zeros(1, np.int32))
    found = {
        name: measure(AOVS.specs()[name]().quantity(nobody), None, seen)
        for name in ("geometric_normal", "normal", "distance")
    }
    assert found["geometric_normal"] == (0.0, -1.0, 0.0)
    assert found["normal"] == (0.0, -0.8, -0.6)
    assert found["distance"][0] == 2.0


def test_albedo_is_that_of_the_material_whatever_the_light(ball):
    for seen, albedo in zip(inside(), ([0.8, 0.2, 0.1], [0.5, 0.5, 0.5]), strict=True):
        assert seen.sum() > 100
        np.testing.assert_allclose(ball.layers["albedo"][seen], np.tile(albedo, (seen.sum(), 1)), rtol=1e-14)
    # Emitters reflect nothing, and show as black.
    np.testing.assert_array_equal(ball.layers["albedo"][3, 20], 0.0)
    assert ball.layers["object_id"][3, 20] == 3


def test_what_nothing_covers_is_marked(ball):
    empty = ball.layers["coverage"] == 0.0
    assert empty.sum() > 50
    assert np.isinf(ball.layers["depth"][empty]).all()
    assert np.isinf(ball.layers["distance"][empty]).all()
    for name in ("normal", "geometric_normal", "albedo", "position", "motion", "object_id", "material_id"):
        assert not ball.layers[name][empty].any()
    assert np.isfinite(ball.layers["depth"][~empty]).all()


def test_coverage_is_the_area_and_decides_whose_pixel_it_is():
    # A rectangle of 0.83 m x 0.57 m, 4 m away, in front of nothing.
    shape = "{type: quad, corner: [-0.3, -0.2, 0], edges: [[0.83, 0, 0], [0, 0.57, 0]], material: {type: lambertian}}"
    picture = layers(f"{CAMERA}objects:\n  - {shape}", spp=256)
    coverage = picture.layers["coverage"]
    assert coverage.sum() == pytest.approx(0.83 * 0.57 / (4.0 * PIXEL) ** 2, rel=1e-3)
    # More than half of the samples decide, so an edge is where the coverage is a half.
    np.testing.assert_array_equal(picture.layers["object_id"], coverage > 0.5)
    # Values are of what is there, not mixed with what is not.
    some = coverage > 0.0
    assert 0.0 < coverage[some].min() < 0.3
    np.testing.assert_allclose(picture.layers["depth"][some], 4.0, rtol=1e-14)


def test_numbers_are_those_of_the_scene_and_the_header_names_them(ball):
    objects, materials = (json.loads(str(ball.settings[f"{name}_names"])) for name in ("object_id", "material_id"))
    assert [objects[str(number)] for number in (1, 2, 3)] == ["ball", "wall", "objects[2]"]
    assert [materials[str(number)] for number in (1, 2, 3)] == ["red", "grey", "objects[2].material"]
    ids = ball.layers["object_id"]
    assert ids.dtype == np.uint32
    for seen, number in zip(inside(), (1, 2), strict=True):
        np.testing.assert_array_equal(ids[seen], number)
    assert set(np.unique(ids)) == {0, 1, 2, 3}
    np.testing.assert_array_equal(ball.layers["material_id"], ids)


@pytest.mark.parametrize("rr_depth", [1, 1000])
def test_direct_and_indirect_are_all_there_is_and_direct_is_what_two_segments_bring(rr_depth):
    picture = layers(BALL, rr_depth=rr_depth)
    direct, indirect = picture.layers["direct"], picture.layers["indirect"]
    np.testing.assert_allclose(direct + indirect, picture.radiance, rtol=1e-13, atol=1e-15)
    two = layers(BALL, rr_depth=rr_depth, max_depth=2)
    np.testing.assert_allclose(direct, two.radiance, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(two.layers["direct"], two.radiance, rtol=1e-13, atol=1e-15)
    np.testing.assert_array_equal(two.layers["indirect"], 0.0)
    # There is some of both.
    assert (indirect > 0.0).mean() > 0.3


def test_radiance_keeps_its_bits(ball):
    plain = layers(BALL, aovs=())
    np.testing.assert_array_equal(ball.radiance, plain.radiance)
    np.testing.assert_array_equal(ball.layers["variance"], plain.variance)
    np.testing.assert_array_equal(ball.layers["samples"], 64)
    assert plain.layers == {}


def test_layers_are_the_same_for_any_threads_and_any_crop(ball):
    other, part = layers(BALL, threads=3), layers(BALL, threads=1, crop=(3, 5, 20, 21))
    for name in RECORDED:
        np.testing.assert_array_equal(other.layers[name], ball.layers[name])
        np.testing.assert_array_equal(part.layers[name], ball.layers[name][5:21, 3:20])


# ---- Files


def test_an_exr_file_holds_the_layers_under_names_that_others_read(ball, tmp_path):
    path = tmp_path / "a.exr"
    ball = replace(ball, layers={name: ball.layers[name] for name in ALL})
    ball.save(path)
    expected = {"R", "G", "B", "depth.Z", "distance.Z", "motion.X", "motion.Y", "object_id.ID", "material_id.ID"}
    expected |= {"coverage.A", "samples.N"}
    expected |= {f"{name}.{c}" for name in ("normal", "geometric_normal", "position") for c in "XYZ"}
    expected |= {f"{name}.{c}" for name in ("albedo", "direct", "indirect", "variance") for c in "RGB"}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert set(file.channels()) == expected
        assert file.channels()["object_id.ID"].pixels.dtype == np.uint32
        assert file.channels()["depth.Z"].pixels.dtype == np.float32
        assert json.loads(file.header()["rt.object_id_names"])["1"] == "ball"
    loaded, settings = load_layers(path)
    assert set(loaded) == {"radiance", *ALL}
    for name in ALL:
        np.testing.assert_array_equal(loaded[name], ball.layers[name].astype(np.float32))
    assert json.loads(settings["material_id_names"])["2"] == "grey"
    # Other formats hold the picture, and no layers.
    for suffix in (".png", ".npy", ".hdr", ".jpg"):
        ball.save(tmp_path / f"a{suffix}")


def test_every_aov_says_what_it_is_and_others_are_refused():
    with pytest.raises(InputError, match=r"unknown AOV 'normals'; did you mean 'normal'\?"):
        layers(BALL, aovs=("normals",))
    with pytest.raises(ValueError, match="layer depth"):
        Image(np.zeros((2, 3, 3)), layers={"depth": np.zeros((3, 2))})
    for name, spec in AOVS.specs().items():
        assert spec.__doc__
        assert 1 <= len(spec.channels) <= 3 or spec.is_per_sample
        assert f"`{name}`" in (Path(__file__).parents[3] / "docs" / "aovs.md").read_text("utf-8")


# ---- What other effects make of it


@pytest.mark.slow
def test_light_that_fog_scatters_counts_its_segments_too():
    # Scattered once in the fog is direct, and so is what comes through a pane that is half cut out; a path that ends
    # or scatters before it meets anything sees no surface.
    text = (
        CAMERA
        + """
medium: fog
media: {fog: {type: homogeneous, absorption: 0.05, scattering: 0.2}}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian}}
  - type: quad
    corner: [-1, -1, 2]
    edges: [[1, 0, 0], [0, 2, 0]]
    material: {type: cutout, opacity: 0.5, material: {type: lambertian}}
  - {type: sphere, center: [1, 1.5, 2], radius: 0.3, material: {type: emitter, radiance: 20}}
"""
    )
    names = ("direct", "indirect", "coverage", "depth")
    picture, two = (layers(text, aovs=names, lit=False, max_depth=depth) for depth in (50, 2))
    direct, indirect = picture.layers["direct"], picture.layers["indirect"]
    np.testing.assert_allclose(direct + indirect, picture.radiance, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(direct, two.radiance, rtol=1e-13, atol=1e-15)
    assert indirect.mean() > 0.1 * direct.mean()
    # Right of the pane's edge the middle sees the ball through 3 m of fog.
    assert picture.layers["coverage"][11:13, 13:16].mean() == pytest.approx(math.exp(-0.25 * 3.0), abs=0.04)


def lens_layers(objects, **opening):
    """Layers of an exposed scene by a lens, with instances and something cut out."""
    return layers(
        f"""
{lens(**opening, more=", sensor: full_frame, sensor_fit: vertical, shutter: 1/60 s, iso: 100")}
groups:
  pair:
    - {{type: sphere, center: [-0.5, 0, 0], radius: 0.4, material: {{type: lambertian, albedo: 0.25}}}}
    - {{type: sphere, center: [0.5, 0, 0], radius: 0.4, material: {{type: lambertian, albedo: 0.75}}}}
objects:
{objects}
  - {{type: instance, of: pair, transform: [{{translate: [0, 0, 99]}}]}}
  - type: quad
    corner: [-9, -9, 99]
    edges: [[18, 0, 0], [0, 18, 0]]
    material: {{type: cutout, opacity: 0, material: {{type: lambertian}}}}
""",
        aovs=("coverage", "depth", "distance", "object_id", "material_id", "albedo"),
        max_depth=2,
        filled=False,
        lit=False,
    )


def plain_layers(objects, **opening):
    """Layers of a scene by a lens, of the type of most scenes here."""
    return layers(f"{lens(**opening)}objects:\n{objects}")


def test_what_light_passes_through_is_not_seen():
    # A pane in front that is cut out all over, and a wall: the wall is what is there, at its own distance.
    cut = "{type: cutout, opacity: 0, material: {type: lambertian}}"
    pane = f"  - {{type: quad, corner: [-9, -9, 2], edges: [[18, 0, 0], [0, 18, 0]], material: {cut}}}"
    found = lens_layers(f"  - {WALL}\n{pane}").layers
    np.testing.assert_allclose(found["depth"], 4.0, rtol=1e-6)
    x, y = centres()
    np.testing.assert_allclose(found["distance"], 4.0 * np.sqrt(1.0 + x**2 + y**2), rtol=1e-3)
    np.testing.assert_array_equal(found["object_id"], 1)


def test_instances_are_objects_of_their_own():
    picture = lens_layers("""
  - {type: instance, name: upper, of: pair, transform: [{translate: [0, 0.6, 0]}]}
  - {type: instance, name: lower, of: pair, transform: [{translate: [0, -0.6, 0]}]}
  - {type: sphere, name: small, center: [0, 0, 1], radius: 0.2, material: {type: lambertian}}
""")

    def pixel(x, y, depth):
        return int(SIZE / 2 - y / depth / PIXEL), int(SIZE / 2 + x / depth / PIXEL)

    expected = {(-0.5, 0.6): (1, 0.25), (0.5, 0.6): (1, 0.75), (-0.5, -0.6): (2, 0.25), (0.5, -0.6): (2, 0.75)}
    for (x, y), (number, albedo) in expected.items():
        at = pixel(x, y, 3.6)
        assert picture.layers["object_id"][at] == number
        np.testing.assert_allclose(picture.layers["albedo"][at], albedo, rtol=1e-14)
    assert picture.layers["object_id"][pixel(0, 0, 2.8)] == 3
    names = json.loads(str(picture.settings["material_id_names"]))
    assert names[str(picture.layers["material_id"][pixel(0.5, 0.6, 3.6)])] == "groups.pair[1].material"


@pytest.mark.parametrize("taken", [plain_layers, lens_layers])
def test_rays_that_a_rim_stops_are_no_holes_in_a_surface(taken):
    # A wall fills the picture, and a rim cuts most of the light in its corners; what comes through sees the wall alone.
    picture = taken(f"  - {WALL}", aperture=25, rim=25)
    np.testing.assert_array_equal(picture.layers["coverage"], 1.0)
    np.testing.assert_array_equal(picture.layers["object_id"], 1)
    np.testing.assert_allclose(picture.layers["depth"], 4.0, rtol=1e-6)
    open_lens = taken(f"  - {WALL}", aperture=25).radiance
    assert picture.radiance[0, 0, 0] < 0.6 * open_lens[0, 0, 0]
