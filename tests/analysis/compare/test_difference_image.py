"""Pictures of a difference: pixels are where the images have theirs, and colours mean what the legend says."""

import base64
import io
import json
import re

import numpy as np
import PIL.Image
import pytest

from raytracer.analysis import compare as comparison
from raytracer.analysis.compare import compare, encode, show
from raytracer.analysis.compare.difference_image import WipePage, pack_halves
from raytracer.film.image import Image
from raytracer.report.colour_maps import false_colour, false_colours, signed, signed_colours
from raytracer.util import srgb
from raytracer.util.errors import InputError

HEIGHT, WIDTH = 20, 30
PICTURES = [kind for kind in comparison.KINDS if kind not in ("side-by-side", "wipe")]


@pytest.fixture(scope="module")
def pair():
    """A ramp of differences from -0.1 to 0.2, in one channel after the other, with noise that is known."""
    b = np.random.default_rng(1).uniform(0.2, 0.6, (HEIGHT, WIDTH, 3))
    a = b.copy()
    a[np.arange(HEIGHT)[:, None], np.arange(WIDTH), np.arange(WIDTH) % 3] += np.linspace(-0.1, 0.2, WIDTH)
    variance = np.full(a.shape, 1e-4)
    return compare(Image(a, variance, 64), Image(b, variance, 64), names=("after", "before"))


def pixels_of(data):
    return np.asarray(PIL.Image.open(io.BytesIO(data)).convert("RGB"))


def luminance(colours):
    return srgb.decode(colours / 255) @ [0.2126, 0.7152, 0.0722]


def test_colours_grow_brighter_all_the_way_and_signed_ones_darker_from_white_to_either_side():
    found = luminance(false_colours())
    assert (np.diff(found) > -1e-3).all()
    assert (found[0], found[-1]) == (0.0, pytest.approx(1.0))
    found = signed_colours()
    assert tuple(found[127]) == (255, 255, 255)
    light = luminance(found)
    assert (np.diff(light[:128]) > 0).all()
    assert (np.diff(light[127:]) < 0).all()
    assert len({tuple(colour) for colour in found.tolist()}) == 255
    # Blue below and red above.
    assert (found[:120, 2] > found[:120, 0]).all()
    assert (found[135:, 0] > found[135:, 2]).all()


def test_values_become_the_colours_of_their_places_on_the_scale():
    values = np.array([[-9.0, -2.0, 0.0, 1.0, 2.0, np.inf, -np.inf, np.nan]])
    colours = signed_colours()
    expected = [colours[i] for i in (0, 0, 127, 190, 254, 254, 0)] + [(0, 0, 0)]
    np.testing.assert_array_equal(signed(values, 2.0)[0], expected)
    colours = false_colours()
    expected = [colours[i] for i in (0, 0, 0, 128, 255, 255, 0)] + [(255, 0, 0)]
    np.testing.assert_array_equal(false_colour(values, 2.0)[0], expected)
    assert not any((colours == (255, 0, 0)).all(axis=1))
    with np.errstate(all="raise"):
        for scale in (0.0, 5e-324):
            assert (signed(np.zeros((2, 2)), scale) == 255).all()
            assert (false_colour(np.zeros((2, 2)), scale) == 0).all()


def assert_alike(found, expected):
    np.testing.assert_allclose(found.astype(int), expected.astype(int), atol=6)


def test_each_kind_shows_what_it_says(pair):
    a, b = (picture.values for picture in pair.pictures)
    ramp = np.broadcast_to(np.linspace(-0.1, 0.2, WIDTH), (HEIGHT, WIDTH))
    found = show(pair, "signed")
    assert_alike(found.pixels, signed(ramp, found.scale))
    assert found.scale == pytest.approx(0.2, rel=0.05)
    found = show(pair, "absolute")
    assert_alike(found.pixels, false_colour(np.abs(ramp), found.scale))
    found = show(pair, "relative")
    relative = np.sqrt(np.mean((a - b) ** 2 / (b**2 + 0.01), axis=2))
    assert_alike(found.pixels, false_colour(relative, found.scale))
    found = show(pair, "flip")
    assert_alike(found.pixels, false_colour(comparison.flip_map(a, b, "linear"), 1.0))
    # Of 14 standard deviations, which is what the ends of the ramp differ by, five are told apart.
    found = show(pair, "z")
    assert_alike(found.pixels, signed(ramp / np.sqrt(2e-4), 5.0))


