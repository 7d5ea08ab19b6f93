"""The camera with a lens of glass: what its keys mean, where it sees what, and what it says of mistakes."""

import math

import numpy as np
import pytest

import raytracer as rt
from raytracer.analysis.explain.camera_numbers import CameraView
from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.lens_setup import equivalent_thin_lens
from raytracer.optics.lens_system.pupils import search
from raytracer.scene.digest import digest
from raytracer.scene.load import build, build_plain
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import SceneError
from tests.optics.lens_system.lens_files import thin, written
from tests.plugins.cameras.kernels import projected, weighted_rays
from tests.repository import SCENES

LENSES = SCENES / "lenses"
DOUBLE_GAUSS = LENSES / "double-gauss-50mm.yaml"

SCENE = """
camera: {{type: lens, lens: '{lens}', look_from: [1, 2, 3], look_at: [1, 2, 0]{keys}}}
film: {{width: 360, height: 240}}
objects:
  - {{type: sphere, name: ball, center: [1.1, 2.05, 1], radius: 0.2}}
  - {{type: quad, corner: [-49, -48, -5], edges: [[100, 0, 0], [0, 100, 0]]}}
"""


def scene(lens=DOUBLE_GAUSS, **keys):
    text = "".join(f", {key}: {value}" for key, value in keys.items())
    return build(SCENE.format(lens=lens, keys=text), "test.yaml", allow_files="/")


def camera(lens=DOUBLE_GAUSS, **keys):
    return pack(scene(lens, **keys)).scene.camera


# ---- Where what is seen


def met(origins, directions, distance):
    """Return the points of rays (n, 3) at a distance before the camera of `SCENE`."""
    way = (3.0 - distance - origins[:, 2:]) / directions[:, 2:]
    return origins + way * directions


@pytest.mark.parametrize("name", ["double-gauss-50mm", "telephoto-250mm", "anamorphic-75mm", "wide-22mm"])
def test_rays_of_a_place_of_the_film_meet_where_it_is_sharp(name):
    """And that point is projected back to the place, upright, by all but the lens's own errors."""
    distance = 40.0
    packed = camera(LENSES / f"{name}.yaml", focus_distance=distance, f_number=11, sensor="four_thirds")
    places = np.array([(180.0, 120.0), (90.0, 60.0), (300.0, 30.0), (20.0, 220.0)])
    for x, y in places:
        origins, directions, weights = weighted_rays(packed, np.full(400, x), y)
        lit = weights > 0.0
        assert lit.mean() > 0.8
        points = met(origins[lit], directions[lit], distance)
        middle = points.mean(axis=0)
        # A pixel's image there, of which the spot is a small part.
        pixel = distance * packed.thin.pixel
        assert np.hypot(*(points - middle)[:, :2].T).mean() < 0.5 * pixel
        result = projected(packed, middle)[0]
        np.testing.assert_allclose(result[:2], (x, y), rtol=0.0, atol=0.15)
        assert result[2] == pytest.approx(distance)
    # To the right and up is right and up.
    right, up = projected(packed, [(1.1, 2.0, 3.0 - distance), (1.0, 2.1, 3.0 - distance)])[:, :2] - (180.0, 120.0)
    assert right[0] > 0.0
    assert abs(right[1]) < 1e-9
    assert up[1] < 0.0
    assert abs(up[0]) < 1e-9


def test_a_fisheye_sees_what_is_beside_it():
    packed = camera(LENSES / "fisheye-10mm.yaml", focus_distance=math.inf, f_number=8)
    angles = np.radians([0.0, 20.0, 45.0, 70.0])
    points = np.stack([1.0 + 1e6 * np.sin(angles), 2.0 + 0.0 * angles, 3.0 - 1e6 * np.cos(angles)], axis=1)
    places = projected(packed, points)
    assert (np.diff(places[:, 0]) > 0.0).all()
    for (x, y, _), angle in zip(places[:3], angles[:3], strict=True):
        _, directions, weights = weighted_rays(packed, np.full(400, x), y)
        mean = directions[weights > 0.0].mean(axis=0)
        assert math.atan2(mean[0], -mean[2]) == pytest.approx(angle, abs=2e-3)
    # Not behind it, and not beyond its picture.
    assert np.isnan(projected(packed, [(1.0, 2.0, 10.0)])[0, :2]).all()


