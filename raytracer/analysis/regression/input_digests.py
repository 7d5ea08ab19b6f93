"""What a reference was rendered from, as digests that tell later which part of it has changed."""

import hashlib
import json
from collections.abc import Mapping

from raytracer.dump import plain
from raytracer.scene.inputs import files_of
from raytracer.scene.spec import SceneSpec

SCENE = "the scene"
"""What `digests` calls the scene itself."""

_DIGITS = 16


def digests(spec: SceneSpec) -> dict[str, str]:
    """Digests of the scene's values, however its file is written, and of each file that it is made of, by its name.

    Raises
    ------
    InputError : a file cannot be read.
    """
    text = json.dumps(plain(spec), sort_keys=True, default=str)
    found = {SCENE: _digest(text.encode())}
    for file in files_of(spec):
        found[file.name] = _digest(file.path.read_bytes())
    return found


def changed(before: Mapping[str, str], after: Mapping[str, str]) -> tuple[str, ...]:
    """Names of what is not as it was, or is there in one of the two only."""
    return tuple(name for name in dict.fromkeys([*before, *after]) if before.get(name) != after.get(name))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:_DIGITS]
