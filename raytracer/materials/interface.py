"""What every material kind gives to kernels.

A kind's file holds its YAML spec, its packed table (one row a material), the record that one row makes for a hit,
and its cases of the functions below.  Directions are unit vectors; `normal` is turned against the incoming
`direction`; `front` says whether the ray came from the outside of the surface.
"""

import math
from typing import Any, NamedTuple

from raytracer.jit import generic, kernel, switch
from raytracer.spec import Spec
from raytracer.textures.interface import Book
from raytracer.vec import Vec3

BLACK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)


class MaterialSpec(Spec):
    """Base of the materials: what packing asks of each."""

    type: str

    @staticmethod
    def pack(specs: Any, book: Book) -> Any:
        """The table of materials of this kind, one row a spec; `book` turns colours and numbers into parameters."""
        raise NotImplementedError

    def is_lit(self) -> bool:
        """Whether light that arrives from a chosen direction can leave in another (not so for mirrors and glass)."""
        return False

    def exitance(self, book: Book) -> float:
        """What a square metre radiates, in any unit that is the same for all materials: how often to aim at it."""
        return 0.0

    def passes(self) -> bool:
        """Whether light may go straight through, as if nothing were there."""
        return False


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


@generic
def count(selectors):
    """How many kinds of selectors there are."""
    raise NotImplementedError


@count.register(type(None))
def _(selectors):
    return 0


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
def select_at(selectors, scene, reference, front, site, draws):
    """The material that is met, through selectors, at a surface of this material: its reference, or PASS."""
    raise NotImplementedError


@select_at.register(type(None))
def _(selectors, scene, reference, front, site, draws):
    return reference


@kernel
def absorbed(direction: Vec3) -> Scatter:
    """The end of a path."""
    return Scatter(direction, BLACK, math.inf)
