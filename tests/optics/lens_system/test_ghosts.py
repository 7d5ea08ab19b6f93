"""Ghosts: formulas of plates, matrices of mirrors, and paths that are sampled."""

import functools
import math
from itertools import combinations

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import entry
from raytracer.core.sampling import Independent, pixel_key, sample_1d
from raytracer.core.sampling.warp import sample_disc
from raytracer.core.vec import madd, normalize, sub
from raytracer.optics.glass import constant_index_glass, glass_from_abbe
from raytracer.optics.lens_system.coatings import Coating, reflectance
from raytracer.optics.lens_system.ghosts import (
    aim_ghost_ray,
    build_ghost_paths,
    sample_ghost_path,
    trace_ghost_path,
    wavelength_or_d_line,
)
from raytracer.optics.lens_system.lens import Element, Lens
from raytracer.optics.lens_system.ray_tracing import (
    intersect_surface,
    refract,
    refractive_index,
    rim_transmission,
    trace,
    trace_rays,
)
from raytracer.rendering.render import render
from tests.optics.lens_system.kernels import DOUBLE_GAUSS, Surface, pack_surfaces
from tests.repository import SCENES
from tests.small_scenes import scene
from tests.vectorised import rows, vectorised

ABBE = {1.67: 47.1, 1.699: 30.1, 1.603: 38.0, 1.658: 57.3, 1.717: 48.0}

COUNT = 1 << 17


@functools.cache
def double_gauss(*, coated=False, dispersion=False):
    """The f/2 lens, its surfaces towards air coated or bare."""
    elements, before = [], 1.0
    for radius, thickness, index, aperture in DOUBLE_GAUSS:
        glass = glass_from_abbe(index, ABBE[index]) if index > 1.0 else constant_index_glass(1.0)
        coating = Coating() if coated and radius and 1.0 in (before, index) else None
        curvature = 1.0 / radius if radius else 0.0
        elements.append(Element(curvature, thickness, glass, aperture, coating=coating, is_stop=radius == 0.0))
        before = index
    return Lens("", tuple(elements)).packed(dispersion=dispersion, coatings=coated)


@functools.cache
def flared(**options):
    """That lens, and the ways of its light to a film of full frame."""
    lens = double_gauss(**options)
    return lens, build_ghost_paths(lens, 21.6, 36.0)


@entry
def _estimates(lens, flare, start, wavelength, numbers, out):
    # Of each ray the direct light and that of ghosts, each evenly from everywhere and from one side alone, as a part of
    # what falls on the last surface.
    rear, rim = lens.vertex[len(lens.vertex) - 1], lens.radius[len(lens.radius) - 1]
    for i in range(len(numbers)):
        x, y = sample_disc(numbers[i, 0], numbers[i, 1])
        pair, first, last, probability = sample_ghost_path(flare, numbers[i, 2])
        right, up = rim * x, rim * y
        if pair >= 0:
            right, up, area = aim_ghost_ray(flare, pair, start[0], start[1], x, y, numbers[i, 3])
            probability *= math.pi * rim * rim / area
        direction = normalize(sub((right, up, rear), start))
        weight, _, onward = trace_ghost_path(lens, start, direction, first, last, wavelength)
        column = 0 if first < 0 else 2
        out[i, column] = weight / probability
        out[i, column + 1] = weight / probability if onward[0] > 0.1 else 0.0


def estimated(lens, flare, start, wavelength, numbers):
    """Means (4,) of what `_estimates` finds, and their standard deviations."""
    out = np.zeros((len(numbers), 4))
    _estimates(lens, flare, start, wavelength, numbers, out)
    return out.mean(axis=0), out.std(axis=0) / math.sqrt(len(out))


