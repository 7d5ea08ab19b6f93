"""What every material kind gives to kernels.

A kind's file holds its YAML spec, its packed table (one row a material), the record that one row makes for a hit,
and its cases of the functions below.  Directions are unit vectors; `normal` is turned against the incoming
`direction`; `front` says whether the ray came from the outside of the surface.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from raytracer.glass import AIR, LINE_D, Glass, IndexField, constant
from raytracer.jit import generic, kernel, switch
from raytracer.sampling import sample_2d
from raytracer.sampling.hashing import BELOW_ONE
from raytracer.spec import (
    Color,
    Count,
    Length,
    NonNegativeNumber,
    PositiveLength,
    Quantity,
    Spec,
    Triple,
    Vector,
    at,
    name_or_material,
)
from raytracer.spectra import FIRST, LAST
from raytracer.textures.interface import Book, OptionalTexture
from raytracer.vec import Vec3

BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)


class Filling(NamedTuple):
    """What an object is filled with that has a priority over others: its index of refraction and absorption (1/m)."""

    priority: int
    ior: Glass
    absorption: Vector


class MaterialSpec(Spec):
    """Base of the materials: what packing asks of each, and the relief that any surface may have."""

    type: str
    bump: OptionalTexture = Field(
        default=None, description="texture of heights, whose slopes the surface is shaded with: a name or a texture"
    )
    bump_height: Length = Field(default=0.01, description="height of the texture's value 1 above its value 0 (m)")
    normal_map: OptionalTexture = Field(
        default=None,
        description="texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards",
    )
    normal_scale: NonNegativeNumber = Field(default=1.0, description="what the map's slopes are multiplied by")

    @model_validator(mode="after")
    def _relief_has_a_texture(self) -> "MaterialSpec":
        for key, texture in (("bump_height", "bump"), ("normal_scale", "normal_map")):
            if key in self.model_fields_set and getattr(self, texture) is None:
                at(key, f"needs a {texture}, the texture that it scales")
        return self

    @staticmethod
    def pack(specs: Any, book: Book) -> Any:
        """The table of materials of this kind, one row a spec; `book` turns colours and numbers into parameters."""
        raise NotImplementedError

    def is_lit(self) -> bool:
        """Whether light that arrives from a chosen direction can leave in another (not so for mirrors and glass)."""
        return False

    def mirrors(self) -> bool:
        """Tell if some light leaves in a direction without choice, in which it shows lights that are found so."""
        return not (self.is_lit() or self.emits() or self.lets_all_through())

    def exitance(self, book: Book) -> float:
        """What a square metre radiates, in any unit that is the same for all materials: how often to aim at it."""
        return 0.0

    def emits(self) -> bool:
        """Whether it may give light; its `exitance` is 0 if not."""
        return False

    def passes(self) -> bool:
        """Whether light may go straight through, as if nothing were there."""
        return False

    def lets_all_through(self) -> bool:
        """Whether all light goes straight through everywhere, so that there is nothing to be seen, or focused on."""
        return False

    def is_nothing(self) -> bool:
        """Whether it is no boundary at all, so that light goes through it as if nothing were there."""
        return False

    def filling(self) -> Filling | None:
        """What an object of this resolved material is filled with; None if it has no priority over what it overlaps.

        Raises
        ------
        ValueError : the materials that it selects from fill it with different things.
        """
        found = dict.fromkeys(child.filling() for child in self.children().values())
        given = [filling for filling in found if filling is not None]
        if len(given) > 1:
            raise ValueError(
                "its materials fill one object with different things: give those with a priority the same priority, "
                "ior and absorption"
            )
        return given[0] if given else None

    def parting(self) -> int:
        """How it sends light of each wavelength another way: spectra.TOGETHER or ALONE, or 0 if it does not."""
        return 0

    def against(self, ior: Glass) -> "MaterialSpec | None":
        """This material as a boundary to something of that index; None where there is no boundary then."""
        return self

    def transmits(self) -> bool:
        """Whether some light goes into it, or through it and on in another direction."""
        return any(child.transmits() for child in self.children().values())

    def holds_medium(self) -> bool:
        """Whether light that goes in is inside of something, which then has a medium of its own or none."""
        return any(child.holds_medium() for child in self.children().values())

    def children(self) -> Mapping[tuple[str | int, ...], Any]:
        """The materials that this one selects from, names or specs, by the path to their key."""
        return {}

    def turned(self) -> "MaterialSpec":
        """This material for the back of a surface: what it gives to its front, it gives there to the back."""
        return self

    def with_means(self, means: Mapping[str, Any]) -> "MaterialSpec":
        """This material with plain values in place of the textures of some keys, of which they are the means."""
        return self.model_copy(update=means)


class SelectorSpec(MaterialSpec):
    """Base of the materials that only name other ones."""

    def nearest_child(self, book: Book) -> MaterialSpec | None:
        """The one of its children, which are resolved, that comes nearest to what it shows; None if it has none."""
        return next(iter(self.children().values()), None)

    def with_children(self, children: Sequence[MaterialSpec]) -> MaterialSpec:
        """This material with these in place of names; one of them, where no other is ever selected."""
        raise NotImplementedError

    @staticmethod
    def pack_selectors(specs: Any, book: Book, children: Sequence[Sequence[int]]) -> Any:
        """The table of selectors of this kind, one row a spec; `children`: references, by spec and child."""
        raise NotImplementedError

    def turned(self) -> MaterialSpec:
        return self.with_children([child.turned() for child in self.children().values()])

    def is_lit(self) -> bool:
        return any(child.is_lit() for child in self.children().values())

    def mirrors(self) -> bool:
        return any(child.mirrors() for child in self.children().values())

    def emits(self) -> bool:
        return any(child.emits() for child in self.children().values())

    def passes(self) -> bool:
        return any(child.passes() for child in self.children().values())

    def lets_all_through(self) -> bool:
        children = self.children().values()
        return bool(children) and all(child.lets_all_through() for child in children)


_Attenuation: TypeAlias = Annotated[Vector, Triple(Quantity(low=0.0, low_open=True, high=1.0), "a colour", single=True)]


class ClearSpec(MaterialSpec):
    """Base of the boundaries of clear solids and liquids, which may overlap by priorities.

    References: Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images", JGT 7(2); absorption: Beer 1852;
    attenuation by colour and distance: KHR_materials_volume of glTF.
    """

    ior: IndexField = Field(
        default=constant(1.5),
        description="index of refraction on the inside: a number, a glass of the catalogue such as N-BK7, or {index, "
        "abbe}, {cauchy} or {sellmeier}; glass whose index depends on the wavelength disperses light",
    )
    outside_ior: IndexField = Field(
        default=AIR, description="index on the outside, likewise: of the glass that this one is embedded in"
    )
    priority: Annotated[int, Count(0, 2**31 - 1)] | None = Field(
        default=None,
        description="where objects overlap that have a priority, the one with the highest is there; takes the place of "
        "`outside_ior`",
    )
    absorption: Color | None = Field(
        default=None,
        description="absorption coefficient of the inside by channel (1/m); none by default; of a "
        "`rough_dielectric` it needs a `priority`",
    )
    attenuation_color: _Attenuation | None = Field(
        default=None,
        description="in place of `absorption`: the colour of white light after `attenuation_distance`",
    )
    attenuation_distance: PositiveLength | None = Field(
        default=None, description="the distance within which light takes on `attenuation_color` (m)"
    )

    @model_validator(mode="after")
    def _one_absorption(self) -> Any:
        if (self.attenuation_color is None) != (self.attenuation_distance is None):
            missing = "attenuation_color" if self.attenuation_color is None else "attenuation_distance"
            at(missing, "is missing; attenuation_color and attenuation_distance go together")
        if self.absorption is not None and self.attenuation_color is not None:
            at("absorption", "goes not with attenuation_color: give the one or the other")
        return self

    @model_validator(mode="after")
    def _one_outside(self) -> Any:
        for key in ("outside_ior", "outside_absorption"):
            if self.priority is not None and key in self.model_fields_set:
                at(key, "goes not with priority, by which what is outside is found: leave it out")
        return self

    def inside_absorption(self) -> Vector:
        """Absorption coefficient (1/m) of the inside, by channel."""
        if self.attenuation_color is not None and self.attenuation_distance is not None:
            r, g, b = (-math.log(kept) / self.attenuation_distance for kept in self.attenuation_color)
            return r, g, b
        return self.absorption or BLACK

    def filling(self) -> Filling | None:
        return None if self.priority is None else Filling(self.priority, self.ior, self.inside_absorption())

    def disperses(self) -> bool:
        """Whether the index on one of its sides depends on the wavelength."""
        return self.ior.disperses() or self.outside_ior.disperses()

    def eta(self, wavelength: float = LINE_D) -> float:
        """The index inside over that outside, for light of a wavelength (nm)."""
        return float(self.ior.ior(wavelength)) / float(self.outside_ior.ior(wavelength))

    def against(self, ior: Glass) -> MaterialSpec | None:
        if ior == self.ior:
            return None
        return self if ior == self.outside_ior else self.model_copy(update={"outside_ior": ior})

    def transmits(self) -> bool:
        return True

    def holds_medium(self) -> bool:
        return True


_PER_NANOMETRE = 2


class Dispersion(NamedTuple):
    """Indices that depend on the wavelength.

    eta (n, m) float64, by material, index inside over index outside, at half nanometres from FIRST to LAST of
    `spectra`; between them it is linear, which for optical glass is right to 1e-6; disperses (n,) uint8, whether a
    material does.
    """

    eta: NDArray[np.float64]
    disperses: NDArray[np.uint8]


def pack_dispersion(specs: Sequence[ClearSpec]) -> Dispersion | None:
    """The indices of boundaries by wavelength, a row each; None where none of them disperses."""
    if not any(spec.disperses() for spec in specs):
        return None
    wavelengths = np.linspace(FIRST, LAST, int(_PER_NANOMETRE * (LAST - FIRST)) + 1)
    rows = [spec.ior.ior(wavelengths) / spec.outside_ior.ior(wavelengths) for spec in specs]
    return Dispersion(np.array(rows, np.float64), np.array([spec.disperses() for spec in specs], np.uint8))


@kernel
def eta_at(dispersion: Dispersion, index: int, wavelength: float) -> float:
    """Index inside over index outside of boundary `index` of a table, at a wavelength (nm)."""
    place = _PER_NANOMETRE * (wavelength - FIRST)
    first = int(max(0, min(dispersion.eta.shape[1] - 2, int(place))))
    below, above = float(dispersion.eta[index, first]), float(dispersion.eta[index, first + 1])
    return below + (place - first) * (above - below)


Child: TypeAlias = Annotated[Any, BeforeValidator(name_or_material)]
"""Field of a material within a material: a name, or a mapping."""


class Scatter(NamedTuple):
    """A direction drawn by a material.

    direction, unit; weight = f |cos| / pdf by channel, zero where the path ends; pdf (1/sr), infinite for a
    direction without choice (mirror, glass), which no light sample could have found.
    """

    direction: Vec3
    weight: Vec3
    pdf: float


class Draws(NamedTuple):
    """Where a material takes its random numbers from: see sampling.interface."""

    sampler: Any
    key: int
    index: int  # type: ignore[assignment]  # takes the place of tuple.index
    dimension: int


# Slots of random numbers within one bounce, each a dimension of its own (or two); a slot not drawn costs nothing.
LOBE, DIRECTION, LIGHT, LIGHT_POINT, ROULETTE, SELECT, MEDIUM, PHASE, SLOTS = 0, 1, 2, 3, 4, 5, 6, 7, 8


@generic
def row(table, index, textures, site):
    """The parameters of material `index` at a geometry.Site, as a record of scalars.

    A table of arrays handed on would compile 60 times slower.
    """
    raise NotImplementedError


@generic
def scatter(material, direction, normal, front, draws):
    """Draw where light goes that arrives along `direction`: a Scatter."""
    raise NotImplementedError


@generic
def evaluate(material, direction, normal, front, outgoing):
    """f |cos| by channel toward `outgoing`, and the pdf (1/sr) with which `scatter` draws it; zero without choice."""
    raise NotImplementedError


@generic
def emission(table, index, front, textures, site):
    """Radiance that leaves the surface of material `index` on the side named by `front`."""
    raise NotImplementedError


@generic
def reflectance(material):
    """The fraction of light that is not absorbed, by channel, about as seen head on: the albedo of an image's layer."""
    raise NotImplementedError


