"""The options of a render: one list of them, of which Python's keywords are made."""

import inspect
from dataclasses import fields

import pytest

import raytracer as rt
from raytracer.film.window import Window
from raytracer.rendering.checked_options import check_options
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import SceneOptions
from raytracer.util.errors import InputError
from tests.rendering.halves import halves

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
def test_help_shows_the_options_with_their_defaults(function, first, without, tmp_path):
    parameters = inspect.signature(function).parameters
    assert list(parameters)[: len(first)] == first
    assert [name for name in parameters if name in NAMES] == [name for name in NAMES if name not in without]
    for field in fields(RenderOptions):
        assert field.name in without or parameters[field.name].default == field.default
    keywords = list(parameters.values())[len(first) :]
    assert all(parameter.kind is inspect.Parameter.KEYWORD_ONLY for parameter in keywords)
    if function is rt.render:
        own = ["progress", "live", "cache", "stock", "cluster", "checkpoint", "resume"]
        assert list(parameters) == ["scene", *NAMES, *own]
    # Keywords that a function goes without, and others, are refused.
    arguments = {rt.probe: [(0.0, 0.0, 4.0)], rt.lightfield.capture: [tmp_path / "x.lf"], rt.sweep: [{}]}
    for name in ("nope", "dry_run_save", *without):
        with pytest.raises(TypeError, match=rf"^{function.__name__}\(\) got an unexpected keyword argument '{name}'"):
            function(halves(), *arguments.get(function, []), **{name: None})


@pytest.mark.filterwarnings("ignore::raytracer.util.errors.SceneWarning")
def test_memory_is_limited_from_python_too():
    with pytest.raises(InputError, match="memory"):
        rt.render(halves(), max_memory=1)


def test_what_is_checked_holds_the_options_alone():
    options = SceneOptions(halves(), spp=5, progress=print)
    _, checked = check_options(options.scene, options)
    assert not hasattr(checked, "scene")
    assert not hasattr(checked, "progress")


def test_options_stand_in_place_of_the_scenes():
    plain = halves(width=8, height=4, spp=16)
    spec, checked = check_options(plain, RenderOptions(spp=5, seed=7, threads=3, aovs="depth"))
    assert (spec.render.spp, spec.render.seed) == (5, 7)
    assert checked.window == Window(0, 0, 8, 4)
    assert (checked.max_spp, checked.is_adaptive, checked.threads, checked.aovs) == (5, False, 3, ("depth",))
    spec, checked = check_options(plain, RenderOptions(noise=0.1, aovs=["depth"]))
    assert (spec.render.spp, checked.max_spp, checked.is_adaptive, checked.aovs) == (16, None, True, ("depth",))
    assert check_options(plain, RenderOptions(time_limit=1.0, spp=5))[1].is_adaptive is False
    for given, limit in (
        ({}, 16),
        ({"noise": 0.1}, None),
        ({"time_limit": 1.0}, None),
        ({"noise": 0.1, "spp": 5}, 5),
        ({"time_limit": 1.0, "spp": 5}, 5),
    ):
        assert RenderOptions(**given).spp_limit(plain) == limit
