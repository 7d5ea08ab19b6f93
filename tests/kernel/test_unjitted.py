"""Kernels are plain Python too: interpreted, without the compiler, they give the same numbers.

So a debugger can step through them, and what Numba makes of them is what is written.
"""

import numpy as np

from tests.repository import run_python
from tests.unjitted import numbers, random_numbers


def test_interpreted_kernels_give_the_same_numbers(tmp_path):
    run_python("-m", "tests.unjitted", str(tmp_path / "numbers.npz"), NUMBA_DISABLE_JIT="1")
    compiled = numbers()
    with np.load(tmp_path / "numbers.npz") as interpreted:
        assert set(interpreted.files) == set(compiled)
        for name in random_numbers():
            np.testing.assert_array_equal(interpreted[name], compiled[name])
        for name, values in compiled.items():
            assert not np.isnan(values).any(), name
            # Fused multiply-adds drop roundings, which the lobe of fuzzy metal enlarges at its rim.
            np.testing.assert_allclose(values, interpreted[name], rtol=1e-9, atol=1e-12, err_msg=name)
