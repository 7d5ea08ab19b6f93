"""Meshes: one geometry whatever the format, normals against closed forms and a peer, and broken files."""

import builtins
import struct
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from raytracer.scene.assets.meshes import _checked, read_mesh, smooth_normals
from raytracer.scene.assets.raw_mesh import RawMesh
from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError

# A pyramid over the unit square: a quad and four triangles, seen from outside.
VERTICES = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.5, 0.5, 1.25)]
POLYGONS = [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
TRIANGLES = [(0, 3, 2), (0, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]

PLY_HEADER = """ply
format {format} 1.0
comment a comment
element vertex {vertices}
property {type} x
property {type} y
property {type} z
element face {faces}
property list uchar int vertex_indices
end_header
"""


def soup(mesh):
    """The corners of all triangles, in an order that formats and their readers cannot change."""
    corners = mesh.vertices[mesh.faces]
    first = np.array([min(range(3), key=lambda k: tuple(t[k])) for t in corners])
    turned = [np.roll(t, -k, axis=0).tolist() for t, k in zip(corners, first, strict=True)]
    return sorted(turned)


EXPECTED = soup(RawMesh(np.array(VERTICES), np.array(TRIANGLES), None))


def ply_text(polygons=POLYGONS, vertices=VERTICES):
    header = PLY_HEADER.format(format="ascii", vertices=len(vertices), faces=len(polygons), type="double")
    rows = [" ".join(map(str, v)) for v in vertices] + [f"{len(p)} " + " ".join(map(str, p)) for p in polygons]
    return (header + "\n".join(rows) + "\n").encode()


def ply_binary(order="<", polygons=POLYGONS, vertices=VERTICES, code="f"):
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    kind = {"f": "float", "d": "double"}[code]
    header = PLY_HEADER.format(format=name, vertices=len(vertices), faces=len(polygons), type=kind).encode()
    body = b"".join(struct.pack(f"{order}3{code}", *v) for v in vertices)
    return header + body + b"".join(struct.pack(f"{order}B{len(p)}i", len(p), *p) for p in polygons)


def obj_text(polygons=POLYGONS, vertices=VERTICES):
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + ["f " + " ".join(str(i + 1) for i in p) for p in polygons]
    return ("\n".join(lines) + "\n").encode()


def stl_binary(triangles=TRIANGLES, vertices=VERTICES):
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *(x for i in t for x in vertices[i]), 0) for t in triangles)
    return b"solid that says it is text".ljust(80) + struct.pack("<I", len(triangles)) + body


def stl_text(triangles=TRIANGLES, vertices=VERTICES):
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*vertices[i]) for i in t)
        + "endloop\nendfacet\n"
        for t in triangles
    ]
    return ("solid pyramid\n" + "".join(facets) + "endsolid pyramid\n").encode()


def glb(triangles=TRIANGLES):
    return trimesh.Trimesh(VERTICES, triangles, process=False).export(file_type="glb")


def ply_with_more(polygons):
    """Elements, properties and lists that are no concern of the mesh's geometry, before, between and after it."""
    header = (
        b"ply\nformat binary_little_endian 1.0\nobj_info made by hand\n"
        b"element material 2\nproperty list uchar float weights\nproperty short id\n"
        b"element vertex 5\nproperty uchar red\nproperty float x\nproperty float y\nproperty float z\n"
        b"element face %d\nproperty uchar flags\nproperty list ushort uint vertex_index\n"
        b"property list uchar float texcoord\nelement camera 1\nproperty int a\nend_header\n"
    )
    body = struct.pack("<B2fh", 2, 1, 2, 3) + struct.pack("<B2fh", 2, 0, 1, 3)
    body += b"".join(struct.pack("<B3f", 7, *v) for v in VERTICES)
    for p in polygons:
        uv = [0.5, 0.25] * len(p)
        body += struct.pack(f"<BH{len(p)}IB{len(uv)}f", 1, len(p), *p, len(uv), *uv)
    return header % len(polygons) + body + struct.pack("<i", 3)


