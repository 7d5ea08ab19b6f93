"""The light-field camera: every ray against one traced by hand, and its picture against ordinary photographs."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from raytracer.analysis.explain.explanation import explain
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.plugins.cameras.light_field import LightField
from raytracer.plugins.cameras.thin_lens import ThinLens
from raytracer.scene.load import build
from raytracer.util.errors import SceneError
from tests.plugins.cameras.kernels import weighted_rays
from tests.plugins.cameras.test_cameras import camera
from tests.repository import SCENES
from tests.small_scenes import scene, scene_text

Floats = NDArray[np.float64]

FOCUS, FOCAL_LENGTH, F_NUMBER, SIDE = 2.0, 0.04, 4.0, 0.006

THIN = {
    "type": "light_field",
    "sensor": {"width": "6 mm", "height": "6 mm"},
    "focal_length": 1e3 * FOCAL_LENGTH,
    "f_number": F_NUMBER,
    "focus_distance": FOCUS,
}

FOCUSED = {"arrangement": "focused"}
ARRAYS = {
    "plenoptic": {"pixels": 15},
    "plenoptic, mismatched": {"pixels": 12, "distance": "0.3 mm", "focal_length": "0.5 mm"},
    "turned": {"pitch": "145 um", "rotation": 7, "offset": ["0.03 mm", "-0.02 mm"]},
    "hexagonal, focused": {
        "pitch": "200 um",
        "layout": "hexagonal",
        "rotation": -3,
        **FOCUSED,
        "focal_length": "0.7 mm",
    },
    "three kinds": {
        "pitch": "200 um",
        "layout": "hexagonal",
        "rotation": 4,
        **FOCUSED,
        "focal_length": ["0.66 mm", "0.7 mm", "0.75 mm"],
    },
    "focused before the image": {"count": 20, **FOCUSED, "focal_length": "1.4 mm"},
    "pinholes": {"pixels": 10, "model": "pinhole"},
}

WIDTH = 300


def spec_of(**microlenses):
    return LightField.model_validate({**THIN, "microlenses": microlenses})


def rays_of(spec, count=4000):
    """Film positions drawn evenly, and the rays that the packed camera makes of them."""
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, WIDTH, count), rng.uniform(0, WIDTH, count)
    return x, y, *weighted_rays(spec.pack(WIDTH, WIDTH), x, y)


# ---- Rays


@pytest.mark.parametrize("name", ARRAYS)
def test_a_ray_from_the_scene_goes_to_the_sensor_by_gauss_and_back_to_its_pixel(name):
    """The rays that the camera makes, sent into it by hand: through the thin main lens, its microlens, to the sensor.

    A thin lens changes the slope of a ray by -h / f of where it goes through; so do microlenses, from their middles.
    Right and up are those of the scene here, in which the picture is upside down.
    """
    spec = spec_of(**ARRAYS[name])
    array, lattice = spec.arrangement(WIDTH, WIDTH), spec.lenslets(WIDTH, WIDTH).lattice
    x, y, origins, directions, _ = rays_of(spec)
    on_lens = origins[:, :2]
    # Light comes from the scene: with it z grows away from the lens, and the direction is turned round.
    slope = directions[:, :2] / directions[:, 2:]
    slope -= on_lens / FOCAL_LENGTH
    image, distance, focal_length = (1e-3 * value for value in (array.image, array.distance, array.focal_length))
    on_array = on_lens + image * slope

    # The microlens through whose middle the middle of the sub-image is seen from the middle of the main lens.
    pixel = SIDE / WIDTH
    places = np.column_stack([x, y])
    number = lattice.index(places)
    around = [lattice.place(*(np.floor(number) + step).T) for step in ((0, 0), (0, 1), (1, 0), (1, 1))]
    away = [((place - places) ** 2).sum(axis=1) for place in around]
    nearest = np.stack(around)[np.argmin(away, axis=0), np.arange(len(x))]
    if len(spec.microlenses.focal_lengths) > 1:
        column, row = np.rint(lattice.index(nearest)).astype(int).T
        focal_length = 1e-3 * np.array(spec.microlenses.focal_lengths)[(column - row) % 3, None]
    shrink = image / (image + distance)
    middles = (nearest - 0.5 * WIDTH) * np.array([-1.0, 1.0]) * pixel * shrink
    off = on_array - middles
    if name != "pinholes":
        assert np.abs(off).max() <= 0.66e-3 * array.pitch
        slope -= off / focal_length
    else:
        np.testing.assert_allclose(off, 0.0, atol=1e-15)
    on_sensor = on_array + distance * slope
    np.testing.assert_allclose(0.5 * WIDTH - on_sensor[:, 0] / pixel, x, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(0.5 * WIDTH + on_sensor[:, 1] / pixel, y, rtol=0.0, atol=1e-8)


def test_light_goes_through_all_of_a_microlens_evenly():
    # Places on a hexagon of the pitch p between opposite sides: the mean square of each coordinate is 5 p^2 / 72.
    spec = spec_of(pixels=15, layout="hexagonal")
    array = spec.arrangement(WIDTH, WIDTH)
    packed = spec.pack(WIDTH, WIDTH)
    middle = spec.lenslets(WIDTH, WIDTH).lattice.origin
    origins, directions, _ = weighted_rays(packed, np.full(40_000, middle[0]), middle[1])
    np.testing.assert_allclose(origins, 0.0, atol=1e-15)
    on_array = 1e-3 * array.image * directions[:, :2] / -directions[:, 2:]
    expected = 5.0 * (1e-3 * array.pitch) ** 2 / 72.0
    np.testing.assert_allclose((on_array**2).mean(axis=0), expected, rtol=0.03)
    assert np.hypot(*on_array.T).max() <= 1e-3 * array.pitch / math.sqrt(3.0)


def test_rays_through_glass_leave_it_as_they_come_from_the_array():
    """Rays of the packed camera, traced back through the surfaces of the lens, go through their own microlens."""
    spec = camera(
        type="light_field", lens=str(SCENES / "lenses" / "double-gauss-50mm.yaml"), f_number=4, focus_distance=2,
        sensor={"width": 12, "height": 12}, dispersion=False, microlenses={"pixels": 10},
    )  # fmt: skip
    array, setting, lattice = spec.arrangement(WIDTH, WIDTH), spec.lens_setup(), spec.lenslets(WIDTH, WIDTH).lattice
    x, y, origins, directions, weights = rays_of(spec, 400)
    lit = weights > 0.0
    # Three quarters of square sub-images are the image of a round pupil.
    assert 0.6 < lit.mean() < math.pi / 4.0 + 0.05
    surfaces = spec.glass().packed(stop_radius=setting.stop_radius, shift=setting.shift, dispersion=False)
    # The camera looks along -z of the scene, and the lens's axis goes from the scene to the film.
    starts, ways = 1e3 * origins + [0.0, 0.0, setting.thin.pupil], -directions
    back, points, onward = trace_rays(surfaces, starts[lit], ways[lit])
    assert (back > 0.0).all()
    on_array = points[:, :2] + (setting.film - points[:, 2:]) * onward[:, :2] / onward[:, 2:]
    number = np.rint(lattice.index(np.column_stack([x, y])[lit]))
    middles = (lattice.place(number[:, 0], number[:, 1]) - 0.5 * WIDTH) * np.array([-1.0, 1.0])
    off = on_array - middles * array.pitch / array.spacing
    assert np.abs(off).max() <= 0.5 * array.pitch * (1.0 + 1e-9)


# ---- Arrangements


def test_sub_images_fall_on_whole_pixels_though_microlenses_are_narrower():
    # Focused at 2 m, f = 40 mm, z = 40.816 mm; the sub-images of a lens of 10 mm touch at d = 0.3 z / 10.
    array = spec_of(pixels=15).arrangement(WIDTH, WIDTH)
    image = 1.0 / (1.0 / 40.0 - 1.0 / 2000.0)
    assert array.image == pytest.approx(image)
    assert array.distance == pytest.approx(15 * 0.02 * image / 10.0)
    assert array.spacing == pytest.approx(15.0)
    assert array.pitch == pytest.approx(0.3 / (1.0 + array.distance / image))
    assert 1.0 / array.focal_length == pytest.approx(1.0 / array.distance + 1.0 / image)
    # The f-number of the microlenses is that of the main lens on the side of the image.
    assert array.focal_length / array.pitch == pytest.approx(image / 10.0)
    assert array.blur == pytest.approx(0.0, abs=1e-12)
    layout = spec_of(pixels=15).lenslets(WIDTH, WIDTH)
    assert layout.views.position.shape == (15, 15, 2)
    assert (layout.views.width, layout.views.height) == (20, 20)


@pytest.mark.parametrize("focal_length", [0.3, 0.6, 0.8])
def test_focused_microlenses_show_the_image_of_the_plane_of_focus(focal_length):
    array = spec_of(pixels=15, arrangement="focused", focal_length=focal_length).arrangement(WIDTH, WIDTH)
    image = 1.0 / (1.0 / 40.0 - 1.0 / 2000.0)
    assert 1.0 / (array.image - image) + 1.0 / array.distance == pytest.approx(1.0 / focal_length)
    # Sub-images touch.
    assert 10.0 * array.distance / array.image == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("keys", "key", "message"),
    [
        ({"microlenses": {"pixels": 15, "pitch": "100 um"}}, ("microlenses", "pitch"), "pixels and pitch both set"),
        ({"microlenses": {"arrangement": "focused"}}, ("microlenses", "focal_length"), "needs the focal_length"),
        ({"f_number": math.inf}, ("f_number",), "there is none"),
        ({"lens": "a.yaml"}, ("focal_length",), "lens and focal_length both say"),
        ({"dispersion": True}, ("dispersion",), "give lens"),
    ],
)
def test_what_cannot_be_is_refused(keys, key, message):
    with pytest.raises(ValidationError, match=message) as caught:
        LightField.model_validate({**THIN, **keys})
    assert caught.value.errors()[0]["loc"] == key


def test_optics_without_a_size_are_refused():
    with pytest.raises(ValidationError, match="need the size of the optics"):
        LightField.model_validate({"type": "light_field", "vfov": 40, "aperture": 5})


def test_pixels_that_cannot_tell_directions_apart_are_refused():
    text = _TEXT.format(camera="microlenses: {pitch: 30 um}")
    with pytest.raises(SceneError, match=r"camera\.microlenses\.pitch: leaves 1\.5"):
        explain(scene(text, width=WIDTH, height=WIDTH))


# ---- Pictures

_TEXT = """
camera: {{type: light_field, look_at: [0, 0, -1], sensor: {{width: 6 mm, height: 6 mm}}, focal_length: 40 mm,
          f_number: 4, focus_distance: 2, {camera}}}
