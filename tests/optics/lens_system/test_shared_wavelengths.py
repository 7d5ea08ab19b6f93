"""Wavelengths that share a camera's rays: the mean is unbiased, and colours have less noise."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import entry
from raytracer.core.sampling import SAMPLERS, pixel_key, sample_2d
from raytracer.core.simd import WIDTH
from raytracer.core.spectra import FIRST, LAST, response
from raytracer.kernel.hero_wavelength import (
    DispersiveLens,
    DispersiveMaterials,
    MonochromaticCamera,
    start_rgb_path,
    wavelength_rows,
)
from raytracer.kernel.lens_dispersion import LENS_ROWS, WAVELENGTHS_PER_RAY, apply_lens_color, share_lens_rays
from raytracer.optics.glass import LINE_D
from raytracer.optics.lens_system.packets import DIRECTION, EXTENT, ORIGIN, ROWS, WAVELENGTH, WEIGHT
from raytracer.optics.lens_system.pupils.search import on_axis_solid_angle
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import reverse_lens
from raytracer.plugins.cameras.base.interface import (
    FILTER,
    WavelengthSharing,
    lane_ray,
    set_lane,
    share_wavelengths,
    trace_lanes,
)
from raytracer.plugins.cameras.lens import RealLens
from raytracer.plugins.materials.base.interface import Draws
from raytracer.scene.assets.lenses import read_lens
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack, pack_spectrum
from tests.moving import pictured
from tests.optics.lens_system.kernels import Array
from tests.optics.lens_system.test_packets import to_the_pupil, trace_in_packets
from tests.optics.lens_system.test_shipped_lenses import every_lens
from tests.repository import SCENES

LENSES = SCENES / "lenses"
EDGE = ((1.0, 0.1, 0.0), (0.0, 0.3, 1.0))


class Room(NamedTuple):
    """What of a workspace is used here."""

    wavelengths: Any
    lens: Array
    lens_weights: Array


def camera_of(name, width, **keys):
    keys = {"lens": name, "look_from": (0.0, 0.0, 5.0), "look_at": (0.0, 0.0, 0.0), **keys}
    return RealLens(**keys).bind_assets({"lens": read_lens(LENSES / f"{name}.yaml")})


@entry
def _estimate(camera, spectrum, sampler, work, x, y, count, slope, edge, moments):
    """Sums of what samples of a pixel show, and of its squares: a colour on each side of an edge in the world."""
    key = pixel_key(sampler, x, y)
    for first in range(0, count, WIDTH):
        for lane in range(WIDTH):
            draws = Draws(sampler, key, first + lane, 0)
            u, v = sample_2d(sampler, key, first + lane, FILTER)
            set_lane(camera, work.lens, lane, x + u, y + v, draws)
        trace_lanes(camera, work.lens)
        share_lens_rays(spectrum, camera, work, x, y, 0, WIDTH)
        for lane in range(WIDTH):
            draws = Draws(sampler, key, first + lane, 0)
            origin, way, weight = lane_ray(camera, work.lens, lane, 0.0, 0.0, None, draws)
            start_rgb_path(spectrum, work, lane, draws, origin, way)
            if weight > 0.0:
                value = apply_lens_color(spectrum, work, lane, edge[0] if way[0] > -slope * way[2] else edge[1])
                for channel in range(3):
                    moments[0, channel] += weight * value[channel]
                    moments[1, channel] += (weight * value[channel]) ** 2


def estimated(camera, spectrum, pixel, slope, count, edge=EDGE, seed=0):
    """Mean and variance by channel of a pixel's samples."""
    moments = np.zeros((2, 3))
    room = Room(wavelength_rows(spectrum, WIDTH), np.zeros((LENS_ROWS, WIDTH)), np.zeros((WIDTH, WAVELENGTHS_PER_RAY)))
    sampler = SAMPLERS["independent"](seed, 1)
    _estimate(camera, spectrum, sampler, room, *pixel, count, slope, edge, moments)
    mean = moments[0] / count
    return mean, moments[1] / count - mean**2


# In the middle of a coarse film, where all wavelengths share; and far out on finer ones, where some do.
PLACES = [
    ("double-gauss-50mm", 24, 12, 8, 0.25),
    ("double-gauss-50mm", 1200, 60, 40, 0.8),
    ("flint-100mm", 24, 3, 2, 0.6),
    ("flint-100mm", 240, 20, 20, 0.99),
    ("flint-100mm", 1200, 500, 390, 1.01),
]


