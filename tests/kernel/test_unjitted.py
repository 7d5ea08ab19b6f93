"""Kernels are plain Python too: interpreted, without the compiler, they give the same numbers.

So a debugger can step through them, and what Numba makes of them is what is written.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

import raytracer
from tests.unjitted import numbers, random_numbers

ROOT = Path(__file__).parents[2]


def test_interpreted_kernels_give_the_same_numbers(tmp_path):
    package = Path(raytracer.__file__).parent.parent
    result = subprocess.run(
        [sys.executable, "-m", "tests.unjitted", str(tmp_path / "numbers.npz")],
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": f"{package}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    compiled = numbers()
    with np.load(tmp_path / "numbers.npz") as interpreted:
        assert set(interpreted.files) == set(compiled)
        for name in random_numbers():
            np.testing.assert_array_equal(interpreted[name], compiled[name])
        for name, values in compiled.items():
            assert not np.isnan(values).any(), name
            # Fused multiply-adds drop roundings, which the lobe of fuzzy metal enlarges at its rim.
            np.testing.assert_allclose(values, interpreted[name], rtol=1e-9, atol=1e-12, err_msg=name)
