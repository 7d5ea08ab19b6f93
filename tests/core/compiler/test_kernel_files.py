"""Files of compiled kernels, which processes share."""

import hashlib
import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import numba
import numpy as np
import pytest

from raytracer.core.compiler import kernel_files
from raytracer.core.compiler.dispatch import entry
from raytracer.core.compiler.kernel_files import CacheWarning, KernelFiles
from raytracer.core.compiler.signing_key import FILE_NAME

KEY = ("float64", ("x86", "+avx2"), ("code", ""))


def files(folder):
    return KernelFiles(folder / "kernels", "path_tracer.render_tile-1")


def file_of(store, key=KEY):
    """Find the file that was saved for a key; its name also depends on the signing key."""
    path = store.path(key)
    (file,) = path.parent.glob(f"{path.stem}.*.nbc")
    return file


@pytest.fixture(autouse=True)
def keys(tmp_path_factory, monkeypatch):
    """Use an empty folder for the signing key, and forget earlier warnings."""
    folder = tmp_path_factory.mktemp("keys")
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(folder))
    monkeypatch.setattr(kernel_files, "_warned", set())
    return folder


def test_what_was_saved_is_loaded_by_any_process(tmp_path):
    assert files(tmp_path).load(KEY) is None
    files(tmp_path).save(KEY, [1, 2])
    assert files(tmp_path).load(KEY) == [1, 2]
    assert files(tmp_path).load(("int64", *KEY[1:])) is None


def test_processes_that_save_at_the_same_time_keep_both(tmp_path):
    # Numba's own index, read before the other's entry is there, loses one of them.
    keys = [("int64", *KEY[1:]), KEY, ("float32", *KEY[1:])]
    together = threading.Barrier(len(keys))

    def save(key):
        together.wait()
        files(tmp_path).save(key, key[0])

    threads = [threading.Thread(target=save, args=(key,)) for key in keys]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [files(tmp_path).load(key) for key in keys] == [key[0] for key in keys]


def test_a_file_of_other_types_is_not_taken(tmp_path, monkeypatch):
    # Two types may be called alike.
    store, other, path = files(tmp_path), ("others", *KEY[1:]), files(tmp_path).path(KEY)
    monkeypatch.setattr(KernelFiles, "path", lambda *_: path)
    store.save(other, "those")
    assert store.load(other) == "those"
    assert store.load(KEY) is None


def test_a_signed_file_is_not_taken_in_the_place_of_another(tmp_path):
    # Nor in a folder of other sources, whose machine code expects other arguments.
    store, other = files(tmp_path), ("int64", *KEY[1:])
    store.save(KEY, _Trap(tmp_path / "sprung"))
    store.save(other, "those")
    file_of(store).replace(file_of(store, other))
    assert store.load(other) is None
    store.save(KEY, _Trap(tmp_path / "sprung"))
    (tmp_path / "kernels").rename(tmp_path / "later")
    later = KernelFiles(tmp_path / "later", "path_tracer.render_tile-1")
    assert later.load(KEY) is None
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("left", [0, 1, 20, -1])
def test_a_damaged_file_is_as_none_and_is_replaced(left, tmp_path):
    store = files(tmp_path)
    store.save(KEY, "good")
    file_of(store).write_bytes(file_of(store).read_bytes()[:left])
    assert store.load(KEY) is None
    store.save(KEY, "good")
    assert store.load(KEY) == "good"


