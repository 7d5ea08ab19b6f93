"""Files of compiled kernels, which processes share."""

import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import numpy as np
import pytest

from raytracer.core.compiler import kernel_files
from raytracer.core.compiler.dispatch import entry
from raytracer.core.compiler.kernel_files import CacheWarning, KernelFiles
from raytracer.core.compiler.signing_key import FILE_NAME

KEY = ("float64", ("x86", "+avx2"), ("code", ""))
OTHER = ("int64", *KEY[1:])


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


def test_what_was_saved_is_loaded_by_any_process_and_executed(tmp_path, tmp_path_factory, monkeypatch, keys):
    assert files(tmp_path).load(KEY) is None
    files(tmp_path).save(KEY, [1, 2])
    assert files(tmp_path).load(KEY) == [1, 2]
    assert files(tmp_path).load(OTHER) is None
    # Those who find it there hold nothing up.
    with files(tmp_path).compile_lock(KEY), files(tmp_path).compile_lock(KEY):
        pass
    # Signing keys that share a folder do not undo each other's work.
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(tmp_path_factory.mktemp("others")))
    assert files(tmp_path).load(KEY) is None
    files(tmp_path).save(KEY, "another's")
    assert files(tmp_path).load(KEY) == "another's"
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(keys))
    assert files(tmp_path).load(KEY) == [1, 2]
    # Otherwise the tests below could not fail.
    _trapped(tmp_path / "trapped").load(KEY)
    assert (tmp_path / "trapped" / "sprung").exists()


def test_a_folder_that_cannot_be_made_is_no_error(tmp_path):
    (tmp_path / "kernels").touch()
    with files(tmp_path).compile_lock(KEY):
        files(tmp_path).save(KEY, "machine code")
        assert files(tmp_path).load(KEY) is None


def at_once(action, arguments):
    """What an action returns for each of some arguments, by threads that start together."""
    together = threading.Barrier(len(arguments))

    def run(argument):
        together.wait()
        return action(argument)

    with ThreadPoolExecutor(len(arguments)) as pool:
        return list(pool.map(run, arguments))


def test_processes_that_save_at_the_same_time_keep_both(tmp_path):
    # Numba's own index, read before the other's entry is there, loses one of them.
    keys = [OTHER, KEY, ("float32", *KEY[1:])]
    at_once(lambda key: files(tmp_path).save(key, key[0]), keys)
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
    store, other = files(tmp_path), OTHER
    store.save(KEY, _Trap(tmp_path / "sprung"))
    store.save(other, "those")
    file_of(store).replace(file_of(store, other))
    assert store.load(other) is None
    store.save(KEY, _Trap(tmp_path / "sprung"))
    (tmp_path / "kernels").rename(tmp_path / "later")
    later = KernelFiles(tmp_path / "later", "path_tracer.render_tile-1")
    assert later.load(KEY) is None
    assert not (tmp_path / "sprung").exists()


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


FORGED = {
    # The format of old, and that of today with a checksum, which anybody can make; and right but for the key.
    "unsigned": lambda path, content: b"rt kernel 1\n" + hashlib.sha256(content).digest() + content,
    "with a checksum": lambda path, content: b"rt kernel 2\n" + hashlib.sha256(content).digest() + content,
    "by another key": lambda path, content: kernel_files._signed_header(path, content, bytes(32)) + content,
}


@pytest.mark.parametrize("forged", FORGED)
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
    attack = FORGED[forged](path, pickle.dumps(_Trap(sprung)))
    # By the name without a key, too, by which it was looked for once.
    unkeyed = path.with_name(f"{path.name.rsplit('.', 2)[0]}.nbc")
    path.write_bytes(attack)
    unkeyed.write_bytes(attack)
    assert run() == (1.5, 0)
    assert not sprung.exists()
    # What was compiled anew has taken its place.
    assert path.read_bytes() != attack
    assert run() == (1.5, 1)


def _made(path, make):
    make(path)
    return path


@pytest.mark.parametrize(
    ("place", "words"),
    [
        (lambda cache: _made(cache / "key", Path.mkdir), "lies in that of the cache"),
        (lambda cache: _made(cache.parent / "link", lambda link: link.symlink_to(cache)), "lies in that of the cache"),
        (lambda _: "key", "'key', is not an absolute path"),
        (lambda cache: _made(cache.parent / "file", Path.touch) / "key", "no signing key can be kept in .*file.key: "),
    ],
)
def test_without_a_key_to_trust_nothing_is_taken_or_kept(place, words, tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    store = _trapped(cache)
    before = sorted(cache.rglob("*"))
    monkeypatch.setenv("RAYTRACER_KEY_DIR", str(place(cache)))
    warned = pytest.warns(CacheWarning, match=f"{words}.*compiles anew; RAYTRACER_KEY_DIR names another")
    with warned, store.compile_lock(KEY):
        assert store.load(KEY) is None
    # Said once.
    store.save(KEY, "machine code")
    assert {*cache.rglob("*")} - {cache / "key"} == {*before}
    assert not (cache / "sprung").exists()


def _linked(folder, monkeypatch):
    folder.rename(folder.with_name("elsewhere"))
    folder.symlink_to(folder.with_name("elsewhere"))


def _given_away(folder, monkeypatch):
    if os.geteuid() == 0:
        os.chown(folder, 12345, -1)
    else:
        monkeypatch.setattr("os.geteuid", lambda: os.getuid() + 1)


def _open(mode):
    return lambda folder, monkeypatch: folder.chmod(mode)


@_POSIX
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        *((_open(mode), "can be written by other users") for mode in (0o775, 0o757, 0o777, 0o1777)),
        (_linked, "is a link"),
        (_given_away, "belongs to another user"),
    ],
)
def test_a_folder_that_others_may_write_to_is_not_trusted(spoil, words, tmp_path, monkeypatch):
    store = _trapped(tmp_path)
    spoil(tmp_path / "kernels", monkeypatch)
    before = sorted((tmp_path / "kernels").iterdir())
    with pytest.warns(CacheWarning, match=words), store.compile_lock(KEY):
        assert store.load(KEY) is None
    # Said once; and nothing is written there, nor locked.
    with store.compile_lock(OTHER):
        store.save(OTHER, "machine code")
    assert sorted((tmp_path / "kernels").iterdir()) == before
    assert not (tmp_path / "sprung").exists()


def _piped(path):
    path.unlink()
    os.mkfifo(path)


SPOILT = {
    "no folder": lambda path: shutil.rmtree(path.parent),
    **{f"cut at {left}": lambda path, left=left: path.write_bytes(path.read_bytes()[:left]) for left in (0, 1, 20, -1)},
    "key lost": lambda path: (Path(os.environ["RAYTRACER_KEY_DIR"]) / FILE_NAME).unlink(),
    "group may write": lambda path: path.chmod(0o664),
    "all may write": lambda path: path.chmod(0o646),
    # Which is not waited for.
    "a pipe": _piped,
}


@_POSIX
@pytest.mark.parametrize("spoilt", SPOILT)
def test_a_lost_damaged_or_open_file_is_as_none_and_is_replaced_by_one_alone(spoilt, tmp_path):
    store = _trapped(tmp_path)
    SPOILT[spoilt](file_of(store))

    def want(number):
        with files(tmp_path).compile_lock(KEY):
            if files(tmp_path).load(KEY) is not None:
                return False
            files(tmp_path).save(KEY, "machine code")
            return True

    assert sum(at_once(want, range(4))) == 1
    assert not (tmp_path / "sprung").exists()
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
    store.save(OTHER, "other")
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
