"""The package as a library: scenes in code, arrays, bars, and the pages that show how."""

import ast
import inspect
import io
import json
import keyword
import pkgutil
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import yaml

import raytracer as rt
from docs.make_scenes import snippet
from raytracer.film.image import Image
from raytracer.scene import python_api
from raytracer.scene.kind_unions import VALIDATION_CONTEXT
from raytracer.scene.load import build
from raytracer.scene.spec import SceneSpec
from raytracer.util.progress import Bar
from tests.repository import ROOT, script

CAMERA = rt.camera.pinhole(look_from=[0, 0, 4], vfov=40)
FILM = rt.Film(width=4, height=3)
SCENE = rt.Scene(camera=CAMERA, film=FILM)
BALL = rt.object.sphere(center=[0, 0, 0], radius=1)

# ---- Words


def kinds():
    return [(word, name, spec) for word, family in python_api.FAMILIES.items() for name, spec in family.specs().items()]


def mappings(value, name):
    """The mappings of this type in a tree."""
    if isinstance(value, dict):
        if value.get("type") == name:
            yield value
        value = list(value.values())
    for item in value if isinstance(value, list) else ():
        yield from mappings(item, name)


@pytest.mark.parametrize(("word", "name", "spec"), kinds(), ids=lambda value: value if isinstance(value, str) else "")
def test_every_kind_is_a_function_that_takes_what_its_mapping_holds(word, name, spec):
    # What the docstring of the kind's module shows.
    piece = yaml.safe_load(snippet(sys.modules[spec.__module__].__doc__))
    found = list(mappings(piece, name)) or [{"type": bare} for bare in piece.get("film", {}).values() if bare == name]
    assert found
    make = getattr(getattr(rt, word), name)
    for mapping in found:
        values = {key: value for key, value in mapping.items() if key != "type"}
        made = make(**values)
        assert type(made) is spec
        assert made == spec.model_validate(mapping, context=VALIDATION_CONTEXT)
        assert made.model_fields_set >= values.keys()
    assert set(inspect.signature(make).parameters) == set(spec.model_fields) - {"type"}
    assert inspect.getdoc(spec) in (inspect.getdoc(make) or "")
    assert not any(map(keyword.iskeyword, (name, *spec.model_fields)))


def test_the_package_has_all_words_and_nothing_that_is_not_there():
    words = {*python_api.FAMILIES, *python_api.parts()}
    assert words < set(rt.__all__)
    for name in rt.__all__:
        assert getattr(rt, name) is not None
    assert set(dir(rt)) >= set(rt.__all__)
    assert sorted(dir(rt.filter)) == ["box", "gaussian", "mitchell"]


def test_no_part_of_the_package_takes_the_place_of_a_name_when_it_is_imported():
    parts = {info.name for info in pkgutil.iter_modules(rt.__path__)}
    # The one that is a name itself.
    assert parts & set(rt.__all__) == {"lightfield"}
    assert isinstance(rt.lightfield, ModuleType)
    inner = {info.name for info in pkgutil.iter_modules(rt.lightfield.__path__)}
    assert not inner & set(rt.lightfield.__all__)


