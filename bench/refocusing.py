"""Time the refocusing of a light field, by shift-and-sum and by slices of its spectrum.

    python bench/refocusing.py [--views 9] [--width 512] [--height 384] [--planes 1,5,20,50]

Both read the same views out of memory and write the same planes, interleaved; the spectrum is made anew for each
number of planes.  Prints a table in seconds, and from how many planes on slices are sooner done.
"""

import argparse
import time

import numpy as np
from scipy.ndimage import gaussian_filter

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.focusing import refocusable
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.refocusing.refocus import focal_stack

_SPACING, _FOCUS = 0.004, 0.6


def _field(views: int, width: int, height: int) -> LightField:
    places = _SPACING * (np.arange(views) - 0.5 * (views - 1))
    pixel = 0.5 / width
    geometry = Views(
        position=np.stack(np.meshgrid(places, -places), axis=-1),
        plane=Plane(pixel, -0.5 * width * pixel, 0.5 * height * pixel),
        width=width,
        height=height,
        inverse_focus=1.0 / _FOCUS,
    )
    picture = gaussian_filter(np.random.default_rng(0).random((height, width, 3)), (2.0, 2.0, 0.0))
    radiance = np.empty((views, views, height, width, 3), np.float32)
    radiance[:] = picture
    return LightField(radiance, geometry)


def _seconds(field: LightField, distances: list[float], method: str) -> float:
    start = time.perf_counter()
    focal_stack(field, distances, method=method)  # type: ignore[arg-type]
    return time.perf_counter() - start


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=9)
    parser.add_argument("--width", type=int, default=512)
    parser.add_argument("--height", type=int, default=384)
    parser.add_argument("--planes", default="1,5,20,50")
    asked = parser.parse_args()
    field = _field(asked.views, asked.width, asked.height)
    nearest = 1.0 / refocusable(field.views)[0]
    print(f"{asked.views} x {asked.views} views of {asked.width} x {asked.height}")
    print("planes  shift  fourier  ratio")
    for count in map(int, asked.planes.split(",")):
        distances = [1.0 / inverse for inverse in np.linspace(1.0 / _FOCUS, nearest, count + 1)[1:]]
        shift, fourier = (_seconds(field, distances, method) for method in ("shift", "fourier"))
        print(f"{count:6d} {shift:6.2f} {fourier:8.2f} {shift / fourier:6.2f}", flush=True)


if __name__ == "__main__":
    main()
