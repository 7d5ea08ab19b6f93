"""Functions that build parts of scenes in code, with a file's keys as arguments, its checks and its errors."""

import inspect
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pydantic import ValidationError

from raytracer.optics.to_yaml import value_to_plain
from raytracer.scene.kind_unions import VALIDATION_CONTEXT
from raytracer.scene.validation import to_builtins
from raytracer.schema.registry import Family, type_name
from raytracer.schema.spec import Spec
from raytracer.schema.validation_errors import first_error
from raytracer.schema.yaml_nodes import SourceLocation, node_of
from raytracer.util.errors import InputError, SceneError, suggest_name

Maker = Callable[..., Any]


class UnknownKindError(InputError, AttributeError):
    """A family has no kind of this name."""


class KindFactories:
    """The kinds of a family as functions: `camera.thin_lens(vfov=20)` is `{type: thin_lens, vfov: 20}`."""

    def __init__(self, word: str, family: Family) -> None:
        self._word, self._family = word, family
        self.__doc__ = f"The kinds of {family.noun}, each a function with the keys of a scene file as arguments."

    def __getattr__(self, name: str) -> Maker:
        if name.startswith("__"):
            raise AttributeError(name)
        known = self._family.specs()
        if name not in known:
            message = f"unknown type of {self._family.noun} {name!r}; {suggest_name(name, known, 'types')}"
            raise UnknownKindError(f"rt.{self._word}.{name}: {message}")
        result = self.__dict__[name] = part_factory(known[name], f"rt.{self._word}.{name}", {"type": name})
        return result

    def __dir__(self) -> list[str]:
        return list(self._family.specs())


def part_factory(spec: type[Spec], path: str, given: Mapping[str, Any] | None = None) -> Maker:
    """Make a function that builds such a part of a scene; errors call it `path`, and the keys `given` are set."""

    def make(**values: Any) -> Spec:
        return build_part(spec, {**(given or {}), **values}, path)

    make.__name__ = path.rpartition(".")[2]
    make.__qualname__ = path
    make.__module__ = "raytracer.scene.python_api"
    make.__doc__ = _documentation(spec)
    make.__signature__ = _signature(spec)  # type: ignore[attr-defined]
    return make


def build_part(spec: type[Spec], values: Mapping[str, Any], path: str) -> Spec:
    """Build a checked part of a scene.

    Raises
    ------
    SceneError : a value is wrong; the sentence begins with `path` and the key.
    """
    plain = to_builtins(values)
    try:
        return spec.model_validate(plain, context=VALIDATION_CONTEXT)
    except ValidationError as error:
        first = first_error(error, node_of(value_to_plain(plain), SourceLocation(0)), None)
        raise SceneError(first.message, key=first.key, source=path) from None


def _arguments(spec: type[Spec]) -> list[str]:
    return [key for key in spec.own_keys_first() if key != "type" or type_name(spec) is None]


def _signature(spec: type[Spec]) -> inspect.Signature:
    parameters = []
    for key, field in ((key, spec.model_fields[key]) for key in _arguments(spec)):
        default = inspect.Parameter.empty if field.is_required() else field.get_default(call_default_factory=True)
        parameters.append(inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=default))
    return inspect.Signature(parameters)


def _documentation(spec: type[Spec]) -> str:
    keys = ((key, spec.model_fields[key].description) for key in _arguments(spec))
    listed = "\n".join(f"{key} : {text}" for key, text in keys)
    return f"{inspect.getdoc(spec)}\n\nParameters\n----------\n{listed}"


def mapping_classes(*roots: type[Spec]) -> dict[str, type[Spec]]:
    """List the classes of mappings without a type that these may hold, by name: `Film`, `Sensor`, ..."""
    classes: dict[str, type[Spec]] = {}
    seen: set[type[Spec]] = set()
    for part in (part for root in roots for part in _reached(root, seen)):
        kind = part.model_fields.get("type")
        is_base = kind is not None and kind.annotation is str
        if part not in roots and type_name(part) is None and not is_base:
            classes[part.__name__.removesuffix("Spec")] = part
    return dict(sorted(classes.items()))


def _reached(spec: type[Spec], seen: set[type[Spec]]) -> Iterator[type[Spec]]:
    """Walk through a mapping's class and those of all mappings that it may hold."""
    if spec in seen:
        return
    seen.add(spec)
    yield spec
    for field in spec.model_fields.values():
        for annotation in _within(field.annotation):
            yield from _reached(annotation, seen)


def _within(annotation: Any) -> Iterator[type[Spec]]:
    """Walk through the classes of mappings in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, Spec):
        yield annotation
    for argument in typing.get_args(annotation):
        yield from _within(argument)
