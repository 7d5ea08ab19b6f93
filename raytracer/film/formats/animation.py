"""Pictures one after the other, as a GIF, a WebP or an animated PNG that runs for ever."""

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError

if TYPE_CHECKING:
    import PIL.Image

Kind = Literal["gif", "webp", "png"]
KINDS: tuple[Kind, ...] = ("gif", "webp", "png")

# A GIF's frames last whole hundredths of a second, and browsers slow down those of fewer than two.
_TICK_MS, _FEWEST_TICKS = 10, 2
_SLOWEST = 600_000

MOST_FPS = 1000.0 / (_TICK_MS * _FEWEST_TICKS)
"""Frames a second, at most."""

_WEBP_QUALITY = 90
_COLORS = 256

# Pixels of all frames together from which a GIF's colours are chosen.
_LOOKED_AT = 1_000_000


def check(kind: str, fps: float, *, kind_option: str = "--animate", fps_option: str = "--fps") -> None:
    """Make sure, before anything is rendered, that there is such an animation.

    Raises
    ------
    InputError : `fps` is not in 0..50, or `kind` is none of those that there are.
    """
    if kind not in KINDS:
        raise InputError(f"{kind_option} {kind}: must be one of {', '.join(KINDS)}")
    if not 0.0 < fps <= MOST_FPS:
        raise InputError(f"{fps_option} {fps:g}: must be greater than 0 and at most {MOST_FPS:g}")


def encode(frames: Sequence[NDArray[np.uint8]], kind: Kind, *, fps: float = 5.0, boomerang: bool = False) -> bytes:
    """The animation of frames (height, width, 3), all of one size, in sRGB.

    A GIF has 256 colours, the same in all frames, and steps of 1/100 s; a WebP's quality is 90; a PNG has all pixels as
    they are.

    Parameters
    ----------
    fps : frames a second, at most 50.
    boomerang : go back from the last frame to the first, rather than start anew.

    Raises
    ------
    InputError : as `check`, or there is no frame.
    """
    import PIL.Image

    check(kind, fps)
    if not frames:
        raise InputError("an animation needs a picture, and there is none")
    pictures = [PIL.Image.fromarray(frame) for frame in frames]
    if kind == "gif":
        pictures = _in_one_palette(pictures)
    if boomerang:
        pictures += pictures[-2:0:-1]

    duration = min(_SLOWEST, round(1000.0 / fps))
    if kind == "gif":
        duration = max(_FEWEST_TICKS, round(duration / _TICK_MS)) * _TICK_MS
    settings: dict[str, Any] = {
        "gif": {"optimize": False, "disposal": 1},
        "webp": {"quality": _WEBP_QUALITY, "method": 4},
        "png": {"disposal": 0, "blend": 0},
    }[kind]
    if kind == "gif":
        settings["palette"] = bytes(pictures[0].getpalette() or ())
    buffer = io.BytesIO()
    pictures[0].save(buffer, kind, save_all=True, append_images=pictures[1:], duration=duration, loop=0, **settings)
    return buffer.getvalue()


def _in_one_palette(frames: Sequence["PIL.Image.Image"]) -> list["PIL.Image.Image"]:
    """The frames in 256 colours, which are those of all of them, so that none changes its look for the others'."""
    import PIL.Image

    # Every n-th pixel of all frames is a picture of its own, from which the colours are chosen.
    step = max(1, math.isqrt(len(frames) * frames[0].width * frames[0].height // _LOOKED_AT))
    seen = np.concatenate([np.asarray(frame)[::step, ::step].reshape(-1, 3) for frame in frames])
    with PIL.Image.fromarray(seen[None]) as sample:
        palette = sample.quantize(_COLORS, PIL.Image.Quantize.MEDIANCUT)
    return [frame.quantize(palette=palette, dither=PIL.Image.Dither.FLOYDSTEINBERG) for frame in frames]
