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


class NoFog(NamedTuple):
    """A fog that is none."""


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


@overridable
def corners(shape, scale):
    return 4.0 * scale


@corners.register(Circle)
def corners_circle(shape, scale):
    return 0.0


@optional(NoFog)
def dimmed(fog, light):
    """Dim a light."""
    return light


@dimmed.register(Circle)
def dimmed_circle(fog, light):
    return light / fog.radius


@optional
def count(fog, rows):
    """Count in the first row."""


@count.register(Circle)
def count_circle(fog, rows):
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
    return twice(area(shape, factor)), corners(shape, factor)


@entry
def call_dimmed(fog, light, rows):
    count(fog, rows)
    return dimmed(fog, light)


@entry
def call_switch(tables, which, index):
    return first_row_any(tables, which, index)


@pytest.mark.parametrize(
    ("shape", "wanted", "angles"), [(Square(2.0), 4.0, 4.0), (Circle(2.0), 12.0, 0.0), (None, -1.0, 4.0)]
)
def test_cases_are_chosen_by_class_from_python_and_from_kernels(shape, wanted, angles):
    assert (area(shape, 1.0), corners(shape, 1.0)) == (wanted, angles)
    assert call_area(shape, 1.0) == (2.0 * wanted, angles)


@pytest.mark.parametrize(("fog", "wanted", "counted"), [(None, 6.0, 0.0), (NoFog(), 6.0, 0.0), (Circle(2.0), 3.0, 1.0)])
def test_the_body_of_an_optional_function_is_what_is_done_without_it(fog, wanted, counted):
    assert dimmed(fog, 6.0) == wanted
    if not isinstance(fog, NoFog):
        rows = np.zeros(2)
        assert call_dimmed(fog, 6.0, rows) == wanted
        count(fog, rows[1:])
        assert rows.tolist() == [counted, counted]


def test_what_nobody_registered_has_no_case():
    for function in (area, dimmed):
        with pytest.raises(NotImplementedError):
            function(Table(1.0), 1.0)
    with pytest.raises(TypingError):
        call_area((1.0, 2.0), 1.0)
    with pytest.raises(TypingError):
        call_dimmed(Square(1.0), 6.0, np.zeros(1))


@pytest.mark.parametrize("length", [1, 2, 3])
def test_switch_picks_a_table_at_run_time(length):
    tables = (Table(np.arange(3.0)), OtherTable(np.arange(3.0), 10.0), Table(np.arange(3.0) + 100.0))[:length]
    for which, expected in enumerate([2.0, 20.0, 102.0][:length]):
        assert call_switch(tables, which, 2) == first_row_any(tables, which, 2) == expected


def test_kernels_release_the_interpreter_and_divide_as_numpy_does():
    @entry
    def divide(a, b):
        return a / b

    assert not machine_code._FUNCTION._flags_ & ctypes.PYFUNCTYPE(None)._flags_ & ~ctypes.CFUNCTYPE(None)._flags_
    assert divide(1.0, 0.0) == np.inf
    assert np.isnan(divide(0.0, 0.0))
