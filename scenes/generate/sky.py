"""Write ``scenes/generated/evening.hdr``: all directions round a place by the sea, an hour before sunset.

A clear sky, clouds of noise on a level sheet, and a sun behind a thin veil, which spreads its light over some degrees;
below the horizon, hills and the sea.  In W/(m2 sr), with the sun at the azimuth 0 (-z), so that `rotation` turns it; a
second run writes the same bytes:

    python scenes/generate/sky.py [OUT.hdr] [--elevation DEG] [--veil FRACTION]

References: Preetham, Shirley, Smits 1999, "A Practical Analytic Model for Daylight", SIGGRAPH '99, appendix A (sky and
sun); Henyey, Greenstein 1941, "Diffuse Radiation in the Galaxy" (clouds).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from raytracer.film.formats import hdr
from raytracer.plugins.environments.sky import linear_rec709, skylight, sunlight

DEFAULT = Path(__file__).parents[1] / "generated" / "evening.hdr"
HEIGHT = 1024

TURBIDITY = 2.8
EFFICACY = 179.0  # lm/W
SUN_RADIUS = np.radians(0.265)
VEIL_SPREAD = np.radians(3.5)
"""Standard deviation of the light that the veil spreads round the sun."""

SHEET, CELLS = 2048, 8.0
"""Samples along an edge of the noise that clouds are made of, and how often it repeats within ten heights of them."""

COVER, SOFTNESS = 0.35, 1.1
"""From how many standard deviations on there is cloud, and within how many more it is dense."""

Floats = NDArray[np.float64]


def directions() -> Floats:
    """Return unit vectors (HEIGHT, 2 HEIGHT, 3) as `environment: {type: image}` reads them."""
    theta = np.pi * (np.arange(HEIGHT) + 0.5)[:, None] / HEIGHT
    phi = np.pi * (np.arange(2 * HEIGHT) + 0.5) / HEIGHT
    parts = (np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi))
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def clear_sky(toward: Floats, ways: Floats) -> Floats:
    """Return radiance without clouds; below the horizon, that of the horizon."""
    level = np.stack([ways[..., 0], np.maximum(ways[..., 1], 0.004), ways[..., 2]], axis=-1)
    level /= np.linalg.norm(level, axis=-1, keepdims=True)
    x, y, luminance = np.moveaxis(skylight(TURBIDITY, tuple(toward), level), -1, 0)
    xyz = np.stack([x / y * luminance, luminance, (1.0 - x - y) / y * luminance], axis=-1)
    return linear_rec709(xyz) * 1000.0 / EFFICACY


def noise(seed: int) -> Floats:
    """Return a periodic field (SHEET, SHEET) whose spectrum falls as that of clouds, of variance 1."""
    white = np.fft.fft2(np.random.default_rng(seed).standard_normal((SHEET, SHEET)))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(SHEET), np.fft.fftfreq(SHEET))) * SHEET
    field = np.fft.ifft2(white * np.where(frequency < 3.0, 0.0, np.maximum(frequency, 1.0) ** -1.75)).real
    return field / field.std()


def clouds(ways: Floats, seed: int) -> Floats:
    """Return optical depths of a level sheet of cloud, which ends before the horizon."""
    up = np.maximum(ways[..., 1], 0.0)
    # A little of the Earth's curvature, or else all clouds would crowd at the horizon.
    reach = SHEET * CELLS / 10.0 / (up + 0.07)
    places = np.stack([0.6 * reach * ways[..., 2], reach * ways[..., 0]])
    dense = np.clip((map_coordinates(noise(seed), places % SHEET, order=1, mode="grid-wrap") - COVER) / SOFTNESS, 0, 2)
    return 2.2 * dense**1.3 * np.clip((up - 0.01) / 0.09, 0.0, 1.0)


def sun_lobes(toward: Floats, ways: Floats, veil: float) -> Floats:
    """Return the sun's light over solid angle (1/sr), of which a part is spread by the veil; its integral is 1."""
    angle = np.arccos(np.clip(ways @ toward, -1.0, 1.0))
    disc = np.clip(0.5 + (SUN_RADIUS - angle) / (np.pi / HEIGHT), 0.0, 1.0)
    spread = np.exp(-0.5 * (angle / VEIL_SPREAD) ** 2)
    solid_angle = np.sqrt(1.0 - ways[..., 1] ** 2) * (np.pi / HEIGHT) ** 2
    return (1.0 - veil) * disc / (disc * solid_angle).sum() + veil * spread / (spread * solid_angle).sum()


