"""The page of a light field in a browser: a click focuses, a drag looks around, the picture is the refocused one."""

import base64
import dataclasses
import io
import json
import re

import numpy as np
import PIL.Image
import pytest

from raytracer.film import srgb
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.lightfield.viewer.page import write_page
from tests.browser import WEBGL
from tests.lightfield.analytic import Surface, light_field, views, waves
from tests.lightfield.test_looking_commands import run

CHROMIUM = WEBGL


WIDTH, HEIGHT, SPACING = 96, 72, 0.012
NEAR, MIDDLE, FAR = 1.6, 2.5, 5.0

# Where in the picture (0..1, right and down) the planes at those distances are, seen from anywhere.
AT = {NEAR: (0.25, 0.5), MIDDLE: (0.6, 0.5), FAR: (0.9, 0.15)}


@pytest.fixture(scope="module")
def field():
    """A near and a middle card before a wall; the plane that stands still is none of them."""
    surfaces = [
        Surface(FAR, waves(1, 0.12)),
        Surface(MIDDLE, waves(2, 0.06), bounds=(-0.05, -0.5, 0.5, 0.5)),
        Surface(NEAR, waves(3, 0.04), bounds=(-0.4, -0.3, -0.1, 0.3)),
    ]
    made = light_field(views(7, 7, spacing=SPACING, width=WIDTH, height=HEIGHT), surfaces, supersampling=1)
    # All of it can be shown: 8 bits of sRGB are then all that is lost.
    return dataclasses.replace(made, radiance=np.clip(made.radiance, 0.0, 1.0))


@pytest.fixture
def opened(open_page, tmp_path):
    """The page of a light field, once all of its views are there."""

    def opened(field, fragment="", settings=None, **window):
        path = tmp_path / "page.html"
        write_page(path, field, **(settings or {}))
        page = open_page(path, fragment, **window)
        page.locator(f"body[data-views='{len(data_in(path)['views'])}'][data-shown]").wait_for()
        return page

    return opened


def data_in(path):
    """Read the data that a page gives to its script."""
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', path.read_text())
    return json.loads(found)


def seen(page):
    """The picture of the page on the pixels of the views, 0..255 (height, width, 3)."""
    return decoded(page.evaluate("picture().toDataURL('image/png')"))


def decoded(address):
    """The pixels of a picture that is its own address."""
    with PIL.Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))) as file:
        return np.asarray(file.convert("RGB"), dtype=np.float64)


def settled(page):
    """Until the focus rests and is drawn."""
    page.wait_for_function("() => gliding === null && document.body.dataset.shown === addressOf()")


def number(page, key):
    """A number of the address that the page has now."""
    said = dict(part.split("=") for part in page.evaluate("addressOf()").split("&"))
    return float(said[key])


def sharpness(picture, at, reach=7):
    """Gradient energy around a place."""
    x, y = int(at[0] * picture.shape[1]), int(at[1] * picture.shape[0])
    grey = picture[max(0, y - reach) : y + reach, max(0, x - reach) : x + reach].mean(axis=-1)
    return float(sum((part**2).mean() for part in np.gradient(grey)))


def place(page, at):
    """A place in the picture in pixels of the window."""
    box = page.locator("#picture").bounding_box()
    return box["x"] + at[0] * box["width"], box["y"] + at[1] * box["height"]


def off(page, field, distance, **settings):
    """How far each value is from what Python makes of it."""
    return np.abs(seen(page) - srgb.to_uint8(refocus(field, distance, interpolation="linear", **settings).radiance))


@pytest.mark.parametrize("distance", [NEAR, 2.0, FAR])
def test_it_is_refocused_as_by_python(opened, field, distance):
    """All views count the same: within the rounding of two times 8 bits, and that of a graphics card's filter."""
    error = off(opened(field, f"#focus={distance}"), field, distance)
    assert error.max() <= 2.0
    assert error.mean() < 0.5


def test_a_smaller_aperture_is_python_s(opened, field):
    """A round one: views count by the part of their cell that it covers."""
    page = opened(field, f"#focus={MIDDLE}&aperture=0.5&shape=round")
    error = off(page, field, MIDDLE, aperture=3.5 * SPACING)
    assert error.max() <= 3.0
    assert error.mean() < 0.5
    assert "42 mm" in page.locator("#aperture output").inner_text()


def test_behind_a_lens_views_count_by_what_it_lets_through(opened, field):
    """f/ numbers are told, and views beyond the lens are not looked from."""
    across = 7.0 * SPACING
    lens = dataclasses.replace(field.views, aperture=across, focal_length=168.0, cell=(SPACING, SPACING))
    behind = dataclasses.replace(field, views=lens)
    page = opened(behind, f"#focus={MIDDLE}")
    assert off(page, behind, MIDDLE).max() <= 3.0
    assert page.locator("#aperture output").inner_text().startswith("f/2,")
    page.evaluate("choose({ eye: [1, 1] })")
    assert number(page, "aperture") == 1.0
    assert np.hypot(*page.evaluate("state.eye")) <= 0.5 * across * (1.0 + 1e-12)


