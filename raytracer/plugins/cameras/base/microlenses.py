"""Array of microlenses before the sensor of a light-field camera: its keys, arrangement, and sub-images.

Behind a main lens, at the distance z of the array, the sensor lies a distance d farther back.  Each microlens shows the
main lens's pupil in a sub-image of its own.  Light through the middle of the pupil comes to the array inclined, so that
the sub-images are spaced by 1 + d / z times the pitch of the microlenses; and what is a part of the pupil's diameter D
is that part of D d / z there.  The sub-images touch and do not overlap where D d / z is their spacing, so where the
microlenses have the main lens's f-number on the image side, z / D.

References: Ng, Levoy, Bredif, Duval, Horowitz, Hanrahan 2005, "Light Field Photography with a Hand-Held Plenoptic
Camera", Stanford CTSR 2005-02, sec. 3; Lumsdaine, Georgiev 2009, "The Focused Plenoptic Camera", ICCP; Dansereau,
Pizarro, Williams 2013, "Decoding, Calibration and Rectification for Lenselet-Based Plenoptic Cameras", CVPR, sec. 3.
"""

import math
from typing import Annotated, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from raytracer.film.light_field.lattice import Lattice
from raytracer.film.light_field.lenslets import Lenslets
from raytracer.film.light_field.openings import OpeningTable
from raytracer.film.light_field.views import Pose, Views
from raytracer.optics.sensor_formats import SensorSize
from raytracer.plugins.cameras.base.placement import CameraFrame
from raytracer.schema.fields import Angle, Count, LensLength, PositiveLensLength
from raytracer.schema.rules import exclusive, never, requires
from raytracer.schema.spec import Spec, field_error
from raytracer.schema.units import METRES_PER_MILLIMETRE

PIXELS = 15
"""Pixels of the sensor under a microlens, across, where nothing says how many."""

_ITERATIONS = 8
"""Rounds in which the spacing of sub-images converges for a given pitch: each leaves a part d / z of the error."""

ThreeFocalLengths = tuple[PositiveLensLength, PositiveLensLength, PositiveLensLength]
"""Focal lengths of microlenses of three kinds."""

_LEAST_PIXELS, _MOST = 2, 10_000
_SIZES = ("pixels", "pitch", "count")


