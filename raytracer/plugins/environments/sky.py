"""Sky: the clear or hazy sky of a day, by an analytic model.

In a scene:

    environment: {type: sky, sun_elevation: 35, sun_azimuth: 120, turbidity: 3, scale: 0.01, sun: true}
"""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raytracer.core.vec import Vec3
from raytracer.optics.thin_lens import WHITE_EFFICACY
from raytracer.plugins.environments.base.equirectangular import Equirectangular, equirectangular
from raytracer.plugins.environments.base.interface import Assets, EnvironmentSpec, SunDisc
from raytracer.schema.fields import MAX_MAGNITUDE, Albedo, Angle, Direction, NonNegativeNumber, Quantity
from raytracer.schema.rules import never, only
from raytracer.schema.spec import field_error

Floats = NDArray[np.float64]

HEIGHT, WIDTH = 512, 1024
"""Size of the map that the sky is tabulated in; the horizon lies between two rows."""

SUN_ANGLE = 0.53
"""Angular diameter of the sun in degrees, on the mean of a year."""

# Perez coefficients A..E of Y, x and y, each as (slope, offset) in turbidity: Preetham et al. 1999, appendix A.2.
_PEREZ = {
    "Y": ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)),
    "x": ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)),
    "y": ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)),
}

# Zenith chromaticity, (T^2, T, 1) M (theta^3, theta^2, theta, 1): Preetham et al. 1999, appendix A.2.
_ZENITH_X = np.array(
    [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ]
)
_ZENITH_Y = np.array(
    [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]
)

# From 380 nm on in steps of 10 nm, the sun's radiance outside the atmosphere in W/(cm2 um sr), and the absorption of
# ozone in 1/cm: Preetham et al. 1999, table 2.
_STEP = 10.0
_WAVELENGTHS: Floats = np.arange(380.0, 760.0, _STEP)
# fmt: off
_SOLAR = np.array([
    1655.9, 1623.37, 2112.75, 2588.82, 2582.91, 2423.23, 2676.05, 2965.83, 3054.54, 3005.75, 3066.37, 2883.04, 2871.21,
    2782.5, 2710.06, 2723.36, 2636.13, 2550.38, 2506.02, 2531.16, 2535.59, 2513.42, 2463.15, 2417.32, 2368.53, 2321.21,
    2282.77, 2233.98, 2197.02, 2152.67, 2109.79, 2072.83, 2024.04, 1987.08, 1942.72, 1907.24, 1862.89, 1825.92,
])
_OZONE = np.array([
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, 0.006, 0.009, 0.014, 0.021, 0.03,
    0.04, 0.048, 0.063, 0.075, 0.085, 0.103, 0.12, 0.12, 0.115, 0.125, 0.12, 0.105, 0.09,
    0.079, 0.067, 0.057, 0.048, 0.036, 0.028, 0.023, 0.018, 0.014, 0.011, 0.01, 0.009,
])
# fmt: on


def perez(coefficients: Floats, cosine: Floats, gamma: Floats) -> Floats:
    """Evaluate Perez' function of cos theta > 0, theta the angle from the zenith, and the angle gamma from the sun.

    coefficients : A, B, C, D, E.

    References: Preetham et al. 1999, eq. 3.
    """
    a, b, c, d, e = coefficients
    return np.asarray((1.0 + a * np.exp(b / cosine)) * (1.0 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2))


def zenith(turbidity: float, theta_sun: float) -> dict[str, float]:
    """Return luminance Y (kcd/m2) and chromaticity x, y of the zenith, for a sun at theta_sun (rad) from it.

    References: Preetham et al. 1999, appendix A.2.
    """
    chi = (4.0 / 9.0 - turbidity / 120.0) * (math.pi - 2.0 * theta_sun)
    powers = np.array([theta_sun**3, theta_sun**2, theta_sun, 1.0])
    turbidities = np.array([turbidity**2, turbidity, 1.0])
    return {
        "Y": (4.0453 * turbidity - 4.9710) * math.tan(chi) - 0.2155 * turbidity + 2.4192,
        "x": float(turbidities @ _ZENITH_X @ powers),
        "y": float(turbidities @ _ZENITH_Y @ powers),
    }


