"""Broken scenes and command lines: each is refused in one sentence that says where and what is wrong.

A row is a scene, as a change of a scene that is right, and a command line; SCENE in it stands for the scene's file,
DIR for the folder of the test.  The status is 2 for wrong input, and 1 for a machine that fails while it works.
"""

import importlib.util
import os
import stat
from dataclasses import dataclass
from pathlib import Path

import pytest

from raytracer.cli.main import main

SCENE = """\
camera: {type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], up: [0, 1, 0], vfov: 40}
film: {width: 8, height: 8, filter: box}
render: {spp: 1, max_depth: 2, sampler: sobol, accuracy: exact, seed: 0}
environment: {type: constant, radiance: 1}
materials:
  grey: {type: lambertian, albedo: 0.5}
  lamp: {type: emitter, radiance: [1, 2, 3]}
objects:
  - {type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: grey}
  - {type: quad, corner: [0, 0, 0], edges: [[1, 0, 0], [0, 1, 0]], material: lamp}
  - {type: mesh, file: rock.ply}
"""

PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)

ROCK = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"

BOMB = "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10 if i else ['1'] * 10)}]\n" for i in range(20))


@dataclass(frozen=True)
class Row:
    """One broken input and what must be said of it."""

    name: str
    words: tuple[str, ...]
    change: tuple[str, str] | None = None
    scene: str | bytes = SCENE
    command: str = "validate SCENE"
    files: tuple[tuple[str, str | bytes], ...] = ()
    status: int = 2


def changed(name: str, old: str, new: str, *words: str) -> Row:
    return Row(name, words, change=(old, new))


def mesh(name: str, suffix: str, data: str | bytes, *words: str) -> Row:
    return Row(
        name,
        ("scene.yaml:11: objects[2].file: ", *words),
        change=("rock.ply", f"broken{suffix}"),
        command="render SCENE -o DIR/out.npy",
        files=((f"broken{suffix}", data),),
    )


def override(name: str, definition: str, *words: str) -> Row:
    return Row(name, words, command=f"render SCENE -o DIR/out.npy -D {definition}")


def options(name: str, text: str, *words: str, status: int = 2) -> Row:
    return Row(name, words, command=f"render SCENE {text}", status=status)


CAMERA = "scene.yaml:1: camera"
BALL = "scene.yaml:9: objects[0]"

FILES = [
    Row("missing file", ("nowhere.yaml: no such file",), command="validate DIR/nowhere.yaml"),
    Row("folder", ("is a folder",), command="validate DIR"),
    Row("path through a file", ("cannot be read: not a directory",), command="validate SCENE/x.yaml"),
    Row("empty file", ("is empty",), scene=""),
    Row("only comments", ("is empty",), scene="# a scene\n"),
    Row("binary file", ("is a binary file",), scene=b"\x89PNG\r\n\x1a\n\0\0\0"),
    Row("latin-1", ("scene.yaml:2: is not UTF-8 text (byte 0xe9)",), scene="# scene\n# \xe9t\xe9 \n".encode("latin-1")),
    Row("utf-16", ("is a binary file",), scene="camera: 1".encode("utf-16-le")),
    Row("control character", ("control character",), scene="camera: \x07\n"),
]