class Microlenses(Spec):
    """An array of microlenses, and the sensor behind it."""

    pixels: Annotated[int, Count(_LEAST_PIXELS, _MOST)] | None = Field(
        default=None,
        description="pixels of the sensor across each sub-image, whole ones: the pitch is chosen so that sub-images, "
        f"which are spaced wider than microlenses, fall on the pixels exactly; {PIXELS} by default",
    )
    pitch: PositiveLensLength | None = Field(
        default=None,
        description="distance between the middles of neighbours (mm; 125 um), in place of `pixels`; it need fit no "
        "pixels",
    )
    count: Annotated[int, Count(1, _MOST)] | None = Field(
        default=None, description="microlenses across the width of the picture, in place of `pixels`"
    )
    layout: Literal["square", "hexagonal"] = Field(
        default="square",
        description="how the microlenses are packed; in hexagonal rows every other one is half a step off",
    )
    model: Literal["lens", "pinhole"] = Field(
        default="lens",
        description="`lens`, thin ones without gaps between them; `pinhole`, holes in their middles, sharp at any "
        "distance, which by convention let as much light through",
    )
    focal_length: PositiveLensLength | ThreeFocalLengths | None = Field(
        default=None,
        description="focal length of a microlens (mm); by default that which has the sensor in focus on the main lens, "
        "with sub-images that just touch; three of them for focused hexagonal microlenses of three kinds, interleaved, "
        "of which the middle one is sharp in the plane of focus",
    )
    distance: PositiveLensLength | None = Field(
        default=None,
        description="distance of the sensor behind the microlenses (mm); by default where sub-images just touch, or by "
        "`focal_length`",
    )
    arrangement: Literal["plenoptic", "focused"] = Field(
        default="plenoptic",
        description="`plenoptic` (1.0), the microlenses lie in the image of the plane of focus and show the main lens; "
        "`focused` (2.0), they lie before or behind that image, and show it sharply on the sensor",
    )
    crosstalk: bool = Field(
        default=False,
        description="whether light also falls under the neighbours of the microlens that it goes through, where the "
        "sub-images overlap; else each pixel sees through its own microlens alone",
    )
    rotation: Angle = Field(
        default=0.0, description="angle (deg) by which the array is turned to the left in the picture, about its middle"
    )
    offset: tuple[LensLength, LensLength] = Field(
        default=(0.0, 0.0),
        description="by how much the array is off its place on the sensor (mm), right and up in the picture",
    )

    _one_size = exclusive(*_SIZES, sets="the size of the microlenses")
    _has_a_focal_length = requires(
        "focal_length",
        where={"arrangement": "focused"},
        message="arrangement: focused needs the focal_length of the microlenses",
    )

    _is_out_of_focus = never(
        "distance",
        where=lambda lenses: lenses.arrangement == "focused" and lenses.distance in lenses.focal_lengths,
        message="a sensor in the focal plane of the microlenses sees infinity sharp, not the main lens's image",
    )

    @model_validator(mode="after")
    def _kinds_are_interleaved(self) -> Self:
        if len(self.focal_lengths) > 1 and (self.arrangement, self.layout, self.model) != (
            "focused",
            "hexagonal",
            "lens",
        ):
            field_error(
                "focal_length",
                "microlenses of three kinds are interleaved in layout: hexagonal, and need arrangement: focused and "
                "model: lens",
            )
        return self

    @property
    def focal_lengths(self) -> tuple[float, ...]:
        """Focal lengths (mm) of the kinds; empty if they are not given."""
        given = self.focal_length
        return () if given is None else given if isinstance(given, tuple) else (given,)

    @property
    def main_focal_length(self) -> float | None:
        """Focal length (mm) by which the array is placed, the middle one of three; None if it is not given."""
        return sorted(self.focal_lengths)[len(self.focal_lengths) // 2] if self.focal_lengths else None

    def scaled(self, factor: float) -> "Microlenses":
        """Scale the microlenses by a factor, rounding integers, to an arrangement that suits the main lens."""
        size = {key: getattr(self, key) for key in _SIZES if getattr(self, key) is not None} or {"pixels": PIXELS}
        ((key, value),) = size.items()
        changed = {
            "pitch": factor * value,
            "pixels": max(_LEAST_PIXELS, round(factor * value)),
            "count": max(1, round(value / factor)),
        }
        scaled = tuple(factor * own for own in self.focal_lengths) if self.arrangement == "focused" else ()
        focal_length = scaled if len(scaled) > 1 else (*scaled, None)[0]
        return self.model_copy(update={key: changed[key], "distance": None, "focal_length": focal_length})


class MainLens(NamedTuple):
    """Main lens in front of an array of microlenses; for one of glass, the thin lens in its place.

    film (mm) : size of the part of the sensor that the picture shows.
    image (mm) : distance of the image of the plane of focus behind the lens.
    pupil (mm) : distance of that image from the exit pupil.
    diameter (mm) : of the entrance pupil.
    focal_length (mm) : by which the distances of the plane of focus and of its image go together.
    width, height (px) : size of the picture.
    """

    film: SensorSize
    image: float
    pupil: float
    diameter: float
    focal_length: float
    width: int
    height: int

    @property
    def pixel(self) -> float:
        """Edge of a pixel (mm)."""
        return self.film.height / self.height


class Arrangement(NamedTuple):
    """Array of microlenses with all that its keys leave open worked out.

    image (mm) : distance of the array behind the main lens, for one of glass the thin lens in its place.
    pupil (mm) : distance of the array behind the exit pupil.
    distance (mm) : of the sensor behind the array.
    focal_length (mm) : of a microlens, of three kinds the middle one's.
    pitch (mm) : of the microlenses.
    spacing (px) : of the sub-images.
    matched (mm) : distance of the sensor at which sub-images would just touch.
    """

    image: float
    pupil: float
    distance: float
    focal_length: float
    pitch: float
    spacing: float
    matched: float

    @property
    def magnification(self) -> float:
        """Spacing of the sub-images over that of the microlenses."""
        return 1.0 + self.distance / self.pupil

    @property
    def blur(self) -> float:
        """Shift on the main lens of the point that a pixel sees, over the shift of the ray on its microlens.

        0 where microlenses show the main lens sharply, at 1/f = 1/d + 1/z; less than 0 nearer than that.
        """
        return (1.0 + self.pupil / self.distance - self.pupil / self.focal_length) * self.image / self.pupil


def solve_arrangement(lenses: Microlenses, main: MainLens) -> Arrangement:
    """Work out the array behind a main lens.

    Raises
    ------
    ValidationError : there is no such arrangement; it points at a key of the microlenses.
    """
    if lenses.arrangement == "focused":
        return _solve_focused(lenses, main)
    given, focal_length = lenses.distance, lenses.main_focal_length
    if given is None and focal_length is not None:
        if focal_length >= main.pupil:
            field_error(
                "focal_length",
                f"{focal_length:g} mm is not shorter than the distance to the main lens, {main.pupil:.4g} mm: such "
                "microlenses show no image of it",
            )
        given = 1.0 / (1.0 / focal_length - 1.0 / main.pupil)
    return _solve_plenoptic(lenses, main, given)


def _solve_plenoptic(lenses: Microlenses, main: MainLens, given: float | None, offset: float = 0.0) -> Arrangement:
    """Place the array at an offset from the image, and the sensor at a given distance, or where sub-images touch."""
    pupil = main.pupil + offset
    image = main.image * (pupil / main.pupil)
    # The pupil's image is D d / z wide, and so is the spacing s = (1 + d / z') p of a pitch p: solve for s.
    working = image / main.diameter
    if lenses.pitch is not None and given is None:
        remaining = pupil - lenses.pitch * working
        if remaining <= 0.0:
            field_error("pitch", f"{lenses.pitch:g} mm is as wide as the main lens: no sub-images lie side by side")
        pixels = lenses.pitch * pupil / remaining / main.pixel
    elif lenses.pitch is not None:
        assert given is not None
        pixels = lenses.pitch * (1.0 + given / pupil) / main.pixel
    elif lenses.count is not None:
        pixels = main.width / lenses.count
    else:
        pixels = float(lenses.pixels or PIXELS)
    matched = pixels * main.pixel * working
    distance = matched if given is None else given
    focal_length = lenses.main_focal_length or 1.0 / (1.0 / distance + 1.0 / pupil)
    if pixels < _LEAST_PIXELS:
        field_error(
            "pitch" if lenses.pitch is not None else "count",
            f"leaves {pixels:.3g} pixels of the sensor for each sub-image, and it takes {_LEAST_PIXELS} to tell "
            "directions apart: give a film with more pixels, or fewer and larger microlenses",
        )
    pitch = pixels * main.pixel / (1.0 + distance / pupil)
    return Arrangement(image, pupil, distance, focal_length, pitch, pixels, matched)


def _solve_focused(lenses: Microlenses, main: MainLens) -> Arrangement:
    """Place an array whose microlenses show the image of the plane of focus on the sensor: 1/f = 1/a + 1/d.

    a is how far the array is behind that image, less than 0 before it, where the image is one that would lie main.
    """
    focal_length = lenses.main_focal_length
    assert focal_length is not None
    array = _solve_plenoptic(lenses, main, lenses.distance)
    for _round in range(_ITERATIONS):
        given = lenses.distance
        distance = _touching_distance(array.spacing * main.pixel, main, focal_length) if given is None else given
        away = focal_length * distance / (distance - focal_length)
        if main.pupil + away <= 0.0:
            field_error("focal_length", f"{focal_length:g} mm would put the microlenses before the main lens")
        array = _solve_plenoptic(lenses, main, distance, away)
    return array


def _touching_distance(spacing: float, main: MainLens, focal_length: float) -> float:
    """Return the distance behind focused microlenses (mm) at which their sub-images touch.

    d D = s (z + a), where f d = a (d - f), has two solutions, on both sides of f; the one is taken that has the array
    nearer to the main lens's image.  D is the exit pupil's diameter, z its distance.
    """
    width, image = main.diameter * main.pupil / main.image, main.pupil
    middle = 0.5 * (width * focal_length + spacing * (image + focal_length))
    product = width * spacing * image * focal_length
    farther = (middle + math.sqrt(middle * middle - product)) / width
    return farther if focal_length < spacing * image / width else product / (width * width * farther)


# ---- Sub-images


_ROW = math.sqrt(3.0) / 2.0
"""Distance of the rows of a hexagonal lattice, over the distance of neighbours in a row."""


def make_lenslets(
    lenses: Microlenses,
    array: Arrangement,
    main: MainLens,
    frame: CameraFrame,
    plane_of_focus: float,
    opening: OpeningTable | None = None,
) -> Lenslets:
    """Lay out the sub-images of a camera whose plane of focus is at a distance (m).

    opening : table of the main lens's opening; None for a round one.
    """
    pixel, sharp = METRES_PER_MILLIMETRE * main.film.height / main.height, 1.0 / plane_of_focus
    # The plane that the microlenses see: by 1/F = 1/f - 1/z, turned to the side of the scene by the pupils' sizes.
    moved = (1.0 / main.image - 1.0 / array.image) / METRES_PER_MILLIMETRE
    # For microlenses that are sharp on the main lens the blur would be rounding.
    is_sharp = lenses.arrangement == "plenoptic" and None in (lenses.focal_length, lenses.distance)
    is_sharp |= lenses.model == "pinhole"
    on_array = METRES_PER_MILLIMETRE * array.pitch / array.spacing
    kinds = [on_array * array._replace(focal_length=own).blur for own in lenses.focal_lengths]
    return Lenslets(
        lattice=_make_lattice(lenses, array, main),
        width=main.width,
        height=main.height,
        middle=(0.5 * main.width, 0.5 * main.height),
        slope=pixel / (METRES_PER_MILLIMETRE * array.image * array.magnification),
        stride=pixel * array.image / array.distance,
        inverse_distance=sharp + moved * main.pupil / main.image,
        inverse_focus=sharp,
        aperture=METRES_PER_MILLIMETRE * main.diameter,
        focal_length=main.focal_length,
        pose=Pose(frame.origin, frame.right, frame.up, frame.forward),
        blur=0.0 if is_sharp else on_array * array.blur,
        kinds=tuple(kinds) if len(kinds) > 1 else (),
        opening=opening,
    )


def _make_lattice(lenses: Microlenses, array: Arrangement, main: MainLens) -> Lattice:
    """Make the lattice of the middles of the sub-images: of an integer size in pixels they fit between the edges."""
    width, height, spacing = main.width, main.height, array.spacing
    turn = math.radians(lenses.rotation)
    cosine, sine = spacing * math.cos(turn), spacing * math.sin(turn)
    along, down = (cosine, -sine), (sine, cosine)
    x, y = 0.5 * width, 0.5 * height
    if lenses.pitch is None and lenses.layout == "square":
        # Sub-images from edge to edge of pixels, with as many pixels left over on both sides.
        unused = (size - math.floor(size / spacing) * spacing for size in (width, height))
        x, y = (math.floor(0.5 * left_over) + 0.5 * spacing for left_over in unused)
    shift = array.magnification * height / main.film.height
    origin = (x + shift * lenses.offset[0], y - shift * lenses.offset[1])
    if lenses.layout == "square":
        return Lattice(origin, along, down)
    return Lattice(origin, along, (0.5 * along[0] + _ROW * down[0], 0.5 * along[1] + _ROW * down[1]))


def microlens_solid_angle(lenses: Microlenses, array: Arrangement) -> float:
    """Return the solid angle in which a pixel sees its microlens: its area over the square of its distance."""
    area = array.pitch * array.pitch * (_ROW if lenses.layout == "hexagonal" else 1.0)
    return area / (array.distance * array.distance)


def describe_resolution(array: Arrangement, layout: Lenslets, views: Views) -> dict[str, float]:
    """Return numbers of the places and directions that microlenses resolve, by name with unit."""
    numbers = {
        "microlens_pitch_um": 1e3 * array.pitch,
        "sub_image_px": array.spacing,
        "view_columns": float(views.columns),
        "view_rows": float(views.rows),
        "view_width_px": float(views.width),
        "view_height_px": float(views.height),
    }
    return numbers | ({"seen_by_microlenses": layout.overlap} if layout.is_focused else {})