def skylight(turbidity: float, toward: Vec3, directions: Floats) -> Floats:
    """Return chromaticity x, y and luminance Y (kcd/m2) of the sky, (..., 3) in the order x, y, Y.

    toward : unit vector to the sun.  directions : unit vectors (..., 3) above the horizon, +y.

    References: Preetham et al. 1999, eq. 4 and appendix A.2.
    """
    cosine = directions[..., 1]
    gamma = np.arccos(np.clip(directions @ np.array(toward), -1.0, 1.0))
    theta_sun = math.acos(min(1.0, toward[1]))
    at_zenith = zenith(turbidity, theta_sun)
    values = []
    for name in ("x", "y", "Y"):
        coefficients = np.array([slope * turbidity + offset for slope, offset in _PEREZ[name]])
        relative = perez(coefficients, cosine, gamma) / perez(coefficients, np.array(1.0), np.array(theta_sun))
        values.append(at_zenith[name] * relative)
    return np.stack(values, axis=-1)


def sunlight(turbidity: float, theta_sun: float) -> Floats:
    """Return CIE XYZ (3,) of the sun's mean radiance at the ground, Y in cd/m2; theta_sun is its angle from the zenith.

    It is weakened by molecules, by haze, and by 3.5 mm of ozone; gases and water absorb where the eye is blind.

    References: Preetham et al. 1999, appendix A.1.
    """
    elevation = 93.885 - math.degrees(theta_sun)
    air_mass = 1.0 / (math.cos(theta_sun) + 0.15 * elevation**-1.253)
    micrometres = 1e-3 * _WAVELENGTHS
    haze = 0.04608 * turbidity - 0.04586
    depth = 0.008735 * micrometres**-4.08 + haze * micrometres**-1.3 + 0.35 * _OZONE

    # From W/(cm2 um sr) to W/(m2 nm sr).
    radiance = 10.0 * _SOLAR * np.exp(-air_mass * depth)
    return np.asarray(683.0 * _STEP * color_matching(_WAVELENGTHS) @ radiance)


def color_matching(wavelength: Floats) -> Floats:
    """Return the CIE 1931 colour matching functions x, y, z, (3, n), at wavelengths (n,) in nm, within about 1 %.

    References: Wyman, Sloan, Shirley 2013, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions",
    JCGT 2(2), eq. 4.
    """

    def lobe(mean: float, below: float, above: float) -> Floats:
        t = (wavelength - mean) / np.where(wavelength < mean, below, above)
        return np.asarray(np.exp(-0.5 * t * t))

    return np.stack(
        [
            1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2),
            0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
            1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8),
        ]
    )


def _xyz(x: Floats, y: Floats, luminance: Floats) -> Floats:
    """Convert chromaticities and luminance to CIE XYZ (..., 3)."""
    return np.stack([x / y * luminance, luminance, (1.0 - x - y) / y * luminance], axis=-1)


def linear_rec709(xyz: Floats) -> Floats:
    """Convert CIE XYZ to linear Rec. 709 (..., 3); values outside the gamut are clipped at 0.

    References: ITU-R BT.709-6, items 1.3 and 1.4; SMPTE RP 177-1993 for the matrix of primaries and white.
    """
    one = np.ones(3)
    primaries = _xyz(np.array([0.64, 0.30, 0.15]), np.array([0.33, 0.60, 0.06]), one).T
    white = _xyz(np.array(0.3127), np.array(0.3290), np.array(1.0))
    to_xyz = primaries * np.linalg.solve(primaries, white)
    return np.maximum(xyz @ np.linalg.inv(to_xyz).T, 0.0)


