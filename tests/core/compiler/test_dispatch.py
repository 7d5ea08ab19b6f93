"""Dispatch by type."""

import ctypes
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from raytracer.core.compiler import machine_code
from raytracer.core.compiler.dispatch import entry, generic, kernel, optional, overridable, switch


class Square(NamedTuple):
    side: float


class Circle(NamedTuple):
    radius: float


class Table(NamedTuple):
    rows: Any


class OtherTable(NamedTuple):
    rows: Any
    scale: float


@generic
def area(shape, factor):
    """Area times a factor."""
    raise NotImplementedError


@area.register(Square)
def area_square(shape, factor):
    return factor * shape.side * shape.side


@area.register(Circle)
def area_circle(shape, factor):
    return factor * 3.0 * shape.radius * shape.radius


@area.register(type(None))
def area_none(shape, factor):
    return -factor


class Fog(NamedTuple):
    density: float


class NoFog(NamedTuple):
    """A fog that is none."""


class Haze(NamedTuple):
    density: float


@optional(NoFog)
def dimmed(fog, light):
    """Dim a light."""
    return light


@dimmed.register(Fog)
def dimmed_fog(fog, light):
    return light / fog.density


@optional
def count(fog, rows):
    """Count in the first row."""


@count.register(Fog)
def count_fog(fog, rows):
    rows[0] += 1.0


@generic
def first_row(table, index):
    raise NotImplementedError


@first_row.register(Table)
def first_row_table(table, index):
    return table.rows[index]


@first_row.register(OtherTable)
def first_row_other_table(table, index):
    return table.scale * table.rows[index]


first_row_any = switch(first_row)


@kernel
def twice(x):
    return 2.0 * x


@entry
def call_area(shape, factor):
    return twice(area(shape, factor))


@entry
def call_dimmed(fog, light, rows):
    count(fog, rows)
    return dimmed(fog, light)


@entry
def call_switch(tables, which, index):
    return first_row_any(tables, which, index)


@overridable
def corners(shape, scale):
    return 4.0 * scale


@corners.register(Circle)
def corners_circle(shape, scale):
    return 0.0


@entry
def call_corners(shape, scale):
    return corners(shape, scale)


@pytest.mark.parametrize(("shape", "expected"), [(Square(2.0), 4.0), (Circle(2.0), 12.0), (None, -1.0)])
def test_generic_chooses_by_class_from_python_and_from_kernels(shape, expected):
    assert area(shape, 1.0) == expected
    assert call_area(shape, 1.0) == 2.0 * expected


@pytest.mark.parametrize(("shape", "expected"), [(Square(2.0), 4.0), (Circle(2.0), 0.0)])
def test_overridable_is_its_own_case_for_all_others(shape, expected):
    assert corners(shape, 1.0) == call_corners(shape, 1.0) == expected


def test_generic_without_a_case_says_so():
    with pytest.raises(NotImplementedError):
        area(3.0, 1.0)
    with pytest.raises(TypingError):
        call_area((1.0, 2.0), 1.0)


def test_kernels_can_be_called_from_python():
    assert twice(1.5) == 3.0
    assert twice.__name__ == "twice"


@pytest.mark.parametrize("count", [1, 2, 3])
def test_switch_picks_a_table_at_run_time(count):
    tables = (Table(np.arange(3.0)), OtherTable(np.arange(3.0), 10.0), Table(np.arange(3.0) + 100.0))[:count]
    for which in range(count):
        expected = [2.0, 20.0, 102.0][which]
        assert call_switch(tables, which, 2) == expected
        assert first_row_any(tables, which, 2) == expected


def test_kernels_release_the_interpreter_and_divide_as_numpy_does():
    @entry
    def divide(a, b):
        return a / b

    assert not machine_code._FUNCTION._flags_ & ctypes.PYFUNCTYPE(None)._flags_ & ~ctypes.CFUNCTYPE(None)._flags_
    assert divide(1.0, 0.0) == np.inf
    assert np.isnan(divide(0.0, 0.0))


@pytest.mark.parametrize(("fog", "wanted", "counted"), [(None, 6.0, 0.0), (NoFog(), 6.0, 0.0), (Fog(2.0), 3.0, 1.0)])
def test_the_body_of_an_optional_function_is_what_is_done_without_it(fog, wanted, counted):
    rows = np.zeros(1)
    if not isinstance(fog, NoFog):
        assert call_dimmed(fog, 6.0, rows) == wanted
        assert rows[0] == counted
        rows[0] = 0.0
        count(fog, rows)
        assert rows[0] == counted
    assert dimmed(fog, 6.0) == wanted


def test_an_optional_function_has_no_case_for_what_nobody_registered():
    with pytest.raises(NotImplementedError):
        dimmed(Haze(1.0), 6.0)
    with pytest.raises(TypingError):
        call_dimmed(Haze(1.0), 6.0, np.zeros(1))