FILES = {
    "text.ply": ply_text(),
    "little.ply": ply_binary("<"),
    "big.ply": ply_binary(">"),
    "double.ply": ply_binary("<", code="d"),
    "triangles.ply": ply_binary("<", TRIANGLES),
    "big_triangles.ply": ply_binary(">", TRIANGLES, code="d"),
    "text_triangles.ply": ply_text(TRIANGLES),
    "index.ply": ply_binary("<").replace(b"vertex_indices", b"vertex_index"),
    "windows.ply": ply_text().replace(b"\n", b"\r\n"),
    "plain.obj": obj_text(),
    "triangles.obj": obj_text(TRIANGLES),
    "windows.obj": obj_text().replace(b"\n", b"\r\n"),
    "binary.stl": stl_binary(),
    "text.stl": stl_text(),
    "UPPER.STL": stl_text().upper().replace(b"E+", b"e+"),
    "scene.glb": glb(),
    "more.ply": ply_with_more(POLYGONS),
    "more_triangles.ply": ply_with_more(TRIANGLES),
}


@pytest.fixture
def written(tmp_path):
    def write(name, data):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


# ---- one geometry whatever the format ----


@pytest.mark.parametrize("name", FILES)
def test_every_format_gives_the_same_triangles(name, written):
    mesh = read_mesh(written(name, FILES[name]))
    assert soup(mesh) == EXPECTED
    assert len(mesh.vertices) == 5
    assert (mesh.normals, mesh.degenerate) == (None, 0)
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float64, np.uint32)
    assert mesh.vertices.flags.c_contiguous
    assert mesh.faces.flags.c_contiguous


@pytest.mark.parametrize("code", ["f", "d"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_ply_file_that_is_as_long_as_one_of_quads(order, code, written):
    # A quad, a pentagon and a triangle have the corners of three quads.
    polygons = [(0, 3, 2, 1), (0, 1, 2, 3, 4), (1, 2, 4)]
    expected = soup(read_mesh(written("a.ply", ply_text(polygons))))
    assert len(expected) == 6
    assert soup(read_mesh(written("b.ply", ply_binary(order, polygons, code=code)))) == expected


@pytest.mark.parametrize(("polygons", "edges"), [(POLYGONS, True), (TRIANGLES, False)])
def test_a_ply_file_as_blender_writes_it(polygons, edges, written):
    # Normals, colours and texture coordinates of the vertices, quads beside triangles, and edges without a face.
    names = [f"float {n}" for n in ("x", "y", "z", "nx", "ny", "nz")] + [f"uchar {n}" for n in ("red", "green", "blue")]
    lines = ["ply", "format binary_little_endian 1.0", "comment Created in a modeller", "element vertex 5"]
    lines += [f"property {n}" for n in [*names, "float s", "float t"]]
    lines += [f"element face {len(polygons)}", "property list uchar uint vertex_indices"]
    lines += ["element edge 1", "property int vertex1", "property int vertex2"] * edges
    body = b"".join(struct.pack("<6f3B2f", *v, 0, 0, 2, 1, 2, 3, 0.25, i) for i, v in enumerate(VERTICES))
    body += b"".join(struct.pack(f"<B{len(p)}I", len(p), *p) for p in polygons)
    header = "\n".join([*lines, "end_header", ""]).encode()
    mesh = read_mesh(written("a.ply", header + body + struct.pack("<2i", 0, 4) * edges))
    assert soup(mesh) == EXPECTED
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1]] * 5)


def test_obj_indices_below_zero_count_back_from_their_face(written):
    # The format's own rule; the second vertex -1 is not the first.
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 0 2\nv 1 0 2\nv 1 1 2\nf -3 -2 -1\nf 1 -1 2\n"
    vertices = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 2), (1, 0, 2), (1, 1, 2)], dtype=float)
    expected = RawMesh(vertices, np.array([(0, 1, 2), (3, 4, 5), (0, 5, 1)]), None)
    assert soup(read_mesh(written("a.obj", text))) == soup(expected)
    counted = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nv 0 0 2\nv 1 0 2\nv 1 1 2\nf 4 5 6\nf 1 6 2\n"
    assert soup(read_mesh(written("b.obj", counted))) == soup(expected)


