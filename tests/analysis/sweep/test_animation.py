"""The animation of a sweep: its frames are the sweep's pictures, one step after the other."""

import io
import math
from itertools import pairwise, product

import numpy as np
import PIL.Image
import PIL.ImageSequence
import pytest

from raytracer.analysis.sweep.animation import encode_animation, gray_code_indices
from raytracer.analysis.sweep.results import Axis
from raytracer.util.errors import InputError
from tests.analysis.sweep.made_up import F_NUMBER, FOCUS, HEIGHT, WIDTH, images, made_up, picture


def frames(data):
    with PIL.Image.open(io.BytesIO(data)) as file:
        return [np.asarray(frame.convert("RGB"))[:HEIGHT] for frame in PIL.ImageSequence.Iterator(file)]


@pytest.mark.parametrize("shape", [(), (1,), (4, 3), (2, 1, 3, 2)])
def test_the_path_goes_to_all_in_steps_of_one(shape):
    path = list(gray_code_indices(shape))
    assert sorted(path) == list(product(*map(range, shape)))
    assert all(sum(abs(x - y) for x, y in zip(a, b, strict=True)) == 1 for a, b in pairwise(path))


def test_a_png_holds_every_pixel_there_and_back():
    sweep = made_up(None, failed=((1, 1),))
    points = {taken.point.index: taken for taken in sweep.results}
    # The path, worked out by hand for 4 x 3 points, without the one that failed.
    order = [(0, 0), (0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1), (2, 2), (3, 2), (3, 1), (3, 0)]
    there = [picture(points[index].point) for index in order]
    np.testing.assert_array_equal(frames(encode_animation(sweep, images, "png")), there + there[-2:0:-1])


def tables_of_colors(data):
    """Tell if the file has a table of colours for all frames, and each frame, but the first, one of its own.

    By the blocks of a GIF89a: a screen of 13 bytes, whose flags say if a table follows; extensions (21h) and images
    (2Ch), each with blocks of up to 255 bytes to its end.
    """
    size = lambda flags: 3 * 2 ** ((flags & 7) + 1) if flags & 0x80 else 0  # noqa: E731
    tables, at = [bool(data[10] & 0x80)], 13 + size(data[10])
    while data[at] != 0x3B:
        if data[at] == 0x21:
            at += 2
        else:
            tables.append(bool(data[at + 9] & 0x80))
            at += 10 + size(data[at + 9]) + 1
        while data[at]:
            at += data[at] + 1
        at += 1
    return tables[:1] + tables[2:]


def test_a_gif_has_one_palette_that_serves_all_frames():
    """Each picture is of one colour, which a palette of the first frame alone would not hold."""
    axis = Axis("camera.iso", tuple(range(6)), tuple("012345"))
    colors = [(250, 10, 10), (10, 250, 10), (10, 10, 250), (250, 250, 10), (10, 250, 250), (120, 60, 200)]
    data = encode_animation(
        made_up(None, (axis,)),
        lambda taken: np.full((HEIGHT, WIDTH, 3), colors[taken.point.index[0]], dtype=np.uint8),
        "gif",
    )
    for frame, color in zip(frames(data), colors + colors[-2:0:-1], strict=True):
        np.testing.assert_allclose(frame.mean(axis=(0, 1)), color, atol=4)
    assert tables_of_colors(data) == [True] + [False] * 9


@pytest.mark.parametrize("kind", ["gif", "webp", "png"])
@pytest.mark.parametrize(("fps", "expected"), [(5.0, 200), (12.5, 80), (50.0, 20), (0.5, 2000)])
def test_frames_last_as_long_as_asked_for(kind, fps, expected):
    data = encode_animation(made_up(None, (F_NUMBER,)), images, kind, fps=fps)
    found = []
    with PIL.Image.open(io.BytesIO(data)) as file:
        assert file.info["loop"] == 0
        for frame in PIL.ImageSequence.Iterator(file):
            frame.load()
            found.append(frame.info["duration"])
    assert found == [expected] * 6


def test_frames_are_bounded_and_of_one_size():
    """The first picture's size is that of all; what is beside a narrower one is paper."""
    sizes = {1.4: (1500, 3000), 2.0: (300, 300), 2.8: (1500, 3000), 4.0: (1500, 3000)}
    data = encode_animation(
        made_up(None, (F_NUMBER,), failed=((2,), (3,))),
        lambda taken: (
            np.full((*sizes[taken.point.values["camera.f_number"]], 3), 9, dtype=np.uint8)
            if taken.status == "done"
            else None
        ),
        "png",
    )
    with PIL.Image.open(io.BytesIO(data)) as file:
        first, second = (np.asarray(frame.convert("RGB")) for frame in PIL.ImageSequence.Iterator(file))
    assert first.shape == second.shape == (480 + 40, 960, 3)
    assert np.all(first[:480] == 9)
    dark = np.all(second[:480] == 9, axis=-1)
    np.testing.assert_array_equal(np.flatnonzero(dark.any(axis=0)), np.arange(240, 720))
    assert np.all(second[:480, :240] == 255)


@pytest.mark.parametrize(("kind", "fps"), [("avi", 5.0), ("gif", 0.0), ("gif", 51.0), ("gif", math.nan), ("gif", -1.0)])
def test_what_cannot_be_is_refused(kind, fps):
    with pytest.raises(InputError, match=r"--(animate|fps) \S+: must be"):
        encode_animation(made_up(None), images, kind, fps=fps)


def test_a_webp_is_near_its_pictures():
    sweep = made_up(None, (FOCUS,))
    smooth = np.linspace(0, 255, WIDTH * HEIGHT * 3).reshape(HEIGHT, WIDTH, 3).astype(np.uint8)
    got = frames(encode_animation(sweep, lambda taken: np.roll(smooth, 8 * taken.point.index[0], axis=0), "webp"))
    for frame, number in zip(got, (0, 1, 2, 1), strict=True):
        assert np.abs(frame.astype(int) - np.roll(smooth, 8 * number, axis=0)).mean() < 8


def test_many_frames_are_smaller(monkeypatch):
    monkeypatch.setattr("raytracer.analysis.sweep.animation._MOST_PIXELS", 4 * WIDTH * HEIGHT / 4)
    with PIL.Image.open(io.BytesIO(encode_animation(made_up(None, (F_NUMBER,)), images, "webp"))) as file:
        assert (file.width, file.height) == (WIDTH // 2, HEIGHT // 2 + 20)


def test_a_caption_says_the_values():
    """Where values differ, so do the words below the pictures; they are dark on white."""
    data = encode_animation(made_up(None, (F_NUMBER,)), images, "png")
    with PIL.Image.open(io.BytesIO(data)) as file:
        words = [np.asarray(frame.convert("L"))[HEIGHT:] for frame in PIL.ImageSequence.Iterator(file)]
    assert all((word < 100).any() and word.max() == 255 for word in words)
    assert not any(np.array_equal(a, b) for a, b in pairwise(words))


def test_nothing_moves_without_a_picture():
    with pytest.raises(InputError, match="needs a picture"):
        encode_animation(made_up(None, (F_NUMBER,), failed=((0,), (1,), (2,), (3,))), images, "gif")
