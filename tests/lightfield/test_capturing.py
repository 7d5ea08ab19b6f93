"""All views of an array into a file, in bounded memory: the bits of the picture of all views."""

import json
from pathlib import Path

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.film.light_field import lf
from raytracer.film.light_field.views import Plane, Views
from raytracer.lightfield.capturing.bands import ViewBand, split_into_bands
from raytracer.lightfield.capturing.capture import capture
from raytracer.rendering import worker_pool
from raytracer.rendering.render import render
from raytracer.scene.load import build
from raytracer.util.errors import InputError

# Of the type that tests/plugins/cameras/test_camera_array.py has, which is compiled once for both.
SCENE = """
camera: {{type: camera_array, look_from: [0, 0.5, 3], look_at: [0, 0.3, 0], vfov: 40, rows: 3, columns: 4,
  spacing: 0.1{camera}}}
film: {{width: 24, height: 20{film}}}
render: {{spp: 16, max_depth: 2, sampler: independent}}
environment: {{type: gradient, horizon: [1, 1, 1], zenith: [0.2, 0.4, 1.0]}}
objects:
  - {{type: quad, corner: [-5, 0, 5], edges: [[10, 0, 0], [0, 0, -20]], material: {{type: lambertian, albedo: 0.5}}}}
  - {{type: sphere, name: ball, center: [0, 0.4, 0], radius: 0.3, material: {{type: lambertian, albedo: 0.7}}}}
"""

VIEW_BYTES = 176 * 24 * 20
"""What one view of this size takes: its film twice, and 48 bytes a pixel to tell the error by."""


def scene(camera="", film=""):
    return build(SCENE.format(camera=camera, film=film), "test.yaml")


@pytest.fixture(scope="module")
def whole():
    return render(scene(), threads=2)


def views(rows, columns):
    return Views(position=np.zeros((rows, columns, 2)), plane=Plane(1.0, 0.0, 0.0), width=4, height=3)


@pytest.mark.parametrize("most", [1, 2, 3, 4, 5, 7, 8, 11, 12, 100])
@pytest.mark.parametrize("size", [(3, 4), (17, 17), (1, 9), (9, 1)])
def test_bands_hold_every_view_once_and_no_more_than_they_may(size, most):
    seen = np.zeros(size, dtype=int)
    bands = split_into_bands(views(*size), most)
    for band in bands:
        part = seen[band.row : band.row_end, band.column : band.column_end]
        part += 1
        assert 1 <= part.size <= most
        assert part.shape[1] == size[1] or part.shape[0] == 1
    assert np.all(seen == 1)


def test_bands_are_whole_rows_where_these_fit():
    assert split_into_bands(views(5, 4), 9) == [ViewBand(0, 1, 0, 4), ViewBand(1, 3, 0, 4), ViewBand(3, 5, 0, 4)]
    assert split_into_bands(views(2, 5), 3) == [
        ViewBand(0, 1, 0, 2),
        ViewBand(0, 1, 2, 5),
        ViewBand(1, 2, 0, 2),
        ViewBand(1, 2, 2, 5),
    ]


@pytest.mark.parametrize(("memory", "bands"), [(10**9, 1), (5 * VIEW_BYTES, 3), (VIEW_BYTES, 12)])
def test_views_rendered_in_parts_have_the_bits_of_the_picture_of_all(whole, tmp_path, memory, bands):
    path = tmp_path / "x.lf"
    seen = []
    captured = capture(scene(), path, memory=memory, dtype="float64", threads=2, progress=seen.append)
    assert captured.bands == bands
    assert captured.band_bytes <= memory
    expected = whole.image.layout.light_field(whole.image)
    with lf.open(path) as field:
        np.testing.assert_array_equal(np.asarray(field.radiance), expected.radiance)
        np.testing.assert_array_equal(field.views.position, expected.views.position)
        assert field.views.pose == expected.views.pose
        assert field.settings["samples"] == 16
        assert field.settings["camera"] == "camera_array"
        assert "crop" not in field.settings
        assert float(field.settings["relative_error"]) == pytest.approx(whole.stats.error["relative"], rel=0.05)

    # As of one render.
    assert captured.stats.rays == whole.stats.rays
    assert captured.stats.samples == whole.stats.samples
    assert captured.stats.spp == whole.stats.spp
    assert [each.done for each in seen] == sorted(each.done for each in seen)
    assert all(each.wanted == whole.stats.samples for each in seen)


def test_the_plane_that_an_object_lies_in_is_that_of_the_file(tmp_path):
    """3 m from the camera, as the middle of the ball is."""
    capture(scene(", focus_on: ball"), tmp_path / "x.lf", memory=5 * VIEW_BYTES, threads=2, spp=1)
    with lf.open(tmp_path / "x.lf") as field:
        assert field.views.focus_distance == pytest.approx(3.0, rel=1e-3)


@pytest.mark.parametrize(
    ("camera", "film", "memory", "message"),
    [
        ("", "", VIEW_BYTES // 2, "memory: must be at least what a view of 24 x 20 pixels takes, "),
        (", exposure: auto", "", 3 * VIEW_BYTES, "memory: camera.exposure measures the whole picture, for which "),
        ("", ", white_balance: auto", 3 * VIEW_BYTES, "film.white_balance: auto measures the whole picture"),
    ],
)
def test_what_does_not_fit_is_told_with_what_it_takes(tmp_path, camera, film, memory, message):
    with pytest.raises(InputError) as caught:
        capture(scene(camera, film), tmp_path / "x.lf", memory=memory)
    assert message in str(caught.value)
    assert " GB" in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["pinhole, ", "thin_lens, aperture: 20, "])
