"""Where the repository has what tests use."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

import raytracer

ROOT = Path(__file__).parent.parent
SCENES = ROOT / "scenes"
REFERENCES = Path(__file__).parent / "references"
"""Small pictures of the scenes, and scenes that only they are made of (`make references`)."""

GENERATED = {
    "million": "million.ply",
    "instances": "forest_russet.npy",
    "night_street": "umbrella_cloth.ply",
    "still_life": "candle.obj",
}
"""Scenes that are made of files which are not in the repository, and the last of these that is made."""


def need_files_of(name: str) -> None:
    """Skip the test if what the scene of this name is made of has not been made."""
    if name in GENERATED and not (SCENES / "generated" / GENERATED[name]).exists():
        pytest.skip(f"make scenes has not made what {name}.yaml is made of")


def script(path):
    """Load a script of the repository, such as "docs/make_gallery.py", as a module."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run_python(*words, **environment):
    """Run Python with these words, where it finds the package and the tests, and return what it prints."""
    path = f"{Path(raytracer.__file__).parent.parent}{os.pathsep}{ROOT}"
    own = {**os.environ, "PYTHONPATH": path, **environment}
    done = subprocess.run([sys.executable, *words], cwd=ROOT, env=own, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
