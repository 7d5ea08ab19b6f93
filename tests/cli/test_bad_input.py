"""Broken scenes and command lines: each is refused in one sentence that says where and what is wrong.

The table is bad_input.yaml.  The status is 2 for wrong input, and 1 for a machine that fails while it works.
"""

import io
import os
import stat
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest
import yaml
from pydantic import ValidationError

from raytracer.film.image import Image
from raytracer.film.image_file import save
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Plane, Views
from raytracer.scene.spec import SceneSpec
from raytracer.schema.validation_errors import error_sentence
from raytracer.util import atomic_write
from tests.cli.test_render import SCENE as BALL
from tests.fuzz.targets._parts import npy
from tests.scene.gltf_files import gltf_text

SCENE = """\
camera: {look_from: [0, 0, 4], look_at: [0, 0, 0], up: [0, 1, 0], type: thin_lens, vfov: 40}
film: {width: 8, height: 8, filter: box}
render: {spp: 1, max_depth: 2, sampler: sobol, accuracy: exact, seed: 0}
environment: {type: constant, radiance: 1}
materials:
  grey: {type: lambertian, albedo: 0.5}
  lamp: {type: emitter, radiance: [1, 2, 3]}
objects:
  - {type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: grey}
  - {type: quad, corner: [2, 0, 0], edges: [[1, 0, 0], [0, 1, 0]], material: lamp}
  - {type: mesh, file: rock.ply}
"""

PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)

GLASS = """\
name: singlet
surfaces:
  - {type: spherical, radius: 50, thickness: 5, material: N-BK7, aperture: 20}
  - {type: spherical, radius: -50, aperture: 20}
"""


def exr(values, *names):
    buffer = io.BytesIO()
    channels = {name: np.resize(np.array(values, np.float32), (2, 2)) for name in names}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(buffer)
    return buffer.getvalue()


def png():
    buffer = io.BytesIO()
    PIL.Image.new("RGB", (1, 1)).save(buffer, "PNG")
    return buffer.getvalue()


PIXELS = np.ones((1, 2, 3))
FILES = {
    "rock.ply": PLY,
    "other.ply": PLY.replace("3 0 1 2", "3 0 2 1"),
    "rock.xyz": "x",
    "nan.obj": "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
    "lines.obj": "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 3 3 3\n",
    "uv.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 nan\nf 1/1 2/1 3/1\n",
    "picture.ply": b"GIF89a\0\0",
    "list.gltf": "[]",
    "materials.gltf": gltf_text(
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}], materials={"a": 1}
    ),
    "a.gif": b"GIF89a\0\0",
    "glass.yaml": GLASS,
    "gauss.dat": "50 5 1.5 10\n-50 90 1 10\n",
    "broken.npz": "text",
    "empty.yaml": "# a scene\n",
    "latin.yaml": "# scene\n# \xe9t\xe9 \n".encode("latin-1"),
    "binary.yaml": b"\x89PNG\r\n\x1a\n\0\0\0",
    "two.yaml": SCENE + "---\n" + SCENE,
    "broken.hdr": "#?RADIANCE\n",
    "broken.exr": b"\x76\x2f\x31\x01nonsense",
    "nan.exr": exr([0.5, np.nan], "R", "G", "B"),
    "others.exr": exr([0.5], "U", "V"),
    "bright.exr": exr([0.5, 3.0], "Y"),
    "negative.exr": exr([-0.5], "Y"),
    "text.png": "nonsense",
    "white.png": png(),
    "text.npy": "nonsense",
    "cut.npy": npy(PIXELS)[:-8],
    "lie.npy": npy(np.ones((2, 3, 4))).replace(b"(2, 3, 4), }            ", b"(2, 3, 400000000000), }"),
    "objects.npy": npy(np.array([[[None]]])),
    "line.npy": npy(np.ones(4)),
    "number.npy": npy(1.0),
    "nothing.npy": npy(np.ones((0, 3, 4))),
    "complex.npy": npy(1j * PIXELS),
    "inf.npy": npy(np.inf * PIXELS),
    "negative.npy": npy(PIXELS - [0.0, 2.0, 0.0]),
    "bright.npy": npy(1e9 * PIXELS),
    "black.npy": npy(0.0 * PIXELS),
    "fog.npy": npy(PIXELS),
    "channels.npy": npy(np.ones((2, 2, 5))),
    "nopixels.npy": npy(np.ones((0, 4))),
    "notnumbers.npy": npy(np.full((2, 3, 4), np.nan)),
    "flat.npy": npy(np.ones((2, 3, 4))),
    "projective.npy": npy(np.ones((2, 4, 4))),
    "head.csv": "x,y,z\n",
    "empty.csv": "",
    "unknown.csv": "x,y,z,scal\n0,0,0,1\n",
    "twice.csv": "x,y,z,x\n0,0,0,1\n",
    "letter.csv": "x,y,z\n0,b,0\n",
    "short.csv": "x,y,z\n0,0,0\n0,0\n",
    "axis.csv": "x,y,z,angle,axis_x\n0,0,0,9,0\n",
}

