"""The analytic sky: values of its paper, and what is plain to the eye."""

import math

import numpy as np
import pytest

from raytracer.optics.thin_lens import WHITE_EFFICACY
from raytracer.plugins.environments import sky
from raytracer.plugins.environments.sky import (
    HEIGHT,
    SUN_ANGLE,
    color_matching,
    linear_rec709,
    perez,
    skylight,
    sunlight,
    zenith,
)
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import ENVIRONMENTS
from tests.plugins.environments.kernels import seen
from tests.plugins.shapes.kernels import uniform_directions
from tests.small_scenes import scene

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def spec_of(**keys):
    return ENVIRONMENTS.specs()["sky"].model_validate({"type": "sky", **keys})


def up(elevation, azimuth=0.0):
    """Unit vector at an elevation, and an azimuth from -z over +x."""
    e, a = math.radians(elevation), math.radians(azimuth)
    return np.array([math.cos(e) * math.sin(a), math.sin(e), -math.cos(e) * math.cos(a)])


def test_zenith_is_that_of_the_paper():
    # By hand, from appendix A.2: T = 2, theta = 45 degrees; chi = (4/9 - 2/120) pi/2 = 0.671952, tan = 0.795436.
    # Y = 3.1196 * 0.795436 - 0.431 + 2.4192 = 4.46964 kcd/m2.
    values = zenith(2.0, math.pi / 4.0)
    assert values["Y"] == pytest.approx(4.4696, abs=2e-4)
    # x: the rows of its matrix count T^2, T and 1.
    t = math.pi / 4.0
    x = (
        4.0 * (0.00166 * t**3 - 0.00375 * t**2 + 0.00209 * t)
        + 2.0 * (-0.02903 * t**3 + 0.06377 * t**2 - 0.03202 * t + 0.00394)
        + (0.11693 * t**3 - 0.21196 * t**2 + 0.06052 * t + 0.25886)
    )
    assert values["x"] == pytest.approx(x, rel=1e-12)
    # The zenith is bluer than white, (0.3127, 0.3290).
    assert values["x"] < 0.27
    assert values["y"] < 0.28
    # Looking up is the zenith, whatever Perez' function is.
    sun = tuple(up(45.0))
    np.testing.assert_allclose(
        skylight(2.0, sun, np.array([0.0, 1.0, 0.0])), [values["x"], values["y"], values["Y"]], rtol=1e-12
    )


def test_perez_function_by_hand():
    # (1 + A e^(B / cos theta)) (1 + C e^(D gamma) + E cos^2 gamma) with both angles 60 degrees.
    value = perez(np.array([-1.0, -0.3, 10.0, -3.0, 0.45]), np.array(0.5), np.array(math.pi / 3.0))
    assert float(value) == pytest.approx(
        (1.0 - math.exp(-0.6)) * (1.0 + 10.0 * math.exp(-math.pi) + 0.45 / 4.0), rel=1e-12
    )


def test_distribution_is_that_of_the_paper():
    # Preetham et al. 1999, appendix A.2, at turbidity 2: A to E of Y, x and y.
    published = {
        "Y": [-1.1056, -0.2833, 5.2797, -2.3359, 0.2363],
        "x": [-0.2978, -0.1322, 0.2117, -1.0271, 0.0386],
        "y": [-0.2942, -0.1808, 0.1944, -1.7419, 0.0311],
    }
    for name, coefficients in published.items():
        np.testing.assert_allclose(np.array(sky._PEREZ[name]) @ (2.0, 1.0), coefficients, rtol=0.0, atol=1e-12)


def test_sky_is_bright_near_the_sun_and_blue_away_from_it():
    sky = spec_of(sun_elevation=30, sun_azimuth=90, turbidity=2.5).pack({})
    near, zenith_, opposite = seen(sky, np.stack([up(32.0, 90.0), up(90.0), up(60.0, -90.0)]))
    assert near @ LUMINANCE > 3.0 * (zenith_ @ LUMINANCE)
    for blue in (zenith_, opposite):
        assert blue[2] > 1.5 * blue[0]
    # The sun is at azimuth 90, that is +x: the brightest of the horizon ring.
    ring = seen(sky, np.stack([up(30.0, azimuth) for azimuth in range(0, 360, 10)])) @ LUMINANCE
    assert int(np.argmax(ring)) == 9


def test_haze_whitens_and_the_sun_reddens_towards_the_horizon():
    blueness = []
    for turbidity in (2.0, 4.0, 8.0):
        red, _, blue = seen(spec_of(sun_elevation=45, turbidity=turbidity).pack({}), up(80.0, 180.0))[0]
        blueness.append(blue / red)
    assert blueness[0] > blueness[1] > blueness[2] > 1.0
    suns = [spec_of(sun_elevation=elevation, sun=True).sun_disc().irradiance for elevation in (60, 30, 10)]
    redness = [red / blue for red, _, blue in suns]
    assert 1.0 < redness[0] < redness[1] < redness[2]


