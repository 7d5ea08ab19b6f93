"""Private copies of the checkout, in which tests are run."""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import psutil

from tests.repository import ROOT

_PYTEST = ("-x", "-q", "--tb=no", "-m", "not slow and not peer", "-p", "no:cacheprovider", "-n", "0")

# What the program and its tests do without; all else of the checkout is linked.
_LEFT_OUT = (".venv*", "*.egg-info", ".*_cache", ".hypothesis", "outputs", "build", "dist")


class NoVerdictError(Exception):
    """Error that tests say nothing of a fault: there are none, or they fail without it, too."""


def copy_checkout(place: Path) -> Path:
    """Make a private copy of the checkout in a folder, of hard links if it can have them."""

    def link(source: str, target: str) -> None:
        try:
            os.link(source, target, follow_symlinks=False)
        except OSError:
            shutil.copy2(source, target)

    copy = place / "checkout"
    shutil.copytree(ROOT, copy, symlinks=True, ignore=shutil.ignore_patterns(*_LEFT_OUT), copy_function=link)
    return copy


def run_tests(checkout: Path, tests: Sequence[str], cache: Path | None, limit: float) -> tuple[int | None, str]:
    """Run tests in a copy of the checkout: what pytest returned, None after too long, and what it printed.

    cache : folder for compiled kernels; None for the user's own.

    Raises
    ------
    NoVerdictError : another package than that of the copy is imported there.
    """
    environment = {**os.environ, "PYTHONPATH": str(checkout)}
    if cache is not None:
        environment["RAYTRACER_CACHE_DIR"] = str(cache)
    code = "import importlib.util as util; print(util.find_spec('raytracer').origin, end='')"
    imported = subprocess.check_output([sys.executable, "-c", code], cwd=checkout, env=environment, text=True)
    if Path(imported) != checkout / "raytracer" / "__init__.py":
        raise NoVerdictError(f"{imported} is imported, and not the copy in {checkout}")
    process = subprocess.Popen(
        [sys.executable, "-m", "pytest", *_PYTEST, *tests],
        cwd=checkout,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    try:
        output, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        # Tests have processes of their own.
        for each in [*psutil.Process(process.pid).children(recursive=True), process]:
            each.kill()
        return None, process.communicate()[0]
    return process.returncode, output
