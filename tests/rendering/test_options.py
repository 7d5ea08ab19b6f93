"""The options of a render: one list of them, of which Python's keywords are made."""

import inspect
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

import raytracer as rt
from raytracer.film.window import Window
from raytracer.rendering.checked_options import check_options
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import SceneOptions
from raytracer.util.errors import InputError
from tests.small_scenes import scene

_SPHERE = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}
"""


NAMES = [field.name for field in fields(RenderOptions)]


@pytest.mark.parametrize(
    ("function", "first", "without"),
    [
        (rt.render, ["scene"], set()),
        (rt.sweep, ["scene", "values"], set()),
        (rt.probe, ["scene", "at"], {"crop", "noise", "time_limit", "aovs", "denoise"}),
        (rt.lightfield.capture, ["spec", "path"], {"crop", "noise", "time_limit"}),
    ],
)
def test_help_shows_the_options_with_their_defaults(function: Any, first: list[str], without: set[str]) -> None:
    parameters = inspect.signature(function).parameters
    assert list(parameters)[: len(first)] == first
    assert [name for name in parameters if name in NAMES] == [name for name in NAMES if name not in without]
    for field in fields(RenderOptions):
        if field.name in parameters:
            assert parameters[field.name].default == field.default
    keywords = list(parameters.values())[len(first) :]
    assert all(parameter.kind is inspect.Parameter.KEYWORD_ONLY for parameter in keywords)


def test_help_shows_the_keywords_of_a_render() -> None:
    own = ["progress", "cache", "stock", "cluster", "checkpoint", "resume"]
    assert list(inspect.signature(rt.render).parameters) == ["scene", *NAMES, *own]


@pytest.mark.parametrize("name", ["nope", "dry_run_save"])
def test_other_keywords_are_refused(name: str) -> None:
    settings: dict[str, Any] = {name: None}
    with pytest.raises(TypeError, match=f"unexpected keyword argument '{name}'"):
        rt.render(scene(_SPHERE), **settings)


def test_keywords_that_a_function_goes_without_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"^capture\(\) got an unexpected keyword argument 'crop'"):
        rt.lightfield.capture(scene(_SPHERE), tmp_path / "x.lf", crop=(0, 0, 1, 1))
    with pytest.raises(TypeError, match=r"^probe\(\) got an unexpected keyword argument 'noise'"):
        rt.probe(scene(_SPHERE), (0.0, 0.0, 4.0), toward=(0.0, 0.0, 0.0), noise=0.1)


@pytest.mark.filterwarnings("ignore::raytracer.util.errors.SceneWarning")
def test_memory_is_limited_from_python_too() -> None:
    with pytest.raises(InputError, match="memory"):
        rt.render(scene(_SPHERE), max_memory=1)


def test_one_aov_needs_no_list() -> None:
    assert RenderOptions(aovs="depth").aovs == RenderOptions(aovs=["depth"]).aovs == ("depth",)


def test_what_is_checked_holds_the_options_alone() -> None:
    options = SceneOptions(scene(_SPHERE), spp=5, progress=print)
    _, checked = check_options(options.scene, options)
    assert not hasattr(checked, "scene")
    assert not hasattr(checked, "progress")


def test_options_stand_in_place_of_the_scenes() -> None:
    plain = scene(_SPHERE, width=8, height=4, spp=16)
    spec, checked = check_options(plain, RenderOptions(spp=5, seed=7, threads=3, aovs=["depth"]))
    assert (spec.render.spp, spec.render.seed) == (5, 7)
    assert checked.window == Window(0, 0, 8, 4)
    assert (checked.max_spp, checked.is_adaptive, checked.threads, checked.aovs) == (5, False, 3, ("depth",))
    spec, checked = check_options(plain, RenderOptions(noise=0.1))
    assert spec.render.spp == 16
    assert (checked.max_spp, checked.is_adaptive) == (None, True)
    assert check_options(plain, RenderOptions(time_limit=1.0, spp=5))[1].is_adaptive is False
    assert RenderOptions(noise=0.1).spp_limit(plain) is RenderOptions(time_limit=1.0).spp_limit(plain) is None
    assert (
        RenderOptions(time_limit=1.0, spp=5).spp_limit(plain) == RenderOptions(noise=0.1, spp=5).spp_limit(plain) == 5
    )
    assert RenderOptions().spp_limit(plain) == 16
