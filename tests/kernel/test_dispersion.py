"""Scenes in which glass disperses: nothing is gained or lost, grey stays grey, and colours go where they must."""

import math

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.fresnel import fresnel_dielectric
from raytracer.core.sampling import SAMPLERS
from raytracer.core.spectra import FIRST, LAST, response, spectra
from raytracer.kernel.hero_wavelength import (
    LENS_ROW,
    WAVELENGTH_ROW,
    DispersiveLens,
    DispersiveMaterials,
    MonochromaticCamera,
    start_rgb_path,
    wavelengths_of,
)
from raytracer.kernel.path_state import workspace
from raytracer.optics.glass import CATALOGUE
from raytracer.plugins.materials.base.interface import BLACK, Draws
from raytracer.rendering.path_debug import trace_sample
from raytracer.rendering.path_text import format_path
from raytracer.rendering.render import render
from raytracer.scene.effects import effects_of
from raytracer.scene.pack.scene import pack
from tests.moving import pictured
from tests.small_scenes import assert_mean, image, mean, scene
from tests.vectorised import rows, vectorised

FLINT = "{index: 1.785, abbe: 25.7}"
NOTHING = "{cauchy: [1.6, 1.0e-9]}"
"""Glass that disperses by nothing."""

SKY = "environment: {type: constant, radiance: 1}"

BALL = f"""
camera: {{type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 20}}
{SKY}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {{type: dielectric, ior: {FLINT}}}}}
"""


def floor(ior, grey="0.5", light=SKY):
    return f"""
camera: {{type: pinhole, look_from: [0, 1, 5], look_at: [0, 0, 0], vfov: 50}}
{light}
objects:
  - {{type: disc, center: [0, -1, 0], normal: [0, 1, 0], radius: 9, material: {{type: lambertian, albedo: {grey}}}}}
  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {{type: dielectric, ior: {ior}}}}}
"""


def test_a_ball_of_flint_in_a_white_furnace_is_white():
    picture = image(BALL, lit=True, spp=1024, max_depth=1000)
    assert_mean(picture, 1.0, relative_noise=0.01)
    # By the hue of one wavelength alone a sample would be off by 2.2, 1.5 and 1.7.
    assert (np.sqrt(1024 * picture.variance.mean(axis=(0, 1))) < 0.6).all()


def test_a_ball_of_flint_in_coloured_light_has_its_colour():
    # Clear glass takes nothing from a furnace of one colour, whichever wavelengths a path goes on with.
    picture = image(BALL.replace("radiance: 1", "radiance: [0.9, 0.3, 0.1]"), lit=True, spp=1024, max_depth=1000)
    np.testing.assert_allclose(picture.radiance.mean(axis=(0, 1)), [0.9, 0.3, 0.1], rtol=0.005)


def test_glass_that_disperses_by_nothing_is_plain_glass():
    pictures = [image(floor(ior), lit=True, spp=1024, seed=seed) for seed, ior in enumerate((NOTHING, "1.6"))]
    one, plain = (picture.radiance.reshape(4, 4, 4, 4, 3).mean(axis=(1, 3)) for picture in pictures)
    noise = sum(picture.variance.reshape(4, 4, 4, 4, 3).sum(axis=(1, 3)) / 256.0 for picture in pictures)
    assert (np.abs(one - plain) < 4.5 * np.sqrt(noise) + 1e-9).all()
    assert noise.max() < 0.02**2


def test_light_from_before_the_wavelengths_part_counts_once():
    # The floor is lit by a lamp, which paths look for before they go on into the ball, and are traced anew there.
    lamp = "  - {type: sphere, center: [0, 7, 1], radius: 2, material: {type: emitter, radiance: 10}}\n"
    (one, noise), (plain, other) = (
        mean(image(floor(ior, light="") + lamp, lit=True, spp=4096, max_depth=3, seed=seed))
        for seed, ior in enumerate((NOTHING, "1.6"))
    )
    assert (np.hypot(noise, other) < 0.0025 * plain).all(), np.hypot(noise, other) / plain
    np.testing.assert_array_less(np.abs(one - plain), 4.0 * np.hypot(noise, other))


def test_grey_is_exactly_grey_where_light_met_nothing_that_disperses():
    # Two segments: the floor is lit straight from the sky, and of glass only what is reflected outside is seen.
    picture = image(floor(FLINT), lit=True, spp=16, max_depth=2).radiance
    spread = np.ptp(picture, axis=2)
    assert (spread[-3:] == 0.0).all()
    assert (spread[0] == 0.0).all()
    assert spread.max() > 0.0


def test_bits_do_not_depend_on_the_number_of_threads_and_on_a_crop():
    spec = scene(floor(FLINT), lit=True, spp=37, width=44, height=36)
    one = render(spec, threads=1).image.radiance
    np.testing.assert_array_equal(render(spec, threads=3).image.radiance, one)
    np.testing.assert_array_equal(render(spec, crop=(13, 9, 31, 33)).image.radiance, one[9:33, 13:31])


