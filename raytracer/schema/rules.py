"""Rules between the keys of a mapping, declared beside the fields of its spec:

    class Pinhole(PerspectiveSpec):
        _one_hole = exclusive("diameter", "f_number", sets="the size of the hole")

They are checked in their order, with pydantic's own validators between them.  A message may name the `{key}` that it is
about, the `{first}` key given, and what the `{spec}` holds.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from pydantic import model_validator

from raytracer.schema.spec import Spec, field_error

Condition: TypeAlias = str | Mapping[str, object] | Callable[[Any], bool]
"""A key that is given, keys with the values that they have, or a function of the spec."""


def _rule(keys: Sequence[str], wrong: Callable[[Spec, list[str]], Sequence[str]], message: str) -> object:
    """Make a validator that refuses the first key that a function of the spec, and of the keys given, finds wrong."""

    def check(spec: Spec) -> Spec:
        given = [key for key in keys if _is_given(spec, key)]
        for key in wrong(spec, given):
            field_error(key, message.format(key=key, first=given[0] if given else key, spec=spec))
        return spec

    return model_validator(mode="after")(check)


def _is_given(spec: Spec, key: str) -> bool:
    return key in spec.model_fields_set and getattr(spec, key) is not None


def _holds(condition: Condition, spec: Spec) -> bool:
    if isinstance(condition, str):
        return _is_given(spec, condition)
    if isinstance(condition, Mapping):
        return all(getattr(spec, key) == value for key, value in condition.items())
    return condition(spec)


def exclusive(
    *keys: str, sets: str = "", message: str = "{first} and {key} both set {sets}: give one of them"
) -> object:
    """Allow one of some keys at most; the message is about the second one given."""
    return _rule(keys, lambda spec, given: given[1:], message.replace("{sets}", sets))


def only(*keys: str, where: Condition, message: str) -> object:
    """Allow keys only where a condition holds."""
    return _rule(keys, lambda spec, given: [] if not given or _holds(where, spec) else given, message)


def never(*keys: str, where: Condition, message: str) -> object:
    """Allow keys only where a condition does not hold."""
    return only(*keys, where=lambda spec: not _holds(where, spec), message=message)


def requires(*keys: str, where: Condition, message: str) -> object:
    """Require keys where a condition holds; the message is about the first that is missing."""
    return _rule(
        keys, lambda spec, given: [key for key in keys if key not in given] if _holds(where, spec) else [], message
    )


def together(*keys: str, message: str) -> object:
    """Require all of some keys or none; the message is about the first that is missing."""
    return _rule(keys, lambda spec, given: [key for key in keys if key not in given] if given else [], message)


def some_of(*keys: str, message: str, most: int | None = None) -> object:
    """Require one of some keys, and `most` at most; the message is about the mapping."""

    def check(spec: Spec) -> Spec:
        if not 1 <= sum(_is_given(spec, key) for key in keys) <= (most or len(keys)):
            raise ValueError(message)
        return spec

    return model_validator(mode="after")(check)