@entry
def _walks(lens, start, wavelength, numbers, sampler, out, ends):
    # Every surface reflects or lets through by chance; `ends` counts where light comes out: front, rear, nowhere.
    key = pixel_key(sampler, 0, 0)
    count = len(lens.curvature)
    rear, rim = lens.vertex[count - 1], lens.radius[count - 1]
    for i in range(len(numbers)):
        x, y = sample_disc(numbers[i, 0], numbers[i, 1])
        origin = start
        direction = normalize(sub((rim * x, rim * y, rear), start))
        surface, side, turns, met = count - 1, -1, 0, 0
        while 0 <= surface < count:
            distance, normal, cosine = intersect_surface(lens, surface, origin, direction, float(side))
            if cosine == 0.0 or (turns > 0 and distance < 0.0):
                break
            origin = madd(origin, distance, direction)
            if rim_transmission(lens, surface, origin) == 0.0:
                break
            near = refractive_index(lens, surface if side > 0 else surface + 1, wavelength)
            far = refractive_index(lens, surface + 1 if side > 0 else surface, wavelength)
            part, _ = reflectance(lens.coatings, surface, abs(cosine), near, far, wavelength_or_d_line(wavelength))
            met += 1
            if sample_1d(sampler, key, i, met) < part:
                direction = madd(direction, -2.0 * cosine, normal)
                side = -side
                turns += 1
            else:
                _, direction = refract(direction, normal, cosine, near / far)
            surface += side
        ends[0 if surface < 0 else 1 if surface == count else 2] += 1
        if surface < 0 and turns <= 2:
            out[i, turns] = 1.0
            out[i, turns + 1] = 1.0 if direction[0] > 0.1 else 0.0


def followed(lens, start, direction, ways, wavelength=None):
    """Weights (n,), points and directions (n, 3) of one ray on ways (n, 2)."""
    firsts, lasts = (rows(column) for column in np.array(ways, np.int32).reshape(-1, 2).T)
    origin, towards = (tuple(map(float, vector)) for vector in (start, direction))
    return vectorised(trace_ghost_path)(lens, origin, towards, firsts, lasts, wavelength)


def aimed(flare, pair, x, y, numbers):
    """Places (n,), (n,) of the last surface that a ghost's rays are aimed at, and areas (n,)."""
    return vectorised(aim_ghost_ray)(flare, pair, x, y, *map(rows, numbers.T)).T


@functools.cache
def aims():
    """Places of the unit disc and a number for each of many rays (n, 3)."""
    numbers = np.random.default_rng(9).random((COUNT, 3))
    numbers[:, :2] = vectorised(sample_disc)(*map(rows, numbers[:, :2].T))
    return numbers


def plates(*indices):
    """Planes 1 mm apart, without rims to speak of, and the index of refraction behind each."""
    return pack_surfaces([Surface(0.0, 1.0, index, 1e9) for index in indices])


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.2])
def test_plate_lets_direct_light_and_a_ghost_through(angle):
    # Both surfaces reflect R: (1 - R)^2 goes directly, (1 - R)^2 R^2 after two reflections, and with all that follow
    # (1 - R) / (1 + R); what returns on the film's side is the rest, 2 R / (1 + R).
    lens = plates(1.5168, 1.0)
    direction = (math.sin(angle), 0.0, -math.cos(angle))
    inside = math.asin(math.sin(angle) / 1.5168)
    s = (math.cos(angle) - 1.5168 * math.cos(inside)) / (math.cos(angle) + 1.5168 * math.cos(inside))
    p = (1.5168 * math.cos(angle) - math.cos(inside)) / (1.5168 * math.cos(angle) + math.cos(inside))
    part = 0.5 * (s * s + p * p)
    (straight, ghost), points, onward = followed(lens, (0.0, 0.0, 10.0), direction, [(-1, -1), (0, 1)])
    assert straight == pytest.approx((1.0 - part) ** 2, rel=1e-12)
    assert ghost == pytest.approx((1.0 - part) ** 2 * part**2, rel=1e-12)
    series = straight / (1.0 - ghost / straight)
    assert series + 2.0 * part / (1.0 + part) == pytest.approx(1.0, rel=1e-12)
    # The plate leaves directions as they are; the ghost is aside by twice the way across it.
    np.testing.assert_allclose(onward, [direction] * 2, rtol=0.0, atol=1e-15)
    assert points[1, 0] - points[0, 0] == pytest.approx(2.0 * math.tan(inside), rel=1e-12, abs=1e-15)