def test_one_view_is_no_light_field(tmp_path, kind):
    text = SCENE.format(camera="", film="").replace("camera_array, ", kind)
    text = text.replace(", rows: 3, columns: 4,\n  spacing: 0.1", "")
    with pytest.raises(InputError, match="of one view"):
        capture(build(text, "test.yaml"), tmp_path / "x.lf")


def test_an_interrupt_leaves_nothing(tmp_path):
    def interrupt(progress):
        if progress.done > 5 * 480 * 16:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        capture(scene(), tmp_path / "x.lf", memory=2 * VIEW_BYTES, threads=1, spp=2**14, progress=interrupt)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "array.yaml").write_text(SCENE.format(camera="", film=""))
    return tmp_path


def test_rt_lightfield_render(files, capsys):
    words = ["lightfield", "render", "array.yaml", "-o", "x.lf", "--memory", "0.4 MB", "--stats", "s.json"]
    assert main([*words, "--dtype", "float16", "--threads", "2", "--checkpoint", "off"]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    line = err.splitlines()[-1]
    assert line.startswith("x.lf: 4 x 3 views of 24 x 20, 16 spp in ")
    assert "in 3 parts, in at most " in line
    stats = json.loads((files / "s.json").read_text())
    assert stats["samples"] == 12 * 480 * 16
    with lf.open("x.lf") as field:
        assert field.radiance.dtype == np.float16
    # A checkpoint copies the film, which counts: 4 views of 107,520 bytes do not fit.
    assert main(words) == 0
    assert "in 6 parts, in at most " in capsys.readouterr().err
    assert main([*words, "-q"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["array.yaml", "-o", "x.png"], "x.png: a light field is written as .lf, such as x.lf"),
        (["array.yaml", "-o", "x.lf", "--memory", "much"], "--memory much: must be an amount of memory such as 2GB"),
        (["array.yaml", "-o", "x.lf", "--memory", "0 MB"], "--memory 0 MB: must be greater than 0"),
        (["array.yaml", "-o", "x.lf", "--dtype", "int8"], "--dtype int8: must be float16, float32, float64"),
        (["array.yaml", "-o", "x.lf", "--aov", "deep"], "unknown AOV 'deep'"),
        (["array.yaml", "-o", "array.yaml/x.lf"], "array.yaml"),
    ],
)
def test_wrong_use_is_one_sentence(files, capsys, words, message):
    assert main(["lightfield", "render", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not Path("x.lf").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "keys",
    [
        {"aovs": ("depth", "albedo")},
        {"camera": ", fill: true, focal_length: 20, iso: 100, shutter: 1, sensor: {format: full_frame, noise: true}"},
    ],
)
def test_layers_and_sensors_are_those_of_the_whole_picture(tmp_path, keys):
    spec = build(SCENE.format(camera=keys.get("camera", ""), film="").replace("vfov: 40, ", ""), "test.yaml")
    aovs = keys.get("aovs", ())
    image = render(spec, threads=2, aovs=aovs).image
    expected = image.layout.light_field(image)
    capture(spec, tmp_path / "x.lf", memory=15 * VIEW_BYTES, dtype="float64", threads=2, aovs=aovs)
    with lf.open(tmp_path / "x.lf") as field:
        np.testing.assert_array_equal(np.asarray(field.radiance), expected.radiance)
        assert set(field.layers) == set(aovs)
        for name in aovs:
            np.testing.assert_array_equal(np.asarray(field.layers[name]), expected.layers[name])


def test_broken_off_in_a_band_it_goes_on_there(tmp_path, monkeypatch):
    monkeypatch.setattr(worker_pool, "_POLL_SECONDS", 1e-3)
    path, spp = tmp_path / "x.lf", 256
    whole = render(scene(), threads=2, spp=spp)
    step, interrupts = whole.stats.samples // 4, 0

    def stop(progress):
        if progress.done >= (interrupts + 1) * step:
            raise KeyboardInterrupt

    while not path.exists():
        try:
            # Every band that is done is kept.
            keys = {"every": 1e-6, "resume": interrupts > 0}
            captured = capture(
                scene(), path, memory=5 * VIEW_BYTES, dtype="float64", threads=1, spp=spp, progress=stop, **keys
            )
        except KeyboardInterrupt:
            interrupts += 1
            assert interrupts < 10
            assert sorted(tmp_path.glob("x.lf.*.checkpoint"))
    assert interrupts >= 2
    with lf.open(path) as field:
        expected = whole.image.layout.light_field(whole.image)
        np.testing.assert_array_equal(np.asarray(field.radiance), expected.radiance)
    assert captured.stats.samples == whole.stats.samples
    assert captured.stats.rays == whole.stats.rays
    assert captured.stats.resumed["samples"] > 0
    assert list(tmp_path.iterdir()) == [path]


def test_pixels_below_zero_are_counted_over_all_bands(tmp_path, monkeypatch):
    places = []

    def find(values, causes, left, top):
        places.append([left, top])
        return 2, {"lowest": -float(len(places)), "pixel": [left, top], "causes": ["filter"]}

    monkeypatch.setattr("raytracer.rendering.session.find_negative_pixels", find)
    captured = capture(scene(), tmp_path / "x.lf", memory=5 * VIEW_BYTES, threads=2, spp=1)
    assert captured.bands == len(places) > 1
    assert captured.stats.negative_pixels == 2 * len(places)
    assert captured.stats.negative == {"lowest": -float(len(places)), "pixel": places[-1], "causes": ["filter"]}
