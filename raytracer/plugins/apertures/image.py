"""Image aperture: an opening of any shape, from a picture of it.

In a scene:

    camera: {type: thin_lens, look_from: [0, 1, 4], look_at: [0, 1, 0], vfov: 30, aperture: 40 mm,
             aperture_shape: {type: image, file: heart.png}}
"""

import math
from collections.abc import Mapping
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from raytracer.core.fresnel import REC709_LUMINANCE
from raytracer.core.sampling.warp import sample_bin
from raytracer.optics.lens_system.surfaces import aperture_extent, aperture_transmission
from raytracer.plugins.apertures.base.interface import ApertureSpec, Assets, sample_aperture


class ImageAperture(ApertureSpec):
    """A mask before the lens: white lets light through, black does not, grey and half transparent places do in part.

    The middle of the picture is on the axis, its pixels are square, and its top is up.  What counts is how much light
    pixels let through in proportion to each other; the whole is made as large as lets through what the round aperture
    does.
    """

    loads: ClassVar[Mapping[str, str]] = {"file": "image"}

    type: Literal["image"] = "image"
    file: str = Field(
        description="picture (.png .jpg .bmp .tga .tif .webp .exr .hdr .npy), relative to the scene", min_length=1
    )
    encoding: Literal["linear", "srgb"] = Field(
        default="linear", description="what the picture's values are: the transmission itself, or the sRGB code of it"
    )

    def shape(self, assets: Assets) -> "ApertureMask":
        values = np.asarray(assets["file"].linear(self.encoding == "srgb"), np.float64)
        channels = values.shape[2]
        light = values[..., :3] @ np.array(REC709_LUMINANCE) if channels >= 3 else values[..., 0]
        try:
            return pack_mask(np.asarray(light * values[..., -1] if channels in (2, 4) else light))
        except ValueError as error:
            raise ValueError(f"{self.file} {error}") from None


class ApertureMask(NamedTuple):
    """Packed mask.

    rows (H,) float64 : probability of a row or one above it.
    columns (H * W,) float64 : probability of a pixel or one to its left, given the row.
    side : edge of a pixel.
    """

    rows: NDArray[np.float64]
    columns: NDArray[np.float64]
    side: float


def pack_mask(transmission: NDArray[np.float64]) -> ApertureMask:
    """Pack a mask of `transmission` (H, W), row 0 at the top, in which only proportions count.

    Raises
    ------
    ValueError : it holds what is negative or not finite, or nothing but zeros; a predicate of the picture.
    """
    if not np.isfinite(transmission).all():
        raise ValueError("holds a transmission that is not finite")
    if (transmission < 0.0).any():
        raise ValueError("holds a negative transmission")
    if not transmission.any():
        raise ValueError("is black all over, so it lets no light through")
    columns = np.cumsum(transmission / transmission.max(), axis=1)
    by_row = columns[:, -1].copy()
    columns /= np.where(by_row > 0.0, by_row, 1.0)[:, None]
    rows = np.cumsum(by_row)
    total = float(rows[-1])
    return ApertureMask(rows / total, columns.ravel(), math.sqrt(math.pi / total))


@sample_aperture.register(ApertureMask)
def sample_aperture_aperture_mask(aperture, u1, u2):
    # By cumulative sums, so that well spread numbers stay well spread.
    height = len(aperture.rows)
    width = len(aperture.columns) // height
    row, down = sample_bin(aperture.rows, 0, height, u2)
    pixel, right = sample_bin(aperture.columns, row * width, (row + 1) * width, u1)
    x = pixel - row * width + right - 0.5 * width
    return aperture.side * x, aperture.side * (0.5 * height - row - down)


@aperture_transmission.register(ApertureMask)
def aperture_transmission_aperture_mask(diaphragm, x, y):
    height = len(diaphragm.rows)
    width = len(diaphragm.columns) // height
    across, down = x / diaphragm.side + 0.5 * width, 0.5 * height - y / diaphragm.side
    if not (0.0 <= across < width and 0.0 <= down < height):
        return 0.0
    row, pixel = int(down), int(across)
    begin = row * width
    of_row = diaphragm.rows[row] - (diaphragm.rows[row - 1] if row > 0 else 0.0)
    of_pixel = diaphragm.columns[begin + pixel] - (diaphragm.columns[begin + pixel - 1] if pixel > 0 else 0.0)
    # Of all light, pi, this part falls on the area of a pixel.
    return min(1.0, of_row * of_pixel * math.pi / (diaphragm.side * diaphragm.side))


@aperture_extent.register
def aperture_extent_aperture_mask(diaphragm: ApertureMask) -> float:
    height = len(diaphragm.rows)
    return 0.5 * diaphragm.side * math.hypot(height, len(diaphragm.columns) // height)
