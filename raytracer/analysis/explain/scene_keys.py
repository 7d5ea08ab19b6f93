"""Every key of a scene, at any depth: what it holds, whether the scene gives it, and what it means."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from raytracer.dump import plain_value
from raytracer.scene.schema import forms_of, meaning, name_of, properties_of, schema
from raytracer.scene.spec import SceneSpec
from raytracer.spec import Spec


class Key(NamedTuple):
    """A key of a scene.

    path : from the top of the scene on, as `-D` takes it.
    value : a plain value; None where there is none.
    is_given : whether the scene says so; else the value is the default.
    meaning : its description with its unit; empty where a mapping of the same class was described before.
    """

    path: str
    value: Any
    is_given: bool
    meaning: str


def keys_of(scene: SceneSpec) -> list[Key]:
    """List the keys of a scene and of all mappings in it, in the order of the scene's keys.

    The first mapping of each class has all its keys, with those of what may be in it; others have what is given.
    """
    return list(_keys_of(scene, "", set()))


def _keys_of(spec: Spec, path: str, told: set[str]) -> Iterator[Key]:
    """List the keys of a mapping at a path; `told` are the classes and definitions that were described before."""
    name = name_of(type(spec))
    is_first = name not in told
    told.add(name)
    properties = properties_of(type(spec))
    for key in spec.own_keys_first():
        value, node = getattr(spec, key), properties[key]
        here = f"{path}.{key}" if path else key
        if below := list(_specs_in(value, here)):
            for place, part in below:
                yield from _keys_of(part, place, told)
            continue
        is_given = key in spec.model_fields_set
        if is_first or is_given:
            yield Key(here, plain_value(value), is_given, meaning(node) if is_first else "")
        if is_first and not is_given:
            yield from _absent(node, here, told)


def _specs_in(value: Any, path: str) -> Iterator[tuple[str, Spec]]:
    """Go through the mappings that a value is or holds, with their paths."""
    if isinstance(value, Spec):
        yield path, value
    elif isinstance(value, tuple):
        for number, item in enumerate(value):
            name = getattr(item, "name", None)
            yield from _specs_in(item, f"{path}[{number}]" if name is None else f"{path}.{name}")
    elif isinstance(value, Mapping):
        for name, item in value.items():
            yield from _specs_in(item, f"{path}.{name}")


def _absent(node: Mapping[str, Any], path: str, told: set[str]) -> Iterator[Key]:
    """List the keys of the mappings that may stand where there is none; kinds of a family are left out."""
    for form in forms_of(schema(), node, path):
        if form.is_kind or (form.name is not None and form.name in told):
            continue
        told.update([form.name] if form.name is not None else [])
        for key, below in form.node["properties"].items():
            here = f"{form.path}.{key}"
            yield Key(here, None, False, meaning(below))
            yield from _absent(below, here, told)
