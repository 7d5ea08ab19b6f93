"""Files of compiled kernels, which processes share."""

import pickle
import threading
from pathlib import Path

import numba
import pytest

from raytracer.jit import entry
from raytracer.kernel_files import KernelFiles

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
    store = files(tmp_path)
    store.save(KEY, "these")
    store.path(KEY).write_bytes(pickle.dumps((pickle.dumps("others"), pickle.dumps("those"))))
    assert store.load(KEY) is None


@pytest.mark.parametrize("left", [0, 1, 20, -1])
def test_a_damaged_file_is_as_none_and_is_replaced(left: int, tmp_path: Path) -> None:
    store = files(tmp_path)
    store.save(KEY, "good")
    store.path(KEY).write_bytes(store.path(KEY).read_bytes()[:left])
    assert store.load(KEY) is None
    store.save(KEY, "good")
    assert store.load(KEY) == "good"


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