def powers(reflectances, orders):
    """Light through a stack of boundaries and back from it, by number of reflections (orders,): the adding method.

    Every boundary passes 1 - R and reflects R t, in which the power of t counts reflections.

    References: Stokes 1862, "On the intensity of the light reflected from or transmitted through a pile of plates".
    """

    def times(*series):
        product = np.eye(1, orders)[0]
        for factor in series:
            product = np.convolve(product, factor)[:orders]
        return product

    one = np.eye(1, orders)[0]
    through, front, back = one, 0.0 * one, 0.0 * one
    for part in reflectances:
        passes, mirror = (1.0 - part) * one, part * np.eye(1, orders, 1)[0]
        loop = times(back, mirror)
        echoes, power = one.copy(), one
        for _ in range(orders):
            power = times(power, loop)
            echoes = echoes + power
        front = front + times(through, mirror, echoes, through)
        back = mirror + times(passes, back, echoes, passes)
        through = times(through, echoes, passes)
    return through, front


@pytest.mark.parametrize("coated", [False, True])
def test_on_the_axis_all_orders_are_those_of_a_pile_of_plates(coated):
    # On the axis a lens is such a pile.  Direct light is that without a reflection, all ghosts are those of two; and
    # with all orders, what goes through and what comes back are all the light.
    lens = double_gauss(coated=coated)
    normal = ((lens.ior[1:] - lens.ior[:-1]) / (lens.ior[1:] + lens.ior[:-1])) ** 2
    if coated:
        # With a quarter of a wave: between n0 and n2, ((n0 n2 - n1^2) / (n0 n2 + n1^2))^2.
        product = lens.ior[1:] * lens.ior[:-1]
        normal = np.where(lens.coatings.wavelength > 0.0, ((product - 1.38**2) / (product + 1.38**2)) ** 2, normal)
    through, back = powers(normal, 80)
    assert through.sum() + back.sum() == pytest.approx(1.0, rel=1e-12)
    ways = [(-1, -1), *combinations(range(len(normal)), 2)]
    found = followed(lens, (0.0, 0.0, 80.0), (0.0, 0.0, -1.0), ways, 550.0 if coated else None)[0]
    assert found[0] == pytest.approx(through[0], rel=1e-12)
    assert found[1:].sum() == pytest.approx(through[2], rel=1e-12)


def test_the_direct_way_is_that_of_the_lens_without_reflections():
    lens = double_gauss(dispersion=True)
    start = (3.0, -5.0, 72.0)
    for wavelength in (400.0, 550.0, 700.0):
        for x in (-3.0, 0.0, 4.0):
            direction = np.array([x, 2.0, lens.vertex[-1]]) - start
            direction /= np.linalg.norm(direction)
            weights, points, onward = trace_rays(lens, [start], [direction], False, wavelength)
            passed, *way = followed(lens, start, direction, [(-1, -1)], wavelength)
            assert weights[0] == 1.0
            assert 0.5 < passed[0] < 0.75
            np.testing.assert_array_equal(way, [points, onward])


def paraxial(lens, first, last, height, slope, behind):
    """Slope dy/dz before the lens of a ray near the axis from behind it: refraction n' u' = n u - h c (n' - n), and
    reflection, for which n' is -n."""
    surface, side, turns = len(lens.curvature) - 1, -1, 0
    height -= slope * behind
    while True:
        near, far = (lens.ior[surface], lens.ior[surface + 1])[:: 1 if side > 0 else -1]
        if (turns == 0 and surface == first) or (turns == 1 and surface == last):
            far, side, turns = -near, -side, turns + 1
        slope = (near * slope - height * lens.curvature[surface] * (far - near)) / far
        if surface + side < 0:
            return float(slope)
        height += slope * (lens.vertex[surface + side] - lens.vertex[surface])
        surface += side


def test_ghosts_near_the_axis_go_where_matrices_send_them():
    lens = double_gauss()
    behind, slope = 36.0, 1e-5
    ways = [pair for pair in combinations(range(11), 2) if 5 not in pair]
    start = (0.0, 1e-4, lens.vertex[-1] + behind)
    weights, _, onward = followed(
        lens, start, (0.0, -slope / math.hypot(1.0, slope), -1.0 / math.hypot(1.0, slope)), ways
    )
    expected = [paraxial(lens, *pair, start[1], slope, behind) for pair in ways]
    assert (weights > 0.0).all()
    np.testing.assert_allclose(onward[:, 1] / onward[:, 2], expected, rtol=1e-4, atol=1e-9)


