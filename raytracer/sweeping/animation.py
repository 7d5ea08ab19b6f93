"""A sweep as an animation: one frame for each picture, with its values below it, one after the other.

From frame to frame one value goes one step: where an axis is at its end, the others' next values run through it
backwards.  Zipped axes go step by step together.
"""

import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from raytracer.errors import InputError
from raytracer.film.output import write_bytes
from raytracer.sweeping.points import Sweep
from raytracer.sweeping.sheet import cut, fitted, font
from raytracer.sweeping.sliders import Images, Slider, sliders

if TYPE_CHECKING:
    import PIL.Image

Kind = Literal["gif", "webp", "png"]
KINDS: tuple[Kind, ...] = ("gif", "webp", "png")

STEM = "sweep"
FPS = 5.0

# A frame's greatest width and height, since formats of animations are made for small pictures.
_LARGEST = (960, 720)

# Of all frames together, since they are in memory at once.
_MOST_PIXELS = 100e6

# A GIF's frames last whole hundredths of a second, and browsers slow down those of fewer than two.
_TICK_MS, _FEWEST_TICKS = 10, 2
_MOST_FPS = 1000.0 / (_TICK_MS * _FEWEST_TICKS)
_SLOWEST = 600_000

_WEBP_QUALITY = 90
_COLORS = 256

# Pixels of all frames together from which a GIF's colours are chosen.
_LOOKED_AT = 1_000_000

_PAPER, _INK = (255, 255, 255), (27, 29, 33)


def check(kind: str, fps: float) -> None:
    """Make sure, before anything is rendered, that there is such an animation.

    Raises
    ------
    InputError : `fps` is not in 0..50, or `kind` is none of those that there are.
    """
    if kind not in KINDS:
        raise InputError(f"--animate {kind}: must be one of {', '.join(KINDS)}")
    if not 0.0 < fps <= _MOST_FPS:
        raise InputError(f"--fps {fps:g}: must be greater than 0 and at most {_MOST_FPS:g}")


def animate(
    sweep: Sweep,
    images: Images,
    kind: Kind,
    *,
    fps: float = FPS,
    boomerang: bool = True,
) -> bytes:
    """The animation as a GIF, a WebP or an animated PNG, which runs for ever.

    Points without a picture are left out.  Frames are at most 960 x 720 without their captions, and 100 million pixels
    together.  A GIF has 256 colours, the same in all frames, and steps of 1/100 s; a WebP's quality is 90; a PNG has
    all pixels as they are.

    Parameters
    ----------
    fps : frames a second, at most 50.
    boomerang : go back from the last frame to the first, rather than start anew.

    Raises
    ------
    InputError : as `check`, or there is no picture.
    """
    check(kind, fps)
    frames = list(_frames(sweep, images))
    if not frames:
        raise InputError("an animation needs a picture, and no point has one")
    if kind == "gif":
        frames = _in_one_palette(frames)
    if boomerang:
        frames += frames[-2:0:-1]

    duration = min(_SLOWEST, round(1000.0 / fps))
    if kind == "gif":
        duration = max(_FEWEST_TICKS, round(duration / _TICK_MS)) * _TICK_MS
    settings: dict[str, Any] = {
        "gif": {"optimize": False, "disposal": 1},
        "webp": {"quality": _WEBP_QUALITY, "method": 4},
        "png": {"disposal": 0, "blend": 0},
    }[kind]
    if kind == "gif":
        settings["palette"] = bytes(frames[0].getpalette() or ())
    buffer = io.BytesIO()
    frames[0].save(buffer, kind, save_all=True, append_images=frames[1:], duration=duration, loop=0, **settings)
    return buffer.getvalue()


def write_animation(
    sweep: Sweep,
    images: Images,
    kind: Kind,
    *,
    fps: float = FPS,
    boomerang: bool = True,
) -> Path:
    """Write the animation into the sweep's folder, as `sweep.gif`, `sweep.webp` or `sweep.png`; see `animate`.

    Returns
    -------
    The file.

    Raises
    ------
    InputError : as `animate`.
    ValueError : the sweep has no folder.
    OutputError : the file cannot be written.
    """
    if sweep.folder is None:
        raise ValueError("a sweep in memory has no folder for an animation")
    path = sweep.folder / f"{STEM}.{kind}"
    write_bytes(path, animate(sweep, images, kind, fps=fps, boomerang=boomerang))
    return path


def path_of_indices(shape: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """All indices, the last axis fastest, such that one number of each differs by one from the one before.

    The reflected code of mixed radix: Knuth 2011, "The Art of Computer Programming", vol. 4A, sec. 7.2.1.1.
    """
    if not shape:
        yield ()
        return
    *others, last = shape
    for number, index in enumerate(path_of_indices(others)):
        there = range(last)
        for end in reversed(there) if number % 2 else there:
            yield (*index, end)


def _frames(sweep: Sweep, images: Images) -> Iterator["PIL.Image.Image"]:
    """All pictures with their captions, each of the first one's size."""
    import PIL.Image

    chosen = sliders(sweep.axes, zipped=sweep.zipped)
    by_index = {taken.point.index[: len(chosen)]: taken for taken in sweep.taken}
    size = None
    for index in path_of_indices([len(slider.labels) for slider in chosen]):
        pixels = images(by_index[index])
        if pixels is None:
            continue
        with PIL.Image.fromarray(pixels) as picture:
            if size is None:
                share = math.sqrt(_MOST_PIXELS / (len(sweep.taken) * picture.width * picture.height))
                scale = min(1.0, share, _LARGEST[0] / picture.width, _LARGEST[1] / picture.height)
                size = max(1, round(scale * picture.width)), max(1, round(scale * picture.height))
            text = min(20, max(10, size[0] // 24))
            caption = _caption(chosen, index, text, size[0])
            yield _captioned(picture, size, caption, text)


def _caption(chosen: Sequence[Slider], index: Sequence[int], size: int, room: float) -> str:
    """The values with their names; where there is no room for both, the values alone."""
    values = [slider.labels[number] for slider, number in zip(chosen, index, strict=True)]
    whole = ", ".join(f"{slider.name} {value}" for slider, value in zip(chosen, values, strict=True))
    return cut(whole if font(size).getlength(whole) <= room else ", ".join(values), size, room)


def _captioned(picture: "PIL.Image.Image", size: tuple[int, int], caption: str, text: int) -> "PIL.Image.Image":
    import PIL.Image
    import PIL.ImageDraw

    frame = PIL.Image.new("RGB", (size[0], size[1] + 2 * text), _PAPER)
    picture = fitted(picture, size)
    frame.paste(picture, ((size[0] - picture.width) // 2, (size[1] - picture.height) // 2))
    place = size[0] / 2, size[1] + text
    PIL.ImageDraw.Draw(frame).text(place, caption, _INK, font(text), anchor="mm")
    return frame


def _in_one_palette(frames: Sequence["PIL.Image.Image"]) -> list["PIL.Image.Image"]:
    """The frames in 256 colours, which are those of all of them, so that none changes its look for the others'."""
    import PIL.Image

    # Every n-th pixel of all frames is a picture of its own, from which the colours are chosen.
    step = max(1, math.isqrt(len(frames) * frames[0].width * frames[0].height // _LOOKED_AT))
    seen = np.concatenate([np.asarray(frame)[::step, ::step].reshape(-1, 3) for frame in frames])
    with PIL.Image.fromarray(seen[None]) as sample:
        palette = sample.quantize(_COLORS, PIL.Image.Quantize.MEDIANCUT)
    return [frame.quantize(palette=palette, dither=PIL.Image.Dither.FLOYDSTEINBERG) for frame in frames]
