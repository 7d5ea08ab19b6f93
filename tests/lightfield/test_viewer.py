"""The page of a light field in a browser: a click focuses, a drag looks around, the picture is the refocused one."""

import base64
import dataclasses
import io
import json
import re

import numpy as np
import PIL.Image
import pytest
from scipy import ndimage

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField, Rays
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.lightfield.viewer.page import page as page_of
from raytracer.lightfield.viewer.page import write_page
from raytracer.util import srgb
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


@pytest.fixture(scope="module")
def plain(field, tmp_path_factory):
    """The page of that light field, which most tests open."""
    path = tmp_path_factory.mktemp("viewer") / "page.html"
    write_page(path, field)
    return path


@pytest.fixture
def opened(open_page, plain, field, tmp_path):
    """The page of a light field, once all of its views are there."""

    def opened(shown, fragment="", settings=None, size=(820, 500), **window):
        path = plain
        if shown is not field or settings:
            path = tmp_path / "page.html"
            write_page(path, shown, **(settings or {}))
        page = open_page(path, fragment, size, **window)
        page.locator(f"body[data-views='{len(data_in(path)['views'])}'][data-shown]").wait_for()
        return page

    return opened


def data_in(path):
    """Read the data that a page gives to its script."""
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', path.read_text())
    return json.loads(found)


def seen(page, channels="RGB"):
    """The picture of the page on the pixels of the views, 0..255 (height, width, 3)."""
    return decoded(page.evaluate("picture().toDataURL('image/png')"), channels)


def decoded(address, channels="RGB"):
    """The pixels of a picture that is its own address."""
    with PIL.Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))) as file:
        return np.asarray(file.convert(channels), dtype=np.float64)


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


def clicked(page, distance):
    """Click on what is at that distance, and return the focus that comes of it."""
    page.mouse.click(*place(page, AT[distance]))
    settled(page)
    return number(page, "focus")


def off(page, field, distance, **settings):
    """How far each value is from what Python makes of it."""
    return np.abs(seen(page) - srgb.to_uint8(refocus(field, distance, interpolation="linear", **settings).radiance))


def test_it_is_refocused_as_by_python(opened, field):
    """All views count the same: within the rounding of two times 8 bits, and that of a graphics card's filter."""
    page = opened(field, f"#focus={NEAR}")
    for distance in (NEAR, 2.0, FAR):
        page.evaluate(f"choose({{ w: {1.0 / distance} }})")
        error = off(page, field, distance)
        assert error.max() <= 2.0
        assert error.mean() < 0.5

    # The mean over views of L(u, x - u (w' - w0)), by the definition, where all views see.
    page.evaluate(f"choose({{ w: {1.0 / MIDDLE} }})")
    shifts = field.views.shift(1.0 / MIDDLE)
    total = np.zeros((HEIGHT, WIDTH, 3))
    for index in np.ndindex(7, 7):
        right, down = shifts[index]
        total += ndimage.shift(field.view(*index), (-down, -right, 0.0), order=1, mode="nearest")
    border = int(np.ceil(np.abs(shifts).max())) + 1
    inside = np.s_[border:-border, border:-border]
    assert np.abs(seen(page) - srgb.to_uint8(total / 49.0))[inside].max() <= 2.0


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


def test_closed_it_is_a_view(opened, field):
    """Through a pinhole where a view is, focused where all views see the same: bits for bits."""
    page = opened(field, f"#focus=2&aperture=0&from={1000 * SPACING * 2},{1000 * SPACING}")
    np.testing.assert_allclose(seen(page), srgb.to_uint8(field.view(2, 5)), atol=1.0)
    assert page.locator("#aperture output").inner_text() == "closed: everything is sharp"


