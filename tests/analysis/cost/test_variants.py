"""Variants leave out what they say and as little else as can be, and keep the brightness where it is no effect."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from raytracer.analysis.cost.removals import in_all_materials
from raytracer.analysis.cost.variants import REPEAT, Variant, make_variants, reasons_without_variant, select_variants
from raytracer.core.fresnel import REC709_LUMINANCE
from raytracer.core.motion.resolve import matrix_at
from raytracer.film.window import Window
from raytracer.plugins.lights.background import Background
from raytracer.plugins.lights.base.interface import Lights
from raytracer.rendering.compilation import compile_scene
from raytracer.rendering.tile_renderer import render_tiles
from raytracer.rendering.tile_scheduler import split_into_tiles
from raytracer.scene.effects import effects_of
from raytracer.scene.load import build, load
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import MATERIALS, MEDIA, SHAPES, TEXTURES
from raytracer.schema.transform import matrix_of
from raytracer.util.errors import InputError
from tests.plugins.cameras.kernels import weighted_rays

SCENES = Path(__file__).parents[3] / "scenes"

# Of these, which have all families of effects between them, packing takes no time; of the others a while.
QUICK = {"aperture", "cornell", "fan", "glass", "iso_noise", "shutter", "smoke", "textures", "train"}

# What an effect takes along when it goes, besides what is below: a lens its shape and rim, a shutter what it does.
TAKES: dict[str, set[str]] = {
    "defocus": {"aperture_shape", "vignetting"},
    "motion_blur": {"shutter_curve", "rolling_shutter", "camera_shake"},
    "camera_shake": {"motion_blur"},
    "environment": {"environment_sampling", "light.sun", "light_sampling"},
    "environment_sampling": {"light_sampling"},
    "media": {f"medium.{kind}" for kind in MEDIA.specs()},
    "light_sampling=paths": {"light_sampling", "environment_sampling"},
    "light": {"light_sampling"},
    "texture": {"relief"},
    # Of a lens of glass all its errors go; without what it reflects, colours of its coating too.
    "real_lens": {"vignetting", "projection", "dispersion", "flare"},
    "flare": {"dispersion"},
    # Of a material its textures go, what it was made of, the light that it gave, and the holes that it had.
    "material": {"light_sampling", "passage", "nested_dielectrics", "dispersion"}
    | {f"texture.{kind}" for kind in TEXTURES.specs()}
    | {f"material.{kind}" for kind in MATERIALS.specs()},
}

SMALL = """
film: {width: 8, height: 4}
camera: {type: pinhole, look_at: [0, 0, -5]}
environment: {type: constant, radiance: 1}
objects: [{type: sphere, center: [0, 0, -5], radius: 1}]
"""


def text(**parts):
    """SMALL with other values of some keys."""
    lines = [line for line in SMALL.strip().splitlines() if line.split(":")[0] not in parts]
    return "\n".join([*lines, *(f"{key}: {value}" for key, value in parts.items())])


def small(**parts):
    return build(text(**parts), "test.yaml")


def active(spec, scene):
    return {name for name, effect in effects_of(spec, scene).items() if effect.active}


def without(spec, name):
    """The checked and the packed scene of a variant."""
    packed = pack(spec)
    (variant,) = [item for item in make_variants(packed.spec, packed) if item.name == name]
    made = variant.pack(packed.spec)
    return made.spec, variant.packed_variant(made.scene)


@cache
def of_file(path):
    packed = pack(load(path))
    return packed.spec, packed


def equal(a, b):
    """Tell if packed values are of the same types, with the same bits."""
    if type(a) is not type(b):
        return False
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(equal, a, b))
    return bool(np.array_equal(a, b, equal_nan=True)) if isinstance(a, np.ndarray) else bool(a == b)


every_scene = pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[] if path.stem in QUICK else [pytest.mark.slow])
        for path in sorted([*SCENES.glob("*.yaml"), *(SCENES / "lecture").glob("*.yaml")])
    ],
)


# ---- Of all scenes


@every_scene
def test_each_variant_leaves_out_its_effect_and_nothing_else(path):
    spec, packed = of_file(path)
    before = active(spec, packed.scene)
    for variant in make_variants(spec, packed):
        changed = variant.spec_variant(spec)
        again = variant.pack(spec) if variant.needs_repacking else packed
        after = active(changed, variant.packed_variant(again.scene))
        name = variant.name.partition("=")[0] if variant.name.startswith(("roulette", "max_depth")) else variant.name
        if variant.group == "effect":
            assert name in before
            assert name not in after
        taken = TAKES.get(name, set()) | TAKES.get(name.partition(".")[0], set()) | {name}
        taken |= {"roulette"} if name == "max_depth" else set()
        assert before - after <= taken, variant.name
        # What takes a material's place can be lit, and paths of few segments or many may need roulette no more.
        added = (
            {"material.lambertian", "light_sampling", "environment_sampling"} if "material" in name else {"roulette"}
        )
        assert after - before <= added, variant.name


@every_scene
def test_what_need_not_be_packed_anew_is_what_packing_gives(path):
    spec, packed = of_file(path)
    shared = [variant for variant in make_variants(spec, packed) if not variant.needs_repacking]
    assert {variant.group for variant in shared} >= {"control", "sampler"}
    for variant in shared:
        scene, changed = variant.packed_variant(packed.scene), variant.spec_variant(spec)
        anew = packed.scene if changed is spec else pack(changed).scene
        assert equal(scene, variant.packed_variant(anew)), variant.name
        # Of settings the checked scene alone says all.
        assert variant.group == "effect" or equal(scene, anew), variant.name


@every_scene
def test_every_active_effect_has_a_variant_or_a_reason(path):
    spec, packed = of_file(path)
    reasons = reasons_without_variant(spec, packed)
    names = {variant.name for variant in make_variants(spec, packed)}
    of_settings = {name.partition("=")[0] for name in names if "=" in name}
    for effect in active(spec, packed.scene):
        assert (effect in names) + (effect in of_settings) + (effect in reasons) == 1, effect
    assert all(reasons.values())


@every_scene
def test_no_variant_changes_what_is_asked_of_the_picture(path):
    spec, packed = of_file(path)
    found = make_variants(spec, packed)
    assert found[0].name == REPEAT
    assert len({variant.name for variant in found}) == len(found)
    for variant in found:
        changed = variant.spec_variant(spec)
        assert changed.film == spec.film
        assert (changed.render.spp, changed.render.seed) == (spec.render.spp, spec.render.seed)
        width, height = spec.film.width, spec.film.height
        if variant.name == "real_lens":
            continue
        assert changed.camera.describe(width, height) == pytest.approx(spec.camera.describe(width, height), rel=1e-9)
        # Also for how long the film is exposed, and how.
        before, after = (item.camera.exposure_settings(width, height) for item in (spec, changed))
        assert (before is None) == (after is None)
        if before is not None and after is not None:
            assert after.seconds == pytest.approx(before.seconds, rel=1e-12)
            assert after._replace(seconds=None) == before._replace(seconds=None)


def test_the_control_is_the_scene():
    spec = small()
    packed = pack(spec)
    control = make_variants(spec, packed)[0]
    assert (control.name, control.group) == ("A/A", "control")
    assert control.spec_variant(spec) is spec
    assert control.packed_variant(packed.scene) is packed.scene


def test_what_is_the_same_picture_says_so():
    spec = small(environment="{type: sky}", render="{max_depth: 20}")
    same = {variant.name for variant in make_variants(spec, pack(spec)) if variant.same_mean}
    ways = {"environment_sampling", "light_sampling=lights", "light_sampling=paths"}
    assert same == {REPEAT, "roulette=off", "sampler=independent", "sampler=stratified", *ways}


@pytest.mark.slow
def test_what_is_the_same_picture_is():
    # A ball in the light of a sky: what differs is noise, of four independent pictures of each.
    spec = build(text(film="{width: 16, height: 16}", environment="{type: sky}", render="{spp: 128}"), "test.yaml")
    scene = compile_scene(spec)
    windows = split_into_tiles(Window(0, 0, 16, 16))

    def means(prepared, seed):
        return np.array([render_tiles(prepared, windows, 128, seed + i, 2).mean.mean() for i in range(4)])

    expected = means(scene, 0)
    for variant in make_variants(scene.spec, scene.packed):
        if variant.name in ("environment_sampling", "sampler=independent", "roulette=on", "roulette=off"):
            changed = compile_scene(scene.spec, variant.pack(scene.spec))
            found = means(changed._replace(scene=variant.packed_variant(changed.scene)), 100)
            deviation = np.sqrt((found.var(ddof=1) + expected.var(ddof=1)) / 4.0)
            assert abs(found.mean() - expected.mean()) < 5.0 * deviation
            assert deviation < 0.01 * expected.mean()


# ---- Cameras

LENS = (
    "{type: thin_lens, look_at: [0, 0, -5], sensor: full_frame, focal_length: 50 mm, f_number: 2, focus_distance: 4, "
    "shutter: 1/100 s, iso: 100, aperture_shape: {type: polygon, blades: 5}, "
    "vignetting: {diameter: 60 mm, distance: 50 mm}}"
)


@pytest.mark.parametrize("pupil", ["aplanatic", "flat"])
def test_a_lens_without_its_opening_lets_in_as_much_light(pupil):
    # Without a rim: that one takes light away by being there.
    camera = LENS.replace(", vignetting: {diameter: 60 mm, distance: 50 mm}", "").replace("iso", f"pupil: {pupil}, iso")
    spec = small(camera=camera)
    wide, (_, point) = pack(spec).scene.camera, without(spec, "defocus")
    x = np.repeat([0.5, 4.0, 7.5], 40000)
    before, after = (weighted_rays(packed, x, 2.0)[2].reshape(3, -1).mean(axis=1) for packed in (wide, point.camera))
    if pupil == "flat":
        # An even disc of light 25 mm wide, 50 mm * 4000 / 3950 from the film: 1 / (1 + 4 N^2), and not 1 / (4 N^2).
        n = 50.0 * 4000.0 / 3950.0 / 25.0
        assert after[1] / before[1] == pytest.approx((1.0 + 4.0 * n * n) / (4.0 * n * n), rel=1e-3)
    else:
        # Off the axis rays through the edge of the lens differ in angle by 12.5 mm / 4 m, on average by nothing.
        np.testing.assert_allclose(after, before, rtol=4.0 * 0.0125 / 4.0 / np.sqrt(40000.0) * 4.0)
    assert point.camera.irradiance == wide.irradiance


def test_a_lens_keeps_what_is_not_left_out():
    spec = small(camera=LENS)
    lens = pack(spec).scene.camera.lens
    _, unshaped = without(spec, "aperture_shape")
    assert unshaped.camera.lens == lens._replace(shape=None)
    _, rimless = without(spec, "vignetting")
    assert rimless.camera.lens.rim is None
    assert equal(rimless.camera.lens.shape, lens.shape)


def test_a_moving_camera_loses_its_lens_and_not_its_motion():
    spec = small(camera=LENS[:-1] + ", motion: {velocity: [1, 0, 0]}}")
    _, scene = without(spec, "defocus")
    assert scene.camera.camera.lens is None
    assert equal(scene.camera.trajectories, pack(spec).scene.camera.trajectories)


DOUBLE_GAUSS = SCENES / "lenses" / "double-gauss-50mm.yaml"

GLASS = (
    f"{{type: lens, lens: '{DOUBLE_GAUSS}', look_at: [0, 0, -5], f_number: 4, focus_distance: 4, "
    "shutter: 1/100 s, iso: 100, flare: true, aperture_shape: {type: polygon, blades: 5}}"
)


def test_a_lens_of_glass_goes_as_a_whole_or_by_what_it_does():
    spec = small(camera=GLASS)
    packed = pack(spec)
    found = {item.name for item in make_variants(spec, packed) if item.group == "effect"}
    assert {"real_lens", "dispersion", "flare", "aperture_shape"} <= found
    reasons = reasons_without_variant(spec, packed)
    for name in ("defocus", "vignetting"):
        assert "see real_lens" in reasons[name]
    assert "projection" in reasons
    _, dark = without(spec, "flare")
    assert dark.camera.flare is None
    assert dark.spectrum is not None
    _, grey = without(spec, "dispersion")
    assert grey.spectrum is None
    assert grey.camera.surfaces.indices is None
    _, rounded = without(spec, "aperture_shape")
    assert rounded.camera.surfaces.diaphragm is None


@pytest.mark.parametrize("focus", ["4", ".inf"])
def test_the_thin_lens_in_place_of_glass_shows_as_much_as_brightly(focus):
    spec = small(camera=GLASS.replace("focus_distance: 4", f"focus_distance: {focus}").replace("flare: true, ", ""))
    changed, scene = without(spec, "real_lens")
    assert changed.camera.type == "thin_lens"
    assert scene.camera.lens.shape is not None
    before, after = (item.camera.describe(800, 400) for item in (spec, changed))
    for key in ("sensor_width_mm", "film_width_mm", "pixel_pitch_um", "focus_distance_m", "ev100"):
        assert after[key] == pytest.approx(before[key], rel=0.01), key
    for key in ("entrance_pupil_mm", "image_distance_mm", "pixel_at_1m_mm", "magnification"):
        assert after[key] == pytest.approx(before[key], rel=1e-6), key
    # Of glass with distortion and a pupil with aberrations.
    for key in ("f_number", "hfov_deg", "vfov_deg", "focal_length_mm"):
        assert after[key] == pytest.approx(before[key], rel=0.03), key
    x = np.full(40000, 4.0)
    real, ideal = (weighted_rays(camera, x, 2.0)[2] for camera in (pack(spec).scene.camera, scene.camera))
    assert ideal.mean() == pytest.approx(real.mean(), rel=0.03)


def test_glass_of_the_scene_bends_all_colours_alike():
    prism = "{type: sphere, center: [0, 0, -5], radius: 1, material: {type: dielectric, ior: N-SF10}}"
    spec = small(objects=f"[{prism}]")
    assert pack(spec).scene.spectrum is not None
    changed, scene = without(spec, "dispersion")
    assert scene.spectrum is None
    assert changed.camera == spec.camera
    plain = small(objects=f"[{prism.replace('N-SF10', '1.72828')}]")
    (ours,), (expected,) = scene.materials, pack(plain).scene.materials
    assert type(ours) is type(expected)
    for name in ours._fields:
        if isinstance(getattr(ours, name), np.ndarray):
            np.testing.assert_allclose(getattr(ours, name), getattr(expected, name), rtol=0.0, atol=1e-5)


CURVED = "{opening: [[0, 0], [2 ms, 1], [4 ms, 0.5], [10 ms, 0]], open: 1}"


def test_a_shutter_without_ramps_exposes_for_as_long_about_the_same_time():
    spec = small(
        camera=f"{{type: pinhole, shutter: {CURVED}}}",
        objects="[{type: sphere, center: [0, 0, -5], radius: 1, motion: {velocity: [0, 1, 0]}}]",
    )
    changed, scene = without(spec, "shutter_curve")
    assert scene.shutter.curve is None
    before, after = spec.camera.timing(), changed.camera.timing()
    # 1 + 1.5 + 1.5 ms; and three triangles' and a rectangle's centroids, by hand.
    assert before.seconds() == pytest.approx(4e-3)
    assert after.seconds() == pytest.approx(4e-3)
    centroid = 1.0 + (1.0 * 4 / 3 + 1.0 * 3.0 + 0.5 * 8 / 3 + 1.5 * 6.0) / 4.0 * 1e-3
    assert 0.5 * (after.opens + after.closes) == pytest.approx(centroid, rel=1e-12)


def test_a_shutter_without_a_readout_exposes_all_when_the_middle_was():
    spec = small(
        camera="{type: pinhole, shutter: {open: 2, duration: 10 ms, readout: 30 ms, opening: trapezoid, ramp: 1 ms}}",
        objects="[{type: sphere, center: [0, 0, -5], radius: 1, motion: {velocity: [0, 1, 0]}}]",
    )
    changed, scene = without(spec, "rolling_shutter")
    assert scene.shutter.scan is None
    assert scene.shutter.curve is not None
    timing = changed.camera.timing()
    assert timing.opens == pytest.approx(2.015)
    assert timing.seconds() == pytest.approx(10e-3)


MOVING = """[
  {type: sphere, name: ball, center: [0, 0, -5], radius: 1, motion: {velocity: [0, 2, 0]}},
  {type: instance, of: pair, transform: [{scale: 2}], motion: {spin: {axis: [0, 0, 1], rate: 90}}},
  {type: quad, corner: [0, 0, 0], edges: [[1, 0, 0], [0, 1, 0]]}]"""


def test_nothing_moves_in_the_middle_of_the_exposure():
    spec = small(
        camera="{type: pinhole, shutter: {open: 1, close: 2}, motion: {velocity: [0.2, 0, 0]}, "
        "shake: {amplitude: 0.1, bandwidth: 5}}",
        objects=MOVING,
        groups="{pair: [{type: sphere, center: [1, 0, 0], radius: 0.5, motion: {velocity: [0, 0, 4]}}]}",
    )
    changed, scene = without(spec, "motion_blur")
    assert scene.shutter is None
    assert scene.instances is None or scene.instances.trajectories is None
    assert changed.camera.look_from == pytest.approx((0.3, 0.0, 0.0))
    ball, pair, quad = changed.objects
    assert ball.name == "ball"
    np.testing.assert_allclose(matrix_of(ball.transform)[:3, 3], [0.0, 3.0, 0.0])
    motion = spec.objects[1].motion
    assert motion is not None
    turned = matrix_at(motion, 1.5) @ np.diag([2.0, 2.0, 2.0, 1.0])
    np.testing.assert_allclose(matrix_of(pair.transform), turned)
    assert quad is spec.objects[2]
    np.testing.assert_allclose(matrix_of(changed.groups["pair"][0].transform)[:3, 3], [0.0, 0.0, 6.0])


def test_a_mesh_of_frames_rests_in_the_nearest_one():
    frames = [{"time": float(time), "file": f"{name}.ply"} for time, name in enumerate("abc")]
    mesh = TypeAdapter(SHAPES.union()).validate_python({"type": "mesh", "frames": frames})
    assert (mesh.at_time(1.4).file, mesh.at_time(1.4).frames) == ("b.ply", None)
    assert mesh.at_time(9.0).file == "c.ply"


def test_a_shaking_camera_is_held_and_has_no_second_variant():
    spec = small(camera="{type: pinhole, shutter: 1/10 s, shake: {amplitude: 0.1, bandwidth: 10}}")
    _, scene = without(spec, "camera_shake")
    assert scene.shutter is None
    assert "camera_shake" in reasons_without_variant(spec, pack(spec))["motion_blur"]


# ---- Light


def test_light_that_is_all_there_is_stays():
    lamp = "[{type: quad, corner: [0, 4, 0], edges: [[1, 0, 0], [0, 0, 1]], material: {type: emitter, radiance: 3}}]"
    alone = small(environment="{type: constant, radiance: 0}", objects=lamp)
    assert "all the light" in reasons_without_variant(alone, pack(alone))["material.emitter"]
    both = small(objects=lamp)
    reasons = reasons_without_variant(both, pack(both))
    assert not {"environment", "material.emitter"} & set(reasons)
    sunny = small(environment="{type: sky, sun: true}")
    reasons = reasons_without_variant(sunny, pack(sunny))
    assert "all the light" in reasons["environment"]
    assert "light.sun" not in reasons


def test_the_sun_of_a_sky_goes_without_the_sky():
    spec = small(environment="{type: sky, sun: true}")
    _, scene = without(spec, "light.sun")
    assert [type(table) for table in scene.lights.tables] == [Background]
    assert equal(scene.environment, pack(spec).scene.environment)


def test_an_environment_that_is_not_aimed_at_is_met_by_paths():
    spec = small(environment="{type: sky}", lights="[{type: point, position: [0, 2, 0], intensity: 1}]")
    before = pack(spec).scene
    _, scene = without(spec, "environment_sampling")
    assert isinstance(scene.lights, Lights)
    assert not any(isinstance(table, Background) for table in scene.lights.tables)
    assert scene.lights.background_tables is scene.environment
    assert len(scene.lights.tables) == len(before.lights.tables) - 1
    alone = without(small(environment="{type: sky}"), "environment_sampling")[1]
    assert alone.lights is None


def test_paths_are_offered_where_they_find_all_light():
    def offered(**parts):
        spec = small(**parts)
        return {item.name for item in make_variants(spec, pack(spec)) if item.name.startswith("light_sampling")}

    both = {"light_sampling=lights", "light_sampling=paths"}
    assert offered() == set()
    assert offered(environment="{type: sky}") == both
    assert offered(lights="[{type: point, position: [0, 2, 0], intensity: 1}]") == {"light_sampling=lights"}
    aimless = offered(environment="{type: sky}", render="{light_sampling: paths}")
    assert aimless == {"light_sampling=mis", "light_sampling=lights"}


def test_a_flash_takes_its_pulses_along():
    spec = small(
        camera="{type: pinhole, shutter: {duration: 1/50 s, readout: 1/100 s}}",
        lights="[{type: flash, energy: 1, position: [0, 1, 0]}]",
    )
    assert pack(spec).scene.shutter.pulses is not None
    _, scene = without(spec, "light.flash")
    assert scene.shutter is None
    assert scene.lights is None


# ---- Media

FOGS = """{
  thin: {type: homogeneous, extinction: 0.1, albedo: 0.5}, thick: {type: homogeneous, extinction: 3, albedo: 0.9},
  cloud: {type: grid, file: cloud.npy, min: [0, 0, 0], max: [1, 1, 1], extinction: 1, albedo: 0.8}}"""


def _media(kinds, tmp_path):
    np.save(tmp_path / "cloud.npy", np.full((2, 2, 2), 0.5, np.float32))
    written = text(media=FOGS, medium="thin", objects=kinds)
    return build(written, "test.yaml", base=tmp_path)


def test_media_of_one_kind_go_and_others_keep_their_places(tmp_path):
    spec = _media(
        "[{type: sphere, center: [0, 0, -5], radius: 1, medium: thick}, "
        "{type: sphere, center: [3, 0, -5], radius: 1, medium: cloud}, {type: sphere, center: [6, 0, -5], radius: 1}]",
        tmp_path,
    )
    before = pack(spec).scene.media
    kinds = [type(table).__module__.rpartition(".")[2] for table in before.tables]
    assert kinds == ["grid", "homogeneous"]
    for gone, left in (("grid", "homogeneous"), ("homogeneous", "grid")):
        _, scene = without(spec, f"medium.{gone}")
        (table,) = scene.media.tables
        assert equal(table, before.tables[kinds.index(left)])
        for name in ("inside", "outside", "camera"):
            old, new = np.atleast_1d(getattr(before, name)), np.atleast_1d(getattr(scene.media, name))
            assert new.dtype == old.dtype or name == "camera"
            for was, now in zip(old.tolist(), new.tolist(), strict=True):
                # Of two kinds, a medium's reference is row * 2 + kind; of one, its row.  Vacuum and "as before" stay.
                expected = was if was < 0 else (was // 2 if kinds[was % 2] == left else -1)
                assert now == expected


def test_clear_space_keeps_the_boundaries_of_its_media(tmp_path):
    spec = _media("[{type: sphere, center: [0, 0, -5], radius: 1, medium: thick}]", tmp_path)
    _, scene = without(spec, "media")
    assert equal(scene, pack(spec).scene._replace(media=None))


# ---- Materials and textures


def replaced_materials(spec, name):
    """The materials that are packed of a variant, in the order of the objects."""
    packed = pack(spec)
    (variant,) = [item for item in make_variants(packed.spec, packed) if item.name == name]
    assert variant.material_variant is not None
    change, made = in_all_materials(variant.material_variant), list[Any]()

    def noted(material, book):
        made.append(change(material, book))
        return made[-1]

    pack(spec, material_variant=noted)
    return made


def of(material, **parts):
    return small(objects=f"[{{type: sphere, center: [0, 0, -5], radius: 1, material: {material}}}]", **parts)


CHECKER = "{type: checker, scale: 1, even: [0.2, 0.4, 0.6], odd: [0.6, 0.8, 1.0]}"
MEAN = (0.4, 0.6, 0.8)


@pytest.mark.parametrize(
    ("kind", "values", "albedo"),
    [
        ("metal", "albedo: [0.9, 0.6, 0.3], fuzz: 0.2", (0.9, 0.6, 0.3)),
        ("metal", f"albedo: {CHECKER}", MEAN),
        ("dielectric", "ior: 1.5", (1.0, 1.0, 1.0)),
        ("thin_dielectric", "color: [0.5, 0.7, 0.9]", (0.5, 0.7, 0.9)),
        ("emitter", "radiance: 5", (0.0, 0.0, 0.0)),
        # The coat of index 1.5 reflects 4 %, and the body gets the rest.
        ("principled", "base_color: 0.5", (0.52, 0.52, 0.52)),
    ],
)
def test_a_material_becomes_a_matte_one_that_reflects_as_much(kind, values, albedo):
    (found,) = replaced_materials(of(f"{{type: {kind}, {values}}}"), f"material.{kind}")
    assert found.type == "lambertian"
    np.testing.assert_allclose(found.albedo, np.array(albedo), rtol=1e-12)


def test_a_matte_stand_in_keeps_the_relief():
    spec = of(f"{{type: metal, albedo: 0.9, bump: {CHECKER}, bump_height: 2 mm}}")
    (found,) = replaced_materials(spec, "material.metal")
    (original,) = [item.material for item in spec.objects]
    assert (found.bump, found.bump_height) == (original.bump, original.bump_height)


def test_a_selector_becomes_what_it_mostly_shows():
    first, second = "{type: metal, albedo: 0.9}", "{type: lambertian, albedo: 0.1}"
    for weight, kind in ((0.4, "metal"), (0.6, "lambertian"), ("{type: noise, low: 0.6, high: 1}", "lambertian")):
        (found,) = replaced_materials(
            of(f"{{type: mixture, materials: [{first}, {second}], weight: {weight}}}"), "material.mixture"
        )
        assert found.type == kind
    (found,) = replaced_materials(of(f"{{type: two_sided, front: {first}, back: {second}}}"), "material.two_sided")
    assert found.type == "metal"
    spec = of(f"{{type: cutout, material: {first}, opacity: 0.5}}")
    (found,) = replaced_materials(spec, "material.cutout")
    assert found.type == "metal"
    assert without(spec, "material.cutout")[1].transparency is None


def test_selectors_in_selectors_of_their_kind_go_too():
    inner = "{type: mixture, materials: [{type: metal}, {type: dielectric}], weight: 0.7}"
    spec = of(f"{{type: mixture, materials: [{inner}, {{type: lambertian}}], weight: 0.2}}")
    (found,) = replaced_materials(spec, "material.mixture")
    assert found.type == "dielectric"
    within = of(f"{{type: cutout, material: {inner}, opacity: 0.5}}")
    (found,) = replaced_materials(within, "material.mixture")
    assert (found.type, found.material.type) == ("cutout", "dielectric")


def test_what_a_selector_shows_is_replaced_in_it():
    spec = of("{type: mixture, materials: [{type: metal, albedo: 0.9}, {type: dielectric}], weight: 0.5}")
    (found,) = replaced_materials(spec, "material.metal")
    assert [child.type for child in found.children().values()] == ["lambertian", "dielectric"]
    # A material of two equal ones is that one.
    spec = of("{type: mixture, materials: [{type: metal, albedo: 0.9}, {type: lambertian, albedo: 0.9}]}")
    (found,) = replaced_materials(spec, "material.metal")
    assert (found.type, found.albedo) == ("lambertian", (0.9, 0.9, 0.9))


def test_a_boundary_has_nothing_to_become():
    spec = of("{type: boundary}")
    reasons = reasons_without_variant(spec, pack(spec))
    assert {"material.boundary", "passage"} <= set(reasons)


def test_textures_become_their_means_and_reliefs_nothing():
    spec = of(
        f"{{type: principled, base_color: {CHECKER}, roughness: {CHECKER}, bump: {CHECKER}, bump_height: 1 mm, "
        "metallic: {type: noise, low: 0.2, high: 0.6}}",
    )
    (found,) = replaced_materials(spec, "texture.checker")
    np.testing.assert_allclose(found.base_color, np.array(MEAN))
    np.testing.assert_allclose(found.roughness, np.dot(MEAN, REC709_LUMINANCE))
    assert found.bump is None
    assert found.metallic.type == "noise"
    scene = without(spec, "texture.checker")[1]
    assert scene.normal_mapping is None
    assert len(scene.textures) == 1


def test_holes_become_as_many_on_average():
    opacity = "{type: checker, scale: 1, even: 0.0, odd: 0.8}"
    (found,) = replaced_materials(
        of(f"{{type: cutout, material: {{type: metal}}, opacity: {opacity}, threshold: 0.5}}"), "texture.checker"
    )
    assert found.opacity == pytest.approx(0.4)
    assert found.threshold is None


def test_materials_of_a_files_own_are_replaced_too():
    spec, packed = of_file(SCENES / "studio.yaml")
    (variant,) = [item for item in make_variants(spec, packed) if item.name == "material.principled"]
    radio = spec.model_copy(update={"objects": tuple(item for item in spec.objects if item.name == "radio")})
    kinds = {type(table).__module__ for table in pack(radio).scene.materials}
    assert "raytracer.plugins.materials.principled" in kinds
    after = {type(table).__module__ for table in variant.pack(radio).scene.materials}
    assert after == {"raytracer.plugins.materials.lambertian"}


# ---- Names


def named(*names):
    return [Variant(REPEAT, "control", "."), *(Variant(name, "effect", ".") for name in names)]


def test_variants_are_chosen_by_name_with_the_control():
    found = named("defocus", "accuracy=fast", "max_depth=4")
    assert [item.name for item in select_variants(found, ["max_depth=4", "defocus"])] == [
        REPEAT,
        "defocus",
        "max_depth=4",
    ]
    assert [item.name for item in select_variants(found, [])] == [REPEAT]


def test_an_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(InputError, match="unknown variant 'defokus'; did you mean 'defocus'"):
        select_variants(named("defocus"), ["defokus"])
    with pytest.raises(InputError, match="no variant without environment: it is all the light that there is"):
        select_variants(named("defocus"), ["environment"], {"environment": "it is all the light that there is"})
