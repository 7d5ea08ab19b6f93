"""The page of views with poses of their own: its picture is that of `view_from`, and one goes round with a hand."""

import dataclasses

import numpy as np
import pytest
from axe_playwright_python import sync_playwright as axe

from raytracer.film.light_field import lf
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.lightfield.viewer.posed_page import page as page_of
from raytracer.lightfield.views.unstructured import view_from
from raytracer.plugins.cameras.camera_box import CameraBox
from raytracer.plugins.cameras.camera_sphere import CameraSphere
from raytracer.util import srgb
from raytracer.util.errors import InputError
from tests.browser import WEBGL
from tests.lightfield.test_any_pose import camera_at, captured, psnr
from tests.lightfield.test_looking_commands import run
from tests.lightfield.test_viewer import data_in, place, seen

CHROMIUM = WEBGL
AT = {"look_from": (0, 0, 0), "look_at": (0, 0, -1), "vfov": 70}
ROOM = {"rows": 4, "columns": 9, "facing": "outward", "radius": 0.3, **AT}
SPHERE = {"rows": 4, "columns": 8, "look_from": (0, 0, 3), "look_at": (0, 0, 0), "vfov": 64}
NEW_PLACES = [(1.6, 1.3, 1.9), (-2.4, -1.1, 1.2), (0.4, 3.1, -0.9)]


@pytest.fixture(scope="module")
def field():
    return captured(CameraSphere.model_validate(SPHERE))


@pytest.fixture(scope="module")
def few():
    """Fewer views, which are drawn sooner, for what does not depend on how many there are."""
    return captured(CameraSphere.model_validate({**SPHERE, "rows": 2, "columns": 4}))


@pytest.fixture
def opened(open_page, tmp_path):
    """The page of a light field, once all of its views are there."""

    def opened(shown, fragment="", size=(900, 600), **settings):
        path = tmp_path / "page.html"
        page_of(shown, **settings).write(path)
        page = open_page(path, fragment, size)
        page.locator("body[data-views][data-shown]").wait_for()
        return page

    return opened


def look_from(page, eye, toward=(0.0, 0.0, 0.0), **values):
    """Show what is seen from a place, in linear light on the pixels of a view; NaN where nothing is known."""
    page.evaluate("values => choose(values)", {"from": list(eye), "toward": list(toward), **values})
    shown = seen(page, "RGBA")
    light = np.where(shown[..., 3:] > 0.0, srgb.decode(shown[..., :3] / 255.0), np.nan)
    height, width = light.shape[:2]
    parts = light.reshape(height // 2, 2, width // 2, 2, 3).swapaxes(1, 2).reshape(height // 2, width // 2, 4, 3)
    known = ~np.isnan(parts)
    total, count = np.where(known, parts, 0.0).sum(axis=2), known.sum(axis=2)
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)


def likeness(drawn, exact):
    """PSNR (dB) where both know something; they differ in what they know by less than 2 % of the picture."""
    unknown = np.isnan(drawn), np.isnan(exact)
    assert (unknown[0] != unknown[1]).mean() < 0.02
    known = ~(unknown[0] | unknown[1])
    return psnr(drawn[known], exact[known])


def settled(page):
    page.wait_for_function("() => frame === null && document.body.dataset.shown === addressOf()")


def state(page, key):
    return np.array(page.evaluate(f"state.{key}"))


def test_from_the_place_of_a_view_it_is_that_view(opened, field):
    """But for edges, whose pixels hold means: the median is within the rounding of two times 8 bits."""
    page = opened(field)
    for view in ((1, 2), (2, 7)):
        drawn, exact = look_from(page, field.views.pose[view][0]), field.radiance[view]
        assert likeness(drawn, exact) > 34.0
        known = ~np.isnan(drawn)
        assert np.median(np.abs(255.0 * (srgb.encode(drawn) - srgb.encode(exact))[known])) < 2.0


