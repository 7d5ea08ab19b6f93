"""Providers of what packing can reuse: files that were read, ray caster's structures, and packed parts."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from raytracer.core.embree import Accel, InstanceArray
from raytracer.core.geometry import Geometry
from raytracer.scene.assets import LOADERS

T = TypeVar("T")


class AssetProvider(Protocol):
    """Source of file contents, ray caster's structures and packed parts."""

    def read(self, kind: str, path: Path) -> Any:
        """Read a file as an asset kind of `assets.LOADERS`.

        Raises
        ------
        InputError : the file cannot be read.
        """

    def build_accel(
        self,
        geometries: Mapping[int, Geometry],
        groups: Sequence[Mapping[int, Geometry]],
        placements: Sequence[InstanceArray],
        *,
        first_instance: int,
        robust: bool,
    ) -> Accel:
        """Provide the ray caster's structure of these; see `Accel`."""

    def get_or_create(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """Return the cached result for an equal key, if it is still `fresh`; otherwise that of `make`."""


class NoCache:
    """Provider that keeps nothing."""

    def read(self, kind: str, path: Path) -> Any:
        """Read the file."""
        return LOADERS[kind](path)

    def build_accel(
        self,
        geometries: Mapping[int, Geometry],
        groups: Sequence[Mapping[int, Geometry]],
        placements: Sequence[InstanceArray],
        *,
        first_instance: int,
        robust: bool,
    ) -> Accel:
        """Build it."""
        return Accel(geometries, groups, placements, first_instance=first_instance, robust=robust)

    def get_or_create(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """Make it."""
        return make()
