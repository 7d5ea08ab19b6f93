"""Animations: several pictures in one GIF, WebP or animated PNG file, repeated without end."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raytracer.film.formats.gif import MIN_TICKS, TICK_MS
from raytracer.film.formats.registry import animation_suffixes, image_formats
from raytracer.util.errors import InputError

_MAX_DURATION_MS = 600_000

MAX_FPS = 1000.0 / (TICK_MS * MIN_TICKS)
"""Frames a second, at most."""


def check(kind: str, fps: float) -> None:
    """Raise an InputError if there are no animations of a suffix (without its dot), or `fps` is not in 0..50."""
    if f".{kind}" not in animation_suffixes():
        known = ", ".join(suffix.removeprefix(".") for suffix in animation_suffixes())
        raise InputError(f"--animate {kind}: must be one of {known}")
    if not 0.0 < fps <= MAX_FPS:
        raise InputError(f"--fps {fps:g}: must be greater than 0 and at most {MAX_FPS:g}")


def encode(frames: Sequence[NDArray[np.uint8]], kind: str, *, fps: float = 5.0, boomerang: bool = False) -> bytes:
    """Encode frames (height, width, 3), all of one size, in sRGB, as an animation; see the file of its format.

    kind : suffix of the format, without its dot.
    fps : frames a second, at most 50.
    boomerang : whether to go back from the last frame to the first, rather than to start again.

    Raises InputError: as `check`, or there is no frame.
    """
    check(kind, fps)
    if not frames:
        raise InputError("an animation needs a picture, and there is none")
    encode_frames = image_formats()[f".{kind}"].encode_frames
    assert encode_frames is not None
    return encode_frames(frames, min(_MAX_DURATION_MS, round(1000.0 / fps)), boomerang)
