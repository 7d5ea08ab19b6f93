"""The lens camera with other features: crops, noise limits, layers, shutters, media, sweeps, bundles, files."""

import shutil

import numpy as np
import pytest

from raytracer.rendering.render import render
from raytracer.scene.bundle import bundle, unbundle
from raytracer.scene.digest import digest
from raytracer.scene.load import build, load
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import SceneError
from tests.repository import SCENES

LENS = SCENES / "lenses" / "double-gauss-50mm.yaml"

CAMERA = (
    "type: lens, lens: LENS, look_from: [0, 0, 0], look_at: [0, 0, -1], sensor: full_frame, f_number: 4, "
    "focus_distance: 4"
)
"""At the origin, looking along -z, so that depths are distances along -z."""

SHINING_WALL = """\
  - {type: quad, corner: [-9, -9, -4], edges: [[18, 0, 0], [0, 18, 0]],
     material: {type: emitter, radiance: {type: checker, scale: 0.3, even: [0.1, 0.4, 0.7], odd: 1}}}
"""


def text(camera="", objects=SHINING_WALL, rest="", **render):
    settings = {"spp": 16, "max_depth": 1, "sampler": "sobol", **render}
    return (
        f"camera: {{{CAMERA}{camera}}}\nfilm: {{width: 24, height: 16}}\n"
        f"render: {{{', '.join(f'{key}: {value}' for key, value in settings.items())}}}\n{rest}objects:\n{objects}"
    ).replace("LENS", f"'{LENS}'")


def scene(*arguments, **keys):
    return build(text(*arguments, **keys), "test.yaml")


def taken(spec, **settings):
    result = render(spec, threads=2, seed=3, **settings)
    assert result.stats.nan_samples == 0
    return result


def test_a_bundle_takes_the_lens_along(tmp_path):
    folder = tmp_path / "home"
    folder.mkdir()
    shutil.copy(LENS, folder / "glass.yaml")
    (folder / "scene.yaml").write_text(text().replace(f"'{LENS}'", "glass.yaml"), encoding="utf-8")
    spec = load(folder / "scene.yaml")
    expected, rays = digest(spec), pack(spec).scene.camera
    packed = bundle(spec)
    shutil.rmtree(folder)
    there = unbundle(packed, tmp_path / "there")
    assert digest(there) == expected
    again = pack(there).scene.camera
    np.testing.assert_array_equal(again.surfaces.curvature, rays.surfaces.curvature)
    assert again.frame == rays.frame


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("LENS", "nowhere.yaml", "camera.lens.*there is no file 'nowhere.yaml'"),
        ("f_number: 4", "f_number: 1", r"camera.f_number.*f/1.*widest|camera.f_number.*f/2"),
        ("f_number: 4", "f_number: 0", "camera.f_number"),
        ("focus_distance: 4", "focus_distance: 0.05", "camera.focus_distance.*nearest"),
        ("focus_distance: 4", "focus_distance: -1", "camera.focus_distance"),
        ("focus_distance: 4", "focus_distance: 4, focus_at: [0.5, 0.5]", "camera.focus_"),
        ("focus_distance: 4", "focus_distance: 4, focus: sharp", "camera.focus"),
        ("focus_distance: 4", "focus_distance: 4, flare: 3", "camera.flare"),
        ("focus_distance: 4", "focus_distance: 4, focal_length: 50", "camera.focal_length"),
    ],
)
def test_what_no_lens_can_do_is_told_by_its_key(old, new, words):
    broken = text().replace(f"'{LENS}'", "LENS").replace(old, new).replace("LENS", f"'{LENS}'")
    with pytest.raises(SceneError, match=words) as caught:
        pack(build(broken, "test.yaml"))
    assert "test.yaml:1:" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("how", ["focus_on: ball", "focus_at: [0.5, 0.5]"])
def test_focus_on_what_is_there(how):
    objects = "  - {type: sphere, name: ball, center: [0, 0, -3], radius: 0.5}\n"
    spec = build(text("", objects).replace("focus_distance: 4", how), "test.yaml")
    expected = 3.0 if "on" in how else 2.5
    assert pack(spec).spec.camera.focus_distance == pytest.approx(expected, abs=1e-6)


def test_crops_and_threads_take_the_same_samples():
    spec = scene(spp=32)
    whole = taken(spec).image
    part = taken(spec, crop=(5, 3, 20, 14)).image
    np.testing.assert_array_equal(part.radiance, whole.radiance[3:14, 5:20])
    alone = render(spec, threads=1, seed=3).image
    np.testing.assert_array_equal(alone.radiance, whole.radiance)
    assert 0.05 < whole.radiance.mean() < 1.0
