"""Registry of families of kinds: one package a family, one module a kind, found by importing the package.

A kind's module defines a `Spec` with `type: Literal["its name"]`; that name is what a scene file writes.  A module is
imported, and its model built, when a scene names its kind: of sixty models a scene needs ten, and all of them take a
quarter of a second.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cached_property, reduce
from operator import or_
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, ValidationInfo, WithJsonSchema
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.schema.spec import Spec, class_noun, field_error, with_article
from raytracer.util.errors import format_value, suggest_name


class _ByName:
    """Annotation of a family's union by which a kind's bare name stands for a mapping of that type."""

    def __init__(self, family: "Family") -> None:
        self._family = family

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(
            lambda value: {"type": value} if isinstance(value, str) else value, handler(source)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"enum": list(self._family.specs())}, handler(schema)]}


class _OtherKind(Spec):
    """A second kind beside any, since a union of one takes no discriminator."""

    type: Literal[""] = ""


class _AnyKind:
    """Annotation of a field that holds any kind of a family, chosen by its key `type`."""

    def __init__(self, family: "Family") -> None:
        self._family = family

    def _validate(self, value: Any, info: ValidationInfo) -> Any:
        value = self._family.check_type(value)
        if isinstance(value, Spec):
            return value
        return self._family.adapter(value["type"]).validate_python(value, context=info.context)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(
            self._validate, serialization=core_schema.plain_serializer_function_ser_schema(lambda value: value)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return handler(TypeAdapter(self._family.whole_union()).core_schema)


class Family:
    """The kinds of one noun ("shape") in one package ("raytracer.plugins.shapes")."""

    def __init__(self, noun: str, package: str) -> None:
        self.noun = noun
        self.package = package
        self._found: dict[str, Any] = {}
        self._adapters: dict[str, TypeAdapter[Any]] = {}

    @cached_property
    def _specs(self) -> dict[str, type[Spec]]:
        specs: dict[str, type[Spec]] = {}
        for info in pkgutil.iter_modules(importlib.import_module(self.package).__path__):
            for kind in _kinds(f"{self.package}.{info.name}"):
                name = str(type_name(kind))
                if name in specs:
                    raise TypeError(f"two kinds are called {name!r}: {specs[name]!r} and {kind!r}")
                specs[name] = kind
        return dict(sorted(specs.items()))

    @cached_property
    def modules(self) -> dict[str, str]:
        """Modules by the names of their kinds, sorted; in families with one kind a module, called as the module is."""
        found = pkgutil.iter_modules(importlib.import_module(self.package).__path__)
        return {name: f"{self.package}.{name}" for name in sorted(info.name for info in found if not info.ispkg)}

    def spec(self, name: str) -> Any:
        """Return the kind of a type name; imports its module alone, if that is called as the kind is.

        Raises
        ------
        KeyError: there is no such kind.
        """
        if name not in self._found:
            kinds = _kinds(self.modules[name]) if name in self.modules else ()
            self._found[name] = next((kind for kind in kinds if type_name(kind) == name), None) or self.specs()[name]
        return self._found[name]

    def adapter(self, name: str) -> TypeAdapter[Any]:
        """Return what validates mappings of a kind, with errors as those of the union of all kinds."""
        if name not in self._adapters:
            either: Any = Annotated[self.spec(name) | _OtherKind, Field(discriminator="type")]
            self._adapters[name] = TypeAdapter(either)
        return self._adapters[name]

    def specs(self) -> dict[str, Any]:
        """Return the kinds' specs by type name, sorted by it; imports every module of the package.

        Raises
        ------
        TypeError: two kinds have the same type name.
        """
        return self._specs

    def union(self) -> Any:
        """Make a type for pydantic of all kinds, discriminated by their key `type`; without kinds nothing is valid."""
        return Annotated[Any, _AnyKind(self)]

    def whole_union(self) -> Any:
        """Make the type of `union` out of the models of all kinds, for the schema."""
        specs = list(self.specs().values())
        if not specs:
            return Annotated[Spec, WithJsonSchema({"not": {}})]
        if len(specs) == 1:
            # A union of one is not a union, and takes no discriminator.
            return specs[0]
        return Annotated[reduce(or_, specs), Field(discriminator="type")]

    def union_or_name(self) -> Any:
        """Make the type of `union` in which a kind's bare name stands for a mapping of that type alone."""
        return Annotated[self.union(), _ByName(self)]

    def check_type(self, value: Any) -> Any:
        """Reject a type that names no kind of this family, in the words of YAML instead of pydantic's.

        Raises
        ------
        ValueError: there is no type, or the value is neither a mapping nor a kind of this family.
        ValidationError: no kind has this type.
        """
        if isinstance(value, Spec):
            if self._find(type_name(type(value))) is not type(value):
                raise ValueError(f"must be {with_article(self.noun)}, got {with_article(class_noun(type(value)))}")
            return value
        if not isinstance(value, Mapping):
            known = ", ".join(self.specs())
            message = f"must be a mapping with a type ({known}), got {format_value(value)}"
            if self._find(value) is not None:
                message += f"; did you mean {{type: {value}}}?"
            elif isinstance(value, str) and (reading := self._reading_files()):
                message += f"; a file is named by {{type: {reading[0]}, file: {value}}}"
            raise ValueError(message)  # noqa: TRY004
        if "type" not in value:
            raise ValueError(f"needs a type, one of {', '.join(self.specs())}")
        name = value["type"]
        if self._find(name) is None:
            close = suggest_name(str(name), self.specs(), "types")
            field_error("type", f"unknown type of {self.noun} {format_value(name)}; {close}")
        return value

    def _reading_files(self) -> list[str]:
        """Return the kinds that take a file."""
        return [name for name, spec in self.specs().items() if "file" in spec.model_fields]

    def _find(self, name: object) -> Any:
        """Return the kind of a type name; None if there is no such kind."""
        try:
            return self.spec(name) if isinstance(name, str) else None
        except KeyError:
            return None


def _kinds(module: str) -> list[type[Spec]]:
    """Import a module, and list the specs with a type name that it defines."""
    values = vars(importlib.import_module(module)).values()
    specs = (value for value in values if isinstance(value, type) and issubclass(value, Spec))
    return [spec for spec in specs if spec.__module__ == module and type_name(spec) is not None]


def type_name(spec: type[Spec]) -> str | None:
    """Return the name that a scene writes as `type` for this spec; None if the spec is not a kind."""
    field = spec.model_fields.get("type")
    if field is None or get_origin(field.annotation) is not Literal:
        return None
    names = get_args(field.annotation)
    return str(names[0]) if len(names) == 1 else None


AOVS = Family("AOV", "raytracer.kernel.aovs")
APERTURES = Family("aperture", "raytracer.plugins.apertures")
CAMERAS = Family("camera", "raytracer.plugins.cameras")
ENVIRONMENTS = Family("environment", "raytracer.plugins.environments")
FILTERS = Family("filter", "raytracer.plugins.filters")
LIGHTS = Family("light", "raytracer.plugins.lights")
MATERIALS = Family("material", "raytracer.plugins.materials")
MEDIA = Family("medium", "raytracer.plugins.media")
SHAPES = Family("shape", "raytracer.plugins.shapes")
TEXTURES = Family("texture", "raytracer.plugins.textures")
