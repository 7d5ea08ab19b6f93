"""Light fields: of ours, `.lf`; of other programs, folders of views, stacks of them and depths; and their geometry."""

import io
import json
import math
import struct
import tempfile
from pathlib import Path

import h5py
import numpy as np
import PIL.Image

from raytracer.film.formats import pfm
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField, Rays
from raytracer.film.light_field.lattice import Lattice
from raytracer.film.light_field.views import Plane, Pose, Views
from raytracer.lightfield.decoding.microlens_grid import Grid, read_grid
from raytracer.lightfield.formats import geometry, hci
from raytracer.lightfield.formats.exporter import export
from raytracer.lightfield.formats.importer import import_views
from tests.fuzz.harness import target
from tests.fuzz.targets._parts import npy

POSE = Pose((0.0, 1.0, 2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
SIDE = 2
_MOST_FILES, _LONGEST_NAME = 32, 64


def _views(rows=2, columns=2, *, plane=(0.1, -0.1, 0.1), side=SIDE, **rest):
    return Views(0.1 * geometry.regular_grid(rows, columns), Plane(*plane), side, side, 0.5, **rest)


_FULL = _views(cell=(0.1, 0.1), aperture=0.3, focal_length=50.0, pose=POSE)

# ---- What tells where views are

_GEOMETRIES = [
    geometry.to_json(_views(rows, columns, plane=(0.1, -0.2, 0.2), side=4, pose=POSE, **rest), units)
    for rows, columns, rest in ((2, 2, {}), (1, 3, {"cell": (0.1, 0.2), "aperture": 0.3, "focal_length": 50.0}))
    for units in (None, "views")
]
_WORDS = '"position"~"pose"~"cell"~"origin"~NaN~Infinity~1e999~[[[~null'


@target("geometry", seeds=_GEOMETRIES, file=geometry.FILE, words=_WORDS)
def load_geometry(path):
    views, settings = geometry.read(path)
    assert min(views.width, views.height) >= 1
    assert np.isfinite(views.position).all()
    assert views.position.shape == (views.rows, views.columns, 2)
    assert set(settings) <= {"units"}
    # What was read can be written, and read again.
    path.write_bytes(geometry.to_json(views, settings.get("units")))
    again, _ = geometry.read(path)
    assert (again.plane, again.position.tolist()) == (views.plane, views.position.tolist())


_CFGS = [hci.to_cfg(_views(plane=(0.1, -0.2, 0.2), side=4, pose=pose), "seed", None) for pose in (None, POSE)]
_WORDS = "[intrinsics]~[extrinsics]~[DEFAULT]~num_cams_x = ~baseline_mm = ~1e308~1e-320"


@target("parameters", seeds=_CFGS, file=hci.FILE, words=_WORDS)
def load_parameters(path):
    """Parameters of the 4D Light Field Benchmark."""
    said = hci.read(path)
    assert min(said.rows, said.columns, said.width, said.height) >= 1
    assert 0.0 < (said.known.pixel or 0.0) < math.inf
    assert all(math.isfinite(number) for triple in said.pose or () for number in triple)


_GRIDS = [
    json.dumps(Grid(Lattice((3.0, 4.0), (10.0, 0.0), across), 100, 80).as_dict()).encode()
    for across in ((0.1, 10.0), (5.0, 8.66))
]


@target(
    "lenslets", seeds=_GRIDS, file="a.json", words='"offset"~"along"~"across"~"width"~"diameter"~NaN~Infinity~1e999'
)
def load_lenslets(path):
    """Grids of microlenses in JSON, as decoding prints them and takes them."""
    grid = read_grid(path)
    assert grid.lattice.pitch >= 1.0
    assert all(map(math.isfinite, (grid.lattice.area, grid.lattice.rotation, grid.diameter)))
    json.dumps(grid.as_dict(), allow_nan=False)


# ---- Views.  An input is a list of files: after a zero byte comes a name, up to the next one, and after that what the
# file holds; nothing stands for a small picture.


def _picture(suffix):
    values = np.arange(SIDE * SIDE * 3).reshape(SIDE, SIDE, 3)
    if suffix == ".npy":
        return npy(values / values.size)
    held = io.BytesIO()
    PIL.Image.fromarray(values.astype(np.uint8)).save(held, "PNG")
    return held.getvalue()


def _folders():
    grid = [f"view_{row:02d}_{column:02d}.png" for row in range(2) for column in range(2)]
    cameras = [f"input_Cam{number:03d}.png" for number in range(4)]
    places = ("0_0", "0_12.5", "-32.5_0", "-32.5_12.5")
    # The files have no zero bytes, which stand between names.
    depths = pfm.encode(np.full((SIDE, SIDE), 2.1))
    told = {hci.FILE: hci.to_cfg(_FULL, "seed", None), "gt_disp_lowres.pfm": depths}
    for names, files in (
        (grid, {}),
        ([name.replace(".png", ".npy") for name in grid], {}),
        (grid, {geometry.FILE: geometry.to_json(_FULL, None)}),
        ([f"{number}.png" for number in range(4)], {}),
        ([f"out_{i // 2:02d}_{i % 2:02d}_{place}_.png" for i, place in enumerate(places)], {}),
        (cameras, {}),
        (cameras, {**told, "gt_depth_lowres_Cam000.pfm": depths}),
    ):
        everything = {**dict.fromkeys(names, b""), **files}
        yield b"".join(b"\0" + name.encode() + b"\0" + content for name, content in everything.items())


def check(field):
    views = field.views
    assert tuple(field.radiance.shape) == (views.rows, views.columns, views.height, views.width, 3)
    assert views.rows * views.columns <= _MOST_FILES * 1024
    assert np.isfinite(views.position).all()
    assert views.plane.pixel > 0.0
    assert np.asarray(field.radiance[-1, -1]).shape == (views.height, views.width, 3)
    for layer in field.layers.values():
        assert np.asarray(layer[0, 0]).shape == (views.height, views.width)
    # What was read can be written again.
    geometry.to_json(views, None)


_WORDS = "geometry.json~parameters.cfg~input_Cam000.png~out_00_00_~view_00_00.npy~gt_disp_lowres"


@target("views", seeds=_folders, words=_WORDS)
def load_views(data, folder):
    parts = data.split(b"\0")[1:]
    for name, content in list(zip(parts[::2], parts[1::2], strict=False))[:_MOST_FILES]:
        text = name.decode("utf-8", "replace").replace("/", "_")
        if text not in ("", ".", "..") and len(name) <= _LONGEST_NAME:
            (folder / text).write_bytes(content or _picture(Path(text).suffix))
    check(import_views(folder))


def _stacks():
    rng = np.random.default_rng(1)
    for shape in ((1, 2, 2, 3, 3), (2, 1, 2, 2), (1, 1, 2, 2, 1)):
        values = rng.random(shape)
        for array in (values, values.astype(">f4"), (255 * values).astype(np.uint8), np.asfortranarray(values)):
            yield npy(array, None)


_WORDS = "\udc93NUMPY~'descr': ~'fortran_order': True~'shape': (~'<f4'~'|O'~'|u1'"


@target("stack", seeds=_stacks, file="given.npy", max_length=2048, words=_WORDS)
def load_stack(path):
    check(import_views(path))


_VALUES = np.array([[1.0, -2.0], [np.nan, np.inf]])
_MAPS = [pfm.encode(_VALUES), b"Pf\n2 2\n1.0\n" + _VALUES.astype(">f4").tobytes()]


@target("depth_map", seeds=_MAPS, max_length=256, words="PF\n~Pf\n~-1.0\n~2 2\n~999999999 999999999\n")
def load_depth_map(data, folder):
    """Depths and disparities as portable float maps, of light fields of other programs."""
    for number in range(4):
        (folder / f"input_Cam{number:03d}.npy").write_bytes(_picture(".npy"))
    (folder / hci.FILE).write_bytes(hci.to_cfg(_views(), "given", None))
    (folder / "gt_disp_lowres.pfm").write_bytes(data)
    (folder / "gt_depth_lowres_Cam000.pfm").write_bytes(data)
    depth = np.asarray(import_views(folder).layers["depth"])
    assert (depth.shape, depth.dtype) == ((2, 2, SIDE, SIDE), np.float64)
    assert np.isnan(depth[0, 1]).all()


def _transforms():
    shared = {"camera_angle_x": 0.7, "w": SIDE, "h": SIDE, "rt": {"rows": 1, "cell": [0.1, 0.1], "aperture": 0.3}}
    for turn in (0.0, 1.0):
        frames = []
        for number in range(3):
            angle = turn * number
            c, s = math.cos(angle), math.sin(angle)
            matrix = [[c, 0.0, s, 0.1 * number], [0.0, 1.0, 0.0, 0.0], [-s, 0.0, c, 0.0], [0.0, 0.0, 0.0, 1.0]]
            frames.append({"file_path": "p.npy", "depth_file_path": "d.npy", "cx": 1.0, "transform_matrix": matrix})
        yield json.dumps({**shared, "frames": frames}).encode()


_WORDS = '"fl_x"~"k1"~"cy"~"is_fisheye"~"camera_model"~"OPENCV_FISHEYE"~"integer_depth_scale"~NaN~1e999~[[[~null~../'


@target("transforms", seeds=_transforms, file="transforms.json", words=_WORDS)
def load_transforms(path):
    """Pictures with a camera each."""
    (path.parent / "p.npy").write_bytes(_picture(".npy"))
    (path.parent / "d.npy").write_bytes(npy(np.ones((SIDE, SIDE))))
    field = import_views(path)
    if isinstance(field, LightField):
        check(field)
        return
    assert np.isfinite(field.views.pose).all()
    assert (field.views.plane[..., 0] > 0.0).all()
    assert np.asarray(field.radiance[-1, -1]).shape == (SIDE, SIDE, 3)


def _multiview():
    field = LightField(np.random.default_rng(1).random((1, 2, 2, 2, 3), np.float32), _views(1, 2))
    with tempfile.TemporaryDirectory() as folder:
        export(field, Path(folder, "seed.exr"))
        yield Path(folder, "seed.exr").read_bytes()


@target(
    "multiview",
    seeds=_multiview,
    file="given.exr",
    words="multiView~rt.lightfield~view~left~right~\udcff\udcff\udcff\x7f",
)
def load_multiview(path):
    """OpenEXR files of several views."""
    check(import_views(path, layout="multiview"))


# ---- `.lf`: HDF5, of this program and of others that write the older forms of it

_MOST_BYTES = 2**24
"""That are read of a file's arrays: each is asked for by parts, as programs do."""


def _fields():
    for side, extra in ((2, False), (1, True)):
        more = {"cell": (0.1, 0.1), "pose": POSE} if extra else {}
        views = Views(10.0 * _views(side, side).position, Plane(0.1, -0.2, 0.2), 4, 4, 0.5, **more)
        layers = {"depth": np.ones((side, side, 4, 4)), "id": np.ones((side, side, 4, 4, 2), np.uint16)}
        rays = Rays(np.zeros((3, 4)), np.ones((3, 3)), np.ones(3), np.ones((3, 2))) if extra else None
        radiance = np.random.default_rng(1).random((side, side, 4, 4, 3))
        field = LightField(radiance, views, layers if extra else {}, rays, {"spp": 16, "scene": "ball", "gain": 0.5})
        for compress in (False, True):
            with tempfile.TemporaryDirectory() as folder:
                lf.write(Path(folder, "seed.lf"), field, compress=compress)
                yield Path(folder, "seed.lf").read_bytes()
        yield _plainly(field)


def _plainly(field):
    """The oldest form of HDF5, which other programs write and which has no checksums: mistakes in it get farther."""
    held, views = io.BytesIO(), field.views
    with h5py.File(held, "w", libver="earliest") as file:
        numbers = {**views.plane._asdict(), "inverse_focus": views.inverse_focus}
        for name, value in {"format": np.bytes_(lf.FORMAT), "version": 1, **numbers}.items():
            file.attrs[name] = value
        file["position"] = views.position
        file.create_dataset("radiance", data=field.radiance, chunks=(1, 1, 4, 4, 3), dtype="f4", compression="gzip")
        for name, layer in field.layers.items():
            file[f"layers/{name}"] = layer
        for name, part in (field.rays._asdict() if field.rays else {}).items():
            file[f"rays/{name}"] = part
        for name, setting in field.settings.items():
            file.require_group("settings").attrs[name] = np.bytes_(setting) if isinstance(setting, str) else setting
    return held.getvalue()


_WORDS = "OHDR~TREE~HEAP~SNOD~FRHP~BTHD~FADB~OCHK~GCOL~radiance~position"


# HDF5 makes room for a header of a size of 32 bits before it looks whether the file has so much; it is not written to.
@target("lf", seeds=_fields, max_length=16384, address_limit=2**33, words=_WORDS)
def load_lf(data, folder):
    path = folder / "given.lf"
    path.write_bytes(_summed(data))
    with lf.open(path) as field:
        views = field.views
        assert field.radiance.shape == (views.rows, views.columns, views.height, views.width, 3)
        assert np.isfinite(views.position).all()
        assert views.position.nbytes <= 1100 * len(data)
        assert all(isinstance(value, str | int | float) for value in field.settings.values())
        for array in (field.radiance, *field.layers.values()):
            for at in ((0, 0), (-1, -1)):
                view = array[at][: max(1, _MOST_BYTES // max(1, math.prod(array.shape[3:]) * array.dtype.itemsize))]
                assert view.shape[1:] == array.shape[3:]
        for part in field.rays or ():
            assert part is None or len(part[:1000]) <= 1000


def _summed(data):
    """With the checksums of the superblock and of object headers as they should be: who means harm gets these right.

    An object header of version 2: signature, version, flags, times and limits if there are any, size of messages.
    """
    found = bytearray(data)
    if len(found) >= 48 and found[:8] == b"\x89HDF\r\n\x1a\n" and found[8] in (2, 3):
        found[44:48] = _lookup3(bytes(found[:44]))
    at = found.find(b"OHDR")
    while 0 <= at <= len(found) - 6:
        flags = found[at + 5]
        start = at + 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
        width = 1 << (flags & 3)
        end = start + width + int.from_bytes(found[start : start + width], "little")
        if end + 4 <= len(found):
            found[end : end + 4] = _lookup3(bytes(found[at:end]))
        at = found.find(b"OHDR", at + 4)
    return bytes(found)


def _lookup3(data):
    """Bob Jenkins' hash "lookup3" (`hashlittle`, initial value 0), which HDF5's metadata are summed by."""

    def turned(value, bits):
        return (value << bits | value >> (32 - bits)) & 0xFFFFFFFF

    a = b = c = (0xDEADBEEF + len(data)) & 0xFFFFFFFF
    words = struct.unpack(f"<{-(-len(data) // 12) * 3}I", data + bytes(-len(data) % 12))
    for i in range(0, len(words) - 3, 3):
        a, b, c = ((x + y) & 0xFFFFFFFF for x, y in zip((a, b, c), words[i : i + 3], strict=True))
        for turn in (4, 6, 8, 16, 19, 4):
            a = (((a - c) & 0xFFFFFFFF) ^ turned(c, turn)) & 0xFFFFFFFF
            a, b, c = b, (c + b) & 0xFFFFFFFF, a
    a, b, c = ((x + y) & 0xFFFFFFFF for x, y in zip((a, b, c), words[-3:], strict=True))
    for turn in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - turned(b, turn)) & 0xFFFFFFFF
        a, b, c = b, c, a
    return struct.pack("<I", b)
