"""Parts that return nothing, an argument or a constant are not compiled, and mean the same."""

import math

import pytest

from raytracer.core.compiler import parts
from raytracer.core.compiler.dispatch import entry, kernel, optional
from raytracer.core.compiler.parts import trivial_part

NOTHING_FITS = (math.nan, -1.0, 0.5)


@optional
def nothing(fog, light):
    """Do nothing."""


@optional
def same(fog, light):
    return light


@optional
def number(fog, light):
    """Return a number."""
    return 1.0 / 3.0


@optional
def vector(fog, light):
    return NOTHING_FITS


@optional
def answer(fog, light):
    return False


@kernel
def told(fog, light):
    if nothing(fog, light) is None and not answer(fog, light):
        return same(fog, light), number(fog, light), vector(fog, light)
    return light, 0.0, NOTHING_FITS


def ask(fog, light):
    return told(fog, light)


def test_what_is_not_compiled_gives_what_python_does(tmp_path, monkeypatch):
    # No earlier run has left its kernel here.
    monkeypatch.setattr("raytracer.core.compiler.cache.CACHE_FOLDER", tmp_path)
    before = parts.counts["lowered"]
    light, third, values = entry(ask)(None, 2.0)
    assert (light, third) == (2.0, 1.0 / 3.0)
    assert repr(values) == repr(NOTHING_FITS)
    # Of six functions that are called one is compiled.
    assert parts.counts["lowered"] == before + 1


@kernel
def doubled(light):
    return 2.0 * light


def loop(light):
    for _ in range(3):
        light *= 2.0
    return light


def more(fog, light):
    return light + 1.0


def both(fog, light):
    return fog, light


def part(fog, light):
    return light.real


@pytest.mark.parametrize(
    ("function", "trivial"),
    [
        *((function.dispatch(type(None)), True) for function in (nothing, same, number, vector, answer)),
        *((function, False) for function in (more, both, part, doubled.__wrapped__, loop)),
    ],
)
def test_functions_that_only_return_something_are_trivial_and_no_others(function, trivial):
    from numba import float64, none

    arguments = (none, float64) if function.__code__.co_argcount == 2 else (float64,)
    assert (trivial_part(function, arguments) is not None) == trivial
