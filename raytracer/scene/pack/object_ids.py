"""Numbers and names of a packed scene's objects and materials, for AOVs."""

import numpy as np

from raytracer.kernel.aovs.base.interface import SceneIds
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.spec import SceneSpec


def scene_ids(spec: SceneSpec, packed: PackedScene) -> SceneIds:
    """Number and name the objects and materials of a packed scene.

    Objects are numbered from 1 in the scene's order, and materials in the order in which objects first have them; an
    object or material without a name is called by its path in the scene.
    """
    by_reference = np.zeros(max(packed.materials) + 1, np.int32)
    for number, reference in enumerate(packed.materials, 1):
        by_reference[reference] = number
    lengths = [len(owners.start) for owners in packed.owners]
    return SceneIds(
        objects=tuple(item.name or f"objects[{i}]" for i, item in enumerate(spec.objects)),
        first=np.cumsum([0, *lengths], dtype=np.int64),
        start=np.concatenate([owners.start for owners in packed.owners]),
        owner=np.concatenate([owners.number for owners in packed.owners]) + np.int32(1),
        placed=packed.instance_objects + np.int32(1),
        materials=tuple(packed.materials.values()),
        material=by_reference,
        spp=spec.render.spp,
        frame=getattr(packed.scene.camera, "frame", None),
    )
