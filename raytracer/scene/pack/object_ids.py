"""Numbers and names of a packed scene's objects and materials, for AOVs."""

import numpy as np

from raytracer.aovs.interface import Identities
from raytracer.scene.pack import Packed
from raytracer.scene.spec import SceneSpec


def identify(spec: SceneSpec, packed: Packed) -> Identities:
    """Who is who in a scene and what was packed of it.

    Objects are numbered from 1 in the scene's order, and materials in the order in which objects first have them; what
    has no name is called by its path in the scene.
    """
    by_reference = np.zeros(max(packed.materials) + 1, np.int32)
    for number, reference in enumerate(packed.materials, 1):
        by_reference[reference] = number
    lengths = [len(owners.start) for owners in packed.owners]
    return Identities(
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
