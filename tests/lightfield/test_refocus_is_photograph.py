"""A light field that is focused after the shot is the photograph of a thin lens that was focused so."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from raytracer.film.light_field.field import LightField, rays_from_layer
from raytracer.film.light_field.focusing import refocusable
from raytracer.film.light_field.layout import extract_light_field as of
from raytracer.lightfield.refocusing.fourier import FourierRefocuser
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.rendering.render import render
from tests.lightfield.analytic import away
from tests.small_scenes import scene

WIDTH, HEIGHT, VIEWS, APERTURE, FOCUS = 96, 72, 15, 0.06, 0.6

_SCENE = """
textures:
  clouds: {type: noise, scale: 13, octaves: 4, low: [0.1, 0.2, 0.6], high: [1, 0.9, 0.5]}
  coarse: {type: checker, scale: 0.027, even: [0.9, 0.2, 0.1], odd: [0.8, 0.7, 0.2]}
  fine: {type: checker, scale: 0.021, even: [0.1, 0.6, 0.2], odd: [0.3, 0.9, 0.5]}
materials:
  far: {type: emitter, radiance: clouds}
  middle: {type: emitter, radiance: coarse}
  near: {type: emitter, radiance: fine}
objects:
  - {type: quad, corner: [-1, -1, -0.9], edges: [[2, 0, 0], [0, 2, 0]], material: far}
  - {type: disc, center: [-0.084, 0.015, 0], normal: [0, 0, 1], radius: 0.075, material: middle}
  - {type: quad, corner: [0.015, -0.06, 0.15], edges: [[0.075, 0, 0], [0, 0.09, 0]], material: near}
"""

_CAMERA = "camera: {%s, look_from: [0, 0, 0.6], look_at: [0, 0, 0], vfov: 30, focal_length: 216 mm, focus_distance: %r}"

# Of the range in which neighbouring views differ by a pixel at most, in 1/distance from the common plane: from 12 to
# 0.28 m, and then nearer.
INSIDE = (-0.85, -0.5, -0.12, 0.3, 0.6, 1.0)
OUTSIDE = 1.5

# The ends of that range and what lies between; each is a photograph of its own.
EVERY_INSIDE = [part if part in {-0.85, 0.3, 1.0} else pytest.param(part, marks=pytest.mark.slow) for part in INSIDE]

# Of a picture; the rest is nearer to a border than a view is ever shifted in a picture inside the range.
INNER = (slice(8, -8), slice(8, -8))


def _rendered(keys, distance, spp, aovs=(), *, camera=_CAMERA):
    text = camera % (keys, distance) + _SCENE
    spec = scene(text, width=WIDTH, height=HEIGHT, spp=spp, max_depth=1, sampler="sobol", filled=False)
    return render(spec, threads=2, seed=5, aovs=aovs).image


@cache
def photograph(distance, aperture=APERTURE):
    """Render the picture of a thin lens, with its rays."""
    return _rendered(f"type: thin_lens, aperture: {1e3 * aperture!r}", distance, 128, ("rays",))


@pytest.fixture(scope="module")
def field():
    """15 x 15 views whose square lenses tile a plane as large as the thin lens."""
    array = f"type: camera_array, rows: {VIEWS}, columns: {VIEWS}, spacing: {APERTURE / VIEWS!r}, fill: true"
    return of(_rendered(array, FOCUS, 4))


@pytest.fixture(scope="module")
def summed(field):
    """The views' picture of a plane, made once for all tests."""
    return cache(lambda distance: refocus(field, distance, aperture=APERTURE).radiance)


def _distance(field, part):
    inverse = field.views.inverse_focus
    return 1.0 / (inverse + part * (1.0 / refocusable(field.views)[0] - inverse))


def _relative(a, b):
    return away(a, b, 8)


@pytest.mark.parametrize("part", EVERY_INSIDE)
def test_inside_the_range_views_make_the_photograph(field, summed, part):
    distance = _distance(field, part)
    truth = photograph(distance).radiance
    error = _relative(summed(distance), truth)
    assert error < 0.02
    # It is this plane that is in focus: left where it was, the picture is farther off by what that takes.
    assert _relative(summed(FOCUS), truth) > 2.5 * error


def test_outside_of_it_they_are_near_the_photograph(field, summed):
    # Copies of edges come apart, by half a pixel more than they are wide.
    distance = _distance(field, OUTSIDE)
    truth = photograph(distance).radiance
    assert _relative(summed(distance), truth) < 0.02
    assert _relative(summed(FOCUS), truth) > 0.1


