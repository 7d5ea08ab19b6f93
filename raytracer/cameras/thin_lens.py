"""Thin lens camera: sharp in one plane, blurred before and behind it.

In a scene:

    camera: {type: thin_lens, look_from: [13, 2, 3], look_at: [0, 0, 0], vfov: 20,
             focus_distance: 10, defocus_angle: 0.6}
    camera: {type: thin_lens, look_from: [0, 1.6, 4], look_at: [0, 1, 0], sensor: full_frame, focal_length: 50 mm,
             f_number: 1.4, focus_distance: 2, shutter: 1/125 s, iso: 400}
"""

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import Field, model_validator

from raytracer.apertures.interface import ApertureSpec
from raytracer.apertures.vignetting import Vignetting
from raytracer.cameras.interface import NO_ASSETS, Assets
from raytracer.cameras.perspective import FlatPupil, Optics, PerspectiveCamera, PerspectiveSpec
from raytracer.cameras.pupil import Lens
from raytracer.kinds import APERTURES
from raytracer.photography import focal_length_of, image_distance, magnification
from raytracer.spec import Fraction, Name, NonNegativeOptic, PositiveLengthOrInf, Quantity, at
from raytracer.units import METRES_PER_MILLIMETRE

if TYPE_CHECKING:
    Aperture: TypeAlias = ApertureSpec
else:
    Aperture = APERTURES.union_or_name()

_SIZES = ("defocus_angle", "aperture", "f_number")
_FOCUSES = ("focus_distance", "focus_on", "focus_at")


