"""Files of compiled kernels, which processes share."""

import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import numba
import numpy as np
import pytest

from raytracer.jit import entry
from raytracer.kernel_files import CacheWarning, KernelFiles

KEY = ("float64", ("x86", "+avx2"), ("code", ""))


def files(folder: Path) -> KernelFiles:
    return KernelFiles(folder / "kernels", "integrator.render_tile-1", pickle.dumps)


def test_what_was_saved_is_loaded_by_any_process(tmp_path: Path) -> None:
    assert files(tmp_path).load(KEY) is None
    files(tmp_path).save(KEY, [1, 2])
    assert files(tmp_path).load(KEY) == [1, 2]
    assert files(tmp_path).load(("int64", *KEY[1:])) is None
    files(tmp_path).flush()
    assert files(tmp_path).load(KEY) is None


def test_processes_that_save_at_the_same_time_keep_both(tmp_path: Path) -> None:
    # Numba's own index, read before the other's entry is there, loses one of them.
    keys = [("int64", *KEY[1:]), KEY, ("float32", *KEY[1:])]
    together = threading.Barrier(len(keys))

    def save(key: tuple[object, ...]) -> None:
        together.wait()
        files(tmp_path).save(key, key[0])

    threads = [threading.Thread(target=save, args=(key,)) for key in keys]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [files(tmp_path).load(key) for key in keys] == [key[0] for key in keys]


def test_a_file_of_other_types_is_not_taken(tmp_path: Path) -> None:
    # Two types may be called alike.
    store, other = files(tmp_path), ("others", *KEY[1:])
    store.save(other, "those")
    store.path(other).rename(store.path(KEY))
    assert store.load(KEY) is None


@pytest.mark.parametrize("left", [0, 1, 20, -1])
def test_a_damaged_file_is_as_none_and_is_replaced(left: int, tmp_path: Path) -> None:
    store = files(tmp_path)
    store.save(KEY, "good")
    store.path(KEY).write_bytes(store.path(KEY).read_bytes()[:left])
    assert store.load(KEY) is None
    store.save(KEY, "good")
    assert store.load(KEY) == "good"


def test_no_flipped_bit_gets_into_what_is_executed(tmp_path: Path) -> None:
    store = files(tmp_path)
    store.save(KEY, "machine code " * 100)
    good = store.path(KEY).read_bytes()
    for place in np.random.default_rng(1).integers(8 * len(good), size=200).tolist():
        damaged = bytearray(good)
        damaged[place // 8] ^= 1 << place % 8
        store.path(KEY).write_bytes(damaged)
        assert store.load(KEY) is None, place
    store.path(KEY).write_bytes(good + b"more")
    assert store.load(KEY) is None
    store.path(KEY).write_bytes(good)
    assert store.load(KEY) == "machine code " * 100


class _Trap:
    """Leaves a file where it was unpickled."""

    def __init__(self, sprung: Path) -> None:
        self.sprung = sprung

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self.sprung,)


def _trapped(folder: Path) -> KernelFiles:
    """Files, one of which does something when it is loaded."""
    store = files(folder)
    store.save(KEY, _Trap(folder / "sprung"))
    return store


_POSIX = pytest.mark.skipif(sys.platform == "win32", reason="modes say nothing there")


def test_what_is_trusted_is_executed(tmp_path: Path) -> None:
    # Else the tests below could not fail.
    _trapped(tmp_path).load(KEY)
    assert (tmp_path / "sprung").exists()


