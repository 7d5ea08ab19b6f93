"""Removals of parts of packed scenes, for the variants of `effect_variants.py`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.kernel.packed_scene import Scene
from raytracer.plugins.lights.background import Background
from raytracer.plugins.media.base.interface import NO_MEDIUM


def without_path(node: Any, path: Sequence[str]) -> Any:
    """Set a path of fields of a packed NamedTuple to None; of a moving camera, in the camera that it holds."""
    name, *rest = path
    if name not in node._fields:
        return node._replace(camera=without_path(node.camera, path))
    return node._replace(**{name: without_path(getattr(node, name), rest) if rest else None})


def _with_tables(scene: Scene, tables: Sequence[Any], **values: Any) -> Scene:
    """Replace the tables of lights of a scene; without any, rays meet the environment as where there are no lights."""
    return scene._replace(lights=scene.lights._replace(tables=tuple(tables), **values) if tables else None)


def without_environment_sampling(scene: Scene) -> Scene:
    """Remove next-event estimation of the environment."""
    tables = [table for table in scene.lights.tables if not isinstance(table, Background)]
    return _with_tables(scene, tables, background_tables=scene.environment)


def without_light_kind(scene: Scene, module: str) -> Scene:
    """Remove the lights of the kind that a module defines."""
    if scene.lights is None:
        return scene
    return _with_tables(scene, [table for table in scene.lights.tables if type(table).__module__ != module])


def without_media_kind(scene: Scene, module: str) -> Scene:
    """Remove the media of the kind that a module defines."""
    media = scene.media
    left = [number for number, table in enumerate(media.tables) if type(table).__module__ != module]
    numbers = np.full(len(media.tables), NO_MEDIUM, np.int32)
    numbers[left] = np.arange(len(left))

    def renamed(references: NDArray[np.int32]) -> NDArray[np.int32]:
        rows, kinds = np.divmod(np.maximum(references, 0), len(media.tables))
        there = np.where(numbers[kinds] == NO_MEDIUM, NO_MEDIUM, rows * len(left) + numbers[kinds])
        return np.where(references < 0, references, there).astype(np.int32)

    return scene._replace(
        media=media._replace(
            tables=tuple(media.tables[number] for number in left),
            inside=renamed(media.inside),
            outside=renamed(media.outside),
            camera=int(renamed(np.array(media.camera, np.int32))),
        )
    )
