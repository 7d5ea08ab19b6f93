"""Shapes of sub-images that are fitted, and the error of their middles that pixels make."""

import numpy as np
import pytest

from raytracer.lightfield.decoding.subimage_phases import Levels, measure_subimages
from raytracer.lightfield.decoding.subimage_shape import SubimageShape, fit_shape, measure_bias
from tests.lightfield.lenslet_pictures import lattice, nearest_middles

SUPERSAMPLING = 8


def draw(grid, size, light):
    """Draw a picture of size x size pixels from `light(offset)`, integrated over its pixels."""
    places = (np.arange(size * SUPERSAMPLING) + 0.5) / SUPERSAMPLING
    place = np.stack(np.meshgrid(places, places), axis=-1)
    values = light(place - nearest_middles(grid, place))
    return values.reshape(size, SUPERSAMPLING, size, SUPERSAMPLING).mean(axis=(1, 3))


def inner_middles(grid, count):
    columns, rows = np.meshgrid(np.arange(3, count), np.arange(3, count))
    return grid.place(columns.ravel(), rows.ravel())


def test_shape_is_that_which_was_drawn():
    grid = lattice(7.3, 1.3, (3.2, 3.9))
    true = SubimageShape(amplitude=0.8, falloff=0.3, radius=3.1, blur=0.4, base=0.05, spill=0.0)

    def light(offset):
        squared = (offset**2).sum(axis=-1)
        return true.base + true.amplitude * true._disc(squared)

    found = fit_shape(draw(grid, 100, light), grid, inner_middles(grid, 10), Levels(0.0, 1.0))
    # Nothing of these discs is beyond their cells, and so nothing tells what spills.
    assert np.array(found[:5]) == pytest.approx(np.array(true[:5]), abs=0.005)


@pytest.mark.parametrize("hexagonal", [False, True], ids=["square", "hexagonal"])
@pytest.mark.parametrize("blades", [8, 40])
def test_error_of_pixels_is_taken_off_other_shapes(blades, hexagonal):
    """Sub-images are polygons with an edge like a ramp, clipped, unlike the discs that are fitted."""
    grid = lattice(6.0, 0.0, (5.37, 6.18), hexagonal=hexagonal)
    angles = 2.0 * np.pi * np.arange(blades) / blades + 0.2

    def light(offset):
        farthest = np.max([offset @ np.array([np.cos(angle), np.sin(angle)]) for angle in angles], axis=0)
        return np.clip((2.5 - farthest) / 0.7 + 0.5, 0.0, 1.0)

    white, levels = np.minimum(draw(grid, 90, light), 0.7), Levels(0.0, 0.7)
    middles = inner_middles(grid, 9)
    wrong = measure_subimages(white, grid, middles, levels).away
    bias = measure_bias(fit_shape(white, grid, middles, levels), grid, levels)
    before, after = (np.hypot(*each.T).max() for each in (wrong, wrong - bias.at(middles)))
    assert before > 0.02
    assert after < 0.4 * before


def test_places_between_those_drawn_are_interpolated():
    grid, levels = lattice(6.0, 0.0, (0.0, 0.0)), Levels(0.0, 0.7)
    shape = SubimageShape(amplitude=1.0, falloff=0.2, radius=2.7, blur=0.4, base=0.0, spill=0.0)
    bias = measure_bias(shape, grid, levels)
    place = (5.31, 6.94)
    moved = lattice(6.0, 0.0, place)
    pixels = np.stack(np.meshgrid(np.arange(40) + 0.5, np.arange(40) + 0.5), axis=-1)
    away = pixels - nearest_middles(moved, pixels)
    white = shape.draw(away[..., 0], away[..., 1], moved, 0.7)
    middle = np.array([moved.place(2, 2)])
    found = measure_subimages(white, moved, middle, levels).away
    assert np.abs(found).max() > 0.005
    assert bias.at(middle) == pytest.approx(found, abs=0.0005)