def test_a_click_focuses_where_it_is(opened, field):
    """Seen from the middle or not: what is under the pointer becomes as sharp as it can be."""
    page = opened(field)
    for distance, eye in ((NEAR, (0.0, 0.0)), (MIDDLE, (0.024, -0.024)), (FAR, (0.024, -0.024))):
        away = FAR if distance != FAR else NEAR
        page.evaluate(f"choose({{ w: {1.0 / away}, eye: {list(eye)} }})")
        before = sharpness(seen(page), AT[distance])
        assert clicked(page, distance) == pytest.approx(distance, rel=0.01)
        assert page.evaluate("state.eye") == pytest.approx(eye)
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


def test_a_double_click_makes_all_sharp(opened, field):
    page = opened(field, f"#focus={FAR}")
    before = seen(page)
    page.mouse.dblclick(*place(page, AT[MIDDLE]))
    settled(page)
    after = seen(page)
    for distance in (NEAR, MIDDLE):
        assert sharpness(after, AT[distance]) > 1.5 * sharpness(before, AT[distance])


def test_a_finger(opened, field):
    page = opened(field, f"#focus={FAR}", size=(390, 760), has_touch=True, is_mobile=True)
    page.touchscreen.tap(*place(page, AT[NEAR]))
    settled(page)
    assert number(page, "focus") == pytest.approx(NEAR, rel=0.01)
    # A drag with a finger is told to pages as its pointer moves.
    moved = page.evaluate(
        """() => {
          const box = canvas.getBoundingClientRect();
          const say = (kind, x) => canvas.dispatchEvent(new PointerEvent(kind, {
            pointerId: 7, pointerType: "touch", button: 0, clientX: box.left + x, clientY: box.top + 50 }));
          canvas.setPointerCapture = () => {};
          say("pointerdown", 50); say("pointermove", 100); say("pointerup", 100);
          return state.eye[0];
        }"""
    )
    assert moved < 0.0


def test_the_address_says_what_is_seen(opened, field):
    page = opened(field, "#focus=2.5&aperture=0.3&from=10,-5&ev=1.5&shape=round")
    shown = page.evaluate("document.body.dataset.shown")
    assert shown == "focus=2.5&aperture=0.3&from=10,-5&ev=1.5&shape=round"
    page.locator("#picture").press("Home")
    page.wait_for_url("**#focus=2.5&aperture=0.3&from=0,0&ev=1.5&shape=round")
    page.goto(page.url.split("#")[0] + "#focus=-1&aperture=x&zoom=2&ev=2")
    page.wait_for_function("() => addressOf() === 'focus=2.5&aperture=0.3&from=0,0&ev=2&shape=round'")


@pytest.mark.parametrize(("size", "scheme"), [((360, 640), "dark"), ((900, 600), "light")])
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


def test_a_context_that_is_lost_comes_back(opened, field):
    page = opened(field, f"#focus={NEAR}")
    before = seen(page)
    page.evaluate(
        """() => new Promise((done) => {
          const loss = painter.gl.getExtension("WEBGL_lose_context");
          delete document.body.dataset.views;
          canvas.addEventListener("webglcontextlost", () => setTimeout(() => { loss.restoreContext(); done(); }, 50));
          loss.loseContext();
        })"""
    )
    page.locator("body[data-views]").wait_for()
    np.testing.assert_array_equal(seen(page), before)


def test_names_are_text(opened, field):
    page = opened(field, settings={"title": "<b>a</b> & </script>"})
    assert page.locator("h1").inner_text() == "<b>a</b> & </script>"
    assert page.locator("b").count() == 0


def part(field, rows, columns):
    index = (rows, columns)
    return LightField(
        field.radiance[index],
        dataclasses.replace(field.views, position=field.views.position[index]),
        {name: layer[index] for name, layer in field.layers.items()},
    )


def test_one_row(opened, field):
    row = part(field, slice(3, 4), slice(None))
    page = opened(row, f"#focus={FAR}")
    assert off(page, row, FAR).max() <= 2.0
    assert "left and right" in page.locator("#help").inner_text()
    assert not page.locator("#shape").is_visible()
    page.evaluate("choose({ eye: [0.01, 0.01], opening: 0 })")
    assert page.evaluate("state.eye") == [0.01, 0.0]
    assert clicked(page, MIDDLE) == pytest.approx(MIDDLE, rel=0.01)


