"""`rt render --tev`, whose value may be left out."""

import re
import socket

import numpy as np
import pytest

from raytracer.cli.base.optional_values import add_left_out_values
from raytracer.film import load
from raytracer.rendering.tev.viewer import DEFAULT_ADDRESS
from tests.cli.test_render import SCENE
from tests.rendering.tev.receiver import Receiver
from tests.repository import ROOT


@pytest.mark.parametrize(
    ("line", "completed"),
    [
        ("render a.yaml --tev", "render a.yaml --tev 127.0.0.1:14158"),
        ("render --tev a.yaml", "render --tev 127.0.0.1:14158 a.yaml"),
        ("render --tev -q a.yaml", "render --tev 127.0.0.1:14158 -q a.yaml"),
        ("render --tev host:1 a.yaml", "render --tev host:1 a.yaml"),
        ("render --tev=host:1 a.yaml", "render --tev=host:1 a.yaml"),
    ],
)
def test_a_value_that_is_left_out_is_the_default(line, completed):
    assert add_left_out_values(line.split()) == completed.split()
    assert str(DEFAULT_ADDRESS) in add_left_out_values(["--tev"])


def test_what_cannot_be_shown_is_refused(here, refused):
    (here / "a.yaml").write_text(SCENE)
    assert (
        refused("render a.yaml --tev host:99999")
        == "rt: --tev host:99999: must be HOST:PORT, such as 127.0.0.1:14158\n"
    )
    assert "--tev is for pictures" in refused("render a.yaml --tev --debug --pixel 1,1")


def test_a_render_of_a_command_arrives_whole_as_its_file_has_it(here, rt):
    (here / "ball.yaml").write_text(SCENE)
    with Receiver() as receiver:
        err = rt(f"render ball.yaml -o ball.npy --crop 3,2,20,15 --tev {receiver.address}").err
        receiver.wait()
    assert "warning" not in err
    assert list(receiver.images) == ["ball.npy"]
    assert np.array_equal(receiver.images["ball.npy"], load("ball.npy").astype(np.float32))
    # Made once, and brought to the front once.
    assert receiver.operations.count(4) == 1
    assert receiver.focused == ["ball.npy"]


PAGE = (ROOT / "docs" / "tev.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("line", re.findall(r"^rt (render .*--tev.*)$", PAGE, re.MULTILINE))
def test_what_the_page_shows_works(line, here, rt):
    (here / "scenes").mkdir()
    (here / "scenes" / "cover.yaml").write_text(SCENE)
    with Receiver() as receiver:
        words = [
            word for word in line.split() if word != "desk.example:14158" and not word.startswith("camera.defocus")
        ]
        words = [word for word in words if word != "-D"]
        words.insert(words.index("--tev") + 1, receiver.address)
        assert "warning" not in rt(*words, "--spp", "8").err
        receiver.wait()
    (name,) = receiver.images
    assert (here / name).is_file()


def test_the_page_has_the_sentence_of_a_viewer_that_is_missing(here, rt):
    (here / "a.yaml").write_text(SCENE)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    warning, _ = rt(f"render a.yaml --tev 127.0.0.1:{port}").err.splitlines()
    assert warning.replace(str(port), "14158") in PAGE