environment: {{type: constant, radiance: 0.5}}
objects:
  - {{type: quad, corner: [-2, -2, -2.5], edges: [[4, 0, 0], [0, 4, 0]],
      material: {{type: emitter, radiance: {{type: checker, scale: 0.03, even: [0.1, 0.4, 0.2], odd: [1, 0.8, 0.5]}}}}}}
  - {{type: sphere, center: [0.02, 0.03, -1.2], radius: 0.02, material: {{type: emitter, radiance: [0.2, 2, 0.1]}}}}
"""


def picture(text, spp, width):
    from raytracer.rendering.render import render

    checked = build(scene_text(text, width=width, height=width, spp=spp, max_depth=1, filled=False), "test.yaml")
    return render(checked, seed=spp, threads=2).image


@pytest.fixture(scope="module")
def raw():
    return picture(_TEXT.format(camera="microlenses: {pixels: 15}"), 32, WIDTH)


def in_place(layout, **keys):
    """The scene as another camera sees it, with the field of view of the views."""
    vfov = 2.0 * math.degrees(math.atan(0.5 * layout.views.height * layout.views.plane.pixel))
    other = ", ".join(f"{key}: {value}" for key, value in keys.items())
    camera = f"camera: {{look_at: [0, 0, -1], vfov: {vfov!r}, {other}}}\n"
    return camera + _TEXT.format(camera="").partition("\n          f_number")[2].partition("\n")[2]


def assert_same(first, variance, second):
    """Pixels of two pictures differ by no more than their noise, in the mean square and in all."""
    score = (first - second.radiance) ** 2 / (variance + second.variance + 1e-12)
    # A pixel of many samples is nearly normal: the mean of n squares has a deviation of sqrt(2 / n).
    assert score.mean() < 1.0 + 5.0 * math.sqrt(2.0 / score.size)
    assert score.max() < 40.0


def test_the_mean_over_the_pixels_of_a_microlens_is_the_ordinary_photograph(raw):
    layout = raw.layout
    photograph = picture(in_place(layout, type="thin_lens", focus_distance=2, aperture="10 mm"), 4096, 20)
    lit = layout.lit.reshape(20, 15, 20, 15).sum(axis=(1, 3))[..., None]
    np.testing.assert_allclose(lit, 225 * math.pi / 4.0)
    mean = raw.radiance.reshape(20, 15, 20, 15, 3).sum(axis=(1, 3)) / lit
    variance = raw.variance.reshape(20, 15, 20, 15, 3).sum(axis=(1, 3)) / lit**2
    assert_same(mean, variance, photograph)
    relative = math.sqrt(((mean - photograph.radiance) ** 2).mean() / (photograph.radiance**2).mean())
    assert relative < 0.01


def test_views_see_from_where_they_are_said_to_be(raw):
    """Points before the plane of focus go left as the view goes right, by the one formula of `Views`."""
    layout = raw.layout
    field, views = layout.light_field(raw), layout.views
    assert views.nearest() == (7, 7)
    shift = views.shift(1.0 / 1.2)
    rows, columns = np.mgrid[0:20, 0:20] + 0.5
    for row, column in ((7, 2), (7, 12), (2, 7), (12, 7)):
        position = np.array([0.02, 0.03])
        ball = field.view(row, column)[..., 1] * (field.view(row, column)[..., 0] < 0.35)
        ball = np.where(ball > 1.2, ball, 0.0)
        result = np.array([(ball * columns).sum(), (ball * rows).sum()]) / ball.sum()
        plane = views.plane
        expected = [(position[0] / 1.2 - plane.left) / plane.pixel, (plane.top - position[1] / 1.2) / plane.pixel]
        np.testing.assert_allclose(result, np.array(expected) + shift[row, column], atol=0.25)


def test_exposed_sensors_get_the_irradiance_of_the_photograph_spread_over_sub_images():
    # E of an ordinary photograph on the axis, pi / 4 / (N (1 + m))^2, over the square of 1 + d / z.
    keys = {**THIN, "microlenses": {"pixels": 15}, "iso": 100, "shutter": "1/100 s"}
    spec = LightField.model_validate(keys)
    array = spec.arrangement(WIDTH, WIDTH)
    rng = np.random.default_rng(5)
    x, y = 142.5 + 7.5 * rng.uniform(-1.0, 1.0, (2, 60_000))
    _, _, weights = weighted_rays(spec.pack(WIDTH, WIDTH), x, y)
    working = array.image / 10.0
    assert weights.mean() == pytest.approx(math.pi / 4.0 / working**2 / array.magnification**2, rel=0.01)
    thin = {key: value for key, value in keys.items() if key not in ("type", "microlenses")}
    photograph = ThinLens.model_validate(thin).pack(WIDTH, WIDTH)
    _, _, whole = weighted_rays(photograph, np.full(100, 150.0), 150.0)
    assert weights.mean() * array.magnification**2 == pytest.approx(whole.mean(), rel=0.01)


# ---- What it says of itself


def test_small_microlenses_give_sharp_views_and_large_ones_many():
    spec = spec_of(pixels=10)
    rows = spec.trade_off(WIDTH, WIDTH)
    assert [row["sub_image_px"] for row in rows] == [5, 7, 10, 15, 20, 30]
    for row in rows:
        assert row["view_columns"] == row["sub_image_px"]
        assert row["view_width_px"] == WIDTH // row["sub_image_px"]
    # A pixel of a view, p / z, is what a view's own opening, D / n, blurs over at the limits: 1/w = 1/F +- p n / (z D).
    array = spec.arrangement(WIDTH, WIDTH)
    reach = 1e-3 * array.pitch / (1e-3 * array.image) / (0.01 / 10)
    numbers = spec.describe(WIDTH, WIDTH)
    assert numbers["refocus_near_m"] == pytest.approx(1.0 / (1.0 / FOCUS + reach))
    assert numbers["refocus_far_m"] == math.inf
    near = [row["refocus_near_m"] for row in rows]
    assert near == sorted(near, reverse=True)


def test_explain_prints_the_trade_off():
    text = scene_text(_TEXT.format(camera="microlenses: {pixels: 15}"), width=WIDTH, height=WIDTH, filled=False)
    result = explain(build(text, "test.yaml"))
    text = result.text()
    assert "Microlenses of other sizes before the same sensor" in text
    assert [line.split()[:2] for line in text.splitlines() if line.endswith("  these")] == [["291.3", "15"]]
    assert result.json()["trade_off"][2]["view_columns"] == 15
    assert not result.warnings


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"f_number": 2.8}, None),
        ({"f_number": 2.8, "microlenses": {"pixels": 15, "focal_length": "1.2 mm"}}, "would overlap"),
        ({"f_number": 8, "microlenses": {"pixels": 15, "focal_length": "1.2 mm"}}, "stay dark"),
        ({"microlenses": {"pixels": 15, "arrangement": "focused", "focal_length": "1 mm"}}, None),
        ({"microlenses": {"pixels": 15, "arrangement": "focused", "focal_length": "0.5 mm"}}, "is seen by"),
    ],
)
def test_what_does_not_suit_the_main_lens_is_doubted(keys, message):
    result = LightField.model_validate({**THIN, **keys}).warnings(WIDTH, WIDTH)
    assert [warned.keys for warned in result] == ([] if message is None else [("microlenses",)])
    assert message is None or message in result[0].text


def test_a_picture_without_room_for_a_sub_image_holds_no_views():
    spec = spec_of(pixels=30)
    assert spec.layout(29, 60) is None
    assert [warned.keys for warned in spec.warnings(29, 60) if "holds no views" in warned.text] == [("microlenses",)]
    assert "views" not in spec.describe(29, 60)