def test_one_view(opened, field):
    page = opened(part(field, slice(3, 4), slice(3, 4)))
    np.testing.assert_allclose(seen(page), srgb.to_uint8(field.view(3, 3)), atol=1.0)
    assert "one view" in page.locator("#notes").inner_text()
    assert page.get_by_role("slider").count() == 1
    page.mouse.click(*place(page, AT[NEAR]))


def test_distances_are_found_where_none_are_given(opened, field):
    page = opened(dataclasses.replace(part(field, slice(1, 6), slice(1, 6)), layers={}), f"#focus={FAR}")
    before = sharpness(seen(page), AT[MIDDLE])
    assert clicked(page, MIDDLE) == pytest.approx(MIDDLE, rel=0.05)
    assert sharpness(seen(page), AT[MIDDLE]) > 1.3 * before


def test_without_metres_it_tells_slopes(opened, field):
    """Places in steps of one view, slopes in pixels a view: what a folder of pictures has."""
    geometry = Views(
        field.views.position[1:6, 1:6] / SPACING, Plane(1.0, -0.5 * WIDTH, 0.5 * HEIGHT), width=WIDTH, height=HEIGHT
    )
    unknown = LightField(field.radiance[1:6, 1:6], geometry, settings={"units": "views"})
    page = opened(unknown, "#aperture=0.6")
    slope = SPACING * (1.0 / NEAR - field.views.inverse_focus) / field.views.plane.pixel
    assert clicked(page, NEAR) == pytest.approx(slope, abs=0.1)
    assert page.locator("#focus output").inner_text().startswith("slope ")
    assert " m" not in page.locator("#camera").inner_text().replace(" middle", "").replace("mm", "")


def test_rays_are_gathered_into_views(opened, field):
    """A photograph of which only the rays were kept is focused anew."""
    random = np.random.default_rng(1)
    count = 200_000
    row, column = random.integers(0, 7, (2, count))
    u = field.views.position[row, column]
    i, j = random.integers(0, WIDTH, count), random.integers(0, HEIGHT, count)
    plane = field.views.plane
    x, y = plane.left + (i + 0.5) * plane.pixel, plane.top - (j + 0.5) * plane.pixel
    rays = Rays(np.column_stack([u, x, y]), field.radiance[row, column, j, i], np.ones(count))
    lens = dataclasses.replace(field.views, position=np.zeros((1, 1, 2)), aperture=10.0 * SPACING)
    photograph = LightField(np.asarray(field.radiance).mean(axis=(0, 1))[None, None], lens, rays=rays)
    page = opened(photograph, f"#focus={NEAR}")
    assert "200,000 rays are gathered into 3 x 3 views" in page.locator("#notes").inner_text()
    near = seen(page)
    page.evaluate(f"choose({{ w: {1.0 / FAR} }})")
    assert sharpness(near, AT[NEAR]) > 1.3 * sharpness(seen(page), AT[NEAR])


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


def test_an_address_just_set_is_not_overwritten(opened, field):
    """The page writes its state a moment later: an address set meanwhile stays, although it has not been read yet."""
    page = opened(field, "#focus=2.5")
    said = page.evaluate("""() => {
      const later = window.setTimeout;
      let write;
      window.setTimeout = (callback) => { write = callback; };
      writeAddress();
      window.setTimeout = later;
      location.hash = "#ev=1";
      write();
      return location.hash;
    }""")
    assert said == "#ev=1"
    page.wait_for_function("() => document.body.dataset.shown.includes('ev=1')")