def test_direction_and_angles_are_the_same_sun():
    one, other = spec_of(sun_elevation=30, sun_azimuth=120), spec_of(sun_direction=list(4.0 * up(30.0, 120.0)))
    np.testing.assert_allclose(one.toward(), other.toward(), atol=1e-15)
    np.testing.assert_allclose(spec_of(sun_direction=[1e-30, 1e-30, 0]).toward(), up(45.0, 90.0), atol=1e-15)


def test_map_holds_the_model():
    keys = {"sun_elevation": 40, "sun_azimuth": 200, "turbidity": 4, "scale": 0.1}
    spec = spec_of(**keys)
    directions = np.stack([up(e, a) for e in (3.0, 20.0, 50.0, 85.0) for a in range(0, 360, 30)])
    x, y, luminance = skylight(4.0, spec.toward(), directions).T
    shown = seen(spec.pack({}), directions)
    # Luminance over the map's own values, at 179 lm/W.
    np.testing.assert_allclose(shown @ LUMINANCE * WHITE_EFFICACY / 0.1, 1000.0 * luminance, rtol=0.01)
    assert (x < 0.4).all()
    assert (y < 0.4).all()


def test_ground_reflects_what_falls_on_it():
    # A furnace from below: ground albedo times irradiance over pi, evenly.
    spec = spec_of(sun_elevation=35, turbidity=3, ground_albedo=[0.2, 0.4, 0.6], sun=True)
    directions = uniform_directions(200_000, 0)
    directions[:, 1] = np.abs(directions[:, 1])
    sky = 2.0 * math.pi * (seen(spec.pack({}), directions) * directions[:, 1:2]).mean(axis=0)
    disc = spec.sun_disc()
    falling = sky + np.array(disc.irradiance) * math.sin(math.radians(35.0))
    for below in (-1.0, -30.0, -90.0):
        np.testing.assert_allclose(
            seen(spec.pack({}), up(below, 70.0))[0], np.array([0.2, 0.4, 0.6]) * falling / math.pi, rtol=0.01
        )
    assert not seen(spec_of(sun=True).pack({}), up(-1.0)).any()
    assert HEIGHT % 2 == 0


def test_sun_outside_the_haze_is_about_a_hundred_kilolux():
    # Direct sunlight at the ground on a clear day, sun high: 90 to 110 klx (Illuminating Engineering Society).
    disc = spec_of(sun_elevation=70, turbidity=2, sun=True).sun_disc()
    lux = float(np.array(disc.irradiance) @ LUMINANCE) * WHITE_EFFICACY
    assert 85e3 < lux < 115e3
    assert disc.angle == SUN_ANGLE
    np.testing.assert_allclose(disc.direction, -up(70.0), atol=1e-15)


def test_near_the_horizon_the_path_is_that_through_a_round_atmosphere(monkeypatch):
    # Light of one wavelength, 550 nm, for which Bouguer's law holds exactly; air masses at 0, 60 and 85 degrees from
    # the zenith: Kasten, Young 1989, "Revised Optical Air Mass Tables", Applied Optics 28(22).
    monkeypatch.setattr(sky, "_SOLAR", np.where(sky._WAVELENGTHS == 550.0, sky._SOLAR, 0.0))
    top, half, low = (math.log(sunlight(2.0, math.radians(angle))[1]) for angle in (0.0, 60.0, 85.0))
    assert (low - half) / (half - top) == pytest.approx((10.306 - 1.994) / (1.994 - 1.0), rel=0.01)


def test_colour_matching_functions_are_normalised():
    # The CIE's are made so that their integrals are equal, 106.86 nm; the fit keeps that within a thousandth.
    integrals = color_matching(np.arange(360.0, 831.0)).sum(axis=1)
    np.testing.assert_allclose(integrals, 106.86, rtol=2e-3)


def test_white_is_white():
    # D65's chromaticity, luminance 1, is (1, 1, 1); the primaries' luminances are those of Rec. 709.
    white = np.array([0.3127 / 0.3290, 1.0, (1.0 - 0.3127 - 0.3290) / 0.3290])
    np.testing.assert_allclose(linear_rec709(white), 1.0, rtol=1e-12)
    xyz_of_green = np.array([0.30, 0.60, 0.10]) / 0.60 * 0.7152
    np.testing.assert_allclose(linear_rec709(xyz_of_green), [0.0, 1.0, 0.0], atol=1e-3)


def test_scale_scales_and_zero_is_none():
    direction = up(60.0, 10.0)
    once, twice = (seen(spec_of(scale=s, sun=True).pack({}), direction)[0] for s in (0.5, 1.0))
    np.testing.assert_allclose(twice, 2.0 * once, rtol=1e-6)
    assert spec_of(scale=0).pack({}) is None


def test_the_sun_of_a_sky_is_a_light():
    text = """
camera: {type: pinhole, look_from: [0, 3, 0], look_at: [0, 0, 0], up: [0, 0, 1], vfov: 2}
environment: {type: sky, sun: SUN}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian}}
"""

    def tables(sun):
        lights = pack(scene(text.replace("SUN", sun), filled=False)).scene.lights
        return [type(table).__name__ for table in lights.tables]

    assert tables("true") == ["Suns", "Background"]
    assert tables("false") == ["Background"]