# Where a sentence begins with a colon, the name of what is called comes before.
MISTAKES = {
    "rt.camera.thin_lense()": ": unknown type of camera 'thin_lense'; did you mean 'thin_lens'?",
    "rt.camera.pinhole(vfv=3)": ": vfv: unknown key 'vfv' of pinhole; did you mean 'vfov'?",
    "rt.camera.pinhole(vfov='400 deg')": ": vfov: must be less than 180, got '400 deg'",
    "rt.camera.thin_lens(aperture_shape=TWO)": ": aperture_shape.blades: must be at least 3, got 1",
    "rt.object.sphere(center=[0, 0, 0])": ": radius: is missing",
    "rt.object.sphere(center=np.zeros(2), radius=1)": ": center: must be a point of three numbers, got a list of 2",
    "rt.object.sphere(center=[0, 0, 0], radius=1, material=BALL)": ": material: must be a material, got a sphere",
    "rt.Film(width=0, height=1)": ": width: must be at least 1, got 0",
    "rt.Scene(camera=BALL, film=FILM)": "camera: must be a camera, got a sphere",
    "rt.Scene(camera=CAMERA, flm=FILM)": "flm: unknown key 'flm' of scene; did you mean 'film'?",
    "rt.Scene(camera=CAMERA, film=FILM, objects=[CENTER])": "objects[0].radius: is missing",
    "rt.Scene(camera=CAMERA, film=FILM, **REDS)": "objects[1].material: unknown material 'red'; did you mean 'rad'?",
    "rt.render(SCENE, spp=0)": "spp must be an integer from 1 to 2147483647, got 0",
    "rt.render(SCENE, spp=1.5)": "spp must be an integer from 1 to 2147483647, got 1.5",
    "rt.render(SCENE, spp=True)": "spp must be an integer from 1 to 2147483647, got True",
    "rt.render(SCENE, seed=-1)": "seed must be an integer from 0 to 4294967295, got -1",
    "rt.render(SCENE, threads=0)": "threads must be an integer from 1 to 1024, got 0",
}
CENTER = {"type": "sphere", "center": [0, 0, 0]}
TWO = {"type": "polygon", "blades": 1}
REDS = {"materials": {"rad": {"type": "metal"}}, "objects": [BALL, {**CENTER, "radius": 1, "material": "red"}]}


@pytest.mark.parametrize(("made", "sentence"), MISTAKES.items())
def test_mistakes_are_told_in_the_words_of_files(made, sentence):
    with pytest.raises(rt.InputError) as caught:
        eval(made)
    assert str(caught.value) == (made.partition("(")[0] if sentence.startswith(":") else "") + sentence


def test_a_missing_file_is_told_when_the_scene_is_made():
    with pytest.raises(rt.InputError, match=r"^objects\[0\]\.file: there is no file 'nowhere\.obj' in /"):
        rt.Scene(camera=CAMERA, film=FILM, objects=[rt.object.mesh(file=Path("nowhere.obj"))])


def test_a_scene_in_code_is_the_scene_of_the_file():
    text = """\
    camera: {type: thin_lens, look_from: [1, 2, 3], vfov: 0.5 rad, aperture: 3 mm,
             aperture_shape: {type: polygon, blades: 5}, shutter: {duration: 1/125 s}, motion: {velocity: [1, 0, 0]}}
    film: {width: 4, height: 3, filter: {type: gaussian}, tone_curve: {type: filmic, white: 8}}
    textures: {squares: {type: checker, even: 0.2, odd: [0, 1, 0]}}
    materials: {floor: {type: lambertian, albedo: squares}}
    media: {fog: {type: homogeneous, scattering: 0.1}}
    medium: fog
    groups: {pair: [{type: sphere, center: [0, 0, 0], radius: 1, material: {type: metal}}]}
    objects: [{type: instance, of: pair, transform: {matrix: [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}}]
    lights: [{type: point, position: [0, 5, 0], intensity: [10, 10, 10]}]
    """
    moved = np.eye(4)
    moved[0, 3] = 2.0
    made = rt.Scene(
        camera=rt.camera.thin_lens(
            look_from=np.array([1, 2, 3], np.float32),
            vfov="0.5 rad",
            aperture="3 mm",
            aperture_shape=rt.aperture.polygon(blades=np.int64(5)),
            shutter=rt.Shutter(duration="1/125 s"),
            motion=rt.Motion(velocity=(1, 0, 0)),
        ),
        film=rt.Film(width=4, height=3, filter=rt.filter.gaussian(), tone_curve=rt.ToneCurve(type="filmic", white=8)),
        textures={"squares": rt.texture.checker(even=0.2, odd=[0, 1, 0])},
        materials={"floor": rt.material.lambertian(albedo="squares")},
        media={"fog": rt.medium.homogeneous(scattering=0.1)},
        medium="fog",
        groups={"pair": [rt.object.sphere(center=[0, 0, 0], radius=1, material=rt.material.metal())]},
        objects=[rt.object.instance(of="pair", transform=moved)],
        lights=[rt.light.point(position=[0, 5, 0], intensity=[10] * 3)],
    )
    assert made == build(text, "a.yaml")
    assert isinstance(made, SceneSpec)


