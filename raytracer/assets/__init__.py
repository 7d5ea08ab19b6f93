"""What scenes are made of besides their YAML: meshes read from files."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from raytracer.assets.meshes import Mesh, read_mesh, smooth_normals

LOADERS: Mapping[str, Callable[[Path], Any]] = {"mesh": read_mesh}
"""How each kind of asset that a shape may ask for is read."""

__all__ = ["LOADERS", "Mesh", "read_mesh", "smooth_normals"]
