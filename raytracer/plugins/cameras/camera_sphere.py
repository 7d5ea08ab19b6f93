"""A sphere of cameras round an object, which look at it from all sides; or round a place, from which they look out.

In a scene, 8 rows of 16 cameras round the origin, and 3 rows of 12 cameras in a room, on a sphere of 40 cm:

    camera: {type: camera_sphere, rows: 8, columns: 16, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
    camera: {type: camera_sphere, rows: 3, columns: 12, facing: outward, radius: 200 mm, elevation: [-60, 60],
             look_from: [0, 1.5, 0], look_at: [0, 1.5, -1], vfov: 75}
"""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from raytracer.plugins.cameras.base import views
from raytracer.plugins.cameras.base.rig import RigSpec, RigViews, place_cells
from raytracer.schema.fields import Count, Pair, PositiveLength, Quantity
from raytracer.schema.rules import requires
from raytracer.schema.spec import field_error


def _range(low: float, high: float) -> Pair:
    return Pair(Quantity("angle", low=low, high=high), "the lowest and the highest angle")


class CameraSphere(RigSpec):
    """Rows and columns of equal cameras on a sphere, or on a part of one, that look at its middle or away from it.

    Rows are circles of latitude, columns meridians: middles of equal parts of the ranges `elevation` and `azimuth`, the
    highest row at the top.  Both angles are 0 in the direction in which `look_from` lies from `look_at`, for cameras
    that look outward in that in which `look_at` lies from `look_from`; `up` is the axis.  Each camera has the picture
    upright.  The picture of all holds the views side by side, each of the film's width x height.

    A light field in space without obstacles has four dimensions: what the cameras on a surface round an object see is
    all that can be seen of it from outside of that surface.

    References: Gortler et al. 1996, "The Lumigraph", sec. 2; Levoy and Hanrahan 1996, "Light Field Rendering", sec. 2;
    Camahort, Lerios and Fussell 1998, "Uniformly Sampled Light Fields".
    """

    type: Literal["camera_sphere"] = "camera_sphere"
    rows: Annotated[int, Count(1, views.MAX_VIEWS)] = Field(description="rows of cameras, each at one elevation")
    columns: Annotated[int, Count(1, views.MAX_VIEWS)] = Field(description="cameras in a row, each at one azimuth")
    radius: PositiveLength | None = Field(
        default=None, description="of the sphere (m); default for cameras that look inward: |look_at - look_from|"
    )
    elevation: Annotated[tuple[float, float], _range(-90.0, 90.0)] = Field(
        default=(-90.0, 90.0), description="range (deg) above the equator that the rows divide, or one angle for a row"
    )
    azimuth: Annotated[tuple[float, float], _range(-360.0, 360.0)] = Field(
        default=(-180.0, 180.0),
        description="range (deg) to the right that the columns divide: cameras with more stand further to the right "
        "as seen from where they look from",
    )

    _has_a_size = requires(
        "radius", where={"facing": "outward"}, message="cameras that look outward need the radius of their sphere"
    )

    @model_validator(mode="after")
    def _ranges_rise(self) -> Any:
        for key in ("elevation", "azimuth"):
            low, high = getattr(self, key)
            if low > high:
                field_error(key, f"must rise, from the lowest to the highest angle, got {low:g}, {high:g}")
        if self.azimuth[1] - self.azimuth[0] > 360.0:
            field_error("azimuth", "must be at most a full circle, 360 deg")
        for key, count in (("elevation", self.rows), ("azimuth", self.columns)):
            low, high = getattr(self, key)
            if low == high and count > 1:
                field_error(key, f"is one angle, at which {count} cameras would stand in one place: give two")
        return self

    def reach(self) -> float:
        return self.distance() if self.radius is None else self.radius

    def rig(self) -> RigViews:
        sight, sign = self.sight(), self.outward_sign()
        right, up, ahead = (np.array(axis) for axis in (sight.right, sight.up, sight.forward))
        azimuth = np.radians(place_cells(*self.azimuth, self.columns))[None, :, None]
        elevation = np.radians(place_cells(*self.elevation, self.rows))[::-1, None, None]
        level = np.cos(azimuth) * (sign * ahead) + np.sin(azimuth) * right
        out = np.cos(elevation) * level + np.sin(elevation) * up
        across = np.broadcast_to(np.cos(azimuth) * right - np.sin(azimuth) * (sign * ahead), out.shape)
        upright = np.cos(elevation) * up - np.sin(elevation) * level
        pose = np.stack([self.center() + self.reach() * out, across, upright, sign * out], axis=2)
        return RigViews(pose, np.zeros((self.rows, self.columns, 2)))
