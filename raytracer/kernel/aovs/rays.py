"""The camera rays themselves: what a light field is made of.

On the command line:

    rt render scene.yaml -o out.lf --aov rays
"""

import math
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.aovs.interface import AovSpec, Identities, add_layer, begin_layer
from raytracer.cameras.placement import Frame, in_frame
from raytracer.errors import InputError
from raytracer.film.film import Film
from raytracer.hues import finished
from raytracer.paths import load3
from raytracer.vec import dot

# Columns of what is kept of a sample: a place and a slope, a value, and whether there is a sample.
_PLACE, _VALUE, _TAKEN, _COLUMNS = 0, 4, 7, 8


class Rays(AovSpec):
    """All rays of each pixel, as they are in front of the camera, and what each brought: a picture to be focused later.

    For each sample: U and V, where it goes through the plane of the lens, to the right and up from its middle (m); S
    and T, by how much it goes to the right and up per metre along the axis; R, G and B, what it added to the picture,
    before that was exposed or clamped; N, 1, or 0 where no sample was taken.  The picture is their mean.  Place and
    slope of what looks back or to the side, as in pictures of all directions, are NaN: such rays meet no plane ahead.
    """

    type: Literal["rays"] = "rays"
    channels: ClassVar[tuple[str, ...]] = ("U", "V", "S", "T", "R", "G", "B", "N")
    is_by_sample: ClassVar[bool] = True

    def pack(self, height: int, width: int, column: int, identities: Identities) -> "Kept":
        """The layer that holds them.

        Raises
        ------
        InputError : the camera moves, or has no axis; or there is not enough memory.
        """
        if identities.frame is None:
            raise InputError("the AOV rays needs a camera that has an axis and does not move")
        shape = (height, width, identities.spp, _COLUMNS)
        try:
            samples = np.zeros(shape)
        except MemoryError as error:
            gigabytes = 8.0 * math.prod(shape) / 1e9
            raise InputError(f"the AOV rays needs {gigabytes:.0f} GB of memory for {identities.spp} spp") from error
        return Kept(identities.frame, samples, np.zeros((height, width), np.int64), column)

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return np.asarray(layer.samples.reshape(*layer.count.shape, -1))

    def components(self, layer: Any) -> tuple[str, ...]:
        return tuple(f"{sample}.{name}" for sample in range(layer.samples.shape[2]) for name in self.channels)


class Kept(NamedTuple):
    """All samples, each as it came.

    frame, of the camera; samples (height, width, spp, 8) float64, the channels of `Rays`; count (height, width) int64,
    samples that are there; column, where a workspace keeps place and slope.
    """

    frame: Frame
    samples: NDArray[np.float64]
    count: NDArray[np.int64]  # type: ignore[assignment]  # takes the place of tuple.count
    column: int


@begin_layer.register(Kept)
def _(layer, work, sample, origin, direction):
    frame = layer.frame
    right, up, ahead = in_frame(frame, origin)
    along = dot(direction, frame.forward)
    # No plane ahead is met by what does not go there.
    inverse = 1.0 / along if along > 0.0 else math.nan
    slope, rise = dot(direction, frame.right) * inverse, dot(direction, frame.up) * inverse
    work.features[sample, layer.column] = right - ahead * slope
    work.features[sample, layer.column + 1] = up - ahead * rise
    work.features[sample, layer.column + 2] = slope
    work.features[sample, layer.column + 3] = rise


@add_layer.register(Kept)
def _(layer, spectrum, work, sample, x, y):
    number = layer.count[y, x]
    # What looks along a pixel once more, to find a sample again, may take more than there is room for.
    if number >= layer.samples.shape[2]:
        return
    value = finished(spectrum, work, sample, load3(work.radiance, sample, 0))
    for i in range(4):
        layer.samples[y, x, number, _PLACE + i] = work.features[sample, layer.column + i]
    for channel in range(3):
        layer.samples[y, x, number, _VALUE + channel] = work.radiance[sample, 3] * value[channel]
    layer.samples[y, x, number, _TAKEN] = 1.0
    layer.count[y, x] = number + 1
