"""Openings that are not round: the part of them that pixels and views see."""

import numpy as np
import pytest

from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.openings import OpeningTable, disc_coverage
from raytracer.lightfield.coverage import lit_views, within_lens
from raytracer.lightfield.synthetic_aperture import cell_weights
from raytracer.plugins.apertures.base.interface import AnamorphicAperture
from tests.plugins.cameras.kernels import weighted_rays
from tests.small_scenes import scene

WIDTH = 120
KEYS = "sensor: {width: 6 mm, height: 6 mm}, focal_length: 40 mm, f_number: 4, microlenses: {pixels: 12}"
OBJECTS = """
materials: {grey: {type: lambertian}}
objects: [{type: sphere, center: [0, 0, -2], radius: 1, material: grey}]
"""


def camera_of(shape, base=None):
    text = f"camera: {{type: light_field, look_from: [0, 0, 2], look_at: [0, 0, 0], aperture_shape: {shape}, {KEYS}}}"
    return scene(text + OBJECTS, base=base, width=WIDTH, height=WIDTH, filled=False).camera


def test_an_ellipse_covers_what_a_disc_covers_of_squeezed_rectangles():
    rng = np.random.default_rng(7)
    left, bottom = rng.uniform(-2.4, 1.6, (2, 300))
    table = OpeningTable(AnamorphicAperture(None, 0.8, 1.25))
    found = table.coverage(left, bottom, 0.7, 0.5, 1.5)
    exact = disc_coverage(left / 0.8, bottom / 1.25, 0.7 / 0.8, 0.5 / 1.25, 1.5)
    assert 0 < (exact == 0.0).sum() < 150
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=0.005)


def _ring(folder):
    """A ring whose inner radius is half of its outer, as a picture in a folder."""
    x, y = np.meshgrid(np.arange(200) - 99.5, np.arange(200) - 99.5)
    away = np.hypot(x, y)
    np.save(folder / "ring.npy", ((away < 99.0) & (away > 49.5)).astype(np.float32)[..., None])
    return "{type: image, file: ring.npy}"


@pytest.mark.parametrize("shape", ["{type: polygon, blades: 3}", "{type: round, anamorphic: 2}", "ring"])
def test_the_layout_knows_which_views_are_lit_and_by_how_much(shape, tmp_path):
    camera = camera_of(_ring(tmp_path) if shape == "ring" else shape, tmp_path)
    layout = camera.lenslets(WIDTH, WIDTH)
    views = layout.views

    # The light of pixels behind the middle microlenses, by rays of the packed camera.
    count, rng = 60_000, np.random.default_rng(2)
    x, y = rng.uniform(48.0, 72.0, (2, count))
    shapes = {} if shape != "ring" else {"aperture_shape.file": camera._opening_assets["aperture_shape.file"]}
    weights = weighted_rays(camera.pack(WIDTH, WIDTH, shapes), x, y)[2]
    column, row = (np.floor(a).astype(int) % 12 for a in (x, y))
    drawn = np.array([[weights[(row == i) & (column == j)].mean() for j in range(12)] for i in range(12)])
    np.testing.assert_allclose(views.coverage, drawn, rtol=0.0, atol=0.12)
    assert np.abs(views.coverage - drawn).mean() < 0.015
    np.testing.assert_array_equal(cell_weights(views), views.coverage)
    np.testing.assert_array_equal(within_lens(views), views.coverage > 0.0)
    if shape == "ring":
        assert views.coverage[5:7, 5:7].max() == 0.0
        assert views.coverage.max() == pytest.approx(1.0, abs=1e-9)


def test_pixels_are_brightened_by_the_opening_that_is_there(tmp_path):
    camera = camera_of("{type: polygon, blades: 3}")
    layout = camera.lenslets(WIDTH, WIDTH)
    lit = layout.lit
    radiance = np.repeat(lit[..., None], 3, axis=2)
    views, _, _ = layout._split_radiance(radiance, lit)
    covered = layout.views.coverage > 1e-6
    np.testing.assert_allclose(views[covered], 1.0, rtol=0.0, atol=1e-9)
    assert (views[~covered] == 0.0).all()
    field = LightField(views, layout.views)
    np.testing.assert_array_equal(lit_views(field), layout.views.coverage > 0.0)

    # Files keep it.
    lf.write(tmp_path / "triangle.lf", field)
    with lf.open(tmp_path / "triangle.lf") as stored:
        np.testing.assert_array_equal(stored.views.coverage, layout.views.coverage)
