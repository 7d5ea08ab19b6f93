"""The array of microlenses before the sensor of a light-field camera: what it is given by, and what follows.

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
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from raytracer.jit import generic
from raytracer.spec import Angle, Count, Optic, PositiveOptic, Spec, at

PIXELS = 15
"""Pixels of the sensor under a microlens, across, where nothing says how many."""

_LEAST_PIXELS, _MOST = 2, 10_000
_SIZES = ("pixels", "pitch", "count")


class Microlenses(Spec):
    """An array of microlenses, and the sensor behind it."""

    pixels: Annotated[int, Count(_LEAST_PIXELS, _MOST)] | None = Field(
        default=None,
        description="pixels of the sensor across each sub-image, whole ones: the pitch is chosen so that sub-images, "
        f"which are spaced wider than microlenses, fall on the pixels exactly; {PIXELS} by default",
    )
    pitch: PositiveOptic | None = Field(
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
    focal_length: PositiveOptic | None = Field(
        default=None,
        description="focal length of a microlens (mm); by default that which has the sensor in focus on the main lens, "
        "with sub-images that just touch",
    )
    distance: PositiveOptic | None = Field(
        default=None,
        description="distance of the sensor behind the microlenses (mm); by default where sub-images just touch, or by "
        "`focal_length`",
    )
    arrangement: Literal["plenoptic", "focused"] = Field(
        default="plenoptic",
        description="`plenoptic` (1.0), the microlenses lie in the image of the plane of focus and show the main lens; "
        "`focused` (2.0), they lie before or behind that image, and show it sharply on the sensor",
    )
    rotation: Angle = Field(
        default=0.0, description="angle (deg) by which the array is turned to the left in the picture, about its middle"
    )
    offset: tuple[Optic, Optic] = Field(
        default=(0.0, 0.0),
        description="by how much the array is off its place on the sensor (mm), right and up in the picture",
    )

    @model_validator(mode="after")
    def _one_size(self) -> Any:
        sizes = [key for key in _SIZES if getattr(self, key) is not None]
        if len(sizes) > 1:
            at(sizes[1], f"{sizes[0]} and {sizes[1]} both set the size of the microlenses: give one of them")
        if self.arrangement == "focused" and self.focal_length is None:
            at("focal_length", "arrangement: focused needs the focal_length of the microlenses")
        if self.arrangement == "focused" and self.focal_length == self.distance:
            at(
                "distance",
                "a sensor in the focal plane of the microlenses sees infinity sharp, not the main lens's image",
            )
        return self

    def scaled(self, factor: float) -> "Microlenses":
        """Microlenses that are larger by a factor, as nearly as whole numbers can be, and suit the main lens."""
        size = {key: getattr(self, key) for key in _SIZES if getattr(self, key) is not None} or {"pixels": PIXELS}
        ((key, value),) = size.items()
        changed = {
            "pitch": factor * value,
            "pixels": max(_LEAST_PIXELS, round(factor * value)),
            "count": max(1, round(value / factor)),
        }
        own = self.focal_length if self.arrangement == "focused" else None
        focal_length = None if own is None else factor * own
        return self.model_copy(update={key: changed[key], "distance": None, "focal_length": focal_length})


class Behind(NamedTuple):
    """What stands before an array of microlenses (mm).

    image, distance of the image of the plane of focus behind the main lens, of glass the thin one in its place; pupil,
    its distance from the exit pupil; diameter, that of the entrance pupil; pixel, the edge of a pixel; width and
    height, of the picture in pixels.
    """

    image: float
    pupil: float
    diameter: float
    pixel: float
    width: int
    height: int


class Arrangement(NamedTuple):
    """An array of microlenses with all that its keys leave open worked out (mm).

    image : how far it is behind the main lens, of glass the thin one in its place.
    pupil : how far it is behind the exit pupil.
    distance : of the sensor behind it.
    focal_length : of a microlens.
    pitch : of the microlenses.
    spacing : of the sub-images, in pixels.
    matched : of the distance at which sub-images would just touch.
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
        """How far the place on the main lens moves that a pixel sees, by how far the light goes through its microlens.

        0 where microlenses show the main lens sharply, at 1/f = 1/d + 1/z; less than 0 nearer than that.
        """
        return (1.0 + self.pupil / self.distance - self.pupil / self.focal_length) * self.image / self.pupil


def arranged(lenses: Microlenses, behind: Behind) -> Arrangement:
    """The array behind a main lens.

    Raises
    ------
    ValidationError : there is no such arrangement; it points at a key of the microlenses.
    """
    if lenses.arrangement == "focused":
        return _focused(lenses, behind)
    given, focal_length = lenses.distance, lenses.focal_length
    if given is None and focal_length is not None:
        if focal_length >= behind.pupil:
            at(
                "focal_length",
                f"{focal_length:g} mm is not shorter than the distance to the main lens, {behind.pupil:.4g} mm: such "
                "microlenses show no image of it",
            )
        given = 1.0 / (1.0 / focal_length - 1.0 / behind.pupil)
    return _settled(lenses, behind, given)


