"""Digests of what a reference was rendered from, which show later what has changed."""

import hashlib
import json
from collections.abc import Mapping

from raytracer.optics.to_yaml import spec_to_plain
from raytracer.scene.files import input_files
from raytracer.scene.spec import SceneSpec

SCENE = "the scene"
"""Name of the scene itself in `digests`."""

_DIGITS = 16


def digests(spec: SceneSpec) -> dict[str, str]:
    """Compute digests of the scene's values, however its file is written, and of each of its files, by name.

    Raises
    ------
    InputError : a file cannot be read.
    """
    text = json.dumps(spec_to_plain(spec), sort_keys=True, default=str)
    by_name = {SCENE: _digest(text.encode())}
    for file in input_files(spec):
        by_name[file.name] = _digest(file.path.read_bytes())
    return by_name


def changed_inputs(before: Mapping[str, str], after: Mapping[str, str]) -> tuple[str, ...]:
    """List names whose digests differ, or that only one of the two has."""
    return tuple(name for name in dict.fromkeys([*before, *after]) if before.get(name) != after.get(name))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:_DIGITS]