@kernel
def number_of_hero(spectrum, work, sampler, index):
    start_rgb_path(spectrum, work, 0, Draws(sampler, 5, index, 0), BLACK, BLACK)
    return wavelengths_of(work, 0).u


def test_the_sampler_stratifies_wavelengths():
    # Of 256 samples of a pixel, each has the wavelength of a stratum of its own.
    packed = pack(scene(BALL)).scene
    for sampler, stratified in (("sobol", True), ("independent", False)):
        numbers = SAMPLERS[sampler](1, 256)
        u = vectorised(number_of_hero)(packed.spectrum, workspace(packed), numbers, rows(np.arange(256)))
        assert (np.unique(np.floor(256.0 * u)).size == 256) == stratified


# ---- Where light goes


def refracted(direction, normal, eta):
    """Snell's law for unit vectors; normal against the direction, eta behind it over before it."""
    cosine = -float(direction @ normal)
    return direction / eta + (cosine / eta - math.sqrt(1.0 - (1.0 - cosine**2) / eta**2)) * normal


# A prism of 30 degrees in front of a camera at z = 1, whose second face is at z = 0.
FACE = np.array([math.sin(math.radians(30.0)), 0.0, math.cos(math.radians(30.0))])


def place(glass, wavelength):
    """Trace a ray along -z to the wall at z = -4: its position there (m), and its transmittance."""
    eta = float(CATALOGUE[glass].ior(wavelength))
    within = refracted(np.array([0.0, 0.0, -1.0]), FACE, eta)
    transmitted = 1.0 - fresnel_dielectric(FACE[2], eta)[0]
    at = np.array([0.0, 0.0, 0.2]) + within * (0.2 / -within[2])
    transmitted *= 1.0 - fresnel_dielectric(-within[2], 1.0 / eta)[0]
    out = refracted(within, np.array([0.0, 0.0, 1.0]), 1.0 / eta)
    return float((at + out * (4.0 / -out[2]))[0]), transmitted


@pytest.mark.slow
@pytest.mark.parametrize(("low", "high"), [(440.0, 460.0), (540.0, 560.0), (620.0, 680.0)])
def test_a_prism_sends_each_wavelength_where_snell_says(low, high):
    # A lamp lies at the wall just where light of wavelengths from low to high (nm) goes.
    left, right = sorted(place("N-SF11", wave)[0] for wave in (low, high))
    # 0.7 m along the sloping face.
    slope = 0.7 * np.array([FACE[2], 0.0, -FACE[0]])
    start = np.array([0.0, -0.5, 0.2]) - 0.3 * slope
    glass = "material: {type: dielectric, ior: N-SF11}"
    wall = f"[{left}, -1, -4], edges: [[{right - left}, 0, 0], [0, 2, 0]]"
    text = f"""
camera: {{type: pinhole, look_from: [0, 0, 1], look_at: [0, 0, 0], vfov: 0.0001}}
objects:
  - {{type: quad, corner: {start.tolist()}, edges: [{slope.tolist()}, [0, 1, 0]], {glass}}}
  - {{type: quad, corner: [-1, -0.5, 0], edges: [[0, 1, 0], [2, 0, 0]], {glass}}}
  - {{type: quad, corner: {wall}, material: {{type: emitter, radiance: 1}}}}
"""
    waves = np.linspace(low, high, 2001)
    seen = response(waves) * np.array([place("N-SF11", wave)[1] for wave in waves])[:, None]
    expected = np.trapezoid(seen, waves, axis=0)
    # Two faces are met, and none again: what is reflected within counts for nothing.
    color, noise = mean(image(text, lit=True, spp=8192, max_depth=3))
    assert (noise < 0.02 * np.abs(expected).max()).all()
    np.testing.assert_array_less(np.abs(color - expected), 4.0 * noise + 1e-6)
    # The channel that sees such light best.
    assert np.argmax(color) == (2 if high < 500.0 else 1 if high < 600.0 else 0)


# ---- Among other things


def test_the_effect_is_told_and_packed_only_where_something_disperses():
    # A material that no object has calls for nothing.
    unused = floor("1.6").replace("objects:", "materials: {f: {type: dielectric, ior: N-SF11}}\nobjects:")
    for text, disperses in ((floor(FLINT), True), (floor("1.6"), False), (unused, False)):
        spec = scene(text)
        packed = pack(spec).scene
        assert packed.spectrum is None or packed.spectrum.camera is None
        assert isinstance(packed.spectrum, DispersiveMaterials) == effects_of(spec, packed)["dispersion"].active
        assert isinstance(packed.spectrum, DispersiveMaterials) == disperses
        rows = workspace(packed).wavelengths
        assert (rows is not None and rows.dtype == WAVELENGTH_ROW) == disperses
    lens = workspace(packed._replace(spectrum=DispersiveLens(spectra()))).wavelengths
    assert lens.dtype == LENS_ROW


