"""The interface of AOVs: their specs, and the numbers and names that they record.

An AOV's file holds its spec, with its name and unit, and its case of `measure`: up to three numbers of the first
surface that a camera path meets.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from raytracer.film.film import Film
from raytracer.kernel.aovs.base.layers import MeanLayer
from raytracer.schema.spec import Spec


@dataclass(frozen=True)
class SceneIds:
    """Numbers and names of the objects and materials of a packed scene; number 0 is none.

    Attributes
    ----------
    objects : names of the objects from number 1 on.
    first : int64 (tables + 1,), the first entry in `start` and `owner` of each table of primitives.
    start : int64 (n,), the primitive of the table from which on `owner` holds, rising within a table.
    owner : int32 (n,), numbers of objects.
    placed : int32 (instances,), number of the object that an instance is, in place of the owners of its primitives.
    materials : names of the materials from number 1 on.
    material : int32 (references,), the number of a material by the reference that primitives have.
    spp : samples of each pixel, where all have as many.
    frame : the CameraFrame of the packed camera if it does not move; else None.
    """

    objects: tuple[str, ...]
    first: NDArray[np.int64]
    start: NDArray[np.int64]
    owner: NDArray[np.int32]
    placed: NDArray[np.int32]
    materials: tuple[str, ...]
    material: NDArray[np.int32]
    spp: int = 0
    frame: Any = None


class AovSpec(Spec):
    """Base of the AOVs.

    Attributes
    ----------
    channels : names of the components in a file.
    unit : of the values.
    empty : the value of a pixel that sees nothing.
    is_per_sample : True if it holds values of each sample, so that all pixels must have equally many.
    measured : class of the quantity that kernels measure, where it has no fields.
    """

    type: str
    channels: ClassVar[tuple[str, ...]]
    unit: ClassVar[str] = ""
    empty: ClassVar[float] = 0.0
    is_per_sample: ClassVar[bool] = False
    measured: ClassVar[Any]

    def quantity(self, identities: SceneIds) -> Any:
        """Make the quantity that kernels measure: the first argument of `measure`."""
        return self.measured()

    def pack(self, height: int, width: int, column: int, identities: SceneIds) -> Any:
        """Make the layer of this AOV in a film of height x width pixels; None if the film itself holds it.

        It may use as many columns of a workspace as it has channels, from `column` on.
        """
        size = len(self.channels)
        return MeanLayer(self.quantity(identities), np.zeros((height, width, size + 1)), column, size)

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        """Compute the finished AOV, (height, width) for a single channel, else (height, width, channels)."""
        sums, weight = layer.sums[..., :-1], layer.sums[..., -1:]
        values = np.full(sums.shape, self.empty)
        np.divide(sums, weight, out=values, where=weight != 0.0)
        return values[..., 0] if len(self.channels) == 1 else values

    def components(self, layer: Any) -> tuple[str, ...]:
        """Name the components of the finished AOV in a file."""
        return self.channels

    def names(self, identities: SceneIds) -> Mapping[int, str]:
        """Return the names that the numbers stand for, if they do."""
        return {}
