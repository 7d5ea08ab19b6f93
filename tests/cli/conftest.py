"""What tests of commands share."""

import shlex
from pathlib import Path

import pytest

from raytracer.cli.base.app import main
from raytracer.cli.base.defaults import KEYS, variable
from raytracer.rendering.progress import CompileBar


@pytest.fixture(autouse=True)
def _silent_compiler(monkeypatch):
    """Keep what a test sees from depending on what has been compiled."""
    monkeypatch.setattr(CompileBar, "show", lambda *_: None)


@pytest.fixture(autouse=True)
def _no_defaults(monkeypatch, tmp_path_factory):
    """Keep it from depending on the defaults of whoever runs the tests."""
    for key in KEYS:
        monkeypatch.delenv(variable(key), raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.getbasetemp() / "no_config"))


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A new folder, which is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def rt(capsys):
    """Run a command line in this process; returns what it prints to stdout and to stderr."""

    def run(*words, status=0):
        capsys.readouterr()
        command = shlex.split(words[0]) if len(words) == 1 else [str(word) for word in words]
        returned = main(command)
        captured = capsys.readouterr()
        assert returned == status, captured.err
        return captured

    return run


@pytest.fixture
def refused(rt):
    """Run a command line that is refused in one sentence, and writes nothing; returns the sentence."""

    def run(*words, status=2):
        before = sorted(Path().rglob("*"))
        out, err = rt(*words, status=status)
        assert out == ""
        assert err.startswith("rt: ")
        assert err.endswith("\n")
        assert err.count("\n") == 1
        for jargon in ("Traceback", "Input should", "validation error", "[type=", "None", "internal error"):
            assert jargon not in err
        assert sorted(Path().rglob("*")) == before
        return err

    return run
