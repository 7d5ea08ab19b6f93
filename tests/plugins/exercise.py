"""Kinds that stand in one file outside of the package, as a reader of docs/examples writes them."""

import os
import shutil
import subprocess
import sys

import numpy as np

from tests.repository import ROOT

EXAMPLES = ROOT / "docs" / "examples"

# What a file in the package's folder would be, before the package is searched for its kinds.
_PRELUDE = """
import sys
import numpy as np
import raytracer.plugins.{family}
raytracer.plugins.{family}.__path__.append({folder!r})
out = {{}}
"""

_SAVE = "\nnp.savez({file!r}, **out)\n"


def run_with_kind(family, name, code, folder):
    """Run code in a process whose family of plugins has an example's file, and return the arrays that it puts in `out`.

    Parameters
    ----------
    family : package of the plugins, such as `cameras`.
    name : file of docs/examples, which becomes a module of that package.
    folder : an empty one, for the file and the result.
    """
    kinds, result = folder / "kinds", folder / "out.npz"
    kinds.mkdir()
    shutil.copy(EXAMPLES / name, kinds)
    prelude = _PRELUDE.format(family=family, folder=str(kinds))
    done = subprocess.run(
        [sys.executable, "-c", prelude + code + _SAVE.format(file=str(result))],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    with np.load(result) as arrays:
        return dict(arrays)


def code_lines(name):
    """Count the lines of an example's file."""
    return len((EXAMPLES / name).read_text(encoding="utf-8").splitlines())