SYNTAX = [
    changed("unclosed bracket", "[0, 0, 4]", "[0, 0, 4", "scene.yaml:1: not valid YAML: "),
    changed("unclosed quote", "grey:", "'grey:", "not valid YAML: "),
    changed("tab", "  lamp:", "\tlamp:", "scene.yaml:7: not valid YAML: ", "a tab"),
    changed("wrong indent", "  lamp:", "   lamp:", "scene.yaml:7: not valid YAML: "),
    changed("duplicate key", "vfov: 40", "vfov: 40, vfov: 41", "scene.yaml:1: the key 'vfov' is given twice"),
    changed("duplicate section", "render:", "film:", "scene.yaml:3: the key 'film' is given twice, first on line 2"),
    changed("duplicate material", "lamp:", "grey:", "scene.yaml:7: the key 'grey' is given twice, first on line 6"),
    Row("alias bomb", ("aliases expand to more than 1000000 values",), scene=BOMB + SCENE),
    Row("alias to itself", ("scene.yaml:1: the alias *a stands inside",), scene="a: &a [*a]\n"),
    changed("unknown alias", "material: grey", "material: *gray", "scene.yaml:9: the alias *gray has no anchor"),
    Row("deep nesting", ("nested more than 64 levels",), scene="camera: " + "[" * 10_000),
    Row(
        "python object", ("python/object/apply:os.system' is refused",), scene="a: !!python/object/apply:os.system [x]"
    ),
    changed("other tag", "vfov: 40", "vfov: !!float 40", "scene.yaml:1: the tag", "is refused"),
    Row("two documents", ("scene.yaml:12: a second document",), scene=SCENE + "---\n" + SCENE),
    Row("a list", ("scene.yaml:1: must be a mapping (camera, film",), scene="- camera\n"),
    Row("a word", ("scene.yaml:1: must be a mapping (camera, film", "got 'camera'"), scene="camera\n"),
    changed("list as key", "materials:", "? [1, 2]\n: 3\nmaterials:", "scene.yaml:5: a key must be a plain text"),
]

KEYS = [
    changed("misspelt section", "render:", "rendr:", "scene.yaml:3: rendr: unknown key 'rendr'", "mean 'render'?"),
    changed("misspelt key", "vfov", "vfv", f"{CAMERA}.vfv: unknown key 'vfv'", "did you mean 'vfov'?"),
    changed("key of another kind", "radius: 1,", "radius: 1, smooth: true,", f"{BALL}.smooth: unknown key 'smooth'"),
    changed("missing key", "radius: 1, ", "", f"{BALL}.radius: is missing"),
    changed("missing camera", "camera:", "materials2:", "unknown key 'materials2' of scene"),
    Row("no film", ("film: is missing",), scene=SCENE.splitlines()[0]),
    changed("misspelt kind", "type: sphere", "type: sphree", f"{BALL}.type: unknown", "did you mean 'sphere'?"),
    changed("no kind", "type: sphere, ", "", f"{BALL}: needs a type, one of box, disc, mesh, quad, sphere"),
    changed("kind is a number", "type: sphere", "type: 3", f"{BALL}.type: unknown", "shape 3"),
    changed("misspelt filter", "filter: box", "filter: bx", "scene.yaml:2: film.filter: ", "did you mean 'box'?"),
    changed("misspelt sampler", "sobol", "sobl", "scene.yaml:3: render.sampler: ", "'sobl'; did you mean 'sobol'?"),
    changed("misspelt accuracy", "exact", "exakt", "render.accuracy: must be one of", "did you mean 'exact'?"),
    changed("unknown environment", "constant", "skybox", "scene.yaml:4: environment.type: ", "known types: constant"),
    changed("unknown material", "material: grey", "material: gray", f"{BALL}.material: ", "did you mean 'grey'?"),
    changed("inline material", "material: grey", "material: {type: glas}", f"{BALL}.material.type: ", "'glas'"),
    changed("material as list", "material: grey", "material: [grey]", f"{BALL}.material: must be a name"),
    changed("name given twice", "{type: quad,", "{type: quad, name: ball,", "scene.yaml:10: objects[1].name: 'ball'"),
    changed(
        "nothing where a mapping belongs", "film: {width: 8, height: 8, filter: box}", "film:", "film: must be a map"
    ),
]

