import os
import subprocess
import sys
from pathlib import Path

from tests.compilations import BUDGET
from tests.repository import ROOT

TESTS = """\
import pytest
from raytracer.core.compiler.dispatch import entry

@entry
def double(x):
    return 2.0 * x

@pytest.mark.parametrize("number", range(4))
def test_double(number):
    assert double(float(number)) == 2.0 * number
"""


def test_two_processes_share_a_kernel_and_more_than_the_budget_fails(tmp_path: Path) -> None:
    (tmp_path / "test_double.py").write_text(TESTS)
    (tmp_path / "conftest.py").write_text(
        "from tests import compilations\n\ncompilations.BUDGET['kernels in all'] = 0\n"
    )
    # Without other plugins, which take longer to load than all else takes.
    words = "-q -p tests.compilations -p no:cacheprovider -p xdist -n 2 --kernels 1"
    run = subprocess.run(
        [sys.executable, "-m", "pytest", *words.split(), "-m", "not slow", "--rootdir", tmp_path, tmp_path],
        env={**os.environ, "PYTHONPATH": str(ROOT), "RAYTRACER_CACHE_DIR": str(tmp_path / "cache")}
        | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        check=False,
        capture_output=True,
        text=True,
    )
    assert run.returncode == 1, run.stdout + run.stderr
    assert (
        f"0 path tracers (budget {BUDGET['path tracers']}), 1 kernels in all (budget 0); compiled now: 1\n"
        in run.stdout
    )
    assert "FAILED: more kernels than the budget has" in run.stdout
    assert "1 kernels,   0 of them path tracers: test_double.py" in run.stdout
    assert "4 passed" in run.stdout
