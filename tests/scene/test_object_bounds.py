"""Where objects are: the middles of what they are made of, carried by transforms, motions and placements."""

import numpy as np
import pytest

from raytracer.core.primitives.base.interface import bounds
from raytracer.scene.object_bounds import ObjectBounds
from raytracer.scene.pack.scene import pack
from raytracer.scene.scene_assets import SceneAssets
from tests.scene.assets.test_meshes import ply_text
from tests.small_scenes import scene

CAMERA = "camera: {type: pinhole, look_from: [0, 0, 9]}\n"


def write_ply(path, *vertices):
    path.write_bytes(ply_text([(0, 1, 2)], vertices))


def where(objects, *, groups="", base=None):
    spec = scene(CAMERA + groups + "objects:\n" + objects, filled=False, base=base)
    return ObjectBounds(spec, SceneAssets(spec))


@pytest.mark.parametrize(
    ("item", "center"),
    [
        ("{type: sphere, center: [1, 2, 3], radius: -2}", (1, 2, 3)),
        ("{type: box, min: [0, 1, 2], max: [4, 2, 8]}", (2, 1.5, 5)),
        ("{type: quad, corner: [1, 0, 0], edges: [[2, 0, 0], [0, 4, 0]]}", (2, 2, 0)),
        ("{type: disc, center: [1, -1, 0], normal: [1, 2, 3], radius: 2}", (1, -1, 0)),
        ("{type: triangle, vertices: [[0, 0, 0], [4, 0, 0], [0, 2, 1]]}", (2, 1, 0.5)),
        # The transform happens to the object: the box is that of before it.
        ("{type: sphere, center: [1, 0, 0], radius: 1, transform: [{scale: [3, 1, 1]}]}", (3, 0, 0)),
        (
            "{type: box, min: [0, 0, 0], max: [2, 2, 4], transform: [{rotate: {axis: [0, 0, 1], angle: 90}}]}",
            (-1, 1, 2),
        ),
    ],
)
def test_the_middle_of_each_shape(item, center):
    np.testing.assert_allclose(where(f"  - {item}").center(0, 0.0), center, rtol=0, atol=1e-12)


def test_vertices_that_no_triangle_has_do_not_count(tmp_path):
    write_ply(tmp_path / "a.ply", (0, 0, 0), (4, 0, 0), (0, 2, 6), (99, 99, 99))
    found = where("  - {type: mesh, file: a.ply, transform: [{translate: [0, 0, 1]}]}", base=tmp_path)
    np.testing.assert_allclose(found.center(0, 0.0), (2, 1, 4))


def test_frames_have_the_form_of_their_time(tmp_path):
    write_ply(tmp_path / "a.ply", (0, 0, 0), (4, 0, 0), (0, 2, 0))
    write_ply(tmp_path / "b.ply", (0, 0, 0), (4, 0, 0), (0, 6, 0))
    found = where("  - {type: mesh, frames: [{time: 0, file: a.ply}, {time: 2, file: b.ply}]}", base=tmp_path)
    assert found.moves(0)
    for time, height in ((-1.0, 1.0), (0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (5.0, 3.0)):
        np.testing.assert_allclose(found.center(0, time), (2, height, 0))


def test_motion_carries_the_middle():
    found = where(
        "  - {type: sphere, center: [1, 0, 0], radius: 1, motion: {velocity: [0, 2, 0]}}\n"
        "  - {type: box, min: [1, -1, -1], max: [3, 1, 1], motion: {spin: {axis: [0, 0, 1], rate: 90 deg/s}}}\n"
        "  - {type: sphere, center: [0, 0, 0], radius: 1}\n"
    )
    np.testing.assert_allclose(found.center(0, 1.5), (1, 3, 0), atol=1e-12)
    np.testing.assert_allclose(found.center(1, 1.0), (0, 2, 0), atol=1e-12)
    assert [found.moves(number) for number in range(3)] == [True, True, False]
    # The corners turn with the box: by 90 degrees its x becomes its y.
    np.testing.assert_allclose(sorted(found.corners(1, 1.0)[:, 1]), [1] * 4 + [3] * 4, atol=1e-12)


GROUPS = """groups:
  pair:
    - {type: sphere, center: [0, 0, 0], radius: 1}
    - {type: sphere, center: [4, 0, 0], radius: 1, motion: {velocity: [2, 0, 0]}}
  four:
    - {type: instance, of: pair}
    - {type: instance, of: pair, transform: [{translate: [0, 10, 0]}]}
"""


def test_what_is_placed_is_boxed_as_a_whole():
    found = where(
        "  - {type: instance, of: pair, transform: [{translate: [0, 0, 5]}]}\n"
        "  - {type: instance, of: four, motion: {velocity: [0, 0, 1]}}\n"
        "  - {type: instance, of: ball, placements: [[{translate: [0, 6, 0]}], [{translate: [0, 0, 2]}]]}\n"
        "  - {type: sphere, name: ball, center: [1, 0, 0], radius: 1}\n",
        groups=GROUPS,
    )
    np.testing.assert_allclose(found.center(0, 0.0), (2, 0, 5))
    np.testing.assert_allclose(found.center(0, 1.0), (3, 0, 5))
    np.testing.assert_allclose(found.center(1, 1.0), (3, 5, 1))
    np.testing.assert_allclose(found.center(2, 0.0), (1, 3, 1))
    assert [found.moves(number) for number in range(4)] == [True, True, False, False]


def test_bounds_are_those_of_points_on_the_primitives():
    text = CAMERA + (
        "objects:\n"
        "  - {type: disc, center: [1, -1, 0], normal: [1, 2, 3], radius: 2}\n"
        "  - {type: disc, center: [3, 1, 2], normal: [0, 1, 0], radius: 0.5}\n"
    )
    (table,) = pack(scene(text, filled=False)).scene.primitives
    rim = []
    for center, normal, radius in zip(table.center, table.normal, table.radius, strict=True):
        across = np.linalg.svd(normal[None])[2][1:]
        angle = np.linspace(0.0, 2.0 * np.pi, 100_001)
        rim.append(center + radius * (np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]))
    low, high = bounds(table)
    np.testing.assert_allclose(low, np.concatenate(rim).min(axis=0), atol=1e-8)
    np.testing.assert_allclose(high, np.concatenate(rim).max(axis=0), atol=1e-8)