def test_ways_are_drawn_as_often_as_is_said():
    _, flare = flared()
    # All pairs of the ten surfaces with glass; the stop has none.
    pairs = [pair for pair in combinations(range(11), 2) if 5 not in pair]
    assert list(zip(flare.first, flare.last, strict=True)) == pairs
    numbers = (np.arange(COUNT) + 0.5) / COUNT
    _, firsts, lasts, probability = vectorised(sample_ghost_path)(flare, rows(numbers))
    for first, last in [(-1, -1), *pairs]:
        drawn = (firsts == first) & (lasts == last)
        assert drawn.mean() == pytest.approx(probability[drawn][0], abs=1.5 / COUNT)
    assert (firsts < 0).mean() == 0.5
    # What is strong is drawn more often, and nothing is left out.
    ghosts = probability[firsts >= 0]
    assert ghosts.min() >= 0.2499 / len(pairs)
    assert ghosts.max() > 1.0 / len(pairs)
    # Nor are the least and the greatest number.
    _, *ends, _ = vectorised(sample_ghost_path)(flare, rows([0.0, np.nextafter(1.0, 0.0)]))
    np.testing.assert_array_equal(np.transpose(ends), [(-1, -1), pairs[-1]])


def test_what_does_not_reflect_has_no_ghosts():
    for lens in (plates(1.0), plates(1.5)):
        flare = build_ghost_paths(lens, 1.0, 10.0)
        assert len(flare.first) == 0
        _, *way = vectorised(sample_ghost_path)(flare, rows([0.999]))
        assert [float(value[0]) for value in way] == [-1.0, -1.0, 1.0]


@pytest.mark.parametrize(("coated", "wavelength", "x"), [(False, None, 0.0), (False, None, 15.0), (True, 450.0, 8.0)])
def test_light_that_takes_its_way_by_chance_brings_as_much(coated, wavelength, x):
    lens, flare = flared(coated=coated, dispersion=wavelength is not None)
    start = (x, 4.0, float(lens.vertex[-1]) + 36.0)
    rng = np.random.default_rng(7)
    found, spread = estimated(lens, flare, start, wavelength, rng.random((COUNT, 4)))
    walked, ends = np.zeros((4 * COUNT, 4)), np.zeros(3, np.int64)
    _walks(lens, start, wavelength, rng.random((len(walked), 2)), Independent(11), walked, ends)
    # Some light comes back to the film, and most of it ends at rims.
    assert ends.sum() == len(walked)
    assert ends.min() > 0
    error = np.hypot(spread, walked.std(axis=0) / math.sqrt(len(walked)))
    assert walked.mean(axis=0)[2] > 0.0
    assert (np.abs(found - walked.mean(axis=0)) <= 4.0 * error).all()
    # So few rays are enough to tell the ghosts to a few per cent.
    assert error[2] < 0.1 * found[2]


def test_any_shares_of_the_ways_give_the_same_light():
    lens, drawn = flared()
    start = (8.0, 0.0, float(lens.vertex[-1]) + 36.0)
    numbers = np.random.default_rng(8).random((COUNT, 4))
    alike = drawn._replace(cumulative=np.append(0.2, 0.2 + 0.8 * np.arange(1, 46) / 45.0))
    anywhere = drawn._replace(ellipses=np.zeros_like(drawn.ellipses))
    means, errors = zip(
        *(estimated(lens, flare, start, None, numbers) for flare in (drawn, alike, anywhere)), strict=True
    )
    for other in (1, 2):
        assert (np.abs(means[0] - means[other]) <= 4.0 * np.hypot(errors[0], errors[other])).all()
        # Drawn by strength, and aimed at where they pass, ghosts are told better by as many rays.
        assert errors[0][2] < errors[other][2]


def test_ghosts_of_many_surfaces_are_aimed_anywhere():
    # Twenty plates have 780 ghosts, of too many to look for where each passes.
    pile = [Surface(0.0, 0.5, index, 12.0) for _ in range(20) for index in (1.5, 1.0)]
    flare = build_ghost_paths(pack_surfaces(pile), 5.0, 10.0)
    assert len(flare.first) == 780
    assert flare.cumulative[-1] == 1.0
    assert (np.diff(flare.cumulative) >= 0.2499 / 780.0).all()
    _, _, area = aimed(flare, 77, 3.0, 4.0, aims()[:100])
    np.testing.assert_allclose(area, math.pi * 12.0**2, rtol=1e-12)