@pytest.mark.slow
def test_a_path_written_down_tells_its_wavelengths():
    spec = scene(BALL, spp=8)
    picture = render(spec, threads=1).image.radiance[8, 8]
    paths = [trace_sample(spec, (8, 8), sample) for sample in range(8)]
    np.testing.assert_allclose(np.mean([one.value for one in paths], axis=0), picture, rtol=1e-12)
    for one in paths:
        surfaces = [event for event in one.events if event["event"] == "surface"]
        scattered = [event for event in one.events if event["event"] == "scatters"]
        assert surfaces[0]["wavelengths"] == []
        assert len(scattered[0]["wavelengths"]) in (1, 3)
        # Once for each of its wavelengths, where these have parted.
        turns = [event["event"] for event in one.events].count("again")
        assert turns == (2 if any(len(event["wavelengths"]) == 1 for event in scattered) else 0)
        assert all(FIRST <= wave <= LAST for event in scattered for wave in event["wavelengths"])
        assert one.first_non_finite is None
        assert f"{scattered[0]['wavelengths'][0]:.9g}" in format_path(one)
        assert one.json()["events"][0]["wavelength"] is None


@pytest.mark.slow
def test_parts_of_the_light_add_up_and_a_clamp_holds():
    layers = render(scene(floor(FLINT, "[0.7, 0.4, 0.2]"), spp=32), aovs=("direct", "indirect")).image
    np.testing.assert_allclose(
        layers.layers["direct"] + layers.layers["indirect"], layers.radiance, rtol=0.0, atol=1e-12
    )
    assert render(scene(floor(FLINT), spp=32, clamp=0.8)).image.radiance.max() <= 0.8 + 1e-12


# A cloud that takes no light, in a solid with a priority, beside water.
CLOUD = f"""
camera: {{type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 25}}
{SKY}
media: {{cloud: {{type: homogeneous, scattering: [2, 1, 0.5]}}}}
materials:
  glass: {{type: dielectric, ior: N-SF11, priority: 2}}
  water: {{type: dielectric, ior: water, priority: 1}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1, medium: cloud, material: glass}}
  - {{type: sphere, center: [0.8, 0, 0], radius: 0.8, material: water}}
"""
FURNACES = {"cloud": CLOUD} | {
    f"rough {roughness}": BALL.replace("type: dielectric", f"type: rough_dielectric, roughness: {roughness}")
    for roughness in (0.3, 0.7)
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FURNACES)
def test_a_white_furnace_with_other_effects_is_white(name):
    assert_mean(image(FURNACES[name], spp=4096, max_depth=1000), 1.0, relative_noise=0.005)


@pytest.mark.slow
def test_the_same_glass_in_itself_is_not_there():
    one = """
camera: {type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 25}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.1, 0.3, 1.0]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric, ior: N-SF11, priority: 1}}
"""
    inner = "{type: sphere, center: [0, 0, 0.2], radius: 0.5, material: {type: dielectric, ior: N-SF11, priority: 2}}"
    pictures = [image(text, spp=2048, max_depth=100, seed=len(text)) for text in (one, f"{one}  - {inner}\n")]
    (first, noise), (second, other) = map(mean, pictures)
    np.testing.assert_array_less(np.abs(first - second), 4.0 * np.hypot(noise, other))


# ---- Cameras whose lens disperses


COLOURED = """
camera: {type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 20}
environment: {type: constant, radiance: [0.9, 0.6, 0.3]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: [0.8, 0.2, 0.1]}}
"""


def assert_pictured(packed, spectrum, expected, relative_noise):
    result = pictured(packed._replace(scene=packed.scene._replace(spectrum=spectrum)), spp=2048, seed=2)
    value, noise = mean(result)
    assert (noise < relative_noise * expected).all()
    np.testing.assert_array_less(np.abs(value - expected), 4.0 * noise)


def test_rays_of_one_wavelength_each_give_all_colours_back():
    # Means of the sky, and of the matte ball in front of it, without noise but for what is at its edge.
    expected = mean(image(COLOURED, lit=True, spp=4096))[0]
    assert_pictured(pack(scene(COLOURED, spp=64)), DispersiveLens(spectra()), expected, 0.02)


@pytest.mark.slow
def test_a_lens_and_glass_that_both_disperse_keep_a_white_furnace_white():
    packed = pack(scene(BALL, spp=1024, max_depth=1000))
    assert_pictured(packed, packed.scene.spectrum._replace(camera=MonochromaticCamera()), np.ones(3), 0.005)
