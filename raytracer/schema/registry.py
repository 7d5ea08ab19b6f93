"""Registry of families of kinds: one package a family, one module a kind, found by importing the package.

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


class Family:
    """The kinds of one noun ("shape") in one package ("raytracer.plugins.shapes")."""

    def __init__(self, noun: str, package: str) -> None:
        self.noun = noun
        self.package = package

    @cached_property
    def _specs(self) -> dict[str, type[Spec]]:
        specs: dict[str, type[Spec]] = {}
        for info in pkgutil.iter_modules(importlib.import_module(self.package).__path__):
            module = importlib.import_module(f"{self.package}.{info.name}")
            for value in vars(module).values():
                if not (isinstance(value, type) and issubclass(value, Spec) and value.__module__ == module.__name__):
                    continue
                name = type_name(value)
                if name is None:
                    continue
                if name in specs:
                    raise TypeError(f"two kinds are called {name!r}: {specs[name]!r} and {value!r}")
                specs[name] = value
        return dict(sorted(specs.items()))

    def specs(self) -> dict[str, Any]:
        """Return the kinds' specs by type name, sorted by it; imports every module of the package.

        Raises
        ------
        TypeError: two kinds have the same type name.
        """
        return self._specs

    def union(self) -> Any:
        """Make a type for pydantic of all kinds, discriminated by their key `type`; without kinds nothing is valid."""
        specs = list(self.specs().values())
        if not specs:
            return Annotated[Spec, BeforeValidator(self._known_type), WithJsonSchema({"not": {}})]
        if len(specs) == 1:
            # A union of one is not a union, and takes no discriminator.
            return Annotated[specs[0], BeforeValidator(self._known_type)]
        return Annotated[reduce(or_, specs), Field(discriminator="type"), BeforeValidator(self._known_type)]

    def union_or_name(self) -> Any:
        """Make the type of `union` in which a kind's bare name stands for a mapping of that type alone."""
        return Annotated[self.union(), _ByName(self)]

    def _known_type(self, value: Any) -> Any:
        """Reject a type that names no kind of this family, in the words of YAML instead of pydantic's."""
        known = self.specs()
        if isinstance(value, Spec):
            if type(value) not in known.values():
                raise ValueError(f"must be {with_article(self.noun)}, got {with_article(class_noun(type(value)))}")
            return value
        if not isinstance(value, Mapping):
            raise ValueError(f"must be a mapping with a type ({', '.join(known)}), got {format_value(value)}")  # noqa: TRY004
        if "type" not in value:
            raise ValueError(f"needs a type, one of {', '.join(known)}")
        name = value["type"]
        if not isinstance(name, str) or name not in known:
            field_error(
                "type", f"unknown type of {self.noun} {format_value(name)}; {suggest_name(str(name), known, 'types')}"
            )
        return value


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
