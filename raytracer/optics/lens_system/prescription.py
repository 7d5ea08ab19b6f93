"""Prescriptions: lenses as files have them, such as those in `scenes/lenses/*.yaml`.

    name: Plano-convex singlet 100 mm
    source: worked example of a textbook
    focal_length: 100
    surfaces:
      - {type: flat, thickness: 5, material: 1.5, aperture: 25}
      - {type: spherical, radius: -50, aperture: 25}

Lengths are millimetres; surfaces come in the order in which light from the scene meets them; `thickness` is the
distance to the next surface, and `material` what fills it, air by default; `aperture` is the clear diameter.
"""

import math
from dataclasses import dataclass
from functools import reduce
from itertools import accumulate
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import BeforeValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.optics.glass import AIR, Glass, IndexField
from raytracer.optics.lens_system.coatings import Coating
from raytracer.optics.lens_system.lens import Element, Focus, Kind, Lens
from raytracer.schema.fields import Count, Number, PositiveLensLength, PositiveNumber, Quantity
from raytracer.schema.rules import only, requires
from raytracer.schema.spec import Spec, field_error
from raytracer.util.errors import format_value, suggest_name

MAX_SURFACES = 200


def _radius_value(value: Any) -> Any:
    """Refuse the radii that other programs write for flat glass."""
    number = float("inf") if value in ("inf", "infinity") else value
    if isinstance(number, int | float) and not isinstance(number, bool) and (number == 0 or math.isinf(number)):
        raise ValueError(
            f"must be neither zero nor infinite, got {format_value(value)}: flat glass is of the type flat"
        )
    return value


Radius: TypeAlias = Annotated[float, Quantity("optic", nonzero=True), BeforeValidator(_radius_value)]
Thickness: TypeAlias = Annotated[float, Quantity("optic", low=0.0)]


class CoatingSpec(Spec):
    """A layer a quarter of a wave thick, of magnesium fluoride, which reflects less than bare glass."""

    type: Literal["mgf2", "none"] = Field(default="mgf2", description="What it is of: `mgf2`; `none` is bare glass")
    wavelength: Annotated[float, Quantity(low=300.0, high=2500.0)] = Field(
        default=550.0, description="Wavelength (nm) of which it is a quarter thick, where it reflects least"
    )


@dataclass(frozen=True)
class _Shorthand:
    """Annotation of a mapping: a bare name stands for a mapping that has it under `key` and nothing else."""

    key: str
    names: tuple[str, ...]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(
            lambda value: {self.key: value} if isinstance(value, str) else value, handler(source)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"enum": list(self.names)}, handler(schema)]}


CoatingField: TypeAlias = Annotated[CoatingSpec, _Shorthand("type", ("mgf2", "none"))]


class SurfaceSpec(Spec):
    """Base of the surfaces: place, clear diameter, and the medium behind it."""

    aperture: PositiveLensLength = Field(description="Clear diameter: what light passes")
    thickness: Thickness | None = Field(
        default=None, description="Way along the axis to the next surface; of the last one without effect"
    )

    kind: ClassVar[Kind]

    def curvature(self) -> float:
        """Compute 1 / radius at the vertex (1/mm)."""
        return 0.0

    def glass(self, before: Glass) -> Glass:
        """Return the medium behind it, on the film's side; `before` is the one on the scene's side."""
        return before

    def is_stop(self) -> bool:
        """Return True if its rim is the diaphragm."""
        return self.kind == "stop" or bool(getattr(self, "stop", False))

    def element(self, before: Glass, coating: CoatingSpec | None) -> Element:
        """Make the surface of a lens, behind the glass `before`."""
        behind = self.glass(before)
        layer = getattr(self, "coating", None) or coating
        if layer and (layer.type == "none" or (before == AIR) == (behind == AIR)):
            layer = None
        return Element(
            curvature=self.curvature(),
            thickness=self.thickness or 0.0,
            glass=behind,
            radius=0.5 * self.aperture,
            kind=type(self).kind,
            conic=getattr(self, "conic", 0.0),
            coefficients=getattr(self, "coefficients", ()),
            axis=getattr(self, "axis", ""),
            coating=Coating(wavelength=layer.wavelength) if layer else None,
            is_stop=self.is_stop(),
        )