@pytest.mark.parametrize("place", [(0.0, 0.0), (9.0, -12.0), (-21.0, 0.0)])
def test_ghosts_are_aimed_with_the_density_that_is_said(place):
    # Areas over the density are areas: of the surface, and of its half to one side.
    _, flare = flared()
    numbers = aims()
    for pair in range(0, len(flare.first), 7):
        right, up, area = aimed(flare, pair, *place, numbers)
        on = np.hypot(right, up) <= flare.reach
        for side in (on, on & (up > 0.25 * flare.reach)):
            areas = np.where(side, area, 0.0)
            # The part of a disc beyond a quarter of its radius: (acos(d) - d sqrt(1 - d^2)) / pi.
            part = 1.0 if side is on else (math.acos(0.25) - 0.25 * math.sqrt(1.0 - 0.25**2)) / math.pi
            expected = part * math.pi * flare.reach**2
            assert areas.mean() == pytest.approx(expected, abs=4.5 * areas.std() / math.sqrt(COUNT))


def test_through_a_small_stop_few_ghosts_are_aimed_in_vain():
    # At f/8 a sixteenth of the opening is left.
    lens = double_gauss()
    radius = lens.radius.copy()
    radius[lens.stop] /= 4.0
    lens = lens._replace(radius=radius)
    start = (8.0, 0.0, float(lens.vertex[-1]) + 36.0)
    numbers = np.random.default_rng(8).random((COUNT, 4))
    aimed = build_ghost_paths(lens, 21.6, 36.0)
    anywhere = aimed._replace(ellipses=np.zeros_like(aimed.ellipses))
    found = [estimated(lens, flare, start, None, numbers) for flare in (aimed, anywhere)]
    means, errors = np.array(found)[:, :, 2].T
    assert means[0] == pytest.approx(means[1], abs=4.0 * math.hypot(*errors))
    assert errors[0] < 0.4 * errors[1]


@pytest.mark.slow
@pytest.mark.parametrize("f_number", [2, 5.6])
def test_the_camera_gathers_direct_light_and_ghosts(f_number):
    # An even scene of radiance 1 is as bright as its light that gets through, over what a lens without losses passes.
    text = f"""
camera: {{type: lens, lens: '{SCENES}/lenses/double-gauss-50mm.yaml',
          f_number: {f_number}, focus_distance: .inf, dispersion: false, flare: true,
          sensor: {{width: 0.8 mm, height: 0.8 mm}}}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: sphere, center: [0, 0, 1.0e6], radius: 1.0e-6}}
"""
    spec = scene(text, width=8, height=8, spp=1 << 15, filled=False)
    found = render(spec, threads=2).image.radiance[..., 1]
    setting = spec.camera.lens_setup()
    start, lens = (0.0, 0.0, float(setting.film)), setting.surfaces
    disc = vectorised(sample_disc)(*(rows(numbers) for numbers in np.random.default_rng(3).random((2, COUNT))))
    ways = np.column_stack([lens.radius[-1] * disc, np.full(COUNT, lens.vertex[-1] - start[2])])
    ways = rows(ways / np.linalg.norm(ways, axis=1, keepdims=True))
    # Of light that is even: what a lens without losses would bring; its direct light; and that of all ghosts.
    brought = np.zeros((COUNT, 3))
    brought[:, 0] = vectorised(trace)(lens, start, ways, False, None)[0]
    for pair in [(-1, -1), *combinations(range(len(lens.curvature)), 2)]:
        brought[:, 1 if pair[0] < 0 else 2] += vectorised(trace_ghost_path)(lens, start, ways, *pair, None)[0]
    brought *= ways.values[:, 2:] ** 4
    even, direct, ghosts = brought.mean(axis=0)
    assert ghosts > 0.01 * direct
    # What lens and ghosts are measured by is the same light, whose noise mostly cancels.
    noise = (brought[:, 1:].sum(axis=1) - (direct + ghosts) / even * brought[:, 0]).std() / math.sqrt(COUNT) / even
    error = math.hypot(noise, found.std() / math.sqrt(found.size))
    assert found.mean() == pytest.approx((direct + ghosts) / even, abs=4.0 * error)
    assert error < 0.2 * ghosts / even
