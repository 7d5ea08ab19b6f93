"""What scenes are made of besides their YAML: meshes, grids and the like, read from files."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from raytracer.assets import gltf
from raytracer.assets.grids import read_grid
from raytracer.assets.images import Image, file_of, read_image
from raytracer.assets.lenses import read_lens
from raytracer.assets.meshes import Mesh, read_mesh, smooth_normals
from raytracer.assets.placements import read_placements

LOADERS: Mapping[str, Callable[[Path], Any]] = {
    "grid": read_grid,
    "image": read_image,
    "lens": read_lens,
    "mesh": read_mesh,
    "placements": read_placements,
}
"""How each kind of asset that a shape may ask for is read."""


def companions(kind: str, path: Path) -> tuple[Path, ...]:
    """The files that a file of this kind (of `LOADERS`) names in its turn, as far as they are there.

    They are those of glTF files; the materials of OBJ files are not read.
    """
    path = file_of(path)
    return gltf.companions(path) if kind in ("mesh", "image") and path.suffix.lower() in (".gltf", ".glb") else ()


def names_within(kind: str, path: Path) -> tuple[Path, ...]:
    """The files that reading a file of this kind may open besides, be they there or not."""
    path = file_of(path)
    return gltf.named(path) if kind in ("mesh", "image") and path.suffix.lower() in (".gltf", ".glb") else ()


__all__ = [
    "LOADERS",
    "Image",
    "Mesh",
    "companions",
    "file_of",
    "names_within",
    "read_grid",
    "read_image",
    "read_lens",
    "read_mesh",
    "read_placements",
    "smooth_normals",
]
