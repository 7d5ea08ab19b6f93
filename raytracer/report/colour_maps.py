"""Colour maps: for differences of images, and for depth.

Signed differences are white where there is none, red where the first image is brighter and blue where the second is.
False colours go from black to white by way of colours whose brightness rises all the way, so that they may be printed
in grey.  Depth has viridis, through nine of its colours.

References: Green 2011, "A colour scheme for the display of astronomical intensity images", Bulletin of the Astronomical
    Society of India 39, 289-295 (cubehelix, with the parameters of its equation 2 that it starts with); Smith and
    van der Walt 2015, the colour map viridis.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

# Ends of the scale of signed differences, from blue to red, with even steps in between to white.
_BLUE, _WHITE, _RED = (5, 48, 97), (255, 255, 255), (128, 0, 20)
_MID_BLUE, _MID_RED = (67, 147, 195), (214, 84, 62)

# Default start, rotations and hue of cubehelix; its gamma is 1.
_START, _ROTATIONS, _HUE = 0.5, -1.5, 1.0

_VIRIDIS = (
    (68, 1, 84),
    (71, 44, 122),
    (59, 81, 139),
    (44, 113, 142),
    (33, 144, 141),
    (39, 173, 129),
    (92, 200, 99),
    (170, 220, 50),
    (253, 231, 37),
)
_UNKNOWN_DEPTH = 128

_SMALLEST = float(np.finfo(np.float64).tiny)


def false_colours() -> Pixels:
    """Compute the 256 colours (256, 3) from black to white."""
    shade = np.linspace(0.0, 1.0, 256)
    angle = 2.0 * np.pi * (_START / 3.0 + 1.0 + _ROTATIONS * shade)
    amplitude = _HUE * shade * (1.0 - shade) / 2.0
    mix = np.array([[-0.14861, 1.78277], [-0.29227, -0.90649], [1.97294, 0.0]])
    colours = shade[:, None] + amplitude[:, None] * (np.stack([np.cos(angle), np.sin(angle)], axis=1) @ mix.T)
    pixels: Pixels = np.rint(255.0 * np.clip(colours, 0.0, 1.0)).astype(np.uint8)
    return pixels


def signed_colours() -> Pixels:
    """Compute the 255 colours (255, 3) from blue, least, by white to red, most."""
    stops = np.array([_BLUE, _MID_BLUE, _WHITE, _MID_RED, _RED], dtype=np.float64)
    places = np.linspace(0.0, 1.0, 255)
    channels = [np.interp(places, np.linspace(0.0, 1.0, len(stops)), stops[:, c]) for c in range(3)]
    return np.rint(np.stack(channels, axis=1)).astype(np.uint8)


def signed(difference: NDArray[np.floating], scale: float) -> Pixels:
    """Colour signed differences (height, width) in blue, white and red: uint8 (height, width, 3).

    `scale` and more is the darkest red, -`scale` and less the darkest blue; nan is black.
    """
    colours = signed_colours()
    middle = len(colours) // 2
    return _coloured(difference, colours, (-scale, scale), middle, unknown=(0, 0, 0))


def false_colour(values: NDArray[np.floating], most: float) -> Pixels:
    """Colour values (height, width) of at least 0 in false colours: uint8 (height, width, 3).

    `most` and more is white; nan is red, which no value is.
    """
    return _coloured(values, false_colours(), (0.0, most), 0, unknown=(255, 0, 0))


def _coloured(
    values: NDArray[np.floating],
    colours: Pixels,
    ends: tuple[float, float],
    zero: int,
    *,
    unknown: tuple[int, int, int],
) -> Pixels:
    """Colour values on a scale with these `ends`, of which number `zero` is that of 0."""
    least, most = ends
    steps = len(colours) - 1
    if most - least < _SMALLEST:
        # There is no difference, or one that is too small to scale.
        places = np.full(np.shape(values), zero, dtype=np.uint8)
    else:
        clipped = np.clip(np.nan_to_num(values, posinf=most, neginf=least), least, most)
        places = np.rint((clipped - least) * (steps / (most - least))).astype(np.uint8)
    pixels = colours[places]
    pixels[np.isnan(values)] = unknown
    return pixels


def depth_colours(values: Array, low: float, high: float) -> Pixels:
    """Map values (height, width) to colours, from dark at `low` to bright at `high`: uint8 (height, width, 3), sRGB.

    Values that are not finite are grey.
    """
    width = high - low if high > low else 1.0
    is_known = np.isfinite(values)
    place = np.clip((np.where(is_known, values, low) - low) / width, 0.0, 1.0) * (len(_VIRIDIS) - 1)
    channels = [np.interp(place, np.arange(len(_VIRIDIS)), channel) for channel in zip(*_VIRIDIS, strict=True)]
    return np.where(is_known[..., None], np.rint(np.stack(channels, axis=-1)), _UNKNOWN_DEPTH).astype(np.uint8)
