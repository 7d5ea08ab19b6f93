"""Packed scenes without a part of themselves, for the variants that `arms.py` makes of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.integrator import Scene
from raytracer.lights.background import Background
from raytracer.media.interface import NONE


def cleared(node: Any, path: Sequence[str]) -> Any:
    """A packed NamedTuple with None at a path of fields; of a camera that moves, in the one that it holds."""
    name, *rest = path
    if name not in node._fields:
        return node._replace(camera=cleared(node.camera, path))
    return node._replace(**{name: cleared(getattr(node, name), rest) if rest else None})


def _with_tables(scene: Scene, tables: Sequence[Any], **values: Any) -> Scene:
    """The scene with these tables of lights; without any, rays meet the environment as where there are no lights."""
    return scene._replace(lights=scene.lights._replace(tables=tuple(tables), **values) if tables else None)


def unaimed(scene: Scene) -> Scene:
    """The scene whose environment is met by paths alone."""
    tables = [table for table in scene.lights.tables if not isinstance(table, Background)]
    return _with_tables(scene, tables, unaimed=scene.environment)


def unlit(scene: Scene, module: str) -> Scene:
    """The scene without the lights of the kind in a module."""
    if scene.lights is None:
        return scene
    return _with_tables(scene, [table for table in scene.lights.tables if type(table).__module__ != module])


def cleared_of(scene: Scene, module: str) -> Scene:
    """The scene without the media of the kind in a module."""
    media = scene.media
    left = [number for number, table in enumerate(media.tables) if type(table).__module__ != module]
    numbers = np.full(len(media.tables), NONE, np.int32)
    numbers[left] = np.arange(len(left))

    def renamed(references: NDArray[np.int32]) -> NDArray[np.int32]:
        rows, kinds = np.divmod(np.maximum(references, 0), len(media.tables))
        there = np.where(numbers[kinds] == NONE, NONE, rows * len(left) + numbers[kinds])
        return np.where(references < 0, references, there).astype(np.int32)

    return scene._replace(
        media=media._replace(
            tables=tuple(media.tables[number] for number in left),
            inside=renamed(media.inside),
            outside=renamed(media.outside),
            camera=int(renamed(np.array(media.camera, np.int32))),
        )
    )