# ---- Focus


def test_focus_is_on_an_object_or_on_what_is_seen():
    on = pack(scene(focus_on="ball")).spec.camera
    assert on.focus_distance == pytest.approx(2.0)
    assert on.focus_on is None
    # The ball's surface is nearer than its middle; beside it is the wall, 8 m away.
    x, y = projected(camera(focus_distance=2), [(1.1, 2.05, 1.0)])[0, :2]
    at = pack(scene(focus_at=[float(x / 360.0), float(y / 240.0)])).spec.camera
    assert at.focus_distance == pytest.approx(1.8, abs=0.01)
    assert pack(scene(focus_at="[0.1, 0.9]")).spec.camera.focus_distance == pytest.approx(8.0, rel=1e-6)


def test_the_sensor_moves_back_for_what_is_near():
    films = [camera(focus_distance=distance, f_number=8).film.z for distance in (math.inf, 10, 1, 0.5)]
    assert (np.diff(films) > 0.0).all()
    # Newton: x x' = f^2 by distances from the focal points.
    lens = scene(f_number=8).camera.lens_setup().surfaces
    points, away = cardinal_points(lens), 1e3 * 0.5
    pupil = scene(f_number=8).camera.lens_setup().thin.pupil
    way = away - pupil + points.front_focus
    assert films[-1] - films[0] == pytest.approx(points.focal_length**2 / way, rel=0.01)


# ---- The thin lens in place of it


def test_the_thin_lens_sees_as_much_and_blurs_as_much():
    spec = scene(f_number=4, focus_distance=2, iso=100, shutter="1/100 s", sensor="full_frame")
    keys = spec.camera.thin_lens_equivalent(360, 240)
    thin_scene = build_plain({"camera": keys, "film": spec.film, "objects": spec.objects})
    assert thin_scene.camera.type == "thin_lens"
    ours, theirs = (CameraView(each, pack(each).scene.camera) for each in (spec, thin_scene))
    # Near the axis, where a lens has no distortion.
    point = np.array([1.01, 2.005, 1.0])
    np.testing.assert_allclose(ours.project(point, 0.0), theirs.project(point, 0.0), rtol=0.0, atol=0.01)
    assert ours.blur(4.0) == pytest.approx(theirs.blur(4.0), rel=1e-9)
    assert ours.blur(2.0) == pytest.approx(0.0, abs=1e-12)
    for name in ("pixel_pitch_um", "focus_distance_m", "aperture_diameter_mm", "blur_at_infinity_px", "film_height_mm"):
        assert ours.numbers[name] == pytest.approx(theirs.numbers[name], rel=1e-9), name
    assert ours.numbers["thin_lens_focal_length_mm"] == pytest.approx(theirs.numbers["focal_length_mm"], rel=1e-9)
    # And it is as bright: weights on the axis, in W/m2 of a radiance of 1.
    light = [
        weighted_rays(pack(each).scene.camera, np.full(4000, 180.0), 120.0)[2].mean() for each in (spec, thin_scene)
    ]
    assert light[0] == pytest.approx(light[1], rel=0.01)


def test_a_scene_with_the_lens_is_explained():
    result = rt.explain(scene(f_number=2.8, focus_distance=2))
    assert result.camera["f_number"] == pytest.approx(2.8, rel=1e-3)
    assert result.camera["focal_length_mm"] == pytest.approx(50.0, rel=5e-3)
    assert result.camera["near_limit_m"] < 2.0 < result.camera["far_limit_m"]
    assert "Thin lens in its place" in result.text()
    assert result.json()["thin_lens"]["type"] == "thin_lens"


def test_the_thin_lens_of_a_thin_piece_of_glass_is_that_glass(tmp_path):
    path = thin(tmp_path, 50.0, 8.0)
    for distance in (math.inf, 2.0, 0.3):
        setting = scene(path, f_number=16, focus_distance=distance).camera.lens_setup()
        result = equivalent_thin_lens(setting.surfaces, setting.film, 1e3 * distance)
        expected = (50.0, 50.0 / 16.0, 16.0)
        assert (result.focal_length, result.aperture, result.f_number) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("keys", [{"f_number": 2}, {}])
