"""Files that claim what they do not have, name what they may not, or would run code: one sentence, and little memory.

Python and NumPy tell how much they have asked for; the libraries written in C are asked only for what has been judged.
"""

import io
import itertools
import os
import pickle
import re
import struct
import subprocess
import sys
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest
from scipy.spatial.transform import Rotation

from raytracer.film import load, load_layers
from raytracer.scene.assets import companion_files, read_grid, read_image, read_mesh, read_placements
from raytracer.scene.assets.gltf import referenced_files
from raytracer.util.errors import InputError
from raytracer.util.safe_open import BrokenFileError, parse_npy
from tests.fuzz import harness
from tests.scene.gltf_files import CORNERS, accessor, data_uri, write_gltf

POSIX_ONLY = pytest.mark.skipif(sys.platform == "win32", reason="pipes and devices of POSIX")

FEW_BYTES = 2**24
"""What refusing a file of some kilobytes takes at most."""


def refused(path, read):
    """Return the refusal of a file by `read`: one line that names it, and with little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            read(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    text = str(caught.value)
    assert path.name in text
    assert "\n" not in text
    assert peak < FEW_BYTES
    return text


def readers(suffix):
    return {
        ".npy": [read_image, read_grid, read_placements, load],
        ".csv": [read_placements],
        ".exr": [read_image, load, load_layers],
        ".png": [read_image, load],
        ".jpg": [read_image, load],
        ".hdr": [read_image, load],
        ".webp": [read_image],
        ".tif": [read_image],
    }.get(suffix, [read_mesh])


# ---- Claims


def npy(header, numbers=b""):
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + numbers


def npy_of(shape, numbers=b""):
    return npy(f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}", numbers)


def png(width, height, data):
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(data)),
        (b"IEND", b""),
    )
    parts = (struct.pack(">I", len(c)) + k + c + struct.pack(">I", zlib.crc32(k + c)) for k, c in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def exr(right, bottom):
    file = io.BytesIO()
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Y": np.ones((64, 64), np.float32)}).write(file)
    data = bytearray(file.getvalue())
    struct.pack_into("<4i", data, data.index(b"dataWindow\x00box2i\x00") + 21, 0, 0, right, bottom)
    return bytes(data)


def tiled(side):
    """A file of 6 x 4 pixels in one tile that is said to have `side` x `side`."""
    file = io.BytesIO()
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    OpenEXR.File(header, {"Y": np.ones((4, 6), np.float32)}).write(file)
    data = bytearray(file.getvalue())
    struct.pack_into("<2I", data, data.index(b"tiledesc\x00") + 13, side, side)
    return bytes(data)


def webp(side):
    file = io.BytesIO()
    PIL.Image.new("RGB", (side, side)).save(file, "WEBP", lossless=True)
    return file.getvalue()


def claiming(side):
    """60 bytes of a WebP file without losses that is said to have `side` x `side` pixels."""
    data = bytearray(webp(64)[:60].ljust(60, b"\0"))
    data[21:25] = (int.from_bytes(data[21:25], "little") >> 28 << 28 | side - 1 << 14 | side - 1).to_bytes(4, "little")
    return bytes(data)


PLACES = "property float x\nproperty float y\nproperty float z\n"


def ply(kind, vertices, faces, body):
    head = f"ply\nformat {kind} 1.0\nelement vertex {vertices}\n{PLACES}element face {faces}\n"
    return f"{head}property list uint int vertex_indices\nend_header\n".encode() + body


CLAIMS = {
    "60000.png": (png(60_000, 60_000, bytes(1000)), "is 60000 x 60000 pixels, and at most 268,435,456 are read"),
    "16000.png": (png(16_000, 16_000, bytes(1000)), "is 16000 x 16000 pixels in 74 bytes"),
    "plain.webp": (claiming(8192), "is 8192 x 8192 pixels in 60 bytes"),
    "window.exr": (exr(15_999, 15_999), "is 16000 x 16000 pixels in"),
    "tile.exr": (tiled(16_384), "has tiles of 16384 x 16384 for 6 x 4 pixels"),
    "wide.exr": (exr(2**31 - 2, 0), "broken"),
    "large.hdr": (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 30000 +X 30000\n" + bytes(100), "at most 268,435,456"),
    "trillion.npy": (npy_of((10**6, 10**6, 3)), "cut off"),
    "overflow.npy": (npy_of((2**62, 4, 4)), "cut off"),
    "negative.npy": (npy_of((-4, -4, 3), bytes(96)), "none|cut off"),
    "header.npy": (b"\x93NUMPY\x02\x00" + struct.pack("<I", 4 * 10**9) + b"{" * 100, "cut off"),
    "brackets.npy": (npy("(" * 900), "broken"),
    "minuses.npy": (npy("-" * 9000 + "1"), "broken"),
    "types.npy": (npy(f"{{'descr': '{','.join(['f4'] * 2000)}', 'fortran_order': False, 'shape': (1,), }}"), "numbers"),
    "trillion.ply": (ply("ascii", 999_999_999_999, 1, b"0 0 0\n"), "ends early"),
    "list.ply": (
        ply("binary_little_endian", 3, 2, bytes(36) + struct.pack("<I3iI3i", 3, 0, 1, 2, 2**32 - 16, 0, 1, 2)),
        "cannot be read|ends early",
    ),
    "newlines.ply": (b"ply\nformat ascii 1.0" + b"\n" * 60_000, "does not begin as a PLY file"),
    "count.stl": (bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(500), "ends early"),
    "corners.obj": (
        b"v 0 0 0\n" * 3 + b"f " + b"1 2 3 " * 200_000,
        "a line of 1,200,002 characters, and at most 1,048,576",
    ),
    "forms.obj": (b"v 0 0 0\n" * 3 + b"".join(b"f 1%s 2 3\n" % (b"/" * n) for n in range(900)), "indices of one kind"),
    "brackets.gltf": (b"[" * 100_000, "nested too deeply"),
    "digits.gltf": (b'{"a":' + b"9" * 10_000 + b"}", "no JSON that can be read"),
    "column.csv": (b"x" * 100_000 + b",y,z\n1,2,3\n", "unknown column 'xxx"),
    "field.csv": (b"x,y,z\n" + b"1" * 200_000 + b",2,3\n", "field limit"),
    "zero.csv": (b"x,y,z\n1,\x002,3\n", "must be a number"),
    "angle.csv": (b"x,y,z,angle,axis_x\n1,2,3,1e308,1e308\n", "is not finite"),
}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_is_refused_before_room_is_made_for_it(name, tmp_path):
    data, reason = CLAIMS[name]
    path = tmp_path / name
    path.write_bytes(data)
    for read in readers(path.suffix):
        assert re.search(reason, refused(path, read))


def test_a_large_texture_of_one_colour_is_read_however_short_its_file(tmp_path):
    (tmp_path / "flat.webp").write_bytes(webp(4096))
    assert (tmp_path / "flat.webp").stat().st_size < 1000
    assert read_image(tmp_path / "flat.webp").texels.shape == (4096, 4096, 3)


@pytest.mark.parametrize("read", readers(".npy"))
def test_pickled_objects_are_not_read(read, tmp_path):
    class Runs:
        def __reduce__(self):
            return Path.touch, (tmp_path / "run",)

    assert pickle.loads(pickle.dumps(Runs())) is None
    (tmp_path / "run").unlink()
    path = tmp_path / "a.npy"
    np.save(path, np.array([Runs()], object), allow_pickle=True)
    assert "holds pickled objects, which are not read" in refused(path, read)
    assert not (tmp_path / "run").exists()


def test_arrays_are_what_numpy_reads():
    values = np.arange(24.0).reshape(2, 3, 4)
    for stored in (values, np.asfortranarray(values), values.astype(">f2"), values[:0], np.array(3), values > 2):
        file = io.BytesIO()
        np.save(file, stored)
        found = parse_npy(file.getvalue())
        assert found.dtype == stored.dtype
        np.testing.assert_array_equal(found, stored)
        if stored.size:
            with pytest.raises(BrokenFileError, match="cut off"):
                parse_npy(file.getvalue()[:-1])


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.jpg"])
def test_only_the_formats_of_the_table_are_read_whatever_a_file_is_called(name, tmp_path):
    # Pillow hands PostScript to another program.
    path = tmp_path / name
    path.write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n%%EndComments\nshowpage\n")
    for read in readers(path.suffix):
        assert "broken, or no" in refused(path, read)


# ---- What is no file


SUFFIXES = (".png", ".exr", ".hdr", ".npy", ".obj", ".ply", ".stl", ".gltf", ".glb", ".csv")


@POSIX_ONLY
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_pipes_and_devices_are_refused_without_waiting(suffix, tmp_path):
    assert "cannot be read" in refused(gltf(tmp_path, buffers=[{"byteLength": 36, "uri": "/dev/zero"}]), read_mesh)
    pipe, device, loop = (tmp_path / f"{name}{suffix}" for name in ("pipe", "device", "loop"))
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    loop.symlink_to(loop)
    for read in readers(suffix):
        assert "is no regular file" in refused(pipe, read)
        assert "is no regular file" in refused(device, read)
        assert "cannot be read" in refused(loop, read)


def test_a_file_too_large_to_be_read_whole_is_refused_by_its_length(tmp_path):
    path = tmp_path / "a.png"
    with path.open("wb") as file:
        file.truncate(2**32 + 1)
    assert "has 4,294,967,297 bytes, and at most 4,294,967,296 are read" in refused(path, read_image)


# ---- glTF


def gltf(folder, **more):
    return write_gltf(folder / "a.gltf", **more)


DAG = [*({"children": [number + 1, number + 1]} for number in range(40)), {"mesh": 0}]

BROKEN = {
    "a cycle of nodes": ({"nodes": [{"children": [1]}, {"children": [0], "mesh": 0}]}, "node 0 in more than one place"),
    "a node below itself": ({"nodes": [{"children": [0], "mesh": 0}]}, "node 0 in more than one place"),
    "2^40 ways to a node": ({"nodes": DAG}, "in more than one place of its tree"),
    "a thousand million elements": ({"accessors": accessor(count=10**9)}, "goes beyond its data"),
    "elements without data": ({"accessors": [{"componentType": 5126, "count": 10**9, "type": "VEC3"}]}, "without data"),
    "a negative offset": ({"accessors": accessor(byteOffset=-4)}, "byteOffset that is no integer from 0 on: -4"),
    "an offset beyond 64 bits": ({"accessors": accessor(byteOffset=2**70)}, "goes beyond its data"),
    "a stride of one byte": ({"bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 1}]}, "a byteStride of 1"),
    "a view beyond its buffer": ({"bufferViews": [{"buffer": 0, "byteLength": 37}]}, "ends early"),
    "a matrix that is not finite": (
        {"nodes": [{"mesh": 0, "matrix": [1e999] * 16}]},
        "matrix that is not 16 finite numbers",
    ),
    "a huge matrix": ({"nodes": [{"mesh": 0, "scale": [1e300] * 3}]}, "vertex that is not finite"),
    "a number of 400 digits": ({"nodes": [{"mesh": 0, "scale": [10**400] * 3}]}, "scale that is not 3 finite numbers"),
    "a rotation of zeros": ({"nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]}, "rotation that is none"),
    "compressed meshes": ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "needs the extension KHR_draco"),
    "an address on the net": ({"buffers": [{"uri": "http://example.org/a.bin"}]}, "and only files are read"),
    "an address of a file": ({"buffers": [{"uri": "file:///etc/passwd"}]}, "and only files are read"),
    "an address that is none": ({"buffers": [{"uri": ["a"]}]}, "and only files are read"),
    "an address with a zero": ({"buffers": [{"uri": "a%00b"}]}, "cannot be read"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_gltf_file_that_breaks_the_specification_is_refused(name, tmp_path):
    more, reason = BROKEN[name]
    assert reason in refused(gltf(tmp_path, **more), read_mesh)


def test_repeated_data_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr("raytracer.scene.assets.gltf_geometry.MAX_REPEATED", 60)
    nodes = [{"children": list(range(1, 21))}, *({"mesh": 0} for _ in range(20))]
    assert len(read_mesh(gltf(tmp_path, nodes=nodes)).vertices) == 60
    nodes = [{"children": list(range(1, 22))}, *({"mesh": 0} for _ in range(21))]
    assert "60 vertices or triangles" in refused(gltf(tmp_path, nodes=nodes), read_mesh)

    monkeypatch.setattr("raytracer.scene.assets.gltf_geometry.MAX_PIECES", 8)
    meshes = [{"primitives": [{"attributes": {"POSITION": 0}}] * 3}]
    nodes = [{"children": [1, 2, 3]}, {"mesh": 0}, {"mesh": 0}, {"mesh": 0}]
    assert "repeats its meshes to more than 8 parts" in refused(gltf(tmp_path, nodes=nodes, meshes=meshes), read_mesh)

    meshes = [{"primitives": [{"attributes": {"POSITION": number}} for number in range(9)]}]
    path = gltf(tmp_path, meshes=meshes, accessors=accessor() * 9)
    assert "too many accessors of the same data" in refused(path, read_mesh)


def test_all_files_that_may_be_opened_are_named(tmp_path):
    uris = ["b%20c.bin", "../d.bin", "http://example.org/e.bin", "data:,", 3]
    path = gltf(tmp_path, buffers=[{"uri": uri} for uri in uris], images=[{"uri": "f.png"}, "g.png"])
    (tmp_path / "f.png").touch()
    assert referenced_files(path) == (tmp_path / "b c.bin", tmp_path / "../d.bin", tmp_path / "f.png")
    assert companion_files("mesh", path) == (tmp_path / "f.png",)


def test_what_a_file_names_is_told_with_little_memory(tmp_path):
    path = tmp_path / "a.glb"
    path.write_bytes(struct.pack("<IIIII", 0x46546C67, 2, 100, 2**32 - 16, 0x4E4F534A) + b"{}  ")
    tracemalloc.start()
    try:
        assert referenced_files(path) == ()
        assert tracemalloc.get_traced_memory()[1] < FEW_BYTES
    finally:
        tracemalloc.stop()


def test_sparse_strips_fans_and_quantised_coordinates_are_read(tmp_path):
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")
    changed = struct.pack("<H2x3f", 3, 2, 2, 5)
    coordinates = np.array([[0, 0], [255, 0], [0, 255], [255, 255]], "u1")
    data = square.tobytes() + changed + coordinates.tobytes()
    ends = [0, 48, 52, 64, 72]
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    path = gltf(
        tmp_path,
        buffers=[{"byteLength": len(data), "uri": data_uri(data)}],
        bufferViews=[{"buffer": 0, "byteOffset": a, "byteLength": b - a} for a, b in itertools.pairwise(ends)],
        accessors=[
            *accessor(
                count=4,
                sparse={"count": 1, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 2}},
            ),
            {"bufferView": 3, "componentType": 5121, "count": 4, "type": "VEC2", "normalized": True},
        ],
        meshes=[{"primitives": [{"attributes": attributes, "mode": mode} for mode in (5, 6)]}],
    )
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.vertices[:4], [*square[:3], [2, 2, 5]])
    # The specification's orders: of a strip (0 1 2)(1 3 2), of a fan (1 2 0)(2 3 0); each by its least corner first.
    turned = [tuple(np.roll(face, -int(np.argmin(face)))) for face in mesh.faces]
    assert turned == [(0, 1, 2), (1, 3, 2), (4, 5, 6), (4, 6, 7)]
    assert mesh.uv is not None
    np.testing.assert_array_equal(mesh.uv[:4], [[0, 1], [1, 1], [0, 0], [1, 0]])


def test_nodes_are_scaled_then_turned_then_moved(tmp_path):
    turn, factors, place, inner = (0.1, -0.7, 0.5, 0.4), (2.0, 3.0, 4.0), (5.0, 6.0, 7.0), (1.0, -2.0, 3.0)
    node = {"children": [1], "translation": place, "rotation": turn, "scale": factors}
    nodes = [node, {"mesh": 0, "translation": inner}]
    moved = Rotation.from_quat(turn).apply(np.add(CORNERS, inner) * factors) + place
    np.testing.assert_allclose(read_mesh(gltf(tmp_path, nodes=nodes)).vertices, moved, rtol=1e-6)


def test_sparse_elements_without_data_are_zeros_but_where_they_are_replaced(tmp_path):
    data = struct.pack("<2H6f", 1, 2, 1, 0, 0, 0, 1, 0)
    sparse = {"count": 2, "indices": {"bufferView": 0, "componentType": 5123}, "values": {"bufferView": 1}}
    mesh = gltf(
        tmp_path,
        buffers=[{"byteLength": 28, "uri": data_uri(data)}],
        bufferViews=[{"buffer": 0, "byteLength": 4}, {"buffer": 0, "byteOffset": 4, "byteLength": 24}],
        accessors=[{"componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse}],
    )
    np.testing.assert_array_equal(read_mesh(mesh).vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    huge = [{"componentType": 5126, "count": 10**9, "type": "VEC3", "sparse": sparse}]
    assert "too many accessors" in refused(gltf(tmp_path, accessors=huge), read_mesh)


def test_parts_without_triangles_are_left_out(tmp_path):
    indices = {"bufferView": 0, "componentType": 5123, "count": 0, "type": "SCALAR"}
    attributes = [{"attributes": {"POSITION": 0}}, {}, {"attributes": {"POSITION": 1}}]
    primitives = [*attributes, {"attributes": {"POSITION": 0}, "indices": 2}]
    accessors = [*accessor(), *accessor(count=0), indices]
    mesh = read_mesh(gltf(tmp_path, accessors=accessors, meshes=[{"primitives": primitives}]))
    np.testing.assert_array_equal(mesh.vertices, CORNERS)
    assert mesh.faces.tolist() == [[0, 1, 2]]


def test_a_file_of_many_parts_is_read_if_it_has_them(tmp_path, monkeypatch):
    monkeypatch.setattr("raytracer.scene.assets.gltf_geometry.MAX_PIECES", 8)
    nodes = [{"children": list(range(1, 31))}, *({"mesh": 0} for _ in range(30))]
    assert len(read_mesh(gltf(tmp_path, nodes=nodes)).faces) == 30


# ---- Noise


def test_nothing_reaches_the_terminal_but_the_sentence(tmp_path):
    for name in CLAIMS:
        (tmp_path / name).write_bytes(CLAIMS[name][0])
    program = (
        "import sys\nfrom pathlib import Path\n"
        "from raytracer.scene.assets import *\nfrom raytracer.util.errors import InputError\n"
        "for path in sorted(Path(sys.argv[1]).iterdir()):\n"
        "    for read in (read_mesh, read_image, read_grid, read_placements):\n"
        "        try:\n            read(path)\n        except InputError:\n            pass\n"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# ---- What is cut off


@pytest.mark.parametrize(
    "name", ["mesh_obj", "mesh_ply", "mesh_stl", "mesh_gltf", "image", "picture", "grid", "placements"]
)
def test_a_file_cut_off_anywhere_is_refused_or_loads(name, tmp_path):
    target = harness.load_target(name)
    by_kind = {seed[:12]: seed for seed in target.seeds() if len(seed) < 600}
    assert by_kind
    with harness.strict():
        for seed in by_kind.values():
            for end in range(1, len(seed)):
                harness.execute(target, seed[:end], tmp_path)
