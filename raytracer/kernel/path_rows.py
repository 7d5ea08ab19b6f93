"""Read and write the rows of arrays that hold a number or a vector a path, where the scene calls for them."""

import numpy as np

from raytracer.core.compiler.dispatch import kernel, optional

# Numbers of rows that come from a queue could be negative, for all that the compiler knows, and would then count from
# the end: unsigned ones need not be looked at.


@kernel
def load3(rows, row, start):
    """Read three columns of a row, from `start` on, as a vector."""
    at = np.uintp(row)
    return (rows[at, np.uintp(start)], rows[at, np.uintp(start + 1)], rows[at, np.uintp(start + 2)])


@kernel
def store3(rows, row, start, value):
    """Write a vector into three columns of a row, from `start` on."""
    at = np.uintp(row)
    rows[at, np.uintp(start)] = value[0]
    rows[at, np.uintp(start + 1)] = value[1]
    rows[at, np.uintp(start + 2)] = value[2]


@optional
def load_number(rows, row):
    """Read the number of a row; None where there are no rows."""


@load_number.register(np.ndarray)
def load_number_array(rows, row):
    return rows[np.uintp(row)]


@optional
def load_vector_row(rows, row):
    """Read the vector of a row; None where there are no rows."""


@load_vector_row.register(np.ndarray)
def load_vector_row_array(rows, row):
    return load3(rows, row, 0)


@optional
def store_number(rows, row, value):
    """Write a number into a row, if there are rows."""


@store_number.register(np.ndarray)
def store_number_array(rows, row, value):
    rows[np.uintp(row)] = value


@optional
def store_vector_row(rows, row, value):
    """Write a vector into a row, if there are rows."""


@store_vector_row.register(np.ndarray)
def store_vector_row_array(rows, row, value):
    store3(rows, row, 0, value)