def _scatter_row(table, index, textures, site, direction, normal, front, draws):
    return scatter(row(table, index, textures, site), direction, normal, front, draws)


def _evaluate_row(table, index, textures, site, direction, normal, front, outgoing):
    return evaluate(row(table, index, textures, site), direction, normal, front, outgoing)


def _reflectance_row(table, index, textures, site):
    return reflectance(row(table, index, textures, site))


_scatter_any = switch(kernel(_scatter_row))
_evaluate_any = switch(kernel(_evaluate_row))
_emission_any = switch(emission)
_reflectance_any = switch(kernel(_reflectance_row))


# A primitive names its material by one number, row * kinds + kind: the kinds are a constant of the compiled scene.
# Kinds from len(materials) on are selectors, which name another material.


class Selectors(NamedTuple):
    """tables, one a kind of selector."""

    tables: tuple[Any, ...]


@generic
def count(selectors):
    """How many kinds of selectors there are."""
    raise NotImplementedError


@count.register(type(None))
def _(selectors):
    return 0


@count.register(Selectors)
def _(selectors):
    return len(selectors.tables)


@kernel
def scatter_at(scene, reference, site, direction, normal, front, draws):
    """`scatter` of a material that is no selector."""
    kinds = len(scene.materials) + count(scene.selectors)
    kind, index = reference % kinds, reference // kinds
    return _scatter_any(scene.materials, kind, index, scene.textures, site, direction, normal, front, draws)


