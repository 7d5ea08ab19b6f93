"""Animation of a sweep: one frame for each image, with its values below it.

From frame to frame one value changes by one step: at the end of an axis, the next value of another axis follows, and
the first is run through backwards.  Zipped axes change together.
"""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from raytracer.analysis.sweep.contact_sheet import fit_image
from raytracer.analysis.sweep.results import Images, Slider, Sweep
from raytracer.film.animation import check, encode
from raytracer.report.lettering import load_font, truncate_text
from raytracer.report.palette import INK, PAPER
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import PIL.Image

__all__ = ["FPS", "STEM", "check", "encode_animation", "gray_code_indices"]

STEM = "sweep"
FPS = 5.0

# Greatest width and height of a frame, since formats of animations are made for small pictures.
_LARGEST = (960, 720)

# Pixels of all frames together, which are in memory at once.
_MOST_PIXELS = 100e6


def encode_animation(sweep: Sweep, images: Images, kind: str, *, fps: float = FPS) -> bytes:
    """Encode the animation as a GIF, a WebP or an animated PNG, which runs for ever, forwards and back.

    Points without a picture are left out.  Frames are at most 960 x 720 without their captions, and 100 million pixels
    together.  A GIF has 256 colours, the same in all frames, and steps of 1/100 s; a WebP's quality is 90; a PNG has
    all pixels as they are.

    fps : frames a second, at most 50.

    Raises
    ------
    InputError : as `check`, or there is no picture.
    """
    check(kind, fps)
    frames = list(_frames(sweep, images))
    if not frames:
        raise InputError("an animation needs a picture, and no point has one")
    return encode([np.asarray(frame) for frame in frames], kind, fps=fps, boomerang=True)


def gray_code_indices(shape: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Enumerate all indices, the last axis fastest, such that one number differs by one from the index before.

    The reflected Gray code of mixed radix: Knuth 2011, "The Art of Computer Programming", vol. 4A, sec. 7.2.1.1.
    """
    if not shape:
        yield ()
        return
    *others, last = shape
    for number, index in enumerate(gray_code_indices(others)):
        there = range(last)
        for end in reversed(there) if number % 2 else there:
            yield (*index, end)


def _frames(sweep: Sweep, images: Images) -> Iterator["PIL.Image.Image"]:
    """Draw all images with their captions, each of the first one's size."""
    import PIL.Image
    import PIL.ImageDraw

    chosen = sweep.sliders
    by_index = {result.point.index[: len(chosen)]: result for result in sweep.results}
    size = None
    for index in gray_code_indices([len(slider.labels) for slider in chosen]):
        pixels = images(by_index[index])
        if pixels is None:
            continue
        with PIL.Image.fromarray(pixels) as picture:
            if size is None:
                share = math.sqrt(_MOST_PIXELS / (len(sweep.results) * picture.width * picture.height))
                scale = min(1.0, share, _LARGEST[0] / picture.width, _LARGEST[1] / picture.height)
                size = max(1, round(scale * picture.width)), max(1, round(scale * picture.height))
            text = min(20, max(10, size[0] // 24))
            frame = PIL.Image.new("RGB", (size[0], size[1] + 2 * text), PAPER)
            fitting = fit_image(picture, size)
            frame.paste(fitting, ((size[0] - fitting.width) // 2, (size[1] - fitting.height) // 2))
            place, caption = (size[0] / 2, size[1] + text), _caption(chosen, index, text, size[0])
            PIL.ImageDraw.Draw(frame).text(place, caption, INK, load_font(text), anchor="mm")
            yield frame


def _caption(chosen: Sequence[Slider], index: Sequence[int], size: int, width: float) -> str:
    """Write the values with their names; where there is no space for both, the values alone."""
    values = [slider.labels[number] for slider, number in zip(chosen, index, strict=True)]
    whole = ", ".join(f"{slider.name} {value}" for slider, value in zip(chosen, values, strict=True))
    return truncate_text(whole if load_font(size).getlength(whole) <= width else ", ".join(values), size, width)
