"""Parts of kernels: compiled for types, and kept on disk for other kernels."""

import json
import math
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import types
from numba.core.errors import NumbaError

from raytracer.core.compiler import part_cache, parts
from raytracer.core.compiler.dispatch import entry, kernel, optional
from raytracer.core.compiler.kernel_files import _signed_header
from raytracer.core.compiler.part_cache import part_key
from raytracer.core.compiler.parts import trivial_part
from raytracer.core.compiler.signing_key import KEY_BYTES, signing_key

_PROGRAM = """
import json
from raytracer.core.compiler.dispatch import entry
from raytracer.core.compiler.parts import counts
from raytracer.core.vec import cross, dot, max_component, normalize

@entry
def program(a, b, scale):
    return scale * dot(normalize(cross(a, b)), b) + max_component(a)

result = program((1.0, 2.0, 3.0), (0.5, -1.0, 2.0), {scale})
print(json.dumps([result, counts["lowered"], counts["loaded"]]))
"""


_CALLED = ("cross", "normalize", "dot", "max_component")


def _run(folder, scale=0.0, cache="cache"):
    """Run a program whose own kernel is new, and return its result and how many parts it lowered and loaded."""
    path = folder / f"program_{scale}.py"
    path.write_text(_PROGRAM.format(scale=scale))
    # The kernel's own file is of no use to the next run.
    for kept in (folder / "cache").rglob("*.nbc"):
        kept.unlink()
    own = {"RAYTRACER_CACHE_DIR": str(folder / cache), "RAYTRACER_KEY_DIR": str(folder / "key")}
    done = subprocess.run([sys.executable, str(path)], stdout=subprocess.PIPE, check=True, env={**os.environ, **own})
    return tuple(json.loads(done.stdout))


def _parts(folder):
    return sorted((folder / "cache").rglob("*.part"))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with the parts of a program, and what its run returned; each test leaves it complete."""
    folder = tmp_path_factory.mktemp("parts")
    return folder, _run(folder)


def test_parts_of_one_process_are_loaded_by_another(made):
    folder, (result, lowered, loaded) = made
    assert lowered > len(_CALLED)
    assert loaded == 0
    # For another kernel that calls the same.  What these call need not be typed, nor the `max` of Numba's own.
    assert _run(folder, 2.0) == (pytest.approx(result), 0, len(_CALLED))


class _Mark:
    """Leaves a file where it was unpickled."""

    def __init__(self, path):
        self._path = path

    def __reduce__(self):
        return Path.touch, (self._path,)


def test_damaged_and_forged_parts_are_not_run_but_compiled_again(made, tmp_path):
    folder, first = made
    parts, mark = _parts(folder), pickle.dumps(_Mark(tmp_path / "mark"))
    for number, path in enumerate(parts):
        content = path.read_bytes()
        flipped = content[:-9] + bytes([content[-9] ^ 1]) + content[-8:]
        forged = _signed_header(path, mark, b"\1" * KEY_BYTES) + mark
        path.write_bytes((flipped, content[: len(content) // 2], b"", forged)[number % 4])
    assert len(parts) >= 4
    assert _run(folder) == first
    assert not (tmp_path / "mark").exists()
    secret = signing_key(folder / "key")
    for path in parts:
        header = _signed_header(path, mark, secret)
        content = path.read_bytes()
        assert content[: len(header)] == _signed_header(path, content[len(header) :], secret) != header


@pytest.mark.parametrize("gone", [0, 1])
def test_a_part_that_lacks_what_it_calls_is_compiled_again(made, gone):
    folder, (result, lowered, _) = made
    parts = _parts(folder)
    for path in parts[gone::2]:
        path.unlink()
    again, compiled, _ = _run(folder)
    assert again == result
    assert 0 < compiled <= lowered
    assert _parts(folder) == parts


def test_parts_in_a_folder_that_cannot_be_written_are_compiled_each_time(made):
    folder, first = made
    (folder / "file").touch()
    assert _run(folder, cache="file/cache") == first


def _closure(value):
    return lambda x: value


def _plus(x):
    return x + 1.0


def _minus(x):
    return x - 1.0


@pytest.fixture
def as_sources(monkeypatch):
    """Take this module for one of those that the name of the cache's folder hashes."""
    monkeypatch.setattr(part_cache, "_PREFIXES", (f"{__name__}.", "elsewhere."))
    part_cache._type.cache_clear()
    yield
    part_cache._type.cache_clear()


