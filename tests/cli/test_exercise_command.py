"""The exercise docs/examples/histogram.py: a new command is one file, found without a change to any other."""

import importlib.util
import shutil
import sys

import numpy as np
import pytest

import raytracer.cli
from tests.repository import ROOT


@pytest.fixture(autouse=True)
def _histogram(here, monkeypatch):
    """Another folder in which commands are looked for, too."""
    assert importlib.util.find_spec("raytracer.cli.histogram") is None
    (here / "commands").mkdir()
    shutil.copy(ROOT / "docs" / "examples" / "histogram.py", here / "commands")
    monkeypatch.setattr(raytracer.cli, "__path__", [*raytracer.cli.__path__, str(here / "commands")])
    yield
    sys.modules.pop("raytracer.cli.histogram", None)


def test_a_command_is_added_by_one_file(rt):
    # Luminances of 1/4, 1, 1 and 1.5, and one pixel each without light and without a number.
    pixels = np.array([[0.25, 1.0, 1.0], [1.5, 0.0, np.nan]])
    np.save("a.npy", np.repeat(pixels[..., None], 3, axis=2))
    assert rt("histogram a.npy --width 6").out.splitlines() == [
        "  -2 EV   16.7 %  ##",
        "  -1 EV    0.0 %",
        "  +0 EV   50.0 %  ######",
        " others   33.3 %",
    ]
    assert "  histogram   Print how many pixels" in rt("--help").out
    text = rt("histogram --help").out
    assert "Usage: rt histogram [OPTIONS] {IMAGE}" in text
    assert "\n    rt histogram outputs/cover.png --width 40\n" in text


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("none.exr", "rt: none.exr: no such file\n"),
        ("black.npy", "rt: black.npy: is black, and has no histogram\n"),
        ("broken.png", "rt: broken.png: "),
        ("black.npy --width 0", "rt: Invalid value for '--width': must be greater than or equal to 1 (see"),
        ("", "rt: Missing argument 'IMAGE' (see 'rt histogram --help')\n"),
    ],
)
def test_wrong_input_is_told_in_one_sentence(here, refused, words, sentence):
    np.save("black.npy", np.zeros((2, 3, 3)))
    (here / "broken.png").write_bytes(b"no picture")
    assert refused(f"histogram {words}").startswith(sentence)