def test_a_scene_file_stands_for_its_scene(tmp_path, monkeypatch):
    asked = {}

    def prepare(scene, options, **settings):
        asked.update(scene=scene, aovs=options.aovs)

    scene = rt.Scene(camera=CAMERA, film=FILM, objects=[BALL], environment=rt.environment.gradient())
    scene.save(tmp_path / "scene.yaml")
    monkeypatch.setattr("raytracer.rendering.render.prepare_scene", prepare)
    rendered = SimpleNamespace(failure=None, image="the image")
    monkeypatch.setattr("raytracer.rendering.render.render_prepared", lambda prepared, **settings: rendered)
    for given in (tmp_path / "scene.yaml", str(tmp_path / "scene.yaml"), scene):
        assert rt.render(given, aovs="depth") == "the image"
        assert asked["scene"] == scene
        assert asked["aovs"] == ("depth",)
    assert rt.explain(tmp_path / "scene.yaml").camera == rt.explain(scene).camera
    with pytest.raises(rt.InputError, match=r"nosuch\.yaml: no such file"):
        rt.render("nosuch.yaml")


def test_names_of_files_stay_where_the_scene_was_made(tmp_path, monkeypatch):
    (tmp_path / "sky.png").touch()
    monkeypatch.chdir(tmp_path)
    scene = rt.Scene(camera=CAMERA, film=FILM, environment=rt.environment.image(file="sky.png"))
    monkeypatch.chdir(tmp_path.parent)
    assert scene.replace({"film.width": 2}).base == tmp_path


def test_old_names_are_accepted():
    assert rt.Stock is rt.Cache
    lit = rt.environment.constant(radiance=1)
    cache, scene = rt.Cache(), rt.Scene(camera=CAMERA, film=FILM, objects=[BALL], environment=lit)
    first, second = rt.render(scene, spp=1, cache=cache), rt.render(scene, spp=1, stock=cache)
    assert np.array_equal(first.radiance, second.radiance)
    assert cache.counts.worlds_packed == 1
    sweep = rt.sweep(scene, {"render.seed": [1, 2]}, spp=1, stock=cache)
    assert (sweep.taken, sweep.kept) == (sweep.results, sweep.reused) == (sweep.results, 0)
    assert cache.counts.worlds_packed == 1


# ---- The stub


def test_the_stub_of_the_words_is_up_to_date():
    made = script("docs/make_python_api.py")
    assert made.OUTPUT.read_text(encoding="utf-8") == made.stub(), "run `make docs`"


def test_the_stub_knows_every_kind_and_every_key():
    tree = ast.parse((ROOT / "raytracer" / "scene" / "python_api.pyi").read_text(encoding="utf-8"))
    types = {
        node.target.id: ast.unparse(node.annotation)
        for node in tree.body
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
    classes = {node.name: node.body for node in tree.body if isinstance(node, ast.ClassDef)}
    for word, name, spec in kinds():
        (function,) = (node for node in classes[types[word]] if isinstance(node, ast.FunctionDef) and node.name == name)
        assert {argument.arg for argument in function.args.kwonlyargs} == set(spec.model_fields) - {"type"}
        assert ast.get_docstring(function)


@pytest.mark.slow
def test_type_checkers_know_the_words(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        """\
import numpy as np
import raytracer as rt

camera = rt.camera.thin_lens(look_from=(1, 2, 3), look_at=np.zeros(3), vfov="20 deg", shutter=rt.Shutter(duration=1))
ball = rt.object.sphere(center=[0, 0, 0], radius=1, material=rt.material.lambertian(albedo=rt.texture.noise()))
scene: rt.Scene = rt.Scene(camera=camera, film=rt.Film(width=3, height=2, filter="box"), objects=[ball, {"type": "x"}])
image: rt.Image = rt.render(scene.replace({"film.width": 4}), spp=4, progress=True)
np.asarray(image)
rt.camera.thin_lens(vfv=3)
rt.object.sphere(center=[0, 0, 0])
rt.material.metl()
rt.Film(width="a", height=3)
"""
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), str(program)],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    lines = [int(line) for line in re.findall(r"program\.py:(\d+): error", done.stdout)]
    assert lines == [9, 10, 11, 12], done.stdout


