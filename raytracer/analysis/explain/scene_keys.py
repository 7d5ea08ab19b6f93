"""Every key of a scene, at any depth: its value, its source and its meaning."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from raytracer.optics.to_yaml import value_to_plain
from raytracer.scene.json_schema import definition_name, description_with_unit, forms_of, properties_of, scene_schema
from raytracer.scene.spec import SceneSpec
from raytracer.schema.spec import Spec


class SceneKey(NamedTuple):
    """A key of a scene.

    path : from the top of the scene on, as `-D` takes it.
    value : a plain value; None where there is none.
    is_given : True if the scene gives the value; else it is the default.
    meaning : its description with its unit; empty where a mapping of the same class was described before.
    """

    path: str
    value: Any
    is_given: bool
    meaning: str


def list_keys(scene: SceneSpec) -> list[SceneKey]:
    """List the keys of a scene and of all mappings in it, in the order of the scene's keys.

    The first mapping of each class has all its keys, with those of what may be in it; others have what is given.
    """
    return list(_list_keys(scene, "", set()))


def _list_keys(spec: Spec, path: str, described: set[str]) -> Iterator[SceneKey]:
    """List the keys of a mapping at a path; `described` are the classes and definitions that were described before."""
    name = definition_name(type(spec))
    is_first = name not in described
    described.add(name)
    properties = properties_of(type(spec))
    for key in spec.own_keys_first():
        value, node = getattr(spec, key), properties[key]
        here = f"{path}.{key}" if path else key
        if below := list(_specs_in(value, here)):
            for place, part in below:
                yield from _list_keys(part, place, described)
            continue
        is_given = key in spec.model_fields_set
        if is_first or is_given:
            yield SceneKey(here, value_to_plain(value), is_given, description_with_unit(node) if is_first else "")
        if is_first and not is_given:
            yield from _list_absent_keys(node, here, described)


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


def _list_absent_keys(node: Mapping[str, Any], path: str, described: set[str]) -> Iterator[SceneKey]:
    """List the keys of the mappings that may stand where there is none; kinds of a family are left out."""
    for form in forms_of(scene_schema(), node, path):
        if form.is_kind or (form.name is not None and form.name in described):
            continue
        described.update([form.name] if form.name is not None else [])
        for key, below in form.node["properties"].items():
            here = f"{form.path}.{key}"
            yield SceneKey(here, None, False, description_with_unit(below))
            yield from _list_absent_keys(below, here, described)
