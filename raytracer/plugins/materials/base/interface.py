"""Interface of materials: the spec's methods for packing, and the generic functions for kernels.

A kind's file holds its YAML spec, its packed table (one row a material), the record that one row makes for a hit,
and its cases of the functions below.  Directions are unit vectors; `normal` is turned against the incoming
`direction`; `front` says whether the ray came from the outside of the surface.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple, TypeAlias

from pydantic import BeforeValidator, Field

from raytracer.core.compiler.dispatch import generic, kernel, overridable
from raytracer.core.sampling.hashing import ONE_MINUS_EPSILON
from raytracer.core.vec import Vec3
from raytracer.optics.glass import Glass
from raytracer.plugins.textures.base.interface import OptionalTexture, ParameterPacker
from raytracer.schema.fields import Length, NonNegativeNumber, Vector, name_or_material
from raytracer.schema.rules import only
from raytracer.schema.spec import Spec

BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)


class InteriorMedium(NamedTuple):
    """Filling of an object that has a priority over others.

    priority : where objects overlap, the highest is there.
    ior : index of refraction.
    absorption (1/m) : coefficient by channel.
    """

    priority: int
    ior: Glass
    absorption: Vector


class MaterialSpec(Spec):
    """Base of the materials, with the bump and normal maps that any surface may have."""

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

    _scales_bumps = only("bump_height", where="bump", message="needs a bump, the texture that it scales")
    _scales_normals = only("normal_scale", where="normal_map", message="needs a normal_map, the texture that it scales")

    @staticmethod
    def pack(specs: Any, book: ParameterPacker) -> Any:
        """Pack the materials of this kind, one row a spec; `book` turns colours and numbers into parameters."""
        raise NotImplementedError

    def has_non_delta_bsdf(self) -> bool:
        """Tell if light from a sampled direction can leave in another: not for mirrors and glass."""
        return False

    def has_delta_bsdf(self) -> bool:
        """Tell if some light leaves in the one direction of a mirror or of glass, so that lights are seen in it."""
        return not (self.has_non_delta_bsdf() or self.is_emissive() or self.is_invisible())

    def emitted_power(self, book: ParameterPacker) -> float:
        """Return the power of a square metre, in a unit common to all materials, by which emitters are sampled."""
        return 0.0

    def is_emissive(self) -> bool:
        """Tell if it may emit light; its `emitted_power` is 0 if not."""
        return False

    def has_passthrough(self) -> bool:
        """Tell if light may go straight through, as if nothing were there."""
        return False

    def is_invisible(self) -> bool:
        """Tell if all light goes straight through everywhere, so that there is nothing to be seen, or focused on."""
        return False

    def is_index_matched(self) -> bool:
        """Tell if it has the same index on both sides, so that light goes through it as if nothing were there."""
        return False

    def interior_medium(self) -> InteriorMedium | None:
        """Return the filling of an object of this resolved material; None if it has no priority.

        Raises
        ------
        ValueError : the materials that it selects from fill it with different things.
        """
        fillings = dict.fromkeys(child.interior_medium() for child in self.children().values())
        given = [filling for filling in fillings if filling is not None]
        if len(given) > 1:
            raise ValueError(
                "its materials fill one object with different things: give those with a priority the same priority, "
                "ior and absorption"
            )
        return given[0] if given else None

    def dispersion_mode(self) -> int:
        """Return the mode in which it disperses: TERMINATE_ON_HIT or TERMINATE_ON_REFRACTION, 0 if it does not."""
        return 0

    def as_boundary_to(self, ior: Glass) -> "MaterialSpec | None":
        """Return this material as a boundary to something of that index; None where that is no boundary."""
        return self

    def is_transmissive(self) -> bool:
        """Tell if some light goes into it, or through it and on in another direction."""
        return any(child.is_transmissive() for child in self.children().values())

    def admits_light(self) -> bool:
        """Tell if light goes into or through objects of this material."""
        return self.has_passthrough() or self.is_transmissive()

    def has_interior(self) -> bool:
        """Tell if light that goes in is inside of something, which then has a medium of its own or none."""
        return any(child.has_interior() for child in self.children().values())

    def children(self) -> Mapping[tuple[str | int, ...], Any]:
        """Return the materials that this one selects from, names or specs, by the path to their key."""
        return {}

    def flipped(self) -> "MaterialSpec":
        """Return this material for the back of a surface, with its two sides exchanged."""
        return self

    def with_mean_textures(self, means: Mapping[str, Any]) -> "MaterialSpec":
        """Return this material with plain values in place of some keys' textures, of which they are the means."""
        return self.model_copy(update=means)


