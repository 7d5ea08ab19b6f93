"""Reconstruct what a camera without a lens saw through a coded mask.

    python docs/examples/lensless.py scenes/lecture/lensless.yaml outputs/lensless.png

Every point of the scene casts the shadow of the mask, moved by where the point is, so the recorded picture is the scene
convolved with the shadow of one point.  The division that undoes it is regularised as by Wiener, since what is hardly
recorded of a frequency is mostly noise.  Gonzalez and Woods 2018, "Digital Image Processing", section 5.8.
"""

import math
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import raytracer as rt

NOISE = 4e-3
"""Power of the noise over that of the strongest frequency of the shadow but for its mean."""


def mask_shadow(mask: NDArray[np.bool_], side: float, size: tuple[int, int]) -> NDArray[np.float64]:
    """Draw the shadow of a square mask, `side` pixels wide, that a lamp in the middle pixel casts on a film: of sum 1.

    size : height and width of the film (px); the middle is the pixel in row height // 2 and column width // 2.
    The picture is the film turned upside down, and so is the shadow.
    """

    def coverage(length: int) -> NDArray[np.float64]:
        """Part of each pixel (length,) that each row of the mask (squares,) covers."""
        edges = np.arange(length + 1) - length // 2 - 0.5
        squares = (np.arange(len(mask) + 1) / len(mask) - 0.5) * side
        below = np.clip(edges[:, None], squares[:-1], squares[1:])
        return np.diff(below, axis=0)

    shadow = coverage(size[0]) @ mask[::-1, ::-1].astype(np.float64) @ coverage(size[1]).T
    return shadow / shadow.sum()


def scene_shadow(scene: rt.Scene, folder: Path) -> NDArray[np.float64]:
    """Draw the shadow (height, width) of the mask of a scene's camera, for what is as far away as `look_at`.

    The mask has the area of a round hole of the camera's diameter, and its shadow is larger by 1 + f / z.

    folder : where the file of the mask is.
    """
    camera, film = scene.camera, scene.film
    with Image.open(folder / camera.aperture_shape.file) as picture:
        mask = np.asarray(picture.convert("1"))
    side = camera.diameter * math.sqrt(0.25 * math.pi / mask.mean())
    side *= 1.0 + 1e-3 * camera.focal_length / math.dist(camera.look_from, camera.look_at)
    return mask_shadow(mask, side * film.width / camera.sensor.width, (film.height, film.width))


def reconstruct(recorded: NDArray[np.float64], shadow: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide a recorded picture (height, width, 3) by the shadow (height, width) of a lamp in its middle pixel."""
    height, width = shadow.shape
    size = (2 * height, 2 * width)
    transfer = np.fft.rfft2(shadow, size)
    power = np.abs(transfer) ** 2
    inverse = transfer.conj() / (power + NOISE * np.sort(power.ravel())[-100])
    channels = [np.fft.irfft2(np.fft.rfft2(channel, size) * inverse, size) for channel in np.moveaxis(recorded, -1, 0)]
    return np.roll(np.stack(channels, -1), (height // 2, width // 2), (0, 1))[:height, :width]


def main() -> None:
    """Render a scene through its mask, and reconstruct it."""
    file, output = map(Path, sys.argv[1:])
    scene = rt.load(file)
    seen = reconstruct(rt.render(scene, progress=True).radiance, scene_shadow(scene, file.parent))
    rt.Image(np.maximum(seen / np.percentile(seen, 99.5), 0.0)).save(output)


if __name__ == "__main__":
    main()