VALUES = [
    changed("text for a number", "radius: 1", "radius: big", f"{BALL}.radius: must be a length", "got 'big'"),
    changed("list for a number", "radius: 1", "radius: [1]", f"{BALL}.radius: must be a length", "got a list of 1"),
    changed("truth for a number", "radius: 1", "radius: true", f"{BALL}.radius: must be a length", "got true"),
    changed("nothing for a number", "radius: 1", "radius: ~", f"{BALL}.radius: must be a length", "got nothing"),
    changed("not a number", "radius: 1", "radius: .nan", f"{BALL}.radius: must be a number, got nan"),
    changed("infinite", "radius: 1", "radius: inf", f"{BALL}.radius: must be finite, got inf"),
    changed("overflow", "radius: 1", "radius: 1e999", f"{BALL}.radius: must be finite"),
    changed("zero radius", "radius: 1", "radius: 0", f"{BALL}.radius: must not be zero"),
    changed("minus zero radius", "radius: 1", "radius: -0.0", f"{BALL}.radius: must not be zero"),
    changed("unknown unit", "radius: 1", "radius: 1 mmm", f"{BALL}.radius: ", "unknown unit 'mmm'; did you mean 'mm'?"),
    changed("unit of something else", "vfov: 40", "vfov: 40 mm", f"{CAMERA}.vfov: ", "'mm' is a unit of length"),
    changed("sexagesimal", "vfov: 40", "vfov: 1:30", f"{CAMERA}.vfov: must be an angle", "'1:30'"),
    changed("division by zero", "radius: 1", "radius: 1/0", f"{BALL}.radius: divides by zero"),
    changed("two components", "center: [0, 0, 0]", "center: [0, 0]", f"{BALL}.center: must be a point of three"),
    changed("wrong component", "center: [0, 0, 0]", "center: [0, x, 0]", f"{BALL}.center[1]: must be a length"),
    changed("one edge", "[[1, 0, 0], [0, 1, 0]]", "[[1, 0, 0]]", "scene.yaml:10: objects[1].edges[1]: is missing"),
    changed("parallel edges", "[0, 1, 0]]", "[2, 0, 0]]", "scene.yaml:10: objects[1].edges: "),
    changed(
        "albedo above 1", "albedo: 0.5", "albedo: [0.5, 1.2, 0]", "scene.yaml:6: materials.grey.albedo[1]: must be"
    ),
    changed("negative albedo", "albedo: 0.5", "albedo: -0.5", "materials.grey.albedo: must be at least 0, got -0.5"),
    changed(
        "negative radiance", "[1, 2, 3]", "[1, -2, 3]", "scene.yaml:7: materials.lamp.radiance[1]: must be at least"
    ),
    changed("vfov 180", "vfov: 40", "vfov: 180", f"{CAMERA}.vfov: must be less than 180, got 180"),
    changed("vfov 0", "vfov: 40", "vfov: 0", f"{CAMERA}.vfov: must be greater than 0, got 0"),
    changed("camera looks nowhere", "[0, 0, 4]", "[0, 0, 0]", f"{CAMERA}: look_from and look_at are the same point"),
    changed("up along the view", "up: [0, 1, 0]", "up: [0, 0, 2]", f"{CAMERA}: up is parallel to the view"),
    changed("no up", "up: [0, 1, 0]", "up: [0, 0, 0]", f"{CAMERA}.up: must not be the zero vector"),
    changed("zero focus distance", "vfov: 40", "vfov: 40, focus_distance: 0", f"{CAMERA}.focus_distance: must be gr"),
    changed("two apertures", "vfov: 40", "vfov: 40, aperture: 1, defocus_angle: 1", f"{CAMERA}: ", "aperture"),
    changed("width 0", "width: 8", "width: 0", "scene.yaml:2: film.width: must be at least 1, got 0"),
    changed("half a pixel", "width: 8", "width: 8.5", "film.width: must be a whole number, got 8.5"),
    changed("10^9 pixels", "width: 8, height: 8", "width: 50000, height: 20000", "film: is too large", "1,000,000,000"),
    changed("spp 0", "spp: 1", "spp: 0", "scene.yaml:3: render.spp: must be at least 1, got 0"),
    changed("spp 2^31", "spp: 1", "spp: 2147483648", "render.spp: must be at most 2147483647"),
    changed("depth 0", "max_depth: 2", "max_depth: 0", "render.max_depth: must be at least 1, got 0"),
    changed("negative seed", "seed: 0", "seed: -1", "render.seed: must be at least 0, got -1"),
    changed(
        "scale 0", "radius: 1", "radius: 1, transform: [{scale: 0}]", f"{BALL}.transform[0].scale: must not be zero"
    ),
    changed(
        "flat matrix", "radius: 1", f"radius: 1, transform: {[[0] * 4] * 3 + [[0, 0, 0, 1]]}", "flattens the object"
    ),
    changed("two steps in one", "radius: 1", "radius: 1, transform: [{scale: 2, translate: [0, 0, 1]}]", "exactly one"),
    changed("missing mesh", "rock.ply", "stone.ply", "scene.yaml:11: objects[2].file: there is no file 'stone.ply'"),
    changed("mesh without a name", "rock.ply", '""', "scene.yaml:11: objects[2].file: must not be empty"),
    changed("mesh is a folder", "rock.ply", ".", "scene.yaml:11: objects[2].file: '.' is a folder"),
]