@pytest.mark.parametrize(("name", "width", "x", "y", "less"), PLACES)
def test_shared_rays_show_what_rays_of_one_wavelength_do(name, width, x, y, less):
    height = width * 2 // 3
    lens = camera_of(name, width)
    camera = lens.pack(width, height)
    spectrum = pack_spectrum(None, camera, 1.0, None)
    assert isinstance(spectrum, DispersiveLens)
    _, way = lens.film_to_ray((x + 0.5) / width, (y + 0.5) / height, width, height)
    count, slope = 1 << 18, float(way[0] / way[2])
    alone, alone_spread = estimated(
        camera, spectrum._replace(camera=MonochromaticCamera()), (x, y), slope, count, seed=1
    )
    shared, spread = estimated(camera, spectrum, (x, y), slope, count, seed=2)
    noise = np.sqrt((alone_spread + spread) / count)
    assert (noise < 0.02 * alone.max()).all()
    np.testing.assert_array_less(np.abs(shared - alone), 4.0 * noise)
    assert spread.sum() < less * alone_spread.sum()


@pytest.mark.parametrize("width", [241, 2401])
def test_a_white_furnace_shows_how_wide_the_pupil_is_at_each_wavelength(width):
    camera = camera_of("double-gauss-50mm", width, f_number=8).pack(width, 161)
    spectrum = pack_spectrum(None, camera, 1.0, None)
    wavelengths = np.linspace(FIRST, LAST, 21)
    light = [
        on_axis_solid_angle(camera.surfaces, camera.film.z, wavelength, is_round=True) for wavelength in wavelengths
    ]
    relative = np.array(light) / on_axis_solid_angle(camera.surfaces, camera.film.z, LINE_D, is_round=True)
    np.testing.assert_allclose(relative, 1.0, atol=0.05)
    fine = np.arange(FIRST, LAST + 0.5)
    expected = np.trapezoid(response(fine) * np.interp(fine, wavelengths, relative)[:, None], fine, axis=0)
    white = ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
    count = 1 << 18
    mean, spread = estimated(camera, spectrum, (width // 2, 80), 0.0, count, white)
    np.testing.assert_array_less(np.abs(mean - expected), 4.0 * np.sqrt(spread / count) + 5e-4)
    if width == 241:
        # What is left is nearly that of three wavelengths in strata, and that of the pupil's bounds.
        np.testing.assert_array_less(spread, [0.5, 0.4, 0.5])


@entry
def _back(camera, sharing, sampler, rows, others, x, y, by, found):
    key = pixel_key(sampler, x, y)
    for lane in range(WIDTH):
        u, v = sample_2d(sampler, key, lane, FILTER)
        set_lane(camera, rows, lane, x + u, y + v, Draws(sampler, key, lane, 0))
        found[0, lane], found[1, lane] = rows[ORIGIN, lane], rows[ORIGIN + 1, lane]
    trace_lanes(camera, rows)
    for lane in range(WIDTH):
        others[WAVELENGTH, lane] = rows[WAVELENGTH, lane] + by
    share_wavelengths(camera, sharing, rows, others, x, y)


@pytest.mark.parametrize("name", ["double-gauss-50mm", "flint-100mm", "anamorphic-75mm"])
def test_a_ray_of_the_same_wavelength_comes_back_to_where_it_began(name):
    camera = camera_of(name, 240).pack(240, 160)
    spectrum = pack_spectrum(None, camera, 1.0, None)
    assert isinstance(spectrum, DispersiveLens)
    rows, others, began = np.zeros((16, WIDTH)), np.zeros((16, WIDTH)), np.zeros((2, WIDTH))
    _back(camera, spectrum.camera, SAMPLERS["independent"](1, 1), rows, others, 60, 40, 0.0, began)
    lit = rows[WEIGHT] > 0.0
    assert lit.sum() > 2
    np.testing.assert_allclose(others[WEIGHT, lit], 1.0, rtol=1e-12)
    np.testing.assert_allclose(others[EXTENT, lit], rows[EXTENT, lit], rtol=1e-10)
    np.testing.assert_allclose(others[ORIGIN : ORIGIN + 2, lit], began[:, lit], rtol=0.0, atol=1e-10)


@every_lens
def test_through_a_turned_lens_rays_go_as_to_the_film(path):
    lens = read_lens(path)
    packed = lens.packed(dispersion=True)
    starts, ways = to_the_pupil(lens, packed, 1024)
    wavelengths = np.linspace(400.0, 700.0, len(starts))
    weights, points, onward = trace_rays(packed, starts, ways, False, wavelengths)
    lit = weights > 0.0
    count = lit.sum() // WIDTH * WIDTH
    points, onward, wavelengths = points[lit][:count], onward[lit][:count], np.roll(wavelengths[lit], 5)[:count]
    rays = np.zeros((WEIGHT + 1, count))
    mirror = np.array([1.0, 1.0, -1.0])
    rays[ORIGIN : ORIGIN + 3], rays[DIRECTION : DIRECTION + 3] = (points * mirror).T, (-onward * mirror).T
    rays[WAVELENGTH], rays[WEIGHT] = wavelengths, 1.0
    trace_in_packets(reverse_lens(packed), rays, np.zeros((ROWS, WIDTH)))
    weights, points, onward = trace_rays(packed, points, -onward, True, wavelengths)
    np.testing.assert_array_equal(rays[WEIGHT], weights)
    passed = weights > 0.0
    assert passed.mean() > 0.9
    size = np.abs(starts).max()
    back = rays[ORIGIN : ORIGIN + 3, passed].T * mirror
    np.testing.assert_allclose(back, points[passed], rtol=0.0, atol=1e-13 * size)
    np.testing.assert_allclose(rays[DIRECTION : DIRECTION + 3, passed].T * mirror, onward[passed], rtol=0.0, atol=1e-12)


SCENE = """
film: {width: 24, height: 16, filter: FILTER}
camera: {type: lens, lens: lenses/flint-100mm.yaml, look_from: [0, 0, 5], look_at: [0, 0, 0]CAMERA}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.1, 0.3, 1.0]}
render: {max_depth: 4}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 0.4, material: MATERIAL}
"""


def spectrum_of(*, pixels="box", camera="", material="{type: lambertian}"):
    text = SCENE.replace("FILTER", pixels).replace("CAMERA", camera).replace("MATERIAL", material)
    return pack(build(text, "test.yaml", base=SCENES)).scene.spectrum


def test_rays_are_shared_only_where_all_that_differs_is_the_place_in_a_pixel():
    moving = ", motion: {velocity: [1, 0, 0]}, shutter: "
    assert spectrum_of().camera.tolerance == 1.0
    assert isinstance(spectrum_of(camera=moving + "1/10 s").camera, WavelengthSharing)
    assert spectrum_of(pixels="gaussian").camera == MonochromaticCamera()
    assert spectrum_of(camera=", flare: true").camera == MonochromaticCamera()
    assert spectrum_of(camera=moving + "{duration: 1/10 s, readout: 1/10 s}").camera == MonochromaticCamera()
    assert spectrum_of(camera=", dispersion: false") is None
    assert isinstance(spectrum_of(material="{type: dielectric, ior: N-SF11}"), DispersiveMaterials)


@pytest.mark.slow
def test_pictures_by_shared_rays_are_those_by_rays_of_one_wavelength():
    text = (
        SCENE.replace("FILTER", "box")
        .replace("CAMERA", "")
        .replace("MATERIAL", "{type: lambertian, albedo: [0.8, 0.2, 0.05]}")
    )
    packed = pack(build(text, "test.yaml", base=SCENES))
    alone = packed._replace(
        scene=packed.scene._replace(spectrum=packed.scene.spectrum._replace(camera=MonochromaticCamera()))
    )
    first, second = pictured(packed, spp=4096, seed=1), pictured(alone, spp=4096, seed=2)
    off = (first.radiance - second.radiance) / np.sqrt(first.variance + second.variance)
    assert np.abs(off).max() < 5.0
    np.testing.assert_array_less(np.abs(off.mean(axis=(0, 1))), 4.0 / np.sqrt(off[..., 0].size))
    np.testing.assert_allclose(off.std(axis=(0, 1)), 1.0, atol=0.15)
    assert (first.variance.sum(axis=(0, 1)) < 0.5 * second.variance.sum(axis=(0, 1))).all()
    np.testing.assert_array_equal(pictured(packed, spp=64, seed=3).radiance, pictured(packed, spp=64, seed=3).radiance)
