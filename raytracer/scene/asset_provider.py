"""Where packing takes from what it need not make itself: files that are read, structures, and parts packed before."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from raytracer.assets import LOADERS
from raytracer.embree import Accel, Placements
from raytracer.geometry import Geometry

T = TypeVar("T")


class Supplies(Protocol):
    """What packing asks for."""

    def read(self, kind: str, path: Path) -> Any:
        """What a file holds, read as a kind of `assets.LOADERS`.

        Raises
        ------
        InputError : the file cannot be read.
        """

    def structure(
        self,
        geometries: Mapping[int, Geometry],
        groups: Sequence[Mapping[int, Geometry]],
        placements: Sequence[Placements],
        *,
        first_instance: int,
        robust: bool,
    ) -> Accel:
        """The ray caster's structure of these; see `Accel`."""

    def kept(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """What was made for an equal key, if that is still `fresh`; or what `make` makes now."""


class Anew:
    """Supplies that keep nothing."""

    def read(self, kind: str, path: Path) -> Any:
        """Read the file."""
        return LOADERS[kind](path)

    def structure(
        self,
        geometries: Mapping[int, Geometry],
        groups: Sequence[Mapping[int, Geometry]],
        placements: Sequence[Placements],
        *,
        first_instance: int,
        robust: bool,
    ) -> Accel:
        """Build it."""
        return Accel(geometries, groups, placements, first_instance=first_instance, robust=robust)

    def kept(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """Make it."""
        return make()
