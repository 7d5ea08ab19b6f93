"""Dispatch by type, and the cache of kernels."""

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from raytracer import jit
from raytracer.jit import entry, generic, kernel, switch


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
def _(shape, factor):
    return factor * shape.side * shape.side


@area.register(Circle)
def _(shape, factor):
    return factor * 3.0 * shape.radius * shape.radius


@area.register(type(None))
def _(shape, factor):
    return -factor


@generic
def first_row(table, index):
    raise NotImplementedError


@first_row.register(Table)
def _(table, index):
    return table.rows[index]


@first_row.register(OtherTable)
def _(table, index):
    return table.scale * table.rows[index]


first_row_any = switch(first_row)


@kernel
def twice(x):
    return 2.0 * x


@entry
def call_area(shape, factor):
    return twice(area(shape, factor))


@entry
def call_switch(tables, which, index):
    return first_row_any(tables, which, index)


@pytest.mark.parametrize(("shape", "expected"), [(Square(2.0), 4.0), (Circle(2.0), 12.0), (None, -1.0)])
def test_generic_chooses_by_class_from_python_and_from_kernels(shape: Any, expected: float) -> None:
    assert area(shape, 1.0) == expected
    assert call_area(shape, 1.0) == 2.0 * expected


def test_generic_without_a_case_says_so() -> None:
    with pytest.raises(NotImplementedError):
        area(3.0, 1.0)
    with pytest.raises(TypingError):
        call_area((1.0, 2.0), 1.0)


def test_kernels_can_be_called_from_python() -> None:
    assert twice(1.5) == 3.0
    assert twice.__name__ == "twice"


@pytest.mark.parametrize("count", [1, 2, 3])
def test_switch_picks_a_table_at_run_time(count: int) -> None:
    tables = (Table(np.arange(3.0)), OtherTable(np.arange(3.0), 10.0), Table(np.arange(3.0) + 100.0))[:count]
    for which in range(count):
        expected = [2.0, 20.0, 102.0][which]
        assert call_switch(tables, which, 2) == expected
        assert first_row_any(tables, which, 2) == expected


def test_kernels_release_the_interpreter_and_divide_as_numpy_does() -> None:
    @entry
    def divide(a, b):
        return a / b

    assert divide.targetoptions["nogil"]
    assert divide(1.0, 0.0) == np.inf
    assert np.isnan(divide(0.0, 0.0))


# ---- Cache


def _package(folder: Path) -> Path:
    (folder / "sub").mkdir(parents=True)
    (folder / "a.py").write_text("x = 1\n")
    (folder / "sub" / "b.py").write_text("y = 1\n")
    return folder


def test_any_edited_source_makes_another_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Numba looks at the file of the function it caches, not at those of the functions it calls.
    package = _package(tmp_path / "package")
    monkeypatch.setattr(jit, "_PACKAGE", package)
    seen = {jit._source_hash()}
    assert jit._source_hash() in seen
    for change in (
        lambda: (package / "sub" / "b.py").write_text("y = 2\n"),
        (package / "sub" / "c.py").touch,
        lambda: (package / "sub" / "c.py").rename(package / "c.py"),
    ):
        change()
        digest = jit._source_hash()
        assert digest not in seen
        seen.add(digest)


def test_edits_above_the_kernels_leave_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = _package(tmp_path / "package")
    monkeypatch.setattr(jit, "_PACKAGE", package)
    before = jit._source_hash()
    (package / "rendering.py").write_text("z = 1\n")
    (package / "cli").mkdir()
    (package / "cli" / "a.py").write_text("z = 1\n")
    assert jit._source_hash() == before


@pytest.mark.parametrize("name", jit._WITHOUT_KERNELS)
def test_what_does_not_count_for_the_cache_compiles_nothing(name: str) -> None:
    package = Path(jit.__file__).parent
    taken = re.compile(r"from raytracer\.jit import .*\b(kernel|entry|generic|each|switch|share)\b")
    for path in [package / f"{name}.py", *(package / name).rglob("*.py")]:
        assert not path.exists() or not taken.search(path.read_text(encoding="utf-8"))


def test_other_numba_versions_have_another_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "_PACKAGE", _package(tmp_path / "package"))
    before = jit._source_hash()
    monkeypatch.setattr("numba.__version__", "0.0.1")
    assert jit._source_hash() != before


def test_old_caches_are_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYTRACER_CACHE_DIR", str(tmp_path))
    for age in range(8):
        folder = tmp_path / f"kernels-{age}"
        folder.mkdir()
        (folder / "file.nbc").touch()
        os.utime(folder, (1000.0 - age, 1000.0 - age))
    (tmp_path / "something else").mkdir()
    current = jit._use_cache_of_these_sources()
    assert current.parent == tmp_path
    kept = sorted(path.name for path in tmp_path.iterdir())
    assert kept == sorted([current.name, "kernels-0", "kernels-1", "kernels-2", "something else"])


def _locked(folder: Path) -> Path:
    folder.chmod(0o500)
    return folder / "cache"


def _taken(folder: Path) -> Path:
    (folder / "file").touch()
    return folder / "file"


def _dangling(folder: Path) -> Path:
    (folder / "link").symlink_to(folder / "nowhere" / "at all")
    return folder / "link"


@pytest.mark.parametrize("place", [_locked, _taken, _dangling, lambda folder: folder / "a" / "b" / "c"])
def test_wherever_the_cache_is_to_be_kernels_run(
    place: Callable[[Path], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAYTRACER_CACHE_DIR", str(place(tmp_path)))
    monkeypatch.setattr(jit, "CACHE_FOLDER", jit._use_cache_of_these_sources())

    @entry
    def double(x: float) -> float:
        return 2.0 * x

    assert double(1.5) == 3.0
    tmp_path.chmod(0o700)


@pytest.mark.skipif(sys.platform == "win32", reason="homes are found in another way there")
def test_a_user_without_a_home_has_a_cache_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("RAYTRACER_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    assert jit._cache_root() == tmp_path / f"raytracer-{os.getuid()}"


def test_cache_lies_where_each_system_keeps_caches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAYTRACER_CACHE_DIR", raising=False)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    for platform, place in (
        ("linux", tmp_path / ".cache"),
        ("darwin", tmp_path / "Library" / "Caches"),
        ("win32", tmp_path / "AppData" / "Local" / "raytracer"),
    ):
        monkeypatch.setattr("sys.platform", platform)
        assert jit._cache_root() == place / ("Cache" if platform == "win32" else "raytracer")