class Sky(EnvironmentSpec):
    """The sky on a day without clouds, and if asked for its sun; below the horizon, a ground that they light.

    Luminance is converted at 179 lm/W, so a clear sky is some 30 W/(m2 sr) and full sunlight some 500 W/m2: `scale`
    brings them to where a picture without exposure needs them.  Light that reaches the ground from the sky and, if
    there is one, from the sun leaves it evenly; the ground is part of the environment and casts no shadow.

    References: Preetham, Shirley, Smits 1999, "A Practical Analytic Model for Daylight", SIGGRAPH '99, appendix A;
    Perez, Seals, Michalsky 1993, "All-weather Model for Sky Luminance Distribution".
    """

    has_importance_sampling: ClassVar[bool] = True

    type: Literal["sky"] = "sky"
    sun_elevation: Annotated[float, Quantity("angle", low=0.0, high=90.0)] = Field(
        default=45.0, description="the sun's height above the horizon"
    )
    sun_azimuth: Angle = Field(default=0.0, description="where the sun stands: clockwise from above, 0 at -z, 90 at +x")
    sun_direction: Direction | None = Field(
        default=None, description="direction to the sun, in place of elevation and azimuth; y at least 0"
    )
    turbidity: Annotated[float, Quantity(low=2.0, high=10.0)] = Field(
        default=3.0, description="haze: 2 is very clear, 3 clear, 6 warm and moist, 10 hazy"
    )
    ground_albedo: Albedo = Field(default=(0.0, 0.0, 0.0), description="albedo of the ground below the horizon")
    scale: NonNegativeNumber = Field(default=1.0, description="factor to all radiance; 0: none")
    sun: bool = Field(default=False, description="whether the sun itself is there: a light of kind `sun`")

    _one_position = never(
        "sun_elevation",
        "sun_azimuth",
        where="sun_direction",
        message="is given besides sun_direction, which says the same",
    )
    _sun_above_horizon = only(
        "sun_direction",
        where=lambda sky: sky.sun_direction[1] >= 0.0,
        message="points below the horizon, where the model holds no more; y must be at least 0",
    )

    @model_validator(mode="after")
    def _sun_in_range(self) -> "Sky":
        disc = self.sun_disc()
        brightest = 0.0 if disc is None else max(disc.irradiance)
        if brightest and not 1.0 / MAX_MAGNITUDE <= brightest <= MAX_MAGNITUDE:
            field_error(
                "scale",
                f"gives the sun an irradiance of {brightest:.2g} W/m2, and {1.0 / MAX_MAGNITUDE:g} to "
                f"{MAX_MAGNITUDE:g} is possible",
            )
        return self

    def toward(self) -> Vec3:
        """Return the unit vector to the sun."""
        if self.sun_direction is not None:
            x, y, z = np.array(self.sun_direction) / max(map(abs, self.sun_direction))
            length = math.hypot(x, y, z)
            return float(x / length), float(y / length), float(z / length)
        elevation, azimuth = math.radians(self.sun_elevation), math.radians(self.sun_azimuth)
        across = math.cos(elevation)
        return across * math.sin(azimuth), math.sin(elevation), -across * math.cos(azimuth)

    def pack(self, assets: Assets) -> Equirectangular | None:
        return equirectangular(self.radiance())

    def radiance(self) -> Floats:
        """Make the map of the sky and the ground: (HEIGHT, WIDTH, 3), see `equirectangular`."""
        theta = math.pi * (np.arange(HEIGHT // 2) + 0.5) / HEIGHT
        phi = 2.0 * math.pi * (np.arange(WIDTH) + 0.5) / WIDTH
        cosine, sine = np.cos(theta)[:, None], np.sin(theta)[:, None]
        directions = np.stack(np.broadcast_arrays(sine * np.sin(phi), cosine, -sine * np.cos(phi)), axis=-1)
        x, y, luminance = np.moveaxis(skylight(self.turbidity, self.toward(), directions), -1, 0)
        sky = linear_rec709(_xyz(x, y, np.maximum(luminance, 0.0))) * (1000.0 * self.scale / WHITE_EFFICACY)

        # What falls upon the ground, by the midpoint rule over the rows.
        solid_angle = (math.pi / HEIGHT) * (2.0 * math.pi / WIDTH) * sine * cosine
        falling = (sky * solid_angle[..., None]).sum(axis=(0, 1))
        if (disc := self.sun_disc()) is not None:
            falling += max(0.0, -disc.direction[1]) * np.array(disc.irradiance)
        ground = np.array(self.ground_albedo) * falling / math.pi
        return np.concatenate([sky, np.broadcast_to(ground, sky.shape)])

    def sun_disc(self) -> SunDisc | None:
        if not self.sun:
            return None
        x, y, z = self.toward()
        projected = math.pi * math.sin(math.radians(0.5 * SUN_ANGLE)) ** 2
        xyz = sunlight(self.turbidity, math.acos(min(1.0, y)))
        red, green, blue = linear_rec709(xyz) * (projected * self.scale / WHITE_EFFICACY)
        return SunDisc((-x, -y, -z), (float(red), float(green), float(blue)), SUN_ANGLE)
