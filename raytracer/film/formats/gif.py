"""GIF files (.gif) of animations: 256 colours, the same in all frames, and steps of 1/100 s."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.base.image_format import ImageFormat
from raytracer.film.formats.base.pillow import encode_animation

if TYPE_CHECKING:
    import PIL.Image

TICK_MS, MIN_TICKS = 10, 2
"""Frames last whole hundredths of a second, and browsers slow down those of fewer than two."""

_COLORS = 256

# Pixels of all frames together from which the colours are chosen.
_PALETTE_SAMPLES = 1_000_000


def encode_gif(frames: Sequence[NDArray[np.uint8]], duration: int, boomerang: bool) -> bytes:
    """Encode an animation; see `ImageFormat`."""
    pictures = _quantize(frames)
    ticks = max(MIN_TICKS, round(duration / TICK_MS))
    palette = bytes(pictures[0].getpalette() or ())
    return encode_animation(pictures, ticks * TICK_MS, boomerang, "GIF", optimize=False, disposal=1, palette=palette)


def _quantize(frames: Sequence[NDArray[np.uint8]]) -> list["PIL.Image.Image"]:
    """Quantize frames to 256 colours, chosen from all of them, so that colours do not change from frame to frame."""
    import PIL.Image

    # The colours are chosen from every n-th pixel of all frames.
    height, width, _ = frames[0].shape
    step = max(1, math.isqrt(len(frames) * width * height // _PALETTE_SAMPLES))
    colors = np.concatenate([frame[::step, ::step].reshape(-1, 3) for frame in frames])
    with PIL.Image.fromarray(colors[None]) as sample:
        palette = sample.quantize(_COLORS, PIL.Image.Quantize.MEDIANCUT)
    dither = PIL.Image.Dither.FLOYDSTEINBERG
    return [PIL.Image.fromarray(frame).quantize(palette=palette, dither=dither) for frame in frames]


# Before WebP, which messages name after it.
FORMAT = ImageFormat((".gif",), is_linear=False, is_lossy=True, encode_frames=encode_gif, order=55)
