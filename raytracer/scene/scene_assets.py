"""The files that a scene names, each read once, and providers of what packing can reuse."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from raytracer.core.embree import Accel, InstanceArray
from raytracer.core.geometry import Geometry
from raytracer.scene.assets import LOADERS
from raytracer.scene.spec import SceneSpec
from raytracer.schema.spec import Spec
from raytracer.schema.yaml_nodes import KeyPath
from raytracer.util.errors import InputError

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


class AssetProvider:
    """Source of file contents, ray caster's structures and packed parts; this one keeps nothing, `RenderCache` does."""

    def read(self, kind: str, path: Path) -> Any:
        """Read a file as an asset kind of `assets.LOADERS`.

        Raises
        ------
        InputError : the file cannot be read.
        """
        return LOADERS[kind](path)

    def build_accel(self, parts: AccelInput) -> Accel:
        """Provide the ray caster's structure of these parts."""
        return parts.build()

    def get_or_create(self, key: tuple[Any, ...], make: Callable[[], T], fresh: Callable[[T], bool]) -> T:
        """Return the cached result for an equal key, if it is still `fresh`; otherwise that of `make`."""
        return make()


class SceneAssets:
    """The contents of the files that a scene names, each read once."""

    def __init__(self, spec: SceneSpec, provider: AssetProvider | None = None) -> None:
        self._spec, self._provider = spec, provider or AssetProvider()
        self._held: dict[tuple[str, Path], Any] = {}

    def of(self, item: Spec, keys: KeyPath) -> Mapping[str, Any]:
        """Read the files that a mapping of the scene names, by the path of the key that names each.

        Raises
        ------
        SceneError : a file cannot be read.
        """
        result = {}
        for path, (name, kind) in item.files().items():
            known = kind, self._spec.base / name
            try:
                if known not in self._held:
                    self._held[known] = self._provider.read(*known)
            except InputError as error:
                raise self._spec.error(str(error), *keys, *path) from None
            result[".".join(map(str, path))] = self._held[known]
        return result

    def is_fresh(self, provider: AssetProvider) -> bool:
        """Return True if `provider` still has the very same contents of each file that was read."""
        try:
            return all(provider.read(*known) is held for known, held in self._held.items())
        except InputError:
            return False
