"""The scenes of the camera lecture: every setting that its pictures show, and every command of its page."""

import importlib.util
import re
import shlex
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest
import typer

from raytracer.analysis.explain import explain
from raytracer.cli.base.app import application
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.scene.overrides import parse_overrides

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "scenes" / "lecture"
OPTICS = FOLDER.parent / "optics"
NAMES = sorted(path.stem for path in FOLDER.glob("*.yaml"))
PAGE = "".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs" / "lecture").glob("*.md")))

STREET = ("dolly_zoom", "focal_lengths", "pinhole", "sensor_sizes")
"""Scenes that share a compiled kernel."""


def _script(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


make_gallery = _script(ROOT / "docs" / "make_gallery.py")


class Command(NamedTuple):
    """A command of the page, without `rt`, and what the page says that it prints."""

    words: list[str]
    output: list[str]


def _commands() -> list[Command]:
    found = []
    for block in re.findall(r"^```\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE):
        for piece in re.split(r"^\$ rt ", block, flags=re.MULTILINE)[1:]:
            first, *rest = piece.splitlines()
            found.append(Command(shlex.split(first), rest))
    return found


def test_the_gallery_shows_every_scene_of_the_lecture_and_the_page_every_sheet() -> None:
    assert sorted(make_gallery.LECTURE) == NAMES
    assert sorted(re.findall(r"gallery/lecture_(\w+)\.jpg", PAGE)) == NAMES


def test_pages_show_every_diagram_that_is_drawn() -> None:
    drawn = _script(ROOT / "docs" / "make_diagrams.py").DIAGRAMS
    assert sorted(path.stem for path in (ROOT / "docs" / "lecture" / "diagrams").glob("*.svg")) == sorted(drawn)
    assert sorted(re.findall(r"diagrams/(\w+)\.svg", PAGE)) == sorted(drawn)


@pytest.mark.parametrize(
    "path", [*sorted(FOLDER.glob("*.yaml")), *sorted(OPTICS.glob("*.yaml"))], ids=lambda path: path.stem
)
def test_a_scene_says_what_to_look_at_and_what_to_change(path: Path) -> None:
    comment = path.read_text(encoding="utf-8").partition("camera:")[0]
    assert all(line.startswith("# ") for line in comment.splitlines())
    assert "# Look at: " in comment
    assert "# Change: " in comment


@pytest.mark.parametrize("name", NAMES)
def test_every_setting_is_a_scene_of_its_own(name: str) -> None:
    variants = make_gallery.LECTURE[name].variants
    specs = [load(FOLDER / f"{name}.yaml", dict(variant.keys)) for variant in variants]
    assert len({repr((spec.camera, spec.lights)) for spec in specs}) == len(variants) > 1
    assert len({variant.caption for variant in variants}) == len(variants)


def _check(name: str) -> None:
    """Every setting gives light, that is neither lost nor mostly beyond what the sensor can tell apart."""
    for variant in make_gallery.LECTURE[name].variants:
        rendered = render(make_gallery.smaller(FOLDER / f"{name}.yaml", variant.keys, 48, 48), spp=16)
        values = rendered.image.radiance
        assert rendered.stats.nan_samples == 0
        assert np.isfinite(values).all()
        assert rendered.setting is not None
        assert rendered.setting.iso is not None
        # 10/78 is what a meter wants; night and bright roads are up to two stops from it.
        middle = np.minimum(values, 1.0).mean()
        assert 0.04 < middle < 0.4, variant.caption
        assert np.mean(values.max(axis=2) > 1.0) < 0.2, variant.caption
        assert np.median(values) > 0.01, variant.caption


@pytest.mark.slow
@pytest.mark.parametrize("name", STREET)
def test_settings_of_the_street_are_exposed_well(name: str) -> None:
    _check(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name not in STREET])
def test_settings_are_exposed_well(name: str) -> None:
    _check(name)


def test_files_that_scripts_made_are_what_the_scripts_make() -> None:
    generate = ROOT / "scenes" / "generate"
    street = _script(generate / "street.py")
    for name in street.HEADS:
        assert (FOLDER / f"{name}.yaml").read_text(encoding="utf-8") == street.street(name)
    assert (FOLDER / "splash.ply").read_bytes() == _script(generate / "splash.py").ply()


@pytest.mark.parametrize("command", _commands(), ids=lambda command: " ".join(command.words))
def test_commands_of_the_page_work_and_print_what_it_says(command: Command) -> None:
    verb, scene, *options = command.words
    parameters = typer.main.get_command(application()).commands[verb].params  # type: ignore[attr-defined]
    known = {name for parameter in parameters for name in parameter.opts}
    assert set(options[::2]) <= known
    keys = [value for option, value in zip(options[::2], options[1::2], strict=True) if option == "-D"]
    spec = load(ROOT / scene, parse_overrides(keys))
    assert bool(command.output) == (verb == "explain")
    if command.output:
        printed = {" ".join(line.split()) for line in explain(spec).text().splitlines()}
        assert {" ".join(line.split()) for line in command.output} <= printed
