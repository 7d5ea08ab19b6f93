"""The project's frame: what its documents say is there, and what is there is in its documents."""

import importlib.util
import re
import runpy
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from collections.abc import Iterator
from importlib.metadata import entry_points, version
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer
import yaml

import raytracer
from raytracer.analysis.explain import explain
from raytracer.cli.base.app import application
from raytracer.optics.to_yaml import spec_to_plain, to_yaml
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.shapes.base.interface import ShapeSpec
from raytracer.scene.json_schema import lens_schema, scene_schema
from raytracer.scene.load import build, load
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
    Family,
)
from raytracer.schema.spec import Spec
from raytracer.util.errors import SceneError

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
DOCUMENTS = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
FAMILIES = (APERTURES, CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES)

COMMANDS = set(typer.main.get_command(application()).commands)  # type: ignore[attr-defined]


def _script(name: str) -> ModuleType:
    """A script of the docs folder as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


make_scenes = _script("make_scenes")


def _fenced(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


# ---- Kinds


def _kinds() -> list[tuple[Family, str, type[Spec]]]:
    return [(family, name, spec) for family in FAMILIES for name, spec in family.specs().items()]


def _scene_with(family: Family, snippet: str, folder: Path) -> Path:
    """A scene around a kind's snippet, with the materials and files that the snippet names."""
    scene = {"camera": {"type": "pinhole"}, "film": {"width": 8, "height": 6}, "materials": {}, "objects": []}
    piece = yaml.safe_load(snippet)
    if family is MATERIALS:
        scene["materials"] = piece
        scene["objects"] = [{"type": "sphere", "center": [0, 0, 0], "radius": 1, "material": name} for name in piece]
    elif family is SHAPES:
        scene["objects"] = piece
        ball = {"type": "sphere", "center": [0, 0, 0], "radius": 1}
        scene["groups"] = {item["of"]: [ball] for item in piece if "of" in item}
        for item in piece:
            if isinstance(item.get("placements"), str):
                (folder / item["placements"]).touch()
        scene["materials"] = {item["material"]: {"type": "lambertian"} for item in piece if "material" in item}
        for item in piece:
            for source in (item, *item.get("frames", [])):
                if "file" in source:
                    (folder / source["file"]).touch()
    elif family is LIGHTS:
        scene["lights"] = piece
    elif family in (MEDIA, TEXTURES):
        scene["media" if family is MEDIA else "textures"] = piece
        for item in piece.values():
            if "file" in item:
                (folder / item["file"]).touch()
    else:
        scene.update(piece)
        for item in piece.values():
            for source in (item, item.get("aperture_shape", {})):
                if "file" in source:
                    (folder / source["file"]).touch()
            if "lens" in item:
                # What a camera's lens can do is asked of its file when the scene is checked.
                shutil.copytree(ROOT / "scenes" / "lenses", folder / "lenses", dirs_exist_ok=True)
    path = folder / "scene.yaml"
    path.write_text(yaml.safe_dump(scene))
    return path


@pytest.mark.parametrize(
    ("family", "name", "spec"), _kinds(), ids=lambda value: value if isinstance(value, str) else ""
)
def test_a_kinds_docstring_holds_a_scene_that_is_valid(
    family: Family, name: str, spec: type[Spec], tmp_path: Path
) -> None:
    snippet = make_scenes.snippet(sys.modules[spec.__module__].__doc__)
    scene = load(_scene_with(family, snippet, tmp_path))
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
    assert found
    assert {type(item) for item in found} == {spec}
    assert build(to_yaml(spec_to_plain(scene)), "again.yaml", base=tmp_path) == scene


@pytest.mark.parametrize(
    ("family", "name", "spec"), _kinds(), ids=lambda value: value if isinstance(value, str) else ""
)
def test_every_key_of_a_kind_is_described(family: Family, name: str, spec: type[Spec]) -> None:
    silent = [key for key, field in spec.model_fields.items() if key != "type" and not field.description]
    assert silent == []


