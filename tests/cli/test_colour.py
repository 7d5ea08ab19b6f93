"""Colours of what is said: where a terminal shows them, and nowhere else."""

import io
import os
import subprocess
import sys

import pytest

from raytracer.cli.base.app import _FailsafeStream
from raytracer.util.terminal import RED, has_color, paint

MAIN = "from raytracer.cli.main import main; raise SystemExit(main())"


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(autouse=True)
def no_settings(monkeypatch):
    for name in ("NO_COLOR", "FORCE_COLOR", "CLICOLOR", "CLICOLOR_FORCE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")


@pytest.mark.parametrize(
    ("settings", "on_terminal", "in_pipe"),
    [
        ({}, True, False),
        ({"NO_COLOR": "1"}, False, False),
        ({"NO_COLOR": "1", "FORCE_COLOR": "1"}, False, False),
        ({"FORCE_COLOR": "1"}, True, True),
        ({"CLICOLOR_FORCE": "1"}, True, True),
        ({"FORCE_COLOR": "0"}, True, False),
        ({"CLICOLOR": "0"}, False, False),
        ({"TERM": "dumb"}, False, False),
    ],
)
def test_variables_and_the_terminal_decide(settings, on_terminal, in_pipe, monkeypatch):
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    assert (has_color(Terminal()), has_color(io.StringIO())) == (on_terminal, in_pipe)
    assert ("\x1b[1;31m" in paint("rt:", RED, Terminal())) is on_terminal


def test_warnings_of_all_commands_are_yellow_and_nothing_else_is():
    shown = Terminal()
    stream = _FailsafeStream(shown)
    print("rt: warning: no light", file=stream)
    print("rt: out of time", file=stream)
    assert shown.getvalue() == "\x1b[1;33mrt: warning:\x1b[0m no light\nrt: out of time\n"


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo-terminal")
def test_an_error_is_red_on_a_terminal_and_plain_in_a_pipe(here):
    controller, terminal = os.openpty()
    command = [sys.executable, "-c", MAIN, "validate", "none.yaml"]
    assert subprocess.run(command, stderr=terminal, check=False).returncode == 2
    assert os.read(controller, 1000) == b"\x1b[1;31mrt:\x1b[0m none.yaml: no such file\r\n"
    assert subprocess.run(command, stderr=subprocess.PIPE, check=False).stderr == b"rt: none.yaml: no such file\n"