def test_obj_with_everything_that_is_left_out(written):
    text = (
        b"# a comment\nmtllib none.mtl\no thing\ng group\nusemtl red\ns off\n"
        b"  v 0 0 0 1 0 0\n\tv\t1 0 0 # a corner\nv 1 1 0 1.0\nv 0 1 \\\n0\nv 0.5 0.5 1.25\nvt 0 0\nvt 1 0\nvt 0 1\n"
        b"f 1/1 4/2 3/3 2/1\nusemtl blue\nf 1 2 5 # a comment\nf 2/1 3/2 5/3\nl 1 2\nf 3// 4// 5//\nf 4 1 5"
    )
    assert soup(read_mesh(written("a.obj", text))) == EXPECTED


def test_obj_faces_that_have_as_many_numbers_but_are_written_otherwise(written):
    # A hexagon, triangles with texture coordinates and triangles with normals are six numbers each.
    hexagon = "v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 2 0\nv -1 1 0\nvt 0 0\nvn 0 0 1\n"
    faces = ["f 1 2 3 4 5 6", "f 1//1 2//1 3//1", "f 1/1 2/1 4/1", "f 2//-1 3//-1 5//-1", "f 1/1/1 3/1/1 5/1/1"]
    vertices = np.array([line.split()[1:] for line in hexagon.splitlines()[:6]], dtype=float)
    fan = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    expected = soup(RawMesh(vertices, np.array([*fan, (0, 1, 2), (0, 1, 3), (1, 2, 4), (0, 2, 4)]), None))
    for order in (faces, faces[::-1]):
        assert soup(read_mesh(written("a.obj", (hexagon + "\n".join(order)).encode()))) == expected


def test_obj_faces_between_their_vertices_count_back_from_where_they_stand(written, monkeypatch):
    # A triangle after each three vertices, as many programs write them; parsed together, and a few lines at a time.
    corners = np.random.default_rng(6).normal(size=(500, 3, 3)).round(6)
    text = "".join("".join(f"v {x} {y} {z}\n" for x, y, z in t) + "f -3 -2 -1\nvt 0 0\nf -1 -2 -3\n" for t in corners)
    expected = np.stack([corners, corners[:, ::-1]], axis=1).reshape(-1, 3, 3)
    for most in (1 << 20, 100):
        monkeypatch.setattr("raytracer.scene.assets.obj._BATCH", most)
        mesh = read_mesh(written("a.obj", text.encode()))
        np.testing.assert_array_equal(mesh.vertices[mesh.faces], expected)


def test_obj_lines_of_different_lengths_keep_their_numbers(written):
    # Six lines of 18 numbers in all, as if each had three.
    text = b"v 0 0 0 9\nv 1 0\nv 0 1 0\nv 0 0 1\nv 1 1 1\nv 2 2 2\nf 1 2 3\n"
    with pytest.raises(InputError, match="has a vertex without 3 coordinates"):
        read_mesh(written("a.obj", text))
    coloured = text.replace(b"v 1 0\n", b"v 1 0 0 nan 0 red\n")
    mesh = read_mesh(written("a.obj", coloured))
    assert mesh.vertices[mesh.faces].tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]


def test_obj_references_to_what_is_not_there(written):
    # A vertex that is missing is an error; texture coordinates and normals that are, are none.
    text = obj_text([]) + b"vt 0.5 0.25\nvn 0 0 1\n"
    mesh = read_mesh(written("a.obj", text + b"f 1/1/9 2/1/9 3/1/9\nf 1/9 2/9 4/9\n"))
    assert mesh.normals is None
    assert sorted(mesh.uv.tolist()) == [[0, 0]] * 3 + [[0.5, 0.25]] * 3
    with pytest.raises(InputError, match="IndexError: index 8 is out of bounds"):
        read_mesh(written("b.obj", text + b"f 1/1/1 2/1/1 9/1/1\n"))


def test_triangles_keep_their_order(written):
    # What is drawn at random among triangles depends on it.
    faces = np.random.default_rng(8).permutation(TRIANGLES * 3)
    own = np.array(VERTICES)[faces]
    for name, data in (
        ("a.obj", obj_text(faces)),
        ("a.ply", ply_text(faces)),
        ("b.ply", ply_binary(">", faces)),
        ("a.stl", stl_binary(faces)),
    ):
        mesh = read_mesh(written(name, data))
        np.testing.assert_array_equal(mesh.vertices[mesh.faces], own)


