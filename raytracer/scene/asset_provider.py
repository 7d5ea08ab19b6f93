"""Providers of what packing can reuse: files that were read, ray caster's structures, and packed parts."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

from raytracer.core.embree import Accel, InstanceArray
from raytracer.core.geometry import Geometry
from raytracer.scene.assets import LOADERS

T = TypeVar("T")


class AccelInput(NamedTuple):
    """All that a structure is built of; see `Accel`."""

    geometries: Mapping[int, Geometry]
    groups: Sequence[Mapping[int, Geometry]]
    placements: Sequence[InstanceArray]
    first_instance: int
    robust: bool

    def build(self) -> Accel:
        """Build the structure."""
        shapes = self.geometries, self.groups, self.placements
        return Accel(*shapes, first_instance=self.first_instance, robust=self.robust)


class AssetProvider(Protocol):
    """Source of file contents, ray caster's structures and packed parts."""

    def read(self, kind: str, path: Path) -> Any:
        """Read a file as an asset kind of `assets.LOADERS`.

        Raises
        ------
        InputError : the file cannot be read.
        """

    def build_accel(self, parts: AccelInput) -> Accel:
        """Provide the ray caster's structure of these parts."""

    def get_or_create(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """Return the cached result for an equal key, if it is still `fresh`; otherwise that of `make`."""


class NoCache:
    """Provider that keeps nothing."""

    def read(self, kind: str, path: Path) -> Any:
        """Read the file."""
        return LOADERS[kind](path)

    def build_accel(self, parts: AccelInput) -> Accel:
        """Build it."""
        return parts.build()

    def get_or_create(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """Make it."""
        return make()