def test_light_beyond_white_stays_light(opened, field):
    """A highlight is spread by blur as light is, not as what a display can show of it."""
    radiance = np.array(field.radiance)
    radiance[:, :, 20:23, 70:73] = 40.0
    bright = dataclasses.replace(field, radiance=radiance)
    page = opened(bright, f"#focus={NEAR}")
    error = off(page, bright, NEAR)
    assert off(page, dataclasses.replace(bright, radiance=np.clip(radiance, 0, 1)), NEAR).max() > 60.0
    # The upper fifth of the codes holds 5.3 octaves: half a code is 3.7 % of light, 5 of 255 where it is near white.
    assert error.max() <= 6.0
    assert np.median(error) <= 1.0


def test_not_a_number_is_black(opened, field):
    radiance = np.array(field.radiance)
    radiance[:, :, 10:14, 10:14] = np.nan
    page = opened(dataclasses.replace(field, radiance=radiance), "#focus=2&aperture=0")
    assert seen(page)[11:13, 11:13].max() == 0.0


def test_views_at_any_places(opened, field):
    """Places that are not those of a grid: each view is shifted by its own."""
    moved = field.views.position + np.random.default_rng(5).uniform(-0.3, 0.3, (7, 7, 2)) * SPACING
    uneven = dataclasses.replace(field, views=dataclasses.replace(field.views, position=moved))
    page = opened(uneven, f"#focus={MIDDLE}")
    assert off(page, uneven, MIDDLE).max() <= 3.0


def noisy(rows, columns, width, height):
    """Views that no codec makes much smaller: noise of a tenth around a ramp."""
    random = np.random.default_rng(7)
    ramp = np.linspace(0.2, 0.8, width)[None, :, None]
    radiance = np.empty((rows, columns, height, width, 3), dtype=np.float32)
    for index in np.ndindex(rows, columns):
        radiance[index] = ramp + 0.1 * random.standard_normal((height, width, 3), dtype=np.float32)
    depth = np.full(radiance.shape[:4], 2.5)
    return LightField(np.clip(radiance, 0.0, 1.0), views(rows, columns, width=width, height=height), {"depth": depth})


def test_of_many_views_every_second_is_left_out(tmp_path):
    made = page_of(noisy(17, 17, 48, 36), size=1_000_000)
    assert len(made.html) <= 1_000_000
    path = tmp_path / "page.html"
    path.write_bytes(made.html)
    found = data_in(path)
    assert "9 x 9 of its 17 x 17 views" in made.notes[0]
    assert len(found["views"]) == 81
    assert found["notes"] == list(made.notes)
    # The ends and the middle are still there.
    assert [found["views"][number]["at"] for number in (0, 40, 80)] == [
        pytest.approx(place) for place in ([-0.08, 0.08], [0.0, 0.0], [0.08, -0.08])
    ]
    assert found["spacing"] == pytest.approx([0.02, 0.02])


def test_few_large_views_become_smaller():
    made = page_of(noisy(3, 3, 320, 240), size=1_000_000)
    assert len(made.html) <= 1_000_000
    assert re.search(r"views of \d+ x \d+ pixels in place of 320 x 240", made.notes[0])


def test_what_fits_is_held_without_losses(field, tmp_path):
    path = tmp_path / "page.html"
    assert write_page(path, field) == ()
    np.testing.assert_array_equal(decoded(data_in(path)["views"][9]["picture"]), srgb.to_uint8(field.view(1, 2)))


@pytest.mark.slow
def test_a_page_of_81_views_is_under_40_megabytes():
    made = page_of(noisy(9, 9, 512, 384))
    assert len(made.html) < 40e6
    assert not any("views of" in note or "of its" in note for note in made.notes)


def test_on_the_command_line(field, tmp_path, capsys):
    lf.write(tmp_path / "cards.lf", field)
    assert run("view", tmp_path / "cards.lf", "-o", tmp_path / "cards.html") == 0
    assert "wrote" in capsys.readouterr().err
    assert (tmp_path / "cards.html").read_bytes().startswith(b"<!doctype html>")
