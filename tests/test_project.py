"""The project's frame: what its documents say is there, and what is there is in its documents."""

import re
import runpy
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from importlib.metadata import entry_points, version
from pathlib import Path

import numpy as np
import pytest
import typer
import yaml
from PIL import Image

import raytracer
from raytracer.analysis.explain import explain
from raytracer.cli.base.app import application
from raytracer.optics.to_yaml import spec_to_plain, to_yaml
from raytracer.scene.json_schema import lens_schema, scene_schema
from raytracer.scene.load import build, load
from raytracer.scene.overrides import parse_overrides
from raytracer.schema.registry import (
    APERTURES,
    CAMERAS,
    ENVIRONMENTS,
    FILTERS,
    LIGHTS,
    MATERIALS,
    MEDIA,
    SHAPES,
    TEXTURES,
)
from raytracer.util.errors import SceneError
from tests.repository import ROOT, script

README = (ROOT / "README.md").read_text(encoding="utf-8")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
COMMANDS = typer.main.get_command(application()).commands

make_scenes = script("docs/make_scenes.py")
make_thumbnails = script("docs/make_thumbnails.py")


REFERENCE = "\n".join(path.read_text(encoding="utf-8") for path in sorted(make_scenes.OUTPUT.rglob("*.md")))


def fenced(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


# ---- Kinds


def scene_with(family, piece, folder):
    """A scene around a kind's snippet, with the materials and files that the snippet names."""
    scene = {"camera": {"type": "pinhole"}, "film": {"width": 8, "height": 6}, "objects": []}
    ball = {"type": "sphere", "center": [0, 0, 0], "radius": 1}
    if family is SHAPES:
        scene["groups"] = {item["of"]: [ball] for item in piece if "of" in item}
        scene["materials"] = {item["material"]: {"type": "lambertian"} for item in piece if "material" in item}
    if family is MATERIALS:
        scene["objects"] = [{**ball, "material": name} for name in piece]
    keys = {MATERIALS: "materials", SHAPES: "objects", LIGHTS: "lights", MEDIA: "media", TEXTURES: "textures"}
    scene |= {keys[family]: piece} if family in keys else piece

    def touch(item):
        for key, value in item.items() if isinstance(item, dict) else enumerate(item):
            if key in ("file", "placements") and isinstance(value, str):
                (folder / value).touch()
            elif isinstance(value, dict | list):
                touch(value)
        if "lens" in item:
            # What a camera's lens can do is asked of its file when the scene is checked.
            shutil.copytree(ROOT / "scenes" / "lenses", folder / "lenses", dirs_exist_ok=True)

    touch(scene)
    path = folder / "scene.yaml"
    path.write_text(yaml.safe_dump(scene))
    return path


KINDS = [
    pytest.param(family, spec, id=f"{spec.__name__} {name}")
    for family in (APERTURES, CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES)
    for name, spec in family.specs().items()
]


def kinds_in(scene, family):
    """The classes of a family's kinds that a scene has."""
    found = {
        APERTURES: [getattr(scene.camera, "aperture_shape", None)],
        CAMERAS: [scene.camera],
        ENVIRONMENTS: [scene.environment],
        FILTERS: [scene.film.filter],
        LIGHTS: scene.lights,
        MATERIALS: scene.materials.values(),
        MEDIA: scene.media.values(),
        SHAPES: scene.objects,
        TEXTURES: scene.textures.values(),
    }[family]
    return {type(item) for item in found}


@pytest.mark.parametrize(("family", "spec"), KINDS)
def test_a_kinds_docstring_holds_a_scene_that_is_valid(family, spec, tmp_path):
    snippet = make_scenes.snippet(sys.modules[spec.__module__].__doc__)
    scene = load(scene_with(family, yaml.safe_load(snippet), tmp_path))
    assert kinds_in(scene, family) == {spec}
    assert build(to_yaml(spec_to_plain(scene)), "again.yaml", base=tmp_path) == scene


EXAMPLES = [
    pytest.param(name, kind, id=f"{name}/{kind}")
    for name, family in make_scenes.FAMILIES.items()
    for kind in family.specs()
]


@pytest.mark.parametrize(("name", "kind"), EXAMPLES)
def test_a_kinds_example_has_the_kind_and_a_picture_and_what_it_says_to_try_works(name, kind):
    path, family = make_scenes.example(f"{name}/{kind}"), make_scenes.FAMILIES[name]
    assert family.specs()[kind] in kinds_in(load(path), family)
    first, second, *_ = path.read_text(encoding="utf-8").splitlines()
    assert re.match(r"# [A-Z].*\.$", first)
    changes = [
        re.findall(r"-D ((?:\{[^}]*\}|[^\s{])+)", piece) for piece in second.removeprefix("# Try: ").split(", or ")
    ]
    tried = [[word.rstrip(",.") for word in words] for words in changes if words]
    assert tried
    assert all(load(path, parse_overrides(words)) != load(path) for words in tried)
    with Image.open(make_thumbnails.THUMBNAILS / name / f"{kind}.jpg") as picture:
        assert picture.width == make_thumbnails.WIDTH


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), EXAMPLES)
def test_a_kinds_picture_is_what_its_example_renders(name, kind):
    rendered = make_thumbnails.thumbnail(make_scenes.example(f"{name}/{kind}"))
    with Image.open(make_thumbnails.THUMBNAILS / name / f"{kind}.jpg") as picture:
        assert picture.size == rendered.size
        shown, made = (np.asarray(image.reduce(20), float) for image in (picture, rendered))
    assert np.abs(shown - made).mean() < 2.0


