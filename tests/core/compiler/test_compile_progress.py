"""The progress of a compilation, and what is kept of it for the next."""

import os
from pathlib import Path

import pytest

from raytracer.core.compiler import compile_progress
from raytracer.core.compiler.cache import cache_contents, check_cache, clear_cache
from raytracer.core.compiler.compile_progress import COMPILATION, Compilation, CompileProgress, watch_compilation
from raytracer.core.compiler.dispatch import entry
from raytracer.core.compiler.kernel_files import save_signed
from raytracer.util.errors import InputError


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Use an empty folder of kernels, and a clock that is moved by hand."""
    path = tmp_path / "cache" / "kernels-0"
    monkeypatch.setattr("raytracer.core.compiler.cache.CACHE_FOLDER", path)
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(tmp_path / "key"))
    return path


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(compile_progress.time, "perf_counter", lambda: now[0])
    return now


def test_parts_are_counted_against_those_of_the_last_kernel(clock):
    compilation = Compilation()
    assert compilation.progress() is None
    with compilation.of("render_tile"):
        for _ in range(100):
            compilation.add_part()
        clock[0] = 3.0
        compilation.link()
        clock[0] = 4.0
    assert compilation.progress() is None
    assert compilation.count == 1
    # Parts took three quarters of the time, of which half are done; then a quarter is left, of which half has passed.
    with Compilation().of("another"), compilation.of("render_tile"):
        for _ in range(50):
            compilation.add_part()
        assert compilation.progress() == CompileProgress(50, 100, 0.375)
        for _ in range(70):
            compilation.add_part()
        assert compilation.progress() == CompileProgress(120, 100, 0.75)
        compilation.link()
        clock[0] += 0.5
        assert compilation.progress() == CompileProgress(120, 100, 0.875)
        clock[0] += 500.0
        progress = compilation.progress()
        assert progress is not None
        assert 0.875 < progress.fraction < 1.0


@pytest.mark.parametrize("content", [b"", b"[]", b"[0, 1, 2]", b"[9, 2, 1]", b'{"a": 1}', b"[1, 2", b'["a", "b", "c"]'])
def test_what_is_no_record_is_as_none(content, folder):
    save_signed(folder / "render_tile.took", content)
    compilation = Compilation()
    with compilation.of("render_tile"):
        progress = compilation.progress()
    assert progress == CompileProgress(0, compile_progress._GUESS.parts, 0.0)


def test_nobody_waits_for_an_entry_of_a_few_parts(folder, clock):
    compilation = Compilation()
    with compilation.of("small"):
        compilation.add_part()
        compilation.link()
        clock[0] = 1.0
    assert not list(folder.parent.rglob("small*"))


def test_a_compilation_that_fails_is_over():
    compilation = Compilation()
    with pytest.raises(ValueError, match="no kernel"), compilation.of("render_tile"):
        raise ValueError("no kernel")
    assert compilation.progress() is None
    assert compilation.count == 0


def test_who_waits_is_told_and_nobody_else():
    compilation, told, others = Compilation(), [], []
    with compilation.of("render_tile"):
        with watch_compilation(others.append):
            pass
        with watch_compilation(told.append):
            compilation.report()
        compilation.report()
    with watch_compilation(told.append):
        compilation.report()
    assert [progress.parts for progress in told] == [0]
    assert others == []


def test_the_cache_is_counted_and_cleared(folder):
    assert cache_contents() == (folder.parent, 0, 0, 0, None)

    @entry
    def double(x):
        return 2.0 * x

    before = COMPILATION.count
    assert double(2.0) == 4.0
    assert COMPILATION.count == before + 1
    (kernel,) = folder.glob("*.nbc")
    (folder.parent / "kernels-1").mkdir()
    (folder.parent / "kernels-1" / "a.part").write_bytes(b"12345")
    (folder.parent / "mine.txt").write_text("keep")
    os.utime(folder.parent / "kernels-1" / "a.part", (1000.0, 1000.0))
    assert cache_contents() == (folder.parent, 1, 1, 5 + kernel.stat().st_size, 1000.0)
    assert clear_cache() == (folder.parent, 0, 0, 0, None)
    assert (folder.parent / "mine.txt").read_text() == "keep"


def test_a_cache_that_keeps_nothing_is_an_error(folder, monkeypatch):
    check_cache()
    assert list(folder.iterdir()) == []
    monkeypatch.setattr("raytracer.core.compiler.cache.CACHE_FOLDER", Path(__file__) / "kernels")
    with pytest.raises(InputError, match="compiled kernels cannot be kept there; RAYTRACER_CACHE_DIR names another"):
        check_cache()
