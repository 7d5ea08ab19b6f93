"""Scenes in which glass disperses: nothing is gained or lost, grey stays grey, and colours go where they must."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.core.fresnel import fresnel_dielectric
from raytracer.core.spectra import FIRST, LAST, response, spectra
from raytracer.kernel.hero_wavelength import DispersiveLens, DispersiveMaterials, MonochromaticCamera
from raytracer.optics.glass import CATALOGUE, Glass
from raytracer.rendering.path_debug import trace_sample
from raytracer.rendering.path_text import format_path
from raytracer.rendering.render import render
from raytracer.scene.effects import effects_of
from raytracer.scene.pack.scene import pack
from tests.moving import pictured
from tests.small_scenes import assert_mean, image, mean, scene

FLINT = "{index: 1.785, abbe: 25.7}"

BALL = """
camera: {type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 20}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric, ior: FLINT}}
"""

FLOOR = """
camera: {type: pinhole, look_from: [0, 1, 5], look_at: [0, 0, 0], vfov: 50}
environment: {type: constant, radiance: 1}
objects:
  - {type: quad, corner: [-9, -1, 9], edges: [[18, 0, 0], [0, 0, -18]], material: {type: lambertian, albedo: GREY}}
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric, ior: FLINT}}
"""


def floor(ior: str, grey: str = "0.5") -> str:
    return FLOOR.replace("GREY", grey).replace("FLINT", ior)


def test_a_ball_of_flint_in_a_white_furnace_is_white() -> None:
    picture = image(BALL.replace("FLINT", FLINT), spp=1024, max_depth=1000)
    assert_mean(picture, 1.0, relative_noise=0.01)
    # By the hue of one wavelength alone a sample would be off by 2.2, 1.5 and 1.7.
    assert picture.variance is not None
    assert (np.sqrt(1024 * picture.variance.mean(axis=(0, 1))) < 0.6).all()


def test_a_ball_of_flint_in_coloured_light_has_its_colour() -> None:
    # Clear glass takes nothing from a furnace of one colour, whichever wavelengths a path goes on with.
    text = BALL.replace("FLINT", FLINT).replace("radiance: 1", "radiance: [0.9, 0.3, 0.1]")
    picture = image(text, spp=1024, max_depth=1000)
    np.testing.assert_allclose(picture.radiance.mean(axis=(0, 1)), [0.9, 0.3, 0.1], rtol=0.005)


def test_glass_that_disperses_by_nothing_is_plain_glass() -> None:
    by_wavelength, plain = (
        image(floor(ior), spp=1024, max_depth=50, seed=seed)
        for seed, ior in enumerate(("{cauchy: [1.6, 1.0e-9]}", "1.6"))
    )
    assert by_wavelength.variance is not None
    assert plain.variance is not None
    rows = [picture.radiance.reshape(4, 4, 4, 4, 3).mean(axis=(1, 3)) for picture in (by_wavelength, plain)]
    noise = sum(picture.variance.reshape(4, 4, 4, 4, 3).sum(axis=(1, 3)) / 256.0 for picture in (by_wavelength, plain))
    assert (np.abs(rows[0] - rows[1]) < 4.5 * np.sqrt(noise) + 1e-9).all()
    assert noise.max() < 0.02**2


def test_light_from_before_the_wavelengths_part_counts_once() -> None:
    # The floor is lit by a point, which paths look for before they go on into the ball, and are traced anew there.
    lit = "lights: [{type: point, position: [0, 4, 1], intensity: 40}]"
    by_wavelength, plain = (
        image(floor(ior).replace("environment: {type: constant, radiance: 1}", lit), spp=1024, max_depth=50, seed=seed)
        for seed, ior in enumerate(("{cauchy: [1.6, 1.0e-9]}", "1.6"))
    )
    np.testing.assert_allclose(by_wavelength.radiance.mean(axis=(0, 1)), plain.radiance.mean(axis=(0, 1)), rtol=0.005)


def test_grey_is_exactly_grey_where_light_met_nothing_that_disperses() -> None:
    # Two segments: the floor is lit straight from the sky, and of glass only what is reflected outside is seen.
    picture = image(floor(FLINT), spp=16, max_depth=2).radiance
    spread = np.ptp(picture, axis=2)
    assert (spread[-3:] == 0.0).all()
    assert (spread[0] == 0.0).all()
    assert spread.max() > 0.0


def test_bits_do_not_depend_on_the_number_of_threads() -> None:
    spec = scene(floor(FLINT), spp=32, sampler="sobol")
    one, three = (render(spec, threads=threads).image.radiance for threads in (1, 3))
    np.testing.assert_array_equal(one, three)


def test_the_sampler_stratifies_wavelengths() -> None:
    noise = []
    for sampler in ("independent", "sobol"):
        picture = image(BALL.replace("FLINT", FLINT), spp=256, max_depth=1000, sampler=sampler, width=8, height=8)
        noise.append(np.mean((picture.radiance - 1.0) ** 2))
    assert noise[1] < noise[0] / 3.0


# ---- Where light goes


def refracted(direction: NDArray[np.float64], normal: NDArray[np.float64], eta: float) -> NDArray[np.float64]:
    """Snell's law for unit vectors; normal against the direction, eta behind it over before it."""
    cosine = -float(direction @ normal)
    return direction / eta + (cosine / eta - math.sqrt(1.0 - (1.0 - cosine**2) / eta**2)) * normal


