"""What figures and numbers of the lecture say is what the program computes."""

import re

import numpy as np
import pytest
from PIL import Image

from docs import gallery_light_fields
from docs.diagrams import light_field, shutter
from docs.gallery_sheets import LECTURE
from raytracer.analysis.explain import explain
from raytracer.analysis.lens_design.performance.optical_bench import set_up_bench
from raytracer.analysis.lens_design.performance.tolerances import tolerances
from raytracer.core.shutter.table import line_exposure
from raytracer.film.sensor_response import make_response
from raytracer.optics.thin_lens import circle_of_confusion, image_distance
from raytracer.scene.load import load
from tests.analysis.lens_design.benches import shipped
from tests.repository import ROOT, SCENES

PAGES = {path.stem[:2]: path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "lecture").glob("[01]*.md")}
GALLERY = ROOT / "docs" / "gallery"


def shown(name: str) -> np.ndarray:
    """A picture of the gallery, 0 to 255."""
    with Image.open(GALLERY / f"{name}.jpg") as picture:
        return np.asarray(picture, float)


# ---- Inside a camera


THICK, HIGH, IOR = 0.7, 1.3, 1.8
BLADES = 0.77, 0.36


def meets(height: float) -> tuple[float, float]:
    """Trace a ray from 5 m before an ellipsoid: return its height at the blades, and where it meets the axis."""
    place, way = np.array([-5.0, 0.0]), np.array([5.0, height]) / np.hypot(5.0, height)
    squares = np.array([THICK, HIGH]) ** -2
    for sign, ratio in ((-1.0, 1.0 / IOR), (1.0, IOR)):
        a, b, c = (squares * way) @ way, (squares * way) @ place, (squares * place) @ place - 1.0
        place = place + (sign * np.sqrt(b * b - a * c) - b) / a * way
        normal = -sign * squares * place / np.linalg.norm(squares * place)
        cosine = -way @ normal
        way = ratio * way + (ratio * cosine - np.sqrt(1.0 - ratio**2 * (1.0 - cosine**2))) * normal
    slope = way[1] / way[0]
    return place[1] + (BLADES[0] - place[0]) * slope, place[0] - place[1] / slope


def narrowest(blades: float) -> float:
    """Find where the rays between the blades are nearest to the axis, in the mean square over an even disc."""
    heights = np.linspace(0.002, 0.6, 300)
    rays = [(height, *meets(height)) for height in heights]
    weight, at_blades, end = np.array([ray for ray in rays if ray[1] < blades]).T
    places = np.linspace(2.0, 3.5, 301)
    spread = [(weight * (at_blades * (end - x) / (end - BLADES[0])) ** 2).sum() for x in places]
    return float(places[int(np.argmin(spread))])


def test_the_film_stands_where_the_lens_makes_an_image() -> None:
    spec = load(SCENES / "lecture" / "inside_camera.yaml")
    objects = {item.name: item for item in spec.objects if item.name}
    assert spec.materials["glass"].ior.base == IOR
    assert -objects["letter"].max[0] == 5.0
    # The lens maker's equation of a thick lens; at its vertex an ellipsoid has the radius b^2 / a.
    curve = THICK / HIGH**2
    power = (IOR - 1.0) * (2.0 * curve - (IOR - 1.0) * 2.0 * THICK * curve**2 / IOR)
    back = THICK - (IOR - 1.0) * 2.0 * THICK * curve / (IOR * power)
    axis = back + image_distance(1.0 / power, 5.0 - back)
    assert meets(1e-3)[1] == pytest.approx(axis, rel=1e-5)
    edge = min((ray for ray in map(meets, np.linspace(0.3, 0.6, 301)) if ray[0] < BLADES[1]), key=lambda ray: ray[1])[1]
    assert edge < objects["film"].min[0] < axis
    words = " ".join(PAGES["01"].split())
    assert f"focal length of {1.0 / power:.2f} m" in words
    assert f"meet {axis:.2f} m behind its middle" in words
    assert f"meet at {edge:.2f} m" in words
    assert narrowest(BLADES[1]) == pytest.approx(objects["film"].min[0], abs=0.01)
    assert f"narrowest at {narrowest(0.5 * BLADES[1]):.2f} m" in words