def test_meshes_are_read_without_other_libraries(written):
    paths = [str(written(name, data)) for name, data in FILES.items()]
    program = (
        "import sys\nfrom raytracer.scene.assets import read_mesh\n"
        "for path in sys.argv[1:]: read_mesh(path)\n"
        "print({'trimesh', 'meshio', 'scipy', 'numba'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program, *paths], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_no_file_beside_the_mesh_is_opened(written, tmp_path, monkeypatch):
    opened = []
    own = builtins.open
    read_mesh(written("first.obj", obj_text()))
    monkeypatch.setattr(builtins, "open", lambda file, *a, **k: opened.append(file) or own(file, *a, **k))
    (tmp_path / "a.mtl").write_text("newmtl red\nmap_Kd a.png\n")
    (tmp_path / "a.png").write_bytes(b"no picture")
    read_mesh(written("a.obj", b"mtllib a.mtl\nusemtl red\n" + obj_text()))
    read_mesh(written("a.ply", ply_text().replace(b"comment a comment", b"comment TextureFile a.png")))
    assert [file.name for file in opened] == ["a.obj", "a.ply"]


def test_an_ngon_is_a_fan_around_its_first_corner(written):
    angles = np.arange(6) * np.pi / 3
    hexagon = [(float(np.cos(a)), float(np.sin(a)), 0.0) for a in angles]
    for name, data in (("a.obj", obj_text([range(6)], hexagon)), ("a.ply", ply_text([range(6)], hexagon))):
        assert read_mesh(written(name, data)).faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]


def test_stl_corners_that_are_equal_are_one_vertex_and_so_are_the_two_zeros(written):
    data = stl_text().replace(b"vertex 0.0 ", b"vertex -0.0 ", 3)
    assert len(read_mesh(written("a.stl", data)).vertices) == 5


def test_polygons_of_all_sizes_keep_their_area(written):
    # Regular polygons: n - 2 triangles, of n/2 sin(2 pi/n) in all, all facing the same way.
    sizes = np.random.default_rng(1).integers(3, 9, 500)
    vertices = []
    polygons = []
    for i, n in enumerate(sizes):
        angles = 2 * np.pi * np.arange(n) / n
        polygons.append(range(len(vertices), len(vertices) + n))
        vertices += [(float(np.cos(a)), float(np.sin(a)), float(i)) for a in angles]
    area = float(np.sum(sizes / 2 * np.sin(2 * np.pi / sizes)))
    files = {"a.obj": obj_text(polygons, vertices), "a.ply": ply_text(polygons, vertices)}
    for name, data in {**files, "b.ply": ply_binary("<", polygons, vertices, "d")}.items():
        mesh = read_mesh(written(name, data))
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a) / 2
        assert len(mesh.faces) == np.sum(sizes - 2)
        assert (normals[:, 2] > 0).all()
        assert normals.sum(axis=0) == pytest.approx([0, 0, area])


def test_glb_nodes_are_placed_and_a_mirrored_one_keeps_its_outside(written):
    ball = trimesh.creation.icosphere(2)
    ball = trimesh.Trimesh(ball.vertices, ball.faces, vertex_normals=ball.vertices, process=False)
    scale = np.diag([-2.0, 1.0, 3.0, 1.0])
    scale[:3, 3] = [10, 0, 0]
    scene = trimesh.Scene()
    scene.add_geometry(ball, node_name="plain")
    scene.add_geometry(ball, node_name="mirrored", transform=scale)
    mesh = read_mesh(written("a.glb", scene.export(file_type="glb")))

    # On the ellipsoid x^2/4 + y^2 + z^2/9 = 1 around (10, 0, 0) the normal goes as (x/4, y, z/9).
    right = mesh.vertices[:, 0] > 4
    p = mesh.vertices - np.where(right[:, None], [10, 0, 0], 0)
    expected = p / np.where(right[:, None], [4, 1, 9], 1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert right.sum() == len(ball.vertices)
    np.testing.assert_allclose(mesh.normals, expected, atol=2e-6)

    # The signed volume by the divergence theorem is that of the ball, and six times that, both positive.
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    in_mirrored = right[mesh.faces[:, 0]]
    assert volumes[~in_mirrored].sum() == pytest.approx(ball.volume, rel=1e-6)
    assert volumes[in_mirrored].sum() == pytest.approx(6 * ball.volume, rel=1e-6)


# ---- normals ----


def test_normals_of_an_obj_file_split_only_vertices_that_have_several(written):
    text = obj_text([(0, 1, 2)]) + b"vn 0 0 2\nvn 0 3 0\nf 1//1 3//2 4//-2\nf 1//1 2//1 3//1\n"
    mesh = read_mesh(written("a.obj", text.replace(b"f 1 2 3\n", b"")))
    of_corners = mesh.normals[mesh.faces].tolist()
    z, y = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]
    assert of_corners == [[z, y, z], [z, z, z]]
    assert len(mesh.vertices) == 5  # four that are used, one of them twice


