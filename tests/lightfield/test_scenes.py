"""The scenes of light fields, and the files that they are made of."""

import runpy

import pytest

from raytracer.scene.load import load
from tests.repository import ROOT, SCENES

FILES = sorted((SCENES / "lightfield").glob("*.yaml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_scene_holds_a_light_field(path):
    spec = load(path)
    layout = spec.camera.layout(spec.film.width, spec.film.height)
    views = layout.views
    assert views.rows > 1
    assert views.columns > 1
    assert views.pose is not None


def test_the_letters_are_those_that_their_program_writes():
    written = runpy.run_path(str(ROOT / "scenes" / "generate" / "letters.py"))
    for name, strips in written["LETTERS"].items():
        assert (SCENES / "lightfield" / "letters" / f"{name}.ply").read_bytes() == written["ply"](strips), name
