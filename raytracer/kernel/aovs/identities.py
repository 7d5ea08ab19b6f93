"""Numbers of the object and the material that are seen.

On the command line:

    rt render scene.yaml -o out.exr --aov object_id,material_id
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.sampling.warp import first_above
from raytracer.film.film import Film
from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import MajorityLayer, measure


class _Identity(AovSpec):
    """An integer, which no filter may mix: the one that more than half of a pixel's samples see, if there is one."""

    channels: ClassVar[tuple[str, ...]] = ("ID",)

    def pack(self, height: int, width: int, column: int, identities: SceneIds) -> MajorityLayer:
        size = (height, width)
        return MajorityLayer(self.quantity(identities), np.zeros(size, np.int64), np.zeros(size, np.int64), column)

    def develop(self, layer: Any, film: Film) -> NDArray[Any]:
        return np.asarray(layer.winner, dtype=np.uint32)


class ObjectId(_Identity):
    """Number of the object, from 1 in the order of the scene; 0 where there is none."""

    type: Literal["object_id"] = "object_id"

    def quantity(self, identities: SceneIds) -> "ObjectIdQuantity":
        return ObjectIdQuantity(identities.first, identities.start, identities.owner, identities.placed)

    def names(self, identities: SceneIds) -> Mapping[int, str]:
        return dict(enumerate(identities.objects, 1))


class MaterialId(_Identity):
    """Number of the material, from 1; 0 where there is no surface.  Materials that are equal are one."""

    type: Literal["material_id"] = "material_id"

    def quantity(self, identities: SceneIds) -> "MaterialIdQuantity":
        return MaterialIdQuantity(identities.material)

    def names(self, identities: SceneIds) -> Mapping[int, str]:
        return dict(enumerate(identities.materials, 1))


class ObjectIdQuantity(NamedTuple):
    """The number of the object, by the tables of `SceneIds`."""

    first: NDArray[np.int64]
    start: NDArray[np.int64]
    owner: NDArray[np.int32]
    placed: NDArray[np.int32]


class MaterialIdQuantity(NamedTuple):
    """The number of the material, by the table of `SceneIds`."""

    material: NDArray[np.int32]


@measure.register(ObjectIdQuantity)
def measure_object_id_quantity(quantity, scene, seen):
    if 0 <= seen.instance < len(quantity.placed):
        return float(quantity.placed[seen.instance]), 0.0, 0.0
    # The last entry of the table that starts at this primitive or before it.
    after = first_above(quantity.start, quantity.first[seen.table] + 1, quantity.first[seen.table + 1], seen.primitive)
    return float(quantity.owner[after - 1]), 0.0, 0.0


@measure.register(MaterialIdQuantity)
def measure_material_id_quantity(quantity, scene, seen):
    return float(quantity.material[seen.hit.material]), 0.0, 0.0