def test_between_views_it_is_drawn_as_by_python(opened, field):
    """Also nearer, and with another field of view."""
    page = opened(field)
    for eye in NEW_PLACES:
        drawn = look_from(page, eye, vfov=50.0)
        exact = view_from(field, camera_at(field, eye, vfov=50.0)).radiance
        assert likeness(drawn, exact) > 40.0


def test_without_depth_surfaces_are_a_plane_as_by_python(opened, field):
    flat = dataclasses.replace(field, layers={})
    page = opened(flat)
    assert "plane" in page.locator("#notes").inner_text()
    drawn = look_from(page, NEW_PLACES[0])
    exact = view_from(flat, camera_at(field, NEW_PLACES[0])).radiance
    assert likeness(drawn, exact) > 40.0
    known = ~np.isnan(exact)
    by_depth = np.where(known, view_from(field, camera_at(field, NEW_PLACES[0])).radiance, exact)
    assert psnr(drawn[known], np.nan_to_num(by_depth)[known]) < 25.0


def test_views_that_look_at_no_point_need_depth(field):
    """Side by side, or from the middle of a room outward."""
    room = captured(CameraSphere.model_validate(ROOM))
    with pytest.raises(InputError, match="look at no point"):
        page_of(dataclasses.replace(room, layers={}))


