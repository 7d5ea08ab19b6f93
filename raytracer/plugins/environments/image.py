"""Image environment: radiance from a latitude-longitude picture (.hdr, .exr, .npy, .png, .jpg).

In a scene:

    environment: {type: image, file: harbour.hdr, scale: 2, rotation: 90}
"""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from raytracer.plugins.environments.base.equirectangular import Equirectangular, equirectangular
from raytracer.plugins.environments.base.interface import Assets, EnvironmentSpec
from raytracer.schema.fields import Angle, Quantity, Triple, Vector


class ImageEnvironment(EnvironmentSpec):
    """A picture of all directions: 360 degrees across, 180 degrees down, +y at the top.

    The left and right edges meet at -z, +x is a quarter of the width from the left, +z in the middle, -x at three
    quarters.  Between pixels the picture is bilinear.  Next-event estimation samples
    directions in proportion to their radiance.
    """

    loads: ClassVar[dict[str, str]] = {"file": "image"}

    has_importance_sampling: ClassVar[bool] = True

    type: Literal["image"] = "image"
    file: str = Field(description="image file, relative to the scene", min_length=1)
    scale: Annotated[Vector, Triple(Quantity(low=0.0), "a scale", single=True)] = Field(
        default=(1.0, 1.0, 1.0), description="factor to radiance (W/(m2 sr)), by channel or one for all; 0: none"
    )
    rotation: Angle = Field(default=0.0, description="turn about +y, counter-clockwise as seen from above")
    encoding: Literal["auto", "srgb", "linear"] = Field(
        default="auto", description="what the file's values are; auto: sRGB if they are integers, else linear"
    )

    def pack(self, assets: Assets) -> Equirectangular | None:
        picture = assets["file"]
        radiance = picture.linear(picture.integer if self.encoding == "auto" else self.encoding == "srgb")
        colors = radiance[..., :3] if radiance.shape[2] >= 3 else radiance[..., :1]
        try:
            return equirectangular(colors * self.scale, self.rotation)
        except ValueError as error:
            raise ValueError(f"{self.file} {error}") from None
