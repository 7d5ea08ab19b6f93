"""The base class of all specs: a checked mapping of a scene file, declared as a pydantic model.

A kind declares its keys as fields, annotated with the types of `fields.py`, which have units and ranges; it gets from
them the validation, the error messages and the documentation (JSON Schema).  A field of several values is a tuple:

    class Sphere(ObjectSpec):
        type: Literal["sphere"] = "sphere"
        center: Point = Field(description="centre")
        radius: NonZeroLength = Field(description="radius; negative turns the normal inwards")

Which keys go together is declared by the functions of `rules.py`.  Other checks across keys are
`@model_validator(mode="after")` that raise ValueError with a sentence; `field_error("key", message)` raises one that
points at a key of the mapping.
"""

import itertools
from collections.abc import Mapping
from typing import Any, ClassVar, Never, Self

from pydantic import BaseModel, ConfigDict, ModelWrapValidatorHandler, ValidatorFunctionWrapHandler, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError

from raytracer.schema.validation_errors import error_sentence
from raytracer.util.errors import format_value, one_line, suggest_name

_MAX_UNKNOWN_KEYS = 16
"""Unknown keys of a mapping for which a known one is suggested: the message shows one of the first."""

_MAX_ITEMS_LOOKED_AT = 1000
"""Items of a list that are looked at once one was wrong."""


def field_error(key: str | int | tuple[str | int, ...], message: str) -> Never:
    """Raise, from a model validator, an error that points at `key` of the mapping or at a path below it."""
    path = key if isinstance(key, tuple) else (key,)
    raise ValidationError.from_exception_data("spec", [_error(path, message)])


def _error(path: tuple[str | int, ...], message: str) -> InitErrorDetails:
    # pydantic takes no half characters, which a message may quote.
    error = PydanticCustomError("spec", "{message}", {"message": one_line(message)})
    return InitErrorDetails(type=error, loc=path, input=None)


def first_errors(items: Any, validate: ValidatorFunctionWrapHandler) -> Any:
    """Validate a list whose validator stops at the first wrong item; report the next ones that are wrong as well.

    A list may hold a million items, each of which takes a tenth of a millisecond to be found wrong.
    """
    try:
        return validate(items)
    except ValidationError as error:
        place = error.errors(include_url=False)[0]["loc"]
        if not place:
            raise
        errors: list[InitErrorDetails] = []
        start = int(place[0])
        for number, item in enumerate(items[start : start + _MAX_ITEMS_LOOKED_AT], start):
            try:
                validate((item,))
            except ValidationError as found:
                errors += (
                    _error((number, *one["loc"][1:]), error_sentence(one)) for one in found.errors(include_url=False)
                )
        raise ValidationError.from_exception_data("list", errors) from None


def class_noun(cls: type[BaseModel]) -> str:
    """Return the noun of a mapping of this class in messages: its `type`, or the class name in lower case."""
    field = cls.model_fields.get("type")
    return str(field.default) if field and isinstance(field.default, str) else cls.__name__.removesuffix("Spec").lower()


def with_article(noun: str) -> str:
    """Put the indefinite article before a noun."""
    return f"an {noun}" if noun[0] in "aeiouAEIOU" else f"a {noun}"


class Spec(BaseModel):
    """A checked mapping of the scene file: unknown keys are errors, values are never coerced, instances are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)

    loads: ClassVar[Mapping[str, str]] = {}
    """Keys that name files, relative to the scene, and the asset kind that each is read as."""

    def files(self) -> dict[tuple[str | int, ...], tuple[str, str]]:
        """Return the files that it names: by path of keys, the name and the asset kind that it is read as."""
        given = ((key, getattr(self, key), kind) for key, kind in self.loads.items())
        return {(key,): (name, kind) for key, name, kind in given if name is not None}

    @classmethod
    def own_keys_first(cls) -> list[str]:
        """Return its keys, with those that all mappings of its family share at the end."""
        keys = (key for base in cls.__mro__ for key in vars(base).get("__annotations__", ()))
        return [key for key in dict.fromkeys(keys) if key in cls.model_fields]

    @model_validator(mode="wrap")
    @classmethod
    def _known_keys_only(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(data, cls):
            return data
        if not isinstance(data, Mapping):
            given = with_article(class_noun(type(data))) if isinstance(data, Spec) else format_value(data)
            raise ValueError(f"must be a mapping ({', '.join(cls.model_fields)}), got {given}")  # noqa: TRY004

        # Lists of YAML become tuples, since specs are immutable.
        known = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items() if k in cls.model_fields}
        if len(known) == len(data):
            return handler(known)

        # Report unknown keys with the other errors, but no missing key: that is probably the misspelt one.
        noun = class_noun(cls)
        errors = [
            _error(
                (key,),
                f"unknown key {format_value(key)} of {noun}; {cls._meant(str(key), data[key])}",
            )
            for key in itertools.islice((key for key in data if key not in known), _MAX_UNKNOWN_KEYS)
        ]
        try:
            handler(known)
        except ValidationError as error:
            errors += [
                _error(item["loc"], error_sentence(item))
                for item in error.errors(include_url=False)
                if not (item["type"] == "missing" and len(item["loc"]) == 1)
            ]
        raise ValidationError.from_exception_data(cls.__name__, errors)

    @classmethod
    def _meant(cls, key: str, value: Any) -> str:
        """End a sentence about an unknown key."""
        if key.isdecimal() and value is None:
            return "a comma separates keys, and the decimal point is a point"
        if ":" in key and value is None:
            return f"a space goes after the colon: `{key.replace(':', ': ', 1)}`"
        return suggest_name(key, cls.own_keys_first(), "keys")
