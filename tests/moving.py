"""Scenes as their files would be if their authors had put the origin, or the unit, elsewhere.

This works on the mappings of scene files, key by key, and knows nothing of what the program does about such scenes.
"""

import copy
import json
from typing import NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from raytracer.core.sampling import SAMPLERS
from raytracer.kernel.path_state import workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.rendering.compilation import compile_scene
from raytracer.rendering.film_region import empty_film, film_view
from raytracer.scene.load import build

_POINTS = ("center", "corner", "min", "max", "position", "look_from", "look_at")
"""Keys of places."""

_LENGTHS = ("radius", "focus_distance", "height", "bump_height", "spacing", "attenuation_distance")
"""Keys of lengths in metres."""

_CAMERA = {"look_from": [0, 0, 0], "look_at": [0, 0, -1]}


def document(path):
    """The mapping of a scene file, in which nothing is shared as what anchors name is."""
    found = json.loads(json.dumps(yaml.safe_load(path.read_text())))
    assert isinstance(found, dict)
    return found


def checked(found, base, **overrides):
    """The checked scene of a mapping; the overrides are merged into its parts, such as `film={"width": 60}`."""
    result = copy.deepcopy(found)
    for part, values in overrides.items():
        result.setdefault(part, {}).update(values)
    return build(yaml.safe_dump(result), "moved.yaml", base=base)


def _sum(a, b):
    return [float(x) + float(y) for x, y in zip(a, b, strict=True)]


def _map_points(item, change):
    for key in _POINTS:
        if key in item:
            item[key] = change(item[key])
    if "vertices" in item:
        item["vertices"] = [change(vertex) for vertex in item["vertices"]]


def moved(found, by):
    """The scene with all that is in it moved by a vector (m).

    What has no transform is written at its new place; what has one gets a step more.
    """
    result = copy.deepcopy(found)

    def shift(point):
        return _sum(point, by)

    def place(item):
        if "transform" in item or item["type"] in ("mesh", "instance", "scatter", "grid"):
            item["transform"] = [*item.get("transform", []), {"translate": list(map(float, by))}]
        else:
            _map_points(item, shift)

    def carry(item):
        motion = item.get("motion", {})
        if "spin" in motion:
            motion["spin"]["center"] = shift(motion["spin"].get("center", [0, 0, 0]))
        for frame in motion.get("keyframes", []):
            # Poses that turn would have to be those of the old origin between the keyframes, too.
            assert not any("rotate" in step for step in frame["transform"])
            frame["transform"] = [{"translate": [-float(x) for x in by]}, *frame["transform"], {"translate": list(by)}]

    result["camera"] = _CAMERA | result["camera"]
    _map_points(result["camera"], shift)
    carry(result["camera"])
    for item in result["objects"]:
        place(item)
        carry(item)
    for item in result.get("lights", []):
        _map_points(item, shift)
    for item in result.get("media", {}).values():
        if item["type"] == "grid":
            place(item)
    return result


def scaled(found, factor):
    """The scene with all lengths in it times a factor; radiances, and so the picture, stay as they are."""
    result = copy.deepcopy(found)

    def grow(point):
        return [factor * float(x) for x in point]

    def resize(item):
        _map_points(item, grow)
        for key in _LENGTHS:
            if key in item:
                item[key] = factor * item[key]
        if "edges" in item:
            item["edges"] = [grow(edge) for edge in item["edges"]]
        for step in item.get("transform", []):
            if "translate" in step:
                step["translate"] = grow(step["translate"])
        for key in ("extinction", "absorption", "scattering"):
            if key in item:
                item[key] = (np.asarray(item[key], np.float64) / factor).tolist()
        motion = item.get("motion", {})
        if "velocity" in motion:
            motion["velocity"] = grow(motion["velocity"])
        if "spin" in motion:
            motion["spin"]["center"] = grow(motion["spin"].get("center", [0, 0, 0]))
        if "intensity" in item:
            item["intensity"] = (factor**2 * np.asarray(item["intensity"], np.float64)).tolist()

    result["camera"] = _CAMERA | result["camera"]
    grouped = [item for items in result.get("groups", {}).values() for item in items]
    others = [*result.get("lights", []), *result.get("media", {}).values()]
    for item in (result["camera"], *result["objects"], *grouped, *others):
        resize(item)
    return result


class Picture(NamedTuple):
    """Radiance (height, width, 3), and the variance of each pixel's mean."""

    radiance: NDArray[np.float64]
    variance: NDArray[np.float64]


def pictured(packed, *, spp, seed):
    """Render a packed scene, by one thread and with independent samples."""
    width, height = packed.spec.film.width, packed.spec.film.height
    ready = compile_scene(packed.spec, packed)
    film = empty_film(ready.scene, width, height)
    scene = ready.scene._replace(sampler=SAMPLERS["independent"](seed, spp))
    room = workspace(scene)
    render_tile(scene, film_view(film), room, 0, 0, width, height, 0, spp)
    assert not film.nan_count.any()
    return Picture(film.mean, film.m2 / (spp * (spp - 1.0)))
