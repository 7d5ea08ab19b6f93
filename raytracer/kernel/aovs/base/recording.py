"""Record the AOVs of one render: from their names to layers of a film, and from these to layers of an image."""

import json
from collections.abc import Iterable, Sequence
from typing import Any

from numpy.typing import NDArray

from raytracer.film.film import Film
from raytracer.kernel.aovs.base.interface import AovSpec, SceneIds
from raytracer.kernel.aovs.base.layers import FIRST, Aovs
from raytracer.schema.registry import AOVS
from raytracer.util.errors import InputError, suggest_name


def unique_aovs(names: Iterable[str]) -> tuple[str, ...]:
    """Check names of AOVs, and return each once.

    Raises
    ------
    InputError : there is no AOV of that name.
    """
    known = AOVS.specs()
    for name in names:
        if name not in known:
            raise InputError(f"unknown AOV {name!r}; {suggest_name(name, known, 'AOVs')}")
    return tuple(dict.fromkeys(names))


def per_sample_aovs(names: Iterable[str]) -> tuple[str, ...]:
    """List those AOVs that hold values of each sample, so that all pixels must have equally many."""
    return tuple(name for name in names if AOVS.specs()[name].is_per_sample)


class AovRecorder:
    """The AOVs of these names on a film of height x width pixels.

    Attributes
    ----------
    view : the layers that kernels write to, or None if there are none.
    """

    def __init__(self, names: Sequence[str], height: int, width: int, identities: SceneIds) -> None:
        self._specs: dict[str, AovSpec] = {name: AOVS.specs()[name]() for name in names}
        self._identities = identities
        self._layers: dict[str, Any] = {}
        # By name, so that the same AOVs in another order are the same compiled kernel.
        column = FIRST
        for name in sorted(names):
            self._layers[name] = self._specs[name].pack(height, width, column, identities)
            column += len(self._specs[name].channels)
        gathered = tuple(layer for layer in self._layers.values() if layer is not None)
        self.view = Aovs(gathered) if gathered else None

    def develop(self, name: str, film: Film) -> NDArray[Any]:
        """Compute a finished AOV, (height, width) or (height, width, channels)."""
        return self._specs[name].develop(self._layers[name], film)

    def channels(self, names: Iterable[str]) -> dict[str, tuple[str, ...]]:
        """Name the channels of each AOV in a file."""
        return {name: self._specs[name].components(self._layers[name]) for name in names}

    def settings(self, names: Iterable[str]) -> dict[str, str]:
        """Make entries for the headers of files: the names that numbers in AOVs stand for, as JSON."""
        tables = {name: self._specs[name].names(self._identities) for name in names}
        return {f"{name}_names": json.dumps(table, ensure_ascii=False) for name, table in tables.items() if table}
