"""The shipped lenses do what their files say: the f-number, sharpness on the axis, the picture that they cover."""

import re

import numpy as np
import pytest

from raytracer.optics.glass import LINE_C, LINE_D, LINE_F
from raytracer.optics.lens_system.first_order import cardinal_points, entrance_pupil
from raytracer.optics.lens_system.focusing import film_position
from raytracer.optics.lens_system.lens_setup import widest_f_number
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.scene.assets.lenses import read_lens
from tests.repository import ROOT, SCENES

SHIPPED = {path.stem: path for path in sorted((SCENES / "lenses").glob("*.yaml"))}

# Lenses of one glass, or for the axis only, that are there for their faults.
SINGLE = ("plano-convex-100mm", "flint-100mm", "hyperbolic-100mm")

every_lens = pytest.mark.parametrize("path", SHIPPED.values(), ids=list(SHIPPED))


def rays_from_film(lens, film, place, count):
    """Rays (n, 3) from a point of the film to a grid over the last surface, away from the film."""
    packed = lens.packed()
    steps = np.linspace(-1.0, 1.0, count) * packed.radius[-1]
    x, y = (values.ravel() for values in np.meshgrid(steps, steps))
    targets = np.stack([x, y, np.full(len(x), packed.vertex[-1])], axis=1)
    origins = np.broadcast_to(np.array([*place, film]), targets.shape).copy()
    ways = targets - origins
    return origins, ways / np.linalg.norm(ways, axis=1, keepdims=True)


@every_lens
def test_the_numbers_of_the_file_are_those_which_light_finds(path):
    lens = read_lens(path)
    assert lens.source
    assert widest_f_number(lens) == pytest.approx(lens.f_number, rel=0.015)
    # What is anamorphic has its published length in the direction that it does not squeeze.
    lengths = [cardinal_points(lens.packed(), axis).focal_length for axis in "xy"]
    assert pytest.approx(lens.focal_length, rel=0.005) in lengths


@every_lens
def test_light_reaches_the_whole_picture(path):
    lens = read_lens(path)
    film, edge = film_position(lens), 0.5 * lens.image_circle
    packed = lens.packed()
    for place in ((0.0, 0.0), (0.0, edge), (0.6 * edge, 0.8 * edge)):
        weights, _, _ = trace_rays(packed, *rays_from_film(lens, film, place, 161), towards_film=False)
        assert (weights > 0.0).any(), place


@every_lens
def test_the_middle_is_sharp(path):
    """Light of the axis at two stops below the widest is within a circle of a thousandth of the focal length."""
    lens = read_lens(path)
    if path.stem in SINGLE:
        pytest.skip("it is there for its faults")
    radius = 0.5 * lens.elements[lens.stop()].radius
    film = film_position(lens, stop_radius=radius)
    packed = lens.packed(stop_radius=radius)
    steps = np.linspace(-1.0, 1.0, 41) * entrance_pupil(packed).radius
    x, y = (values.ravel() for values in np.meshgrid(steps, steps))
    origins = np.stack([x, y, np.full(len(x), -1.0)], axis=1)
    weights, points, ways = trace_rays(packed, origins, np.broadcast_to((0.0, 0.0, 1.0), origins.shape).copy())
    through = weights > 0.0
    assert through.sum() > 20
    behind = (film - points[through, 2]) / ways[through, 2]
    landed = points[through, :2] + behind[:, None] * ways[through, :2]
    focal_length = abs(cardinal_points(packed).focal_length)
    assert np.hypot(*landed.T).max() < 1e-3 * focal_length / 2.0


@every_lens
def test_colours_come_together(path):
    """Between the lines F and C the focus moves by less than a third of what it does for a single lens: f / V."""
    lens = read_lens(path)
    if path.stem in (*SINGLE, "phone-3.7mm"):
        pytest.skip("it is of one glass, or leaves colour to the program of the phone")
    places = []
    for line in (LINE_F, LINE_D, LINE_C):
        packed = lens.packed(line)
        places.append(cardinal_points(packed).rear_focus - packed.vertex[-1])
    assert lens.disperses()
    assert max(places) - min(places) < abs(cardinal_points(lens.packed()).focal_length) / 60.0 / 3.0


def test_the_anamorphic_squeezes_by_two_and_is_sharp_both_ways():
    lens = read_lens(SHIPPED["anamorphic-75mm"])
    packed = lens.packed()
    up, across = (cardinal_points(packed, across=axis) for axis in ("y", "x"))
    assert up.focal_length / across.focal_length == pytest.approx(2.0, rel=1e-3)
    # The film is as far off for one as for the other, within the depth of focus 2 N c of c = 0.01 mm at f/2.
    assert up.rear_focus == pytest.approx(across.rear_focus, abs=2.0 * 2.0 * 0.01)


def test_the_double_gauss_is_that_of_the_patent():
    # Its focal length is 1 and its back focus 0.71436 there, scaled by 50.
    packed = read_lens(SHIPPED["double-gauss-50mm"]).packed()
    found = cardinal_points(packed)
    assert found.focal_length == pytest.approx(50.0, rel=2e-4)
    assert found.rear_focus - packed.vertex[-1] == pytest.approx(50.0 * 0.71436, abs=5e-3)


def test_the_achromat_has_the_back_focus_of_its_data_sheet():
    # 97.1 mm, where light of the pupil's half comes together.
    lens = read_lens(SHIPPED["achromat-100mm"])
    assert film_position(lens) - lens.packed().vertex[-1] == pytest.approx(97.1, abs=0.05)


ROW = re.compile(r"^\| \[([\w.-]+)\]\(\S+\) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", re.MULTILINE)
TABLE = ROW.findall((ROOT / "docs" / "lenses.md").read_text(encoding="utf-8"))


KINDS = ("double-gauss", "wide", "telephoto", "fisheye", "triplet", "achromat", "plano-convex", "phone", "anamorphic")


def test_the_documentation_has_lenses_of_all_kinds():
    assert [kind for kind in KINDS if not any(kind in name for name, *_ in TABLE)] == []


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row[0])
def test_the_documentation_has_the_numbers_of_the_lenses(row):
    name, focal_length, f_number, image_circle = row
    lens = read_lens(SHIPPED[name])
    assert f"{cardinal_points(lens.packed()).focal_length:.2f}" == focal_length
    assert f"{widest_f_number(lens):.2f}" == f_number
    assert f"{lens.image_circle:g}" == image_circle