def test_the_film_shows_the_letter_upside_down_and_only_in_the_slit() -> None:
    sheet = shown("lecture_inside_camera")
    panels = [sheet[350 * (n // 2) : 350 * (n // 2) + 320, 486 * (n % 2) : 486 * (n % 2) + 480] for n in range(4)]
    # On the film, what is green is below the middle of what is red.
    film = panels[0][100:200, 395:440]
    red_rows, green_rows = (np.nonzero(film[..., k] > film.mean(axis=2) + 40.0)[0] for k in (0, 1))
    assert green_rows.mean() > red_rows.mean() + 15.0
    # The green bar is bright in a late slit, and the upper end of the red one in an early slit.
    green = [panel[172:190, 410:424, 1].mean() for panel in panels]
    red = [panel[120:134, 407:413, 0].mean() for panel in panels]
    assert min(green[0], green[3]) > 1.3 * green[2]
    assert min(red[0], red[2]) > 1.3 * red[3]


# ---- The slit of a focal plane shutter


@pytest.mark.parametrize("seconds", shutter.TIMES.values())
def test_the_slit_uncovers_the_lines_that_are_exposed(seconds: float) -> None:
    packed = shutter.focal_plane(seconds)
    whole = packed.close - packed.open
    for time in np.linspace(0.01, 0.99, 12) * whole:
        begin, end = shutter.uncovered(seconds, time)
        for place in np.linspace(0.03, 0.97, 23):
            opens, width = (part * whole for part in line_exposure(packed.scan, 0.0, place * packed.scan.lines))
            assert (begin < place < end) == (opens < time < opens + width)
    # The width that the page derives, at a moment when the slit is whole.
    begin, end = shutter.uncovered(seconds, 0.5 * whole)
    assert end - begin == pytest.approx(min(1.0, seconds / shutter.TRAVEL))


def test_a_flash_shows_the_slit_where_it_is() -> None:
    wanted = [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0), (0.375, 0.5), (0.0, 1.0)]
    picture, sheet = shown("lecture_slit"), LECTURE["slit"]
    for number, (variant, band) in enumerate(zip(sheet.variants, wanted, strict=True)):
        spec = load(SCENES / "lecture" / "frozen_drop.yaml", dict(variant.keys))
        timing = spec.camera.shutter.timing(0.0)
        begin, end = (moment for moment in spec.lights[0].pulse(timing))
        seconds = timing.seconds()
        assert shutter.uncovered(seconds, begin) == pytest.approx(band)
        assert end - begin < 0.02 * shutter.TRAVEL
        # The panel of the sheet is black elsewhere.
        left, top = 406 * (number % 3), 297 * (number // 3)
        lit = picture[top + 2 : top + 265, left + 5 : left + 395].mean(axis=(1, 2)) > 30.0
        assert lit.mean() == pytest.approx(band[1] - band[0], abs=0.03)
        assert np.flatnonzero(lit).mean() / len(lit) == pytest.approx(np.mean(band), abs=0.02)


# ---- Depth of focus


def test_the_depth_of_focus_is_the_image_of_the_depth_of_field() -> None:
    path = SCENES / "lecture" / "aperture.yaml"
    facts, camera = explain(load(path)).camera, load(path).camera
    focal_length, circle = camera.focal_length, facts["circle_mm"]
    depth = 2.0 * camera.f_number * circle * (1.0 + facts["magnification"])
    # Gauss's equation for both limits.
    near, far = (image_distance(focal_length, 1e3 * facts[name]) for name in ("near_limit_m", "far_limit_m"))
    assert depth == pytest.approx(near - far, rel=1e-3)
    # A point at the focus, on a film that is off by half of it.
    film = facts["image_distance_mm"] + 0.5 * depth
    blur = circle_of_confusion(
        facts["entrance_pupil_mm"],
        film,
        focal_length * film / (film - focal_length),
        1e3 * facts["focus_distance_m"],
    )
    assert blur == pytest.approx(circle, rel=1e-3)
    assert f"$t$ = {depth:.4f} mm" in " ".join(PAGES["11"].split())


def test_the_report_of_a_lens_has_the_depth_of_focus_that_the_page_says() -> None:
    found = tolerances(set_up_bench(shipped("double-gauss-50mm"), None))
    assert f"± {found.depth_of_focus_mm:.4f} mm for\nthe double Gauss" in PAGES["11"]
    assert found.depth_of_focus_mm == pytest.approx(2.0 * found.circle_of_confusion_mm, rel=5e-3)
    assert f"within ±{found.depth_of_focus_mm:.3f} mm" in PAGES["11"]


# ---- A bullet


def test_a_bullet_flies_as_far_in_a_flash_as_the_page_says() -> None:
    path = SCENES / "lecture" / "bullet.yaml"
    spec = load(path)
    # Pixels a second.
    speed = explain(spec).objects["bullet"]["streak_px"] / spec.camera.shutter
    flown = [speed * load(path, dict(variant.keys)).lights[0].duration for variant in LECTURE["bullet"].variants]
    assert flown[0] == pytest.approx(1.0, abs=0.2)  # "about a pixel"
    assert flown[2] > 2.0 * spec.film.width  # "more than twice the width of the picture"
    # Columns of 0.44 mm in which the bullet is seen before the blue wall: 25 mm, and 20 mm more.
    parts = [shown("lecture_bullet")[120:146, 406 * k + 285 : 406 * k + 395] for k in range(3)]
    seen = [(part[..., 2] - part[..., 0]).min(axis=0) < 15.0 for part in parts]
    assert [columns.sum() for columns in seen] == pytest.approx([57, 102, 0], abs=8)


# ---- Gain


def test_rounding_adds_the_noise_that_the_page_says() -> None:
    exposed = {"camera.shutter": 1 / 1024, "camera.sensor.full_well": 50_000.0}
    steps = {}
    for bits in (10, 14):
        for iso in (100, 6400):
            keys = {**exposed, "camera.sensor.bit_depth": bits}
            response = make_response(load(SCENES / "lecture" / "iso_noise.yaml", keys).camera.sensor, iso)
            steps[bits, iso] = 1.0 / response.scale
            # The variance of no light, in electrons.
            dark = float(response.variance(np.zeros(1))[0]) * response.saturation**2
            assert dark == pytest.approx(3.0**2 + steps[bits, iso] ** 2 / 12.0)
    assert steps[10, 100] == pytest.approx(64.0 * steps[10, 6400])
    for bits, step, noise in ((10, "50.5", "14.6"), (14, "3.2", "0.9")):
        assert f"{steps[bits, 100]:.{len(step) - step.index('.') - 1}f}" == step
        words = " ".join(PAGES["06"].split())
        assert re.search(rf"a step is {step} electrons, and rounding adds {noise}\b", words)
        assert steps[bits, 100] / 12.0**0.5 == pytest.approx(float(noise), abs=0.05)
    # White at ISO 6400 is a 64th of a full well.
    assert int(50_000 / 64 / steps[10, 100]) == 15


def test_digital_gain_leaves_few_numbers() -> None:
    sheet = shown("lecture_gain")
    panels = {(330 * (n // 2), 406 * (n % 2)): bits for n, bits in enumerate(("before", 14, 12, 10))}
    greys = {bits: sheet[y : y + 300, x : x + 400, 1][2::5, 2::5] for (y, x), bits in panels.items()}
    noise = {bits: np.abs(np.diff(grey[:20], axis=1)).mean() for bits, grey in greys.items()}
    assert noise[10] > 1.5 * noise["before"]
    assert noise[14] == pytest.approx(noise["before"], rel=0.2)


# ---- Light fields


def sharpness(picture: np.ndarray) -> float:
    """Energy of the gradients of a part of a picture."""
    return float(sum((step**2).mean() for step in np.gradient(picture.mean(axis=2))))


def test_one_raw_picture_is_refocused_on_either_dragon() -> None:
    sheet = shown("lightfield_raw_dragons")
    panels = [sheet[330 * (n // 2) : 330 * (n // 2) + 300, 406 * (n % 2) : 406 * (n % 2) + 400] for n in range(6)]
    head, body = (
        [sharpness(panel[part]) for panel in panels[1:]] for part in (np.s_[60:160, 50:130], np.s_[90:190, 190:330])
    )
    # The first is the photograph, which is focused in front of both.
    assert np.argmax(head) == 1 + gallery_light_fields.DRAGON_FOCUSES.index(0.58)
    assert np.argmax(body) == 1 + gallery_light_fields.DRAGON_FOCUSES.index(0.79)
    assert max(head) > 2.0 * head[-1]
    assert max(body) > 2.0 * body[0]


def test_a_light_field_shows_each_eye_the_window_and_a_photograph_does_not() -> None:
    sheet = shown("lightfield_window")
    rows = [sheet[270 * n : 270 * n + 240] for n in range(3)]
    window, field, photograph = ([row[:, 326 * k : 326 * k + 320] for k in range(3)] for row in rows)
    for side in (0, 2):
        wrong = np.abs(photograph[side] - window[side]).mean()
        assert np.abs(field[side] - window[side]).mean() < 0.15 * wrong
    assert np.abs(photograph[0] - photograph[2]).mean() < 2.0


def test_a_point_of_a_wall_looks_alike_from_everywhere_and_one_of_a_pane_does_not() -> None:
    sheet = shown("lightfield_two_planes")[210:390]
    spreads = [sheet[10:170, 246 * k + 40 : 246 * k + 200].std(axis=(0, 1)).max() for k in range(4)]
    assert min(spreads[1:]) > 3.0 * spreads[0]


def test_rays_of_the_diagram_enter_the_box_on_its_surface() -> None:
    for eye, target in (((-5.2, -1.3), (-0.4, -0.46)), ((-1.2, -3.6), (0.5, -0.41)), ((4.0, 3.0), (0.1, -0.2))):
        x, y = light_field._crossing(eye, target, 1.5)
        assert max(abs(x), abs(y)) == pytest.approx(1.5)
        assert (x - eye[0]) * (target[1] - eye[1]) == pytest.approx((y - eye[1]) * (target[0] - eye[0]))