MESHES = [
    mesh("mesh of NaN", ".obj", ROCK.replace("1 0 0", "nan 0 0"), "broken.obj"),
    mesh("mesh of infinity", ".obj", ROCK.replace("1 0 0", "inf 0 0"), "broken.obj"),
    mesh("empty mesh", ".obj", "", "broken.obj"),
    mesh("mesh without faces", ".obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "broken.obj"),
    mesh("index outside", ".obj", ROCK.replace("1 2 3", "1 2 9"), "broken.obj"),
    mesh("cut off", ".ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 3\n", "broken.ply"),
    mesh("no mesh at all", ".ply", b"GIF89a\0\0", "broken.ply"),
    mesh("unknown suffix of a mesh", ".xyzzy", ROCK, "xyzzy"),
]

OVERRIDES = [
    override("without value", "camera.vfov", "-D camera.vfov", "must be key.path=value"),
    override("wrong value", "camera.vfov=200", "-D camera.vfov=200: camera.vfov: must be less than 180, got 200"),
    override("misspelt path", "camera.vfv=20", "-D camera.vfv=20: camera.vfv: ", "did you mean 'vfov'?"),
    override("misspelt head", "camra.vfov=20", "-D camra.vfov=20: camra: ", "did you mean 'camera'?"),
    override("unknown object", "objects.bal.radius=2", "-D objects.bal.radius=2: ", "did you mean 'ball'?"),
    override("object outside", "objects[9].radius=2", "-D objects[9].radius=2: there is no item 9; the list has 3"),
    override("below a number", "film.width.x=2", "-D film.width.x=2: "),
    override("no path", "=2", "-D =2: ", "is not a path"),
    override("broken YAML", "camera.vfov=[1", "-D camera.vfov=[1: not valid YAML"),
    override("given twice", "film.width=2 -D film.width=3", "film.width is given twice"),
]

RENDER = [
    options("unknown suffix of an image", "-o DIR/out.xyz", ".xyz"),
    options("no suffix", "-o DIR/out", "out"),
    options("output below a file", "-o SCENE/out.png", "out.png: cannot be written"),
    options("full disk", "-o DIR/full.png", "No space left on device", status=1),
    options("crop outside", "-o DIR/out.npy --crop 4,4,20,20", "crop"),
    options("crop of nothing", "-o DIR/out.npy --crop 4,4,4,4", "crop"),
    options("crop of three numbers", "-o DIR/out.npy --crop 0,0,4", "crop"),
    options("--spp 0", "-o DIR/out.npy --spp 0", "spp"),
    options("--threads 0", "-o DIR/out.npy --threads 0", "threads"),
    options("threads in words", "-o DIR/out.npy --threads many", "'--threads': must be a whole number (see"),
    options("negative --seed", "-o DIR/out.npy --seed -1", "seed"),
    options("unknown option", "--fast", "--fast"),
    Row("no objects", ("no objects",), scene=SCENE[: SCENE.index("objects:")], command="render SCENE -o DIR/out.npy"),
    Row(
        "squashed sphere",
        (f"{BALL}: ",),
        change=("radius: 1", "radius: 1, transform: [{scale: [1, 2, 1]}]"),
        command="render SCENE -o DIR/out.npy",
    ),
    Row("missing scene", ("nowhere.yaml: no such file",), command="render DIR/nowhere.yaml"),
    Row("no scene", ("SCENE",), command="render"),
    Row("explain a missing scene", ("nowhere.yaml: no such file",), command="explain DIR/nowhere.yaml"),
]

USAGE = [
    Row("no command", ("Missing command", "rt --help"), command=""),
    Row("unknown command", ("No such command 'rendr'",), command="rendr"),
    Row("unknown option of rt", ("--verbos",), command="--verbos"),
    Row("validate nothing", ("Missing argument",), command="validate"),
    Row("unknown option of a command", ("--strictt", "rt validate --help"), command="validate --strictt SCENE"),
    Row("schema of something", ("unexpected extra argument",), command="schema SCENE"),
]

ROWS = [*FILES, *SYNTAX, *KEYS, *VALUES, *MESHES, *OVERRIDES, *RENDER, *USAGE]


def is_there(command: str) -> bool:
    return importlib.util.find_spec(f"raytracer.cli.{command}") is not None


def run(row: Row, folder: Path) -> int:
    scene: str | bytes = row.scene
    if row.change is not None:
        assert isinstance(scene, str)
        assert row.change[0] in scene, "the row changes nothing"
        scene = scene.replace(row.change[0], row.change[1], 1)
    files = {"scene.yaml": scene, "rock.ply": PLY, **dict(row.files)}
    for name, data in files.items():
        (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)
    words = row.command.replace("SCENE", str(folder / "scene.yaml")).replace("DIR", str(folder)).split()
    return main(words)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name.replace(" ", "-"))
