"""Cameras: what every kind promises, and each against the formulas of its optics."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from raytracer.plugins.cameras.pinhole import Pinhole
from raytracer.plugins.cameras.thin_lens import ThinLens
from raytracer.scene.assets import LOADERS
from raytracer.schema.registry import CAMERAS
from tests.plugins.cameras.kernels import camera_rays, projected, weighted_rays
from tests.repository import SCENES
from tests.small_scenes import rendered

_GLASS, _ACHROMAT = (str(SCENES / "lenses" / name) for name in ("double-gauss-50mm.yaml", "achromat-100mm.yaml"))

EXAMPLES = yaml.safe_load(f"""
camera_array:
- {{rows: 2, columns: 3, spacing: 20 mm, vfov: 35}}
- {{rows: 3, columns: 2, spacing: [0.02, 0.03], fill: true, focal_length: 50, focus_distance: .inf,
   convergence_distance: 3, shutter: 1/125 s, iso: 400}}
camera_box:
- {{rows: 1, columns: 2, size: [4, 3, 5], vfov: 60}}
- {{rows: 2, columns: 1, size: [0.4, 0.3, 0.5], facing: outward, faces: [back, top], hfov: 80}}
camera_sphere:
- {{rows: 2, columns: 3, vfov: 40}}
- {{rows: 1, columns: 4, facing: outward, radius: 0.2, elevation: [10, 10], azimuth: [-60, 60], vfov: 75}}
light_field:
- {{focal_length: 50, f_number: 4}}
- {{sensor: 1-inch, focal_length: 30, f_number: 2.8, shutter: 1/125 s, iso: 400,
   microlenses: {{pixels: 4, layout: hexagonal, rotation: 3, model: pinhole}}}}
light_slab:
- {{rows: 2, columns: 3, uv: 0.2, st: [4, 3]}}
- {{rows: 1, columns: 1, uv: [0.2, 0.3], st: [40, 30]}}
none: [{{}}, {{sensor: {{width: 200, height: 100}}, sensor_fit: overscan}}]
equirectangular: [{{}}, {{hfov: 120, vfov: 70}}, {{wavelength: 550}}]
fisheye:
- {{}}
- {{fov: 220}}
- {{projection: equisolid, fov: 360}}
- {{projection: stereographic, fov: 300}}
- {{projection: orthographic}}
lens:
- {{lens: '{_GLASS}', dispersion: false}}
- {{lens: '{_GLASS}', f_number: 8, focus_distance: .inf}}
- {{lens: '{_ACHROMAT}', sensor: full_frame, f_number: 11, aperture_shape: {{type: polygon, blades: 5}}, focus: rms,
   flare: true, shutter: 1/125 s, iso: 400}}
orthographic: [{{height: 3}}, {{width: 5}}]
pinhole:
- {{vfov: 35}}
- {{sensor: aps-c, focal_length: 28}}
- {{focal_length: 100, diameter: 2}}
- {{focal_length: 50, f_number: 8, shutter: 1, iso: 100}}
- {{hfov: 70, sensor: {{width: 24, height: 36}}}}
- {{equivalent_focal_length: 24, sensor_fit: overscan}}
ray: [{{}}, {{look_at: [1, 5, 3], wavelength: 550 nm}}]
thin_lens:
- {{vfov: 35, defocus_angle: 2}}
- {{vfov: 35, focus_distance: .inf, aperture: 50}}
- {{vfov: 35, focus_distance: 2, aperture: 0}}
- {{sensor: 1-inch, equivalent_focal_length: 35, f_number: 2}}
- {{focal_length: 50, f_number: 1.4, shutter: 1/125 s, iso: 400}}
- {{dfov: 60, sensor: four_thirds, sensor_fit: vertical, f_number: 1.4, pupil: flat, exposure: auto}}
- {{vfov: 35, aperture: 100, aperture_shape: {{type: polygon, blades: 5, curvature: 0.2, anamorphic: 1.5}},
   vignetting: {{diameter: 150, distance: 60}}}}
