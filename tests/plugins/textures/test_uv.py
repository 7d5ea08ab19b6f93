"""Parameters u and v of surfaces, and tangents, which are their derivatives."""

import numba
import numpy as np
import pytest

from raytracer.core.geometry import Exact
from raytracer.core.primitives.base.interface import hit, sample_point, without_uv
from raytracer.scene.assets import read_mesh
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import SHAPES
from tests.small_scenes import scene
from tests.vectorised import rows, vectorised

OBJ = """
v 0 0 0
v 2 0 0
v 2 1 0
v 0 1 0
vt 0.25 0.5
vt 0.75 0.5
vt 0.75 1.0
vt 0.25 1.0
f 1/1 2/2 3/3
f 1/1 3/3 4/4
"""


def hit_at(table, at, towards, primitive=0):
    """The Hit of the point nearest to `at`, seen along `towards`."""
    direction = np.asarray(towards, np.float64) / np.linalg.norm(towards)
    origin = np.asarray(at, np.float64) - 5.0 * direction
    found = vectorised(hit)(table, primitive, rows([origin]), rows([direction]), 5.0, None, Exact())
    return type(found)(*(values[0] for values in found))


def packed(kind, matrix=None, **parameters):
    spec = SHAPES.specs()[kind].model_validate({"type": kind, **parameters})
    return spec.pack(np.eye(4) if matrix is None else matrix, 0, {})


def mapped_mesh(tmp_path, *, smooth=False):
    path = tmp_path / "plate.obj"
    path.write_text(OBJ)
    spec = SHAPES.specs()["mesh"].model_validate({"type": "mesh", "file": "plate.obj", "smooth": smooth})
    return spec.pack(np.eye(4), 0, {"file": read_mesh(path)})


def test_a_quad_runs_from_its_corner_along_its_edges():
    table = packed("quad", corner=[1, 0, 0], edges=[[2, 0, 0], [0, 3, 0]])
    result = hit_at(table, (1.5, 2.25, 0.0), (0, 0, -1))
    assert (result.u, result.v) == pytest.approx((0.25, 0.75))
    np.testing.assert_allclose(result.point, [1.5, 2.25, 0], atol=1e-12)
    np.testing.assert_allclose([result.tangent, result.bitangent], [[2, 0, 0], [0, 3, 0]], atol=1e-12)


def test_a_sphere_runs_around_its_axis_from_minus_x_and_up_from_the_south_pole():
    # The Next Week, sec. 4.4.
    table = packed("sphere", center=[0, 0, 0], radius=1)
    for point, uv in (
        ((0.0, -1.0, 0.0), (0.5, 0.0)),
        ((0.0, 1.0, 0.0), (0.5, 1.0)),
        ((0.0, 0.0, 1.0), (0.25, 0.5)),
        ((1.0, 0.0, 0.0), (0.5, 0.5)),
        ((0.0, 0.0, -1.0), (0.75, 0.5)),
    ):
        result = hit_at(table, point, [-x for x in point])
        if abs(point[1]) < 1.0:
            np.testing.assert_allclose((result.u, result.v), uv, atol=1e-12)
        else:
            assert result.v == pytest.approx(uv[1], abs=1e-12)


def test_a_disc_runs_around_and_outwards():
    table = packed("disc", center=[0, 0, 0], normal=[0, 0, 1], radius=2)
    assert hit_at(table, (0.0, 0.5, 0.0), (0, 0, -1)).v == pytest.approx(0.25)
    assert hit_at(table, (1.2, -1.6, 0.0), (0, 0, -1)).v == pytest.approx(1.0)