class ThinLens(PerspectiveSpec):
    """An ideal lens: what lies in the plane of focus is sharp, what does not is a circle of confusion.

    With a focal length, the film lies where the plane of focus is sharp, by Gauss's equation 1/f = 1/z_i + 1/z_o: the
    nearer it is, the farther the film, the narrower the field of view, and the darker the picture.  A field of view
    that is given as an angle is that of the picture, wherever its focus is.  With none of `defocus_angle`, `aperture`
    and `f_number`, or where they make no opening, the lens is a pinhole and costs as little.

    Exposed by `iso`, the lens loses no light: what a patch of the plane of focus sends through it arrives in the image
    of that patch.  On the axis the film then gets E = pi L / (4 N^2 (1 + m)^2) whatever the f-number, as behind lenses
    that are corrected for coma (Abbe's sine condition), so each stop is a factor of 2.  With `pupil: flat` it gets what
    an even disc of light in the plane of the lens would send: E = pi L / (1 + 4 N^2 (1 + m)^2), and Foote's formula off
    the axis; the two agree where N is large.

    References: Kingslake 1983, "Optical System Design", ch. 7; Foote 1915, "Illumination from a Radiating Disk",
    Bull. Bureau of Standards 12; Shirley et al. 2024, "Ray Tracing in One Weekend", sec. 13; Pharr et al. 2023,
    sec. 5.2.3.
    """

    type: Literal["thin_lens"] = "thin_lens"
    focus_distance: PositiveLengthOrInf | None = Field(
        default=None,
        description="distance of the plane of focus along the axis (m), inf allowed; default: |look_at - look_from|",
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
    defocus_angle: Annotated[float, Quantity("angle", low=0.0, high=180.0, high_open=True)] | None = Field(
        default=None, description="apex angle (deg) of the cone from a point in focus to the lens"
    )
    aperture: NonNegativeOptic | None = Field(default=None, description="diameter of the lens (mm)")
    aperture_shape: Aperture | None = Field(
        default=None,
        description="shape of the opening, of the same area as a disc of the lens's diameter: a type, or a mapping; "
        "a disc by default",
    )
    vignetting: Vignetting | None = Field(
        default=None,
        description="a rim in front of the lens, {diameter: mm, distance: mm}, that cuts what comes in from the side; "
        "without effect where the lens has no opening",
    )

    pupil: Literal["aplanatic", "flat"] = Field(
        default="aplanatic",
        description="how a wide lens exposes the film: `aplanatic`, as a corrected lens that loses no light; `flat`, "
        "as an even disc of light in its place",
    )

    @model_validator(mode="after")
    def _one_aperture(self) -> "ThinLens":
        sizes = [key for key in _SIZES if getattr(self, key) is not None]
        if len(sizes) > 1:
            at(sizes[1], f"{sizes[0]} and {sizes[1]} both set the size of the lens: give one of them")
        focuses = [key for key in _FOCUSES if getattr(self, key) is not None]
        if len(focuses) > 1:
            at(focuses[1], f"{focuses[0]} and {focuses[1]} both set the plane of focus: give one of them")
        if self.focus_on is None and self.focus_at is None:
            self._check_focus()
        return self

    def _check_focus(self) -> None:
        """Refuse a plane of focus that the lens cannot have."""
        if self.defocus_angle and math.isinf(self.focus()):
            raise ValueError("defocus_angle needs a finite focus_distance: with focus at infinity, give aperture")
        focal_length = self._given_focal_length()
        if focal_length is not None and 1e3 * self.focus() <= focal_length:
            at(
                "focal_length" if self.focus_distance is None else "focus_distance",
                f"the plane of focus, {self.focus():g} m away, must be farther than the focal length, "
                f"{focal_length:g} mm: nearer there is no image",
            )

    def focused(self, distance: float) -> "ThinLens":
        """The camera focused at a distance along its axis (m) in place of on an object, or at a place in the frame.

        Raises
        ------
        ValueError : the lens cannot be focused there.
        """
        focused = self.model_copy(update={"focus_distance": distance, "focus_on": None, "focus_at": None})
        focused._check_focus()
        return focused

    def focus(self) -> float:
        """Distance of the plane of focus (m)."""
        return self.distance() if self.focus_distance is None else self.focus_distance

    def _image_distance(self, focal_length: float) -> float:
        return image_distance(focal_length, 1e3 * self.focus())

    def _focal_length(self, image: float) -> float:
        return focal_length_of(image, 1e3 * self.focus())

    def _pupil(self, optics: Optics) -> float:
        """Diameter of the lens (m): as given, by the f-number, or 2 F tan(defocus_angle / 2)."""
        if self.defocus_angle:
            return 2.0 * self.focus() * math.tan(math.radians(self.defocus_angle) / 2.0)
        if self.aperture is not None:
            return METRES_PER_MILLIMETRE * self.aperture
        return super()._pupil(optics)

    def _lets_light_in(self) -> bool:
        return bool(self.defocus_angle) or bool(self.aperture) or super()._lets_light_in()

    def _openings(self) -> str:
        return "give a finite f_number, or aperture or defocus_angle"

    def _irradiance(self, image: float, area: float) -> Any:
        return FlatPupil(image, area) if self.pupil == "flat" else super()._irradiance(image, area)

    def diameter(self, width: int, height: int) -> float:
        """Diameter of the lens (m), for a film of width x height pixels."""
        return self._pupil(self.optics(width, height))

    def describe(self, width: int, height: int) -> dict[str, float]:
        """Derived numbers; the blur at infinity is the circle of confusion A |z - F| / z for z to infinity."""
        numbers = super().describe(width, height)
        pixel, pupil = 1e-3 * numbers["pixel_at_1m_mm"], self.diameter(width, height)
        if "image_distance_mm" in numbers:
            numbers["magnification"] = magnification(numbers["image_distance_mm"], 1e3 * self.focus())
        return {
            **numbers,
            "focus_distance_m": self.focus(),
            "aperture_diameter_mm": pupil / METRES_PER_MILLIMETRE,
            "blur_at_infinity_px": pupil / (pixel * self.focus()),
        }

    def files(self) -> dict[tuple[str | int, ...], tuple[str, str]]:
        shape = {} if self.aperture_shape is None else self.aperture_shape.files()
        return super().files() | {("aperture_shape", *keys): file for keys, file in shape.items()}

    def pack(self, width: int, height: int, assets: Assets = NO_ASSETS) -> PerspectiveCamera:
        """The camera with its lens, or without one where the aperture is 0."""
        radius = self.diameter(width, height) / 2.0
        if radius == 0.0:
            return self.camera(width, height, None)
        rim = None if self.vignetting is None else self.vignetting.pack()
        return self.camera(width, height, Lens(radius, 1.0 / self.focus(), self._shape(assets), rim))

    def _shape(self, assets: Assets) -> Any:
        """The packed shape of the opening; None if it is round."""
        shape = self.aperture_shape
        if shape is None:
            return None
        try:
            return shape.pack({key: assets[f"aperture_shape.{key}"] for key in shape.loads})
        except ValueError as error:
            at(("aperture_shape", *shape.loads), str(error))
