"""Focus: every shipped lens from infinity to the nearest plane that it can have sharp, at all stops."""

import math

import numpy as np
import pytest

from raytracer.optics.lens_system.first_order import entrance_pupil
from raytracer.optics.lens_system.focusing import FOCUS_CRITERIA, focus_range, focus_shift
from raytracer.optics.lens_system.lens_setup import stop_radius_for, widest_f_number
from raytracer.scene.assets.lenses import read_lens
from tests.optics.lens_system.rays import gone_through, unit
from tests.repository import SCENES

SHIPPED = sorted((SCENES / "lenses").glob("*.yaml"))
every_lens = pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
every_way = pytest.mark.parametrize("how", FOCUS_CRITERIA)


def stops(lens, number):
    """Radii of the stop (mm): from the widest f-number to f/64 and beyond, to a hole of a thousandth."""
    widest = widest_f_number(lens)
    numbers = np.geomspace(widest, max(64.0, 2.0 * widest), number)
    radii = [stop_radius_for(lens, float(n)) for n in numbers]
    assert all(np.diff(radii) < 0.0), "a greater f-number closes the stop"
    return [*radii, 1e-3 * radii[0]]


def assert_sweep(lens, how, radius, steps):
    """Every distance from infinity to the nearest one gives finite numbers; a nearer one is refused, and told why."""
    nearest = focus_range(lens, how, radius).nearest
    assert math.isfinite(nearest)
    assert nearest > 0.0
    distances = [math.inf, 1e9, *np.geomspace(1e3 * nearest, nearest * (1.0 + 1e-9), steps).tolist()]
    films, shifts = [], []
    for distance in distances:
        found = focus_shift(lens, distance, how, stop_radius=radius)
        assert math.isfinite(found.film)
        assert math.isfinite(found.shift)
        films.append(found.film - float(lens.packed(shift=found.shift).vertex[-1]))
        shifts.append(found.shift)
    # Nearer planes have their image farther behind, or the group farther out: one or the other goes one way.
    moved = np.diff(films if np.ptp(films) > np.ptp(shifts) else shifts)
    assert (moved >= -1e-9).all() or (moved <= 1e-9).all()
    for near in (0.5 * nearest, 1e-3 * nearest, 0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="nearest"):
            focus_shift(lens, near, how, stop_radius=radius)


@every_lens
@every_way
def test_focus_goes_from_infinity_to_the_nearest_plane(path, how):
    lens = read_lens(path)
    # Wide open, and a hole.
    for radius in stops(lens, 2)[::2]:
        assert_sweep(lens, how, radius, 2)


@pytest.mark.slow
@every_lens
@every_way
def test_focus_at_all_stops(path, how):
    lens = read_lens(path)
    for radius in stops(lens, 13):
        assert_sweep(lens, how, radius, 40)


@every_lens
def test_what_is_focused_on_is_sharp(path):
    """Light from the point of the axis, through the zone of 0.7 of the pupil, meets the axis on the film."""
    lens = read_lens(path)
    if not lens.is_round():
        pytest.skip("an anamorphic lens has a compromise of two")
    for f_number in (widest_f_number(lens), 16.0, 64.0):
        radius = stop_radius_for(lens, max(f_number, widest_f_number(lens)))
        nearest = focus_range(lens, stop_radius=radius).nearest
        for distance in (math.inf, 1e4 * nearest, 30.0 * nearest, 1.5 * nearest):
            found = focus_shift(lens, distance, "marginal", stop_radius=radius)
            surfaces = lens.packed(stop_radius=radius, shift=found.shift)
            pupil = entrance_pupil(surfaces)
            # Straight on, some of the light crosses the pupil's plane behind the front.
            heights = pupil.radius * np.array([math.sqrt(0.5), 0.3, 0.5, 0.85, 0.95])
            starts, ways = np.zeros((5, 3)), np.zeros((5, 3))
            if math.isinf(distance):
                starts[:, 1], starts[:, 2], ways[:, 2] = heights, surfaces.vertex[0] - 100.0, 1.0
            else:
                starts[:, 2], ways[:, 1], ways[:, 2] = pupil.z - distance, heights, distance
            gone = gone_through(surfaces, starts, unit(ways))
            assert gone.weights[0] == 1.0
            ahead = (found.film - gone.points[:, 2]) / gone.directions[:, 2]
            off = np.abs(gone.points[:, 1] + ahead * gone.directions[:, 1])
            # The zone is told by light near the axis, and the pupil has aberrations of its own, more so of near planes.
            worst = off[gone.weights > 0.0].max()
            assert off[0] < max(0.15 * worst, 3e-4 * pupil.radius), (f_number, distance, off)