def test_broken_input_is_told_in_one_sentence(
    row: Row, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = row.command.split(" ")[0]
    if command in ("render", "explain") and not is_there(command):
        pytest.skip(f"there is no rt {command} yet")
    if "full.png" in row.command:
        if not Path("/dev/full").exists():
            pytest.skip("needs a device that is always full")
        (tmp_path / "full.png").symlink_to("/dev/full")
    monkeypatch.chdir(tmp_path)

    status = run(row, tmp_path)

    captured = capsys.readouterr()
    sentence = captured.err.replace(f"{tmp_path}{os.sep}", "")
    assert status == row.status, sentence
    assert captured.out == ""
    assert sentence.startswith("rt: ")
    assert sentence.endswith("\n")
    assert sentence.count("\n") == 1
    for jargon in ("Traceback", "Input should", "validation error", "[type=", "None", "internal error"):
        assert jargon not in sentence
    for words in row.words:
        assert words in sentence
    assert not list(tmp_path.glob("out*")), "a refused command leaves nothing behind"


def test_the_scene_that_rows_change_is_right(tmp_path: Path) -> None:
    assert run(Row("right", (), command="validate --quiet SCENE"), tmp_path) == 0


def test_names_of_rows_are_unique() -> None:
    names = [row.name for row in ROWS]
    assert len(set(names)) == len(names)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="needs a user whom permissions bind")
def test_a_file_without_permission_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    path.chmod(stat.S_IWUSR)
    assert main(["validate", str(path)]) == 2
    assert capsys.readouterr().err == f"rt: {path}: cannot be read: permission denied\n"


def test_a_scene_of_every_wrong_number_never_passes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # Whatever number of the scene is replaced by NaN, the scene is refused at that line.
    for start in [i for i, c in enumerate(SCENE) if c.isdigit() and not SCENE[i - 1].isalnum() and SCENE[i - 1] != "."]:
        end = next(i for i in range(start, len(SCENE)) if not (SCENE[i].isdigit() or SCENE[i] == "."))
        path = tmp_path / "scene.yaml"
        (tmp_path / "rock.ply").write_text(PLY)
        path.write_text(SCENE[:start] + ".nan" + SCENE[end:])
        assert main(["validate", str(path)]) == 2
        sentence = capsys.readouterr().err
        assert f"scene.yaml:{SCENE[:start].count(chr(10)) + 1}: " in sentence
        assert "got nan" in sentence