def test_normals_of_a_ply_file_are_made_unit(written):
    data = ply_text().replace(b"property double z\n", b"property double z\n" + b"property float n%b\n" * 3)
    data = data.replace(b"n%b", b"nx", 1).replace(b"n%b", b"ny", 1).replace(b"n%b", b"nz", 1)
    head, body = data.split(b"end_header\n")
    rows = body.split(b"\n")
    rows[:5] = [row + b" 0 0 -1e-30" for row in rows[:4]] + [rows[4] + b" 3 0 4"]
    mesh = read_mesh(written("a.ply", head + b"end_header\n" + b"\n".join(rows)))
    np.testing.assert_allclose(mesh.normals, [[0, 0, -1]] * 4 + [[0.6, 0, 0.8]], rtol=1e-15)


@pytest.mark.parametrize("bad", ["0 0 0", "nan 0 1", "inf 0 0"])
def test_a_normal_that_is_none_is_computed(bad, written):
    text = obj_text([]) + f"vn 1 0 0\nvn {bad}\n".encode()
    text += b"".join(
        b"f " + b" ".join(b"%d//%d" % (i + 1, 2 if i == 4 else 1) for i in triangle) + b"\n" for triangle in TRIANGLES
    )
    mesh = read_mesh(written("a.obj", text))
    np.testing.assert_allclose(mesh.normals, [[1, 0, 0]] * 4 + [[0, 0, 1]], atol=1e-15)


def test_smooth_normals_are_those_of_a_peer():
    # trimesh 5.2 weights by the angle too.
    rng = np.random.default_rng(2)
    ball = trimesh.creation.icosphere(3)
    vertices = ball.vertices * rng.uniform(0.8, 1.2, (len(ball.vertices), 1))
    peer = trimesh.Trimesh(vertices, ball.faces, process=False)
    np.testing.assert_allclose(smooth_normals(vertices, ball.faces), peer.vertex_normals, atol=1e-10)


@pytest.mark.parametrize("scale", [1e-30, 1e-3, 1e6, 1e30])
def test_smooth_normals_have_no_scale(scale):
    ball = trimesh.creation.icosphere(2)
    expected = smooth_normals(ball.vertices, ball.faces)
    np.testing.assert_allclose(smooth_normals(ball.vertices * scale, ball.faces), expected, atol=1e-12)


def test_a_seam_leaves_no_trace_in_smooth_normals():
    ball = trimesh.creation.icosphere(2)
    vertices, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    torn = vertices[faces.reshape(-1)]
    normals = smooth_normals(torn, np.arange(len(torn)).reshape(-1, 3))
    np.testing.assert_allclose(normals, smooth_normals(vertices, faces)[faces.reshape(-1)], atol=1e-12)


def test_vertex_normals_are_those_of_the_file_or_else_made(written):
    plain = read_mesh(written("a.obj", obj_text()))
    np.testing.assert_array_equal(plain.vertex_normals(), smooth_normals(plain.vertices, plain.faces))
    text = obj_text([(0, 1, 2)]).replace(b"f 1 2 3", b"vn 0 1 0\nf 1//1 2//1 3//1")
    own = read_mesh(written("b.obj", text))
    np.testing.assert_array_equal(own.vertex_normals()[:3], [[0, 1, 0]] * 3)