def test_no_flipped_bit_gets_into_what_is_executed(tmp_path):
    store = files(tmp_path)
    store.save(KEY, "machine code " * 100)
    path = file_of(store)
    good = path.read_bytes()
    for place in np.random.default_rng(1).integers(8 * len(good), size=200).tolist():
        damaged = bytearray(good)
        damaged[place // 8] ^= 1 << place % 8
        path.write_bytes(damaged)
        assert store.load(KEY) is None, place
    path.write_bytes(good + b"more")
    assert store.load(KEY) is None
    path.write_bytes(good)
    assert store.load(KEY) == "machine code " * 100


class _Trap:
    """An object that makes a file when it is unpickled."""

    def __init__(self, sprung):
        self.sprung = sprung

    def __reduce__(self):
        return Path.touch, (self.sprung,)


def _trapped(folder):
    """Make files, one of which runs code when it is loaded."""
    store = files(folder)
    store.save(KEY, _Trap(folder / "sprung"))
    return store


_POSIX = pytest.mark.skipif(sys.platform == "win32", reason="modes say nothing there")


def test_what_is_trusted_is_executed(tmp_path):
    # Otherwise the tests below could not fail.
    _trapped(tmp_path).load(KEY)
    assert (tmp_path / "sprung").exists()


def _unsigned(path, content):
    """Make a file of the unsigned format: a checksum stands before it, which anybody can make."""
    return b"rt kernel 1\n" + hashlib.sha256(content).digest() + content


def _with_a_checksum(path, content):
    """Make a file like a signed one, but with a checksum, which needs no key."""
    return b"rt kernel 2\n" + hashlib.sha256(content).digest() + content


def _by_another_key(path, content):
    """Make a file that is right but for the key that signed it."""
    return kernel_files._signed_header(path, content, bytes(32)) + content


@pytest.mark.parametrize("forged", [_unsigned, _with_a_checksum, _by_another_key])
def test_a_cache_that_came_with_an_archive_runs_nothing(forged, tmp_path, monkeypatch):
    """It belongs to the user who has unpacked it, and nobody else can write to it: modes do not tell."""
    folder = tmp_path / "unpacked" / "kernels"
    monkeypatch.setattr("raytracer.core.compiler.cache.CACHE_FOLDER", folder)

    def halve(x):
        return x / 2.0

    def run():
        compiled = entry(halve)
        return compiled(3.0), compiled.counts["loaded"]

    assert [run(), run()] == [(1.5, 0), (1.5, 1)]
    (path,) = folder.glob("*.nbc")
    sprung = tmp_path / "sprung"
    attack = forged(path, pickle.dumps(_Trap(sprung)))
    # By the name without a key, too, by which it was looked for once.
    unkeyed = path.with_name(f"{path.name.rsplit('.', 2)[0]}.nbc")
    path.write_bytes(attack)
    unkeyed.write_bytes(attack)
    assert run() == (1.5, 0)
    assert not sprung.exists()
    # What was compiled anew has taken its place.
    assert path.read_bytes() != attack
    assert run() == (1.5, 1)


def test_keys_that_share_a_folder_do_not_undo_each_others_work(tmp_path, tmp_path_factory, monkeypatch, keys):
    files(tmp_path).save(KEY, "mine")
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(tmp_path_factory.mktemp("others")))
    assert files(tmp_path).load(KEY) is None
    files(tmp_path).save(KEY, "another's")
    assert files(tmp_path).load(KEY) == "another's"
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(keys))
    assert files(tmp_path).load(KEY) == "mine"


def _in_the_cache(cache):
    (cache / "key").mkdir()
    return str(cache / "key")


def _in_the_cache_by_a_link(cache):
    (cache.parent / "link").symlink_to(cache)
    return str(cache.parent / "link")


def _under_a_file(cache):
    (cache.parent / "file").touch()
    return str(cache.parent / "file" / "key")


