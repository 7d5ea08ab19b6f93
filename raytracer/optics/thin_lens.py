"""Formulas of thin lenses and exposure: image distance, blur, depth of field, exposure values.

Lengths are in one unit, whichever it is, unless a name says otherwise; an infinite distance is `math.inf`.

References: Ray 2002, "Applied Photographic Optics", 3rd ed.; ISO 12232:2019, "Photography - Digital still cameras -
Determination of exposure index, ISO speed ratings, standard output sensitivity, and recommended exposure index".
"""

import math
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from pydantic import BeforeValidator, Field

from raytracer.schema.fields import Fraction, Quantity
from raytracer.schema.rules import only
from raytracer.schema.spec import Spec
from raytracer.util.errors import format_value

WHITE_EFFICACY = 179.0
"""Luminous efficacy (lm/W) of white light, evenly spread over the visible spectrum.

References: Ward 1994, "The RADIANCE Lighting Simulation and Rendering System", SIGGRAPH '94.
"""

SATURATION_EXPOSURE = 78.0
"""Exposure (lx s) that saturates a sensor, times its ISO speed: S_sat = 78 / H_sat (ISO 12232).

It leaves half a stop above a white surface where grey of 18 % has the exposure 10 / S.
"""

MEAN_EXPOSURE = 10.0
"""Mean exposure (lx s) of a correctly exposed picture, times the ISO speed: S_SOS = 10 / H (ISO 12232)."""

FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)
"""Diagonal (mm) of the 35 mm frame, which equivalent focal lengths refer to: CIPA DCG-001."""

_GREEN_NM = 550.0


# ---- Lens


def image_distance(focal_length: float, subject: float) -> float:
    """Compute the image distance of a thin lens for a subject: 1/f = 1/z_i + 1/z_o.

    Raises
    ------
    ValueError : the subject is not farther away than the focal length, so it has no real image.
    """
    if math.isinf(subject):
        return focal_length
    if subject <= focal_length:
        raise ValueError(f"a subject at {subject:g} has no image behind a lens of the focal length {focal_length:g}")
    return focal_length * subject / (subject - focal_length)


def focal_length_from_distances(image: float, subject: float) -> float:
    """Compute the focal length of the thin lens with these distances of image and subject: 1/f = 1/z_i + 1/z_o."""
    return image if math.isinf(subject) else image * subject / (image + subject)


def magnification(image: float, subject: float) -> float:
    """Compute the size of the image over that of the subject, z_i / z_o; 0 for a subject at infinity."""
    return image / subject


def field_of_view(size: float, image: float) -> float:
    """Compute the angle (deg) that a sensor of this size sees, 2 atan(size / 2 z_i)."""
    return math.degrees(2.0 * math.atan(0.5 * size / image))


def circle_of_confusion(pupil: float, image: float, focus: float, subject: float) -> float:
    """Compute the diameter on the sensor of the image of a point: A z_i |1/F - 1/s|, with the pupil's diameter A.

    It is the classical A |s - F| / s * f / (F - f), in a form that holds at infinity too.  The blur of a subject
    at 0, in the lens, is infinite.
    """
    if subject == 0.0:
        return math.inf
    return pupil * image * abs(1.0 / focus - 1.0 / subject)


def near_limit(focal_length: float, f_number: float, circle: float, focus: float) -> float:
    """Compute the nearest distance that is blurred by no more than `circle`: s f^2 / (f^2 + N c (s - f))."""
    square = focal_length * focal_length
    if math.isinf(focus):
        return square / (f_number * circle)
    return focus * square / (square + f_number * circle * (focus - focal_length))


def far_limit(focal_length: float, f_number: float, circle: float, focus: float) -> float:
    """Compute the farthest distance blurred by no more than `circle`: s f^2 / (f^2 - N c (s - f)); may be infinite."""
    square = focal_length * focal_length
    rest = square - f_number * circle * (focus - focal_length)
    return focus * square / rest if rest > 0.0 else math.inf


def hyperfocal(focal_length: float, f_number: float, circle: float) -> float:
    """Compute the hyperfocal distance, from which on the far limit is infinite: f^2 / (N c) + f."""
    return focal_length * focal_length / (f_number * circle) + focal_length


def airy_diameter_um(working_f_number: float) -> float:
    """Compute the diameter (um) of the Airy disc of green light, to the first dark ring: 2.44 lambda N.

    References: Airy 1835, "On the Diffraction of an Object-glass with Circular Aperture".
    """
    return 2.44 * 1e-3 * _GREEN_NM * working_f_number


def crop_factor(width_mm: float, height_mm: float) -> float:
    """Compute the crop factor: the diagonal of the 35 mm frame over that of this sensor."""
    return FULL_FRAME_DIAGONAL_MM / math.hypot(width_mm, height_mm)


# ---- Exposure


def exposure_value(f_number: float, seconds: float, iso: float = 100.0) -> float:
    """Compute EV100 of an exposure setting: log2(N^2 / t) - log2(S / 100)."""
    return math.log2(f_number * f_number / seconds) - math.log2(iso / 100.0)


class Metering(NamedTuple):
    """Settings of metering: the mode, and the middle and the diameter of a spot.

    mode : `mean`, `center_weighted` or `spot`.
    x, y : fractions of the frame's width and height, from the top left.
    size : fraction of the frame's shorter side.
    """

    mode: str
    x: float
    y: float
    size: float


class ExposureSettings(NamedTuple):
    """Exposure settings of a camera.

    seconds (s) : exposure time, the same at every place of the film; None if not known.
    iso : speed; None where metering chooses it.
    compensation (EV) : stops by which the picture is to be brighter.
    metering : None where the speed is given.
    f_number : None if not known.
    radiometric : whether the film has irradiance (W/m2); else it has radiance (W/(m2 sr)).
    base_iso : lowest speed that metering may choose; None for any.
    """

    seconds: float | None
    iso: float | None
    compensation: float
    metering: Metering | None
    f_number: float | None
    radiometric: bool
    base_iso: float | None = None


class AutoExposure(Spec):
    """Exposure by metering: a speed is chosen so that what is metered has the exposure 10 / S of ISO 12232."""

    metering: Literal["mean", "center_weighted", "spot"] = Field(
        default="center_weighted",
        description="`mean` of all pixels; `center_weighted`, three quarters for a circle in the middle, half as wide "
        "as the frame's shorter side; or a `spot`",
    )
    at: tuple[Fraction, Fraction] = Field(
        default=(0.5, 0.5),
        description="middle of the spot: fractions of the frame's width and height, from the top left",
    )
    size: Annotated[float, Quantity(low=0.0, low_open=True, high=1.0)] = Field(
        default=0.1, description="diameter of the spot, as a fraction of the frame's shorter side"
    )

    _has_a_spot = only(
        "at", "size", where={"metering": "spot"}, message="{key} belongs to metering: spot, and this is {spec.metering}"
    )

    def meter(self) -> Metering:
        """Make the settings of metering."""
        return Metering(self.metering, *self.at, self.size)


def _expand_auto(value: Any) -> Any:
    if value == "auto":
        return AutoExposure()
    if isinstance(value, str | int | float):
        raise ValueError(  # noqa: TRY004
            f"must be auto, or a mapping (metering, at, size), got {format_value(value)}; a given speed is the key iso"
        )
    return value


AutoExposureField: TypeAlias = Annotated[AutoExposure, BeforeValidator(_expand_auto)]