@_POSIX
@pytest.mark.parametrize("mode", [0o775, 0o757, 0o777, 0o1777])
def test_a_folder_that_others_may_write_to_is_not_trusted(
    mode: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("raytracer.kernel_files._told", set())
    store = _trapped(tmp_path)
    store.path(KEY).parent.chmod(mode)
    before = sorted((tmp_path / "kernels").iterdir())
    with pytest.warns(CacheWarning, match="can be written by other users"), store.alone(KEY):
        assert store.load(KEY) is None
    # Said once; and nothing is written there, nor locked.
    with store.alone(("int64", *KEY[1:])):
        store.save(("int64", *KEY[1:]), "machine code")
    assert sorted((tmp_path / "kernels").iterdir()) == before
    assert not (tmp_path / "sprung").exists()


@_POSIX
def test_a_link_in_place_of_the_folder_is_not_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raytracer.kernel_files._told", set())
    _trapped(tmp_path)
    (tmp_path / "kernels").rename(tmp_path / "elsewhere")
    (tmp_path / "kernels").symlink_to(tmp_path / "elsewhere")
    with pytest.warns(CacheWarning, match="is a link"):
        assert files(tmp_path).load(KEY) is None
    assert not (tmp_path / "sprung").exists()


@_POSIX
def test_a_folder_of_another_user_is_not_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raytracer.kernel_files._told", set())
    store = _trapped(tmp_path)
    if os.geteuid() == 0:
        os.chown(tmp_path / "kernels", 12345, -1)
    else:
        monkeypatch.setattr("os.geteuid", lambda: os.getuid() + 1)
    with pytest.warns(CacheWarning, match="belongs to another user"):
        assert store.load(KEY) is None
    assert not (tmp_path / "sprung").exists()


@_POSIX
@pytest.mark.parametrize("mode", [0o664, 0o646])
def test_a_file_that_others_may_write_to_is_as_none_and_is_replaced(mode: int, tmp_path: Path) -> None:
    store = _trapped(tmp_path)
    store.path(KEY).chmod(mode)
    assert store.load(KEY) is None
    assert not (tmp_path / "sprung").exists()
    store.save(KEY, "machine code")
    assert store.load(KEY) == "machine code"


@_POSIX
def test_files_are_for_their_owner_to_write_whatever_the_mask_is(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        files(tmp_path).save(KEY, "machine code")
    finally:
        os.umask(before)
    assert files(tmp_path).load(KEY) == "machine code"
    assert {path.stat().st_mode & 0o777 for path in (tmp_path / "kernels").rglob("*")} == {0o644}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in folders there")
def test_a_pipe_in_place_of_a_file_is_not_waited_for(tmp_path: Path) -> None:
    store = files(tmp_path)
    store.save(KEY, "machine code")
    store.path(KEY).unlink()
    os.mkfifo(store.path(KEY))
    assert store.load(KEY) is None
    store.save(KEY, "machine code")
    assert store.load(KEY) == "machine code"


def test_a_damaged_file_is_compiled_by_one_alone(tmp_path: Path) -> None:
    store = files(tmp_path)
    store.save(KEY, "machine code")
    store.path(KEY).write_bytes(store.path(KEY).read_bytes()[:-1])
    compiled: list[int] = []
    together = threading.Barrier(4)

    def want(number: int) -> None:
        together.wait()
        with files(tmp_path).alone(KEY):
            if files(tmp_path).load(KEY) is None:
                compiled.append(number)
                files(tmp_path).save(KEY, "machine code")

    threads = [threading.Thread(target=want, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(compiled) == 1


def test_what_the_killed_have_left_is_removed_in_time(tmp_path: Path) -> None:
    store = files(tmp_path)
    store.save(KEY, "machine code")
    folder = store.path(KEY).parent
    left = [folder / name for name in ("a.0.tmp", "b.lock", "c.1.tmp")]
    at_work = [folder / name for name in ("d.2.tmp", "e.lock")]
    for path in (*left, *at_work):
        path.touch()
    for path in left:
        os.utime(path, (1.0, 1.0))
    store.save(("int64", *KEY[1:]), "other")
    assert not any(path.exists() for path in left)
    assert all(path.exists() for path in at_work)
    assert store.load(KEY) == "machine code"


_HOLDS = """
import pickle, sys, time
from pathlib import Path
from raytracer.kernel_files import KernelFiles
with KernelFiles(Path(sys.argv[1]) / "kernels", "integrator.render_tile-1", pickle.dumps).alone(%r):
    print("held", flush=True)
    time.sleep(600)
"""


def test_who_is_killed_while_compiling_holds_nobody_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    holder = subprocess.Popen([sys.executable, "-c", _HOLDS % (KEY,), str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    # It is waited for as long as it lives...
    monkeypatch.setattr("raytracer.kernel_files._LONGEST_WAIT", 0.1)
    lock = files(tmp_path)._lock(KEY)
    with pytest.raises(TimeoutError), lock:
        pass
    # ... and no longer.
    monkeypatch.undo()
    holder.kill()
    holder.wait()
    holder.stdout.close()
    with files(tmp_path).alone(KEY):
        files(tmp_path).save(KEY, "machine code")
    assert files(tmp_path).load(KEY) == "machine code"


def test_one_compiles_and_the_others_wait(tmp_path: Path) -> None:
    compiled: list[int] = []
    together = threading.Barrier(4)

    def want(number: int) -> None:
        store = files(tmp_path)
        together.wait()
        with store.alone(KEY):
            if store.load(KEY) is None:
                compiled.append(number)
                store.save(KEY, "machine code")

    threads = [threading.Thread(target=want, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(compiled) == 1


def test_those_who_find_it_there_hold_nothing_up(tmp_path: Path) -> None:
    store = files(tmp_path)
    store.save(KEY, "machine code")
    with store.alone(KEY), files(tmp_path).alone(KEY):
        assert files(tmp_path).load(KEY) == "machine code"


def test_a_folder_that_cannot_be_made_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "kernels").touch()
    store = files(tmp_path)
    with store.alone(KEY):
        store.save(KEY, "machine code")
        assert store.load(KEY) is None


def test_an_edited_module_outside_of_the_package_is_compiled_anew(tmp_path: Path) -> None:
    # Another constant is neither in the types nor in the bytecode, by which a kernel is called.
    path = tmp_path / "probe.py"
    found = []
    for factor in (2.5, 3.5, 2.5):
        path.write_text(f"@entry\ndef times(x):\n    return {factor} * x\n")
        module = {"entry": entry, "__name__": "probe"}
        exec(compile(path.read_text(), path, "exec"), module)
        found.append((module["times"](2.0), sum(module["times"].stats.cache_hits.values())))  # type: ignore[attr-defined,operator]
    assert found == [(5.0, 0), (7.0, 0), (5.0, 1)]


def test_an_entry_without_the_compiler_is_the_function_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)

    def function(x: float) -> float:
        return x

    assert entry(function) is function