@pytest.mark.parametrize("kind", PICTURES)
def test_the_pixels_of_a_picture_are_where_the_images_have_theirs(kind, pair):
    found = pixels_of(encode(pair, kind))
    np.testing.assert_array_equal(found[:HEIGHT, :WIDTH], show(pair, kind).pixels)
    # The legend below: all the colours, and texts.
    legend = found[HEIGHT:]
    assert len(np.unique(legend.reshape(-1, 3), axis=0)) > 100
    assert found.shape[1] >= 240


def test_images_beside_each_other_are_as_a_display_shows_them(pair):
    found = pixels_of(encode(pair, "side-by-side"))
    heading = found.shape[0] - HEIGHT - (pixels_of(encode(pair, "signed")).shape[0] - HEIGHT)
    for number, picture in enumerate(pair.pictures):
        left = number * (WIDTH + 8)
        np.testing.assert_array_equal(
            found[heading : heading + HEIGHT, left : left + WIDTH], srgb.to_uint8(picture.values)
        )
    left = 2 * (WIDTH + 8)
    shown = show(pair, "absolute").pixels
    np.testing.assert_array_equal(found[heading : heading + HEIGHT, left : left + WIDTH], shown)


def test_equal_images_show_nothing_and_pixels_that_are_not_finite_show():
    a, b = np.full((12, 12, 3), 0.4), np.full((12, 12, 3), 0.3)
    for kind in ("signed", "absolute", "relative", "flip"):
        assert (show(compare(a, a), kind).pixels == (255 if kind == "signed" else 0)).all()
    a[3, 4, 1] = np.nan
    found = compare(a, b)
    assert tuple(show(found, "signed").pixels[3, 4]) == (0, 0, 0)
    assert tuple(show(found, "absolute").pixels[3, 4]) == (255, 0, 0)
    assert (show(found, "flip").pixels != 255).any()


def test_what_cannot_be_shown_is_said(pair):
    with pytest.raises(InputError, match="unknown kind of picture 'sgined': did you mean 'signed'"):
        encode(pair, "sgined")
    a = np.full((12, 12, 3), 0.4)
    with pytest.raises(InputError, match="no z-test: A has no variance"):
        encode(compare(Image(a), Image(a)), "z")


# ---- the page ----


def seen(page, side):
    address = page.eval_on_selector(f"canvas.wipe-{side}", "canvas => canvas.toDataURL()")
    return pixels_of(base64.b64decode(address.partition(",")[2])).astype(int)


def choose(page, **chosen):
    for name, value in chosen.items():
        if name in ("left", "right"):
            page.select_option(f"#{name}", value)
        else:
            page.evaluate(
                "([id, value]) => { const slider = document.getElementById(id); slider.value = value;"
                " slider.dispatchEvent(new Event('input')); }",
                [name, value],
            )
    state = page.evaluate(
        "['left', 'right', 'exposure', 'gain'].map((id) => document.getElementById(id).value).join(' ')"
    )
    page.wait_for_function("state => document.body.dataset.shown === state", arg=state)


