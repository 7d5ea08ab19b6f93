"""Rules between keys: where they hold, which key their errors point at, and the order of several."""

import pytest
from pydantic import ValidationError, model_validator

from raytracer.schema.rules import exclusive, never, only, requires, some_of, together
from raytracer.schema.spec import Spec, field_error
from raytracer.schema.validation_errors import error_sentence


class Keys(Spec):
    """A mapping of some keys without rules."""

    a: int | None = None
    b: int | None = None
    c: int | None = None
    mode: str = "plain"
    size: float = 1.0


def error_of(spec, **keys):
    """Return the place and the sentence of the first error; None if there is none."""
    try:
        spec.model_validate(keys)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        return first["loc"], error_sentence(first)
    return None


def test_exclusive_points_at_the_second_key_in_the_order_of_the_rule():
    class Sized(Keys):
        _one = exclusive("a", "b", "c", sets="the size")

    assert error_of(Sized) is error_of(Sized, b=1) is error_of(Sized, a=None, b=1) is None
    assert error_of(Sized, c=1, b=1) == (("c",), "b and c both set the size: give one of them")
    # Zero is given, and null is not.
    assert error_of(Sized, c=1, b=0, a=0) == (("b",), "a and b both set the size: give one of them")


@pytest.mark.parametrize("where", ["a", {"mode": "wide"}, lambda keys: keys.c == 3])
def test_conditions(where):
    class Only(Keys):
        _size = only("size", where=where, message="{key} of {spec.mode}")

    class Never(Keys):
        _size = never("size", where=where, message="{key} of {spec.mode}")

    class Requires(Keys):
        _size = requires("size", where=where, message="is missing")

    holding = {"a": 0, "mode": "wide", "c": 3}
    assert error_of(Only) is error_of(Never) is error_of(Requires) is None
    assert error_of(Only, **holding) is error_of(Never, **holding) is error_of(Only, size=1.0, **holding) is None
    assert error_of(Only, size=1.0) == (("size",), "size of plain")
    assert error_of(Never, size=1.0, **holding) == (("size",), "size of wide")
    assert error_of(Never, size=1.0) is error_of(Requires, size=1.0) is None
    assert error_of(Requires, size=1.0, **holding) is None
    assert error_of(Requires, **holding) == (("size",), "is missing")


def test_conditions_are_asked_only_about_keys_that_are_given():
    class Even(Keys):
        _even = only("a", where=lambda keys: keys.a % 2 == 0, message="must be even")

    assert error_of(Even) is error_of(Even, a=2) is None
    assert error_of(Even, a=1) == (("a",), "must be even")


def test_some_of_is_about_the_mapping():
    class One(Keys):
        _one = some_of("a", "b", most=1, message="needs a or b")

    class Some(Keys):
        _any = some_of("a", "b", message="needs a or b")

    assert error_of(One, a=1) is error_of(Some, a=1) is error_of(Some, a=1, b=1) is None
    assert error_of(One) == error_of(One, a=1, b=1) == error_of(Some) == ((), "needs a or b")


def test_together_points_at_what_is_missing():
    class Pair(Keys):
        _pair = together("a", "b", message="is missing")

    assert error_of(Pair) is error_of(Pair, a=1, b=1) is None
    assert error_of(Pair, a=1) == (("b",), "is missing")
    assert error_of(Pair, b=1) == (("a",), "is missing")


def test_rules_and_validators_are_checked_in_their_order_and_inherited():
    class First(Keys):
        _one = exclusive("a", "b", message="first")

        @model_validator(mode="after")
        def _second(self):
            if self.a is not None:
                field_error("a", "second")
            return self

        _third = never("a", where=lambda keys: True, message="third")

    class Last(First):
        _last = never("c", where=lambda keys: True, message="last")

    assert error_of(Last, a=1, b=1, c=1) == (("b",), "first")
    assert error_of(Last, a=1, c=1) == (("a",), "second")
    assert error_of(Last, c=1) == (("c",), "last")
