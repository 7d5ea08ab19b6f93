"""The options of a render: one list of them for the record, the keywords and the signatures."""

import inspect
from dataclasses import fields
from typing import Any

import pytest

import raytracer as rt
from raytracer.film.window import Window
from raytracer.rendering.options import RenderKeywords, RenderOptions, check_options
from tests.small_scenes import scene

_SPHERE = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}
"""


def test_keywords_are_the_fields_of_the_options() -> None:
    names = [field.name for field in fields(RenderOptions)]
    assert [*RenderKeywords.__annotations__, "max_memory"] == names


def test_help_shows_all_keywords_with_their_defaults() -> None:
    parameters = inspect.signature(rt.render).parameters
    own = ["progress", "cache", "stock", "cluster", "checkpoint", "resume"]
    assert list(parameters) == ["scene", *RenderKeywords.__annotations__, *own]
    for field in fields(RenderOptions):
        if field.name in parameters:
            assert parameters[field.name].default == field.default
    assert all(parameter.kind is inspect.Parameter.KEYWORD_ONLY for parameter in list(parameters.values())[1:])


@pytest.mark.parametrize("name", ["nope", "max_memory", "dry_run_save"])
def test_other_keywords_are_refused(name: str) -> None:
    settings: dict[str, Any] = {name: None}
    with pytest.raises(TypeError, match=f"unexpected keyword argument '{name}'"):
        rt.render(scene(_SPHERE), **settings)


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