@pytest.mark.parametrize(("distance", "eye"), [(NEAR, (0, 0)), (MIDDLE, (24, -24)), (FAR, (24, -24))])
def test_a_click_focuses_where_it_is(opened, field, distance, eye):
    """Seen from the middle or not: what is under the pointer becomes as sharp as it can be."""
    away = FAR if distance != FAR else NEAR
    page = opened(field, f"#focus={away}&from={eye[0]},{eye[1]}")
    before = sharpness(seen(page), AT[distance])
    page.mouse.click(*place(page, AT[distance]))
    settled(page)
    assert number(page, "focus") == pytest.approx(distance, rel=0.01)
    assert sharpness(seen(page), AT[distance]) > 1.3 * before
    assert page.locator("#focus output").inner_text() == f"{distance:.2f} m"


def test_a_drag_looks_around(opened, field):
    """What is nearer than the focus goes with the hand, what is farther against it, by the parallax."""
    page = opened(field, f"#focus={MIDDLE}&aperture=0")
    before = seen(page)
    x, y = place(page, (0.5, 0.5))
    across = page.locator("#picture").bounding_box()["width"]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + across / 3.0, y, steps=4)
    page.mouse.up()
    settled(page)
    # A third of the way from one end of the views to the other.
    assert page.evaluate("state.eye") == pytest.approx([-2.0 * SPACING, 0.0], abs=1e-6)
    assert number(page, "focus") == MIDDLE
    after = seen(page)
    for distance, at in AT.items():
        moved = 2.0 * SPACING * (1.0 / distance - 1.0 / MIDDLE) / field.views.plane.pixel
        assert shift_of(before, after, at) == pytest.approx(moved, abs=1.0), distance


def shift_of(before, after, at):
    """By how many pixels to the right a patch has moved."""
    x, y = int(at[0] * WIDTH), int(at[1] * HEIGHT)
    patch = np.s_[y - 8 : y + 8, x - 8 : min(x + 8, WIDTH - 4)]
    steps = range(-8, 9)
    return min(steps, key=lambda step: float(((np.roll(before, step, axis=1) - after)[patch] ** 2).mean()))


def test_sliders_and_keys(opened, field):
    page = opened(field, "#focus=2")
    page.get_by_role("slider", name="Focus").fill("0")
    nearest = number(page, "focus")
    page.get_by_role("slider", name="Focus").press("ArrowRight")
    assert 0.0 < nearest < number(page, "focus") < NEAR
    page.get_by_role("slider", name="Aperture").fill("40")
    assert number(page, "aperture") == 0.4
    page.get_by_role("slider", name="Exposure").fill("-1")
    assert page.get_by_role("slider", name="Exposure").get_attribute("aria-valuetext") == "-1 EV"
    canvas = page.locator("#picture")
    canvas.press("ArrowRight")
    assert page.evaluate("state.eye") == pytest.approx([0.5 * SPACING, 0.0])
    assert page.locator("#pupil output").inner_text() == "6 mm right"
    canvas.press("Home")
    assert page.locator("#pupil output").inner_text() == "the middle"
    canvas.press("a")
    assert number(page, "aperture") == 0.0
    canvas.press("a")
    assert number(page, "aperture") == 0.4
    before = number(page, "focus")
    canvas.press("-")
    assert number(page, "focus") > before
    canvas.press("Enter")
    settled(page)
    assert number(page, "focus") == pytest.approx(MIDDLE, rel=0.01)


def test_the_address_says_what_is_seen(opened, field):
    page = opened(field, "#focus=2.5&aperture=0.3&from=10,-5&ev=1.5&shape=round")
    shown = page.evaluate("document.body.dataset.shown")
    assert shown == "focus=2.5&aperture=0.3&from=10,-5&ev=1.5&shape=round"
    page.locator("#picture").press("Home")
    page.wait_for_url("**#focus=2.5&aperture=0.3&from=0,0&ev=1.5&shape=round")
    page.goto(page.url.split("#")[0] + "#focus=-1&aperture=x&zoom=2&ev=2")
    page.wait_for_function("() => addressOf() === 'focus=2.5&aperture=0.3&from=0,0&ev=2&shape=round'")


