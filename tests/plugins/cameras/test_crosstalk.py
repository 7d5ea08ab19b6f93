"""Crosstalk between microlenses: light that goes through one and falls behind its neighbours."""

import math

import numpy as np
import pytest

from raytracer.film.light_field.openings import disc_coverage
from raytracer.plugins.cameras.light_field import LightField
from tests.plugins.cameras.kernels import weighted_rays
from tests.plugins.cameras.test_cameras import camera
from tests.repository import SCENES

WIDTH, PIXELS = 300, 12
MATCHED = 0.9796
"""Distance of the sensor (mm) at which the sub-images of THIN, 12 pixels of 20 um, touch: 12 x 20 um x f/4, focused."""

THIN = {
    "type": "light_field",
    "sensor": {"width": "6 mm", "height": "6 mm"},
    "focal_length": 40.0,
    "f_number": 4.0,
    "focus_distance": 2.0,
}


def thin(**microlenses):
    return LightField.model_validate({**THIN, "microlenses": {"pixels": PIXELS, "model": "pinhole", **microlenses}})


def places(count=40_000, height=60.0):
    """Film positions over whole cells in the middle, which have neighbours on all sides."""
    rng = np.random.default_rng(5)
    return rng.uniform(120.0, 180.0, count), rng.uniform(120.0, 120.0 + height, count)


def weights_of(spec, x, y):
    return weighted_rays(spec.pack(WIDTH, WIDTH), x, y)[2]


def radius(spec):
    """Radius of the sub-image of the main lens's opening (px)."""
    lenslets = spec.lenslets(WIDTH, WIDTH)
    return 0.5 * lenslets.aperture / lenslets.stride


@pytest.mark.parametrize(("layout", "rows"), [("square", 1.0), ("hexagonal", math.sqrt(3.0) / 2.0)])
@pytest.mark.parametrize("stretch", [0.7, 1.2, 1.9, 2.6])
def test_a_place_gets_the_light_of_each_microlens_whose_sub_image_covers_it(layout, rows, stretch):
    spec = thin(distance=stretch * MATCHED, layout=layout, crosstalk=True)
    x, y = places(60_000, 6.0 * rows * PIXELS)
    found, lattice, reach = weights_of(spec, x, y), spec.lenslets(WIDTH, WIDTH).lattice, radius(spec)
    number = np.rint(lattice.index(np.column_stack([x, y])))
    around = np.stack(np.meshgrid(np.arange(-4, 5), np.arange(-4, 5)), axis=-1).reshape(-1, 2)
    middles = lattice.place(*np.moveaxis(number[:, None] + around, -1, 0))
    covered = (np.hypot(x[:, None] - middles[..., 0], y[:, None] - middles[..., 1]) <= reach).sum(axis=1)
    np.testing.assert_array_equal(found, covered)
    # Energy: what comes through a microlens is all there, spread over the disc of its sub-image.
    assert found.mean() == pytest.approx(math.pi * reach**2 / (rows * PIXELS**2), rel=0.01)


def test_the_part_that_sub_images_share_is_that_of_discs():
    # Two discs of the radius r, s apart, share 2 r^2 acos(s / 2r) - s sqrt(4 r^2 - s^2) / 2; each cell has two such
    # pairs, and for r < s / sqrt(2) no place lies in three.
    spec = thin(distance=1.25 * MATCHED, crosstalk=True)
    r, s = radius(spec), float(PIXELS)
    assert 0.5 * s < r < s / math.sqrt(2.0)
    shared = 2.0 * r * r * math.acos(0.5 * s / r) - 0.5 * s * math.sqrt(4.0 * r * r - s * s)
    found = weights_of(spec, *places(200_000))
    assert (found > 1.5).mean() == pytest.approx(2.0 * shared / s**2, rel=0.02)

    # Without crosstalk a cell gets no more than its own disc's part in it.
    own = weights_of(thin(distance=1.25 * MATCHED), *places(200_000))
    assert own.max() == 1.0
    assert own.mean() == pytest.approx(float(disc_coverage(-0.5 * s, -0.5 * s, s, s, r)), rel=0.005)
    assert found.mean() - own.mean() == pytest.approx(math.pi * r * r / s**2 - own.mean(), rel=0.02)


def test_where_f_numbers_match_there_is_none():
    x, y = places()
    with_it, without = (weights_of(thin(crosstalk=wanted), x, y) for wanted in (True, False))
    np.testing.assert_array_equal(with_it, without)


@pytest.mark.slow
def test_blurred_sub_images_share_no_less_light():
    # Microlenses of another focal length blur the sub-images, and so let light across their borders; none is lost.
    spec = thin(model="lens", focal_length=0.8, distance=MATCHED, crosstalk=True)
    found = weights_of(spec, *places(200_000))
    reach = 0.5 * spec.lenslets(WIDTH, WIDTH).aperture / spec.lenslets(WIDTH, WIDTH).stride
    assert found.mean() == pytest.approx(math.pi * reach**2 / PIXELS**2, rel=0.02)
    own = weights_of(thin(model="lens", focal_length=0.8, distance=MATCHED), *places(200_000))
    assert own.mean() < 0.99 * found.mean()


@pytest.mark.slow
def test_behind_glass_no_light_is_lost_beyond_the_cells():
    """Behind a lens of glass sub-images twice as wide share the light of one, spread over four times the area."""

    def mean_light(**keys):
        spec = camera(
            type="light_field", lens=str(SCENES / "lenses" / "double-gauss-50mm.yaml"), f_number=2, focus_distance=1,
            sensor={"width": 6, "height": 6}, dispersion=False, microlenses={"pixels": PIXELS, **keys},
        )  # fmt: skip
        array = spec.arrangement(WIDTH, WIDTH)
        # A pixel's light is what comes in a solid angle; the gain of radiance has none, so that of areas is left.
        # Sub-images are as far apart on the sensor, 12 pixels, at any distance: the microlenses come closer together.
        return weights_of(spec, *places(200_000)).mean(), array.distance / array.spacing

    matched, near = mean_light(crosstalk=True)
    wide, far = mean_light(crosstalk=True, distance="1 mm")
    assert far > 1.5 * near
    assert wide == pytest.approx(matched * (far / near) ** 2, rel=0.01)
    assert mean_light(distance="1 mm")[0] < 0.75 * wide
