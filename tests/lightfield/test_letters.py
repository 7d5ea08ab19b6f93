"""Nine letters at nine depths: each is sharpest in the picture that is focused on its own distance."""

from functools import cache

import numpy as np
import pytest

from raytracer.film.light_field.layout import extract_light_field
from raytracer.lightfield.refocusing.refocus import refocus
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.schema.transform import matrix_of
from tests.repository import SCENES

FILE = SCENES / "lightfield" / "letters.yaml"
WORD = ("first P", "L", "E", "N", "O", "second P", "T", "I", "C")
STEP = 0.075
"""From letter to letter, in 1/distance (1/m)."""

SQUARE = 0.12
"""Edge of the square in which the cameras stand (m)."""


@cache
def rendered(number, width, height, spp):
    keys = {
        "camera.rows": number,
        "camera.columns": number,
        "camera.spacing": SQUARE / (number - 1),
        "film.width": width,
        "film.height": height,
    }
    return extract_light_field(render(load(FILE, keys), spp=spp).image)


def letters(views):
    """1/distance (1/m) of each letter's face, and the part of a picture that it alone is in."""
    spec = load(FILE)
    placed = {item.name: matrix_of(item.transform) for item in spec.objects if item.name in WORD}
    plane, found = views.plane, []
    for name in WORD:
        right, up, back = placed[name][:3, 3]
        size = placed[name][0, 0]
        x, y = (right / -back - plane.left) / plane.pixel, (plane.top - up / -back) / plane.pixel
        half = 0.6 * size / -back / plane.pixel
        rows, columns = ((max(0, round(at - half)), round(at + half)) for at in (y, x))
        found.append((-1.0 / back, (slice(*rows), slice(*columns))))
    return found


def energy(picture):
    """Mean square of the gradient of the grey picture."""
    down, across = np.gradient(picture.mean(axis=-1))
    return float((down**2 + across**2).mean())


def sharpest(field, **settings):
    """1/distance at which each letter has the most gradient energy, of planes a quarter of a step apart."""
    planes = np.arange(1.0 + STEP, 0.4 - STEP, -0.25 * STEP)
    stack = [refocus(field, 1.0 / plane, **settings).radiance for plane in planes]
    parts = [part for _, part in letters(field.views)]
    return np.array([planes[np.argmax([energy(picture[part]) for picture in stack])] for part in parts])


@pytest.fixture(scope="module")
def field():
    return rendered(7, 160, 144, 8)


def test_the_letters_stand_in_equal_steps():
    spec = load(FILE)
    found = letters(spec.camera.layout(spec.film.width, spec.film.height).views)
    np.testing.assert_allclose([place for place, _ in found], 1.0 - STEP * np.arange(9), atol=1e-4)


@pytest.mark.slow
def test_each_letter_is_sharpest_at_its_own_distance(field):
    """Within half a step of depth."""
    assert np.abs(sharpest(field) - (1.0 - STEP * np.arange(9))).max() <= 0.5 * STEP


@pytest.mark.slow
def test_a_small_aperture_has_all_letters_sharp(field):
    """So what is measured above is the aperture: the middle camera and a little of its neighbours tell no depth."""
    _, part = letters(field.views)[0]

    def gain(**settings):
        own, other = (refocus(field, distance, **settings).radiance for distance in (1.0, 1.6))
        return energy(own[part]) / energy(other[part])

    assert gain(aperture=0.02) < 1.2
    assert gain() > 4.0


@pytest.mark.slow
@pytest.mark.parametrize("method", ["shift", "fourier"])
def test_each_letter_of_the_shipped_size_too(method):
    field = rendered(9, 320, 288, 8)
    assert np.abs(sharpest(field, method=method) - (1.0 - STEP * np.arange(9))).max() <= 0.5 * STEP