@pytest.mark.parametrize(("size", "scheme"), [((360, 640), "dark"), ((1280, 800), "light")])
def test_it_fits(opened, field, size, scheme):
    page = opened(field, "", size=size, color_scheme=scheme, device_scale_factor=2)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert background == ("rgb(21, 23, 27)" if scheme == "dark" else "rgb(255, 255, 255)")
    picture, camera = page.locator("#picture").bounding_box(), page.locator("#camera").bounding_box()
    assert (camera["y"] > picture["y"] + picture["height"]) == (size[0] < 800)
    assert picture["width"] / picture["height"] == pytest.approx(WIDTH / HEIGHT, rel=0.02)
    # On any screen its pixels are those of the views.
    assert seen(page).shape == (HEIGHT, WIDTH, 3)


def test_without_webgl_there_is_a_picture(open_page, field, tmp_path):
    path = tmp_path / "page.html"
    write_page(path, field)
    none = "<script>HTMLCanvasElement.prototype.getContext = () => null;</script>"
    path.write_text(path.read_text().replace('<meta charset="utf-8">', f'<meta charset="utf-8">{none}', 1))
    page = open_page(path)
    page.locator("body[data-failed]").wait_for()
    assert "no WebGL 2" in page.locator("#trouble").inner_text()
    assert page.evaluate("find('#still').decode().then(() => find('#still').naturalWidth)") == WIDTH
    assert not page.locator("#camera").is_visible()


def test_names_are_text(opened, field):
    page = opened(field, settings={"title": "<b>a</b> & </script>"})
    assert page.locator("h1").inner_text() == "<b>a</b> & </script>"
    assert page.locator("b").count() == 0


def test_one_row(opened, field):
    places = dataclasses.replace(field.views, position=field.views.position[3:4])
    row = LightField(field.radiance[3:4], places, {"depth": field.layers["depth"][3:4]})
    page = opened(row, f"#focus={FAR}")
    assert off(page, row, FAR).max() <= 2.0
    assert "left and right" in page.locator("#help").inner_text()
    assert not page.locator("#shape").is_visible()
    page.evaluate("choose({ eye: [0.01, 0.01], opening: 0 })")
    assert page.evaluate("state.eye") == [0.01, 0.0]
    page.mouse.click(*place(page, AT[MIDDLE]))
    settled(page)
    assert number(page, "focus") == pytest.approx(MIDDLE, rel=0.01)


def test_without_metres_it_tells_slopes(opened, field):
    """Places in steps of one view, slopes in pixels a view: what a folder of pictures has."""
    geometry = Views(
        position=field.views.position / SPACING,
        plane=Plane(1.0, -0.5 * WIDTH, 0.5 * HEIGHT),
        width=WIDTH,
        height=HEIGHT,
    )
    unknown = LightField(field.radiance, geometry, settings={"units": "views"})
    page = opened(unknown, "#aperture=0.6")
    page.mouse.click(*place(page, AT[NEAR]))
    settled(page)
    slope = SPACING * (1.0 / NEAR - field.views.inverse_focus) / field.views.plane.pixel
    assert number(page, "focus") == pytest.approx(slope, abs=0.1)
    assert page.locator("#focus output").inner_text().startswith("slope ")
    assert " m" not in page.locator("#camera").inner_text().replace(" middle", "").replace("mm", "")


def test_the_dark_is_brightened_and_said(opened, field):
    dark = dataclasses.replace(field, radiance=np.asarray(field.radiance) / 1000.0)
    page = opened(dark, "#focus=2.5")
    ev = number(page, "ev")
    assert ev == pytest.approx(np.log2(1000.0), abs=0.75)
    wanted = srgb.to_uint8(2.0**ev * refocus(dark, 2.5, interpolation="linear").radiance)
    inside = (wanted < 250).all(axis=-1)
    assert np.abs(seen(page) - wanted)[inside].max() <= 2.0
    page.goto(page.url.split("#")[0] + "#ev=4")
    page.wait_for_function("() => document.body.dataset.shown.includes('ev=4')")
    assert seen(page).mean() < 100.0


def test_what_fits_is_held_without_losses(field, tmp_path):
    path = tmp_path / "page.html"
    assert write_page(path, field) == ()
    np.testing.assert_array_equal(decoded(data_in(path)["views"][9]["picture"]), srgb.to_uint8(field.view(1, 2)))


def test_on_the_command_line(field, tmp_path, capsys):
    lf.write(tmp_path / "cards.lf", field)
    assert run("view", tmp_path / "cards.lf", "-o", tmp_path / "cards.html") == 0
    assert "wrote" in capsys.readouterr().err
    assert (tmp_path / "cards.html").read_bytes().startswith(b"<!doctype html>")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "cards.png"], "unknown suffix '.png' for a page"),
        (["--size", "lots"], "--size lots: must be a number of bytes"),
        (["--size", "10kB"], "at least 1MB"),
        (["--exposure", "bright"], "--exposure bright: must be a number of stops"),
    ],
)
def test_what_is_wrong_is_said(capsys, arguments, said):
    assert run("view", "cards.lf", *arguments) == 2
    assert said in capsys.readouterr().err