def mappings_of_a_schema(node, name=""):
    """The mappings at any depth, and the definitions or keys that they are, or are in."""
    if isinstance(node, dict):
        if "properties" in node:
            yield name, node["properties"]
        for key, below in node.items():
            yield from mappings_of_a_schema(below, name if key in _WORDS else key)
    elif isinstance(node, list):
        for below in node:
            yield from mappings_of_a_schema(below, name)


_WORDS = {"properties", "items", "anyOf", "oneOf", "prefixItems", "additionalProperties", "$defs"}
"""The words of JSON Schema that have schemas below them."""


@pytest.mark.parametrize(
    ("described", "text"),
    [(scene_schema(), REFERENCE), (lens_schema(), (ROOT / "docs" / "lenses.md").read_text(encoding="utf-8"))],
    ids=["scene", "lens"],
)
def test_every_key_at_any_depth_is_described_and_in_the_reference(described, text):
    silent, missing = [], []
    for name, properties in mappings_of_a_schema(described):
        for key, below in properties.items():
            if "const" in below or (text is not REFERENCE and key == "type"):
                continue
            if not below.get("description"):
                silent.append(f"{name}.{key}")
            in_table = any(key in table for table in tables(text))
            if not (in_table if text is REFERENCE else re.search(rf"[`{{ ]{key}[`:]", text)):
                missing.append(f"{name}.{key}")
    assert (silent, missing) == ([], [])


def tables(text):
    """The keys that the tables of a document have in their first columns."""
    return [set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) for table in text.split("\n\n")]


def test_each_mapping_of_a_scene_has_a_table_of_its_keys_and_links_lead_there():
    # What all kinds of some families have besides their own keys has tables of its own.
    shared = {"type", *(key for base, _, _ in make_scenes.SHARED.values() for key in base.model_fields)}
    for name, properties in mappings_of_a_schema(scene_schema()):
        assert any(set(properties) - shared <= table for table in tables(REFERENCE)), name
    cameras = (make_scenes.OUTPUT / "cameras" / "index.md").read_text(encoding="utf-8")
    (page,) = re.findall(r"^\| `shake` \| \[mapping\]\(\.\./(\w+\.md)#shake\)", cameras, re.MULTILINE)
    section = (make_scenes.OUTPUT / page).read_text(encoding="utf-8").partition("\n## shake\n")[2]
    assert "| `amplitude` | number | needed | root mean square (deg) of the angle about each axis" in section


@pytest.mark.parametrize("path", sorted((ROOT / "scenes").glob("*.yaml")), ids=lambda path: path.stem)
def test_scenes_of_the_repository_are_valid(path):
    if "generated/" in path.read_text() and not (ROOT / "scenes" / "generated").exists():
        pytest.skip("`make scenes` has not made its mesh")
    load(path)