class Wedge:
    """A prism of 30 degrees in front of a camera at z = 1, whose second face is at z = 0."""

    first = np.array([math.sin(math.radians(30.0)), 0.0, math.cos(math.radians(30.0))])

    def __init__(self, glass: Glass) -> None:
        self._glass = glass

    def place(self, wavelength: float) -> tuple[float, float]:
        """Trace a ray along -z to the wall at z = -4: returns its position there (m), and its transmittance."""
        eta = float(self._glass.ior(wavelength))
        at = np.array([0.0, 0.0, 0.2])
        within = refracted(np.array([0.0, 0.0, -1.0]), self.first, eta)
        transmitted = 1.0 - fresnel_dielectric(self.first[2], eta)[0]
        at = at + within * (at[2] / -within[2])
        transmitted *= 1.0 - fresnel_dielectric(-within[2], 1.0 / eta)[0]
        out = refracted(within, np.array([0.0, 0.0, 1.0]), 1.0 / eta)
        return float((at + out * (4.0 / -out[2]))[0]), transmitted


def strip(glass: str, low: float, high: float) -> tuple[str, NDArray[np.float64]]:
    """A scene with a lamp at the wall just where light of wavelengths from low to high (nm) goes, and what is seen."""
    wedge = Wedge(CATALOGUE[glass])
    left, right = sorted((wedge.place(low)[0], wedge.place(high)[0]))
    # 0.7 m along the sloping face.
    slope = 0.7 * np.array([wedge.first[2], 0.0, -wedge.first[0]])
    start = np.array([0.0, -0.5, 0.2]) - 0.3 * slope
    corner = ", ".join(f"{value:.17g}" for value in start)
    edge = ", ".join(f"{value:.17g}" for value in slope)
    waves = np.linspace(low, high, 2001)
    seen = response(waves) * np.array([wedge.place(wave)[1] for wave in waves])[:, None]
    lamp = "{type: emitter, radiance: 1}"
    return (
        f"""
camera: {{type: pinhole, look_from: [0, 0, 1], look_at: [0, 0, 0], vfov: 0.0001}}
objects:
  - {{type: quad, corner: [{corner}], edges: [[{edge}], [0, 1, 0]], material: {{type: dielectric, ior: {glass}}}}}
  - {{type: quad, corner: [-1, -0.5, 0], edges: [[0, 1, 0], [2, 0, 0]], material: {{type: dielectric, ior: {glass}}}}}
  - {{type: quad, corner: [{left}, -1, -4], edges: [[{right - left}, 0, 0], [0, 2, 0]], material: {lamp}}}
""",
        np.trapezoid(seen, waves, axis=0),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("low", "high"), [(440.0, 460.0), (540.0, 560.0), (620.0, 680.0)])
def test_a_prism_sends_each_wavelength_where_snell_says(low: float, high: float) -> None:
    text, expected = strip("N-SF11", low, high)
    # Two faces are met, and none again: what is reflected within counts for nothing.
    picture = image(text, spp=8192, max_depth=3)
    color, noise = mean(picture)
    assert (noise < 0.02 * np.abs(expected).max()).all()
    np.testing.assert_array_less(np.abs(color - expected), 4.0 * noise + 1e-6)
    # The channel that sees such light best.
    assert np.argmax(color) == (2 if high < 500.0 else 1 if high < 600.0 else 0)


def test_red_is_bent_least() -> None:
    wedge = Wedge(CATALOGUE["N-SF11"])
    places = [abs(wedge.place(wavelength)[0]) for wavelength in (450.0, 550.0, 650.0)]
    assert places == sorted(places, reverse=True)


# ---- Among other things


def test_the_effect_is_told_and_packed_only_where_something_disperses() -> None:
    spec = scene(floor(FLINT))
    packed = pack(spec).scene
    assert isinstance(packed.spectrum, DispersiveMaterials)
    assert packed.spectrum.camera is None
    assert effects_of(spec, packed)["dispersion"].active
    plain = scene(floor("1.6"))
    assert pack(plain).scene.spectrum is None
    assert not effects_of(plain, pack(plain).scene)["dispersion"].active
    # A material that no object has calls for nothing.
    unused = scene(floor("1.6").replace("objects:", "materials: {f: {type: dielectric, ior: N-SF11}}\nobjects:"))
    assert pack(unused).scene.spectrum is None


