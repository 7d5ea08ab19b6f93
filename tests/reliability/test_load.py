"""Processes that start together, and one after the other: short runs of `race`, and the fit of `hour`."""

import os
from pathlib import Path

import numpy as np
import pytest

from tests.reliability.hour import slope
from tests.reliability.processes import BALL, run
from tests.reliability.race import damage, kill_compilers, race


@pytest.mark.slow
def test_processes_that_start_together_compile_once_whatever_was_left(tmp_path):
    assert kill_compilers(tmp_path, 2) == 2
    first = race(tmp_path, 6)
    assert first.is_won, first
    # A kernel, and the parts that it is made of.
    assert damage(tmp_path, 1) > 1
    second = race(tmp_path, 6)
    assert second.is_won, second
    assert second.pictures == first.pictures


def paths(folder):
    # Memory that processes share lies directly there; folders are those of other programs.
    shared = Path("/dev/shm").glob("*")
    return {f"{path} {path.stat().st_size}" for path in (*folder.rglob("*"), *shared) if path.is_file()}


@pytest.mark.slow
def test_renders_one_after_the_other_leave_nothing(tmp_path):
    # As a shell loop runs them: nothing in the kernel cache, in the folders of temporary files and shared memory, or
    # beside the output.
    (tmp_path / "ball.yaml").write_text(BALL)
    (tmp_path / "tmp").mkdir()
    own = {"RAYTRACER_CACHE_DIR": "cache", "RAYTRACER_KEY_DIR": "key", "TMPDIR": "tmp"}
    environment = {**os.environ, **{name: str(tmp_path / place) for name, place in own.items()}}
    pictures, left = set(), []
    for _ in range(6):
        assert run(["render", "ball.yaml", "-o", "out/picture.exr", "-q"], tmp_path, env=environment).status == 0
        pictures.add((tmp_path / "out" / "picture.exr").read_bytes())
        left.append(paths(tmp_path))
    assert len(pictures) == 1
    assert all(each == left[0] for each in left)


def test_the_slope_is_that_after_what_does_not_count():
    # 3 MB a minute and noise, after five minutes of growth.
    seconds = np.arange(0.0, 3600.0, 2.0)
    noise = np.random.default_rng(1).normal(0.0, 2e6, len(seconds))
    resident = 4e8 + np.where(seconds < 300.0, 1e6 * seconds, 3e8 + 3e6 * (seconds - 300.0) / 60.0) + noise
    found, error = slope(seconds.tolist(), resident.astype(int).tolist(), 300.0)
    assert found == pytest.approx(3e6, abs=4.0 * error)
    assert error < 1e4
    with pytest.raises(ValueError, match="nothing to fit"):
        slope([1.0, 2.0], [1, 2], 300.0)