def test_a_generated_file_that_is_missing_is_said_to_be_made_by_make_scenes(tmp_path):
    text = "camera: {type: pinhole}\nfilm: {width: 8, height: 6}\nobjects: [{type: mesh, file: FOLDER/rock.ply}]\n"
    for folder in ("generate", "lightfield"):
        (tmp_path / folder).mkdir()
    for name in ("generated", "../generated"):
        path = tmp_path / ("lightfield" if name.startswith("..") else "") / "scene.yaml"
        path.write_text(text.replace("FOLDER", name))
        with pytest.raises(SceneError, match=rf"there is no file '{name}/rock.ply' in .*: `make scenes` makes it$"):
            load(path, allow_files=[tmp_path])
    # Of others nothing is known.
    path.write_text(text.replace("FOLDER/", ""))
    with pytest.raises(SceneError, match=r"the scene's folder$"):
        load(path)


# ---- Documents


@pytest.mark.parametrize("name", ["make_scenes", "make_commands", "make_python_reference"])
def test_the_reference_is_up_to_date(name):
    made = script(f"docs/{name}.py")
    pages = {path.relative_to(made.OUTPUT).as_posix(): path for path in made.OUTPUT.rglob("*.md")}
    texts = made.reference()
    assert set(pages) == set(texts), "run `make docs`"
    assert [page for page, path in pages.items() if path.read_text(encoding="utf-8") != texts[page]] == []


def test_the_table_of_warnings_is_up_to_date():
    made = script("docs/make_warnings.py")
    text = made.OUTPUT.read_text(encoding="utf-8")
    assert made.with_tables(text) == text, "run `make docs`"
    with pytest.raises(ValueError, match=r"^docs/warnings.md has no section Photographs$"):
        made.with_tables(text.replace("## Photographs", "## Pictures"))


SHIPPED = {path.read_text(encoding="utf-8"): path for path in (ROOT / "scenes" / "kinds").rglob("*.yaml")}
EVERY_DOCUMENT = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
TARGETS = set(re.findall(r"^([a-z-]+):", MAKEFILE, re.MULTILINE))


@EVERY_DOCUMENT
def test_what_documents_show_is_valid_and_what_they_name_exists(document, tmp_path):
    text = document.read_text(encoding="utf-8")
    # Whole scenes.
    for number, scene in enumerate(fenced(text, "yaml")):
        if "camera:" in scene and "film:" in scene and "objects:" in scene:
            path = tmp_path / f"{number}.yaml"
            path.write_text(scene)
            load(SHIPPED.get(scene, path))
    # Links.
    links = re.findall(r"\]\((?!https?://)([^)#]*)(#[^)]*)?\)", text)
    assert [link for link, _ in links if not (document.parent / link).exists()] == []
    headings = {re.sub(r"[^\w -]", "", line.lstrip("# ")).lower().replace(" ", "-") for line in text.splitlines()}
    assert [anchor for link, anchor in links if anchor and not link and anchor[1:] not in headings] == []
    # Source files, but those of kinds that a reader is told how to add.
    named = set(re.findall(r"`((?:[\w.-]+/)+[\w-]+\.(?:py|yaml|md))`", text))
    named -= {"raytracer/plugins/shapes/ring.py", "raytracer/core/primitives/cylinders.py"}
    assert [name for name in named if not any((base / name).exists() for base in (ROOT, ROOT / "raytracer"))] == []
    # Targets of make.
    used = re.findall(r"(?:^make |`make )(?:[A-Z]+=\S+ )?([a-z-]+)(?:`|\s|$)", text, re.MULTILINE)
    assert set(used) <= TARGETS
    if document.name == "README.md" and document.parent == ROOT:
        assert used
        assert any("objects:" in scene for scene in fenced(text, "yaml"))


def test_the_readme_is_read_in_four_minutes():
    assert len(README.split()) <= 900


def test_the_readmes_far_ball_is_as_blurred_as_it_says(tmp_path):
    (text,) = (text for text in fenced(README, "yaml") if "name: far" in text)
    (told,) = re.findall(r"`far` is blurred by (\d+) px", README)
    path = tmp_path / "ball.yaml"
    path.write_text(text)
    blurs = {}
    for f_number in (16, 2):
        objects = explain(load(path, {"camera.f_number": f_number})).objects
        blurs[f_number] = objects["far"]["circle_of_confusion_px"]
        assert objects["ball"]["circle_of_confusion_px"] == pytest.approx(0.0, abs=1e-9)
    assert blurs[16] < 1.0
    assert round(blurs[2]) == int(told) > 5


def test_names_that_the_readme_uses_from_python_exist():
    (program,) = fenced(README, "python")
    names = set(re.findall(r"\brt\.(\w+)", program))
    assert names
    assert names <= set(dir(raytracer))


