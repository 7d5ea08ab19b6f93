"""Files of arrays: whole, the one before, or told apart from both."""

import errno
import os
import zipfile

import numpy as np
import pytest

from raytracer.util import array_snapshot
from raytracer.util.array_snapshot import DamagedError, previous_path
from raytracer.util.errors import OutputError


def arrays(seed=0):
    rng = np.random.default_rng(seed)
    return {
        "film/0": rng.normal(size=(2, 3, 3)),
        "film/1": rng.integers(0, 2**62, (2, 3)),
        "tally/means": rng.normal(size=(2, 2)).astype(np.float32),
        "counts": np.arange(4),
    }


def write(path, seed=0, *, keep=True):
    return array_snapshot.write(path, {"seed": seed, "x": [1.5, None, "é"]}, arrays(seed), keep=keep)


def read(path, targets=None):
    filled = {name: np.full_like(array, 7) for name, array in arrays().items()} if targets is None else targets
    return array_snapshot.read(path, lambda about: filled), filled


def assert_holds(path, seed):
    about, found = read(path)
    assert about == {"seed": seed, "x": [1.5, None, "é"]}
    for name, array in arrays(seed).items():
        np.testing.assert_array_equal(found[name], array)


def test_what_is_written_is_read(tmp_path):
    path = tmp_path / "new" / "a.checkpoint"
    assert write(path, 1) == path.stat().st_size
    assert_holds(path, 1)
    assert not previous_path(path).exists()


def test_the_one_before_is_kept(tmp_path):
    path = tmp_path / "a.checkpoint"
    for seed in range(4):
        write(path, seed)
    assert_holds(path, 3)
    assert_holds(previous_path(path), 2)
    write(path, 4, keep=False)
    assert_holds(path, 4)
    assert_holds(previous_path(path), 2)
    array_snapshot.delete(path)
    assert list(tmp_path.iterdir()) == []


def test_every_flipped_bit_is_noticed_or_changes_nothing(tmp_path):
    path = tmp_path / "a.checkpoint"
    write(path)
    whole = path.read_bytes()
    expected = arrays()
    noticed = 0
    for place in range(len(whole)):
        data = bytearray(whole)
        # One bit at each place, another one at the next.
        data[place] ^= 1 << (place % 8)
        path.write_bytes(data)
        try:
            about, found = read(path)
        except DamagedError:
            noticed += 1
            continue
        assert about == {"seed": 0, "x": [1.5, None, "é"]}, place
        assert all(np.array_equal(found[name], array) for name, array in expected.items()), place
    # What nobody looks at are times of change and the like, but nothing of what is held.
    path.write_bytes(whole)
    with zipfile.ZipFile(path) as archive:
        assert noticed >= sum(member.file_size for member in archive.infolist())


def test_every_shorter_file_is_noticed(tmp_path):
    path = tmp_path / "a.checkpoint"
    write(path)
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(DamagedError):
            read(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with a name")
def test_other_files_are_noticed_and_a_pipe_is_not_waited_for(tmp_path):
    path = tmp_path / "a.checkpoint"
    for data in (b"not a zip file at all", bytes(1000)):
        path.write_bytes(data)
        with pytest.raises(DamagedError):
            read(path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="is no regular file"):
        read(tmp_path / "pipe")


OBJECTS, HEADER = np.array([print] * 4, dtype=object), None
CLAIMS = {
    "shape": {"counts": np.arange(5)},
    "type": {"counts": np.arange(4.0)},
    "more": {"further": np.arange(4)},
    "order": {"tally/means": np.asfortranarray(arrays()["tally/means"])},
    "pickle": {"counts": OBJECTS},
    "header": {"counts": HEADER},
    "missing": {},
    "compressed": {},
}


@pytest.mark.parametrize("change", CLAIMS)
def test_files_that_claim_what_they_are_not(tmp_path, change):
    """What they ask for is compared with what there is room for, before any of it is made."""
    path = tmp_path / "a.checkpoint"
    content = arrays() | CLAIMS[change]
    if change == "missing":
        del content["counts"]
    compression = zipfile.ZIP_DEFLATED if change == "compressed" else zipfile.ZIP_STORED
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("about.json", "{}")
        for name, array in content.items():
            with archive.open(f"{name}.npy", "w") as member:
                if array is HEADER:
                    header = {"descr": "<i8", "fortran_order": False, "shape": (10**15,)}
                    np.lib.format.write_array_header_1_0(member, header)
                else:
                    np.lib.format.write_array(member, array)
    with pytest.raises(DamagedError):
        read(path)


def test_arrays_may_have_grown(tmp_path):
    path = tmp_path / "a.checkpoint"
    array_snapshot.write(path, {}, {"rays": np.ones((2, 3, 4, 5))}, keep=False)
    grown = {"rays": np.full((2, 3, 6, 5), 7.0)}
    read(path, grown)
    assert (grown["rays"][:, :, :4] == 1.0).all()
    assert (grown["rays"][:, :, 4:] == 0.0).all()
    with pytest.raises(DamagedError):
        read(path, {"rays": np.zeros((2, 3, 3, 5))})


def test_a_failed_write_leaves_both(tmp_path, monkeypatch):
    path = tmp_path / "a.checkpoint"
    write(path, 0)
    write(path, 1)

    def broken(*args, **keys):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(np.lib.format, "write_array", broken)
    with pytest.raises(OutputError, match="cannot be written: Input/output error"):
        write(path, 2)
    assert_holds(path, 1)
    assert_holds(previous_path(path), 0)
    assert len(list(tmp_path.iterdir())) == 2


def test_where_there_is_no_room_the_one_before_makes_it(tmp_path, monkeypatch):
    path = tmp_path / "a.checkpoint"
    write(path, 0)
    write(path, 1)
    written = np.lib.format.write_array

    def full(*args, **keys):
        if previous_path(path).exists():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written(*args, **keys)

    monkeypatch.setattr(np.lib.format, "write_array", full)
    write(path, 2)
    assert_holds(path, 2)
    assert_holds(previous_path(path), 1)
