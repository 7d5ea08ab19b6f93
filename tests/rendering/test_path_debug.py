"""The logged path of one sample: it is the sample of the picture, and its values add up."""

import json
import math
import shlex
from pathlib import Path

import numpy as np
import pytest

import raytracer.rendering.render
from raytracer.cli.base.app import main
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.path_debug import trace_sample
from raytracer.rendering.path_text import format_path
from raytracer.rendering.render import render
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import InputError
from tests.hard_cases.accumulation import poisoned
from tests.small_scenes import scene, scene_text

ROOM = """
camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 0.25}
materials:
  clay: {type: lambertian, albedo: [0.8, 0.6, 0.4]}
objects:
  - {name: floor, type: quad, corner: [-9, -1, 9], edges: [[18, 0, 0], [0, 0, -18]], material: clay}
  - {name: ball, type: sphere, center: [0, 0, 0], radius: 1, material: clay}
  - {name: glass, type: sphere, center: [0.6, 0, 2], radius: 0.5, material: {type: dielectric}}
  - {name: shade, type: disc, center: [0, 2, 0], normal: [0, 1, 0], radius: 0.5, material: {type: metal}}
  - {name: lamp, type: quad, corner: [-1, 3, 1], edges: [[0, 0, -2], [2, 0, 0]], material: {type: emitter, radiance: 9}}
"""

SPP = 12
"""Samples of a pixel: a whole packet, and half of one."""

SETTINGS = {"spp": SPP, "rr_depth": 3, "lit": True}


def traced(pixel, *given):
    return trace_sample(scene(ROOM, **SETTINGS), pixel, *given)


def vertices(found, kind):
    return [event for event in found.events if event["event"] == kind]


def objects(found):
    return [event["object"] for event in vertices(found, "surface")]


@pytest.fixture(scope="module")
def traces():
    """All samples of a pixel that sees the ball under the shade, and of one that sees the floor through the glass."""
    return [traced(pixel, sample) for pixel in ((8, 6), (13, 12)) for sample in range(SPP)]


def test_they_are_the_samples_of_the_picture(traces):
    picture = render(scene(ROOM, **SETTINGS), threads=1).image.radiance
    for x, y in ((8, 6), (13, 12)):
        values = np.array([found.value for found in traces if found.pixel == (x, y)])
        # The same sums in the same order: of each packet, and of the one after it.
        first, second = values[:8].sum(axis=0) / 8.0, values[8:].sum(axis=0) / 4.0
        np.testing.assert_array_max_ulp(picture[y, x], first + (second - first) * (4.0 / 12.0), maxulp=2)
    assert len({found.value for found in traces}) > SPP


def test_what_is_gathered_adds_up(traces):
    for found in traces:
        total, throughput = np.zeros(3), np.ones(3)
        for event in found.events:
            if event["event"] == "emits":
                total += event["mis_weight"] * throughput * event["emitted"]
            elif event["event"] == "leaves":
                np.testing.assert_allclose(event["throughput"], throughput, rtol=1e-14)
                total += throughput * event["background"]
            elif event["event"] == "arrives":
                total += event["brings"]
            elif event["event"] == "surface":
                np.testing.assert_allclose(event["throughput_before"], throughput, rtol=1e-14)
                assert event["throughput"] == event["throughput_before"]
            elif event["event"] == "scatters" and event["survival"] > 0.0:
                throughput = throughput * event["weight"] / event["survival"]
            np.testing.assert_allclose(event["gathered"], total, rtol=1e-13, atol=1e-15)
        np.testing.assert_allclose(found.value, total, rtol=1e-13)
        assert found.first_non_finite is None


def test_rays_start_where_the_path_was_and_end_where_it_goes_on(traces):
    for found in traces:
        (start,) = vertices(found, "camera")
        assert start["origin"] == [0.0, 1.0, 4.0]
        place, direction = np.array(start["origin"]), start["direction"]
        for event in found.events:
            if event["event"] == "surface":
                assert event["direction"] == direction
                # Float32 knows the distance to some 1e-6 of it.
                far = np.array(event["origin"]) + event["distance"] * np.array(direction)
                np.testing.assert_allclose(event["point"], far, atol=1e-4)
                np.testing.assert_allclose(event["origin"], place, atol=1e-4)
                place = np.array(event["point"])
            elif event["event"] == "scatters":
                direction = event["direction"]
                assert math.isclose(math.hypot(*direction), 1.0, rel_tol=1e-12)


def test_objects_materials_and_what_is_in_the_way_of_light_have_their_names(traces):
    met = [vertex for found in traces for vertex in vertices(found, "surface")]
    names = {(vertex["object"], vertex["material"], vertex["shown"]) for vertex in met}
    expected = {("ball", "clay", "lambertian"), ("floor", "clay", "lambertian")}
    assert names >= {*expected, ("glass", "objects[2].material", "dielectric")}
    # In by the front, and against the inside.
    through = [vertices(found, "surface") for found in traces if objects(found)[:2] == ["glass"] * 2]
    assert through
    assert all([vertex["side"] for vertex in met[:2]] == ["front", "back"] for met in through)
    assert {"shade", "ball"} & {event["object"] for found in traces for event in vertices(found, "blocked")}
    for found in traces:
        aimed = None
        for event in found.events:
            if event["event"] == "aims":
                aimed = event
            elif event["event"] == "arrives":
                assert event["brings"] == aimed["brings"]
            elif event["event"] == "blocked":
                assert 0.0 < event["distance"] < aimed["distance"]