class _GlassSpec(SurfaceSpec):
    """Base of the surfaces of glass."""

    material: IndexField = Field(
        default=AIR,
        description="What fills the way to the next surface: an index of refraction, the name of a glass, "
        "{index: 1.62, abbe: 36.4}, {cauchy: [A, B, ...]} or {sellmeier: {b: [...], c: [...]}}; air by default",
    )
    coating: CoatingField | None = Field(
        default=None, description="Its coating against reflections: `mgf2` or `none`; that of the lens by default"
    )
    stop: bool = Field(default=False, description="Whether its rim is the diaphragm, in a lens without a `stop`")

    def curvature(self) -> float:
        radius: float | None = getattr(self, "radius", None)
        return 0.0 if radius is None else 1.0 / radius

    def glass(self, before: Glass) -> Glass:
        return self.material

    @model_validator(mode="after")
    def _reaches(self) -> Any:
        """Refuse an aperture that is wider than the conic section."""
        radius, conic = getattr(self, "radius", None), getattr(self, "conic", 0.0)
        widest = float("inf") if radius is None or conic <= -1.0 else 2.0 * abs(radius) / (1.0 + conic) ** 0.5
        if self.aperture > widest:
            field_error(
                "aperture", f"must be at most {widest:.6g} mm, as wide as its surface is, got {self.aperture:g}"
            )
        return self


class SphericalSpec(_GlassSpec):
    """A part of a sphere."""

    type: Literal["spherical"] = "spherical"
    radius: Radius = Field(description="Radius of curvature; positive where the centre is on the film's side")
    kind = "spherical"


class FlatSpec(_GlassSpec):
    """Flat glass."""

    type: Literal["flat"] = "flat"
    kind = "flat"


class StopSpec(SurfaceSpec):
    """The diaphragm, which is no glass: what is behind it is what is before it."""

    type: Literal["stop"] = "stop"
    kind = "stop"


class ConicSpec(_GlassSpec):
    """A conic section turned about the axis: z = c r^2 / (1 + sqrt(1 - (1 + k) c^2 r^2)), with c = 1 / radius."""

    type: Literal["conic"] = "conic"
    radius: Radius = Field(description="Radius of curvature at the vertex")
    conic: Number = Field(
        description="Conic constant k: 0 a sphere, below -1 a hyperboloid, -1 a paraboloid, else an ellipsoid"
    )
    kind = "conic"


class AsphereSpec(_GlassSpec):
    """An even asphere: a conic section and a_4 r^4 + a_6 r^6 + ..."""

    type: Literal["asphere"] = "asphere"
    radius: Radius | None = Field(
        default=None, description="Radius of curvature at the vertex; without it the vertex is flat"
    )
    conic: Number = Field(default=0.0, description="Conic constant k; 0 by default, a sphere")
    coefficients: tuple[Number, ...] = Field(
        min_length=1, max_length=10, description="a_4 (1/mm^3), a_6 (1/mm^5), ... of the even powers of the height"
    )
    kind = "asphere"


class CylindricalSpec(_GlassSpec):
    """A part of a cylinder, as anamorphic lenses have it."""

    type: Literal["cylindrical"] = "cylindrical"
    radius: Radius = Field(
        description="Radius of curvature across the axis; positive with the centre on the film's side"
    )
    axis: Literal["x", "y"] = Field(
        description="Along which the surface is straight and bends nothing: x, to the right of the picture, or y, up"
    )
    kind = "cylindrical"


_KINDS: dict[str, type[SurfaceSpec]] = {
    kind.kind: kind for kind in (SphericalSpec, FlatSpec, StopSpec, ConicSpec, AsphereSpec, CylindricalSpec)
}


def _known_kind(value: Any) -> Any:
    """Refuse an unknown kind of surface, before pydantic does with a message of its own."""
    if isinstance(value, SurfaceSpec):
        return value
    if not isinstance(value, dict):
        raise ValueError(f"must be a mapping with a type ({', '.join(_KINDS)}), got {format_value(value)}")  # noqa: TRY004
    if "type" not in value:
        raise ValueError(f"needs a type, one of {', '.join(_KINDS)}")
    kind = value["type"]
    if not isinstance(kind, str) or kind not in _KINDS:
        field_error("type", f"unknown type of surface {format_value(kind)}; {suggest_name(str(kind), _KINDS, 'types')}")
    return value


if TYPE_CHECKING:
    Surface: TypeAlias = SurfaceSpec
else:
    Surface = Annotated[reduce(or_, _KINDS.values()), Field(discriminator="type"), BeforeValidator(_known_kind)]


