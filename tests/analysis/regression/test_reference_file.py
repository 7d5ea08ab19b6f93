"""References are read as they were written, and what is not one is told."""

import io
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from raytracer.analysis.regression import reference_file
from raytracer.analysis.regression.reference_file import Recipe, load_reference, save_reference
from raytracer.util.errors import InputError

RECIPE = Recipe(
    scene="../Köln.yaml",
    overrides={"camera.f_number": 2.8, "film.width": 64},
    spp=4096,
    seed=12345,
    version="0.1.0",
    inputs={"the scene": "0123456789abcdef"},
    dropped=3,
    gains=(0.5, 1.0, 2.0),
)
MEAN = np.random.default_rng(1).random((45, 64, 3))


def refused(path):
    with pytest.raises(InputError, match=r"a\.npz: broken, or not a reference image"):
        load_reference(path)


@pytest.mark.parametrize("recipe", [RECIPE, RECIPE._replace(scene=None, gains=None, overrides={})])
def test_a_reference_is_read_as_it_was_written_and_has_the_same_bytes_twice(recipe, tmp_path):
    for name in "ab":
        save_reference(tmp_path / f"{name}.npz", MEAN, MEAN / 1000, recipe)
    reference = load_reference(tmp_path / "a.npz")
    np.testing.assert_array_equal(reference.mean, MEAN.astype(np.float32))
    np.testing.assert_array_equal(reference.variance, (MEAN / 1000).astype(np.float32))
    assert reference.recipe == recipe
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert (tmp_path / "a.npz").stat().st_size < 2 * 4 * MEAN.size


def test_a_reference_is_small(tmp_path):
    for width, other, words in ((129, 129, "128 pixels wide, got 129"), (12, 13, "one shape")):
        with pytest.raises(ValueError, match=words):
            save_reference(tmp_path / "a.npz", np.ones((2, width, 3)), np.ones((2, other, 3)), RECIPE)
    assert not list(tmp_path.iterdir())


def test_a_reference_that_is_missing_or_broken(tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(InputError, match="no such file"):
        load_reference(path)
    save_reference(path, MEAN, MEAN, RECIPE)
    data = path.read_bytes()
    for broken in (b"", b"text", data[:100], data[: len(data) // 2]):
        path.write_bytes(broken)
        refused(path)


@pytest.mark.parametrize(
    ("arrays", "settings"),
    [
        ({"mean": np.ones((4, 5))}, {}),
        ({"mean": np.ones((0, 5, 3)), "variance": np.ones((0, 5, 3))}, {}),
        ({"variance": np.ones((4, 6, 3))}, {}),
        ({"mean": np.array([[[object()] * 3]], dtype=object)}, {}),
        ({"variance": np.full((4, 5, 3), -1.0)}, {}),
        ({"variance": np.full((4, 5, 3), np.nan)}, {}),
        ({}, {"scene": 3}),
        ({}, {"spp": "many"}),
        ({}, {"spp": 0}),
        ({}, {"seed": 2**32}),
        ({}, {"inputs": None}),
        ({}, {"gains": [1.0]}),
        ({}, {"overrides": 7}),
    ],
)
def test_an_archive_that_is_something_else(arrays, settings, tmp_path):
    own = {"mean": np.ones((4, 5, 3)), "variance": np.ones((4, 5, 3)), **arrays}
    np.savez(tmp_path / "a.npz", settings=np.array(json.dumps({**RECIPE._asdict(), **settings})), **own)
    refused(tmp_path / "a.npz")


def test_what_is_pickled_is_not_run(tmp_path):
    marker = tmp_path / "run"

    class Harm:
        def __reduce__(self):
            return Path.touch, (marker,)

    np.savez(tmp_path / "a.npz", mean=np.array([[Harm()]], dtype=object), variance=1, settings=json.dumps({}))
    refused(tmp_path / "a.npz")
    assert not marker.exists()


def test_a_reference_is_not_unpacked_beyond_what_one_has(tmp_path, monkeypatch):
    # 50 KB that unpack to 40 MB, of which 4 MiB (in place of 64) are the most that are taken, and held twice.
    monkeypatch.setattr(reference_file, "_LARGEST_FILE", 1 << 22)
    buffer = io.BytesIO()
    huge = np.zeros((26_000, 128, 3), np.float32)
    np.savez_compressed(buffer, mean=huge, variance=huge[:1], settings=np.array(json.dumps(RECIPE._asdict())))
    (tmp_path / "a.npz").write_bytes(buffer.getvalue())
    assert len(buffer.getvalue()) < 100_000
    tracemalloc.start()
    refused(tmp_path / "a.npz")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 10_000_000
