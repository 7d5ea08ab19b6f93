"""Bounds of the pupil: they hold all of it, are hardly larger, and do not change pictures."""

import itertools
import math

import numpy as np
import pytest

from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.focusing import focus_shift
from raytracer.optics.lens_system.lens_setup import stop_radius_for, widest_f_number
from raytracer.optics.lens_system.pupils import build, search, transmission
from raytracer.optics.lens_system.pupils.build import load_pupil_table
from raytracer.optics.lens_system.pupils.search import on_axis_solid_angle
from raytracer.optics.lens_system.pupils.tables import QuadrantPupilTable, RadialPupilTable, sample_exit_pupil
from raytracer.optics.lens_system.pupils.transmission import exit_pupil_plane, transmitted_fraction
from raytracer.plugins.apertures.polygon import PolygonAperture
from raytracer.scene.assets.lenses import read_lens
from tests.optics.lens_system.test_shipped_lenses import SHIPPED
from tests.vectorised import rows, vectorised

QUICK = ("double-gauss-50mm", "fisheye-10mm", "phone-3.7mm")
SEEN = (380.0, 500.0, 780.0)


def aims(pupils, x, y, discs):
    """Points (n, 2) that points of the unit disc (n, 2) are taken to, and the area of what they fill."""
    right, up, area = vectorised(sample_exit_pupil)(pupils, x, y, *map(rows, discs.T)).T
    assert (area == area[0]).all()
    return np.stack([right, up], axis=1), float(area[0])


def disc(count, *, reach=1.0):
    """Points spread evenly over a disc: Vogel 1979, "A Better Way to Construct the Sunflower Head"."""
    number = np.arange(count)
    radius, angle = reach * np.sqrt((number + 0.5) / count), number * math.pi * (3.0 - math.sqrt(5.0))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def set_up(name, f_number, distance):
    """A shipped lens, packed as a camera does for a picture in colours, and where its film is."""
    lens = read_lens(SHIPPED[name])
    radius = None if f_number is None else stop_radius_for(lens, f_number)
    focus = focus_shift(lens, distance, stop_radius=radius)
    return lens, lens.packed(stop_radius=radius, shift=focus.shift, dispersion=True), focus.film


def check_bounds(name, f_number, distance, places):
    """What passes lies within the bounds, from random places of the film and at random wavelengths."""
    lens, surfaces, film = set_up(name, f_number, distance)
    half = (0.45 * lens.image_circle, 0.3 * lens.image_circle)
    pupils = load_pupil_table(surfaces, film, half, SEEN, is_round=lens.is_round())
    rng = np.random.default_rng(7)
    discs = disc(20_000, reach=1.25)
    away = np.hypot(*discs.T)
    filled = []
    for _place in range(places):
        x, y = rng.uniform(-1.0, 1.0, 2) * half
        points, area = aims(pupils, x, y, discs)
        if area == 0.0:
            wide = disc(20_000, reach=2.0 * float(surfaces.radius.max()))
            assert transmitted_fraction(surfaces, (x, y, film), wide, LINE_D).mean() < 1e-3
            continue
        passes = transmitted_fraction(surfaces, (x, y, film), points, rng.uniform(380.0, 780.0)) > 0.0
        assert away[passes].max(initial=0.0) <= 1.0, (x, y)
        if passes.any():
            filled.append(passes.mean() * 1.25**2)
    # Ellipses round what is left of a pupil by the rims of a lens are not much larger than that.
    assert np.median(filled) > 0.7


@pytest.mark.parametrize("name", QUICK)
def test_bounds_hold_the_pupil(name):
    check_bounds(name, None, math.inf, 12)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_bounds_hold_the_pupil_of_all_lenses(name):
    lens = read_lens(SHIPPED[name])
    widest = widest_f_number(lens)
    for f_number in (None, 1.7 * widest, 4.0 * widest):
        for distance in (math.inf, 30.0 * (lens.focal_length or 50.0)):
            check_bounds(name, f_number, distance, 40)