class FocusSpec(Spec):
    """The part that moves when the lens is focused."""

    moves: Literal["all", "sensor", "group"] = Field(
        default="all", description="The whole lens, the sensor behind it, or a group of its surfaces"
    )
    first: Annotated[int, Count(1, MAX_SURFACES)] | None = Field(
        default=None, description="Number of the group's first surface, from 1"
    )
    last: Annotated[int, Count(1, MAX_SURFACES)] | None = Field(
        default=None, description="Number of the group's last surface"
    )

    _has_a_group = only("first", "last", where={"moves": "group"}, message="goes with moves: group")
    _whole_group = requires(
        "first", "last", where={"moves": "group"}, message="is missing: a group has a first and a last surface"
    )

    @model_validator(mode="after")
    def _group(self) -> "FocusSpec":
        if self.first is not None and self.last is not None and self.last < self.first:
            field_error("last", f"must be at least {self.first}, the first surface, got {self.last}")
        return self


def _tuple(value: Any) -> Any:
    """Make a tuple of a list of YAML."""
    return tuple(value) if isinstance(value, list) else value


class LensSpec(Spec):
    """A lens: what a lens file holds, checked."""

    name: str = Field(min_length=1, description="What the lens is called")
    description: str = Field(default="", description="What is remarkable about it")
    source: str = Field(default="", description="Where its numbers are from: a patent, a book and page")
    focal_length: Annotated[float, Quantity("optic", nonzero=True)] | None = Field(
        default=None, description="Focal length as published"
    )
    f_number: PositiveNumber | None = Field(default=None, description="Smallest f-number as published")
    image_circle: PositiveLensLength | None = Field(
        default=None, description="Diameter of the picture that it is made to cover"
    )
    focus: Annotated[FocusSpec, _Shorthand("moves", ("all", "sensor"))] = Field(
        default=FocusSpec(),
        description="What moves when it is focused: `all`, the whole lens, `sensor`, or "
        "{moves: group, first: 3, last: 5}, those of its surfaces, counted from 1",
    )
    coating: CoatingField | None = Field(
        default=None, description="Coating of all surfaces between glass and air that have none of their own"
    )
    surfaces: Annotated[tuple[Surface, ...], BeforeValidator(_tuple)] = Field(
        min_length=1, max_length=MAX_SURFACES, description="Its surfaces, as light from the scene meets them"
    )

    @model_validator(mode="after")
    def _agrees(self) -> "LensSpec":
        for number, surface in enumerate(self.surfaces[:-1]):
            if surface.thickness is None:
                field_error(("surfaces", number, "thickness"), "is missing: only the last surface needs none")
        stops = [number for number, surface in enumerate(self.surfaces) if surface.is_stop()]
        if len(stops) > 1:
            key = "type" if self.surfaces[stops[1]].kind == "stop" else "stop"
            field_error(("surfaces", stops[1], key), f"is a second stop; the first is surface {stops[0] + 1}")
        last = self.focus.last
        if last is not None and last > len(self.surfaces):
            field_error(("focus", "last"), f"there is no surface {last}: the lens has {len(self.surfaces)}")
        glasses = self._glasses()
        for number, (surface, before, behind) in enumerate(zip(self.surfaces, glasses, glasses[1:], strict=False)):
            layer = getattr(surface, "coating", None)
            if layer and layer.type != "none" and (before == AIR) == (behind == AIR):
                field_error(("surfaces", number, "coating"), "only a surface between glass and air can have one")
        if glasses[-1] != AIR:
            field_error(
                ("surfaces", len(self.surfaces) - 1, "material"), "must be air: the film is behind the last surface"
            )

        # The lens checks the rest.
        self.lens()
        return self

    def _glasses(self) -> list[Glass]:
        """List the media before the first surface, and behind each."""
        return list(accumulate(self.surfaces, lambda before, surface: surface.glass(before), initial=AIR))

    def lens(self) -> Lens:
        """Make the lens that it describes."""
        rows = zip(self.surfaces, self._glasses(), strict=False)
        return Lens(
            name=self.name,
            source=self.source,
            elements=tuple(surface.element(before, self.coating) for surface, before in rows),
            focal_length=self.focal_length,
            f_number=self.f_number,
            image_circle=self.image_circle,
            focus=Focus(self.focus.moves, self.focus.first or 1, self.focus.last or 1),
        )
