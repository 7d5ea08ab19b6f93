"""References are read as they were written, and what is not one is told."""

import io
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

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


@pytest.fixture
def mean():
    return np.random.default_rng(1).random((45, 64, 3))


def test_a_reference_is_read_as_it_was_written_and_has_the_same_bytes_twice(mean, tmp_path):
    for name in "ab":
        save_reference(tmp_path / f"{name}.npz", mean, mean / 1000, RECIPE)
    reference = load_reference(tmp_path / "a.npz")
    np.testing.assert_array_equal(reference.mean, mean.astype(np.float32))
    np.testing.assert_array_equal(reference.variance, (mean / 1000).astype(np.float32))
    assert reference.recipe == RECIPE
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert (tmp_path / "a.npz").stat().st_size < 2 * 4 * mean.size


def test_a_recipe_may_leave_out_what_there_is_not(mean, tmp_path):
    recipe = RECIPE._replace(scene=None, gains=None, overrides={})
    save_reference(tmp_path / "a.npz", mean, mean, recipe)
    assert load_reference(tmp_path / "a.npz").recipe == recipe


def test_a_reference_is_small(tmp_path):
    with pytest.raises(ValueError, match="128 pixels wide, got 129"):
        save_reference(tmp_path / "a.npz", np.ones((2, 129, 3)), np.ones((2, 129, 3)), RECIPE)
    with pytest.raises(ValueError, match="one shape"):
        save_reference(tmp_path / "a.npz", np.ones((2, 12, 3)), np.ones((2, 13, 3)), RECIPE)
    assert not list(tmp_path.iterdir())


def test_a_reference_that_is_missing_or_broken(mean, tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(InputError, match="no such file"):
        load_reference(path)
    save_reference(path, mean, mean, RECIPE)
    data = path.read_bytes()
    for broken in (b"", b"text", data[:100], data[: len(data) // 2]):
        path.write_bytes(broken)
        with pytest.raises(InputError, match=r"a\.npz: broken, or not a reference image"):
            load_reference(path)


@pytest.mark.parametrize(
    ("arrays", "settings"),
    [
        ({"mean": np.ones((4, 5))}, {}),
        ({"mean": np.ones((0, 5, 3)), "variance": np.ones((0, 5, 3))}, {}),
        ({"variance": np.ones((4, 6, 3))}, {}),
        ({"mean": np.array([[[object()] * 3]], dtype=object)}, {}),
        ({}, {"scene": 3}),
        ({"variance": np.full((4, 5, 3), -1.0)}, {}),
        ({"variance": np.full((4, 5, 3), np.nan)}, {}),
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
    buffer = io.BytesIO()
    text = json.dumps({**RECIPE._asdict(), **settings})
    np.savez(buffer, settings=np.array(text), **own)
    (tmp_path / "a.npz").write_bytes(buffer.getvalue())
    with pytest.raises(InputError, match="broken, or not a reference image"):
        load_reference(tmp_path / "a.npz")


def test_what_is_pickled_is_not_run(tmp_path):
    marker = tmp_path / "run"

    class Harm:
        def __reduce__(self):
            return Path.touch, (marker,)

    np.savez(tmp_path / "a.npz", mean=np.array([[Harm()]], dtype=object), variance=1, settings=json.dumps({}))
    with pytest.raises(InputError, match="broken, or not a reference image"):
        load_reference(tmp_path / "a.npz")
    assert not marker.exists()


def test_a_reference_is_not_unpacked_beyond_what_one_has(mean, tmp_path):
    path = tmp_path / "a.npz"
    save_reference(path, mean, mean, RECIPE)
    with np.load(path) as held:
        settings = held["settings"]
    # 600 KB that unpack to 600 MB.
    huge = np.zeros((390_000, 128, 3), np.float32)
    np.savez_compressed(path, mean=huge, variance=huge, settings=settings)
    assert path.stat().st_size < 2_000_000
    tracemalloc.start()
    with pytest.raises(InputError, match="broken, or not a reference image"):
        load_reference(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 300_000_000
