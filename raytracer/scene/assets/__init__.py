"""Read the files that scenes name: meshes, images, grids, placements and lenses."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from raytracer.scene.assets import gltf
from raytracer.scene.assets.grids import read_grid
from raytracer.scene.assets.images import file_of, read_image
from raytracer.scene.assets.meshes import read_mesh
from raytracer.scene.assets.placements import read_placements


def read_lens(path: Path) -> Any:
    """Read the lens of a file, as `lenses.read_lens` does: the optics of lenses are imported for scenes that have one.

    Raises
    ------
    SceneError : it cannot be read, or is wrong; the error names file, line and key.
    """
    from raytracer.scene.assets import lenses

    return lenses.read_lens(path)


LOADERS: Mapping[str, Callable[[Path], Any]] = {
    "grid": read_grid,
    "image": read_image,
    "lens": read_lens,
    "mesh": read_mesh,
    "placements": read_placements,
}
"""Reader of each kind of asset."""


def companion_files(kind: str, path: Path) -> tuple[Path, ...]:
    """List the files that a file of this kind (of `LOADERS`) names in turn, as far as they exist.

    Only glTF files name any; the materials of OBJ files are not read.
    """
    return tuple(file for file in referenced_files(kind, path) if os.path.isfile(file))


def referenced_files(kind: str, path: Path) -> tuple[Path, ...]:
    """List the files that reading a file of this kind may open besides, whether they exist or not."""
    path = file_of(path)
    return gltf.referenced_files(path) if kind in ("mesh", "image") and path.suffix.lower() in (".gltf", ".glb") else ()