def test_a_drag_goes_round_and_a_wheel_comes_nearer(opened, few):
    page = opened(few)
    first = seen(page)
    start = state(page, "from")
    x, y = place(page, (0.5, 0.5))
    tall = page.locator("#picture").bounding_box()["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + tall / 4.0, y, steps=3)
    page.mouse.up()
    settled(page)
    eye = state(page, "from")
    # An eighth of a turn, to the left: what is before the point goes to the right with the hand.
    assert np.linalg.norm(eye) == pytest.approx(3.0)
    assert eye[1] == pytest.approx(start[1])
    turned = np.arctan2(eye[0], eye[2]) - np.arctan2(start[0], start[2])
    assert turned == pytest.approx(-np.pi / 4.0, abs=0.02)
    assert np.abs(seen(page) - first).mean() > 3.0
    page.mouse.wheel(0, -200)
    settled(page)
    assert np.linalg.norm(state(page, "from")) == pytest.approx(3.0 * np.exp(-0.3))
    canvas = page.locator("#picture")
    canvas.press("-")
    assert np.linalg.norm(state(page, "from")) == pytest.approx(3.3 * np.exp(-0.3))
    for _ in range(40):
        canvas.press("ArrowUp")
    # Not over the pole, where nothing would be up.
    assert 0.99 < state(page, "from")[1] / np.linalg.norm(state(page, "from")) < 1.0
    canvas.press("Home")
    assert state(page, "from") == pytest.approx(start)


def test_it_begins_with_a_level_view(tmp_path):
    """Of a box of cameras, not with that which looks down from its top."""
    keys = {"rows": 1, "columns": 1, "size": (4, 4, 4), "look_from": (0, 0, 1), "look_at": (0, 0, 0), "vfov": 60}
    path = tmp_path / "page.html"
    page_of(captured(CameraBox.model_validate({**keys, "faces": ("top", "bottom", "left")}))).write(path)
    data = data_in(path)
    sight = np.subtract(data["start"]["toward"], data["start"]["from"])
    assert data["up"] @ sight == pytest.approx(0.0, abs=1e-9)


def test_two_fingers_pinch(opened, few):
    page = opened(few)
    page.evaluate(
        """() => {
          const box = canvas.getBoundingClientRect();
          canvas.setPointerCapture = () => {};
          const say = (kind, id, x) => canvas.dispatchEvent(new PointerEvent(kind, {
            pointerId: id, pointerType: "touch", button: 0, clientX: box.left + x, clientY: box.top + 50 }));
          say("pointerdown", 1, 50); say("pointerdown", 2, 100); say("pointermove", 2, 150);
          say("pointerup", 1, 50); say("pointerup", 2, 150);
        }"""
    )
    assert np.linalg.norm(state(page, "from")) == pytest.approx(1.5)


def test_in_a_room_one_looks_around_and_walks_between_the_cameras(opened):
    room = captured(CameraSphere.model_validate(ROOM), [(np.zeros(3), 2.0)])
    page = opened(room)
    before, sight = state(page, "from"), state(page, "toward")
    page.locator("#picture").press("ArrowRight")
    assert state(page, "from") == pytest.approx(before)
    ahead = sight - before
    right = np.cross(ahead, (0.0, 1.0, 0.0))
    assert (state(page, "toward") - sight) @ right > 0.0
    for _ in range(30):
        page.locator("#picture").press("+")
    assert np.linalg.norm(state(page, "from")) < 0.3 + 1e-6
    drawn = look_from(page, (0.1, 0.05, -0.05), (1.0, 0.1, 0.3))
    exact = view_from(room, camera_at(room, (0.1, 0.05, -0.05), (1.0, 0.1, 0.3))).radiance
    assert likeness(drawn, exact) > 40.0


def test_the_address_says_what_is_seen(opened, few):
    address = "from=1,2,2.5&toward=0,0.1,0&vfov=40&ev=1"
    page = opened(few, f"#{address}")
    assert page.evaluate("document.body.dataset.shown") == address
    page.evaluate("choose({ vfov: 30 })")
    page.wait_for_url("**#from=1,2,2.5&toward=0,0.1,0&vfov=30&ev=1")
    # What is no pose, or has no direction that is up, stays.
    page.goto(page.url.split("#")[0] + "#from=0,5,0&toward=0,0,0&vfov=x&ev=2")
    page.goto(page.url.split("#")[0] + "#from=1,2&vfov=0&ev=0")
    page.wait_for_function("() => addressOf() === 'from=1,2,2.5&toward=0,0.1,0&vfov=30&ev=0'")


def test_it_is_saved(opened, few):
    page = opened(few)
    with page.expect_download() as saved:
        page.locator("#picture").press("s")
    assert saved.value.suggested_filename == "light field.png"


def test_anyone_can_use_it(opened, few):
    """What the rules of axe find: contrast, names, roles, what a keyboard cannot reach."""
    page = opened(few)
    found = axe.Axe().run(page, options={"preload": False}).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"]) for each in found] == []
    assert page.get_by_role("slider", name="Field of view").get_attribute("aria-valuetext") == "64\u00b0"


def test_a_large_light_field_is_made_smaller(field, tmp_path):
    """Noise in depth, which no codec makes much smaller, beside light that takes nothing."""
    random = np.random.default_rng(7)
    size = (*field.radiance.shape[:2], 160, 160)
    plane = field.views.plane * np.array([64.0 / 160.0, 1.0, 1.0])
    geometry = dataclasses.replace(field.views, plane=plane, width=160, height=160)
    light, depth = np.full((*size, 3), 0.5), random.uniform(2.0, 3.0, size)
    made = page_of(PosedLightField(light, geometry, {"depth": depth}), size=1_000_000)
    assert len(made.html) <= 1_000_000
    assert "pixels in place of 160 x 160" in made.notes[0]
    path = tmp_path / "page.html"
    path.write_bytes(made.html)
    data = data_in(path)
    assert data["notes"] == list(made.notes)
    pixel, down, left, top = data["views"][5]["plane"]
    assert left + pixel * data["width"] == pytest.approx(-left)
    assert top - down * data["height"] == pytest.approx(-top)
    with pytest.raises(ValueError, match="at least 1000000 bytes"):
        page_of(field, size=10)


def test_on_the_command_line(field, tmp_path, capsys):
    lf.write(tmp_path / "balls.lf", field)
    assert run("view", tmp_path / "balls.lf", "-o", tmp_path / "balls.html") == 0
    assert "wrote" in capsys.readouterr().err
    assert "inward" in data_in(tmp_path / "balls.html")
    lf.write(tmp_path / "bare.lf", captured_without_depth())
    assert run("view", tmp_path / "bare.lf", "-o", tmp_path / "bare.html") == 2
    assert "bare.lf: nothing is known of its depth" in capsys.readouterr().err


def captured_without_depth():
    return dataclasses.replace(captured(CameraSphere.model_validate(ROOM)), layers={})
