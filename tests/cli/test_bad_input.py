"""Broken scenes and command lines: each is refused in one sentence that says where and what is wrong.

A row is a scene, as a change of a scene that is right, and a command line; SCENE in it stands for the scene's file,
DIR for the folder of the test.  The status is 2 for wrong input, and 1 for a machine that fails while it works.
"""

import dataclasses
import importlib.util
import io
import os
import stat
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.util import atomic_write

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
  - {type: quad, corner: [2, 0, 0], edges: [[1, 0, 0], [0, 1, 0]], material: lamp}
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
    Row("alias bomb", ("aliases expand to more than 1,000,000 values",), scene=BOMB + SCENE),
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
    changed("list as key", "materials:", "? [1, 2]\n: 3\nmaterials:", "scene.yaml:5: a key must be a plain string"),
]

KEYS = [
    changed("misspelt section", "render:", "rendr:", "scene.yaml:3: rendr: unknown key 'rendr'", "mean 'render'?"),
    changed("misspelt key", "vfov", "vfv", f"{CAMERA}.vfv: unknown key 'vfv'", "did you mean 'vfov'?"),
    changed("key of another kind", "radius: 1,", "radius: 1, smooth: true,", f"{BALL}.smooth: unknown key 'smooth'"),
    changed("missing key", "radius: 1, ", "", f"{BALL}.radius: is missing"),
    changed("missing camera", "camera:", "materials2:", "unknown key 'materials2' of scene"),
    Row("no film", ("film: is missing",), scene=SCENE.splitlines()[0]),
    changed("misspelt kind", "type: sphere", "type: sphree", f"{BALL}.type: unknown", "did you mean 'sphere'?"),
    changed("no kind", "type: sphere, ", "", f"{BALL}: needs a type, one of box, disc, instance, mesh, quad, s"),
    changed("kind is a number", "type: sphere", "type: 3", f"{BALL}.type: unknown", "shape 3"),
    changed("misspelt filter", "filter: box", "filter: bx", "scene.yaml:2: film.filter: ", "did you mean 'box'?"),
    changed("misspelt sampler", "sobol", "sobl", "scene.yaml:3: render.sampler: ", "'sobl'; did you mean 'sobol'?"),
    changed("misspelt light sampling", "seed: 0", "light_sampling: path", "light_sampling: ", "did you mean 'paths'?"),
    changed("misspelt accuracy", "exact", "exakt", "render.accuracy: must be one of", "did you mean 'exact'?"),
    changed("unknown environment", "constant", "skybox", "scene.yaml:4: environment.type: ", "mean 'sky'?"),
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
    changed("too large", "radius: 1", "radius: 1e31", f"{BALL}.radius: must be 0, or of a magnitude between 1e-30"),
    changed("too small", "radius: 1", "radius: 1e-28 mm", f"{BALL}.radius: must be 0, or of a magnitude", "'1e-28 mm'"),
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
    changed("two apertures", "vfov: 40", "vfov: 40, aperture: 1, defocus_angle: 1", f"{CAMERA}.aperture: ", "give one"),
    changed("width 0", "width: 8", "width: 0", "scene.yaml:2: film.width: must be at least 1, got 0"),
    changed("half a pixel", "width: 8", "width: 8.5", "film.width: must be an integer, got 8.5"),
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

QUAD = "scene.yaml:10: objects[1]"


def rigid(name: str, matrix: str, *words: str) -> Row:
    return changed(name, "radius: 1,", f"radius: 1, transform: {matrix},", *words)


# What float32 cannot hold, and what is nothing.
LIMITS = [
    changed(
        "radius too small", "radius: 1", "radius: 1e-25", f"{BALL}: is 2e-25 m large, and rays find nothing smaller"
    ),
    changed("radius too large", "radius: 1", "radius: 1e25", f"{BALL}: lies 1e+25 m from the origin, or is as large"),
    changed(
        "beyond what rays find",
        "center: [0, 0, 0]",
        "center: [0, 2e18, 0]",
        f"{BALL}: lies 2e+18 m",
        "beyond 1.84e+18 m",
    ),
    changed("edges too small", "[[1, 0, 0], [0, 1, 0]]", "[[1e-25, 0, 0], [0, 1e-25, 0]]", f"{QUAD}: is 1e-25 m large"),
    changed("edges too large", "[[1, 0, 0], [0, 1, 0]]", "[[1e25, 0, 0], [0, 1e25, 0]]", f"{QUAD}: lies 1e+25 m"),
    changed("edges of nothing", "[[1, 0, 0], [0, 1, 0]]", "[[0, 0, 0], [0, 1, 0]]", f"{QUAD}.edges: ", "has no area"),
    changed(
        "edges of NaN", "[[1, 0, 0], [0, 1, 0]]", "[[1, 0, .nan], [0, 1, 0]]", f"{QUAD}.edges[0][2]: must be", "nan"
    ),
    rigid("scale too small", "[{scale: 1e-25}]", f"{BALL}: is 2e-25 m large, and rays find nothing smaller"),
    rigid(
        "scale that float32 cannot undo", "[{scale: [1e-14, 2e-14, 1e-14]}]", f"{BALL}: scales by 1.26e-14, and float32"
    ),
    rigid("scale of NaN", "[{scale: .nan}]", f"{BALL}.transform[0].scale: must be a number, got nan"),
    rigid("matrix of NaN", f"{[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, '.nan', 0], [0, 0, 0, 1]]}", f"{BALL}.transform"),
    rigid("shear to nothing", "[[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]", "flattens the object"),
    mesh("mesh of lines", ".obj", "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\nf 3 3 3\n", "has no faces with an area"),
    changed(
        "mesh beyond what rays find", "file: rock.ply", "file: rock.ply, transform: [{scale: 1e19}]", "lies 1e+19 m"
    ),
]

STRICT = [
    Row(
        "a sphere twice, strictly",
        ('scene.yaml:10: objects[1] "twin": a surface of it coincides with one of objects[0] "ball", to within',),
        change=(
            "  - {type: quad,",
            "  - {type: sphere, name: twin, center: [0, 0, 0], radius: 1, material: lamp}\n  - {type: quad,",
        ),
        command="render SCENE -o DIR/out.npy --strict",
    ),
    Row(
        "a camera in a ball, strictly",
        ('scene.yaml:1: camera.look_from: is inside objects[0] "ball", which is opaque and holds no light',),
        change=("look_from: [0, 0, 4]", "look_from: [0, 0, 0.5]"),
        command="validate --strict SCENE",
    ),
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
    options("full disk", "-o DIR/full.png -D render.max_depth=1", "No space left on device", status=1),
    options("crop outside", "-o DIR/out.npy --crop 4,4,20,20", "crop"),
    options("crop of nothing", "-o DIR/out.npy --crop 4,4,4,4", "crop"),
    options("crop of three numbers", "-o DIR/out.npy --crop 0,0,4", "crop"),
    options("no noise at all", "-o DIR/out.npy --noise 0", "--noise 0: must be greater than 0"),
    options("negative noise", "-o DIR/out.npy --noise -1", "--noise -1: must be greater than 0"),
    options("more noise than picture", "-o DIR/out.npy --noise 200%", "--noise 200%: ", "less than 100%"),
    options("noise in percent without the sign", "-o DIR/out.npy --noise 2", "did you mean 2%?"),
    options("noise in words", "-o DIR/out.npy --noise abc", "--noise abc: must be a relative error such as 1% or 0.01"),
    options("noise that is no number", "-o DIR/out.npy --noise nan", "--noise nan: must be a relative error"),
    options("no time", "-o DIR/out.npy --time-limit 0s", "--time-limit 0s: must be a time greater than 0"),
    options("time without end", "-o DIR/out.npy --time-limit inf", "--time-limit inf: must be a finite time"),
    options("time in metres", "-o DIR/out.npy --time-limit 3m", "--time-limit 3m: "),
    options("--spp 0", "-o DIR/out.npy --spp 0", "spp"),
    options("--threads 0", "-o DIR/out.npy --threads 0", "threads"),
    options("threads in words", "-o DIR/out.npy --threads many", "'--threads': must be an integer (see"),
    options("negative --seed", "-o DIR/out.npy --seed -1", "seed"),
    options("unknown option", "--fast", "--fast"),
    Row("no objects", ("no objects",), scene=SCENE[: SCENE.index("objects:")], command="render SCENE -o DIR/out.npy"),
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


def light(name: str, keys: str, *words: str) -> Row:
    return changed(name, "objects:", f"lights: [{{{keys}}}]\nobjects:", "scene.yaml:8: lights[0]", *words)


def surroundings(name: str, keys: str, *words: str, file: tuple[str, str | bytes] | None = None) -> Row:
    return Row(
        name,
        ("scene.yaml:4: environment", *words),
        change=("{type: constant, radiance: 1}", f"{{{keys}}}"),
        command="render SCENE -o DIR/out.npy",
        files=() if file is None else (file,),
    )


def npy(values: list[float], shape: tuple[int, ...] = (1, 2, 3)) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.resize(values, shape))
    return buffer.getvalue()


POINT = "type: point, position: [0, 5, 0], intensity: 1"
SPOT = "type: spot, position: [0, 5, 0], direction: [0, -1, 0], intensity: 1, angle: 40"
SUN = "type: sun, direction: [0, -1, 0], irradiance: 1"
FLASH = "type: flash, energy: 2"

LIGHTS = [
    changed(
        "point light that paths would miss",
        "seed: 0}\n",
        f"seed: 0, light_sampling: paths}}\nlights: [{{{POINT}}}]\n",
        "scene.yaml:3: render.light_sampling: paths never find a point light without extent, since no ray can meet it",
    ),
    Row(
        "flash that paths would miss",
        ("-D render.light_sampling=paths: render.light_sampling: paths never find a flash light", "use mis or lights"),
        change=("vfov: 40}", f"vfov: 40, shutter: 1}}\nlights: [{{{FLASH}}}]"),
        command="render SCENE -o DIR/out.npy -D render.light_sampling=paths",
    ),
    light("unknown light", "type: lamp", ".type: unknown type of light 'lamp'", "point, spot, sun"),
    light("light without a position", "type: point, intensity: 1", ".position: is missing"),
    light("light without an intensity", "type: point, position: [0, 5, 0]", ".intensity: is missing"),
    light("negative intensity", POINT.replace("y: 1", "y: -1"), ".intensity: must be at least 0, got -1"),
    light("intensity of two channels", POINT.replace("y: 1", "y: [1, 2]"), ".intensity: must be an intensity of three"),
    light("infinite intensity", POINT.replace("y: 1", "y: inf"), ".intensity: must be finite"),
    light("misspelt key of a light", POINT + ", colour: 1", ".colour: unknown key 'colour' of point"),
    light(
        "spot that looks nowhere", SPOT.replace("direction: [0, -1, 0], ", ""), "exactly one of direction and look_at"
    ),
    light("spot that looks twice", SPOT + ", look_at: [0, 0, 0]", "exactly one of direction and look_at"),
    light(
        "spot that looks at itself", SPOT.replace("direction: [0, -1, 0]", "look_at: [0, 5, 0]"), ".look_at: is the "
    ),
    light("spot without an axis", SPOT.replace("[0, -1, 0]", "[0, 0, 0]"), ".direction: must not be the zero vector"),
    light("spot of 0 degrees", SPOT.replace("40", "0"), ".angle: must be greater than 0, got 0"),
    light("spot of 181 degrees", SPOT.replace("40", "181"), ".angle: must be at most 180, got 181"),
    light("penumbra beyond the axis", SPOT + ", penumbra: 21", ".penumbra: must be at most half the angle, 20, got 21"),
    light("sun from nowhere", SUN.replace("[0, -1, 0]", "[0, 0, 0]"), ".direction: must not be the zero vector"),
    light("negative irradiance", SUN.replace("e: 1", "e: [1, -1, 1]"), ".irradiance[1]: must be at least 0, got -1"),
    light("sun of 181 degrees", SUN + ", angle: 181", ".angle: must be at most 180, got 181"),
    light("sun in metres", SUN + ", angle: 1 m", ".angle: must be an angle", "unit of length"),
    light("flash without energy", "type: flash", ".energy: is missing"),
    light("negative energy", FLASH.replace("2", "[1, -2, 1]"), ".energy[1]: must be at least 0, got -2"),
    light("flash of no time", FLASH + ", duration: 0", ".duration: must be greater than 0, got 0"),
    light(
        "flash of a third curtain", FLASH + ", curtain: third", ".curtain: must be one of first, second, got 'third'"
    ),
    light("flash of another intensity", FLASH + ", intensity: 1", ".intensity: unknown key 'intensity' of flash"),
    Row(
        "flash in a moment",
        ("scene.yaml:8: lights[0]: a flash needs a shutter that is open for some time", "camera.shutter"),
        change=("objects:", f"lights: [{{{FLASH}}}]\nobjects:"),
        command="render SCENE -o DIR/out.npy",
    ),
    surroundings("environment without a file", "type: image", ".file: is missing"),
    surroundings("sun too bright", "type: sky, sun: true, scale: 1e30", ".scale: gives the sun an irradiance of"),
    surroundings("environment that is not there", "type: image, file: sky.hdr", ".file: there is no file 'sky.hdr'"),
    surroundings("environment of unknown suffix", "type: image, file: a.xyz", ".xyz", file=("a.xyz", "x")),
    surroundings("environment that is broken", "type: image, file: a.hdr", "a.hdr", file=("a.hdr", "#?RADIANCE\n")),
    surroundings("environment cut off", "type: image, file: a.npy", "a.npy", file=("a.npy", npy([1.0])[:-8])),
    surroundings("environment of NaN", "type: image, file: a.npy", "not finite", file=("a.npy", npy([1.0, np.nan]))),
    surroundings("environment of inf", "type: image, file: a.npy", "not finite", file=("a.npy", npy([np.inf]))),
    surroundings("negative environment", "type: image, file: a.npy", "negative", file=("a.npy", npy([1.0, -1.0]))),
    surroundings(
        "environment of 2 axes too many", "type: image, file: a.npy", "a.npy", file=("a.npy", npy([1.0], (1,)))
    ),
    surroundings(
        "environment too bright", "type: image, file: a.npy, scale: 1e30", "3.4e38", file=("a.npy", npy([1e9]))
    ),
    surroundings(
        "negative scale", "type: image, file: a.npy, scale: -1", ".scale: must be at least 0", file=("a.npy", "")
    ),
    surroundings("misspelt encoding", "type: image, file: a.npy, encoding: sRGB", "mean 'srgb'?", file=("a.npy", "")),
    surroundings("turbidity 1", "type: sky, turbidity: 1", ".turbidity: must be at least 2, got 1"),
    surroundings("turbidity 11", "type: sky, turbidity: 11", ".turbidity: must be at most 10, got 11"),
    surroundings("sun below the horizon", "type: sky, sun_elevation: -1", ".sun_elevation: must be at least 0, got -1"),
    surroundings("sun beyond the zenith", "type: sky, sun_elevation: 91", ".sun_elevation: must be at most 90, got 91"),
    surroundings("sun direction below", "type: sky, sun_direction: [1, -1, 0]", ".sun_direction: points below the hor"),
    surroundings("no sun direction", "type: sky, sun_direction: [0, 0, 0]", ".sun_direction: must not be the zero"),
    surroundings(
        "two suns", "type: sky, sun_elevation: 9, sun_direction: [1, 1, 0]", ".sun_elevation: is given besides"
    ),
    surroundings("sun that is a number", "type: sky, sun: 1", ".sun: must be true or false, got 1"),
]


def moving(name: str, motion: str, *words: str) -> Row:
    return changed(name, "radius: 1, material: grey", f"radius: 1, material: grey, motion: {motion}", *words)


def exposed(name: str, keys: str, *words: str, command: str = "validate SCENE") -> Row:
    return Row(name, words, change=("vfov: 40", f"vfov: 40, {keys}"), command=command)


def framed(name: str, frames: str, *words: str, command: str = "validate SCENE") -> Row:
    change = ("file: rock.ply", f"frames: {frames}")
    files = (("other.ply", PLY.replace("3 0 1 2", "3 0 2 1")),)
    return Row(name, words, change=change, command=command, files=files)


_SAME = "{time: 0, transform: []}"
MOTION = [
    moving("a motion that is none", "{}", f"{BALL}.motion: needs a velocity, a spin or keyframes"),
    moving(
        "a motion of an unknown key", "{velocty: [1, 0, 0]}", f"{BALL}.motion.velocty: ", "did you mean 'velocity'?"
    ),
    moving(
        "a velocity of two numbers", "{velocity: [1, 0]}", f"{BALL}.motion.velocity: ", "a velocity of three numbers"
    ),
    moving(
        "a velocity in metres", "{velocity: [1 m, 0, 0]}", f"{BALL}.motion.velocity[0]: ", "'m' is a unit of length"
    ),
    moving("a spin without a rate", "{spin: {axis: [0, 0, 1]}}", f"{BALL}.motion.spin.rate: is missing"),
    moving("a spin about nothing", "{spin: {axis: [0, 0, 0], rate: 1}}", f"{BALL}.motion.spin.axis: ", "zero vector"),
    moving(
        "a rate in degrees", "{spin: {axis: [0, 0, 1], rate: 9 deg}}", f"{BALL}.motion.spin.rate: ", "unit of angle"
    ),
    moving("a rate in turns", "{spin: {axis: [0, 0, 1], rate: 9 turns/s}}", "unknown unit 'turns/s'", "'turn/s'"),
    moving("one keyframe", f"{{keyframes: [{_SAME}]}}", f"{BALL}.motion.keyframes: ", "at least two keyframes"),
    moving(
        "keyframes and a velocity",
        f"{{velocity: [1, 0, 0], keyframes: [{_SAME}, {{time: 1, transform: []}}]}}",
        f"{BALL}.motion.keyframes: ",
        "give either",
    ),
    moving(
        "keyframes at one time",
        f"{{keyframes: [{_SAME}, {_SAME}]}}",
        f"{BALL}.motion.keyframes[1].time: must be later than the keyframe before, 0 s, got 0 s",
    ),
    moving(
        "keyframes that mirror",
        f"{{keyframes: [{_SAME}, {{time: 1, transform: [{{scale: [1, -1, 1]}}]}}]}}",
        f"{BALL}.motion.keyframes[1].transform: ",
        "mirror image",
    ),
    moving(
        "a keyframe that flattens",
        f"{{keyframes: [{_SAME}, {{time: 1, transform: [{{scale: [1, 0, 1]}}]}}]}}",
        f"{BALL}.motion.keyframes[1].transform",
        "must not be zero",
    ),
    Row(
        "a spin of too many turns",
        (f"{BALL}.motion: turns 100 times while the shutter is open, and fewer than 42.67 turns",),
        scene=SCENE.replace("vfov: 40", "vfov: 40, shutter: 1"),
        change=("radius: 1,", "radius: 1, motion: {spin: {axis: [0, 0, 1], rate: 100 turn/s}},"),
        command="render SCENE -o DIR/out.npy",
    ),
    exposed("a shutter that closes first", "shutter: {open: 2, close: 1}", f"{CAMERA}.shutter.close: ", "2 s, got 1 s"),
    exposed("a shutter without an end", "shutter: {open: 2}", f"{CAMERA}.shutter.close: is missing"),
    exposed("a shutter of an unknown key", "shutter: {close: 1, from: 0}", f"{CAMERA}.shutter.from: unknown key"),
    exposed("a negative exposure", "shutter: -1/125 s", f"{CAMERA}.shutter: ", "at least 0"),
    exposed("a shutter in metres", "shutter: 8 mm", f"{CAMERA}.shutter: ", "'mm' is a unit of length"),
    exposed("a shutter too late", "time: 1e9, shutter: 1 ns", f"{CAMERA}.time: is open for 1e-09 s, too short"),
    exposed("a shutter that is a list", "shutter: [0, 1]", f"{CAMERA}.shutter: must be a time"),
    exposed("two openings", "shutter: {open: 0, close: 1}, time: 1", f"{CAMERA}.time: ", "give one"),
    exposed("a shutter of two ends", "shutter: {close: 1, duration: 1}", f"{CAMERA}.shutter.duration: ", "give one"),
    exposed(
        "two openings, one by duration", "shutter: {open: 0, duration: 1}, time: 1", f"{CAMERA}.time: ", "give one"
    ),
    exposed("a negative duration", "shutter: {duration: -1 s}", f"{CAMERA}.shutter.duration: must be at least 0"),
    exposed(
        "an opening of unknown form",
        "shutter: {duration: 1, opening: sudden}",
        f"{CAMERA}.shutter.opening: must be instant or trapezoid, or [[time, transmission], ...], got 'sudden'",
    ),
    exposed(
        "a trapezoid without a ramp",
        "shutter: {duration: 1, opening: trapezoid}",
        f"{CAMERA}.shutter.ramp: is missing: a trapezoid needs the time in which it opens",
    ),
    exposed(
        "a ramp of no trapezoid",
        "shutter: {duration: 1, ramp: 1 ms}",
        f"{CAMERA}.shutter.ramp: belongs to `opening: trapezoid`",
    ),
    exposed(
        "a ramp longer than the shutter",
        "shutter: {duration: 1 ms, opening: trapezoid, ramp: 1 s}",
        f"{CAMERA}.shutter.ramp: must be at most the duration, 0.001 s, got 1 s",
    ),
    exposed(
        "a curve and a duration",
        "shutter: {duration: 1, opening: [[0, 1], [1, 0]]}",
        f"{CAMERA}.shutter.duration: the curve of `opening` says",
    ),
    exposed(
        "a curve back in time",
        "shutter: {opening: [[0, 1], [2, 0], [1, 0]]}",
        f"{CAMERA}.shutter.opening[2][0]: must be later than the point before, 2 s, got 1 s",
    ),
    exposed(
        "a curve of more than all light",
        "shutter: {opening: [[0, 1], [2, 1.5]]}",
        f"{CAMERA}.shutter.opening[1][1]: must be at most 1, got 1.5",
    ),
    exposed(
        "a curve of metres", "shutter: {opening: [[0, 1], [2 m, 1]]}", f"{CAMERA}.shutter.opening[1][0]: ", "of length"
    ),
    exposed(
        "a curve of triples", "shutter: {opening: [[0, 1, 2]]}", f"{CAMERA}.shutter.opening[0]: must be a time and"
    ),
    exposed("a dark curve", "shutter: {opening: [[0, 0], [1, 0]]}", f"{CAMERA}.shutter.opening: lets no light through"),
    exposed("a curve of a point", "shutter: {opening: [[0, 1]]}", f"{CAMERA}.shutter.opening: lets no light through"),
    exposed(
        "a readout back in time", "shutter: {duration: 1, readout: -1}", f"{CAMERA}.shutter.readout: ", "at least 0"
    ),
    exposed(
        "a readout to nowhere",
        "shutter: {duration: 1, readout: 1, direction: donw}",
        f"{CAMERA}.shutter.direction: must be one of down, up, left, right, got 'donw'; did you mean 'down'?",
    ),
    exposed(
        "a curtain of cloth", "shutter: {duration: 1, curtain: cloth}", f"{CAMERA}.shutter.curtain: must be one of"
    ),
    exposed("a shake without an amplitude", "shake: {bandwidth: 5}", f"{CAMERA}.shake.amplitude: is missing"),
    exposed("a shake in metres", "shake: {amplitude: 1 mm}", f"{CAMERA}.shake.amplitude: ", "unit of length"),
    exposed("a negative shake", "shake: {amplitude: -1}", f"{CAMERA}.shake.amplitude: must be at least 0, got -1"),
    exposed("a shake of whole turns", "shake: {amplitude: 200}", f"{CAMERA}.shake.amplitude: must be at most 180"),
    exposed("a shake of no bandwidth", "shake: {amplitude: 1, bandwidth: 0}", f"{CAMERA}.shake.bandwidth: ", "than 0"),
    exposed("a shake of rpm", "shake: {amplitude: 1, bandwidth: 9 rpm}", f"{CAMERA}.shake.bandwidth: ", "angular rate"),
    exposed("a shake of seed 0.5", "shake: {amplitude: 1, seed: 0.5}", f"{CAMERA}.shake.seed: must be an integer"),
    exposed(
        "a shake too fast to follow",
        "shutter: 100 s, shake: {amplitude: 1, bandwidth: 1 kHz}",
        f"{CAMERA}.shake.bandwidth: shakes 1e+05 times while the shutter is open, and at most 4096 times",
    ),
    exposed("a time that is none", "time: noon", f"{CAMERA}.time: ", "must be a time"),
    exposed(
        "a camera that grows",
        f"motion: {{keyframes: [{_SAME}, {{time: 1, transform: [{{scale: 2}}]}}]}}",
        f"{CAMERA}.motion.keyframes[1].transform: a camera can be moved and turned, but not scaled",
    ),
    exposed(
        "a camera that turns too often",
        "shutter: 1, motion: {spin: {axis: [0, 1, 0], rate: 3000 rpm}}",
        f"{CAMERA}.motion: turns 50 times",
        command="render SCENE -o DIR/out.npy",
    ),
    framed("one frame", "[{time: 0, file: rock.ply}]", "objects[2].frames: ", "at least two frames"),
    framed(
        "frames in disorder",
        "[{time: 1, file: rock.ply}, {time: 0, file: rock.ply}]",
        "objects[2].frames[1].time: must be later than the frame before, 1 s, got 0 s",
    ),
    framed(
        "a frame without a file",
        "[{time: 0, file: rock.ply}, {time: 1, file: gone.ply}]",
        "objects[2].frames[1].file: there is no file 'gone.ply'",
    ),
    framed(
        "frames of other triangles",
        "[{time: 0, file: rock.ply}, {time: 1, file: other.ply}]",
        "objects[2]: the file of frames[1] has not the same triangles as that of frames[0]",
        command="render SCENE -o DIR/out.npy",
    ),
    changed("a file and frames", "file: rock.ply", "file: rock.ply, frames: [{time: 0, file: rock.ply}]", "not both"),
    changed("a mesh of nothing", "type: mesh, file: rock.ply", "type: mesh", "objects[2]: needs a file or frames"),
]

THIN_LENS = "type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], up: [0, 1, 0], vfov: 40"


def camera(name: str, keys: str, *words: str) -> Row:
    return changed(name, THIN_LENS, keys, *words)


PROJECTIONS = [
    camera("vfov of parallel rays", "type: orthographic, height: 2, vfov: 40", f"{CAMERA}.vfov: unknown key 'vfov'"),
    camera("orthographic without a size", "type: orthographic", f"{CAMERA}: needs a size", "either height or width"),
    camera("orthographic of two sizes", "type: orthographic, height: 1, width: 2", f"{CAMERA}: ", "height or width"),
    camera("orthographic of no height", "type: orthographic, height: 0", f"{CAMERA}.height: must be greater than 0"),
    camera("orthographic of no width", "type: orthographic, width: -2 m", f"{CAMERA}.width: must be greater than 0"),
    camera("panorama of no width", "type: equirectangular, hfov: 0", f"{CAMERA}.hfov: must be greater than 0"),
    camera("panorama around twice", "type: equirectangular, hfov: 720", f"{CAMERA}.hfov: must be at most 360"),
    camera("panorama beyond the poles", "type: equirectangular, vfov: 181", f"{CAMERA}.vfov: must be at most 180"),
    camera("misspelt panorama", "type: equirectanglar", f"{CAMERA}.type: ", "did you mean 'equirectangular'?"),
    camera("misspelt projection", "type: fisheye, projection: equisold", f"{CAMERA}.projection: ", "'equisolid'?"),
    camera("fisheye of no field", "type: fisheye, fov: 0 deg", f"{CAMERA}.fov: must be greater than 0"),
    camera("fisheye of more than all", "type: fisheye, fov: 400", f"{CAMERA}.fov: must be at most 360"),
    camera(
        "infinite stereographic picture",
        "type: fisheye, projection: stereographic, fov: 360",
        f"{CAMERA}.fov: must be less than 360 deg for the stereographic projection",
    ),
    camera(
        "orthographic fisheye behind itself",
        "type: fisheye, projection: orthographic, fov: 200",
        f"{CAMERA}.fov: must be at most 180 deg for the orthographic projection",
    ),
    camera("fisheye that looks nowhere", "type: fisheye, look_at: [0, 0, 0]", f"{CAMERA}: ", "looks nowhere"),
    options("unknown AOV", "-o DIR/out.exr --aov depth,nomral", "--aov depth,nomral: ", "did you mean 'normal'?"),
    options("AOV without a name", "-o DIR/out.exr --aov depth,,normal", "unknown AOV ''; known AOVs: albedo"),
    options("AOV without a file that holds it", "-o DIR/out.png --aov depth", "only .exr and .lf files hold layers"),
]

# ---- Media


def medium(name: str, keys: str, *words: str) -> Row:
    """A medium, on line 6, that the ball of the scene calls for."""
    text = SCENE.replace("materials:", f"media:\n  fog: {{{keys}}}\nmaterials:")
    return Row(name, ("scene.yaml:6: media.fog", *words), scene=text.replace("l: grey", "l: grey, medium: fog"))


def grid(name: str, file: str, data: str | bytes, *words: str, keys: str = "") -> Row:
    """A grid of densities from a file."""
    row = medium(name, f"type: grid, file: {file}{keys}", ".file: ", *words)
    return dataclasses.replace(row, command="render SCENE -o DIR/out.npy", files=((file, data),))


def npy(array: object, **settings: bool) -> bytes:
    """The bytes of a NumPy file."""
    buffer = io.BytesIO()
    np.save(buffer, np.asarray(array), **settings)
    return buffer.getvalue()


_GRID = np.ones((2, 3, 4))
_LIE = npy(_GRID).replace(b"(2, 3, 4), }            ", b"(2, 3, 400000000000), }")

MEDIA = [
    medium("medium of no kind", "absorption: 1", ": needs a type, one of grid, homogeneous"),
    medium("medium of an unknown kind", "type: gridd", ".type: unknown type of medium 'gridd'", "did you mean 'grid'?"),
    medium("negative absorption", "type: homogeneous, absorption: -1", ".absorption: must be at least 0, got -1"),
    medium("negative scattering", "type: homogeneous, scattering: [1, -1, 1]", ".scattering[1]: must be at least 0"),
    medium("infinite extinction", "type: homogeneous, extinction: inf, albedo: 1", ".extinction: must be finite"),
    medium("albedo of a medium above 1", "type: homogeneous, extinction: 1, albedo: 1.5", ".albedo: must be at most 1"),
    medium("medium without coefficients", "type: homogeneous", "needs absorption or scattering, or else both"),
    medium("extinction without an albedo", "type: homogeneous, extinction: 1", "needs absorption or scattering, or"),
    medium("coefficients given twice", "type: homogeneous, extinction: 1, albedo: 1, scattering: 1", "not some of"),
    medium("g above 1", "type: homogeneous, absorption: 1, g: 1.01", ".g: must be at most 1, got 1.01"),
    medium("g below -1", "type: homogeneous, absorption: 1, g: -2", ".g: must be at least -1, got -2"),
    medium("g that is no number", "type: homogeneous, absorption: 1, g: .nan", ".g: must be a number, got nan"),
    medium("misspelt key of a medium", "type: homogeneous, absorbtion: 1", "did you mean 'absorption'?"),
    medium("grid without a file", "type: grid", ".file: is missing"),
    medium("grid that is not there", "type: grid, file: a.npy", ".file: there is no file 'a.npy'"),
    medium("grid of a box turned round", "type: grid, file: rock.ply, min: [1, 0, 0]", "min must be less than max"),
    medium("negative extinction of a grid", "type: grid, file: a.npy, extinction: -1", ".extinction: must be at least"),
    changed("unknown medium", "l: grey", "l: grey, medium: fog", f"{BALL}.medium: unknown medium 'fog'; there are no"),
    changed(
        "misspelt medium",
        "materials:",
        "media: {fog: {type: homogeneous, absorption: 1}}\nmedium: fogg\nmaterials:",
        "scene.yaml:6: medium: unknown medium 'fogg'; did you mean 'fog'?",
    ),
    changed("unknown outside medium", "l: grey", "l: grey, outside_medium: fog", f"{BALL}.outside_medium: unknown"),
    changed("unknown medium of the camera", "vfov: 40", "vfov: 40, medium: fog", f"{CAMERA}.medium: unknown medium"),
    dataclasses.replace(
        medium(
            "grid that no light would get through",
            "type: grid, file: fog.npy, extinction: 1.0e+9",
            ".extinction: makes the densest voxels",
            "mean free paths thick, where 1182 are the most",
        ),
        command="render SCENE -o DIR/out.npy",
        files=(("fog.npy", npy(_GRID)),),
    ),
    grid("grid of another suffix", "fog.vdb", b"", "unknown suffix '.vdb' for a grid; known: .npy"),
    grid("grid that is no NumPy file", "fog.npy", "density", "is no NumPy file"),
    grid("empty grid file", "fog.npy", b"", "is no NumPy file"),
    grid("grid that is cut off", "fog.npy", npy(_GRID)[:-8], "is a broken NumPy file, or cut off"),
    grid("grid of a header that lies", "fog.npy", _LIE, "is a broken NumPy file, or cut off"),
    grid("grid of objects", "fog.npy", npy(np.array([[[None]]]), allow_pickle=True), "holds pickled objects"),
    grid("several grids in a file", "fog.npy", b"PK\x05\x06" + bytes(18), "is no NumPy file"),
    grid("flat grid", "fog.npy", npy(_GRID[0]), "an array of three dimensions (x, y, z), got shape 3 x 4"),
    grid("grid of one number", "fog.npy", npy(1.0), "three dimensions (x, y, z), got a single number"),
    grid("grid without voxels", "fog.npy", npy(_GRID[:0]), "three dimensions (x, y, z), got shape 0 x 3 x 4"),
    grid("complex grid", "fog.npy", npy(1j * _GRID), "must hold real numbers, got complex128"),
    grid("grid of strings", "fog.npy", npy(_GRID.astype(str)), "must hold real numbers, got "),
    grid("grid with NaN", "fog.npy", npy(np.where(_GRID.cumsum().reshape(2, 3, 4) == 7, np.nan, 1)), "is not finite"),
    grid("grid beyond float32", "fog.npy", npy(1e300 * _GRID), "has a density that is not finite, at [0, 0, 0]"),
    grid("negative grid", "fog.npy", npy(_GRID - 2.0 * np.eye(3, 4)), "has a density that is negative, at [0, 0, 0]"),
]


def placing(name: str, keys: str, *words: str, files: tuple[tuple[str, str | bytes], ...] = ()) -> Row:
    """A row whose third object places the ball, or what `keys` say."""
    return Row(
        name,
        ("scene.yaml:11: objects[2]", *words),
        change=("{type: mesh, file: rock.ply}", f"{{{keys}}}"),
        command="render SCENE -o DIR/out.npy",
        files=files,
    )


def grouped(name: str, groups: str, *words: str) -> Row:
    return changed(name, "objects:", f"groups: {groups}\nobjects:", "scene.yaml:8: groups", *words)


AREA = "type: scatter, of: ball, count: 5, corner: [0, 0, 0], edges: [[1, 0, 0], [0, 0, 1]]"
FILED = "type: instance, of: ball, placements: "

PLACEMENTS = [
    placing("instance of nothing", "type: instance", ".of: is missing"),
    placing("instance of a stranger", "type: instance, of: bal", ".of: unknown group or object 'bal'", "mean 'ball'?"),
    placing("instance of a number", "type: instance, of: 3", ".of: must be a name, got 3"),
    placing("instance of itself", "type: instance, name: a, of: a", ".of: places 'a' in itself: a -> a"),
    placing("medium without a material", "type: instance, of: ball, medium: fog", ".medium: "),
    placing("no placements", FILED + "[]", ".placements: must hold at least one transform"),
    placing("flat placement", FILED + "[[{scale: 0}]]", ".placements", "must not be zero"),
    placing("placements that are a number", FILED + "3", ".placements: "),
    placing("placements without a name", FILED + '""', ".placements: must not be empty"),
    placing("placements that are not there", FILED + "a.npy", ".placements: there is no file 'a.npy'"),
    placing("placements of unknown suffix", FILED + "a.txt", ".txt", files=(("a.txt", ""),)),
    placing("broken placements", FILED + "a.npy", "a.npy", files=(("a.npy", b"\x93NUMPY"),)),
    placing("empty placements", FILED + "a.npy", "a.npy", files=(("a.npy", b""),)),
    placing("placements of a wrong shape", FILED + "a.npy", "(n, 3, 4)", files=(("a.npy", npy(np.ones((4, 4)))),)),
    placing("placements of NaN", FILED + "a.npy", "placement 0", files=(("a.npy", npy(np.full((2, 3, 4), np.nan))),)),
    placing("flat placements", FILED + "a.npy", "placement 0", files=(("a.npy", npy(np.ones((2, 3, 4)))),)),
    placing("projective placements", FILED + "a.npy", "last row", files=(("a.npy", npy(np.ones((2, 4, 4)))),)),
    placing("placements of nothing", FILED + "a.csv", "holds no placements", files=(("a.csv", "x,y,z\n"),)),
    placing("placements without columns", FILED + "a.csv", "lacks the columns x, y, z", files=(("a.csv", ""),)),
    placing("unknown column", FILED + "a.csv", "mean 'scale'?", files=(("a.csv", "x,y,z,scal\n0,0,0,1\n"),)),
    placing("column twice", FILED + "a.csv", "'x' twice", files=(("a.csv", "x,y,z,x\n0,0,0,1\n"),)),
    placing("text in a column", FILED + "a.csv", "line 2: y must be a number", files=(("a.csv", "x,y,z\n0,b,0\n"),)),
    placing("short line", FILED + "a.csv", "line 3 has 2 values", files=(("a.csv", "x,y,z\n0,0,0\n0,0\n"),)),
    placing("no axis", FILED + "a.csv", "line 2: the axis", files=(("a.csv", "x,y,z,angle,axis_x\n0,0,0,9,0\n"),)),
    placing("binary csv", FILED + "a.csv", "a.csv", files=(("a.csv", b"\xff\x00\xff"),)),
    placing("scatter of none", AREA.replace("count: 5", "count: 0"), ".count: must be at least 1, got 0"),
    placing("scatter without an area", AREA.replace("[0, 0, 1]]", "[2, 0, 0]]"), ".edges: "),
    placing("scatter by wrong sizes", AREA + ", scale: [2, 1]", ".scale: must be the least factor, then the greatest"),
    placing("scatter by negative sizes", AREA + ", scale: [-1, 1]", ".scale[0]: must be greater than 0, got -1"),
    placing("scatter that falls over", AREA + ", tilt: 100", ".tilt: must be at most 90, got 100"),
    placing("scatter without room", AREA + ", spacing: 3", "there is no room: at a spacing of 3 m, 1 copies of 5"),
    grouped("group of nothing", "{tree: []}", ".tree: must hold at least one object"),
    grouped("group that is no list", "{tree: ball}", ".tree: must be a list, got 'ball'"),
    grouped("groups in a list", "[ball]", ": must be a mapping"),
    grouped("unknown kind in a group", "{tree: [{type: bush}]}", ".tree[0].type: unknown type of shape 'bush'"),
    grouped(
        "unknown material in a group",
        "{tree: [{type: sphere, center: [0, 0, 0], radius: 1, material: gray}]}",
        ".tree[0].material: unknown material 'gray'; did you mean 'grey'?",
    ),
    grouped("missing file in a group", "{tree: [{type: mesh, file: bush.ply}]}", ".tree[0].file: there is no file"),
    changed(
        "group of the name of an object",
        "objects:",
        "groups: {ball: [{type: sphere, center: [0, 0, 0], radius: 1}]}\nobjects:",
        "objects[0].name: 'ball' is already the name of a group",
    ),
    grouped(
        "groups in one another",
        "{a: [{type: instance, of: b}], b: [{type: instance, of: a}]}",
        ".a[0].of: places 'a' in itself: a -> b -> a",
    ),
]


def material(name: str, keys: str, *words: str, files: tuple[tuple[str, str | bytes], ...] = ()) -> Row:
    change = ("grey: {type: lambertian, albedo: 0.5}", f"grey: {{{keys}}}")
    words = ("scene.yaml:6: materials.grey", *words)
    return Row(name, words, change, files=files, command="render SCENE -o DIR/out.npy")


def bringing(name: str, content: str, *words: str) -> Row:
    return Row(
        name,
        ("scene.yaml:11: objects[2].file: ", *words),
        change=("rock.ply", "model.gltf"),
        command="render SCENE -o DIR/out.npy",
        files=(("model.gltf", content),),
    )


def gltf(more: str) -> str:
    """A triangle with a material; `more` follows its other keys."""
    data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"
    return (
        '{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": '
        '[{"attributes": {"POSITION": 0}, "material": 0}]}], "buffers": [{"byteLength": 36, "uri": '
        f'"data:application/octet-stream;base64,{data}"}}], "bufferViews": [{{"buffer": 0, "byteLength": 36}}], '
        f'"accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}], {more}}}'
    )


GLASSY = "type: dielectric, attenuation"
TEXTURED = '"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}], "textures": [{"source": 0}]'

COMPOSED = [
    material("base colour above 1", "type: principled, base_color: 1.1", ".base_color: must be at most 1, got 1.1"),
    material("metallic above 1", "type: principled, metallic: 2", ".metallic: must be at most 1, got 2"),
    material("negative roughness", "type: principled, roughness: -1", ".roughness: must be at least 0, got -1"),
    material("ior below 1", "type: principled, ior: 0.9", ".ior: must be at least 1, got 0.9"),
    material("specular above 1", "type: principled, specular: 2", ".specular: must be at most 1, got 2"),
    material("transmission in words", "type: principled, transmission: [1]", ".transmission: must be a number"),
    material("negative emission", "type: principled, emission: -1", ".emission: must be at least 0, got -1"),
    material("sides by number", "type: principled, two_sided: 2", ".two_sided: must be true or false, got 2"),
    material("misspelt key of principled", "type: principled, basecolor: 1", "did you mean 'base_color'?"),
    material("mixture of one", "type: mixture, materials: [lamp]", ".materials[1]: is missing"),
    material("mixture of three", "type: mixture, materials: [lamp, lamp, lamp]", ".materials: must hold at most 2"),
    material("mixture of nothing", "type: mixture", ".materials: is missing"),
    material("mixture above 1", "type: mixture, materials: [lamp, lamp], weight: 1.5", ".weight: must be at most 1"),
    material("mixture of the unknown", "type: mixture, materials: [lamp, lmp]", ".materials[1]: ", "mean 'lamp'?"),
    material("mixture of itself", "type: mixture, materials: [lamp, grey]", ".materials[1]: ", "grey -> grey"),
    material(
        "itself, by way of others",
        "type: mixture, materials: [lamp, {type: cutout, material: net}]}\n  net: {type: cutout, material: grey",
        ".materials[1].material: makes the material 'grey' a part of itself: grey -> net -> grey",
    ),
    material("wrong part", "type: cutout, material: {type: lambertian, albedo: 2}", ".material.albedo: must be at m"),
    material("unknown kind of part", "type: cutout, material: {type: lamp}", ".material.type: unknown type"),
    material("cutout of nothing", "type: cutout", ".material: is missing"),
    material("cutout of a number", "type: cutout, material: 3", ".material: must be a name, got 3"),
    material("opacity above 1", "type: cutout, material: lamp, opacity: 2", ".opacity: must be at most 1, got 2"),
    material("threshold above 1", "type: cutout, material: lamp, threshold: 2", ".threshold: must be at most 1"),
    material("unknown opacity", "type: cutout, material: lamp, opacity: leaf", ".opacity: unknown texture 'leaf'"),
    material(
        "picture of a part that is not there",
        "type: cutout, material: {type: lambertian, albedo: {type: image, file: a.png}}",
        ".material.albedo.file: there is no file 'a.png'",
    ),
    material(
        "picture of an opacity that is none",
        "type: cutout, material: lamp, opacity: {type: image, file: a.png, channel: a}",
        ".opacity.file: ",
        "a.png",
        files=(("a.png", "no picture"),),
    ),
    material("one side", "type: two_sided, front: lamp", ".back: is missing"),
    material("pane without an index", "type: thin_dielectric, ior: 0", ".ior: must be greater than 0, got 0"),
    material("pane that is too clear", "type: thin_dielectric, color: 2", ".color: must be at most 1, got 2"),
    material("negative absorption of glass", "type: dielectric, absorption: -1", ".absorption: must be at least 0"),
    material("negative outer absorption", "type: dielectric, outside_absorption: [1]", ".outside_absorption: must be"),
    material("attenuation to nothing", f"{GLASSY}_color: 0, attenuation_distance: 1", "must be greater than 0, got 0"),
    material("attenuation over nothing", f"{GLASSY}_color: 1, attenuation_distance: 0", "_distance: must be greater"),
    material("attenuation without a distance", f"{GLASSY}_color: 0.5", ".attenuation_distance: is missing"),
    material("attenuation without a colour", f"{GLASSY}_distance: 1", ".attenuation_color: is missing"),
    material(
        "absorption twice", f"{GLASSY}_color: 1, attenuation_distance: 1, absorption: 1", "goes not with attenuation_"
    ),
    bringing("glTF that is no JSON", "{", "model.gltf: holds no JSON that can be read"),
    bringing("glTF that is a list", "[]", "model.gltf: holds JSON that is no mapping"),
    bringing("glTF with materials that are no list", gltf('"materials": {"a": 1}'), "materials that are no list"),
    bringing("glTF without a buffer", gltf(TEXTURED).replace("data:app", "no such file "), "model.gltf: "),
    bringing("glTF without its picture", gltf(TEXTURED + ', "images": [{"uri": "a.png"}]'), "names 'a.png' as image 0"),
    bringing("glTF with a broken picture", gltf(TEXTURED + ', "images": [{"uri": "data:;base64,AAAA"}]'), "model.gltf"),
    bringing(
        "glTF with too much roughness",
        gltf('"materials": [{"pbrMetallicRoughness": {"roughnessFactor": 2}}]'),
        "model.gltf: has material 0, counted from 0, whose roughness must be at most 1, got 2",
    ),
]

# ---- Rough metal and glass

FACETS = [
    material("metal of nothing", "type: rough_conductor", "needs a metal, or eta and k, or an albedo"),
    material("unknown metal", "type: rough_conductor, metal: golld", ".metal: must be one of gold", "mean 'gold'?"),
    material("metal twice", "type: rough_conductor, metal: gold, albedo: 1", ".albedo: cannot go with metal"),
    material("metal and indices", "type: rough_conductor, metal: gold, eta: 1, k: 1", ".eta: cannot go with metal"),
    material("index without extinction", "type: rough_conductor, eta: 1", ".k: is missing; `eta` and `k` go together"),
    material("extinction without index", "type: rough_conductor, k: 1", ".eta: is missing; `eta` and `k` go together"),
    material("indices of two channels", "type: rough_conductor, eta: [1, 2], k: 1", ".eta: must be a colour of three"),
    material("negative index of metal", "type: rough_conductor, eta: -1, k: 1", ".eta: must be at least 0, got -1"),
    material("too bright a metal", "type: rough_conductor, albedo: 1.5", ".albedo: must be at most 1, got 1.5"),
    material("too rough a metal", "type: rough_conductor, metal: gold, roughness: 2", ".roughness: must be at most 1"),
    material("too smooth a glass", "type: rough_dielectric, roughness: -1", ".roughness: must be at least 0, got -1"),
    material("rough glass of no index", "type: rough_dielectric, ior: 0", ".ior: must be greater than 0, got 0"),
    material("rough glass in nothing", "type: rough_dielectric, outside_ior: 0", ".outside_ior: must be greater"),
    material("misspelt roughness", "type: rough_dielectric, roughnes: 1", "did you mean 'roughness'?"),
    material("roughness by no texture", "type: rough_dielectric, roughness: x", ".roughness: unknown texture 'x'"),
    material("negative priority", "type: dielectric, priority: -1", ".priority: must be at least 0, got -1"),
    material("half a priority", "type: rough_dielectric, priority: 0.5", ".priority: must be an integer, got 0.5"),
    material("priority of a mirror", "type: metal, priority: 1", "unknown key 'priority'"),
    material(
        "priority and an outside",
        "type: dielectric, priority: 1, outside_ior: 1.3",
        ".outside_ior: goes not with priority, by which what is outside is found: leave it out",
    ),
    material(
        "priority and what is absorbed outside",
        "type: dielectric, priority: 1, outside_absorption: 1",
        ".outside_absorption: goes not with priority",
    ),
    material(
        "tint of a rough glass",
        "type: rough_dielectric, absorption: 1",
        ".absorption: needs a priority, by which light knows what it is in",
    ),
    material(
        "half a tint of a rough glass",
        "type: rough_dielectric, priority: 1, attenuation_color: 0.5",
        ".attenuation_distance: is missing",
    ),
    material(
        "fillings that differ",
        "type: mixture, materials: [{type: dielectric, priority: 1}, {type: rough_dielectric, priority: 2}]",
        ": its materials fill one object with different things",
    ),
]


def textured(name: str, texture: str, *words: str, file: tuple[str, str | bytes] | None = None) -> Row:
    """The grey material with a texture as its albedo."""
    return Row(
        name,
        ("scene.yaml:6: materials.grey.albedo", *words),
        change=("albedo: 0.5", f"albedo: {texture}"),
        command="render SCENE -o DIR/out.npy",
        files=(("rock.ply", PLY),) if file is None else (file, ("rock.ply", PLY)),
    )


def pictured(name: str, suffix: str, data: str | bytes, *words: str, keys: str = "") -> Row:
    """As `textured`, with a picture file."""
    return textured(name, f"{{type: image, file: a{suffix}{keys}}}", *words, file=(f"a{suffix}", data))


def array_file(values: list[float], shape: tuple[int, ...] = (1, 2, 3)) -> bytes:
    return npy(np.resize(values, shape))


def png(width: int, height: int, *, mode: str = "RGB") -> bytes:
    import PIL.Image

    buffer = io.BytesIO()
    PIL.Image.new(mode, (width, height)).save(buffer, "PNG")
    return buffer.getvalue()


def exr(values: list[float], *names: str) -> bytes:
    import OpenEXR

    buffer = io.BytesIO()
    channels = {name: np.resize(np.array(values, np.float32), (2, 2)) for name in names}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(buffer)
    return buffer.getvalue()


# A picture of 60000 x 60000 pixels in 70 bytes, as its header says.
PNG_BOMB = b"\x89PNG\r\n\x1a\n" + b"".join(
    len(data).to_bytes(4, "big") + name + data + zlib.crc32(name + data).to_bytes(4, "big")
    for name, data in (
        (b"IHDR", (60000).to_bytes(4, "big") * 2 + bytes((8, 2, 0, 0, 0))),
        (b"IDAT", zlib.compress(b"")),
        (b"IEND", b""),
    )
)

NAMED = "textures:\n  squares: {type: checker}\nmaterials:"

TEXTURES = [
    textured("texture without a name", "squares", ": unknown texture 'squares'; there are no textures"),
    Row(
        "misspelt texture",
        ("scene.yaml:8: materials.grey.albedo: unknown texture 'sqares'; did you mean 'squares'?",),
        scene=SCENE.replace("materials:", NAMED).replace("albedo: 0.5", "albedo: sqares"),
    ),
    Row(
        "texture named like a number",
        ("scene.yaml:6: textures", "a texture's name must not begin as a number does"),
        scene=SCENE.replace("materials:", NAMED.replace("squares", "2nd")),
    ),
    Row(
        "unknown kind of texture",
        ("scene.yaml:6: textures.squares.type: unknown type of texture 'cheker'; did you mean 'checker'?",),
        scene=SCENE.replace("materials:", NAMED.replace("checker", "cheker")),
    ),
    textured(
        "inline texture of an unknown kind", "{type: clouds}", ".type: unknown type of texture 'clouds'; known types"
    ),
    textured("texture without a type", "{scale: 1}", ": needs a type, one of checker, image, noise"),
    textured("misspelt key of a texture", "{type: checker, evn: 1}", ".evn: unknown key 'evn'", "mean 'even'?"),
    textured("checker of size 0", "{type: checker, scale: 0}", ".scale: must be greater than 0, got 0"),
    textured(
        "checker in another space", "{type: checker, space: world}", ".space: must be one of solid, uv, got 'world'"
    ),
    textured("negative colour", "{type: checker, even: -1}", ".even: must be at least 0, got -1"),
    textured(
        "albedo beyond 1", "{type: checker, even: 1.5}", ": must be at most 1, and the texture takes the value 1.5"
    ),
    textured("noise of no octaves", "{type: noise, octaves: 0}", ".octaves: must be at least 1, got 0"),
    textured("noise of 17 octaves", "{type: noise, octaves: 17}", ".octaves: must be at most 16, got 17"),
    textured("unknown pattern", "{type: noise, pattern: marbel}", ".pattern: must be one of", "did you mean 'marble'?"),
    textured("picture without a file", "{type: image}", ".file: is missing"),
    textured("picture that is not there", "{type: image, file: a.png}", ".file: there is no file 'a.png'"),
    pictured("picture of unknown suffix", ".gif", "x", ".file: ", "unknown suffix '.gif' for an image; known: .png"),
    pictured("broken picture", ".png", "nonsense", ".file: a.png: broken, or no .png image"),
    pictured("empty picture", ".jpg", "", ".file: a.jpg: broken, or no .jpg image"),
    pictured("picture cut off", ".png", png(64, 64)[:60], ".file: a.png: broken, or no .png image"),
    pictured("decompression bomb", ".png", PNG_BOMB, ".file: a.png: is 60000 x 60000 pixels, and at most 268,435,456"),
    pictured("broken EXR", ".exr", b"\x76\x2f\x31\x01nonsense", ".file: a.exr: broken, or no .exr image"),
    pictured(
        "EXR of NaN", ".exr", exr([0.5, np.nan], "R", "G", "B"), "a pixel that is not finite (nan in row 0, column 1)"
    ),
    pictured("EXR of inf", ".exr", exr([np.inf], "Y"), "a pixel that is not finite (inf in row 0, column 0)"),
    pictured("EXR of other channels", ".exr", exr([0.5], "U", "V"), "has neither channels R, G, B nor Y, but U, V"),
    pictured("EXR beyond 1", ".exr", exr([0.5, 3.0], "Y"), ": must be at most 1, and the texture takes the value 3"),
    pictured("negative EXR", ".exr", exr([-0.5], "Y"), ": must be at least 0, and the texture takes the value -0.5"),
    pictured("NPY of NaN", ".npy", array_file([0.5, np.nan]), "a pixel that is not finite"),
    pictured("NPY of one axis", ".npy", array_file([0.5], (4,)), "must be of shape (height, width)", "is of (4,)"),
    pictured("NPY of five channels", ".npy", array_file([0.5], (2, 2, 5)), "is of (2, 2, 5)"),
    pictured("NPY without pixels", ".npy", array_file([0.5], (0, 4)), "has no pixels"),
    pictured("NPY cut off", ".npy", array_file([0.5])[:-4], ".file: a.npy: is a broken NumPy file, or cut off"),
    pictured(
        "NPY of strings",
        ".npy",
        b"\x93NUMPY\x01\x00v\x00{'descr': '<U1', 'fortran_order': False, 'shape': (1, 1), }\n",
        "a.npy",
    ),
    pictured("unknown channel", ".png", png(1, 1), ".channel: must be one of", "got 'alpha'", keys=", channel: alpha"),
    pictured("no transparency", ".png", png(1, 1), "has no channel a (transparency)", keys=", channel: a"),
    pictured(
        "unknown wrap", ".png", png(1, 1), "must be one of repeat, clamp, mirror, got 'tile'", keys=", wrap: tile"
    ),
    pictured(
        "three wraps", ".png", png(1, 1), ".wrap: must hold at most 2 values", keys=", wrap: [clamp, clamp, clamp]"
    ),
    pictured("scale of 0", ".png", png(1, 1), ".scale: must not be zero, got 0", keys=", scale: 0"),
    pictured(
        "offset of three", ".png", png(1, 1), ".offset: must be two numbers, for u and v", keys=", offset: [1, 2, 3]"
    ),
    pictured("unknown encoding", ".png", png(1, 1), ".encoding: must be one of", keys=", encoding: gamma"),
    pictured("negative factor", ".png", png(1, 1), ".factor: must be at least 0, got -1", keys=", factor: -1"),
    changed(
        "bump that is a number", "albedo: 0.5", "albedo: 0.5, bump: 3", "grey.bump: must be a texture's name or a tex"
    ),
    changed("height without a bump", "albedo: 0.5", "albedo: 0.5, bump_height: 1", "grey.bump_height: needs a bump"),
    changed(
        "height in seconds",
        "albedo: 0.5",
        "bump: {type: noise}, bump_height: 1 s",
        "grey.bump_height: must be a length",
    ),
    changed("scale without a map", "albedo: 0.5", "normal_scale: 1", "grey.normal_scale: needs a normal_map"),
    changed(
        "normals that there are not", "albedo: 0.5", "normal_map: stone", "grey.normal_map: unknown texture 'stone'"
    ),
    mesh(
        "texture coordinate of NaN",
        ".obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 nan\nf 1/1 2/1 3/1\n",
        "texture coordinate that is not",
    ),
]


def opening(name: str, keys: str, *words: str, file: tuple[str, str | bytes] | None = None) -> Row:
    return Row(
        name,
        (CAMERA, *words),
        change=("vfov: 40", f"vfov: 40, aperture: 9, {keys}"),
        command="validate SCENE" if file is None else "render SCENE -o DIR/out.npy",
        files=() if file is None else (file,),
    )


APERTURES = [
    opening("aperture of no shape", "aperture_shape: {blades: 5}", ".aperture_shape: needs a type, one of image, poly"),
    opening("aperture by a wrong name", "aperture_shape: hexagon", ".aperture_shape: unknown type of aperture"),
    opening("misspelt aperture", "aperture_shape: {type: polygn}", ".aperture_shape.type: ", "mean 'polygon'?"),
    opening("two blades", "aperture_shape: {type: polygon, blades: 2}", ".aperture_shape.blades: must be at least 3"),
    opening(
        "half a blade", "aperture_shape: {type: polygon, blades: 5.5}", ".aperture_shape.blades: must be an integer"
    ),
    opening("pinched blades", "aperture_shape: {type: polygon, curvature: -1}", ".curvature: must be at least 0, got"),
    opening("blades beyond round", "aperture_shape: {type: polygon, curvature: 2}", ".curvature: must be at most 1"),
    opening("blades of a disc", "aperture_shape: {type: round, blades: 5}", ".blades: unknown key 'blades' of round"),
    opening("flat aperture", "aperture_shape: {type: round, anamorphic: 0}", ".anamorphic: must be greater than 0"),
    opening("mask without a file", "aperture_shape: {type: image}", ".aperture_shape.file: is missing"),
    opening(
        "mask that is not there",
        "aperture_shape: {type: image, file: mask.png}",
        ".aperture_shape.file: there is no file 'mask.png'",
    ),
    *(
        opening(
            name, "aperture_shape: {type: image, file: a.npy}", ".aperture_shape.file: ", words, file=("a.npy", data)
        )
        for name, data, words in (
            ("black mask", array_file([0.0]), "a.npy is black all over, so it lets no light through"),
            ("negative mask", array_file([1.0, -1.0]), "a.npy holds a negative transmission"),
            ("broken mask", "nonsense", "a.npy: is no NumPy file"),
        )
    ),
    opening("rim without a place", "vignetting: {diameter: 9}", ".vignetting.distance: is missing"),
    opening("rim of no size", "vignetting: {diameter: 0, distance: 9}", ".vignetting.diameter: must be greater than 0"),
    opening("rim in the lens", "vignetting: {diameter: 9, distance: 0}", ".vignetting.distance: must be greater than"),
    opening("rim in seconds", "vignetting: {diameter: 9, distance: 1 s}", ".vignetting.distance: ", "unit of time"),
    camera(
        "aperture of a pinhole", "type: pinhole, aperture_shape: {type: round}", f"{CAMERA}.aperture_shape: unknown"
    ),
]

FILM = "scene.yaml:2: film"


def developed(name: str, keys: str, *words: str) -> Row:
    return changed(name, "filter: box", f"filter: box, {keys}", *words)


def recorded(name: str, keys: str, *words: str, exposure: str = "exposure: auto") -> Row:
    return changed(name, "vfov: 40", f"vfov: 40, {exposure}, sensor: {{format: full_frame, {keys}}}", *words)


DEVELOPMENT = [
    changed(
        "an idle mosaic",
        "vfov: 40",
        "vfov: 40, sensor: {format: full_frame, bayer: rggb}",
        f"{CAMERA}.sensor.bayer: bayer does nothing without noise: true",
    ),
    changed(
        "a speed that the sensor has not",
        "vfov: 40",
        "shutter: 1, focal_length: 50, f_number: 2, iso: 50, sensor: {format: full_frame, noise: true}",
        f"{CAMERA}.iso: 50 is slower than the simulated sensor can be",
        "base_iso, 100",
    ),
    changed(
        "a spot for a mean",
        "vfov: 40",
        "exposure: {metering: mean, at: [0.5, 0.5]}",
        f"{CAMERA}.exposure.at: at belongs to metering: spot, and this is mean",
    ),
    developed(
        "misspelt white balance", "white_balance: daylight", f"{FILM}.white_balance: must be auto, a colour temp"
    ),
    developed("white balance in kilometres", "white_balance: 3200 km", f"{FILM}.white_balance: ", "unit of length"),
    developed("white balance of embers", "white_balance: 1500 K", f"{FILM}.white_balance: must be at least 2000, got"),
    developed(
        "white balance beyond the sky", "white_balance: 1e5", f"{FILM}.white_balance: must be at most 25000, got"
    ),
    developed(
        "two gains", "white_balance: [1, 2]", f"{FILM}.white_balance: must be gains of three numbers, got a list"
    ),
    developed("gain of nothing", "white_balance: [1, 0, 1]", f"{FILM}.white_balance[1]: must be greater than 0, got 0"),
    developed("gain of infinity", "white_balance: [1, .inf, 1]", f"{FILM}.white_balance[1]: must be finite"),
    developed("white balance of nothing", "white_balance: {}", f"{FILM}.white_balance: ", "got a mapping"),
    developed(
        "misspelt tone curve", "tone_curve: flimic", f"{FILM}.tone_curve: must be one of", "did you mean 'filmic'?"
    ),
    developed("tone curve of a number", "tone_curve: 2", f"{FILM}.tone_curve: must be a mapping (type, white), got 2"),
    developed(
        "white of a clipped curve", "tone_curve: {white: 2}", f"{FILM}.tone_curve.white: only the tone curve film"
    ),
    developed("grey white", "tone_curve: {type: filmic, white: 0.5}", f"{FILM}.tone_curve.white: must be at least 1"),
    recorded("noise that is not yes or no", "noise: 0.5", f"{CAMERA}.sensor.noise: must be true or false, got 0.5"),
    recorded("noise of no exposure", "noise: true", f"{CAMERA}.sensor.noise: ", "give camera.iso", exposure="time: 0"),
    recorded("well of less than an electron", "full_well: 0", f"{CAMERA}.sensor.full_well: must be at least 1, got 0"),
    recorded("negative read noise", "read_noise: -1", f"{CAMERA}.sensor.read_noise: must be at least 0, got -1"),
    recorded("half a bit", "bit_depth: 7.5", f"{CAMERA}.sensor.bit_depth: must be an integer, got 7.5"),
    recorded("17 bits", "bit_depth: 17", f"{CAMERA}.sensor.bit_depth: must be at most 16, got 17"),
    recorded("black above white", "bit_depth: 8, black_level: 255", f"{CAMERA}.sensor.black_level: ", "8 bits, 255"),
    recorded("speed of nothing", "base_iso: 0", f"{CAMERA}.sensor.base_iso: must be at least 1, got 0"),
    recorded("misspelt mosaic", "bayer: rgbg", f"{CAMERA}.sensor.bayer: must be one of rggb, bggr, grbg, gbrg, got"),
    recorded("misspelt noise", "nois: true", f"{CAMERA}.sensor.nois: unknown key 'nois' of sensor; ", "mean 'noise'?"),
    recorded("negative seed of noise", "seed: -1", f"{CAMERA}.sensor.seed: must be at least 0, got -1"),
    Row(
        "spot outside of the crop",
        ("the metering spot lies outside of the crop",),
        change=("  - {type: mesh, file: rock.ply}\n", ""),
        command="render SCENE -o DIR/out.npy --crop 0,0,2,2 -D camera.exposure.metering=spot",
    ),
]


def focused(name: str, keys: str, *words: str, change: tuple[str, str] | None = None) -> Row:
    scene = SCENE if change is None else SCENE.replace(*change)
    return Row(name, words, ("vfov: 40", f"vfov: 40, {keys}"), scene, "render SCENE -o DIR/out.npy")


def circled(name: str, circle: str, *words: str) -> Row:
    return Row(name, words, command=f"explain SCENE --circle {circle}")


FOCUS = [
    focused("focus on nobody", "focus_on: bal", f"{CAMERA}.focus_on: unknown object 'bal'; did you mean 'ball'?"),
    focused("focus on a number", "focus_on: 3", f"{CAMERA}.focus_on: "),
    focused(
        "focus where there are no names",
        "focus_on: ball",
        f"{CAMERA}.focus_on: unknown object 'ball'; there are no named objects",
        change=("name: ball, ", ""),
    ),
    focused(
        "focus behind the camera",
        "focus_on: ball",
        f"{CAMERA}.focus_on: the middle of 'ball', [0, 0, 9], lies behind the camera",
        change=("center: [0, 0, 0]", "center: [0, 0, 9]"),
    ),
    focused(
        "focus within the focal length",
        "focal_length: 5 m, focus_on: ball",
        f"{CAMERA}.focus_on: the plane of focus, 4 m away, must be farther than the focal length",
    ),
    focused(
        "focus on a surface within the focal length",
        "focal_length: 3.5 m, focus_at: [0.5, 0.5]",
        f"{CAMERA}.focus_at: the plane of focus, 3 m away, must be farther than the focal length",
    ),
    focused(
        "focus on nothing with a defocus angle",
        "defocus_angle: 1, focus_at: [0, 0]",
        f"{CAMERA}.focus_at: ",
        "defocus_angle needs a finite focus_distance",
    ),
    focused("focus outside the frame", "focus_at: [0.5, 1.5]", f"{CAMERA}.focus_at[1]: must be at most 1, got 1.5"),
    focused("focus at one number", "focus_at: [0.5]", f"{CAMERA}.focus_at", "at least 2 values"),
    focused("focus at a word", "focus_at: middle", f"{CAMERA}.focus_at: "),
    focused("focus twice", "focus_on: ball, focus_distance: 2", f"{CAMERA}.focus_on: ", "give one of them"),
    circled("circle of nothing", "0mm", "'--circle': must be a length on the film or in pixels", "got '0mm'"),
    circled("circle in seconds", "3s", "'--circle': must be a length on the film or in pixels, 0.03 mm or 2 px"),
    circled("circle on a film without a size", "0.03mm", "'--circle': a length needs a film that has a size"),
]


def optics(name: str, keys: str, *words: str, kind: str = "thin_lens") -> Row:
    """A camera at 4 m from what it looks at, with these keys in place of its field of view."""
    return Row(name, words, ("type: thin_lens", f"type: {kind}"), SCENE.replace("vfov: 40", keys))


OPTICS = [
    optics("two fields of view", "vfov: 40, hfov: 50", f"{CAMERA}.hfov: vfov and hfov both set the field of view"),
    optics("two more of them", "hfov: 40, dfov: 50", f"{CAMERA}.dfov: hfov and dfov both set", kind="pinhole"),
    optics("two focal lengths", "focal_length: 50, equivalent_focal_length: 75", ".equivalent_focal_length: ", "both"),
    optics(
        "a field of view besides the one of the optics",
        "vfov: 40, sensor: full_frame, focal_length: 50",
        f"{CAMERA}.vfov: vfov is set twice, by itself and by sensor and focal_length",
    ),
    optics(
        "the same on a sensor of any size",
        "focal_length: 50, dfov: 40, sensor: {width: 36, height: 24}",
        f"{CAMERA}.dfov: dfov is set twice, by itself and by sensor and focal_length",
        kind="pinhole",
    ),
    optics(
        "an equivalent of the field of view",
        "hfov: 40, equivalent_focal_length: 50",
        f"{CAMERA}.hfov: hfov and equivalent_focal_length both set the field of view",
    ),
    optics("half a circle", "hfov: 180", f"{CAMERA}.hfov: must be less than 180, got 180"),
    optics("no diagonal", "dfov: 0 deg", f"{CAMERA}.dfov: must be greater than 0, got '0 deg'"),
    optics("no focal length", "focal_length: 0", f"{CAMERA}.focal_length: must be greater than 0, got 0"),
    optics("a lens that spreads", "focal_length: -50", f"{CAMERA}.focal_length: must be greater than 0, got -50"),
    optics("an infinite lens", "focal_length: .inf", f"{CAMERA}.focal_length: must be finite"),
    optics("a focal length in degrees", "focal_length: 50 deg", f"{CAMERA}.focal_length: ", "'deg' is a unit of angle"),
    optics("a misspelt focal length", "focal_lenght: 50", f"{CAMERA}.focal_lenght: ", "did you mean 'focal_length'?"),
    optics("no equivalent", "equivalent_focal_length: 0", f"{CAMERA}.equivalent_focal_length: must be greater than 0"),
    optics("an unknown sensor", "sensor: full_fram", f"{CAMERA}.sensor: unknown sensor", "did you mean 'full_frame'?"),
    optics("a sensor of 35 mm", "sensor: 35", f"{CAMERA}.sensor: unknown sensor 35; ", "full_frame"),
    optics("a sensor of two numbers", "sensor: [36, 24]", f"{CAMERA}.sensor: unknown sensor"),
    optics("a format that is none", "sensor: {format: dx}", f"{CAMERA}.sensor.format: unknown sensor 'dx'"),
    optics("a sensor of no height", "sensor: {width: 36}", f"{CAMERA}.sensor.width: height is missing: a sensor's siz"),
    optics("a sensor of no width", "sensor: {height: 24}", f"{CAMERA}.sensor.height: width is missing"),
    optics("a sensor of width 0", "sensor: {width: 0, height: 24}", f"{CAMERA}.sensor.width: must be greater than 0"),
    optics("a sensor in seconds", "sensor: {width: 36 s, height: 24}", f"{CAMERA}.sensor.width: ", "'s' is a unit of"),
    optics(
        "a sensor of two sizes",
        "sensor: {format: aps_c, width: 36, height: 24}",
        f"{CAMERA}.sensor.format: format and width and height both set the size",
    ),
    optics("a fit without a sensor", "vfov: 40, sensor_fit: crop", f"{CAMERA}.sensor_fit: ", "there is none: give sen"),
    optics(
        "a misspelt fit", "sensor: aps_c, sensor_fit: overscam", f"{CAMERA}.sensor_fit: ", "did you mean 'overscan'?"
    ),
    optics(
        "a lens within itself", "focal_length: 5 m", f"{CAMERA}.focal_length: the plane of focus, 4 m away, must be"
    ),
    optics(
        "a subject within the focal length",
        "focal_length: 50, focus_distance: 4 cm",
        f"{CAMERA}.focus_distance: the plane of focus, 0.04 m away, must be farther than the focal length, 50 mm",
    ),
    optics(
        "a subject at the focal length",
        "focal_length: 50, focus_distance: 5 cm",
        f"{CAMERA}.focus_distance: ",
        "nearer there is no image",
    ),
    optics(
        "a cone from infinity",
        "vfov: 40, focus_distance: .inf, defocus_angle: 1",
        f"{CAMERA}: defocus_angle needs a finite focus_distance",
    ),
    optics("an f-number of an angle", "vfov: 40, f_number: 2", f"{CAMERA}.f_number: f_number needs a focal length"),
    optics("f/0", "focal_length: 50, f_number: 0", f"{CAMERA}.f_number: must be greater than 0, got 0"),
    optics("a negative f-number", "focal_length: 50, f_number: -2", f"{CAMERA}.f_number: must be greater than 0"),
    optics(
        "an f-number in words", "focal_length: 50, f_number: f/2", f"{CAMERA}.f_number: must be a number (", "got 'f/2'"
    ),
    optics(
        "an aperture and an f-number",
        "focal_length: 50, aperture: 25, f_number: 2",
        f"{CAMERA}.f_number: aperture and f_number both set the size of the lens",
    ),
    optics("an aperture below nothing", "vfov: 40, aperture: -1", f"{CAMERA}.aperture: must be at least 0, got -1"),
    optics("a pupil of a cat", "focal_length: 50, pupil: slit", f"{CAMERA}.pupil: must be one of aplanatic, flat, got"),
    optics(
        "a hole of two sizes",
        "focal_length: 50, diameter: 2, f_number: 25",
        f"{CAMERA}.f_number: diameter and f_number both set the size of the hole",
        kind="pinhole",
    ),
    optics("a hole before an angle", "vfov: 40, diameter: 2", f"{CAMERA}.diameter: ", "give focal_len", kind="pinhole"),
    optics(
        "a hole of less than nothing", "focal_length: 50, diameter: -2", ".diameter: must be at least 0", kind="pinhole"
    ),
    optics(
        "a hole in focus", "focal_length: 50, focus_distance: 2", ".focus_distance: unknown key 'foc", kind="pinhole"
    ),
    optics("a hole in a lens", "focal_length: 50, diameter: 2", f"{CAMERA}.diameter: unknown key 'diameter' of thin_l"),
    optics("a bare sensor's view", "vfov: 40", f"{CAMERA}.vfov: unknown key 'vfov' of none", kind="none"),
    optics("a bare sensor's aperture", "f_number: 2", f"{CAMERA}.f_number: unknown key 'f_number'", kind="none"),
    optics("a bare sensor of unknown size", "sensor: 36x24", f"{CAMERA}.sensor: unknown sensor '36x24'", kind="none"),
    optics("a bare sensor in no time", "iso: 100", f"{CAMERA}.iso: iso needs a shutter that is open", kind="none"),
]

LIT = "focal_length: 50, f_number: 2, shutter: 1/125 s"

EXPOSURES = [
    optics("a speed of nothing", f"{LIT}, iso: 0", f"{CAMERA}.iso: must be at least 0.001, got 0"),
    optics("a speed without limit", f"{LIT}, iso: .inf", f"{CAMERA}.iso: must be finite"),
    optics("a speed in seconds", f"{LIT}, iso: 1/100 s", f"{CAMERA}.iso: must be a plain number without a unit"),
    optics("a speed of an angle", "vfov: 40, shutter: 1, iso: 100", f"{CAMERA}.iso: iso needs the size of the optics"),
    optics("a speed without time", "focal_length: 50, f_number: 2, iso: 100", f"{CAMERA}.iso: iso needs a shutter"),
    optics(
        "a speed in no time", f"{LIT}, iso: 100".replace("1/125", "0"), f"{CAMERA}.iso: iso needs a shutter that is ope"
    ),
    optics(
        "a speed without light",
        f"{LIT}, iso: 100".replace("f_number: 2", "f_number: .inf"),
        f"{CAMERA}.iso: iso needs an aperture that lets light in: give a finite f_number, or aperture or defocus_angle",
    ),
    optics(
        "a speed of a point",
        "focal_length: 50, shutter: 1/125 s, iso: 100, diameter: 0",
        f"{CAMERA}.iso: iso needs an aperture that lets light in: give diameter, or a finite f_number",
        kind="pinhole",
    ),
    optics("two exposures", f"{LIT}, iso: 100, exposure: auto", f"{CAMERA}.exposure: exposure and iso both set"),
    optics("an exposure by number", f"{LIT}, exposure: 2", f"{CAMERA}.exposure: must be auto, or a mapping", "key iso"),
    optics("a misspelt auto", f"{LIT}, exposure: atuo", f"{CAMERA}.exposure: must be auto, or a mapping"),
    optics("a misspelt meter", f"{LIT}, exposure: {{metering: spto}}", f"{CAMERA}.exposure.metering: ", "mean 'spot'?"),
    optics("a meter of no size", f"{LIT}, exposure: {{size: 0}}", f"{CAMERA}.exposure.size: must be greater than 0"),
    optics(
        "a meter beside the frame",
        f"{LIT}, exposure: {{metering: spot, at: [0.5, 1.5]}}",
        f"{CAMERA}.exposure.at[1]: must be at most 1, got 1.5",
    ),
    optics(
        "compensation of nothing",
        f"{LIT}, exposure_compensation: 1",
        f"{CAMERA}.exposure_compensation: exposure_compensation needs iso or exposure: auto",
    ),
    optics(
        "compensation without end",
        f"{LIT}, iso: 100, exposure_compensation: .inf",
        f"{CAMERA}.exposure_compensation: must be finite",
    ),
]

# ---- Lenses of glass

GLASS = """\
name: singlet
surfaces:
  - {type: spherical, radius: 50, thickness: 5, material: N-BK7, aperture: 20}
  - {type: spherical, radius: -50, aperture: 20}
"""


def glass(name: str, keys: str, *words: str, lens: str | bytes = GLASS, command: str = "validate SCENE") -> Row:
    """A camera of these keys with a lens of glass."""
    camera = f"camera: {{type: lens, lens: glass.yaml, look_from: [0, 0, 4], look_at: [0, 0, 0]{keys}}}"
    start = SCENE.index("camera:")
    scene = SCENE[:start] + camera + SCENE[SCENE.index("\n", start) :]
    return Row(name, words, scene=scene, files=(("glass.yaml", lens),), command=command)


def prescription(name: str, old: str, new: str, *words: str) -> Row:
    assert old in GLASS
    return glass(name, "", "glass.yaml:", *words, lens=GLASS.replace(old, new, 1))


GLASSES = [
    glass("faster than the lens", ", f_number: 1", f"{CAMERA}.f_number: the lens opens to f/"),
    glass("an f-number of nothing", ", f_number: 0", f"{CAMERA}.f_number: must be greater than 0, got 0"),
    glass("too near for the lens", ", focus_distance: 3 cm", f"{CAMERA}.focus_distance: ", "nearest"),
    glass("focus of no kind", ", focus: sharp", f"{CAMERA}.focus: "),
    glass("flare by how much", ", flare: 2", f"{CAMERA}.flare: "),
    glass("a focal length besides the lens's", ", focal_length: 50", f"{CAMERA}.focal_length: unknown key"),
    glass("two focuses of a lens", ", focus_distance: 2, focus_on: ball", f"{CAMERA}.focus_on: focus_distance and"),
    glass("a lens of bytes", "", "glass.yaml", lens=b"\x89PNG\r\n\x1a\n\0"),
    glass("an empty lens", "", "glass.yaml: is empty", lens=""),
    prescription("a lens of no radius", "radius: 50", "radius: 0", "surfaces[0].radius: "),
    prescription("a lens of unknown glass", "N-BK7", "N-BK8", "surfaces[0].material: unknown", "N-BK7"),
    prescription(
        "a lens of no such surface", "type: spherical", "type: sphere", "surfaces[0].type: unknown type", "asphere"
    ),
    prescription(
        "a lens wider than its sphere", "aperture: 20", "aperture: 200", "surfaces[0].aperture: must be at most"
    ),
    prescription("a lens with a gap", "thickness: 5, ", "", "surfaces[0].thickness: is missing"),
    prescription(
        "a lens that ends in glass", "radius: -50, ", "radius: -50, material: 1.5, ", "surfaces[1].material: "
    ),
    prescription("a lens of two kinds", "name: singlet", "nmae: singlet", "unknown key 'nmae'"),
]

ROWS = [
    *GLASSES,
    *DEVELOPMENT,
    *TEXTURES,
    *FACETS,
    *COMPOSED,
    *PLACEMENTS,
    *MEDIA,
    *PROJECTIONS,
    *MOTION,
    *LIGHTS,
    *FILES,
    *SYNTAX,
    *KEYS,
    *VALUES,
    *MESHES,
    *LIMITS,
    *STRICT,
    *OVERRIDES,
    *RENDER,
    *USAGE,
    *APERTURES,
    *FOCUS,
    *OPTICS,
    *EXPOSURES,
]


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
        # What is not there by then is not waited for here.
        monkeypatch.setattr(atomic_write, "_RETRY_SECONDS", ())
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