def test_the_two_sides_of_a_sheet_keep_their_normals_and_a_lone_vertex_has_none():
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)] * 2 + [(5, 5, 5)], dtype=float)
    normals = smooth_normals(vertices, np.array([(0, 1, 2), (3, 5, 4)]))
    np.testing.assert_array_equal(normals, [[0, 0, 1]] * 3 + [[0, 0, -1]] * 3 + [[0, 0, 0]])


# ---- degenerate and broken ----


def test_triangles_without_area_are_left_out_and_counted(written):
    # A repeated index, three points of a line, two equal points; and a sliver, which has an area.
    vertices = [*VERTICES, (0.1, 0.1, 0.1), (0.2, 0.2, 0.2), (0.0, 0.0, 0.0), (0.5, 1e-30, 0.0)]
    degenerate = [(1, 1, 2), (0, 5, 6), (0, 7, 3)]
    mesh = read_mesh(written("a.obj", obj_text([*POLYGONS, *degenerate, (0, 1, 8)], vertices)))
    assert mesh.degenerate == 3
    assert soup(mesh) == soup(RawMesh(np.array(vertices), np.array([*TRIANGLES, (0, 1, 8)]), None))


BROKEN = {
    "missing.ply": (None, "no such file"),
    "a.fbx": (b"x", r"unknown suffix '\.fbx' for a mesh; known: \.ply, \.obj, \.stl, \.gltf, \.glb"),
    "none": (b"x", "no suffix for a mesh; known:"),
    **{f"empty.{s}": (b"", "is empty") for s in ("ply", "obj", "stl", "gltf", "glb")},
    **{f"noise.{s}": (bytes(range(256)) * 4, "is|has|ends") for s in ("ply", "obj", "stl", "gltf", "glb")},
    **{f"sentence.{s}": (b"This is no mesh.\n" * 40, "is|has|ends") for s in ("ply", "obj", "stl", "gltf", "glb")},
    "faceless.ply": (ply_text([]), "has no faces"),
    "faceless.obj": (obj_text([]), "has no faces"),
    "faceless.stl": (stl_binary([]), "has no faces"),
    "faceless2.stl": (stl_text([]), "has no faces"),
    "points.ply": (ply_text().split(b"element face")[0] + b"end_header\n" + b"0 0 0\n" * 5, "has no faces"),
    "flat.ply": (ply_text([(0, 1, 1)]), "has no faces with an area"),
    "nan.ply": (ply_binary(vertices=[*VERTICES[:4], (0, float("nan"), 0)]), r"not finite \(number 4, counted from 0\)"),
    "inf.obj": (obj_text(vertices=[*VERTICES[:4], (0, float("inf"), 0)]), "not finite"),
    "range.ply": (ply_binary(polygons=[(0, 1, 5)]), r"the vertex 5 \(counted from 0\), and 5 vertices"),
    "negative.ply": (ply_binary(polygons=[(0, 1, -1)]), r"the vertex -1 \(counted from 0\)"),
    "range.obj": (obj_text([(0, 1, 5)]), "cannot be read as OBJ: IndexError: index 5 is out of bounds"),
    "zero.obj": (obj_text([(0, 1, -1)]), "a face with the index 0, after 5"),
    "back.obj": (obj_text([]) + b"f -1 -2 -6\n", "a face with the index -6, after 5"),
    "normal.obj": (obj_text([]) + b"vn 0 0 1\nf 1//1 2//1 3//-2\n", "a face with the index -2, after 1"),
    "two.obj": (obj_text([(0, 1)]), "fewer than 3 corners"),
    "short.ply": (ply_text().replace(b"3 1 2 4", b"3 1 2"), "fewer than 3 corners"),
    "short2.ply": (ply_text(TRIANGLES).replace(b"3 1 2 4", b"3 1 2"), "fewer than 3 corners"),
    "two.ply": (ply_binary(polygons=[(0, 1), (0, 1, 2)]), "fewer than 3 corners"),
    "plane.obj": (b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "without 3 coordinates"),
    "word.obj": (b"v 0 0 x\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "cannot be read as OBJ: .*string or file"),
    "word2.obj": (obj_text([]) + b"f 1 2 x\n", "corners are no indices of one kind: 'f 1 2 x'"),
    "huge.obj": (obj_text([]) + b"f 1 2 99999999999999999999999\n", "corners are no indices of one kind"),
    "word.ply": (ply_text().replace(b"1.25", b"high"), "cannot be read as PLY: .*string or file"),
    "format.ply": (ply_text().replace(b"ascii", b"rot13"), "does not begin as a PLY file"),
    "type.ply": (
        ply_text().replace(b"property list uchar", b"property list nibble"),
        "cannot be read as PLY: KeyError",
    ),
    "formless.ply": (ply_text().replace(b"format ascii 1.0\n", b""), "does not begin as a PLY file"),
    "twist.ply": (ply_text().replace(b"double z", b"double w"), "cannot be read as PLY: KeyError: 'z'"),
    "list.ply": (ply_text([(0, 1, 2)]).replace(b"\n3 0", b"\n-3 0"), "fewer than 3 corners"),
    "many.ply": (ply_binary().replace(b"vertex 5", b"vertex 987654321987654321"), "ends early"),
    "many2.ply": (ply_text().replace(b"face 5", b"face 987654321"), "ends early"),
    "real.ply": (ply_text([(0, 1, 2)]).replace(b"uchar int", b"uchar float"), "corners are not integers"),
    "listed.ply": (ply_text().replace(b"double x", b"list uchar double x"), "cannot be read as PLY"),
    "wide.ply": (ply_binary().replace(b"uchar int", b"double int"), "cannot be read as PLY|ends early"),
    "longer.stl": (stl_binary() + b"left over", "ends early, or is neither text nor as long"),
    "second.stl": (stl_text() + stl_text()[:-20], "ends early"),
    "facets.stl": (stl_text().replace(b"endsolid", b""), "ends early"),
    "open.stl": (stl_text().replace(b"endfacet", b"", 1), "ends early"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_one_sentence_that_names_it_and_prints_nothing(name, written, tmp_path, capfd):
    data, reason = BROKEN[name]
    path = tmp_path / name if data is None else written(name, data)
    with pytest.raises(InputError, match=reason) as caught:
        read_mesh(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_ends_early_is_refused(name, written):
    data = FILES[name]
    # Whole lines of an OBJ file are an OBJ file, so it ends within its last face.
    whole_lines = name.endswith(".obj")
    for end in (len(data) - 4,) if whole_lines else (len(data) // 5, len(data) // 2, 4 * len(data) // 5):
        with pytest.raises(InputError):
            read_mesh(written(name, data[:end]))


def test_more_faces_than_an_index_can_count():
    faces = np.broadcast_to(np.zeros(3, dtype=np.int32), (2**31, 3))
    with pytest.raises(BrokenFileError, match="2147483648 triangles"):
        _checked(RawMesh(np.zeros((1, 3)), faces, None))


@pytest.mark.skipif(sys.platform == "win32", reason="resource is of POSIX")
@pytest.mark.parametrize("suffix", ["ply", "obj"])
def test_a_large_file_takes_little_more_memory_than_it_and_its_mesh(suffix, written):
    # A grid of 270,000 triangles: 6.5 MB of vertices and faces in memory, and a file of 5 MB.
    n = 369
    y, x = np.mgrid[:n, :n]
    vertices = np.stack([x, y, np.sin(x + y).round(5)], axis=-1).reshape(-1, 3).tolist()
    corner = (y * n + x)[:-1, :-1].reshape(-1)
    faces = np.concatenate([corner[:, None] + [0, 1, n], corner[:, None] + [1, n + 1, n]]).tolist()
    path = written(f"grid.{suffix}", {"ply": ply_binary, "obj": obj_text}[suffix](polygons=faces, vertices=vertices))
    program = (
        "import resource, sys\nfrom raytracer.scene.assets import read_mesh\n"
        "peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "before = peak(); mesh = read_mesh(sys.argv[1]); print(len(mesh.faces), peak() - before)"
    )
    out = subprocess.run([sys.executable, "-c", program, path], capture_output=True, text=True, check=True).stdout
    triangles, grown = map(int, out.split())
    unit = 1 if sys.platform == "darwin" else 1024
    assert triangles == len(faces)
    assert grown * unit < 2 * (path.stat().st_size + 6.5e6)
