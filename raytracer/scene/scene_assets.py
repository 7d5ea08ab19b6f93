"""The files that a scene names, each read once."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from raytracer.scene.asset_provider import AssetProvider, NoCache
from raytracer.scene.spec import SceneSpec
from raytracer.schema.spec import Spec
from raytracer.schema.yaml_nodes import KeyPath
from raytracer.util.errors import InputError


class SceneAssets:
    """The contents of the files that a scene names, each read once."""

    def __init__(self, spec: SceneSpec, provider: AssetProvider | None = None) -> None:
        self._spec, self._provider = spec, provider or NoCache()
        self._held: dict[tuple[str, Path], Any] = {}

    def read(self, kind: str, name: str) -> Any:
        """Read the file of that name, relative to the scene, as an asset kind of `assets.LOADERS`.

        Raises
        ------
        InputError : it cannot be read.
        """
        known = kind, self._spec.base / name
        if known not in self._held:
            self._held[known] = self._provider.read(*known)
        return self._held[known]

    def of(self, item: Spec, keys: KeyPath) -> Mapping[str, Any]:
        """Read the files of an object, or of the camera, by the path of the key that names each.

        Raises
        ------
        SceneError : a file cannot be read.
        """
        result = {}
        for path, (name, kind) in item.files().items():
            try:
                result[".".join(map(str, path))] = self.read(kind, name)
            except InputError as error:
                raise self._spec.error(str(error), *keys, *path) from None
        return result

    def is_fresh(self, provider: AssetProvider) -> bool:
        """Return True if `provider` still has the very same contents of each file that was read."""
        try:
            return all(provider.read(*known) is held for known, held in self._held.items())
        except InputError:
            return False