def _settled(lenses: Microlenses, behind: Behind, given: float | None, offset: float = 0.0) -> Arrangement:
    """The array at an offset from the image, and the sensor a given distance behind it, or where sub-images touch."""
    pupil = behind.pupil + offset
    image = behind.image * (pupil / behind.pupil)
    # The pupil's image is D d / z wide, and so is the spacing s = (1 + d / z') p of a pitch p: solve for s.
    working = image / behind.diameter
    if lenses.pitch is not None and given is None:
        room = pupil - lenses.pitch * working
        if room <= 0.0:
            at("pitch", f"{lenses.pitch:g} mm is as wide as the main lens: no sub-images lie side by side")
        pixels = lenses.pitch * pupil / room / behind.pixel
    elif lenses.pitch is not None:
        assert given is not None
        pixels = lenses.pitch * (1.0 + given / pupil) / behind.pixel
    elif lenses.count is not None:
        pixels = behind.width / lenses.count
    else:
        pixels = float(lenses.pixels or PIXELS)
    matched = pixels * behind.pixel * working
    distance = matched if given is None else given
    focal_length = lenses.focal_length or 1.0 / (1.0 / distance + 1.0 / pupil)
    if pixels < _LEAST_PIXELS:
        at(
            "pitch" if lenses.pitch is not None else "count",
            f"leaves {pixels:.3g} pixels of the sensor for each sub-image, and it takes {_LEAST_PIXELS} to tell "
            "directions apart: give a film with more pixels, or fewer and larger microlenses",
        )
    pitch = pixels * behind.pixel / (1.0 + distance / pupil)
    return Arrangement(image, pupil, distance, focal_length, pitch, pixels, matched)


_ROUNDS = 8
"""Rounds by which the spacing of sub-images settles, of a given pitch: each leaves a part d / z of the error."""


def _focused(lenses: Microlenses, behind: Behind) -> Arrangement:
    """An array whose microlenses show the image of the plane of focus on the sensor: 1/f = 1/a + 1/d.

    a is how far the array is behind that image, less than 0 before it, where the image is one that would lie behind.
    """
    focal_length = lenses.focal_length
    assert focal_length is not None
    found = _settled(lenses, behind, lenses.distance)
    for _round in range(_ROUNDS):
        given = lenses.distance
        distance = _touching(found.spacing * behind.pixel, behind, focal_length) if given is None else given
        away = focal_length * distance / (distance - focal_length)
        if behind.pupil + away <= 0.0:
            at("focal_length", f"{focal_length:g} mm would put the microlenses before the main lens")
        found = _settled(lenses, behind, distance, away)
    return found


def _touching(spacing: float, behind: Behind, focal_length: float) -> float:
    """How far behind microlenses, which have the sensor in focus on the main lens's image, sub-images touch (mm).

    d D = s (z + a), where f d = a (d - f), has two solutions, on both sides of f; the one is taken that has the array
    nearer to the main lens's image.  D is the
    exit pupil's diameter, z its distance.
    """
    width, image = behind.diameter * behind.pupil / behind.image, behind.pupil
    middle = 0.5 * (width * focal_length + spacing * (image + focal_length))
    product = width * spacing * image * focal_length
    farther = (middle + math.sqrt(middle * middle - product)) / width
    return farther if focal_length < spacing * image / width else product / (width * width * farther)


# ---- In kernels


class Square(NamedTuple):
    """The cell of a microlens in a square lattice, in steps of it."""


class Hexagon(NamedTuple):
    """The cell of a microlens in a hexagonal lattice, whose steps are at 60 degrees."""


@generic
def nearest(cell, i, j):
    """The node of a lattice in whose cell a place lies, both in steps of the lattice."""
    raise NotImplementedError


@nearest.register(Square)
def _(cell, i, j):
    return math.floor(i + 0.5), math.floor(j + 0.5)


@nearest.register(Hexagon)
def _(cell, i, j):
    # Of three directions at 120 degrees, whose steps add up to 0, the one that rounding changes most is given up.
    a, b, c = math.floor(i + 0.5), math.floor(j + 0.5), math.floor(0.5 - i - j)
    da, db, dc = abs(a - i), abs(b - j), abs(c + i + j)
    if da > db and da > dc:
        return -b - c, b
    return (a, -a - c) if db > dc else (a, b)


@generic
def within_cell(cell, u1, u2):
    """A point of the cell about a node, evenly by area, in steps of the lattice."""
    raise NotImplementedError


@within_cell.register(Square)
def _(cell, u1, u2):
    return u1 - 0.5, u2 - 0.5


@within_cell.register(Hexagon)
def _(cell, u1, u2):
    # Three rhombi, each between two of every other corner: (1, 1) / 3, (-2, 1) / 3, (1, -2) / 3.
    part = 3.0 * u1
    number = min(math.floor(part), 2.0)
    part -= number
    if number == 0.0:
        return (part - 2.0 * u2) / 3.0, (part + u2) / 3.0
    if number == 1.0:
        return (u2 - 2.0 * part) / 3.0, (part - 2.0 * u2) / 3.0
    return (part + u2) / 3.0, (u2 - 2.0 * part) / 3.0
