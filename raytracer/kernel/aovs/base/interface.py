"""The interface of AOVs: their specs, the numbers and names that they record, and the AOVs of one render.

An AOV's file holds its spec, with its name and unit, and its case of `measure`: up to three numbers of the first
surface that a camera path meets.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from raytracer.film.film import Film
from raytracer.kernel.aovs.base.layers import FIRST, Aovs, LightAovs, LightLayer, MeanLayer
from raytracer.schema.registry import AOVS
from raytracer.schema.spec import Spec
from raytracer.util.errors import InputError, suggest_name


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


# ---- Of one render


def unique_aovs(names: Iterable[str]) -> tuple[str, ...]:
    """Check names of AOVs, and return each once.

    Raises
    ------
    InputError : there is no AOV of that name.
    """
    known = AOVS.specs()
    for name in names:
        if name not in known:
            raise InputError(f"unknown AOV {name!r}; {suggest_name(name, known, 'AOVs')}")
    return tuple(dict.fromkeys(names))


def per_sample_aovs(names: Iterable[str]) -> tuple[str, ...]:
    """List those AOVs that hold values of each sample, so that all pixels must have equally many."""
    return tuple(name for name in names if AOVS.specs()[name].is_per_sample)


class AovRecorder:
    """The AOVs of these names on a film of height x width pixels.

    Attributes
    ----------
    view : the layers that kernels write to, or None if there are none.
    """

    def __init__(self, names: Sequence[str], height: int, width: int, identities: SceneIds) -> None:
        self._specs: dict[str, AovSpec] = {name: AOVS.specs()[name]() for name in names}
        self._identities = identities
        self._layers: dict[str, Any] = {}
        # By name, so that the same AOVs in another order are the same compiled kernel.
        column = FIRST
        for name in sorted(names):
            self._layers[name] = self._specs[name].pack(height, width, column, identities)
            column += len(self._specs[name].channels)
        gathered = tuple(layer for layer in self._layers.values() if layer is not None)
        make = LightAovs if any(isinstance(layer, LightLayer) for layer in gathered) else Aovs
        self.view = make(gathered) if gathered else None

    def develop(self, name: str, film: Film) -> NDArray[Any]:
        """Compute a finished AOV, (height, width) or (height, width, channels)."""
        return self._specs[name].develop(self._layers[name], film)

    def channels(self, names: Iterable[str]) -> dict[str, tuple[str, ...]]:
        """Name the channels of each AOV in a file."""
        return {name: self._specs[name].components(self._layers[name]) for name in names}

    def settings(self, names: Iterable[str]) -> dict[str, str]:
        """Make entries for the headers of files: the names that numbers in AOVs stand for, as JSON."""
        tables = {name: self._specs[name].names(self._identities) for name in names}
        return {f"{name}_names": json.dumps(table, ensure_ascii=False) for name, table in tables.items() if table}
