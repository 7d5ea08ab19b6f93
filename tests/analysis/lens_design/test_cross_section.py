"""Drawings: surfaces are where the lens has them, and rays go as rays do."""

import math
import xml.etree.ElementTree as ET
from itertools import combinations, groupby, pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from raytracer.analysis.lens_design.cross_section.drawing import (
    build_cross_section,
    cross_sections,
    stack_labels,
    trace_fan,
)
from raytracer.analysis.lens_design.cross_section.outlines import Cubic, Line, reversed_pieces, surface_outline
from raytracer.analysis.lens_design.cross_section.plot import figure_of, names_of
from raytracer.analysis.lens_design.performance.first_order import first_order
from raytracer.analysis.lens_design.performance.optical_bench import set_up_bench
from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.lens import Element
from raytracer.report.figure import ON_PAPER, style, to_svg
from raytracer.scene.assets.lenses import read_lens
from tests.analysis.lens_design.benches import SHIPPED, lens_of, plano_convex, shipped, symmetric_lens

GLASS = constant_index_glass(1.5)
SVG = "{http://www.w3.org/2000/svg}"


def points_of(start, pieces):
    t = np.linspace(0.0, 1.0, 21)[:, None]
    found = []
    for cubic in pieces:
        a, b, c, d = (np.array(point) for point in (start, *cubic))
        found.append((1 - t) ** 3 * a + 3 * t * (1 - t) ** 2 * b + 3 * t**2 * (1 - t) * c + t**3 * d)
        start = cubic.end
    return np.concatenate(found)


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"kind": "spherical"}, 1e-6),
        ({"kind": "spherical", "curvature": -1.0 / 35.0}, 1e-6),
        ({"conic": -0.6}, 1e-5),
        ({"conic": -1.0}, 1e-5),
        ({"conic": -2.25}, 1e-5),
        ({"conic": 3.0}, 1e-5),
        ({"conic": -1.0, "coefficients": (3e-5, -2e-8)}, 1e-5),
        ({"coefficients": (1e-5, 1e-8, -1e-11)}, 1e-5),
    ],
)
def test_points_of_a_curve_lie_on_the_surface(changes, error):
    surface = Element(0.02, 1.0, GLASS, 18.0, kind="asphere")._replace(**changes)
    start, pieces = surface_outline(surface, -4.0, 18.0)
    assert [start[1], pieces[-1].end[1]] == pytest.approx([-18.0, 18.0])
    points = points_of(start, pieces)
    expected = [-4.0 + float(surface.sag(0.0, height)) for height in points[:, 1]]
    np.testing.assert_allclose(points[:, 0], expected, rtol=0.0, atol=error)
    assert reversed_pieces(*reversed_pieces(start, pieces)) == (start, pieces)
    assert reversed_pieces(start, pieces)[0] == pieces[-1].end


def test_a_cylinder_is_straight_along_its_axis():
    surface = Element(0.02, 1.0, GLASS, 10.0, kind="cylindrical", axis="x")
    assert isinstance(surface_outline(surface, 0.0, 10.0, "x")[1][0], Line)
    assert isinstance(surface_outline(surface, 0.0, 10.0, "y")[1][0], Cubic)


def test_rays_of_a_far_point_are_parallel_and_meet_every_surface():
    lens = plano_convex()
    surfaces = lens.packed()
    film = cardinal_points(surfaces).rear_focus
    found = trace_fan(surfaces, film, -10.0)
    rays, angle = found
    assert rays.shape == (7, 4, 2)
    first = rays[:, 1] - rays[:, 0]
    np.testing.assert_allclose(np.degrees(np.arctan2(-first[:, 1], first[:, 0])), angle, atol=1e-9)
    # The front is the stop of the singlet here, or its rear rim: the image height is f tan(angle), but for aberrations.
    assert 100.0 * math.tan(math.radians(angle)) == pytest.approx(10.0, rel=0.05)
    for number, element in enumerate(lens.elements):
        depths = [float(element.sag(0.0, height)) for height in rays[:, 1 + number, 1]]
        np.testing.assert_allclose(rays[:, 1 + number, 0] - surfaces.vertex[number], depths, atol=1e-12)
    np.testing.assert_array_equal(rays[:, -1, 0], film)


def sections_of(lens):
    """Draw a lens with as much of its study as drawings need."""
    bench = set_up_bench(lens)
    rows = tuple(first_order(bench, meridian) for meridian in bench.meridians)
    return cross_sections(lens, SimpleNamespace(settings=bench.settings, first_order=rows))


def written(shown):
    with style(ON_PAPER):
        return ET.fromstring(to_svg(figure_of(shown, 10.0, 9.0), names=names_of(shown), tight=True))