@kernel
def evaluate_at(scene, reference, site, direction, normal, front, outgoing):
    """`evaluate` of a material that is no selector."""
    kinds = len(scene.materials) + count(scene.selectors)
    kind, index = reference % kinds, reference // kinds
    return _evaluate_any(scene.materials, kind, index, scene.textures, site, direction, normal, front, outgoing)


@kernel
def emission_at(scene, reference, front, site):
    """`emission` of a material that is no selector."""
    kinds = len(scene.materials) + count(scene.selectors)
    return _emission_any(scene.materials, reference % kinds, reference // kinds, front, scene.textures, site)


@kernel
def reflectance_at(scene, reference, site):
    """`reflectance` of a material that is no selector."""
    kinds = len(scene.materials) + count(scene.selectors)
    return _reflectance_any(scene.materials, reference % kinds, reference // kinds, scene.textures, site)


PASS = -1
"""In place of a material's reference: nothing is here, and light goes straight on."""


@generic
def select(table, index, front, textures, site, u):
    """What selector `index` shows at a site, by the number `u`: (reference or PASS, a number to draw with next)."""
    raise NotImplementedError


_select_any = switch(select)


@kernel
def chance(u, probability):
    """Whether `u`, uniform in [0, 1), falls on an event of this probability; and what is left of it, as uniform."""
    if u < probability:
        return True, u / probability
    return False, min((u - probability) / (1.0 - probability), BELOW_ONE)


@kernel
def _chosen(selectors, scene, reference, front, site, u):
    first = len(scene.materials)
    kinds = first + len(selectors.tables)
    while reference >= 0 and reference % kinds >= first:
        reference, u = _select_any(
            selectors.tables, reference % kinds - first, reference // kinds, front, scene.textures, site, u
        )
    return reference


@generic
def select_at(selectors, scene, reference, front, site, draws):
    """The material that is met, through selectors, at a surface of this material: its reference, or PASS."""
    raise NotImplementedError


@select_at.register(type(None))
def _(selectors, scene, reference, front, site, draws):
    return reference


@select_at.register(Selectors)
def _(selectors, scene, reference, front, site, draws):
    u, _ = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + SELECT)
    return _chosen(selectors, scene, reference, front, site, u)


@generic
def select_again(selectors, scene, reference, front, site, draws):
    """As `select_at`, by another number: for light that comes from elsewhere to where the path is."""
    raise NotImplementedError


@select_again.register(type(None))
def _(selectors, scene, reference, front, site, draws):
    return reference


@select_again.register(Selectors)
def _(selectors, scene, reference, front, site, draws):
    _, u = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + SELECT)
    return _chosen(selectors, scene, reference, front, site, u)


@generic
def emission_shown(selectors, scene, reference, front, site, draws):
    """Radiance of a point that a light sample chose: that of the material which its selectors show just then."""
    raise NotImplementedError


@emission_shown.register(type(None))
def _(selectors, scene, reference, front, site, draws):
    return emission_at(scene, reference, front, site)


@emission_shown.register(Selectors)
def _(selectors, scene, reference, front, site, draws):
    shown = select_again(selectors, scene, reference, front, site, draws)
    return BLACK if shown == PASS else emission_at(scene, shown, front, site)


@kernel
def absorbed(direction: Vec3) -> Scatter:
    """The end of a path."""
    return Scatter(direction, BLACK, math.inf)