@pytest.mark.parametrize(
    ("place", "words"),
    [
        (_in_the_cache, "lies in that of the cache"),
        (_in_the_cache_by_a_link, "lies in that of the cache"),
        (lambda _: "key", "'key', is not an absolute path"),
        (_under_a_file, "no signing key can be kept in .*file.key: "),
    ],
)
def test_without_a_key_to_trust_nothing_is_taken_or_kept(place, words, tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    store = _trapped(cache)
    before = sorted(cache.rglob("*"))
    monkeypatch.setenv("RAYTRACER_KEY_DIR", place(cache))
    warned = pytest.warns(CacheWarning, match=f"{words}.*compiles anew; RAYTRACER_KEY_DIR names another")
    with warned, store.compile_lock(KEY):
        assert store.load(KEY) is None
    # Said once.
    store.save(KEY, "machine code")
    assert {*cache.rglob("*")} - {cache / "key"} == {*before}
    assert not (cache / "sprung").exists()


def test_with_a_lost_key_all_is_compiled_anew(tmp_path, keys):
    store = files(tmp_path)
    store.save(KEY, "machine code")
    (keys / FILE_NAME).unlink()
    assert store.load(KEY) is None
    store.save(KEY, "machine code")
    assert store.load(KEY) == "machine code"


@_POSIX
@pytest.mark.parametrize("mode", [0o775, 0o757, 0o777, 0o1777])
def test_a_folder_that_others_may_write_to_is_not_trusted(mode, tmp_path):
    store = _trapped(tmp_path)
    store.path(KEY).parent.chmod(mode)
    before = sorted((tmp_path / "kernels").iterdir())
    with pytest.warns(CacheWarning, match="can be written by other users"), store.compile_lock(KEY):
        assert store.load(KEY) is None
    # Said once; and nothing is written there, nor locked.
    with store.compile_lock(("int64", *KEY[1:])):
        store.save(("int64", *KEY[1:]), "machine code")
    assert sorted((tmp_path / "kernels").iterdir()) == before
    assert not (tmp_path / "sprung").exists()


@_POSIX
def test_a_link_in_place_of_the_folder_is_not_trusted(tmp_path):
    _trapped(tmp_path)
    (tmp_path / "kernels").rename(tmp_path / "elsewhere")
    (tmp_path / "kernels").symlink_to(tmp_path / "elsewhere")
    with pytest.warns(CacheWarning, match="is a link"):
        assert files(tmp_path).load(KEY) is None
    assert not (tmp_path / "sprung").exists()


@_POSIX
def test_a_folder_of_another_user_is_not_trusted(tmp_path, monkeypatch):
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
def test_a_file_that_others_may_write_to_is_as_none_and_is_replaced(mode, tmp_path):
    store = _trapped(tmp_path)
    file_of(store).chmod(mode)
    assert store.load(KEY) is None
    assert not (tmp_path / "sprung").exists()
    store.save(KEY, "machine code")
    assert store.load(KEY) == "machine code"


@_POSIX
def test_files_are_for_their_owner_to_write_whatever_the_mask_is(tmp_path):
    before = os.umask(0)
    try:
        files(tmp_path).save(KEY, "machine code")
    finally:
        os.umask(before)
    assert files(tmp_path).load(KEY) == "machine code"
    assert {path.stat().st_mode & 0o777 for path in (tmp_path / "kernels").rglob("*")} == {0o600}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in folders there")
def test_a_pipe_in_place_of_a_file_is_not_waited_for(tmp_path):
    store = files(tmp_path)
    store.save(KEY, "machine code")
    path = file_of(store)
    path.unlink()
    os.mkfifo(path)
    assert store.load(KEY) is None
    store.save(KEY, "machine code")
    assert store.load(KEY) == "machine code"


def test_a_damaged_file_is_compiled_by_one_alone(tmp_path):
    store = files(tmp_path)
    store.save(KEY, "machine code")
    file_of(store).write_bytes(file_of(store).read_bytes()[:-1])
    compiled = []
    together = threading.Barrier(4)

    def want(number):
        together.wait()
        with files(tmp_path).compile_lock(KEY):
            if files(tmp_path).load(KEY) is None:
                compiled.append(number)
                files(tmp_path).save(KEY, "machine code")

    threads = [threading.Thread(target=want, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(compiled) == 1


def test_what_the_killed_have_left_is_removed_in_time(tmp_path):
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
from raytracer.core.compiler.kernel_files import KernelFiles
with KernelFiles(Path(sys.argv[1]) / "kernels", "path_tracer.render_tile-1").compile_lock(%r):
    print("held", flush=True)
    time.sleep(600)
"""


def test_who_is_killed_while_compiling_holds_nobody_up(tmp_path, monkeypatch):
    holder = subprocess.Popen([sys.executable, "-c", _HOLDS % (KEY,), str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    # It is waited for as long as it lives...
    with monkeypatch.context() as patch:
        patch.setattr(kernel_files, "_MAX_WAIT", 0.1)
        lock = files(tmp_path)._lock(KEY)
    with pytest.raises(TimeoutError), lock:
        pass
    # ... and no longer.
    holder.kill()
    holder.wait()
    holder.stdout.close()
    with files(tmp_path).compile_lock(KEY):
        files(tmp_path).save(KEY, "machine code")
    assert files(tmp_path).load(KEY) == "machine code"


def test_one_compiles_and_the_others_wait(tmp_path):
    compiled = []
    together = threading.Barrier(4)

    def want(number):
        store = files(tmp_path)
        together.wait()
        with store.compile_lock(KEY):
            if store.load(KEY) is None:
                compiled.append(number)
                store.save(KEY, "machine code")

    threads = [threading.Thread(target=want, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(compiled) == 1


def test_those_who_find_it_there_hold_nothing_up(tmp_path):
    store = files(tmp_path)
    store.save(KEY, "machine code")
    with store.compile_lock(KEY), files(tmp_path).compile_lock(KEY):
        assert files(tmp_path).load(KEY) == "machine code"


def test_a_folder_that_cannot_be_made_is_no_error(tmp_path):
    (tmp_path / "kernels").touch()
    store = files(tmp_path)
    with store.compile_lock(KEY):
        store.save(KEY, "machine code")
        assert store.load(KEY) is None


def test_an_edited_module_outside_of_the_package_is_compiled_anew(tmp_path, monkeypatch):
    monkeypatch.setattr("raytracer.core.compiler.cache.CACHE_FOLDER", tmp_path / "cache" / "kernels")
    # Another constant is neither in the types nor in the bytecode, by which a kernel is called.
    path = tmp_path / "probe.py"
    results = []
    for factor in (2.5, 3.5, 2.5):
        path.write_text(f"@entry\ndef times(x):\n    return {factor} * x\n")
        module = {"entry": entry, "__name__": "probe"}
        exec(compile(path.read_text(), path, "exec"), module)
        results.append((module["times"](2.0), module["times"].counts["loaded"]))
    assert results == [(5.0, 0), (7.0, 0), (5.0, 1)]


def test_an_entry_without_the_compiler_is_the_function_itself(monkeypatch):
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)

    def function(x):
        return x

    assert entry(function) is function