# ---- Images


def test_numpy_sees_an_image_without_a_copy():
    radiance = np.arange(24.0).reshape(2, 4, 3)
    image = Image(radiance, samples=5, layers={"depth": np.zeros((2, 4))})
    assert np.asarray(image) is radiance
    assert np.shares_memory(np.asarray(image)[0], radiance)
    assert not np.shares_memory(np.array(image), radiance)
    assert np.asarray(image, np.float32).dtype == np.float32
    assert (image.__array__(copy=False)) is radiance
    with pytest.raises(ValueError, match="float64, and no view of it is float32"):
        image.__array__(np.float32, copy=False)
    assert float(np.mean(image)) == 11.5
    assert repr(image) == "<rt.Image: 4 x 2, 5 spp, depth>"
    assert image != Image(radiance)
    assert len({image, image}) == 1


# ---- Bars


def test_a_bar_is_shown_on_a_terminal_and_where_it_is_asked_for():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    pipe, terminal, asked = io.StringIO(), Terminal(), io.StringIO()
    for stream, always in ((pipe, False), (terminal, False), (asked, True)):
        with Bar(" things", always=always, file=stream, mininterval=0) as bar:
            bar.update(1, 4)
            bar.update(3, 6, "error 2 %")
    assert pipe.getvalue() == ""
    for stream in (terminal, asked):
        assert all(said in stream.getvalue() for said in ("1/4", "3/6", "error 2 %"))
    # One that had nothing to show is nothing.
    with Bar(always=True):
        pass


# ---- The pages


def test_the_examples_of_the_page_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "scripting.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 8
    names = {}
    for block in blocks:
        exec(compile(block, "docs/scripting.md", "exec"), names)
    assert {path.name for path in tmp_path.iterdir()} >= {"ball.png", "scene.yaml", "picture.png", "f2.png"}


@pytest.mark.slow
def test_the_examples_that_take_long_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "scripting.md").read_text(encoding="utf-8")
    names = {}
    for number, block in enumerate(re.findall(r"^```py(?:thon)?\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)):
        if number == 0 or "rt.cost" in block:
            exec(compile(block, "docs/scripting.md", "exec"), names)
    assert names["study"].prediction.points


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_notebook_runs_and_shows_pictures(tmp_path, monkeypatch):
    import nbclient
    import nbformat

    # A kernel of this interpreter, without one being installed for the user.
    argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    kernel = tmp_path / "jupyter" / "kernels" / "tested" / "kernel.json"
    kernel.parent.mkdir(parents=True)
    kernel.write_text(json.dumps({"argv": argv, "display_name": "tested", "language": "python"}))
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path / "jupyter"))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = nbformat.read(ROOT / "docs" / "scripting.ipynb", as_version=4)
    assert all(not cell.outputs and cell.execution_count is None for cell in notebook.cells if cell.cell_type == "code")
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="tested", resources=resources).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 2
    texts = "".join(output.get("text", "") + output.get("data", {}).get("text/plain", "") for output in outputs)
    assert "defocus" in texts
    assert "samples" in texts
    assert (tmp_path / "three_balls.yaml").is_file()
