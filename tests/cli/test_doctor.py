"""`rt doctor`: what works is told so because it was tried, and what does not work fails with what to do."""

import json
import os
import re
import subprocess
import sys
import tomllib
import webbrowser

import numpy as np
import pytest

from raytracer.analysis.doctor import diagnosis, packages
from raytracer.core import trial
from raytracer.util.machine import MemoryLimit
from tests.repository import ROOT

NAMES = [*diagnosis._CHECKS, *(f"[{extra}]" for extra in packages.EXTRAS)]


def by_name(text):
    return {check["name"]: check for check in json.loads(text)}


def test_an_installation_that_works_says_so_line_by_line(rt, monkeypatch):
    checks = by_name(rt("doctor --json").out)
    assert list(checks) == NAMES
    assert {check["status"] for check in checks.values()} <= {"ok", "absent", "warning"}
    assert f"numpy {np.__version__}" in checks["packages"]["found"]
    assert str(os.environ.get("RAYTRACER_CACHE_DIR", "")) in checks["cache"]["found"]
    monkeypatch.setattr(diagnosis, "missing_modules", lambda extra: [*packages.EXTRAS[extra].modules])
    printed = rt("doctor").out
    assert re.findall(r"^(?:ok|warning|-) +(\S+)", printed, re.MULTILINE) == NAMES
    assert "-        [denoise]  not installed\n" + " " * 20 + "pip install 'raytracer[denoise]' gives" in printed


def test_the_ray_is_really_traced(rt, monkeypatch):
    # Both ways find a triangle at another distance, and nothing where there is none.
    monkeypatch.setattr(trial, "_ORIGIN", (0.25, 0.25, 3.0))
    checks = by_name(rt("doctor --json", status=1).out)
    assert {name for name, check in checks.items() if check["status"] == "failed"} == {"Embree", "compiler"}
    assert checks["Embree"]["found"] == "a ray met a triangle at 3 m, which lies at 2 m"
    monkeypatch.setattr(trial, "_ORIGIN", (5.0, 5.0, 2.0))
    assert np.isnan(trial.cast_ray())
    assert np.isinf(trial.cast_ray_in_kernel())


BREAKS = {
    "embreex": ("embreex", {"packages", "Embree", "compiler"}),
    "numba": ("numba", {"packages", "Embree", "compiler", "processor", "cache"}),
    "PIL": ("Pillow", {"packages"}),
}


@pytest.mark.parametrize("module", BREAKS)
def test_what_a_missing_package_breaks_fails_and_all_else_is_still_told(module, tmp_path):
    package, failing = BREAKS[module]
    program = (
        f"import sys; sys.modules[{module!r}] = None\n"
        "from raytracer.cli.base.app import main; raise SystemExit(main(['doctor', '--json']))"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, env=environment, cwd=tmp_path
    )
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr
    checks = by_name(done.stdout)
    assert list(checks) == NAMES
    assert {name for name, check in checks.items() if check["status"] == "failed"} == failing
    assert package in checks["packages"]["found"]
    assert "pip install --force-reinstall" in checks["packages"]["remedy"]


def test_what_could_do_better_is_a_warning_with_what_to_do(rt, monkeypatch, tmp_path):
    def no_browser():
        raise webbrowser.Error

    monkeypatch.setattr("raytracer.core.compiler.cache.CACHE_FOLDER", tmp_path / "file" / "kernels")
    (tmp_path / "file").touch()
    monkeypatch.setattr(webbrowser, "get", no_browser)
    monkeypatch.setattr(diagnosis, "memory_limits", lambda: iter([MemoryLimit(5 * 10**8, "left")]))
    monkeypatch.setattr(diagnosis, "available_threads", lambda: 1)
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    checks = by_name(rt("doctor --json").out)
    found = {name: (check["status"], check["found"]) for name, check in checks.items()}
    assert found["threads"] == ("warning", "1 of the machine's 64 processors")
    assert found["memory"] == ("warning", "0.5 GB left")
    assert found["cache"][0] == found["folder"][0] == "warning"
    assert "RAYTRACER_CACHE_DIR" in checks["cache"]["remedy"]
    assert found["browser"] == ("absent", "none here")


def test_every_package_and_extra_of_the_project_is_looked_at():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    required = {re.split(r"[<>=]", text)[0] for text in project["dependencies"]}
    assert set(packages.REQUIRED) == required | {"llvmlite"}
    assert set(packages.EXTRAS) == set(project["optional-dependencies"]) - {"docs", "fuzz", "test"}
