"""The plan tells of every effect and of every setting."""

from pathlib import Path

from raytracer.analysis.cost.study import plan
from raytracer.scene.effects import effects_of
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from raytracer.scene.render_settings import Render

SCENES = Path(__file__).parents[3] / "scenes"


def test_every_effect_is_in_it_once_with_its_reason():
    packed = pack(load(SCENES / "smoke.yaml"))
    effects = effects_of(packed.spec, packed.scene)
    items = plan(packed.spec, packed)
    told = {item.name: item for item in items if item.group != "setting"}
    assert set(told) == set(effects)
    for name, effect in effects.items():
        assert told[name].group == ("simulated" if effect.active else "left out")
        assert told[name].why.startswith(effect.why)
    assert len({(item.group, item.name) for item in items}) == len(items)
    # It says what no variant can leave out.
    assert "all the light that there is" in told["material.emitter"].why
    assert "no variant" not in told["media"].why


def test_every_setting_is_told_with_its_value():
    packed = pack(load(SCENES / "cornell.yaml", {"render.spp": 123, "render.sampler": "stratified"}))
    settings = {item.name: item.why for item in plan(packed.spec, packed) if item.group == "setting"}
    assert set(settings) == {*Render.model_fields, "film", "filter"}
    assert settings["spp"].startswith("123 samples")
    assert settings["sampler"].startswith("stratified: ")
    assert settings["film"].startswith("600 x 600 pixels")
    assert settings["filter"].startswith("box: ")
    assert not any("{" in why for why in settings.values())