@pytest.mark.usefixtures("as_sources")
def test_parts_with_other_closures_have_other_keys():
    closed = (1, 1.0, True, None, "one", (1, 2), _plus, _minus, _closure(_plus), _closure(_minus))
    keys = [part_key(_closure(value), (types.float64,), inline=True) for value in closed]
    assert None not in keys
    assert len(set(keys)) == len(closed)
    assert keys == [part_key(_closure(value), (types.float64,), inline=True) for value in closed]


@pytest.mark.usefixtures("as_sources")
def test_parts_with_other_types_or_options_have_other_keys():
    class Local(NamedTuple):
        x: float

    here, there = _Pair, NamedTuple("_Pair", [("x", float), ("y", float)])
    there.__module__ = "elsewhere"
    number, tuples = types.float64, types.NamedUniTuple
    arrays = (types.Array(number, 2, "C"), types.Array(number, 2, "A"), types.Array(number, 2, "C", readonly=True))
    plain = (number, types.int64, types.literal(1), types.literal(2), types.none)
    pairs = (types.UniTuple(number, 2), types.StarArgTuple.from_types([number] * 2), tuples(number, 2, here))
    seen = [*plain, *pairs, tuples(number, 2, there), *arrays]
    keys = [part_key(_plus, (seen_type,), inline=inline) for seen_type in seen for inline in (True, False)]
    assert None not in keys
    assert len(set(keys)) == len(keys)
    assert part_key(_plus, (types.NamedUniTuple(types.float64, 1, Local),), inline=True) is None


class _Pair(NamedTuple):
    x: float
    y: float


def test_functions_and_classes_outside_the_hashed_sources_have_no_keys():
    from raytracer.core.vec import dot

    assert part_key(dot, (types.float64,), inline=True) is not None
    assert part_key(_plus, (types.float64,), inline=True) is None
    assert part_key(dot, (types.NamedUniTuple(types.float64, 2, _Pair),), inline=True) is None
    assert part_key(dot, (types.Dispatcher(numba.njit(_plus)),), inline=True) is None


def test_kernels_of_one_name_do_not_collide():
    def times(factor):
        @kernel
        def scaled(x):
            return factor * x

        @entry
        def call(x):
            return scaled(x)

        return call

    assert [times(factor)(2.0) for factor in (1.0, 3.0, 5.0)] == [2.0, 6.0, 10.0]


def test_kernels_take_defaults_and_tuples_of_arguments():
    @kernel
    def added(x, y=10.0, *rest):
        return x + y + len(rest)

    @entry
    def call(x):
        return added(x), added(x, 1.0), added(x, 1.0, x, x)

    assert call(2.0) == (12.0, 3.0, 5.0)


def _with_a_block(x):
    with np.errstate():
        return x


def _with_a_closure(x):
    def inner():
        return x

    return inner


@pytest.mark.parametrize("function", [_with_a_block, lambda x: [x, x], lambda x: object(), _with_a_closure])
def test_what_kernels_cannot_do_is_an_error(function):
    part = kernel(function)

    @entry
    def call(x):
        part(x)
        return 0.0

    with pytest.raises((NumbaError, NotImplementedError)):
        call(1.0)


# ---- Parts that return nothing, an argument or a constant are not compiled, and mean the same

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
    arguments = (types.none, types.float64)[-function.__code__.co_argcount :]
    assert (trivial_part(function, arguments) is not None) == trivial
