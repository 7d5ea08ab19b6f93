"""`rt lightfield info`, `import` and `export`, and `rt render -o X.lf`: what they print, write and refuse."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.layout import NO_LIGHT_FIELD_MESSAGE
from raytracer.film.light_field.posed_field import PosedLightField
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.film.light_field.views import Plane, Views
from raytracer.plugins.cameras.base.interface import CameraSpec
from raytracer.schema.registry import CAMERAS
from tests.lightfield.test_capturing import SCENE as ARRAY

SCENE = """\
camera: {type: CAMERA, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 40KEYS}
film: {width: 12, height: 9}
render: {spp: 4, max_depth: 2}
environment: {type: constant, radiance: [1, 2, 3]}
objects: [{type: sphere, center: [0, 0, 0], radius: 0.5, material: {type: lambertian, albedo: [0.5, 0.5, 0.5]}}]
"""


@pytest.fixture
def file(here):
    position = np.array([[[-0.01, 0.0], [0.01, 0.0]]])
    views = Views(position, Plane(0.01, -0.04, 0.03), 8, 6, 0.4)
    lf.write("a.lf", LightField(np.full((1, 2, 6, 8, 3), 0.5), views, settings={"spp": 4}))
    return "a.lf"


def test_info(file, rt):
    printed = rt("lightfield info a.lf --check").out
    assert "2 x 1, each 8 x 6 pixels" in printed
    assert "20 mm to the right" in printed
    assert "focus distance  2.5 m" in printed
    # A pixel is 0.01, views are 0.02 m apart: 1/m to either side of 0.4/m moves what is there by 2 pixels.
    assert "1.111 m to infinity" in printed

    found = json.loads(rt("lightfield info a.lf --json").out)
    assert (found["rows"], found["columns"], found["width"], found["height"]) == (1, 2, 8, 6)
    assert found["spacing"] == [0.02, 0.0]
    assert found["refocus_far"] == "inf"
    assert found["file_bytes"] == os.path.getsize(file)
    assert found["settings"] == {"spp": 4}


def test_info_reads_all_if_asked_to(file, rt, refused):
    data = bytearray(Path(file).read_bytes())
    data[data.find(np.float32(0.5).tobytes() * 8)] ^= 1
    Path(file).write_bytes(data)
    rt("lightfield info a.lf")
    assert refused("lightfield info a.lf --check") == "rt: a.lf: radiance is damaged\n"


def test_export_and_import(file, rt):
    assert rt("lightfield export a.lf -o views --format exr").err == "wrote 3 files to views\n"
    assert sorted(os.listdir("views")) == ["geometry.json", "view_00_00.exr", "view_00_01.exr"]
    assert rt("lightfield import views -o b.lf").err == "wrote b.lf\n"
    a, b = lf.open("a.lf"), lf.open("b.lf")
    assert np.array_equal(a.radiance, b.radiance)
    assert np.array_equal(a.views.position, b.views.position)

    assert rt("lightfield export a.lf -o a.npy --quiet").err == ""
    assert rt("lightfield import a.npy -o c.lf --quiet --dtype float16 --compress").err == ""
    assert np.array_equal(lf.open("c.lf").radiance, a.radiance)


def test_metres_on_the_command_line(file, rt):
    rt("lightfield export a.lf -o views --quiet")
    os.remove("views/geometry.json")
    assert "metres are not known" in rt("lightfield import views -o b.lf").err
    assert "not known in metres" in rt("lightfield info b.lf").out
    lengths = "--spacing 2cm,3cm --focus-distance inf --focal-length 50mm --sensor 36mm"
    rt(f"lightfield import views -o b.lf {lengths}")
    found = lf.open("b.lf").views
    assert found.position[0, 1, 0] - found.position[0, 0, 0] == pytest.approx(0.02)
    assert found.inverse_focus == 0.0
    assert found.plane.pixel == pytest.approx(36.0 / 50.0 / 8.0)


def test_what_is_too_bright_is_said(here, rt):
    radiance = np.zeros((1, 1, 2, 2, 3))
    radiance[0, 0, 0, 0] = 2.0
    lf.write("a.lf", LightField(radiance, Views(np.zeros((1, 1, 2)), Plane(0.1, 0.0, 0.0), 2, 2)))
    said = rt("lightfield export a.lf -o views").err
    assert "25.0 % of the values are brighter than 1 and were clipped: --format exr keeps them" in said


def test_a_render_is_a_light_field(here, rt):
    Path("array.yaml").write_text(ARRAY.format(camera="", film=""))
    rt("render array.yaml -o a.lf -o a.npy --aov samples --spp 4 --quiet")
    found, picture = lf.open("a.lf"), np.load("a.npy")
    for r in range(3):
        for c in range(4):
            part = picture[20 * r : 20 * r + 20, 24 * c : 24 * c + 24]
            assert np.array_equal(found.radiance[r, c], part.astype(np.float32))
    assert np.array_equal(found.layers["samples"], np.full((3, 4, 20, 24), 4))
    assert found.settings["camera"] == "camera_array"


@pytest.mark.parametrize(
    ("camera", "keys", "options"),
    [
        ("pinhole", "", ""),
        ("thin_lens", ", focus_distance: 3, aperture: 0.1", ""),
        ("camera_array", ", rows: 2, columns: 3, spacing: 0.1", "--crop 0,0,12,9"),
    ],
)
def test_a_picture_of_one_view_is_refused_before_it_is_rendered(camera, keys, options, here, refused):
    Path("scene.yaml").write_text(SCENE.replace("CAMERA", camera).replace("KEYS", keys))
    assert refused(f"render scene.yaml -o a.lf {options}") == (
        "rt: a.lf: the picture is of one view, or a part of one, and no light field: render the whole picture of a "
        "camera_array, light_slab, camera_sphere, camera_box or light_field, or of a thin_lens with the AOV rays\n"
    )


def test_all_cameras_of_many_views_are_named_where_there_is_one():
    kinds = [kind for kind, spec in CAMERAS.specs().items() if spec.layout is not CameraSpec.layout]
    assert "camera_box" in kinds
    assert [kind for kind in kinds if kind not in NO_LIGHT_FIELD_MESSAGE] == []


@pytest.mark.parametrize("command", ["render", "lightfield render"])
def test_microlenses_that_are_larger_than_the_film_are_what_leaves_no_views(command, here, refused):
    keys = ", focus_distance: 3, focal_length: 50, f_number: 2, microlenses: {pixels: 1000}"
    Path("scene.yaml").write_text(SCENE.replace("CAMERA", "light_field").replace(", vfov: 40KEYS", keys))
    assert refused(f"{command} scene.yaml -o a.lf") == (
        "rt: a.lf: the picture of 12 x 9 pixels has no room for sub-images of 1000 pixels side by side, and so holds "
        "no views: give a film with more pixels, or smaller microlenses\n"
    )


def test_other_layouts_by_name_and_by_option(file, rt):
    """Each is taken back: the light field is of one value, which no format changes by more than its steps."""
    outputs = {
        "a_qs2x1a1.3333.png": ("", ""),
        "m.exr": ("--layout mosaic", "--rows 1 --columns 2"),
        "i.png": ("--layout interleaved --bits 16 --memory 1MB", "--rows 1 --columns 2 --interleaved"),
        "v.exr": ("", ""),
        "t": ("--layout transforms --format npy", ""),
        "h": ("--naming hci --bits 16", ""),
    }
    a = lf.open(file)
    for output, (exporting, importing) in outputs.items():
        said = rt(f"lightfield export a.lf -o {output} {exporting}").err
        assert said.startswith("wrote ")
        assert "note" not in said
        assert "note" not in rt(f"lightfield import {output} -o b.lf {importing}").err
        b = lf.open("b.lf")
        assert np.allclose(b.radiance[:], a.radiance[:], rtol=0.0, atol=0.003), output
        assert np.allclose(b.views.position, a.views.position, rtol=0.0, atol=1e-14), output
        assert b.views.inverse_focus == pytest.approx(0.4, abs=1e-12), output
        b.close()


def test_a_quilt_for_a_display(file, rt, refused):
    said = rt("lightfield export a.lf -o q.png --device portrait --size 64x60 --convergence 2m").err
    assert "wrote q_qs8x6a0.75.png\nwrote q_qs8x6a0.75.geometry.json\nnote: views are cropped by " in said
    rt("lightfield import q_qs8x6a0.75.png -o q.lf")
    views = lf.open("q.lf").views
    assert (views.rows, views.columns, views.width, views.height) == (1, 48, 8, 10)
    assert views.focus_distance == pytest.approx(2.0)
    assert np.ptp(views.position[0, :, 0]) == pytest.approx(0.02)
    assert refused("lightfield export q.lf -o a.png --device portrait --baseline 1m") == (
        "rt: a.png: a baseline of 1 m is wider than that of the views, 0.02 m\n"
    )


def test_cameras_anywhere_go_out_and_come_back(here, rt, refused):
    turned = np.array(
        [[[0.0, 0, 2], [1, 0, 0], [0, 1, 0], [0, 0, -1]], [[2.0, 0, 0], [0, 0, -1], [0, 1, 0], [-1, 0, 0]]]
    )
    views = PosedViews(turned[None], np.broadcast_to([0.1, -0.2, 0.15], (1, 2, 3)), 4, 3)
    field = PosedLightField(np.random.default_rng(0).random((1, 2, 3, 4, 3), np.float32), views)
    lf.write("a.lf", field)
    assert "wrote 3 files to t" in rt("lightfield export a.lf -o t --layout transforms --format exr").err
    rt("lightfield import t -o b.lf")
    found = lf.open_posed("b.lf")
    assert np.array_equal(found.radiance[:], field.radiance)
    assert np.allclose(found.views.pose, views.pose, rtol=0.0, atol=1e-15)
    said = refused("lightfield export a.lf -o views")
    assert said == "rt: views: views have poses of their own, which grid cannot tell: export as transforms\n"