def scattering(cosine: Floats, g: float) -> Floats:
    """Evaluate the phase function of Henyey and Greenstein."""
    return np.asarray((1.0 - g * g) / (4.0 * np.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5))


def land_and_sea(ways: Floats, sky: Floats) -> Floats:
    """Put hills before the horizon and the sea below it, the farther the more of the sky's colour."""
    azimuth, elevation = np.arctan2(ways[..., 0], -ways[..., 2]), np.degrees(np.arcsin(ways[..., 1]))
    horizon = sky[HEIGHT // 2 - 1].mean(axis=0)
    result = sky
    for haze, height, turns in ((0.6, 5.0, (2, 5, 11, 23)), (0.35, 3.4, (3, 7, 17, 37)), (0.15, 1.8, (4, 9, 21, 53))):
        waves = sum(np.sin(k * azimuth + 2.3 * k * height) / (1.0 + 0.25 * k) for k in turns)
        top = height * np.clip(0.55 + 0.5 * waves, 0.0, None)
        hill = haze * 0.55 * sky[HEIGHT // 2 - 6] + (1.0 - haze) * horizon * np.array([0.1, 0.13, 0.09])
        result = np.where((elevation < top)[..., None], hill, result)
    # Water mirrors what is above the horizon, blurred by waves, and more of it at a distance.
    calm = gaussian_filter(sky[::-1], (14.0, 5.0, 0.0), mode=("nearest", "wrap", "nearest"))
    mirrored = calm * (0.04 + 0.5 * np.exp(elevation / 6.0))[..., None] + 0.05 * horizon * np.array([0.3, 0.8, 1.2])
    return np.where((elevation < 0.0)[..., None], mirrored, result)


def evening(elevation: float, veil: float) -> Floats:
    """Return the radiance of all directions, (HEIGHT, 2 HEIGHT, 3)."""
    height = np.radians(elevation)
    toward = np.array([0.0, np.sin(height), -np.cos(height)])
    ways = directions()
    sun = linear_rec709(sunlight(TURBIDITY, np.pi / 2.0 - height)) * np.pi * np.sin(SUN_RADIUS) ** 2 / EFFICACY
    sky = clear_sky(toward, ways)
    cosine, depth = ways @ toward, clouds(ways, seed=11)[..., None]
    seen = 1.0 - np.exp(-depth)
    # Thin cloud scatters forwards, thick cloud all round; what it lets through falls with its depth.
    phase = 0.35 * scattering(cosine, 0.75) + 0.65 / (4.0 * np.pi)
    white = sun * phase[..., None] * (0.35 + 0.65 * np.exp(-0.6 * depth)) * 1.7 + 0.4 * sky.mean(axis=(0, 1))
    sky = sky * np.exp(-depth) + seen * white
    sky = sky + sun * sun_lobes(toward, ways, veil)[..., None] * (ways[..., 1:2] > 0.0)
    return land_and_sea(ways, sky)


def main() -> None:
    """Write the picture to the path given, or to the folder of files which are not in the repository."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", nargs="?", type=Path, default=DEFAULT, help="default: scenes/generated/evening.hdr")
    parser.add_argument("--elevation", type=float, default=14.0, help="of the sun above the horizon (degrees)")
    parser.add_argument("--veil", type=float, default=1.0, help="part of the sun's light that the veil spreads")
    arguments = parser.parse_args()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_bytes(hdr.encode(evening(arguments.elevation, arguments.veil), {}))
    print(f"{arguments.out}: {arguments.out.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