@pytest.mark.parametrize(
    "path", [path for path in SHIPPED if "anamorphic" not in path.stem], ids=lambda path: path.stem
)
def test_a_shipped_lens_in_section(path):
    lens = read_lens(path)
    (shown,) = sections_of(lens)
    glasses = sum(float(one.glass.ior()) != 1.0 for one in lens.elements[:-1])
    assert len(shown.outlines) == glasses
    assert len(shown.fields) == 3
    root = written([shown])
    parts = {node.get("id", ""): node for node in root.iter(f"{SVG}g")}
    named = [node.findtext(f"{SVG}title") for name, node in parts.items() if name.startswith("glass-0-")]
    assert named == [one.title for one in shown.outlines]
    assert parts["film-0"].findtext(f"{SVG}title") == "film"
    # No name covers another.
    placed, _ = stack_labels(shown, 5.0, 12.0)
    for row in {row for _, _, row in placed}:
        names = [(x, len(mark.name)) for mark, x, number in placed if number == row]
        assert all(b - a > 3.0 * (long + wide) for (a, long), (b, wide) in pairwise(names))


def test_a_lens_with_cylinders_is_drawn_in_both_planes_with_names_clear_of_legends():
    shown = sections_of(shipped("anamorphic-75mm"))
    assert [one.title[-1] for one in shown] == ["y", "x"]
    parts = {node.get("id") for node in written(shown).iter(f"{SVG}g")}
    assert {"film-0", "film-1", "glass-0-0", "glass-1-0"} <= parts
    for width, letters in ((10.0, 9.0), (3.7, 7.5)):
        with style(ON_PAPER):
            figure = figure_of(shown, width, letters)
            figure.draw_without_rendering()
        for axes in figure.axes:
            names = [name.get_window_extent() for name in axes.texts]
            assert axes.get_legend().get_window_extent().y1 < min(name.y0 for name in names)
            assert not any(a.overlaps(b) for a, b in combinations(names, 2))
        # Nor does one drawing lie over another.
        lower, upper = (figure.axes[number].get_tightbbox() for number in (1, 0))
        assert lower.y1 < upper.y0


def test_the_outer_rays_of_a_singlet_cross_the_axis_before_the_film():
    surfaces = plano_convex().packed()
    film = cardinal_points(surfaces).rear_focus
    found = trace_fan(surfaces, film, 0.0)
    heights = found[0][:, :, 1]
    # Spherical aberration: they land on the other side, the outermost the farthest.
    assert (heights[:3, 1] * heights[:3, -1] < 0.0).all()
    assert abs(heights[0, -1]) > abs(heights[1, -1]) > abs(heights[2, -1])
    np.testing.assert_allclose(heights, -heights[::-1], atol=1e-9)


def test_rays_of_a_near_point_come_from_it():
    surfaces = plano_convex().packed()
    found = trace_fan(surfaces, 200.0, -5.0, object_z=-190.0)
    starts, seconds = found[0][:, 0], found[0][:, 1]
    slopes = (seconds - starts)[:, 1] / (seconds - starts)[:, 0]
    at_plane = starts[:, 1] + slopes * (-190.0 - starts[:, 0])
    np.testing.assert_allclose(at_plane, at_plane[0], atol=1e-9)


def test_no_light_makes_no_fan():
    assert trace_fan(symmetric_lens().packed(), 40.0, 500.0) is None


def test_glass_is_told_from_air():
    lens = plano_convex()
    film = cardinal_points(lens.packed()).rear_focus
    shown = build_cross_section(lens, lens.packed(), (film, 12.0), [0.0])
    (outline,) = shown.outlines
    assert outline.title == "n = 1.5000"
    assert all(element.glass == AIR for element in lens.elements[1:])
    # Flat front, straight rim up to the larger of the two, curved back.
    kinds = [(kind, len(list(run))) for kind, run in groupby(outline.pieces, key=type)]
    assert kinds == [(Line, 4), (Cubic, 12), (Line, 3)]
    assert max(height for _, height in (piece.end for piece in outline.pieces)) == 12.5


def test_rays_astray_do_not_make_all_else_small():
    """A ball of dense glass throws rays of its rim far to the side."""
    ball = lens_of((0.1, 20.0, constant_index_glass(1.8), 9.95), (-0.1, 0.0, AIR, 9.95))
    shown = build_cross_section(ball, ball.packed(), (21.0, 8.0), [0.0, 6.0, 8.0])
    assert all(abs(ray.points[-1, 1]) <= 1.4 * 12.5 for ray in shown.rays)
    whole = trace_fan(ball.packed(), 21.0, -8.0)
    drawn = [ray.points for ray in shown.rays if ray.field == 2]
    # What is left of a ray lies on it.
    cut = [(ended, ray) for ended, ray in zip(drawn, whole[0], strict=True) if abs(ray[-1, 1]) > 20.0]
    assert cut
    for ended, ray in cut:
        (z, height), (full_z, full_height) = ended[-1] - ended[-2], ray[-1] - ray[-2]
        assert z * full_height == pytest.approx(height * full_z)
        assert 0.0 < height / full_height < 1.0