def test_which_sample_is_traced(traces):
    # Without a number, the brightest.
    seen = [found for found in traces if found.pixel == (8, 6)]
    assert traced((8, 6)).sample == max(seen, key=lambda found: sum(found.value)).sample
    # One beyond the last is what more would bring; that of another seed is another.
    assert traced((8, 6), 13).value == traced((8, 6), 13, RenderOptions(spp=16)).value
    assert traced((8, 6), 13).value != traced((8, 6), 13, RenderOptions(seed=9)).value
    for pixel in ((16, 0), (0, 16), (-1, 3)):
        with pytest.raises(InputError, match=r"must lie within the film, from 0,0 to 15,15"):
            traced(pixel, 0)


def test_what_a_clamp_leaves_is_what_a_sample_adds(traces):
    # As if a clamp had left a half of it.
    found = traces[0]
    last = {**found.events[-1], "value": [0.5 * value for value in found.value]}
    half, whole = (f"({', '.join(f'{scale * value:.9g}' for value in found.value)})" for scale in (0.5, 1.0))
    told = format_path(found._replace(events=[*found.events[:-1], last]))
    assert told.endswith(f"gathered {whole}, times 1 is {whole}; after the clamp it adds {half}\n")
    assert "clamp" not in format_path(found)


def test_text_counts_the_rays_and_tells_the_vertices_in_order(traces):
    for found in traces:
        told = format_path(found)
        x, y = found.pixel
        assert told.startswith(f"pixel {x},{y} sample {found.sample}: ")
        places = [told.index(f"ray {number} meets {name} ") for number, name in enumerate(objects(found), 1)]
        assert places == sorted(places)
        assert "nan" not in told
        # Of the path and not of its packet.
        count = len(places) + len(vertices(found, "leaves"))
        assert f": {count} ray{'s' * (count > 1)} long, " in told
    # Some paths of a packet are longer than others.
    assert any(found.events[-1]["round"] > found.events[-2]["round"] for found in traces)


@pytest.fixture
def file(tmp_path, monkeypatch):
    """The room as a file, with a clay that is not a number."""

    def pack_poisoned(spec, **settings):
        return poisoned(pack(spec, **settings), "lambertian")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(raytracer.rendering.render, "pack", pack_poisoned)
    monkeypatch.setattr(raytracer.rendering.path_debug, "pack", pack_poisoned)
    # Specks such as nobody warns of.
    text = scene_text(ROOM, **SETTINGS).replace("1.0e-9", "0.1").replace("1.0e-30", "1")
    Path("my room.yaml").write_text(text)
    return "my room.yaml"


def test_what_is_not_finite_is_reported_as_a_command_that_shows_it(file, capsys):
    words = ["render", file, "-D", "render.seed=4", "--spp", "10", "-q", "-o", "a.npy", "--crop", "2,3,16,16"]
    assert main([*words, "--stats", "a.json", "--threads", "2"]) == 0
    stats = json.loads(Path("a.json").read_text())
    (x, y), sample = stats["first_nan"]["pixel"], stats["first_nan"]["sample"]
    told, _, command = capsys.readouterr().err.strip().partition("; this shows the first one: ")
    assert told == f"rt: {stats['nan_samples']} samples were not finite and were dropped"
    assert command == (f"rt render 'my room.yaml' -D render.seed=4 --spp 10 --pixel {x},{y} --sample {sample} --debug")
    assert np.isfinite(np.load("a.npy")).all()
    # That command shows a path which is not finite, and none before it in the row is.
    again = shlex.split(command)[1:]
    assert main(again) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"pixel {x},{y} sample {sample}: ")
    assert "which is not finite, so it was dropped" in out
    assert out.count("^ not finite from here on: ") == 1
    assert main([*again, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    # The albedo is where it begins.
    assert found["events"][found["first_not_finite"]]["event"] in {"aims", "scatters"}
    assert "nan" in found["value"]
    assert all(not event["not_finite"] for event in found["events"][: found["first_not_finite"]])
    assert main([*again[:-3], "--debug"]) == 0
    assert f"sample {sample}: " in capsys.readouterr().out
    # Under --strict it is a failure.
    assert main([*words, "--strict"]) == 1
    assert command in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("--debug", "--debug needs --pixel X,Y, the pixel whose path it is to print"),
        ("--pixel 3,4", "--pixel needs --debug, which prints the path of one sample"),
        ("--sample 3", "--sample needs --debug, which prints the path of one sample"),
        ("--pixel 3 --debug", "--pixel 3: must be two integers, X,Y"),
        ("--pixel a,b --debug", "--pixel a,b: must be two integers, X,Y"),
        ("--pixel 3,99 --debug", "pixel 3,99 must lie within the film, from 0,0 to 15,15"),
    ],
)
def test_options_that_make_no_sense(options, sentence, file, capsys):
    assert main(["render", file, *options.split()]) == 2
    assert capsys.readouterr() == ("", f"rt: {sentence}\n")
