"""The scenes of light fields, and the files that they are made of."""

import runpy

import numpy as np
import pytest

from raytracer.scene.load import load
from tests.repository import ROOT, SCENES

FILES = sorted((SCENES / "lightfield").glob("*.yaml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_scene_holds_a_light_field_and_says_what_to_look_at_and_to_change(path):
    text = path.read_text(encoding="utf-8")
    assert "# Look at: " in text.partition("camera:")[0]
    assert "# Change: " in text
    spec = load(path)
    views = spec.camera.layout(spec.film.width, spec.film.height).views
    assert views.rows * views.columns > 9
    assert views.columns > 1
    assert views.pose is not None


def test_the_letters_are_those_that_their_program_writes():
    written = runpy.run_path(str(ROOT / "scenes" / "generate" / "letters.py"))
    for name, strips in written["LETTERS"].items():
        assert (SCENES / "lightfield" / "letters" / f"{name}.ply").read_bytes() == written["ply"](strips), name


def test_the_dragon_is_one_skin_with_whole_triangles():
    """Each edge of its body has two triangles, but for the rings at the tip of the tail and at the nose."""
    written = runpy.run_path(str(ROOT / "scenes" / "generate" / "dragon.py"))
    vertices, triangles = written["skin"]()
    assert np.isfinite(vertices).all()
    assert vertices[:, 1].min() >= 0.0
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    _, count = np.unique(edges.min(axis=1) * len(vertices) + edges.max(axis=1), return_counts=True)
    assert set(count) == {1, 2}
    assert (count == 1).sum() == 2 * written["AROUND"]
