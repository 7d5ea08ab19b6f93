"""The camera rays themselves, of which a light field is made.

On the command line:

    rt render scene.yaml -o out.lf --aov rays
"""

import math
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.vec import dot
from raytracer.film.film import Film
from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import add_layer, begin_layer
from raytracer.kernel.lens_dispersion import apply_lens_color
from raytracer.kernel.path_rows import load3
from raytracer.plugins.cameras.base.placement import CameraFrame, to_camera_space
from raytracer.util.errors import InputError

# Columns of a sample: its position and slope, its value, and 1 if it was taken.
_RAY, _VALUE, _TAKEN, _COLUMNS = 0, 4, 7, 8


class Rays(AovSpec):
    """All camera rays of each pixel, in front of the camera, with the radiance of each: a picture to be focused later.

    For each sample: U and V, where it goes through the plane of the lens, to the right and up from its middle (m); S
    and T, by how much it goes to the right and up per metre along the axis; R, G and B, what it added to the picture,
    before that was exposed or clamped; N, 1, or 0 where no sample was taken.  The picture is their mean.  Place and
    slope of what looks back or to the side, as in pictures of all directions, are NaN: such rays meet no plane ahead.
    """

    type: Literal["rays"] = "rays"
    channels: ClassVar[tuple[str, ...]] = ("U", "V", "S", "T", "R", "G", "B", "N")
    is_per_sample: ClassVar[bool] = True

    def pack(self, height: int, width: int, column: int, identities: SceneIds) -> "RaysLayer":
        """Make the layer that holds the rays.

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
        return RaysLayer(identities.frame, samples, np.zeros((height, width), np.int64), column)

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return np.asarray(layer.samples.reshape(*layer.count.shape, -1))

    def components(self, layer: Any) -> tuple[str, ...]:
        return tuple(f"{sample}.{name}" for sample in range(layer.samples.shape[2]) for name in self.channels)


class RaysLayer(NamedTuple):
    """All samples of each pixel, in the order in which they were taken.

    Attributes
    ----------
    frame : of the camera.
    samples : float64 (height, width, spp, 8), the channels of `Rays`.
    count : int64 (height, width), samples taken.
    column : first column of a workspace's AOV values that holds position and slope.
    """

    frame: CameraFrame
    samples: NDArray[np.float64]
    count: NDArray[np.int64]  # type: ignore[assignment]  # takes the place of tuple.count
    column: int


@begin_layer.register(RaysLayer)
def begin_layer_rays_layer(layer, work, sample, origin, direction):
    frame = layer.frame
    right, up, ahead = to_camera_space(frame, origin)
    along = dot(direction, frame.forward)
    # A ray that does not go forward meets no plane ahead.
    inverse = 1.0 / along if along > 0.0 else math.nan
    slope, rise = dot(direction, frame.right) * inverse, dot(direction, frame.up) * inverse
    work.aov_values[sample, layer.column] = right - ahead * slope
    work.aov_values[sample, layer.column + 1] = up - ahead * rise
    work.aov_values[sample, layer.column + 2] = slope
    work.aov_values[sample, layer.column + 3] = rise


@add_layer.register(RaysLayer)
def add_layer_rays_layer(layer, spectrum, work, sample, x, y):
    number = layer.count[y, x]
    # Replays of a sample may take more samples of a pixel than the layer holds.
    if number >= layer.samples.shape[2]:
        return
    value = apply_lens_color(spectrum, work, sample, load3(work.radiance, sample, 0))
    for i in range(4):
        layer.samples[y, x, number, _RAY + i] = work.aov_values[sample, layer.column + i]
    for channel in range(3):
        layer.samples[y, x, number, _VALUE + channel] = work.weight[sample] * value[channel]
    layer.samples[y, x, number, _TAKEN] = 1.0
    layer.count[y, x] = number + 1
