"""Packets of eight rays agree with single rays."""

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import entry
from raytracer.core.simd import WIDTH
from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.first_order import exit_pupil
from raytracer.optics.lens_system.focusing import film_position
from raytracer.optics.lens_system.lens import Element, Lens
from raytracer.optics.lens_system.packets import DIRECTION, ORIGIN, ROWS, WAVELENGTH, WEIGHT, trace_packet
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.plugins.apertures.polygon import PolygonAperture
from raytracer.scene.assets.lenses import read_lens
from tests.optics.lens_system.test_aspheres import ASPHERES
from tests.optics.lens_system.test_shipped_lenses import SHIPPED, every_lens


@entry
def trace_in_packets(lens, rays, packet):
    for first in range(0, rays.shape[1], WIDTH):
        for row in range(WEIGHT + 1):
            for lane in range(WIDTH):
                packet[row, lane] = rays[row, first + lane]
        trace_packet(lens, packet)
        for row in range(WEIGHT + 1):
            for lane in range(WIDTH):
                rays[row, first + lane] = packet[row, lane]


def assert_alike(lens, starts, ways, *, lit):
    """Packets of rays to the scene (n, 3) end as single rays do; of these a part of at least `lit` gets through."""
    wavelengths = np.linspace(400.0, 700.0, len(starts))
    rays = np.zeros((WEIGHT + 1, len(starts)))
    rays[ORIGIN : ORIGIN + 3], rays[DIRECTION : DIRECTION + 3] = starts.T, ways.T
    rays[WAVELENGTH], rays[WEIGHT] = wavelengths, 1.0
    trace_in_packets(lens, rays, np.zeros((ROWS, WIDTH)))
    weights, points, onward = trace_rays(lens, starts, ways, False, wavelengths)
    np.testing.assert_array_equal(rays[WEIGHT], weights)
    passed = weights > 0.0
    assert passed.mean() > lit
    size = np.abs(starts).max()
    np.testing.assert_allclose(rays[ORIGIN : ORIGIN + 3, passed].T, points[passed], rtol=0.0, atol=1e-14 * size)
    np.testing.assert_allclose(rays[DIRECTION : DIRECTION + 3, passed].T, onward[passed], rtol=0.0, atol=1e-12)


def to_the_pupil(lens, packed, count):
    """Rays from the middle half of the film towards the exit pupil and a bit beside it."""
    rng = np.random.default_rng(1)
    film, pupil = film_position(lens), exit_pupil(packed)
    size = 0.25 * (lens.image_circle or 10.0)
    starts = np.stack([*rng.uniform(-size, size, (2, count)), np.full(count, film)], axis=1)
    aims = np.stack([*rng.uniform(-1.2, 1.2, (2, count)) * pupil.radius, np.full(count, pupil.z)], axis=1)
    ways = (aims - starts) * np.sign(film - pupil.z)
    return starts, ways / np.linalg.norm(ways, axis=1)[:, None]


@every_lens
def test_packets_go_as_single_rays_through_shipped_lenses(path):
    lens = read_lens(path)
    packed = lens.packed(dispersion=True)
    assert_alike(packed, *to_the_pupil(lens, packed, 4096), lit=0.2)


@pytest.mark.parametrize("name", ASPHERES)
def test_packets_meet_surfaces_of_all_shapes_as_single_rays_do(name):
    element = ASPHERES[name]
    rng, count, radius = np.random.default_rng(2), 4096, element.radius
    # From within glass, at all angles: some are totally reflected, some miss, some come along the surface.
    aims = np.stack([*rng.uniform(-1.1, 1.1, (2, count)) * radius, np.zeros(count)], axis=1)
    ways = np.stack([*rng.uniform(-0.8, 0.8, (2, count)), rng.uniform(-1.0, -0.1, count)], axis=1)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    starts = aims - ways * (3.0 * radius / -ways[:, 2:])
    lens = Lens("a surface", (element, Element(0.0, 0.0, constant_index_glass(1.5), 1e3)))
    assert_alike(lens.packed(), starts, ways, lit=0.05)


@pytest.mark.parametrize("aperture", [PolygonAperture(blades=5), PolygonAperture(blades=6, curvature=0.5)])
def test_packets_know_the_shape_of_the_diaphragm(aperture):
    lens = read_lens(SHIPPED["double-gauss-50mm"])
    shaped = lens.packed(stop_radius=4.0, diaphragm=aperture.pack({}))
    assert_alike(shaped, *to_the_pupil(lens, lens.packed(stop_radius=4.0), 4096), lit=0.2)


def test_what_is_lost_stays_lost_and_is_no_danger_to_the_others():
    lens = Lens("ball", (Element(0.1, 20.0, constant_index_glass(1.5), 10.0), Element(-0.1, 0.0, AIR, 10.0))).packed()
    rays = np.zeros((WEIGHT + 1, WIDTH))
    rays[ORIGIN + 2], rays[DIRECTION + 2], rays[WAVELENGTH], rays[WEIGHT] = 30.0, -1.0, 550.0, 1.0
    rays[ORIGIN] = [0.0, 1.0, np.nan, np.inf, 50.0, 2.0, 1e300, 0.0]
    rays[WEIGHT, 7] = 0.0
    rays[DIRECTION, 5], rays[DIRECTION + 2, 5] = 1.0, 0.0
    trace_in_packets(lens, rays, np.zeros((ROWS, WIDTH)))
    assert rays[WEIGHT].tolist() == [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert np.isfinite(rays[:, :2]).all()
