"""Focus: the least spot, groups that move, what a lens cannot focus, and every shipped lens at all stops."""

import dataclasses
import math

import numpy as np
import pytest

from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.first_order import cardinal_points, entrance_pupil
from raytracer.optics.lens_system.focusing import (
    FOCUS_CRITERIA,
    _find_root,
    film_position,
    focus_lens,
    focus_range,
    focus_shift,
    image_distance,
)
from raytracer.optics.lens_system.lens import Element, Focus, Lens
from raytracer.optics.lens_system.lens_setup import stop_radius_for, widest_f_number
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.scene.assets.lenses import read_lens
from tests.optics.lens_system.kernels import DOUBLE_GAUSS, gone_through, unit
from tests.optics.lens_system.test_first_order import lens_of, thin
from tests.optics.lens_system.test_shipped_lenses import every_lens

WHOLE = lens_of(DOUBLE_GAUSS)
SINGLET = Lens("plano-convex", (Element(0.0, 5.0, constant_index_glass(1.5), 15.0), Element(-0.02, 0.0, AIR, 10.0)))

# A thin lens of 100 mm before one of -150 mm, 40 mm apart: a telephoto lens that focuses by its rear.
INNER = Lens("inner focus", (*thin(100.0, 40.0, 10.0), *thin(-150.0, 0.0, 20.0)), focus=Focus("group", 3, 4))
FRONT = dataclasses.replace(INNER, focus=Focus("group", 1, 2))


def spot(lens, distance, film):
    """Root mean square of distances on the film from the axis, of light of a point of it through all of the pupil."""
    pupil = entrance_pupil(lens)
    # Evenly by area over more than the pupil: each ring holds as much, and is as good as any of its points.
    rings = 1.5 * pupil.radius * np.sqrt((np.arange(8000) + 0.5) / 8000)
    turns = 2.4 * np.arange(8000)
    through = np.stack([rings * np.cos(turns), rings * np.sin(turns), np.full(8000, pupil.z)], axis=1)
    ways = np.broadcast_to(np.array([0.0, 0.0, 1.0]), through.shape)
    if math.isfinite(distance):
        ways = through - np.array([0.0, 0.0, pupil.z - distance])
        ways = ways / np.linalg.norm(ways, axis=1)[:, None]
    weights, points, onward = trace_rays(lens, through - 50.0 * ways, ways)
    points, onward = points[weights > 0.0], onward[weights > 0.0]
    on_film = points[:, :2] + ((film - points[:, 2]) / onward[:, 2])[:, None] * onward[:, :2]
    return float(np.sqrt((on_film**2).sum(axis=1).mean()))


@pytest.mark.parametrize("distance", [math.inf, 2000.0, 1000.0])
@pytest.mark.parametrize("lens", [WHOLE, SINGLET, INNER], ids=lambda lens: lens.name)
def test_the_least_spot_is_least(lens, distance):
    shift, film = focus_shift(lens, distance, "rms")
    packed = lens.packed(shift=shift)
    steps = np.array([-0.02, -0.01, 0.0, 0.01, 0.02]) * cardinal_points(packed).focal_length
    sizes = [spot(packed, distance, film + step) for step in steps]
    assert np.argmin(sizes) == 2
    # The square of the size is a parabola, whose vertex is there but for the rings of the two samplings.
    curved, sloped, _ = np.polyfit(steps, np.square(sizes), 2)
    assert -sloped / (2.0 * curved) == pytest.approx(0.0, abs=2e-3 * (steps[-1] - steps[0]))
    # It is smaller than that of the marginal ray's focus, by as much as is between them.
    assert sizes[2] <= spot(packed, distance, focus_shift(lens, distance, "marginal").film)


@pytest.mark.parametrize("h", [10.0, 4.0])
def test_the_marginal_focus_is_that_of_the_zone_that_halves_the_area(h):
    # The worked number of the plano-convex lens, at 1 / sqrt(2) of the widest h.
    lens = SINGLET.stopped_down(h)
    zone = h * math.sqrt(0.5)
    bent = math.asin(1.5 * zone / 50.0) - math.asin(zone / 50.0)
    expected = zone / math.tan(bent) - (50.0 - math.sqrt(2500.0 - zone * zone))
    assert film_position(lens) - 5.0 == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("how", FOCUS_CRITERIA)
