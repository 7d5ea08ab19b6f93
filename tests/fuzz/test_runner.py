"""The runner finds mistakes that were planted, of every kind that it says it finds, and none where there are none."""

import json
import subprocess
import sys

import pytest

from tests.repository import ROOT

pytest.importorskip("atheris", reason="atheris has wheels for Linux on x86-64 alone", exc_type=ImportError)


def fuzz(*arguments):
    command = [sys.executable, "-m", "tests.fuzz", *map(str, arguments), "--json"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    (result,) = json.loads(done.stdout)
    return done.returncode, result


def test_planted_mistakes_are_found(tmp_path):
    status, result = fuzz("planted", "--executions", 2500, "--findings", tmp_path)
    assert status == 1
    # Each once, by the line that it comes from, however often it was met.
    assert [name.split("-")[0] for name in result["findings"]] == ["RecursionError", "ValueError", "memory"]
    # None of them ended the run.
    assert result["executions"] == 2500


def test_what_hangs_is_found(tmp_path):
    status, result = fuzz("planted_hang", "--executions", 5000, "--timeout", 1, "--findings", tmp_path)
    assert status == 1
    # On a busy machine anything may take a second.
    name = next(name for name in result["findings"] if name.startswith("hang-targets.planted-"))
    assert (tmp_path / "planted_hang" / f"{name}.input").read_bytes().startswith(b"ha")
    assert "in hang" in (tmp_path / "planted_hang" / f"{name}.txt").read_text()


def test_a_sound_loader_passes(tmp_path):
    status, result = fuzz("mesh_stl", "--executions", 300, "--findings", tmp_path)
    assert status == 0
    assert result["findings"] == []
    assert result["executions"] == 300
