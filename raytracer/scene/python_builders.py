"""Parts of scenes made in code: functions with a file's keys as arguments, a file's checks and its errors."""

import inspect
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from raytracer.document import Place, first_error, node_of
from raytracer.dump import plain_value
from raytracer.errors import InputError, SceneError, suggestion
from raytracer.kinds import Family, type_name
from raytracer.scene.load import CONTEXT, pythonic
from raytracer.spec import Spec

Maker = Callable[..., Any]


class UnknownKindError(InputError, AttributeError):
    """A family has no kind of this name."""


class Kinds:
    """The kinds of a family as functions: `camera.thin_lens(vfov=20)` is `{type: thin_lens, vfov: 20}`."""

    def __init__(self, word: str, family: Family) -> None:
        self._word, self._family = word, family
        self.__doc__ = f"The kinds of {family.noun}, each a function with the keys of a scene file as arguments."

    def __getattr__(self, name: str) -> Maker:
        if name.startswith("__"):
            raise AttributeError(name)
        known = self._family.specs()
        if name not in known:
            found = f"unknown type of {self._family.noun} {name!r}; {suggestion(name, known, 'types')}"
            raise UnknownKindError(f"rt.{self._word}.{name}: {found}")
        result = self.__dict__[name] = maker(known[name], f"rt.{self._word}.{name}", {"type": name})
        return result

    def __dir__(self) -> list[str]:
        return list(self._family.specs())


def maker(spec: type[Spec], path: str, given: Mapping[str, Any] | None = None) -> Maker:
    """A function that makes such a part of a scene, and that errors call by `path`; `given`, what is always set."""

    def make(**values: Any) -> Spec:
        return made(spec, {**(given or {}), **values}, path)

    make.__name__ = path.rpartition(".")[2]
    make.__qualname__ = path
    make.__module__ = "raytracer.vocabulary"
    make.__doc__ = _documentation(spec)
    make.__signature__ = _signature(spec)  # type: ignore[attr-defined]
    return make


def made(spec: type[Spec], values: Mapping[str, Any], path: str) -> Spec:
    """A checked part of a scene.

    Raises
    ------
    SceneError : what it says is wrong; the sentence begins with `path` and the key.
    """
    plain = pythonic(values)
    try:
        return spec.model_validate(plain, context=CONTEXT)
    except ValidationError as error:
        found = first_error(error, node_of(plain_value(plain), Place(0)), None)
        raise SceneError(found.message, key=found.key, source=path) from None


def _arguments(spec: type[Spec]) -> list[str]:
    return [key for key in spec.own_keys_first() if key != "type" or type_name(spec) is None]


def _signature(spec: type[Spec]) -> inspect.Signature:
    parameters = [
        inspect.Parameter(
            key,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if field.is_required() else field.get_default(call_default_factory=True),
        )
        for key, field in ((key, spec.model_fields[key]) for key in _arguments(spec))
    ]
    return inspect.Signature(parameters)


def _documentation(spec: type[Spec]) -> str:
    keys = ((key, spec.model_fields[key].description) for key in _arguments(spec))
    listed = "\n".join(f"{key} : {text}" for key, text in keys)
    return f"{inspect.getdoc(spec)}\n\nParameters\n----------\n{listed}"


def parts_of(spec: type[Spec]) -> dict[str, type[Spec]]:
    """The mappings without a type that a scene may hold, by name: `Film`, `Sensor`, ..."""
    found: dict[str, type[Spec]] = {}
    for part in _reached(spec, set()):
        kind = part.model_fields.get("type")
        is_base = kind is not None and kind.annotation is str
        if part is not spec and type_name(part) is None and not is_base:
            found[part.__name__.removesuffix("Spec")] = part
    return dict(sorted(found.items()))


def _reached(spec: type[Spec], seen: set[type[Spec]]) -> Iterator[type[Spec]]:
    """A mapping's class, and those of all that it may hold."""
    if spec in seen:
        return
    seen.add(spec)
    yield spec
    for field in spec.model_fields.values():
        for annotation in _within(field.annotation):
            yield from _reached(annotation, seen)


def _within(annotation: Any) -> Iterator[type[Spec]]:
    """The classes of mappings in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel) and issubclass(annotation, Spec):
        yield annotation
    for argument in typing.get_args(annotation):
        yield from _within(argument)
