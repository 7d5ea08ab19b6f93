"""Autofocus: on an object, or at a place in the frame.

At a place in the frame, invisible surfaces, such as the boundary of a medium, are not
seen; any other cutout counts as solid, in its holes too.
"""

from collections.abc import Set
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from raytracer.core.embree import Accel, RayHit
from raytracer.core.primitives.base.interface import row_of
from raytracer.core.vec import Vec3
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.scene.object_bounds import ObjectBounds
from raytracer.scene.pack.objects import Objects
from raytracer.scene.pack.world import PackedWorld
from raytracer.scene.spec import SceneSpec
from raytracer.schema.validation_errors import error_sentence

# Rounds of refocusing, as focusing narrows the view and the frame's place then shows another point of the scene.
_MOST_ROUNDS = 32

_MIDDLE = 0.5
"""The middle of the exposure, as a fraction: the time that all focusing is done for."""


def resolve_focus(spec: SceneSpec, world: PackedWorld, accel: Accel | None) -> SceneSpec:
    """Replace a camera's autofocus by the distance that it finds; a scene without autofocus is returned as it is.

    accel : the ray caster's structure of the scene, for a camera that is focused at a place in the frame.

    Raises
    ------
    SceneError : what the camera is to focus on lies behind it, or nearer than its focal length.
    """
    camera: Any = spec.camera
    if camera.focused_object() is not None:
        return _at_distance(spec, "focus_on", _distance_of(spec, world.bounds))
    return spec if accel is None else _at_distance(spec, "focus_at", _distance_seen(spec, world, accel))


def _at_distance(spec: SceneSpec, key: str, distance: float) -> SceneSpec:
    camera: Any = spec.camera
    try:
        return spec.model_copy(update={"camera": camera.with_focus_distance(distance)})
    except ValidationError as error:
        raise spec.error(error_sentence(error.errors()[0]), "camera", key) from None
    except ValueError as error:
        raise spec.error(str(error), "camera", key) from None


def mid_exposure_time(spec: SceneSpec) -> float:
    """Compute the time in the middle of the exposure (s)."""
    opening = spec.camera.shutter_interval()
    return opening.open + _MIDDLE * (opening.close - opening.open)


def _distance_of(spec: SceneSpec, where: ObjectBounds) -> float:
    """Compute the distance along the axis of the object to focus on (m)."""
    time = mid_exposure_time(spec)
    camera: Any = camera_at_time(spec.camera, time)
    frame = camera.frame()
    center = where.center(where.number(camera.focus_on), time)
    distance = float(np.dot(center - frame.origin, frame.forward))
    if distance <= 0.0:
        place = "behind the camera" if distance < 0.0 else "beside the camera"
        x, y, z = center
        sentence = f"[{x:.6g}, {y:.6g}, {z:.6g}], lies {place}, which cannot focus on it"
        raise spec.error(f"the middle of {camera.focus_on!r}, {sentence}", "camera", "focus_on")
    return distance


def _distance_seen(spec: SceneSpec, world: PackedWorld, accel: Accel) -> float:
    """Compute the distance along the axis of what is seen at a place in the frame (m); infinite if nothing is."""
    # Invisible materials let all light through.
    materials = zip(world.used, world.references, strict=True)
    clear = {reference for material, reference in materials if material.is_invisible()}
    origin = (0.0, 0.0, 0.0) if world.origin is None else world.origin.world
    camera: Any = camera_at_time(spec.camera, mid_exposure_time(spec))
    width, height = spec.film.width, spec.film.height
    x, y = camera.focus_at
    distance, tried = np.inf, set()

    # Focusing may change the field of view: look again through the focused camera until it sees the same.
    for _ in range(_MOST_ROUNDS):
        try:
            start, direction = camera.model_copy(update={"focus_distance": distance}).film_to_ray(x, y, width, height)
        except ValueError:
            # Nearer than the camera can focus there is no image to look at.
            return distance
        ray = world_ray(camera, start, direction, origin)
        hit = first_visible_hit(world.objects, clear, accel, ray)
        distance = ray.depth(np.inf if hit is None else hit.distance)
        if distance in tried:
            break
        tried.add(distance)
    return distance


class WorldRay(NamedTuple):
    """A ray through a place in the frame, in packed coordinates.

    start, direction : (3,), the direction a unit vector.
    start_depth, cosine : distance of the start along the axis (m), and how much of each metre goes along it.
    """

    start: NDArray[np.float64]
    direction: NDArray[np.float64]
    start_depth: float
    cosine: float

    def depth(self, distance: float) -> float:
        """Return the distance along the axis (m) of a point at a distance along the ray."""
        return self.start_depth + distance * self.cosine


def world_ray(camera: Any, start: NDArray[np.float64], direction: NDArray[np.float64], origin: Vec3) -> WorldRay:
    """Take the ray of a place in the frame, as `film_to_ray` gives it, into a world packed around an origin."""
    frame = camera.frame()
    axes = np.array([frame.right, frame.up, frame.forward])
    stretch = float(np.linalg.norm(direction))
    return WorldRay(
        np.subtract(frame.origin, origin) + start @ axes,
        direction @ axes / stretch,
        float(start[2]),
        float(direction[2]) / stretch,
    )


def first_visible_hit(objects: Objects, clear: Set[int], accel: Accel, ray: WorldRay) -> RayHit | None:
    """Find the first visible surface that a ray meets in the middle of the exposure; None if there is none.

    clear : references of invisible materials.
    """
    beyond = 0.0
    while (hit := accel.cast(ray.start, ray.direction, beyond=beyond, time=_MIDDLE)) is not None:
        if _material(objects, hit) not in clear:
            return hit
        beyond = float(np.nextafter(np.float32(hit.distance), np.float32(np.inf)))
    return None


def _material(objects: Objects, hit: RayHit) -> int:
    """Look up the material reference of a hit."""
    instances, table = objects.instances, objects.primitives[hit.geometry]
    row = row_of(table, hit.primitive)
    if instances is not None and hit.instance >= 0:
        number = instances.arrays[hit.instance - instances.base] + hit.placement
        row += instances.rows[instances.group[number], hit.geometry]
        if instances.material is not None and instances.material[number] >= 0:
            return int(instances.material[number])
    return int(table.material[row])