def test_the_widest_stop_is_what_is_engraved(keys):
    # f/2 is the engraved number; a lens whose rims make it f/2.003 is still set to f/2.
    assert scene(**keys).camera.lens_setup().f_number == pytest.approx(2.0, rel=0.02)


def test_a_lens_file_is_part_of_what_a_picture_depends_on(tmp_path):
    text, found = DOUBLE_GAUSS.read_text(encoding="utf-8"), []
    for each in (text, text.replace("29.475", "29.5")):
        (tmp_path / "lens.yaml").write_text(each, encoding="utf-8")
        found.append(digest(scene(tmp_path / "lens.yaml", focus_distance=2)))
    assert found[0] != found[1]


# ---- Mistakes


def surfaces(*rows):
    return "".join(f"  - {{type: spherical, radius: {radius}, {more}}}\n" for radius, more in rows)


GLASS, AIR = "thickness: 1, material: 1.5, aperture: 20", "aperture: 20, thickness:"
DIVERGING = surfaces((-50, GLASS), (50, f"{AIR} 0"))
# An objective and a relay, which turns the picture once more: it would be seen upside down.
RELAYED = surfaces((50, GLASS), (-50, f"{AIR} 110"), (25, GLASS), (-25, f"{AIR} 0"))
NO_IMAGE = r"test\.yaml:2: camera\.lens: .*the lens makes no image"


@pytest.mark.parametrize(
    ("text", "keys", "says"),
    [
        (None, {"f_number": 1.2}, r"test\.yaml:2: camera\.f_number: .*f/2.*1\.2"),
        (None, {"focus_distance": 0.05}, r"test\.yaml:2: camera\.focus_distance: .*nearest"),
        (None, {"focus_distance": 2, "focus_on": "ball"}, r"camera\.focus_on: focus_distance and focus_on both set"),
        (None, {"focus": "sharp"}, r"camera\.focus: "),
        (None, {"vfov": 40}, r"unknown key 'vfov'"),
        (None, {"iso": 100}, r"camera\.iso: iso needs a shutter"),
        (None, {"lens": "/nowhere.yaml"}, r"test\.yaml:2: camera\.lens: there is no file '/nowhere\.yaml'"),
        # Files that are no lens are the lens's fault.
        (surfaces(("30 s", "aperture: 10")), {}, r"test\.yaml:2: camera\.lens: .*lens\.yaml:\d: surfaces\[0\]\.radius"),
        (DIVERGING, {}, NO_IMAGE),
        (DIVERGING, {"focus_distance": 2}, NO_IMAGE),
        (DIVERGING, {"focus_at": [0.5, 0.5]}, NO_IMAGE),
        (RELAYED, {}, r"test\.yaml:2: camera\.lens: .*the lens has an image inside it"),
    ],
)
def test_mistakes_are_one_sentence(tmp_path, text, keys, says):
    if text is not None:
        keys = {**keys, "lens": written(tmp_path, text)}
    with pytest.raises(SceneError, match=says) as caught:
        scene(**keys)
    assert "\n" not in str(caught.value)


def test_an_object_too_near_for_the_lens_is_told_when_the_scene_is_packed():
    text = SCENE.format(lens=DOUBLE_GAUSS, keys=", focus_on: ball").replace("[1.1, 2.05, 1]", "[1, 2, 2.95]")
    with pytest.raises(SceneError, match=r"camera\.focus_on: .*nearest"):
        pack(build(text, "test.yaml"))


def test_a_sensor_beyond_the_image_circle_is_warned_of():
    large = scene(sensor="medium_format", focus_distance=math.inf)
    assert any("image circle" in sentence for sentence in rt.explain(large).warnings)
    assert not any("image circle" in sentence for sentence in rt.explain(scene(sensor="aps_c")).warnings)


def test_a_pupil_that_takes_too_long_is_an_error_of_the_lens(monkeypatch):
    monkeypatch.setattr(search, "MAX_CROSSINGS", 1000)
    with pytest.raises(SceneError, match=r"^test.yaml:2: camera.lens: where light passes the lens is not found"):
        camera(f_number=3.1)