@pytest.mark.parametrize("kind", ["sphere", "quad", "disc", "triangle", "mesh", "smooth mesh"])
def test_tangents_are_derivatives_of_the_point(kind, tmp_path):
    tables = {
        "sphere": lambda: packed("sphere", center=[0.1, 0.2, 0.3], radius=2),
        "quad": lambda: packed("quad", corner=[-1, -1, 0.2], edges=[[3, 0.5, 0], [0, 3, 0.5]]),
        "disc": lambda: packed("disc", center=[0.3, 0.3, 0], normal=[0.1, 0.2, 1], radius=2),
        "triangle": lambda: packed("triangle", vertices=[[-2, -2, 0], [3, -2, 0.5], [0, 3, 0]]),
        "mesh": lambda: mapped_mesh(tmp_path),
        "smooth mesh": lambda: mapped_mesh(tmp_path, smooth=True),
    }
    table = tables[kind]()
    direction, h = (0.1, -0.2, -1.0), 1e-5
    middle = hit_at(table, (0.9, 0.3, 0.0), direction)
    matrix = np.empty((2, 2))
    moved = np.empty((2, 3))
    for row, step in enumerate(((h, 0, 0), (0, h, 0))):
        ahead, behind = (
            hit_at(table, np.array((0.9, 0.3, 0.0)) + sign * np.array(step), direction) for sign in (1, -1)
        )
        matrix[row], moved[row] = (ahead.u - behind.u, ahead.v - behind.v), ahead.point - behind.point
    derivatives = np.linalg.solve(matrix, moved)
    np.testing.assert_allclose([middle.tangent, middle.bitangent], derivatives, atol=1e-5)
    np.testing.assert_array_equal(middle.local, middle.point)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_mesh_has_the_coordinates_of_its_file(tmp_path, smooth):
    table = mapped_mesh(tmp_path, smooth=smooth)
    for x, y, primitive in ((1.5, 0.25, 0), (0.5, 0.75, 1), (1.9, 0.05, 0)):
        result = hit_at(table, (x, y, 0.0), (0, 0, -1), primitive)
        np.testing.assert_allclose((result.u, result.v), (0.25 + x / 4, 0.5 + y / 2), atol=1e-6)
        on = vectorised(sample_point)(table, primitive, (9.0, 8.0, 7.0), rows([x / 2]), rows([y]), None)
        np.testing.assert_allclose((on.u[0], on.v[0]), (0.25, 0.5) + on.point[0, :2] * (0.25, 0.5), atol=1e-6)


def test_degenerate_coordinates_have_no_tangents(tmp_path):
    path = tmp_path / "plate.obj"
    path.write_text(OBJ.replace("vt 0.75 0.5", "vt 0.25 0.5"))
    table = SHAPES.specs()["mesh"].model_validate({"type": "mesh", "file": "plate.obj"})
    result = hit_at(table.pack(np.eye(4), 0, {"file": read_mesh(path)}), (1.5, 0.25, 0.0), (0, 0, -1))
    assert np.isfinite((result.u, result.v)).all()
    assert not np.concatenate([result.tangent, result.bitangent]).any()


@pytest.mark.parametrize(("u", "v"), [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_ply_files_have_coordinates_under_several_names(tmp_path, u, v):
    path = tmp_path / "a.ply"
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", u, v))
    path.write_text(
        f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}element face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0 0.1 0.2\n1 0 0 0.3 0.4\n0 1 0 0.5 0.6\n3 0 1 2\n"
    )
    np.testing.assert_allclose(read_mesh(path).uv, [(0.1, 0.2), (0.3, 0.4), (0.5, 0.6)])


def test_seams_keep_both_of_their_coordinates(tmp_path):
    # The vertex 1 has one coordinate in each triangle.
    path = tmp_path / "seam.obj"
    path.write_text(OBJ.replace("f 1/1 3/3 4/4", "f 1/2 3/3 4/4"))
    mesh = read_mesh(path)
    assert mesh.uv is not None
    corners = [{tuple(mesh.uv[i]) for i in face if not mesh.vertices[i].any()} for face in mesh.faces]
    assert corners == [{(0.25, 0.5)}, {(0.75, 0.5)}]


def test_without_textures_coordinates_are_left_out(tmp_path):
    assert without_uv(mapped_mesh(tmp_path)).uv is None
    plain = (
        "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0]}\nobjects:\n  - {type: mesh, file: plate.obj"
    )
    bare = OBJ.replace("/1", "").replace("/2", "").replace("/3", "").replace("/4", "").replace("vt", "# vt")
    (tmp_path / "bare.obj").write_text(bare)
    mapped = pack(scene(plain + "}\n", filled=False, base=tmp_path)).scene
    unlike = pack(scene(plain.replace("plate", "bare") + "}\n", filled=False, base=tmp_path)).scene
    assert numba.typeof(mapped) == numba.typeof(unlike)
    textured = pack(
        scene(plain + ", material: {type: lambertian, albedo: {type: checker}}}\n", filled=False, base=tmp_path)
    ).scene
    assert textured.primitives[0].uv is not None