def _mappings_of_a_schema(node: Any, name: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """The mappings at any depth, and the definitions or keys that they are, or are in."""
    if isinstance(node, dict):
        if "properties" in node:
            yield name, node["properties"]
        for key, below in node.items():
            yield from _mappings_of_a_schema(below, name if key in _WORDS else key)
    elif isinstance(node, list):
        for below in node:
            yield from _mappings_of_a_schema(below, name)


_WORDS = {"properties", "items", "anyOf", "oneOf", "prefixItems", "additionalProperties", "$defs"}
"""The words of JSON Schema that have schemas below them."""


@pytest.mark.parametrize(
    ("described", "document"), [(scene_schema(), "scenes.md"), (lens_schema(), "lenses.md")], ids=["scene", "lens"]
)
def test_every_key_at_any_depth_is_described_and_in_the_reference(described: dict[str, Any], document: str) -> None:
    text = (ROOT / "docs" / document).read_text(encoding="utf-8")
    silent, missing = [], []
    for name, properties in _mappings_of_a_schema(described):
        tables = {tuple(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) for table in text.split("\n\n")}
        for key, below in properties.items():
            if "const" in below or (document == "lenses.md" and key == "type"):
                continue
            if not below.get("description"):
                silent.append(f"{name}.{key}")
            in_table = any(key in table for table in tables)
            if not (in_table if document == "scenes.md" else re.search(rf"[`{{ ]{key}[`:]", text)):
                missing.append(f"{name}.{key}")
    assert (silent, missing) == ([], [])


def test_each_mapping_of_a_scene_has_a_table_of_its_keys() -> None:
    text = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    tables = [set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) for table in text.split("\n\n")]
    # What every object and every material has besides its own keys has tables of its own.
    shared = {*ShapeSpec.model_fields, *MaterialSpec.model_fields, "type"}
    for name, properties in _mappings_of_a_schema(scene_schema()):
        own = set(properties) - shared
        assert any(own <= table for table in tables), name


def test_links_of_the_reference_lead_to_tables_of_what_they_stand_for() -> None:
    text = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", text, re.DOTALL | re.MULTILINE))
    row = re.search(r"^\| `shake` \| \[mapping\]\(#(\w+)\)", text, re.MULTILINE)
    assert row is not None
    assert "| `amplitude` | number | needed | root mean square (deg) of the angle about each axis" in sections[row[1]]
    assert sections["sellmeier"].count("| `b` |") == 1


@pytest.mark.parametrize("path", sorted((ROOT / "scenes").glob("*.yaml")), ids=lambda path: path.stem)
def test_scenes_of_the_repository_are_valid(path: Path) -> None:
    if "generated/" in path.read_text() and not (ROOT / "scenes" / "generated").exists():
        pytest.skip("`make scenes` has not made its mesh")
    load(path)


def test_a_generated_file_that_is_missing_is_said_to_be_made_by_make_scenes(tmp_path: Path) -> None:
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


def test_the_reference_of_scene_files_is_up_to_date() -> None:
    assert make_scenes.OUTPUT.read_text(encoding="utf-8") == make_scenes.reference(), "run `make docs`"


def test_the_reference_of_commands_is_up_to_date() -> None:
    make_commands = _script("make_commands")
    assert make_commands.OUTPUT.read_text(encoding="utf-8") == make_commands.reference(), "run `make docs`"


def test_the_tables_of_warnings_are_up_to_date() -> None:
    make_warnings = _script("make_warnings")
    text = make_warnings.OUTPUT.read_text(encoding="utf-8")
    assert make_warnings.with_tables(text) == text, "run `make docs`"
    with pytest.raises(ValueError, match=r"^docs/warnings.md has no section Photographs$"):
        make_warnings.with_tables(text.replace("## Photographs", "## Pictures"))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_whole_scenes_in_documents_are_valid(document: Path, tmp_path: Path) -> None:
    for number, text in enumerate(_fenced(document.read_text(encoding="utf-8"), "yaml")):
        if "camera:" in text and "film:" in text and "objects:" in text:
            path = tmp_path / f"{number}.yaml"
            path.write_text(text)
            load(path)


def test_the_readmes_first_scene_is_one() -> None:
    assert any("objects:" in text for text in _fenced(README, "yaml"))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    links = re.findall(r"\]\((?!https?://)([^)#]*)(#[^)]*)?\)", text)
    assert [link for link, _ in links if not (document.parent / link).exists()] == []
    headings = {re.sub(r"[^\w -]", "", line.lstrip("# ")).lower().replace(" ", "-") for line in text.splitlines()}
    assert [anchor for link, anchor in links if anchor and not link and anchor[1:] not in headings] == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_source_files_that_documents_name_exist(document: Path) -> None:
    named = set(re.findall(r"`((?:[\w.-]+/)+[\w-]+\.(?:py|yaml|md))`", document.read_text(encoding="utf-8")))
    # Files of kinds that a reader is told how to add.
    named -= {"raytracer/plugins/shapes/ring.py", "raytracer/core/primitives/cylinders.py"}
    assert (
        sorted(name for name in named if not any((base / name).exists() for base in (ROOT, ROOT / "raytracer"))) == []
    )


def test_the_readme_lists_the_commands_that_exist() -> None:
    listed = set(re.findall(r"^\| `rt (\w+)", README, re.MULTILINE))
    assert listed == COMMANDS
    used = {name for text in _fenced(README, "") for name in re.findall(r"\brt (\w+)", text)}
    assert used <= COMMANDS


