"""Picking: the object at a place in the picture, and its distance."""

from typing import Any, NamedTuple

import numpy as np

from raytracer.core.embree import Accel, RayHit
from raytracer.core.primitives.base.interface import row_of
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.scene.pack.autofocus import first_visible_hit, mid_exposure_time, world_ray
from raytracer.scene.pack.scene import PackedScene, scene_ids


class Pick(NamedTuple):
    """The object at a place in the picture.

    object : name, or path in the scene.
    name : given to the object; None without one.
    distance : along the camera's axis (m), to which a camera is focused to have it sharp.
    """

    object: str
    name: str | None
    distance: float


def pick(packed: PackedScene, accel: Accel, x: float, y: float) -> Pick | None:
    """Find what is seen at a place in the frame in the middle of the exposure; None for the background.

    x, y : fractions of the frame's width and height, from the top left; of many views, those of the middle one.

    Raises
    ------
    ValueError : the camera has no such ray.
    """
    spec = packed.spec
    camera: Any = camera_at_time(spec.camera, mid_exposure_time(spec))
    if not hasattr(camera, "film_to_ray"):
        raise ValueError(f"the camera {camera.type} has no axis to measure a distance along")
    origin = (0.0, 0.0, 0.0) if packed.scene.origin is None else packed.scene.origin.world
    start, direction = camera.film_to_ray(x, y, spec.film.width, spec.film.height)
    ray = world_ray(camera, start, direction, origin)
    clear = {reference for reference, material in packed.resolved_materials.items() if material.is_invisible()}
    hit = first_visible_hit(packed.objects, clear, accel, ray)
    if hit is None:
        return None
    number = _object_number(packed, hit)
    name = spec.objects[number].name
    return Pick(name or f"objects[{number}]", name, ray.depth(hit.distance))


def _object_number(packed: PackedScene, hit: RayHit) -> int:
    """Look up which object of the scene a hit is on."""
    ids, instances = scene_ids(packed.spec, packed), packed.objects.instances
    if instances is not None and hit.instance >= 0:
        placed = int(instances.arrays[hit.instance - instances.base]) + hit.placement
        if placed < len(ids.placed):
            return int(ids.placed[placed]) - 1
    first, end = ids.first[hit.geometry], ids.first[hit.geometry + 1]
    owner = np.searchsorted(ids.start[first:end], _row(packed, hit), side="right") - 1
    return int(ids.owner[first + owner]) - 1


def _row(packed: PackedScene, hit: RayHit) -> int:
    """Look up the row of its table that a hit is on."""
    table, instances = packed.objects.primitives[hit.geometry], packed.objects.instances
    row = int(row_of(table, hit.primitive))
    if instances is not None and hit.instance >= 0:
        number = instances.arrays[hit.instance - instances.base] + hit.placement
        row += int(instances.rows[instances.group[number], hit.geometry])
    return row
