"""Animations: several pictures in one GIF, WebP or animated PNG file, repeated without end."""

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import PIL.Image

Kind = Literal["gif", "webp", "png"]
KINDS: tuple[Kind, ...] = ("gif", "webp", "png")

# A GIF's frames last whole hundredths of a second, and browsers slow down those of fewer than two.
_TICK_MS, _MIN_TICKS = 10, 2
_MAX_DURATION_MS = 600_000

MAX_FPS = 1000.0 / (_TICK_MS * _MIN_TICKS)
"""Frames a second, at most."""

_WEBP_QUALITY = 90
_COLORS = 256

# Pixels of all frames together from which a GIF's colours are chosen.
_PALETTE_SAMPLES = 1_000_000


def check(kind: str, fps: float, *, kind_option: str = "--animate", fps_option: str = "--fps") -> None:
    """Check, before anything is rendered, that such an animation can be written.

    Raises
    ------
    InputError : `fps` is not in 0..50, or `kind` is none of `KINDS`.
    """
    if kind not in KINDS:
        raise InputError(f"{kind_option} {kind}: must be one of {', '.join(KINDS)}")
    if not 0.0 < fps <= MAX_FPS:
        raise InputError(f"{fps_option} {fps:g}: must be greater than 0 and at most {MAX_FPS:g}")


def encode(frames: Sequence[NDArray[np.uint8]], kind: Kind, *, fps: float = 5.0, boomerang: bool = False) -> bytes:
    """Encode frames (height, width, 3), all of one size, in sRGB, as an animation.

    A GIF has 256 colours, the same in all frames, and steps of 1/100 s; a WebP's quality is 90; a PNG has all pixels as
    they are.

    Parameters
    ----------
    fps : frames a second, at most 50.
    boomerang : whether to go back from the last frame to the first, rather than to start again.

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
        pictures = _quantize(pictures)
    if boomerang:
        pictures += pictures[-2:0:-1]

    duration = min(_MAX_DURATION_MS, round(1000.0 / fps))
    if kind == "gif":
        duration = max(_MIN_TICKS, round(duration / _TICK_MS)) * _TICK_MS
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


def _quantize(frames: Sequence["PIL.Image.Image"]) -> list["PIL.Image.Image"]:
    """Quantize frames to 256 colours, chosen from all of them, so that colours do not change from frame to frame."""
    import PIL.Image

    # The colours are chosen from every n-th pixel of all frames.
    step = max(1, math.isqrt(len(frames) * frames[0].width * frames[0].height // _PALETTE_SAMPLES))
    colors = np.concatenate([np.asarray(frame)[::step, ::step].reshape(-1, 3) for frame in frames])
    with PIL.Image.fromarray(colors[None]) as sample:
        palette = sample.quantize(_COLORS, PIL.Image.Quantize.MEDIANCUT)
    return [frame.quantize(palette=palette, dither=PIL.Image.Dither.FLOYDSTEINBERG) for frame in frames]
