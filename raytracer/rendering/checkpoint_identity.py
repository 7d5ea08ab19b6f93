"""The identity of a render: all that decides on the bits of its picture, to refuse checkpoints of another one."""

import json
from collections.abc import Mapping
from typing import Any

from raytracer import __version__
from raytracer.core.compiler.cache import processor
from raytracer.scene.digest import file_hashes, libraries, picture_values, program_hash
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import format_value

# Sections of an identity, with their names where they differ, in the order in which they are compared.
_SECTIONS = {
    "version": "another version of rt",
    "libraries": "other libraries",
    "processor": "another kind of processor",
    "program": "another state of rt's sources",
    "scene": "another scene",
    "files": "other files",
    "settings": "other settings",
}


def render_identity(spec: SceneSpec, settings: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return all that decides on the bits of a picture: plain values, by the names of sections.

    Parameters
    ----------
    settings : all that the picture depends on besides its scene.

    Raises
    ------
    InputError : a file of the scene cannot be read.
    """
    return {
        "version": __version__,
        "libraries": libraries(),
        "processor": _processor(),
        "program": program_hash(),
        "scene": picture_values(spec),
        "files": file_hashes(spec),
        "settings": dict(settings),
    }


def _processor() -> dict[str, Any]:
    """Return the parts of the description of the processor that kernels are compiled for."""
    platform, name, features = processor().split(" ", 2)
    return {"platform": platform, "name": name, "features": dict.fromkeys(features.split(","), True)}


def identity_difference(then: Mapping[str, Any], current: Mapping[str, Any]) -> str | None:
    """Describe the first difference of two identities, "another scene: film.width was 4 and is 8"; None without any.

    Parameters
    ----------
    then : from a checkpoint's JSON.
    """
    current = json.loads(json.dumps(current))
    for section, name in _SECTIONS.items():
        difference = _first_difference(then.get(section), current[section], "")
        if difference is not None:
            return f"{name}: {difference}"
    return None


def _first_difference(then: Any, current: Any, place: str) -> str | None:
    """Describe the first difference of two plain values; None if they are equal."""
    if isinstance(then, Mapping) and isinstance(current, Mapping):
        for key in [*then, *(key for key in current if key not in then)]:
            difference = _first_difference(then.get(key), current.get(key), f"{place}.{key}" if place else str(key))
            if difference is not None:
                return difference
        return None
    if isinstance(then, list) and isinstance(current, list) and len(then) == len(current):
        pairs = enumerate(zip(then, current, strict=True))
        return next((text for i, pair in pairs if (text := _first_difference(*pair, f"{place}[{i}]"))), None)
    if then == current:
        return None
    before, after = ("not given" if value is None else format_value(value) for value in (then, current))
    return f"{place} was {before} and is {after}".lstrip()