def test_the_page_shows_both_images_their_difference_and_the_metrics(pair, tmp_path, open_page):
    (tmp_path / "a.html").write_bytes(encode(pair, "wipe"))
    page = open_page(tmp_path / "a.html")
    choose(page)
    a, b = (picture.values for picture in pair.pictures)
    # 7 bits of mantissa are 0.4 % at most, which is one step of what is shown.
    for exposure in (0, 1.5, -2):
        choose(page, exposure=exposure)
        assert np.abs(seen(page, "left") - srgb.to_uint8(a * 2**exposure)).max() <= 1
        assert np.abs(seen(page, "right") - srgb.to_uint8(b * 2**exposure)).max() <= 1

    # A difference of 0.2, of values that are sent to 0.002, on a scale of 255 colours.
    def close(found, expected):
        return np.mean(np.abs(found - expected.astype(int)) <= 12)

    choose(page, left="signed", right="size")
    assert close(seen(page, "left"), show(pair, "signed").pixels) > 0.98
    assert close(seen(page, "right"), show(pair, "absolute").pixels) > 0.98
    choose(page, right="relative")
    assert close(seen(page, "right"), show(pair, "relative").pixels) > 0.98
    fine = seen(page, "left")
    choose(page, gain=-2)
    np.testing.assert_array_less(np.abs(255 - seen(page, "left")).sum(), np.abs(255 - fine).sum())
    choose(page, left="flip", right="z")
    np.testing.assert_array_equal(seen(page, "left"), show(pair, "flip").pixels)
    np.testing.assert_array_equal(seen(page, "right"), show(pair, "z").pixels)

    for name, value in pair.metrics.items():
        text = page.inner_text(f"[data-metric={name}]")
        assert float(text.replace(" dB", "").replace(",", "")) == pytest.approx(value, rel=1e-5)
    assert pair.failures[0] in page.inner_text("#verdict")
    page.keyboard.press("x")
    page.wait_for_function("() => document.body.dataset.shown.startsWith('z flip')")


def test_a_page_of_many_pairs_turns_to_each(tmp_path, open_page):
    views = WipePage()
    for level in (50, 150):
        found = compare(np.full((16, 20, 3), level, np.uint8), np.full((16, 20, 3), 10, np.uint8))
        views.add(found, f"<b>{level}</b>")
    (tmp_path / "a.html").write_bytes(views.page("two"))
    page = open_page(tmp_path / "a.html")
    choose(page)
    assert seen(page, "left")[3, 3].tolist() == [50, 50, 50]
    assert page.is_disabled("#previous")
    assert page.is_hidden("#exposures")
    page.click("#next")
    page.wait_for_function("() => find('[data-metric=mae]').textContent.startsWith('0.549')")
    page.wait_for_timeout(100)
    assert seen(page, "left")[3, 3].tolist() == [150, 150, 150]
    assert page.locator("#pair option").all_inner_texts() == ["<b>50</b>", "<b>150</b>"]


def test_large_images_are_sent_as_a_display_shows_them(monkeypatch, pair):
    monkeypatch.setattr("raytracer.analysis.compare.difference_image._LARGEST_LINEAR", HEIGHT * WIDTH - 1)
    text = encode(pair, "wipe").decode()
    data = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])
    (sent,) = data["pairs"]
    assert sent["linear"] is False
    found = pixels_of(base64.b64decode(sent["images"][0].partition(",")[2]))
    np.testing.assert_array_equal(found, srgb.to_uint8(pair.pictures[0].values))
    assert sent["scale"]["absolute"] == pytest.approx(
        np.abs(np.subtract(*(srgb.to_uint8(picture.values) / 255 for picture in pair.pictures))).max()
    )


def test_halves_are_the_values_to_a_part_in_256():
    rng = np.random.default_rng(2)
    values = np.concatenate([rng.lognormal(0, 3, 300), -rng.lognormal(0, 3, 297), [0.0, 65504.0, 1e9]]).reshape(
        20, 10, 3
    )
    found = pack_halves(values).astype(np.uint16)
    read = (found[:20] << 8 | found[20:]).view(np.float16).astype(np.float64)
    np.testing.assert_allclose(read, np.clip(values, -65504, 65504), rtol=2**-8 + 2**-11, atol=2**-17)
    assert np.isfinite(read).all()
    broken = pack_halves(np.full((1, 1, 3), np.nan)).astype(np.uint16)
    assert np.isnan((broken[:1] << 8 | broken[1:]).view(np.float16)).all()