class SelectorSpec(MaterialSpec):
    """Base of the selectors, materials that only choose among others."""

    def nearest_child(self, book: ParameterPacker) -> MaterialSpec | None:
        """Return the resolved child that is most like what it shows; None if it has none."""
        return next(iter(self.children().values()), None)

    def with_children(self, children: Sequence[MaterialSpec]) -> MaterialSpec:
        """Return this material with these in place of names; or one of them, where no other is ever selected."""
        raise NotImplementedError

    @staticmethod
    def pack_selectors(specs: Any, book: ParameterPacker, children: Sequence[Sequence[int]]) -> Any:
        """Pack the selectors of this kind, one row a spec; `children`: references, by spec and child."""
        raise NotImplementedError

    def flipped(self) -> MaterialSpec:
        return self.with_children([child.flipped() for child in self.children().values()])

    def has_non_delta_bsdf(self) -> bool:
        return any(child.has_non_delta_bsdf() for child in self.children().values())

    def has_delta_bsdf(self) -> bool:
        return any(child.has_delta_bsdf() for child in self.children().values())

    def is_emissive(self) -> bool:
        return any(child.is_emissive() for child in self.children().values())

    def has_passthrough(self) -> bool:
        return any(child.has_passthrough() for child in self.children().values())

    def is_invisible(self) -> bool:
        children = self.children().values()
        return bool(children) and all(child.is_invisible() for child in children)


Child: TypeAlias = Annotated[Any, BeforeValidator(name_or_material)]
"""Field of a material within a material: a name, or a mapping."""


class Scatter(NamedTuple):
    """Direction drawn by a material.

    direction : unit vector.
    weight : f |cos| / pdf by channel, zero where the path ends.
    pdf (1/sr) : of the direction; infinite for the one of a mirror or glass, which no light sample could have found.
    """

    direction: Vec3
    weight: Vec3
    pdf: float


class Draws(NamedTuple):
    """Source of the random numbers of a sample: see `core.sampling`.

    sampler : that draws the numbers.
    key : of the pixel.
    index : of the sample in its pixel.
    dimension : of the first number of this bounce.
    """

    sampler: Any
    key: int
    index: int  # type: ignore[assignment]  # takes the place of tuple.index
    dimension: int


# Slots of random numbers within one bounce, each a dimension of its own (or two); a slot not drawn costs nothing.
LOBE, DIRECTION, LIGHT, LIGHT_POINT, ROULETTE, SELECT, MEDIUM, PHASE, DIMENSIONS_PER_SEGMENT = 0, 1, 2, 3, 4, 5, 6, 7, 8


@generic
def row(table, index, textures, site):
    """Look up the parameters of material `index` at a `geometry.Site`, as a record of scalars.

    A table of arrays handed on would compile 60 times slower.
    """


@generic
def scatter(material, direction, normal, front, draws):
    """Sample the direction in which light goes on that arrives along `direction`: a Scatter."""


@overridable
def evaluate(material, direction, normal, front, outgoing):
    """Evaluate f |cos| by channel toward `outgoing`, and the pdf (1/sr) of `scatter`; both 0 by default."""
    return BLACK, 0.0


@overridable
def emission(table, index, front, textures, site):
    """Return the radiance that leaves the surface of material `index` on the side named by `front`; none by default."""
    return BLACK


@generic
def reflectance(material):
    """Return the fraction of light that is not absorbed, by channel, seen head on: the AOV `albedo`."""


PASSTHROUGH = -1
"""In place of a material's reference: nothing is here, and light goes straight on."""


@generic
def select(table, index, front, textures, site, u):
    """Choose the material that selector `index` shows at a site, by the number `u`.

    Returns
    -------
    Its reference or PASSTHROUGH, and a number to draw with next.
    """


@kernel
def split_random_number(u, probability):
    """Tell if `u`, uniform in [0, 1), falls on an event of this probability, and reuse the rest of it as uniform."""
    if u < probability:
        return True, u / probability
    return False, min((u - probability) / (1.0 - probability), ONE_MINUS_EPSILON)


@kernel
def absorbed_scatter(direction: Vec3) -> Scatter:
    """Make a Scatter that ends the path."""
    return Scatter(direction, BLACK, math.inf)
