"""Keys of cameras with a sensor: its size, how the picture lies on it, and its speed."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from raytracer.optics.sensor_formats import SENSORS, SensorField, SensorSize, SensorSpec, fit_sensor
from raytracer.plugins.cameras.base.placement import PlacedSpec
from raytracer.schema.fields import Quantity
from raytracer.schema.rules import never
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

    @model_validator(mode="after")
    def _is_no_slower_than_its_sensor(self) -> Any:
        sensor = self.simulated_sensor()
        if sensor is not None and self.iso is not None and self.iso < sensor.base_iso:
            field_error(
                "iso",
                f"{self.iso:g} is slower than the simulated sensor can be: give at least its base_iso, "
                f"{sensor.base_iso:g}, or sensor.base_iso",
            )
        return self

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