""")
EXAMPLES = {
    kind: [{"look_from": [1, 2, 3], "look_at": [0, 0, 0], **keys} for keys in all_of]
    for kind, all_of in EXAMPLES.items()
}

CASES = [
    pytest.param({"type": kind, **parameters}, id=f"{kind} {number}")
    for kind, examples in EXAMPLES.items()
    for number, parameters in enumerate(examples)
]


# A bare sensor and a single ray form no image, a hole of a size no sharp one, and glass one with errors; of many views
# each has its own.
VIEWS = ("camera_array", "camera_box", "camera_sphere", "light_field", "light_slab")
IMAGING = [case for case in CASES if case.values[0]["type"] not in (*VIEWS, "none", "ray")]
SHARP = [case for case in IMAGING if "diameter" not in case.values[0] and case.values[0]["type"] != "lens"]


def camera(**keys):
    spec = CAMERAS.specs()[keys.get("type", "pinhole")].model_validate(keys)
    files = {".".join(map(str, place)): LOADERS[kind](Path(name)) for place, (name, kind) in spec.files().items()}
    return spec.bind_assets(files)


# ---- Every kind


def test_every_kind_has_an_example():
    assert set(EXAMPLES) == set(CAMERAS.specs())


def assert_rays(packed, width, height, count=100):
    """At places all over the film, its corners, edges and middle among them, rays are unit vectors and numbers."""
    rng = np.random.default_rng(1)
    x, y = (grid.ravel() for grid in np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0]))
    x, y = np.concatenate([x, rng.random(count)]), np.concatenate([y, rng.random(count)])
    origins, directions, weights = weighted_rays(packed, width * x, height * y)
    # Each refraction adds a rounding; what goes to and fro in glass has three ways through it.  Lost light is anywhere.
    tolerance = 1e-15 if not hasattr(packed, "surfaces") else 3e-15 * len(packed.surfaces.curvature)
    seen = weights > 0.0 if hasattr(packed, "surfaces") else np.full(len(x), True)
    np.testing.assert_allclose(np.linalg.norm(directions[seen], axis=1), 1.0, rtol=0.0, atol=tolerance)
    assert np.isfinite(origins[seen]).all()
    assert np.isfinite(weights).all()
    assert (weights >= 0.0).all()


@pytest.mark.parametrize("size", [(40, 30), (1, 16384), (16384, 1)])
@pytest.mark.parametrize("keys", CASES)
def test_rays_are_unit_vectors_and_numbers(keys, size):
    assert_rays(camera(**keys).pack(*size), *size, count=2000)


@pytest.mark.parametrize("number", [1e-30, 1e-9, 1e9, 1e30])
@pytest.mark.parametrize(
    # Glass has to be looked through for its pupil, as many times as there are numbers that it takes.
    "kind",
    [pytest.param(kind, marks=[pytest.mark.slow] if kind == "lens" else []) for kind in sorted(EXAMPLES)],
)
def test_numbers_of_any_size_are_refused_or_make_rays(kind, number):
    tried = 0
    for example in EXAMPLES[kind]:
        for key in sorted(CAMERAS.specs()[kind].model_fields.keys() - {"type"}):
            for value in (number, [number, number, -number]):
                try:
                    spec = camera(**{"type": kind, **example, key: value})
                except ValidationError:
                    continue
                assert_rays(spec.pack(40, 30), 40, 30, count=10)
                spec.describe(40, 30)
                tried += 1
    assert tried


@pytest.mark.parametrize("keys", IMAGING)
def test_film_is_upright_and_its_middle_is_what_the_camera_looks_at(keys):
    spec = camera(**keys)
    _, directions, weights = weighted_rays(spec.pack(40, 30), np.full(4000, 20.0), 15.0)
    view = np.subtract(spec.look_at, spec.look_from)
    view /= np.linalg.norm(view)
    # A lens turns single rays by up to its radius over the focus distance: on average, not at all.
    middle = np.average(directions, axis=0, weights=weights)
    np.testing.assert_allclose(middle / np.linalg.norm(middle), view, atol=1e-3)
    # What is seen a metre away, above the middle and to its right.
    right = np.cross(view, spec.up)
    packed = spec.pack(40, 30)
    seen = [np.add(*(rays[0] for rays in camera_rays(packed, x, y))) for x, y in ((20, 15), (20, 5), (30, 15))]
    middle, top, side = seen
    assert (top - middle) @ np.asarray(spec.up) > 0.05
    assert (side - middle) @ right > 0.05


@pytest.mark.parametrize("keys", [case for case in IMAGING if case.values[0]["type"] in ("pinhole", "thin_lens")])
def test_fields_of_view_are_what_the_film_shows(keys):
    """Points at half the angles that a camera says it sees are at the edges and in a corner of the picture."""
    spec = camera(**keys)
    numbers, frame = spec.describe(40, 30), spec.frame()
    half = {name: math.tan(math.radians(numbers[f"{name}_deg"]) / 2.0) for name in ("hfov", "vfov", "dfov")}
    assert half["dfov"] == pytest.approx(math.hypot(half["hfov"], half["vfov"]))
    points = [
        np.array(frame.origin) + 7.0 * (np.array(frame.forward) + x * np.array(frame.right) + y * np.array(frame.up))
        for x, y in ((half["hfov"], 0.0), (0.0, -half["vfov"]), (-0.8 * half["dfov"], 0.6 * half["dfov"]))
    ]
    seen = projected(spec.pack(40, 30), points)
    np.testing.assert_allclose(seen[:, :2], [[40.0, 15.0], [20.0, 30.0], [0.0, 0.0]], rtol=0.0, atol=1e-9)
    assert seen[:, 2] == pytest.approx(7.0)


@pytest.mark.parametrize("keys", CASES)
def test_cameras_describe_themselves_in_finite_numbers(keys):
    numbers = camera(**keys).describe(40, 30)
    assert numbers
    for name, value in numbers.items():
        # Only what lies beyond all is infinite: the far limit, and focus at infinity with what follows from it.
        assert isinstance(value, float)
        assert value >= 0.0
        assert math.isfinite(value) or name in ("far_limit_m", "focus_distance_m", "refocus_far_m"), name


@pytest.mark.parametrize("keys", SHARP)
def test_what_a_ray_meets_is_projected_to_where_the_ray_started(keys):
    # Through a lens, what lies in the plane of focus.
    rng = np.random.default_rng(2)
    spec = camera(**keys)
    packed = spec.pack(40, 30)
    x, y = rng.uniform(0, 40, 2000), rng.uniform(0, 30, 2000)
    origins, directions, weights = weighted_rays(packed, x, y)
    forward = np.subtract(spec.look_at, spec.look_from) / np.linalg.norm(np.subtract(spec.look_at, spec.look_from))
    distance = rng.uniform(0.1, 100.0, (2000, 1))
    lens = getattr(packed, "lens", None)
    if lens is not None:
        focus = 1.0 / lens.inverse_focus if lens.inverse_focus else 1e15
        distance = (focus / (directions @ forward))[:, None]
    points = origins + distance * directions
    found = projected(packed, points)
    seen = weights > 0.0
    assert seen.mean() > 0.5
    np.testing.assert_allclose(found[seen, 0], x[seen], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found[seen, 1], y[seen], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found[:, 2], (points - spec.look_from) @ forward, rtol=1e-12, atol=1e-12)


# ---- Pinhole


@pytest.mark.parametrize("vfov", [20.0, 90.0, 179.9])
@pytest.mark.parametrize(("width", "height"), [(40, 30), (30, 40), (1, 1)])
def test_edges_of_the_film_are_the_field_of_view(vfov, width, height):
    # Half the field of view up to the top edge; square pixels to the sides.  Hard case 27: tan(89.95 deg) = 1145.9.
    half = math.tan(math.radians(vfov / 2.0))
    packed = camera(vfov=vfov).pack(width, height)
    for x, y in ((0.0, 0.0), (width, 0.0), (0.5 * width, height), (0.25 * width, 0.75 * height)):
        _, directions = camera_rays(packed, x, y)
        expected = np.array([(2.0 * x - width) / height * half, (1.0 - 2.0 * y / height) * half, -1.0])
        np.testing.assert_allclose(directions[0], expected / np.linalg.norm(expected), rtol=0.0, atol=1e-15)
    if vfov == 179.9:
        assert half == pytest.approx(1145.9, abs=0.1)


def test_frame_is_orthonormal_however_close_up_is_to_the_view():
    # Hard case 28: parallel is an error; 1e-6 rad off, the frame is orthonormal to 1e-12.
    for angle in (1.0, 1e-3, 1e-6, 1e-9):
        spec = camera(look_from=[0, 0, 0], look_at=[0, 0, -2], up=[0, math.sin(angle), -math.cos(angle)])
        frame = np.array(spec.frame()[1:])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), rtol=0.0, atol=1e-12)
        # Right is that of the exact cross product, along +x for this up.
        np.testing.assert_allclose(frame[0], [1.0, 0.0, 0.0], rtol=0.0, atol=1e-12)
    for up in ([0, 0, 1], [0, 0, -3]):
        with pytest.raises(ValidationError, match="parallel"):
            camera(look_from=[0, 0, 0], look_at=[0, 0, -2], up=up)
    # The square of 1e-300 is 0, by which nothing can be divided.
    for near in ([1, 2, 0], [1, 2, 1e-300]):
        with pytest.raises(ValidationError, match="same point"):
            camera(look_from=near, look_at=[1, 2, 0])


@pytest.mark.parametrize("size", [1e-30, 1e30])
def test_frames_do_not_depend_on_how_long_their_vectors_are(size):
    # Down to the smallest and up to the largest that a scene may have, squares and their sums are numbers.
    plain = camera(look_at=[0, 1, -2], up=[1, 2, 0])
    spec = plain.model_copy(update={"look_at": (0.0, size, -2.0 * size), "up": (size, 2.0 * size, 0.0)})
    np.testing.assert_allclose(np.array(spec.frame()[1:]), np.array(plain.frame()[1:]), rtol=0.0, atol=4e-16)
    assert spec.distance() == pytest.approx(math.sqrt(5.0) * size, rel=1e-15)


# ---- Thin lens


def lens_spec(**keys):
    return ThinLens.model_validate({"look_from": [0, 0, 0], "look_at": [0, 0, -10], "vfov": 20, **keys})


def test_defocus_angle_is_the_cone_from_focus_to_lens():
    # Camera truths: F = 10, delta = 0.6 deg: A = 2 F tan(delta / 2) = 0.104720 m.
    assert lens_spec(defocus_angle=0.6).pupil_diameter(40, 30) == pytest.approx(0.104720, abs=1e-6)
    assert lens_spec(aperture=104.72).pupil_diameter(40, 30) == pytest.approx(0.10472)


@pytest.mark.parametrize("focus", [0.5, 10.0, 1e4])
def test_rays_of_a_film_point_meet_in_the_plane_of_focus(focus):
    spec = lens_spec(focus_distance=focus, aperture=100)
    x, y = 31.0, 7.0
    origins, directions = camera_rays(spec.pack(40, 30), np.full(1000, x), y)
    # All on the disc of the lens, over all of it, perpendicular to the axis.
    radius = np.hypot(origins[:, 0], origins[:, 1])
    assert (origins[:, 2] == 0.0).all()
    assert (radius <= 0.05 * (1.0 + 1e-12)).all()
    assert (radius < 0.025).mean() == pytest.approx(0.25, abs=0.05)
    # Without an exposure they carry equal weight, so that what is uniform stays so.
    assert (weighted_rays(spec.pack(40, 30), np.full(100, x), y)[2] == 1.0).all()
    # At z = -focus, all where the pinhole's ray of that film point is.
    meeting = origins + directions * (-focus / directions[:, 2:])
    _, straight = camera_rays(Pinhole(look_from=(0, 0, 0), look_at=(0, 0, -10), vfov=20).pack(40, 30), x, y)
    expected = straight[0] * (-focus / straight[0, 2])
    np.testing.assert_allclose(meeting, np.tile(expected, (1000, 1)), rtol=0.0, atol=1e-14 * focus + 1e-15)


@pytest.mark.parametrize(
    "shape", ["round", {"type": "round"}, {"type": "polygon", "curvature": 1}, {"type": "round", "anamorphic": 1}]
)
def test_a_round_opening_is_the_plain_lens(shape):
    plain, shaped = (lens_spec(aperture=50, **keys).pack(40, 30) for keys in ({}, {"aperture_shape": shape}))
    assert shaped == plain
    assert shaped.lens.shape is None
    assert shaped.lens.rim is None


def test_cameras_describe_themselves():
    # 90 degrees high and 4:3: atan(4/3) * 2 = 106.26 across, atan(5/3) * 2 = 118.07 over the diagonal.
    numbers = camera(vfov=90.0).describe(40, 30)
    assert numbers["hfov_deg"] == pytest.approx(106.2602, abs=1e-4)
    assert numbers["dfov_deg"] == pytest.approx(118.0725, abs=1e-4)
    assert numbers["pixel_at_1m_mm"] == pytest.approx(1e3 * 2.0 / 30.0)
    numbers = lens_spec(defocus_angle=0.6).describe(1200, 675)
    assert numbers["aperture_diameter_mm"] == pytest.approx(104.720, abs=1e-3)
    # Camera truths: twice the blur at 20 m, which is twice the focus distance, is half that at infinity.
    assert numbers["blur_at_infinity_px"] == pytest.approx(20.044, abs=1e-3)


# ---- Orthographic


@pytest.mark.parametrize(("keys", "pixel"), [({"height": 3}, 0.1), ({"width": 3}, 0.075)])
def test_orthographic_rays_are_parallel_and_their_origins_a_grid(keys, pixel):
    spec = camera(type="orthographic", look_from=[0, 1, 5], look_at=[0, 1, 0], **keys)
    origins, directions = camera_rays(spec.pack(40, 30), [0.0, 20.0, 40.0, 13.5], [0.0, 15.0, 30.0, 4.5])
    np.testing.assert_array_equal(directions, np.tile([0.0, 0.0, -1.0], (4, 1)))
    x, y = np.array([-20.0, 0.0, 20.0, -6.5]) * pixel, 1.0 + np.array([15.0, 0.0, -15.0, 10.5]) * pixel
    np.testing.assert_allclose(origins, np.stack([x, y, np.full(4, 5.0)], axis=1), rtol=0.0, atol=1e-15)
    numbers = spec.describe(40, 30)
    assert numbers == pytest.approx({"view_width_m": 40 * pixel, "view_height_m": 30 * pixel, "pixel_mm": 1e3 * pixel})


# ---- Equirectangular


def test_longitude_and_latitude_are_measured_in_equal_steps():
    # 360 x 180 pixels: one pixel a degree.  The x-axis is 90 degrees to the right of -z.
    packed = camera(type="equirectangular", look_from=[0, 0, 0], look_at=[0, 0, -1]).pack(360, 180)
    for longitude, latitude in ((0, 0), (90, 0), (-90, 0), (180, 0), (45, 30), (-120, -60), (10, 90), (0, -90)):
        a, b = math.radians(longitude), math.radians(latitude)
        expected = [math.cos(b) * math.sin(a), math.sin(b), -math.cos(b) * math.cos(a)]
        _, directions = camera_rays(packed, 180.0 + longitude, 90.0 - latitude)
        np.testing.assert_allclose(directions[0], expected, rtol=0.0, atol=1e-15)


# ---- Fisheye

RADII = {
    "equidistant": lambda t: t,
    "equisolid": lambda t: math.sin(t / 2.0),
    "stereographic": lambda t: math.tan(t / 2.0),
    "orthographic": math.sin,
}


@pytest.mark.parametrize("fov", [60.0, 180.0])
@pytest.mark.parametrize("projection", RADII)
def test_angles_land_where_the_projection_says(projection, fov):
    keys = {"type": "fisheye", "projection": projection, "fov": fov, "look_from": [0, 0, 0], "look_at": [0, 0, -1]}
    spec = camera(**keys)
    packed = spec.pack(400, 300)
    radius = RADII[projection]
    for part in (0.0, 0.1, 0.5, 0.9, 1.0 - 1e-12):
        angle = part * math.radians(fov) / 2.0
        r = 150.0 * radius(angle) / radius(math.radians(fov) / 2.0)
        # To the right, and up to the left at 45 degrees.
        for turn in (0.0, 0.75 * math.pi):
            expected = [math.sin(angle) * math.cos(turn), math.sin(angle) * math.sin(turn), -math.cos(angle)]
            x, y = 200.0 + r * math.cos(turn), 150.0 - r * math.sin(turn)
            _, directions = camera_rays(packed, x, y)
            # Orthographic rays turn by 1 / cos(angle) of what the film position is rounded by.
            np.testing.assert_allclose(directions[0], expected, rtol=0.0, atol=1e-14 if angle < 1.5 else 1e-9)
            np.testing.assert_allclose(projected(packed, expected)[0, :2], [x, y], rtol=0.0, atol=1e-9)
    # The middle pixel sees as many degrees as two film positions half a pixel off it differ by.
    _, (left, right) = camera_rays(packed, [199.5, 200.5], 150.0)
    angle = math.degrees(math.asin(np.linalg.norm(np.cross(left, right))))
    assert spec.describe(400, 300)["pixel_at_middle_deg"] == pytest.approx(angle, rel=1e-4)


def test_what_lies_outside_the_circle_is_not_traced():
    scene = """
