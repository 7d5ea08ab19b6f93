"""The exercise docs/examples/histogram.py: a new command is one file, found without a change to any other."""

import importlib.util
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Callable

import numpy as np
import pytest

from tests.repository import ROOT

# Looks for commands in another folder, too, and runs `rt` with the arguments that follow.
PROGRAM = """
    import sys
    import raytracer.cli
    raytracer.cli.__path__.append(sys.argv[1])
    from raytracer.cli.base.app import main
    sys.exit(main(sys.argv[2:]))
"""

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def rt(tmp_path):
    folder = tmp_path / "commands"
    folder.mkdir()
    shutil.copy(ROOT / "docs" / "examples" / "histogram.py", folder)

    def run(*words):
        command = [sys.executable, "-c", textwrap.dedent(PROGRAM), str(folder), *words]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    return run


def test_a_command_is_added_by_one_file(rt, tmp_path):
    # Luminances of 1/4, 1, 1 and 1.5, and one pixel each without light and without a number.
    pixels = np.array([[0.25, 1.0, 1.0], [1.5, 0.0, np.nan]])
    np.save(tmp_path / "a.npy", np.repeat(pixels[..., None], 3, axis=2))
    done = rt("histogram", "a.npy", "--width", "6")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "  -2 EV   16.7 %  ##",
        "  -1 EV    0.0 %",
        "  +0 EV   50.0 %  ######",
        " others   33.3 %",
    ]


def test_help_lists_it(rt):
    assert "  histogram   Print how many pixels" in rt("--help").stdout
    done = rt("histogram", "--help")
    assert "Usage: rt histogram [OPTIONS] {IMAGE}" in done.stdout
    assert "\n    rt histogram outputs/cover.png --width 40\n" in done.stdout


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("none.exr",), "rt: none.exr: no such file\n"),
        (("black.npy",), "rt: black.npy: is black, and has no histogram\n"),
        (("broken.png",), "rt: broken.png: "),
        (("black.npy", "--width", "0"), "rt: Invalid value for '--width': must be greater than or equal to 1 (see"),
        ((), "rt: Missing argument 'IMAGE' (see 'rt histogram --help')\n"),
    ],
)
def test_wrong_input_is_told_in_one_sentence(rt, tmp_path, words, sentence):
    np.save(tmp_path / "black.npy", np.zeros((2, 3, 3)))
    (tmp_path / "broken.png").write_bytes(b"no picture")
    done = rt("histogram", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(sentence)
    assert done.stderr.count("\n") == 1


def test_without_the_file_there_is_no_such_command():
    assert importlib.util.find_spec("raytracer.cli.histogram") is None