def test_bounds_of_a_lens_with_cylinders_are_on_the_side_of_the_place():
    # What is mirrored is the place, so the middle of the ellipse is too, on whichever side of the axis it lies.
    pupils = QuadrantPupilTable(np.broadcast_to([-0.5, 0.25, 2.0, 3.0], (2, 2, 4)).copy(), 0.1, 0.1)
    for x, y in itertools.product((-3.0, 3.0), (-4.0, 4.0)):
        points, area = aims(pupils, x, y, np.zeros((1, 2)))
        middle = (-0.5 * math.copysign(1.0, x), 0.25 * math.copysign(1.0, y))
        np.testing.assert_allclose(points[0], middle, rtol=1e-14)
        assert area == pytest.approx(6.0 * math.pi)


def test_bounds_of_a_stop_that_is_not_round_hold_its_corners():
    _, round_stop, film = set_up("double-gauss-50mm", 5.6, math.inf)
    shaped = round_stop._replace(diaphragm=PolygonAperture(blades=5).pack({}))
    pupils = load_pupil_table(shaped, film, (18.0, 12.0), SEEN, is_round=True)
    discs = disc(20_000, reach=1.25)
    for x, y in ((0.0, 0.0), (3.0, -9.0), (-16.0, 10.0)):
        points, _ = aims(pupils, x, y, discs)
        passes = transmitted_fraction(shaped, (x, y, film), points, LINE_D) > 0.0
        assert np.hypot(*discs[passes].T).max() <= 1.0
    # On the axis they touch the corners of the pentagon, which is as large as the round stop, at all wavelengths.
    points, area = aims(pupils, 0.0, 0.0, disc(100_000))
    seen = transmitted_fraction(shaped, (0.0, 0.0, film), points, LINE_D).mean() * area
    whole, of_round = aims(
        load_pupil_table(round_stop, film, (18.0, 12.0), SEEN, is_round=True), 0.0, 0.0, disc(100_000)
    )
    assert seen == pytest.approx(
        transmitted_fraction(round_stop, (0.0, 0.0, film), whole, LINE_D).mean() * of_round, rel=5e-3
    )
    assert area == pytest.approx(seen * 2.0 * math.pi / 5.0 / math.sin(2.0 * math.pi / 5.0), rel=0.04)


def test_light_does_not_depend_on_the_bounds():
    """Area times the part that passes, of what is aimed at, is the pupil's area, which a plain grid gives too.

    Between places of the table and at them: second differences along the radius are those of a smooth curve, where
    areas that changed from bin to bin and were not in the weight had steps; pbrt-v3 issue 162.
    """
    lens, surfaces, film = set_up("double-gauss-50mm", None, math.inf)
    pupils = load_pupil_table(surfaces, film, (18.0, 12.0), SEEN, is_round=lens.is_round())
    assert isinstance(pupils, RadialPupilTable)
    step = 1.0 / pupils.per_mm
    radii = step * np.arange(0.0, 22.0, 0.125)
    area = np.array([_area(surfaces, film, pupils, float(radius)) for radius in radii])
    brute = np.array([_brute(surfaces, film, float(radius)) for radius in radii[::16]])
    np.testing.assert_allclose(area[::16], brute, rtol=4e-3)
    # A curve of a low degree tells the smooth part; what is left has no larger steps at the places of the table.
    rest = area - np.polynomial.Polynomial.fit(radii, area, 12)(radii)
    second = np.abs(np.diff(rest, 2))
    at_places = np.zeros(len(second), bool)
    at_places[7::8] = True
    assert second.max() < 3e-3 * area[0]
    assert second[at_places].mean() < 2.0 * second[~at_places].mean()


def _area(surfaces, film, pupils, radius):
    points, area = aims(pupils, radius, 0.0, disc(20_000))
    return area * float(transmitted_fraction(surfaces, (radius, 0.0, film), points, LINE_D).mean())


def _brute(surfaces, film, radius):
    size = 1.6 * float(surfaces.radius.max())
    points = disc(200_000, reach=size)
    return math.pi * size**2 * float(transmitted_fraction(surfaces, (radius, 0.0, film), points, LINE_D).mean())


def test_light_on_the_axis_is_that_of_the_cone():
    # pi sin^2 for a round pupil; for any other the integral, here of what is round too.
    _, surfaces, film = set_up("double-gauss-50mm", 2.8, math.inf)
    closed = on_axis_solid_angle(surfaces, film, LINE_D, is_round=True)
    added = on_axis_solid_angle(surfaces, film, LINE_D, is_round=False)
    assert added == pytest.approx(closed, rel=1e-3)
    assert closed == pytest.approx(math.pi / (4.0 * 2.8**2), rel=0.01)


