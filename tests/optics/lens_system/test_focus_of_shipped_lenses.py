"""Focus: every shipped lens from infinity to the nearest plane that it can have sharp, at all stops."""

import math

import numpy as np
import pytest

from raytracer.optics.lens_system.focusing import FOCUS_CRITERIA, focus_range, focus_shift
from raytracer.optics.lens_system.lens_setup import stop_radius_for, widest_f_number
from raytracer.scene.assets.lenses import read_lens
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
    for radius in stops(lens, 2):
        assert_sweep(lens, how, radius, 2)