TABLE = yaml.safe_load(Path(__file__).with_name("bad_input.yaml").read_text(encoding="utf-8"))
ROWS = [(name, row) for name, group in TABLE.items() for row in group["rows"].splitlines()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenes")
    for name, data in FILES.items():
        (path / name).write_bytes(data.encode() if isinstance(data, str) else data)
    (path / "folder.html").mkdir()
    for name in ("one.exr", "two.exr", "one.png", "small.exr"):
        shape = (4, 5, 3) if name == "small.exr" else (16, 20, 3)
        save(Image(np.full(shape, 0.5), np.full(shape, 1e-4), 64), path / name)
    views = Views(np.zeros((1, 1, 2)), Plane(0.1, 0.0, 0.0), 2, 2)
    lf.write(path / "a.lf", LightField(np.zeros((1, 1, 2, 2, 3)), views))
    return path


@pytest.fixture
def refusal(folder, monkeypatch, refused):
    """The one sentence in which a command line is refused, for a scene of this text."""
    monkeypatch.chdir(folder)

    def run(command, scene=SCENE, status=2):
        Path("scene.yaml").write_text(scene)
        return refused(command.replace("SCENE", "scene.yaml"), status=status)

    return run


def replaced(text, old, new):
    assert old in text, "the row changes nothing"
    return text.replace(old, new, 1)


@pytest.mark.parametrize(("name", "row"), ROWS, ids=[f"{name}: {row.partition(' => ')[0]}" for name, row in ROWS])
def test_broken_input_is_told_in_one_sentence(name, row, refusal, folder):
    group = TABLE[name]
    given, words = row.split(" =>", 1)
    given = given.replace("AT0", "{time: 0, transform: []}").replace("AT1", "{time: 1, transform: []}")
    command, scene = group.get("command", "validate SCENE"), SCENE
    if group.get("lens"):
        (folder / "changed.yaml").write_text(replaced(GLASS, *(part.strip() for part in given.split("->"))))
    if "scene" in group:
        old, new = group["scene"]
        scene = replaced(SCENE, old, new.replace("INPUT", given))
    elif "INPUT" in command:
        command = command.replace("INPUT", given)
    else:
        scene = replaced(SCENE, *given.replace("\\n", "\n").split(" -> "))
    sentence = refusal(command, scene)
    for part in (group.get("place", ""), *words.split(" ... ")):
        assert part.strip() in sentence


def test_the_scene_that_rows_change_is_right(folder, rt):
    (folder / "scene.yaml").write_text(SCENE)
    assert rt("validate", "--quiet", folder / "scene.yaml") == ("", "")


def test_what_several_changes_make_wrong(refusal):
    flash = SCENE.replace("vfov: 40}", "vfov: 40, shutter: 1}\nlights: [{type: flash, energy: 2}]")
    by_paths = "render SCENE -o out.npy -D render.light_sampling=paths"
    assert "-D render.light_sampling=paths: render.light_sampling: paths never find a flash" in refusal(by_paths, flash)
    turning = SCENE.replace("vfov: 40", "vfov: 40, shutter: 1").replace(
        "radius: 1,", "radius: 1, motion: {spin: {axis: [0, 0, 1], rate: 100 turn/s}},"
    )
    assert "objects[0].motion: turns 100 times while the shutter is open, and fewer than 42.67" in refusal(
        "render SCENE -o out.npy", turning
    )
    spot = "render SCENE -o out.npy --crop 0,0,2,2 -D camera.exposure.metering=spot"
    assert "the metering spot lies outside of the crop" in refusal(spot, SCENE.replace("  - {type: mesh", "#"))
    nameless = SCENE.replace("name: ball, ", "").replace("vfov: 40", "vfov: 40, focus_on: ball")
    assert "unknown object 'ball'; there are no named objects" in refusal("validate SCENE", nameless)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_told(refusal, folder, monkeypatch):
    (folder / "full.png").symlink_to("/dev/full")
    # What is not there by then is not waited for here.
    monkeypatch.setattr(atomic_write, "_RETRY_SECONDS", ())
    assert "full.png: cannot be written: No space left on device" in refusal("render SCENE -o full.png", BALL, status=1)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="needs a user whom permissions bind")
def test_a_file_without_permission_is_told(here, refused):
    (here / "scene.yaml").write_text(SCENE)
    (here / "scene.yaml").chmod(stat.S_IWUSR)
    assert refused("validate scene.yaml") == "rt: scene.yaml: cannot be read: permission denied\n"


def test_a_scene_of_every_wrong_number_never_passes(refusal):
    # Whatever number of the scene is replaced by NaN, the scene is refused at that line.
    for start in [i for i, c in enumerate(SCENE) if c.isdigit() and not SCENE[i - 1].isalnum() and SCENE[i - 1] != "."]:
        end = next(i for i in range(start, len(SCENE)) if not (SCENE[i].isdigit() or SCENE[i] == "."))
        sentence = refusal("validate SCENE", SCENE[:start] + ".nan" + SCENE[end:])
        assert f"scene.yaml:{SCENE[:start].count(chr(10)) + 1}: " in sentence
        assert "got nan" in sentence


# ---- Ranges

RANGES = yaml.safe_load(Path(__file__).with_name("bad_ranges.yaml").read_text(encoding="utf-8"))


def parted(value):
    """A value without its bounds, and these by key."""
    bounds = {}

    def plain(node, key):
        if isinstance(node, dict):
            return {name: plain(below, name) for name, below in node.items()}
        if isinstance(node, list) and len(node) == 2 and isinstance(node[1], str) and node[0] != "lamp":
            bounds.setdefault(key, []).append(node[1])
            return node[0]
        return [plain(below, key) for below in node] if isinstance(node, list) else node

    return plain(value, ""), bounds


@pytest.mark.parametrize("scene", RANGES, ids=lambda scene: scene["camera"]["type"])
def test_values_out_of_range_are_told_with_their_bound(scene):
    plain, bounds = parted(scene)
    with pytest.raises(ValidationError) as caught:
        SceneSpec.model_validate(plain)
    told = {}
    for error in caught.value.errors():
        key = [part for part in error["loc"] if isinstance(part, str)][-1]
        told.setdefault(key, []).append(error_sentence(error))
    assert told.keys() == bounds.keys()
    for key, expected in bounds.items():
        assert len(told[key]) == len(expected), key
        for words, sentence in zip(expected, told[key], strict=True):
            assert f"must be {words}" in sentence