def test_options_in_the_readme_exist() -> None:
    for text in _fenced(README, ""):
        for command, rest in re.findall(r"^(?:\$ )?rt (\w+)(.*)$", text, re.MULTILINE):
            found = typer.main.get_command(application()).commands[command]  # type: ignore[attr-defined]
            parts = [found, *getattr(found, "commands", {}).values()]
            known = {name for part in parts for parameter in part.params for name in parameter.opts}
            assert set(re.findall(r"(?<=\s)(--[\w-]+|-[a-zA-Z]\b)", rest)) <= known


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_make_targets_that_documents_name_exist(document: Path) -> None:
    named = re.findall(
        r"^make (?:[A-Z]+=\S+ )?([a-z-]+)|`make (?:[A-Z]+=\S+ )?([a-z-]+)`", document.read_text(), re.MULTILINE
    )
    assert named or document != ROOT / "README.md"
    targets = set(re.findall(r"^([a-z-]+):", MAKEFILE, re.MULTILINE))
    assert {first or second for first, second in named} <= targets


def test_the_readmes_far_ball_is_as_blurred_as_it_says(tmp_path: Path) -> None:
    (text,) = (text for text in _fenced(README, "yaml") if "name: far" in text)
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


def test_names_that_the_readme_uses_from_python_exist() -> None:
    (program,) = _fenced(README, "python")
    names = set(re.findall(r"\brt\.(\w+)", program))
    assert names
    assert sorted(name for name in names if not hasattr(raytracer, name)) == []


def test_the_architecture_shows_the_packages_as_they_are() -> None:
    make_tree = runpy.run_path(str(ROOT / "docs" / "make_tree.py"))
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert make_tree["with_tree"](text) == text
    packages = {path.parent.name for path in (ROOT / "raytracer").glob("*/__init__.py")}
    assert sorted(make_tree["layers"]()) == sorted(packages)


def test_the_architecture_is_read_in_fifteen_minutes() -> None:
    # Technical prose is read at some 220 words a minute.
    assert len((ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").split()) <= 15 * 220


def test_every_decision_is_in_the_index() -> None:
    folder = ROOT / "docs" / "decisions"
    listed = set(re.findall(r"\]\(([\w-]+\.md)\)", (folder / "README.md").read_text(encoding="utf-8")))
    assert listed == {path.name for path in folder.glob("*.md")} - {"README.md"}


def test_only_one_module_loads_embree() -> None:
    # Its library is opened by ctypes and never imported, so the contracts on imports do not see it.
    loads = re.compile(r"find_spec\(.embreex|import embreex|from embreex")
    sources = (ROOT / "raytracer").rglob("*.py")
    found = [path.name for path in sources if loads.search(path.read_text(encoding="utf-8"))]
    assert found == ["embree_library.py"]


def test_every_dependency_is_explained() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    text = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8").lower()
    wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = [re.split(r"[<>=~\[; ]", requirement)[0].lower() for requirement in wanted]
    assert [name for name in names if name not in text] == []


# ---- Installation


def test_versions_agree() -> None:
    assert version("raytracer") == raytracer.__version__


def test_the_command_is_installed() -> None:
    (command,) = entry_points(group="console_scripts", name="rt")
    assert command.value == "raytracer.cli.main:main"


def test_the_installed_command_helps_without_loading_what_is_slow() -> None:
    script = Path(sysconfig.get_path("scripts")) / "rt"
    done = subprocess.run(
        [sys.executable, "-X", "importtime", script, "--help"], capture_output=True, text=True, check=True
    )
    assert "Usage: rt" in done.stdout
    assert all(command in done.stdout for command in COMMANDS)
    imported = {line.rpartition("|")[2].strip().partition(".")[0] for line in done.stderr.splitlines()}
    assert "typer" in imported
    assert imported.isdisjoint({"numba", "llvmlite", "numpy", "scipy", "pydantic", "yaml", "PIL", "OpenEXR", "trimesh"})


def test_the_version_is_printed_by_the_installed_command() -> None:
    script = Path(sysconfig.get_path("scripts")) / "rt"
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"rt {raytracer.__version__}\n"


def test_make_help_lists_every_target() -> None:
    done = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True)
    (phony,) = re.findall(r"^\.PHONY: (help .*)$", MAKEFILE, re.MULTILINE)
    assert set(re.findall(r"^ *make ([a-z-]+)", done.stdout, re.MULTILINE)) == set(phony.split())


def test_a_missing_snippet_is_refused() -> None:
    assert make_scenes.snippet("Title.\n\nIn a scene:\n\n    a: 1\n    b:\n      c: 2\n") == "a: 1\nb:\n  c: 2"
    with pytest.raises(ValueError, match="an indented piece of a scene"):
        make_scenes.snippet("Title only.")