def test_tables_are_kept_and_a_damaged_one_is_made_again(monkeypatch, tmp_path):
    monkeypatch.setattr(build, "CACHE_FOLDER", tmp_path / "not yet there")
    lens, surfaces, film = set_up("plano-convex-100mm", None, math.inf)
    first = load_pupil_table(surfaces, film, (2.0, 1.0), (LINE_D,), is_round=lens.is_round())
    (file,) = (tmp_path / "not yet there").iterdir()
    made = []
    monkeypatch.setattr(build, "_build_radial_table", lambda *given: made.append(given) or first)
    again = load_pupil_table(surfaces, film, (2.0, 1.0), (LINE_D,), is_round=True)
    assert not made
    np.testing.assert_array_equal(again.ellipses, first.ellipses)
    assert again[1:] == first[1:]
    file.write_bytes(file.read_bytes()[:200])
    load_pupil_table(surfaces, film, (2.0, 1.0), (LINE_D,), is_round=True)
    assert len(made) == 1
    # Another film, stop or focus has its own.
    load_pupil_table(surfaces, film + 0.1, (2.0, 1.0), (LINE_D,), is_round=True)
    assert len(made) == 2


def counted(monkeypatch):
    """Count the rays that each search traces from here on, without tables on the disk."""
    rays, trace = [], transmission._trace_to_plane

    def through(lens, film, plane, wavelength, targets, *rest):
        rays.append(len(targets))
        trace(lens, film, plane, wavelength, targets, *rest)

    monkeypatch.setattr(transmission, "_trace_to_plane", through)
    monkeypatch.setattr(build, "load_signed", lambda path: None)
    monkeypatch.setattr(build, "save_signed", lambda path, content: None)
    return rays


def test_how_far_a_pupil_reaches_is_found_by_few_rays(monkeypatch):
    # Wide open, the ellipses of most places must grow by a hundredth or two: 260,000 rays, and 1.8 million when each
    # was looked at to 1.6 times its size.
    _, surfaces, film = set_up("double-gauss-50mm", None, math.inf)
    rays = counted(monkeypatch)
    load_pupil_table(surfaces._replace(indices=None), film, (18.0, 12.0), (LINE_D,), is_round=True)
    assert 10_000 < sum(rays) < 500_000


@pytest.mark.slow
def test_the_pupil_of_a_lens_with_cylinders_is_within_the_limit(monkeypatch):
    _, surfaces, film = set_up("anamorphic-75mm", None, 2000.0)
    rays = counted(monkeypatch)
    load_pupil_table(surfaces, film, (12.45, 9.35), SEEN, is_round=False)
    assert sum(rays) * len(surfaces.vertex) < 0.5 * search.MAX_CROSSINGS


@pytest.mark.parametrize("name", ["double-gauss-50mm", "anamorphic-75mm"])
def test_the_search_for_a_pupil_ends_at_its_limit(name, monkeypatch):
    lens, surfaces, film = set_up(name, None, 2000.0)
    rays = counted(monkeypatch)
    monkeypatch.setattr(search, "MAX_CROSSINGS", 1_000_000)
    with pytest.raises(ValueError, match=r"not found by rays that cross surfaces 1,000,000 times, the limit: its pup"):
        load_pupil_table(surfaces, film, (12.0, 9.0), SEEN, is_round=lens.is_round())
    assert 500_000 < sum(rays) * len(surfaces.vertex) <= 1_000_000


def test_a_pupil_that_ellipses_never_hold_is_an_error(monkeypatch):
    lens, surfaces, film = set_up("plano-convex-100mm", None, math.inf)
    counted(monkeypatch)
    monkeypatch.setattr(search.PupilSampler, "growth_factor", lambda *given: 1.01)
    with pytest.raises(ValueError, match="not found in 12 rounds, the limit: its pupil is too irregular at 257 places"):
        load_pupil_table(surfaces, film, (2.0, 1.0), (LINE_D,), is_round=lens.is_round())


def test_the_plane_is_before_the_film_wherever_the_exit_pupil_is():
    for name in SHIPPED:
        _, surfaces, film = set_up(name, None, math.inf)
        assert exit_pupil_plane(surfaces, film) < film
