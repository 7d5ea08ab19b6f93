"""Focusing as a photographer does it: on an object, or at a place in the frame.

At a place in the frame, what light goes through everywhere as if nothing were there, such as the boundary of a medium,
is not seen; any other cutout counts as solid, in its holes too.
"""

from collections.abc import Callable, Set
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from raytracer.cameras.moving import camera_at
from raytracer.embree import Accel, Found
from raytracer.primitives.interface import row_of
from raytracer.scene.objects import Objects
from raytracer.scene.spec import SceneSpec
from raytracer.scene.whereabouts import Whereabouts
from raytracer.spec import Vector, sentence

# Rounds in which focusing narrows the view, so that another point of the scene is seen at that place of the frame.
_MOST_ROUNDS = 32

_MIDDLE = 0.5
"""The middle of the shutter's opening, for which all focusing is done."""


def focuses(spec: SceneSpec) -> bool:
    """Whether the camera is focused on something, in place of at a distance."""
    return getattr(spec.camera, "focus_on", None) is not None or getattr(spec.camera, "focus_at", None) is not None


def focused(
    spec: SceneSpec,
    where: Whereabouts,
    objects: Objects,
    clear: Set[int],
    build: Callable[[], Accel],
    world: Vector,
) -> SceneSpec:
    """The scene with the distance at which its camera is focused; itself where that is known.

    Parameters
    ----------
    clear : references of the materials that let all light through, which a camera does not see.
    build : gives the ray caster's structure of the scene; called only where a ray is needed.
    world : the point of the scene (m) that is the origin of the structure's.

    Raises
    ------
    SceneError : what the camera is to focus on lies behind it, or nearer than its focal length.
    """
    camera: Any = spec.camera
    if getattr(camera, "focus_on", None) is not None:
        return _at_distance(spec, "focus_on", _distance_of(spec, where))
    if getattr(camera, "focus_at", None) is not None:
        return _at_distance(spec, "focus_at", _distance_seen(spec, objects, clear, build(), world))
    return spec


def _at_distance(spec: SceneSpec, key: str, distance: float) -> SceneSpec:
    camera: Any = spec.camera
    try:
        return spec.model_copy(update={"camera": camera.focused(distance)})
    except ValidationError as error:
        raise spec.error(sentence(error.errors()[0]), "camera", key) from None
    except ValueError as error:
        raise spec.error(str(error), "camera", key) from None


def middle_of(spec: SceneSpec) -> float:
    """The time in the middle of the exposure (s)."""
    opening = spec.camera.opening()
    return opening.open + _MIDDLE * (opening.close - opening.open)


def _distance_of(spec: SceneSpec, where: Whereabouts) -> float:
    """Distance, along the axis, of the object to focus on (m)."""
    time = middle_of(spec)
    camera: Any = camera_at(spec.camera, time)
    frame = camera.frame()
    center = where.center(where.number(camera.focus_on), time)
    distance = float(np.dot(center - frame.origin, frame.forward))
    if distance <= 0.0:
        place = "behind the camera" if distance < 0.0 else "beside the camera"
        raise spec.error(
            f"the middle of {camera.focus_on!r}, {_coordinates(center)}, lies {place}, which cannot focus on it",
            "camera",
            "focus_on",
        )
    return distance


def _coordinates(point: NDArray[np.float64]) -> str:
    return f"[{', '.join(f'{coordinate:.6g}' for coordinate in point)}]"


def _distance_seen(spec: SceneSpec, objects: Objects, clear: Set[int], accel: Accel, world: Vector) -> float:
    """Distance, along the axis, of what is seen at a place in the frame (m); infinite if nothing is."""
    camera: Any = camera_at(spec.camera, middle_of(spec))
    frame = camera.frame()
    width, height = spec.film.width, spec.film.height
    x, y = camera.focus_at
    distance, tried = np.inf, set()

    # Where focusing changes the field of view, look again through the focused camera, until that sees the same.
    for _ in range(_MOST_ROUNDS):
        try:
            start, way = camera.model_copy(update={"focus_distance": distance}).sight(x, y, width, height)
        except ValueError:
            # Nearer than the camera can focus there is no image to look at.
            return distance
        axes = np.array([frame.right, frame.up, frame.forward])
        stretch = float(np.linalg.norm(way))
        met = _met(objects, clear, accel, np.subtract(frame.origin, world) + start @ axes, way @ axes / stretch)
        distance = float(start[2]) + met * float(way[2]) / stretch
        if distance in tried:
            break
        tried.add(distance)
    return distance


def _met(objects: Objects, clear: Set[int], accel: Accel, origin: Any, direction: NDArray[np.float64]) -> float:
    """Distance to the first surface that can be seen (m)."""
    beyond = 0.0
    while (found := accel.cast(origin, direction, beyond=beyond, time=_MIDDLE)) is not None:
        if _material(objects, found) not in clear:
            return found.distance
        beyond = float(np.nextafter(np.float32(found.distance), np.float32(np.inf)))
    return np.inf


def _material(objects: Objects, found: Found) -> int:
    """The reference of the material of what a ray met."""
    instances, table = objects.instances, objects.primitives[found.geometry]
    row = row_of(table, found.primitive)
    if instances is not None and found.instance >= 0:
        number = instances.arrays[found.instance - instances.base] + found.placement
        row += instances.rows[instances.group[number], found.geometry]
        if instances.material is not None and instances.material[number] >= 0:
            return int(instances.material[number])
    return int(table.material[row])
