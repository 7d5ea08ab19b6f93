"""Thin lens camera: sharp in one plane, blurred before and behind it.

In a scene:

    camera: {type: thin_lens, look_from: [13, 2, 3], look_at: [0, 0, 0], vfov: 20,
             focus_distance: 10, defocus_angle: 0.6}
"""

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from raytracer.cameras.interface import LENS
from raytracer.cameras.perspective import PerspectiveCamera, PerspectiveSpec, lens_ray
from raytracer.sampling import sample_2d
from raytracer.sampling.warp import sample_disc
from raytracer.spec import NonNegativeOptic, PositiveLengthOrInf, Quantity
from raytracer.vec import add, madd, normalize, scale

_METRES_PER_MILLIMETRE = 1e-3


class ThinLens(PerspectiveSpec):
    """An ideal lens: what lies in the plane of focus is sharp, what does not is a circle of confusion.

    With neither `defocus_angle` nor `aperture`, or 0, it is a pinhole and costs as little.

    References: Shirley et al. 2024, "Ray Tracing in One Weekend", sec. 13; Pharr et al. 2023, sec. 5.2.3.
    """

    type: Literal["thin_lens"] = "thin_lens"
    focus_distance: PositiveLengthOrInf | None = Field(
        default=None,
        description="distance of the plane of focus along the axis (m), inf allowed; default: |look_at - look_from|",
    )
    defocus_angle: Annotated[float, Quantity("angle", low=0.0, high=180.0, high_open=True)] | None = Field(
        default=None, description="apex angle (deg) of the cone from a point in focus to the lens"
    )
    aperture: NonNegativeOptic | None = Field(default=None, description="diameter of the lens (mm)")

    @model_validator(mode="after")
    def _one_aperture(self) -> "ThinLens":
        if self.defocus_angle is not None and self.aperture is not None:
            raise ValueError("defocus_angle and aperture both set the size of the lens: give one of them")
        if self.defocus_angle and math.isinf(self.focus()):
            raise ValueError("defocus_angle needs a finite focus_distance: with focus at infinity, give aperture")
        return self

    def focus(self) -> float:
        """Distance of the plane of focus (m)."""
        return self.distance() if self.focus_distance is None else self.focus_distance

    def diameter(self) -> float:
        """Diameter of the lens (m): as given, or 2 F tan(defocus_angle / 2)."""
        if self.defocus_angle:
            return 2.0 * self.focus() * math.tan(math.radians(self.defocus_angle) / 2.0)
        return _METRES_PER_MILLIMETRE * (self.aperture or 0.0)

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers; the blur at infinity is the circle of confusion A |z - F| / z for z to infinity."""
        numbers = super().describe(width, height)
        pixel = 1e-3 * numbers["pixel_at_1m_mm"]
        return {
            **numbers,
            "focus_distance_m": self.focus(),
            "aperture_diameter_mm": self.diameter() / _METRES_PER_MILLIMETRE,
            "blur_at_infinity_px": self.diameter() / (pixel * self.focus()),
        }

    def pack(self, width: int, height: int) -> PerspectiveCamera:
        """The camera with its lens, or without one where the aperture is 0."""
        radius = self.diameter() / 2.0
        return self.camera(width, height, Lens(radius, 1.0 / self.focus()) if radius > 0.0 else None)


class Lens(NamedTuple):
    """Packed: radius (m) and 1 / focus distance (1/m), which is 0 for focus at infinity."""

    radius: float
    inverse_focus: float


@lens_ray.register(Lens)
def _(lens, frame, direction, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LENS)
    x, y = sample_disc(u1, u2)
    shift = add(scale(lens.radius * x, frame.right), scale(lens.radius * y, frame.up))
    return add(frame.origin, shift), normalize(madd(direction, -lens.inverse_focus, shift)), 1.0