def test_the_architecture_shows_the_packages_as_they_are_and_is_read_in_fifteen_minutes():
    make_tree = runpy.run_path(str(ROOT / "docs" / "make_tree.py"))
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert make_tree["with_tree"](text) == text
    assert sorted(make_tree["layers"]()) == sorted(path.parent.name for path in ROOT.glob("raytracer/*/__init__.py"))
    # Technical prose is read at some 220 words a minute.
    assert len(text.split()) <= 15 * 220


def test_every_decision_is_in_the_index():
    folder = ROOT / "docs" / "decisions"
    listed = set(re.findall(r"\]\(([\w-]+\.md)\)", (folder / "README.md").read_text(encoding="utf-8")))
    assert listed == {path.name for path in folder.glob("*.md")} - {"README.md"}


def test_only_one_module_loads_embree():
    # Its library is opened by ctypes and never imported, so the contracts on imports do not see it.
    loads = re.compile(r"find_spec\(.embreex|import embreex|from embreex")
    sources = (ROOT / "raytracer").rglob("*.py")
    found = [path.name for path in sources if loads.search(path.read_text(encoding="utf-8"))]
    assert found == ["embree_library.py"]


def test_every_dependency_is_explained():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    text = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8").lower()
    wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = [re.split(r"[<>=~\[; ]", requirement)[0].lower() for requirement in wanted]
    assert [name for name in names if name not in text] == []


# ---- Installation


SLOW = {"numba", "llvmlite", "numpy", "scipy", "pydantic", "yaml", "PIL", "OpenEXR", "trimesh"}


def test_the_command_is_installed_in_this_version():
    assert version("raytracer") == raytracer.__version__
    (command,) = entry_points(group="console_scripts", name="rt")
    assert command.value == "raytracer.cli.main:main"


def test_the_installed_command_helps_and_tells_its_version_without_loading_what_is_slow():
    command = [sys.executable, "-X", "importtime", Path(sysconfig.get_path("scripts")) / "rt"]
    for word, said in (("--help", "Usage: rt"), ("--version", f"rt {raytracer.__version__}\n")):
        done = subprocess.run([*command, word], capture_output=True, text=True, check=True)
        assert said in done.stdout
        assert word == "--version" or all(name in done.stdout for name in COMMANDS)
        imported = {line.rpartition("|")[2].strip().partition(".")[0] for line in done.stderr.splitlines()}
        assert "typer" in imported
        assert imported.isdisjoint(SLOW)


def test_make_help_lists_every_target():
    done = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True)
    (phony,) = re.findall(r"^\.PHONY: (help .*)$", MAKEFILE, re.MULTILINE)
    assert set(re.findall(r"^ *make ([a-z-]+)", done.stdout, re.MULTILINE)) == set(phony.split())


def test_a_missing_snippet_or_example_is_refused():
    assert make_scenes.snippet("Title.\n\nIn a scene:\n\n    a: 1\n    b:\n      c: 2\n") == "a: 1\nb:\n  c: 2"
    with pytest.raises(ValueError, match="an indented piece of a scene"):
        make_scenes.snippet("Title only.")
    with pytest.raises(ValueError, match=r"cameras/eye has no example: write scenes/kinds/cameras/eye\.yaml"):
        make_scenes.example("cameras/eye")


# ---- Releases


def test_the_citation_and_the_changelog_are_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    # What the format 1.2.0 asks for, and what it allows of it that is here.
    needed = {"cff-version", "message", "title", "authors"}
    allowed = {"type", "abstract", "version", "date-released", "license", "keywords"}
    assert needed <= set(citation) <= needed | allowed
    assert (citation["cff-version"], citation["type"], citation["license"]) == ("1.2.0", "software", "MIT")
    assert [set(author) for author in citation["authors"]] == [{"name"}]
    # Sources without Git are taken for those of the last release.
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    assert citation["version"] == settings["setuptools_scm"]["fallback_version"]
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    releases = re.findall(r"^## \[([\w.]+)\](?: - (\d{4}-\d\d-\d\d))?$", changes, re.MULTILINE)
    assert releases[:2] == [("Unreleased", ""), (citation["version"], citation["date-released"])]
    assert set(re.findall(r"^### (\w+)$", changes, re.MULTILINE)) <= {
        "Added",
        "Changed",
        "Fixed",
        "Removed",
        "Security",
    }
