"""Entries: what Python calls, loaded from the cache without the compiler."""

import enum
import os
import runpy
import subprocess
import sys
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from raytracer.core.compiler import build_entry, cache, machine_code
from raytracer.core.compiler.dispatch import entry
from raytracer.core.compiler.entry import needs_compiling
from raytracer.core.compiler.machine_code import MachineCode, pack_argument, stable_text


class Pair(NamedTuple):
    left: Any
    right: Any


class OtherPair(NamedTuple):
    left: Any
    right: Any


class Order(enum.IntEnum):
    FIRST = 1


FIXED = np.zeros(3)
FIXED.flags.writeable = False
VALUES = (
    *(None, True, 1, 2**63, 1.5, np.float32(1.5), np.int32(1), np.uint8(1), np.int64(1), np.float64(1.0), Order.FIRST),
    *(
        np.bool_(True),
        (),
        (1,),
        (1, 2),
        (1, 2.0),
        (1.0, 2.0),
        Pair(1, 2),
        Pair(1.0, 2),
        OtherPair(1, 2),
        ((1, 2), None),
    ),
    *(np.zeros(3), np.zeros(3, np.float32), np.zeros((3, 3)), np.zeros((3, 3)).T, np.asfortranarray(np.zeros((3, 2)))),
    *(np.zeros((4, 4))[::2, ::2], FIXED, np.zeros(2, [("a", "f8"), ("b", "i4")]), np.zeros(2, [("c", "f8")])),
)


def test_types_of_arguments_are_those_that_numba_tells_apart():
    for first in VALUES:
        for second in VALUES:
            same = numba.typeof(first) == numba.typeof(second)
            assert (pack_argument(first).kind == pack_argument(second).kind) == same, (first, second)
            stable = stable_text(pack_argument(first).kind) == stable_text(pack_argument(second).kind)
            assert stable == same, (first, second)


def test_what_a_kernel_cannot_take_is_said():
    with pytest.raises(TypeError, match="a kernel takes numbers, arrays and tuples of them, not str"):
        pack_argument((1, "x"))


@entry
def total(numbers, flags, rows, nested):
    """Sum everything, by the place where it stands."""
    result = 10.0 * numbers.left + 100.0 * numbers.right
    if flags[0]:
        result += 1000.0
    if flags[1]:
        result += 1e9
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            result += 1e4 * (i + 1) * (j + 2) * rows[i, j]
    return result + nested[0][0] + 0.5 * nested[1][1]


@pytest.mark.parametrize("layout", [np.array, np.asfortranarray, lambda rows: np.repeat(rows, 2, axis=1)[:, ::2]])
def test_arguments_arrive_where_they_belong(layout):
    rows = layout(np.arange(6.0).reshape(2, 3))
    arguments = Pair(3, np.float32(0.5)), (True, np.bool_(False)), rows, ((np.int8(-7), None), (None, np.uint16(8)))
    assert total(*arguments) == total.__wrapped__(*arguments)


def test_what_is_in_memory_or_on_disk_needs_no_compiling(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "CACHE_FOLDER", tmp_path / "kernels")
    arguments = Pair(3, 0.5), (True, False), np.ones((1, 1)), ((1, None), (None, 1))
    monkeypatch.setattr(total, "_codes", {})
    assert needs_compiling(total, *arguments)
    total(*arguments)
    assert not needs_compiling(total, *arguments)
    monkeypatch.setattr(total, "_codes", {})
    assert not needs_compiling(total, *arguments)
    # Of other types.
    assert needs_compiling(total, *arguments[:2], np.ones((1, 1), np.float32), arguments[3])
    # What is not compiled at all.
    assert not needs_compiling(total.__wrapped__, *arguments)


def test_results_are_what_the_function_returns():
    @entry
    def everything(x):
        return (int(x), x, x > 1.0, None, Pair((x, -3), ()))

    result = everything(2.5)
    assert result == (2, 2.5, True, None, Pair((2.5, -3), ()))
    assert [type(item) for item in result] == [int, float, bool, type(None), Pair]


def test_a_tuple_is_packed_once_and_its_arrays_are_read_anew(tmp_path):
    @entry
    def first(rows, scale, nothing, more):
        return scale * rows[0][0] + len(nothing) + len(more[1])

    rows, more = (np.ones(2),), ((), (2.0, (), None))
    assert first(rows, 2.0, *more) == 2.0
    rows[0][0] = 5.0
    assert first(rows, 3.0, *more) == 15.0
    # Files in memory are arrays, too.
    mapped = np.memmap(tmp_path / "rows", dtype=np.float64, mode="w+", shape=(2,))
    mapped[0] = 7.0
    assert first((mapped,), 1.0, *more) == 7.0
    assert first((np.full(2, 7, np.int32),), 1.0, *more) == 7.0
    assert len(first.signatures) == 2


def test_another_layout_of_arguments_is_an_error(monkeypatch):
    @entry
    def first(rows):
        return rows[0]

    monkeypatch.setattr(build_entry, "pack_argument", lambda value: pack_argument((value, 1)))
    with pytest.raises(RuntimeError, match=r"arguments are 8 words, and Numba .* takes 7"):
        first(np.ones(2))


def test_an_error_within_a_kernel_is_an_error():
    @entry
    def refuse(x):
        if x > 1.0:
            raise ValueError
        return x

    assert refuse(0.5) == 0.5
    with pytest.raises(RuntimeError, match="a kernel ended with status"):
        refuse(2.0)


def test_code_that_calls_what_is_not_there_is_not_linked():
    # LLVM would end the process.
    code = MachineCode("call", 0, machine_code.Result("", None), ("no_library_has_this",), b"")
    assert machine_code.load(code) is None


def test_types_of_a_function_have_no_place_in_the_cache():
    class Local(NamedTuple):
        x: float

    assert stable_text(pack_argument(Local(1.0)).kind) is None
    assert stable_text(pack_argument((1, Pair(None, 2.0))).kind) is not None


_PROGRAM = """
import sys
import numpy as np
from raytracer.core.compiler.dispatch import entry
from raytracer.core.simd import WIDTH, load, store
from raytracer.core.vec import dot

@entry
def program(rows, out):
    store(out, 0, 2.0 * load(rows, 0))
    return dot((rows[0, 0], rows[0, 1], 0.0), (1.0, 2.0, 3.0))

rows, out = np.arange(1.0, WIDTH + 1.0).reshape(1, WIDTH), np.empty((1, WIDTH))
print(program(rows, out), out.sum(), program.counts["loaded"], "numba" in sys.modules)
"""


def test_a_kernel_from_the_cache_needs_no_compiler(tmp_path, monkeypatch, capsys):
    path = tmp_path / "program.py"
    path.write_text(_PROGRAM)
    monkeypatch.setenv("RAYTRACER_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(tmp_path / "key"))
    monkeypatch.setattr(cache, "CACHE_FOLDER", cache._make_cache_folder())
    runpy.run_path(str(path), run_name="__main__")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    again = subprocess.run([sys.executable, path], capture_output=True, text=True, check=True, env=environment).stdout
    assert [capsys.readouterr().out, again] == ["5.0 72.0 0 True\n", "5.0 72.0 1 False\n"]
