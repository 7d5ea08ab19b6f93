"""Variants leave out what they say and as little else as can be, and keep the brightness where it is no effect."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter

from raytracer.analysis.cost.removals import in_all_materials
from raytracer.analysis.cost.variants import REPEAT, make_variants, reasons_without_variant
from raytracer.core.fresnel import REC709_LUMINANCE
from raytracer.core.motion.resolve import matrix_at
from raytracer.film.window import Window
from raytracer.plugins.lights.background import Background
from raytracer.rendering.compilation import compile_scene
from raytracer.rendering.tile_renderer import render_tiles
from raytracer.rendering.tile_scheduler import split_into_tiles
from raytracer.scene.effects import effects_of
from raytracer.scene.load import build, load
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import MATERIALS, MEDIA, SHAPES, TEXTURES
from raytracer.schema.transform import matrix_of
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
    lines = [line for line in SMALL.strip().splitlines() if line.split(":")[0] not in parts]
    return "\n".join([*lines, *(f"{key}: {value}" for key, value in parts.items())])


def small(**parts):
    return build(text(**parts), "test.yaml")


def active(spec, scene):
    return {name for name, effect in effects_of(spec, scene).items() if effect.active}


def without(spec, name, packed=None):
    packed = packed or pack(spec)
    (variant,) = [item for item in make_variants(packed.spec, packed) if item.name == name]
    made = variant.pack(packed.spec)
    return made.spec, variant.packed_variant(made.scene)


@cache
def of_file(path):
    packed = pack(load(path))
    return packed.spec, packed


def equal(a, b):
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
    width, height = spec.film.width, spec.film.height
    for variant in found:
        changed = variant.spec_variant(spec)
        assert changed.film == spec.film
        assert (changed.render.spp, changed.render.seed) == (spec.render.spp, spec.render.seed)
        if variant.name == "real_lens":
            continue
        assert changed.camera.describe(width, height) == pytest.approx(spec.camera.describe(width, height), rel=1e-9)
        # Also for how long the film is exposed, and how.
        before, after = (item.camera.exposure_settings(width, height) for item in (spec, changed))
        assert (before is None) == (after is None)
        if before is not None:
            assert after.seconds == pytest.approx(before.seconds, rel=1e-12)
            assert after._replace(seconds=None) == before._replace(seconds=None)


def test_what_is_the_same_picture_says_so_and_the_control_is_the_scene():
    spec = small(environment="{type: sky}", render="{max_depth: 20}")
    packed = pack(spec)
    control, *_ = found = make_variants(spec, packed)
    assert (control.name, control.group) == ("A/A", "control")
    assert control.spec_variant(spec) is spec
    assert control.packed_variant(packed.scene) is packed.scene
    ways = {"environment_sampling", "light_sampling=lights", "light_sampling=paths"}
    same = {variant.name for variant in found if variant.same_mean}
    assert same == {REPEAT, "roulette=off", "sampler=independent", "sampler=stratified", *ways}


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


DOUBLE_GAUSS = SCENES / "lenses" / "double-gauss-50mm.yaml"

GLASS = (
    f"{{type: lens, lens: '{DOUBLE_GAUSS}', look_at: [0, 0, -5], f_number: 4, focus_distance: 4, "
    "shutter: 1/100 s, iso: 100, flare: true, aperture_shape: {type: polygon, blades: 5}}"
)


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
    turned = matrix_at(spec.objects[1].motion, 1.5) @ np.diag([2.0, 2.0, 2.0, 1.0])
    np.testing.assert_allclose(matrix_of(pair.transform), turned)
    assert quad is spec.objects[2]
    np.testing.assert_allclose(matrix_of(changed.groups["pair"][0].transform)[:3, 3], [0.0, 0.0, 6.0])
    # Of a mesh of frames the nearest one rests.
    frames = [{"time": float(time), "file": f"{name}.ply"} for time, name in enumerate("abc")]
    mesh = TypeAdapter(SHAPES.union()).validate_python({"type": "mesh", "frames": frames})
    assert (mesh.at_time(1.4).file, mesh.at_time(1.4).frames, mesh.at_time(9.0).file) == ("b.ply", None, "c.ply")


def test_a_lens_loses_what_is_left_out_and_nothing_else():
    spec = small(camera=LENS[:-1] + ", motion: {velocity: [1, 0, 0]}}")
    whole = pack(spec).scene.camera
    for name, lens in (
        ("defocus", None),
        ("aperture_shape", whole.camera.lens._replace(shape=None)),
        ("vignetting", whole.camera.lens._replace(rim=None)),
    ):
        camera = without(spec, name)[1].camera
        assert equal(camera.camera.lens, lens)
        assert equal(camera.trajectories, whole.trajectories)


def test_a_lens_of_glass_goes_as_a_whole_or_by_what_it_does():
    spec = small(camera=GLASS)
    packed = pack(spec)
    reasons = reasons_without_variant(spec, packed)
    assert all("see real_lens" in reasons[name] for name in ("defocus", "vignetting"))
    assert "projection" in reasons
    dark = without(spec, "flare", packed)[1]
    assert dark.camera.flare is None
    assert dark.spectrum is not None
    grey = without(spec, "dispersion", packed)[1]
    assert grey.spectrum is None
    assert grey.camera.surfaces.indices is None
    assert without(spec, "aperture_shape", packed)[1].camera.surfaces.diaphragm is None


BALL = "[{type: sphere, center: [0, 0, -5], radius: 1, motion: {velocity: [0, 1, 0]}}]"


def test_shutters_without_ramps_or_readout_expose_for_as_long_about_the_same_time():
    curved = "{opening: [[0, 0], [2 ms, 1], [4 ms, 0.5], [10 ms, 0]], open: 1}"
    changed, scene = without(small(camera=f"{{type: pinhole, shutter: {curved}}}", objects=BALL), "shutter_curve")
    assert scene.shutter.curve is None
    # 1 + 1.5 + 1.5 ms; and three triangles' and a rectangle's centroids, by hand.
    timing = changed.camera.timing()
    assert timing.seconds() == pytest.approx(4e-3)
    centroid = 1.0 + (1.0 * 4 / 3 + 1.0 * 3.0 + 0.5 * 8 / 3 + 1.5 * 6.0) / 4.0 * 1e-3
    assert 0.5 * (timing.opens + timing.closes) == pytest.approx(centroid, rel=1e-12)
    read = "{open: 2, duration: 10 ms, readout: 30 ms, opening: trapezoid, ramp: 1 ms}"
    changed, scene = without(small(camera=f"{{type: pinhole, shutter: {read}}}", objects=BALL), "rolling_shutter")
    assert scene.shutter.scan is None
    assert scene.shutter.curve is not None
    assert changed.camera.timing().opens == pytest.approx(2.015)
    assert changed.camera.timing().seconds() == pytest.approx(10e-3)


# ---- Light and media

LAMP = "[{type: quad, corner: [0, 4, 0], edges: [[1, 0, 0], [0, 0, 1]], material: {type: emitter, radiance: 3}}]"
POINT = "[{type: point, position: [0, 2, 0], intensity: 1}]"


@pytest.mark.parametrize(
    ("parts", "names"),
    [
        ({"environment": "{type: constant, radiance: 0}", "objects": LAMP}, {"material.emitter"}),
        ({"objects": LAMP}, set()),
        ({"environment": "{type: sky, sun: true}"}, {"environment"}),
    ],
)
def test_light_that_is_all_there_is_stays(parts, names):
    reasons = reasons_without_variant(small(**parts), pack(small(**parts)))
    assert {name for name in ("environment", "material.emitter", "light.sun") if name in reasons} == names
    assert all("all the light" in reasons[name] for name in names)


def test_the_environment_goes_without_its_sun_or_its_sampling():
    spec = small(environment="{type: sky, sun: true}")
    _, scene = without(spec, "light.sun")
    assert [type(table) for table in scene.lights.tables] == [Background]
    assert equal(scene.environment, pack(spec).scene.environment)
    spec = small(environment="{type: sky}", lights=POINT)
    _, scene = without(spec, "environment_sampling")
    assert not any(isinstance(table, Background) for table in scene.lights.tables)
    assert scene.lights.background_tables is scene.environment
    assert len(scene.lights.tables) == len(pack(spec).scene.lights.tables) - 1


FOGS = """{
  thin: {type: homogeneous, extinction: 0.1, albedo: 0.5}, thick: {type: homogeneous, extinction: 3, albedo: 0.9},
  cloud: {type: grid, file: cloud.npy, min: [0, 0, 0], max: [1, 1, 1], extinction: 1, albedo: 0.8}}"""


def test_media_of_one_kind_go_and_others_keep_their_places(tmp_path):
    np.save(tmp_path / "cloud.npy", np.full((2, 2, 2), 0.5, np.float32))
    balls = ("[0, 0, -5], radius: 1, medium: thick", "[3, 0, -5], radius: 1, medium: cloud", "[6, 0, -5], radius: 1")
    objects = "[" + ", ".join(f"{{type: sphere, center: {ball}}}" for ball in balls) + "]"
    spec = build(text(media=FOGS, medium="thin", objects=objects), "test.yaml", base=tmp_path)
    before = pack(spec).scene
    # Clear space keeps the boundaries of its media.
    assert equal(without(spec, "media")[1], before._replace(media=None))
    before = before.media
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


# ---- Materials and textures


def of(material):
    return small(objects=f"[{{type: sphere, center: [0, 0, -5], radius: 1, material: {material}}}]")


CHECKER = "{type: checker, scale: 1, even: [0.2, 0.4, 0.6], odd: [0.6, 0.8, 1.0]}"
MEAN = (0.4, 0.6, 0.8)
SHINY, MATTE = "{type: metal, albedo: 0.9}", "{type: lambertian, albedo: 0.1}"
INNER = "{type: mixture, materials: [{type: metal}, {type: dielectric}], weight: 0.7}"
MOSTLY = "{type: mixture, materials: [%s, %s], weight: %s}"
TEXTURED = (
    f"{{type: principled, base_color: {CHECKER}, roughness: {CHECKER}, bump: {CHECKER}, bump_height: 1 mm, "
    "metallic: {type: noise, low: 0.2, high: 0.6}}"
)
RELIEF = f"{{type: metal, bump: {CHECKER}, bump_height: 2 mm}}"
HOLES = "{type: cutout, material: {type: metal}, opacity: {type: checker, scale: 1, even: 0, odd: 0.8}, threshold: 0.5}"
HOLLOW = f"{{type: cutout, material: {INNER}, opacity: 0.5}}"
MIXED = MOSTLY % (SHINY, "{type: dielectric}", 0.5)


@pytest.mark.parametrize(
    ("material", "name", "path", "value"),
    [
        # A matte one that reflects as much.
        ("{type: metal, albedo: [0.9, 0.6, 0.3], fuzz: 0.2}", "material.metal", "albedo", (0.9, 0.6, 0.3)),
        (f"{{type: metal, albedo: {CHECKER}}}", "material.metal", "albedo", MEAN),
        ("{type: dielectric, ior: 1.5}", "material.dielectric", "type", "lambertian"),
        ("{type: dielectric, ior: 1.5}", "material.dielectric", "albedo", (1.0, 1.0, 1.0)),
        ("{type: thin_dielectric, color: [0.5, 0.7, 0.9]}", "material.thin_dielectric", "albedo", (0.5, 0.7, 0.9)),
        ("{type: emitter, radiance: 5}", "material.emitter", "albedo", (0.0, 0.0, 0.0)),
        # The coat of index 1.5 reflects 4 %, and the body gets the rest.
        ("{type: principled, base_color: 0.5}", "material.principled", "albedo", (0.52, 0.52, 0.52)),
        # With the relief that it had.
        (RELIEF, "material.metal", "bump.type", "checker"),
        (RELIEF, "material.metal", "bump_height", 2e-3),
        # What a selector mostly shows, and of its kind whatever is within.
        (MOSTLY % (SHINY, MATTE, 0.4), "material.mixture", "type", "metal"),
        (MOSTLY % (SHINY, MATTE, 0.6), "material.mixture", "type", "lambertian"),
        (MOSTLY % (SHINY, MATTE, "{type: noise, low: 0.6, high: 1}"), "material.mixture", "type", "lambertian"),
        (MOSTLY % (INNER, MATTE, 0.2), "material.mixture", "type", "dielectric"),
        (f"{{type: two_sided, front: {SHINY}, back: {MATTE}}}", "material.two_sided", "type", "metal"),
        (HOLES, "material.cutout", "type", "metal"),
        (HOLLOW, "material.mixture", "type", "cutout"),
        (HOLLOW, "material.mixture", "material.type", "dielectric"),
        # In a selector what it shows; one of two equal materials is that one.
        (MIXED, "material.metal", "materials[0].type", "lambertian"),
        (MIXED, "material.metal", "materials[1].type", "dielectric"),
        (MOSTLY % (SHINY, "{type: lambertian, albedo: 0.9}", 0.5), "material.metal", "albedo", (0.9, 0.9, 0.9)),
        # Textures become their means, reliefs nothing, and holes as many on average.
        (TEXTURED, "texture.checker", "base_color", MEAN),
        (TEXTURED, "texture.checker", "roughness", np.dot(MEAN, REC709_LUMINANCE)),
        (TEXTURED, "texture.checker", "bump", None),
        (TEXTURED, "texture.checker", "metallic.type", "noise"),
        (HOLES, "texture.checker", "opacity", 0.4),
        (HOLES, "texture.checker", "threshold", None),
    ],
)
def test_what_takes_the_place_of_a_material(material, name, path, value):
    spec = of(material)
    (variant,) = [item for item in make_variants(spec, pack(spec)) if item.name == name]
    change, made = in_all_materials(variant.material_variant), []

    def noted(material, book):
        made.append(change(material, book))
        return made[-1]

    pack(spec, material_variant=noted)
    found = eval(f"made[0].{path}", {"made": made})
    assert found == (value if value is None or isinstance(value, str) else pytest.approx(value, rel=1e-12))


FLASH = {
    "camera": "{type: pinhole, shutter: {duration: 1/50 s, readout: 1/100 s}}",
    "lights": "[{type: flash, energy: 1, position: [0, 1, 0]}]",
}
SHAKEN = {"camera": "{type: pinhole, shutter: 1/10 s, shake: {amplitude: 0.1, bandwidth: 10}}"}


@pytest.mark.parametrize(
    ("spec", "name", "gone"),
    [
        (small(**FLASH), "light.flash", "shutter lights"),
        (small(**SHAKEN), "camera_shake", "shutter"),
        (small(environment="{type: sky}"), "environment_sampling", "lights"),
        (of(f"{{type: cutout, material: {SHINY}, opacity: 0.5}}"), "material.cutout", "transparency"),
        (of(TEXTURED), "texture.checker", "normal_mapping"),
    ],
)
def test_what_goes_with_an_effect_goes_from_the_packed_scene(spec, name, gone):
    packed = pack(spec)
    scene = without(spec, name, packed)[1]
    assert all(getattr(packed.scene, part) is not None and getattr(scene, part) is None for part in gone.split())
    assert name != "texture.checker" or len(scene.textures) == 1


def test_what_has_no_variant_of_its_own_says_so():
    shaken, boundary = small(**SHAKEN), of("{type: boundary}")
    assert "camera_shake" in reasons_without_variant(shaken, pack(shaken))["motion_blur"]
    assert {"material.boundary", "passage"} <= set(reasons_without_variant(boundary, pack(boundary)))


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


def test_materials_of_a_files_own_are_replaced_too():
    spec, packed = of_file(SCENES / "studio.yaml")
    (variant,) = [item for item in make_variants(spec, packed) if item.name == "material.principled"]
    radio = spec.model_copy(update={"objects": tuple(item for item in spec.objects if item.name == "radio")})
    kinds = {type(table).__module__ for table in pack(radio).scene.materials}
    assert "raytracer.plugins.materials.principled" in kinds
    after = {type(table).__module__ for table in variant.pack(radio).scene.materials}
    assert after == {"raytracer.plugins.materials.lambertian"}
