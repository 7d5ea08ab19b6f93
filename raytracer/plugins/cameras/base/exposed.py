"""Keys of cameras with a sensor, its size and speed; of those with an opening, its shape; and of those with a focus."""

from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

from pydantic import Field

from raytracer.optics.sensor_formats import SENSORS, SensorField, SensorSize, SensorSpec, fit_sensor
from raytracer.plugins.apertures.base.interface import ApertureSpec
from raytracer.plugins.apertures.base.vignetting import Opening
from raytracer.plugins.cameras.base.interface import Assets
from raytracer.plugins.cameras.base.placement import PlacedSpec
from raytracer.schema.fields import Fraction, Name, PositiveLengthOrInf, Quantity
from raytracer.schema.registry import APERTURES
from raytracer.schema.rules import exclusive, never, only
from raytracer.schema.spec import field_error


class ExposedSpec(PlacedSpec):
    """A camera with a sensor, which may be exposed photographically."""

    sensor: SensorField | None = Field(
        default=None,
        description=f"a name ({', '.join(SENSORS)}), or {{width: 36 mm, height: 24 mm}}; full_frame where only a focal "
        "length is given, or there is no lens",
    )
    sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = Field(
        default=None,
        description="how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest "
        "part of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it",
    )
    iso: Annotated[float, Quantity(low=1e-3, high=1e9)] | None = Field(
        default=None,
        description="speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which "
        "1 is what saturates the sensor",
    )

    _opens_for_some_time = never(
        "iso",
        where=lambda camera: camera.exposure_seconds() == 0.0,
        message="iso needs a shutter that is open for some time, such as shutter: 1/125 s",
    )

    _is_no_slower_than_its_sensor = only(
        "iso",
        where=lambda camera: camera.simulated_sensor() is None or camera.iso >= camera.sensor.base_iso,
        message="{spec.iso:g} is slower than the simulated sensor can be: give at least its base_iso, "
        "{spec.sensor.base_iso:g}, or sensor.base_iso",
    )

    def iso_speed(self) -> float | None:
        return self.iso

    def simulated_sensor(self) -> SensorSpec | None:
        return self.sensor if self.sensor is not None and self.sensor.noise else None

    def given_sensor(self) -> SensorSize | None:
        """Return the size of the sensor (mm); None where the scene does not give it."""
        return self.sensor.size() if self.sensor is not None else None

    def sensor_size(self) -> SensorSize:
        """Return the size of the sensor (mm): full frame where the scene does not give it."""
        return self.given_sensor() or SensorSize(*SENSORS["full_frame"])

    def film_size(self, width: int, height: int) -> SensorSize:
        """Return the size of the part of the sensor that a film of width x height pixels shows (mm)."""
        return fit_sensor(self.sensor_size(), width, height, self.sensor_fit or "crop")


if TYPE_CHECKING:
    Aperture: TypeAlias = ApertureSpec
else:
    Aperture = APERTURES.union_or_name()


class ShapedSpec(ExposedSpec):
    """A camera whose opening, of a lens or a hole, may have any shape."""

    aperture_shape: Aperture | None = Field(
        default=None,
        description="shape of the opening, of the same area as the round one: a type, or a mapping; round by default",
    )

    def opening(self) -> Opening:
        return Opening(self.aperture_shape)

    def files(self) -> dict[tuple[str | int, ...], tuple[str, str]]:
        shape = {} if self.aperture_shape is None else self.aperture_shape.files()
        return super().files() | {("aperture_shape", *keys): file for keys, file in shape.items()}

    def pack_shape(self, assets: Assets) -> Any:
        """Pack the shape of the opening; None for a round one.

        Raises
        ------
        ValidationError : an asset does not suit the shape; it points at the key that names the file.
        """
        shape = self.aperture_shape
        if shape is None:
            return None
        try:
            return shape.pack({key: assets[f"aperture_shape.{key}"] for key in shape.loads})
        except ValueError as error:
            field_error(("aperture_shape", *shape.loads), str(error))


class FocusedSpec(ShapedSpec):
    """A camera with a lens, which is focused at a distance, on an object, or at a place in the frame."""

    focus_distance: PositiveLengthOrInf | None = Field(
        default=None,
        description="distance of the plane of focus along the axis, from the lens, of one of glass from its entrance "
        "pupil (m), inf allowed; default: |look_at - look_from|",
    )
    focus_on: Name | None = Field(
        default=None,
        description="name of the object whose middle is in focus, in place of `focus_distance`; for the surface that "
        "is seen of it, see `focus_at`",
    )
    focus_at: tuple[Fraction, Fraction] | None = Field(
        default=None,
        description="place in the frame at which what is seen is in focus: fractions of its width and height, from the "
        "top left, in place of `focus_distance`; infinity where nothing is seen; cutouts count as solid",
    )

    _one_focus = exclusive("focus_distance", "focus_on", "focus_at", sets="the plane of focus")

    def check_focus(self) -> None:
        """Refuse a plane of focus that the lens cannot have.

        Raises
        ------
        ValueError : the lens cannot be focused there.
        """

    def plane_of_focus(self) -> float:
        """Return the distance of the plane of focus (m)."""
        return self.distance() if self.focus_distance is None else self.focus_distance

    def focused_object(self) -> str | None:
        return self.focus_on

    def focused_place(self) -> tuple[float, float] | None:
        return self.focus_at

    def has_focus_target(self) -> bool:
        """Tell if the camera is focused on something in the scene, so that its distance is yet to be found."""
        return self.focus_on is not None or self.focus_at is not None

    def with_focus_distance(self, distance: float) -> Self:
        """Focus the camera at a distance along its axis (m) in place of on an object, or at a place in the frame.

        Raises
        ------
        ValueError : the lens cannot be focused there.
        """
        focused = self.model_copy(update={"focus_distance": distance, "focus_on": None, "focus_at": None})
        focused.check_focus()
        return focused