@pytest.mark.parametrize("lens", [INNER, FRONT], ids=["rear moves", "front moves"])
def test_a_group_that_moves_brings_planes_to_the_same_film(lens, how):
    film = film_position(lens, how)
    nearest = focus_range(lens, how).nearest
    assert 100.0 < nearest < 2000.0
    shifts = []
    for distance in (math.inf, 30.0 * nearest, 3.0 * nearest, nearest):
        found = focus_shift(lens, distance, how)
        assert found.film == film
        shifts.append(found.shift)
        # Focused so, the lens makes its image there.
        fixed, place = focus_lens(lens, distance, how)
        packed = fixed.packed()
        image = image_distance(packed, distance - entrance_pupil(packed).z, True, how) + packed.vertex[-1]
        assert image == pytest.approx(place, abs=0.02 if distance == nearest else 1e-7)
        np.testing.assert_allclose(
            place - packed.vertex, found.film - lens.packed(shift=found.shift).vertex, rtol=0.0, atol=1e-12
        )
    # The front of a lens goes out for what is near; a rear that spreads light goes in.
    assert shifts[0] == 0.0
    moved = np.diff(shifts)
    assert (moved > 0.0).all() if lens is FRONT else (moved < 0.0).all()


def test_newtons_equation_of_a_front_that_moves():
    # A front of focal length f that images a plane at f + f^2 / e must go out by e, to leave its image where it was.
    lens = FRONT.stopped_down(0.01)
    extension = 8.0
    shift, _ = focus_shift(lens, 100.0 + 100.0**2 / extension)
    assert shift == pytest.approx(extension, rel=1e-6)


def test_a_plane_nearer_than_a_lens_focuses_is_refused_with_the_nearest():
    for lens in (WHOLE, INNER, FRONT):
        for how in FOCUS_CRITERIA:
            nearest = focus_range(lens, how).nearest
            for distance in (0.99 * nearest, 0.0, -5.0, math.nan, -math.inf):
                with pytest.raises(ValueError, match=rf"cannot focus at .*: the nearest .* is {nearest:g} mm before"):
                    focus_shift(lens, distance, how)
    # A lens that moves as a whole ends where the image is as large as the object: 2 f from the principal plane.
    points = cardinal_points(WHOLE.packed())
    expected = 2.0 * points.focal_length - points.front_principal + entrance_pupil(WHOLE.packed()).z
    assert focus_range(WHOLE.stopped_down(0.01)).nearest == pytest.approx(expected, rel=1e-4)


def test_what_has_no_focus_is_named():
    with pytest.raises(ValueError, match="no image behind it"):
        focus_shift(Lens("diverging", thin(-100.0)), math.inf)
    with pytest.raises(ValueError, match="by marginal or rms, not by guess"):
        focus_shift(WHOLE, math.inf, "guess")
    with pytest.raises(ValueError, match="cannot move by 41 mm: surfaces would meet"):
        INNER.packed(shift=41.0)
    with pytest.raises(ValueError, match="cannot move by 41 mm: surfaces would meet"):
        INNER.focused(41.0)
    with pytest.raises(ValueError, match="all of it, the sensor or a group, not by hand"):
        dataclasses.replace(INNER, focus=Focus("hand"))
    with pytest.raises(ValueError, match="from surface 3 to 9, of 4"):
        dataclasses.replace(INNER, focus=Focus("group", 3, 9))


def test_a_root_is_looked_for_by_so_many_images_at_most():
    asked = []

    def jumping(place):
        # A pole and no root between any two places, as of a lens whose image jumps.
        asked.append(place)
        return 1.0 / math.sin(math.pi * (place + 0.3))

    with pytest.raises(ValueError, match="no steady focus: its image jumps past the film at 32 places, and 4 are"):
        _find_root(jumping, np.arange(33.0))
    assert len(asked) <= 33 + 4 * 102

    # After one pole a root is found.
    asked.clear()
    assert _find_root(lambda x: jumping(x) if x < 1.0 else 1.5 - x, np.arange(3.0)) == pytest.approx(1.5)


def test_places_without_light_between_two_with_some_are_no_root():
    assert _find_root(lambda place: place - 0.5 if place in (0.0, 1.0) else math.nan, np.arange(2.0)) is None


# ---- The shipped lenses, from infinity to the nearest plane that they can have sharp

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
