"""The AOVs of one render: from their names to layers of a film, and from these to layers of an image."""

import json
from collections.abc import Iterable, Sequence
from typing import Any

from numpy.typing import NDArray

from raytracer.aovs.interface import FIRST, Aovs, AovSpec, Identities
from raytracer.errors import InputError, suggestion
from raytracer.film.film import Film
from raytracer.kinds import AOVS


def known_aovs(names: Iterable[str]) -> tuple[str, ...]:
    """The names, each once.

    Raises
    ------
    InputError : there is no AOV of that name.
    """
    known = AOVS.specs()
    for name in names:
        if name not in known:
            raise InputError(f"unknown AOV {name!r}; {suggestion(name, known, 'AOVs')}")
    return tuple(dict.fromkeys(names))


def by_sample(names: Iterable[str]) -> tuple[str, ...]:
    """Those AOVs that hold something of each sample, so that all pixels must have as many."""
    return tuple(name for name in names if AOVS.specs()[name].is_by_sample)


class Recording:
    """What the AOVs of these names gather on a film of height x width pixels.

    Attributes
    ----------
    view : what kernels write to, or None if they need not.
    """

    def __init__(self, names: Sequence[str], height: int, width: int, identities: Identities) -> None:
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
        """A finished AOV, (height, width) or (height, width, channels)."""
        return self._specs[name].develop(self._layers[name], film)

    def channels(self, names: Iterable[str]) -> dict[str, tuple[str, ...]]:
        """What the channels of each AOV are called in a file."""
        return {name: self._specs[name].components(self._layers[name]) for name in names}

    def settings(self, names: Iterable[str]) -> dict[str, str]:
        """What the numbers in AOVs stand for, as JSON, for the headers of files."""
        tables = {name: self._specs[name].names(self._identities) for name in names}
        return {f"{name}_names": json.dumps(table, ensure_ascii=False) for name, table in tables.items() if table}