@pytest.mark.parametrize("part", [*EVERY_INSIDE, OUTSIDE])
def test_a_slice_of_the_spectrum_is_the_sum_of_the_views(field, summed, part):
    distance = _distance(field, part)
    found = refocus(field, distance, aperture=APERTURE, method="fourier").radiance
    assert _relative(found, summed(distance)) < 0.01


def test_one_spectrum_serves_all_planes(field, summed):
    distances = [_distance(field, part) for part in INSIDE]
    slices = FourierRefocuser(field, [1.0 / distance for distance in distances], cell_weights(field.views, APERTURE))
    for distance in distances:
        assert _relative(slices.picture(1.0 / distance), summed(distance)) < 0.01


def _anywhere(picture):
    """The rays of a photograph, as places in the plane in which a lens focused at FOCUS is sharp: where they are in
    the scene, and nothing of how the lens was focused that they went through."""
    views = replace(of(picture).views, inverse_focus=1.0 / FOCUS)
    return LightField(picture.radiance[None, None], views, rays=rays_from_layer(picture.layers["rays"], views))


@pytest.mark.parametrize("part", [*EVERY_INSIDE, OUTSIDE])
def test_the_same_rays_make_the_same_picture(field, part):
    distance = _distance(field, part)
    picture = photograph(distance)
    found = refocus(_anywhere(picture), distance, method="rays").radiance
    np.testing.assert_allclose(found, picture.radiance, rtol=1e-10)


@pytest.mark.parametrize("part", [*EVERY_INSIDE, OUTSIDE])
def test_rays_of_one_focus_make_the_photograph_of_another(field, part):
    distance = _distance(field, part)
    truth, taken = photograph(distance), photograph(FOCUS)
    found = refocus(of(taken), distance, method="rays").radiance
    noise = float(np.sqrt(truth.variance[INNER].mean() / np.mean(truth.radiance[INNER] ** 2)))
    # Two pictures of as many independent samples differ by sqrt(2) of the noise of one; Sobol's are better.
    assert _relative(found, truth.radiance) < 1.42 * noise


@pytest.mark.parametrize("part", [0.0, 0.3, -0.85])
def test_stopped_down_after_the_shot(field, part):
    # 216 mm at f/3.6 is the lens of 60 mm; f/18 is 12 mm.
    distance = _distance(field, part)
    wide, deep = photograph(distance).radiance, photograph(distance, 0.2 * APERTURE).radiance
    opened, stopped = (refocus(field, distance, f_number=number).radiance for number in (3.6, 18.0))
    assert _relative(opened, wide) < 0.02
    assert _relative(stopped, deep) < 0.02
    # The two differ as the thin lens's do, in size and in place.
    difference, expected = (opened - stopped)[INNER], (wide - deep)[INNER]
    assert np.sqrt(np.mean(expected**2)) > 0.06 * np.sqrt(np.mean(wide[INNER] ** 2))
    assert np.sqrt(np.mean(difference**2)) == pytest.approx(np.sqrt(np.mean(expected**2)), rel=0.05)
    assert np.corrcoef(difference.ravel(), expected.ravel())[0, 1] > 0.98


def test_rays_are_stopped_down_one_by_one(field):
    distance, opening = _distance(field, 0.3), 0.5 * APERTURE
    rays = of(photograph(distance))
    found = refocus(rays, distance, aperture=opening, method="rays").radiance
    assert _relative(found, photograph(distance, opening).radiance) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("part", [-0.85, -0.5, 0.3, 1.0])
def test_a_microlens_camera_takes_the_same_photographs(part):
    field = _behind_microlenses()
    distance, top = _distance(field, part), field.views.plane.top
    # Its framing is that of its views.
    framing = _CAMERA.replace("vfov: 30", f"vfov: {math.degrees(2.0 * math.atan(top))!r}")
    wide, deep = (
        _rendered(f"type: thin_lens, f_number: {number}", distance, 256, camera=framing).radiance
        for number in (3.6, 18.0)
    )
    opened, stopped = refocus(field, distance).radiance, refocus(field, distance, f_number=18.0).radiance
    assert _relative(opened, wide) < 0.02
    assert _relative(stopped, deep) < 0.02
    assert _relative(opened, stopped) == pytest.approx(_relative(wide, deep), rel=0.05)


@cache
def _behind_microlenses():
    text = _CAMERA % ("type: light_field, f_number: 3.6, microlenses: {pixels: 15}", FOCUS) + _SCENE
    size = {"width": VIEWS * WIDTH, "height": VIEWS * HEIGHT}
    return of(render(scene(text, **size, spp=16, max_depth=1, sampler="sobol", filled=False), threads=2, seed=5).image)