camera: {{type: {}, look_from: [0, 0, 4], look_at: [0, 0, 0]}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: sphere, center: [0, 9, 0], radius: 1, material: {{type: lambertian}}}}
"""
    result = rendered(scene.format("fisheye"), width=64, height=64, max_depth=1, spp=16, filled=False)
    assert result.stats.rays == pytest.approx(math.pi / 4.0 * result.stats.samples, rel=0.01)
    # Samples outside count as black: the middle is as bright as without them, and no pixel is missing any.
    assert (result.image.radiance[31:33, 31:33] == 1.0).all()
    assert result.fewest_samples == 16


@pytest.mark.parametrize(
    ("kind", "keys", "message"),
    [
        ("fisheye", {"projection": "stereographic", "fov": 360}, "less than 360"),
        ("fisheye", {"projection": "orthographic", "fov": 190}, "at most 180"),
        ("orthographic", {}, "give either height or width"),
        ("orthographic", {"height": 1, "width": 1}, "give either height or width"),
        ("thin_lens", {"focus_distance": math.inf, "defocus_angle": 1.0}, "aperture"),
        ("thin_lens", {"defocus_angle": 1, "aperture": 10}, "give one of them"),
        ("fisheye", {"fov": 361}, "360"),
        ("pinhole", {"vfov": 180}, "less than 180"),
        ("pinhole", {"vfov": 0}, "greater than 0"),
        ("pinhole", {"vfov": -10}, "greater than 0"),
    ],
)
def test_what_a_camera_cannot_be_is_refused(kind, keys, message):
    with pytest.raises(ValidationError, match=message):
        camera(type=kind, **keys)


def test_points_behind_are_nowhere_for_cameras_that_look_ahead():
    for keys in ({"type": "pinhole"}, {"type": "orthographic", "height": 1}):
        found = projected(camera(**keys).pack(40, 30), [[0.1, 0.2, 3.0]])[0]
        assert np.isnan(found[:2]).all()
        assert found[2] == -3.0
    # A panorama sees it, half a turn away; a fisheye of 180 degrees would, outside its circle.
    assert projected(camera(type="equirectangular").pack(40, 20), [[0.0, 0.0, 3.0]])[0, 0] in (0.0, 40.0)
    assert projected(camera(type="fisheye").pack(40, 40), [[0.0, 3.0, 1e-9]])[0, 1] == pytest.approx(0.0, abs=1e-6)