@pytest.mark.slow
def test_a_path_written_down_tells_its_wavelengths() -> None:
    spec = scene(BALL.replace("FLINT", FLINT), spp=8, max_depth=50)
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
        json = one.json()
        assert json["events"][0]["wavelength"] is None


@pytest.mark.slow
def test_parts_of_the_light_add_up_and_a_clamp_holds() -> None:
    spec = scene(floor(FLINT, "[0.7, 0.4, 0.2]"), spp=32)
    result = render(spec, threads=2, aovs=("direct", "indirect"))
    np.testing.assert_allclose(
        result.image.layers["direct"] + result.image.layers["indirect"], result.image.radiance, rtol=0.0, atol=1e-12
    )
    clamped = spec.model_copy(update={"render": spec.render.model_copy(update={"clamp": 0.8})})
    assert render(clamped, threads=2).image.radiance.max() <= 0.8 + 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.3, 0.7])
def test_rough_flint_in_a_white_furnace_is_white(roughness: float) -> None:
    rough = BALL.replace("type: dielectric", f"type: rough_dielectric, roughness: {roughness}").replace("FLINT", FLINT)
    assert_mean(image(rough, spp=4096, max_depth=1000), 1.0, relative_noise=0.005)


@pytest.mark.slow
def test_a_white_furnace_with_media_within_solids_that_disperse_is_white() -> None:
    # A cloud that takes no light, in a solid with a priority, beside water; all of it in a white furnace.
    whole = """
camera: {type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 25}
environment: {type: constant, radiance: 1}
media:
  cloud: {type: homogeneous, scattering: [2, 1, 0.5]}
objects:
  - type: sphere
    center: [0, 0, 0]
    radius: 1
    medium: cloud
    material: {type: dielectric, ior: N-SF11, priority: 2}
  - {type: sphere, center: [0.8, 0, 0], radius: 0.8, material: {type: dielectric, ior: water, priority: 1}}
"""
    assert_mean(image(whole, spp=4096, max_depth=1000), 1.0, relative_noise=0.005)


@pytest.mark.slow
def test_the_same_glass_in_itself_is_not_there() -> None:
    one = """
camera: {type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 25}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.1, 0.3, 1.0]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: dielectric, ior: N-SF11, priority: 1}}
"""
    inner = (
        "  - {type: sphere, center: [0, 0, 0.2], radius: 0.5, material: {type: dielectric, ior: N-SF11, priority: 2}}\n"
    )
    two = one + inner
    pictures = [image(text, spp=2048, max_depth=100, seed=seed) for seed, text in enumerate((one, two))]
    (first, noise), (second, other) = map(mean, pictures)
    np.testing.assert_array_less(np.abs(first - second), 4.0 * np.hypot(noise, other))


# ---- Cameras whose lens disperses


COLOURED = """
camera: {type: pinhole, look_from: [0, 0, 5], look_at: [0, 0, 0], vfov: 20}
environment: {type: constant, radiance: [0.9, 0.6, 0.3]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: [0.8, 0.2, 0.1]}}
"""


def test_rays_of_one_wavelength_each_give_all_colours_back() -> None:
    packed = pack(scene(COLOURED, spp=64))
    plain = pictured(packed, spp=64, seed=1)
    split = packed._replace(scene=packed.scene._replace(spectrum=DispersiveLens(spectra())))
    result = pictured(split, spp=2048, seed=2)
    pixels = result.variance.shape[0] * result.variance.shape[1]
    noise = np.sqrt(result.variance.sum(axis=(0, 1)) + plain.variance.sum(axis=(0, 1))) / pixels
    value, expected = result.radiance.mean(axis=(0, 1)), plain.radiance.mean(axis=(0, 1))
    assert (noise < 0.02 * expected).all()
    np.testing.assert_array_less(np.abs(value - expected), 4.0 * noise)


@pytest.mark.slow
def test_a_lens_and_glass_that_both_disperse_keep_a_white_furnace_white() -> None:
    packed = pack(scene(BALL.replace("FLINT", FLINT), spp=1024, max_depth=1000))
    spectrum = packed.scene.spectrum._replace(camera=MonochromaticCamera())
    result = pictured(packed._replace(scene=packed.scene._replace(spectrum=spectrum)), spp=2048, seed=3)
    pixels = result.variance.shape[0] * result.variance.shape[1]
    noise = np.sqrt(result.variance.sum(axis=(0, 1))) / pixels
    np.testing.assert_array_less(np.abs(result.radiance.mean(axis=(0, 1)) - 1.0), 4.0 * noise)
    assert (noise < 0.005).all()
