"""Families of kinds: one package a family, one module a kind, found by looking.

A kind's module defines a `Spec` with `type: Literal["its name"]`; that name is what a scene file writes.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cached_property, reduce
from operator import or_
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BeforeValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, WithJsonSchema
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.errors import shown, suggestion
from raytracer.spec import Spec, a_noun, at, class_noun


class _ByName:
    """Annotation of a family's union: a kind's bare name stands for a mapping of that type."""

    def __init__(self, family: "Family") -> None:
        self._family = family

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(
            lambda value: {"type": value} if isinstance(value, str) else value, handler(source)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"enum": list(self._family.specs())}, handler(schema)]}


class Family:
    """The kinds of one noun ("shape") in one package ("raytracer.shapes")."""

    def __init__(self, noun: str, package: str) -> None:
        self.noun = noun
        self.package = package

    @cached_property
    def _specs(self) -> dict[str, type[Spec]]:
        found: dict[str, type[Spec]] = {}
        for info in pkgutil.iter_modules(importlib.import_module(self.package).__path__):
            module = importlib.import_module(f"{self.package}.{info.name}")
            for value in vars(module).values():
                if not (isinstance(value, type) and issubclass(value, Spec) and value.__module__ == module.__name__):
                    continue
                name = type_name(value)
                if name is None:
                    continue
                if name in found:
                    raise TypeError(f"two kinds are called {name!r}: {found[name]!r} and {value!r}")
                found[name] = value
        return dict(sorted(found.items()))

    def specs(self) -> dict[str, Any]:
        """The kinds' specs by type name, sorted by it; imports every module of the package.

        Raises
        ------
        TypeError: two kinds have the same type name.
        """
        return self._specs

    def union(self) -> Any:
        """The kinds as a type for pydantic, told apart by their key `type`; of a family without kinds none is valid."""
        specs = list(self.specs().values())
        if not specs:
            return Annotated[Spec, BeforeValidator(self._known_type), WithJsonSchema({"not": {}})]
        if len(specs) == 1:
            # A union of one is not a union, and takes no discriminator.
            return Annotated[specs[0], BeforeValidator(self._known_type)]
        return Annotated[reduce(or_, specs), Field(discriminator="type"), BeforeValidator(self._known_type)]

    def union_or_name(self) -> Any:
        """As `union`; a kind's bare name stands for a mapping of that type alone."""
        return Annotated[self.union(), _ByName(self)]

    def _known_type(self, value: Any) -> Any:
        """Refuse what names no kind of this family, before pydantic does in its own words."""
        known = self.specs()
        if isinstance(value, Spec):
            if type(value) not in known.values():
                raise ValueError(f"must be {a_noun(self.noun)}, got {a_noun(class_noun(type(value)))}")
            return value
        if not isinstance(value, Mapping):
            raise ValueError(f"must be a mapping with a type ({', '.join(known)}), got {shown(value)}")  # noqa: TRY004
        if "type" not in value:
            raise ValueError(f"needs a type, one of {', '.join(known)}")
        name = value["type"]
        if not isinstance(name, str) or name not in known:
            at("type", f"unknown type of {self.noun} {shown(name)}; {suggestion(str(name), known, 'types')}")
        return value


def type_name(spec: type[Spec]) -> str | None:
    """What a scene writes as `type` for this spec; None where the spec is not a kind."""
    field = spec.model_fields.get("type")
    if field is None or get_origin(field.annotation) is not Literal:
        return None
    names = get_args(field.annotation)
    return str(names[0]) if len(names) == 1 else None


AOVS = Family("AOV", "raytracer.aovs")
APERTURES = Family("aperture", "raytracer.apertures")
CAMERAS = Family("camera", "raytracer.cameras")
ENVIRONMENTS = Family("environment", "raytracer.environments")
FILTERS = Family("filter", "raytracer.filters")
LIGHTS = Family("light", "raytracer.lights")
MATERIALS = Family("material", "raytracer.materials")
MEDIA = Family("medium", "raytracer.media")
SHAPES = Family("shape", "raytracer.shapes")
TEXTURES = Family("texture", "raytracer.textures")
