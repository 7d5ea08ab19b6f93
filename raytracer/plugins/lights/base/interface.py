"""What every light kind gives to kernels, and the choice among the kinds.

A kind's file holds its YAML spec, its packed table (one row a light) and its cases of the functions below.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple, TypeAlias

from raytracer.environments.interface import background
from raytracer.geometry import offset_of
from raytracer.jit import fold, generic, kernel, switch
from raytracer.materials.interface import BLACK, LIGHT
from raytracer.sampling import sample_1d
from raytracer.sampling.alias import sample_alias
from raytracer.shutter import Timing
from raytracer.spec import Quantity, Spec, Triple
from raytracer.vec import Vec3, add, max_abs, norm, scale, sub

Intensity: TypeAlias = Annotated[Vec3, Triple(Quantity(low=0.0), "an intensity", single=True)]
Irradiance: TypeAlias = Annotated[Vec3, Triple(Quantity(low=0.0), "an irradiance", single=True)]

_FAR = 2.0**100


class LightSpec(Spec):
    """Base of the kinds of the `lights` list: what packing asks of each."""

    type: str

    @staticmethod
    def pack(specs: Sequence[Any]) -> Any:
        """The table of the lights of this kind that shine, one row a light; None if none does."""
        raise NotImplementedError

    def is_seen(self) -> bool:
        """Whether a ray that was not aimed at the light may find it, so that mirrors show it."""
        return False

    def pulse(self, timing: Timing) -> tuple[float, float] | None:
        """When it shines while the shutter is open: begin and end (s of scene time); None where it always does."""
        return None

    def fired(self, timing: Timing, place: Vec3, timed: bool) -> Any:
        """The light as `pack` takes it, in the time of a shutter that is open for some time.

        Parameters
        ----------
        place : where the camera is when the light's pulse begins (m).
        timed : whether paths have a time; without it a pulse is spread over the exposure.
        """
        return self


def unit(vector: Vec3) -> Vec3:
    """A unit vector along any but the zero vector, whatever its length."""
    x, y, z = scale(1.0 / max(map(abs, vector)), vector)
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


class LightSample(NamedTuple):
    """Light that may reach a point.

    direction, unit, towards the light; weight, its radiance (W/(m2 sr)) without what may stand between, over the pdf;
    pdf (1/sr) of the direction, infinite for a light without extent, 0 where nothing can arrive; target, the light's
    point; gap, how far before it a shadow ray ends (m), minus infinity for a light at infinity.
    """

    direction: Vec3
    weight: Vec3
    pdf: float
    target: Vec3
    gap: float


class Lights(NamedTuple):
    """What surfaces aim at, and what rays find at infinity.

    tables, one a kind of light, each of which is chosen as often as any other; unaimed, the environment if none of them
    is that, else None; heuristic, how light that is both aimed at and found is shared: None for the power heuristic, or
    AimedOnly.
    """

    tables: tuple[Any, ...]
    unaimed: Any
    heuristic: Any = None


class Unaimed(NamedTuple):
    """What rays find at infinity where nothing aims at it: tables, one a kind of light, and the environment or None."""

    tables: tuple[Any, ...]
    unaimed: Any


class AimedOnly(NamedTuple):
    """A heuristic: what can be aimed at counts where it is aimed at, and not where a path finds it by chance.

    What a path finds still counts where it had no choice of direction, as at the camera and behind mirrors and glass,
    and where no light sample would have aimed.
    """


@generic
def sample_light(table, scene, point, time, u, draws):
    """Choose a light of the table by the number `u`, and a point on it as seen from `point`: a LightSample."""
    raise NotImplementedError


@generic
def pdf_hit(table, scene, instance, number, primitive, origin, point, normal, time):
    """Density in solid angle (1/sr) with which `sample_light` at `origin` aims at `point` on a primitive."""
    raise NotImplementedError


@pdf_hit.register(tuple)
def _(table, scene, instance, number, primitive, origin, point, normal, time):
    return 0.0


@generic
def arriving(table, scene, direction, pdf, tables, heuristic):
    """Radiance that a ray which leaves the scene along `direction` meets of the table's lights at infinity.

    It is weighted by the heuristic: `pdf` is the density with which the ray's direction was drawn, and `tables` the
    number of tables among which `sample_lights` chooses.
    """
    raise NotImplementedError


@arriving.register(tuple)
def _(table, scene, direction, pdf, tables, heuristic):
    return BLACK


@generic
def moved(table: Any, by: Vec3) -> Any:
    """The table of lights in a world that is moved by a vector (m); what has a `position` is moved, by default."""
    raise NotImplementedError(type(table))


@moved.register(tuple)
def _(table: Any, by: Vec3) -> Any:
    return table._replace(position=table.position + by) if hasattr(table, "position") else table


@kernel
def power_heuristic(pdf, other):
    """Weight of a sample drawn with `pdf` that `other` might have drawn too; squares of densities could overflow.

    All of it where the other never would, or where there was no choice (an infinite pdf), also where neither ratio is a
    number.

    References: Veach 1997, eq. 9.11 with beta = 2.
    """
    if other == 0.0 or math.isinf(pdf):
        return 1.0
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)


@generic
def weight_aimed(heuristic, pdf, by_path):
    """Weight of a light sample of density `pdf`, in whose direction a path would have gone on with `by_path`."""
    raise NotImplementedError


@weight_aimed.register(type(None))
def _(heuristic, pdf, by_path):
    return power_heuristic(pdf, by_path)


@weight_aimed.register(AimedOnly)
def _(heuristic, pdf, by_path):
    return 1.0


@generic
def weight_found(heuristic, pdf, by_light):
    """Weight of light that a path of density `pdf` found, and that light samples aim at with `by_light`."""
    raise NotImplementedError


@weight_found.register(type(None))
def _(heuristic, pdf, by_light):
    return power_heuristic(pdf, by_light)


@weight_found.register(AimedOnly)
def _(heuristic, pdf, by_light):
    return 1.0 if by_light == 0.0 or math.isinf(pdf) else 0.0


@kernel
def choose(choice, u):
    """A row of a table by its AliasTable: (row, probability); a table of one needs no choice."""
    if len(choice.pmf) == 1:
        return 0, 1.0
    chosen, probability, _ = sample_alias(choice, u)
    return chosen, probability


@kernel
def from_point(point, position, intensity, probability):
    """The LightSample at `point` of a light without extent, of this intensity (W/sr), chosen with this probability."""
    way = sub(position, point)
    distance = norm(way)
    if distance == 0.0:
        return LightSample(way, BLACK, 0.0, position, 0.0)
    weight = scale(1.0 / (probability * distance * distance), intensity)
    # The light may lie on a surface, which float32 could find before it.
    gap = offset_of(max_abs(position) + distance)
    return LightSample(scale(1.0 / distance, way), weight, math.inf, position, gap)


@kernel
def at_infinity(direction, weight, pdf):
    """The LightSample of a light at infinity.

    Its target lies so far away that the way there has the light's direction wherever on the scene it starts.
    """
    return LightSample(direction, weight, pdf, scale(_FAR, direction), -math.inf)


@kernel
def _plus(a, b):
    return a + b


_sample_any = switch(sample_light)
_pdf_hit_all = fold(pdf_hit, _plus)
_arriving_all = fold(arriving, add)


@generic
def sample_lights(lights, scene, point, time, draws):
    """Choose a light among all, and a point on it as seen from `point`: a LightSample."""
    raise NotImplementedError


@sample_lights.register(Lights)
def _(lights, scene, point, time, draws):
    u = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + LIGHT)
    kinds = len(lights.tables)
    if kinds == 1:
        return sample_light(lights.tables[0], scene, point, time, u, draws)
    chosen = min(kinds - 1, int(kinds * u))
    found = _sample_any(lights.tables, chosen, scene, point, time, kinds * u - chosen, draws)
    return LightSample(found.direction, scale(kinds, found.weight), found.pdf / kinds, found.target, found.gap)


@generic
def pdf_light(lights, scene, instance, number, primitive, origin, point, normal, time):
    """Density in solid angle (1/sr) with which `sample_lights` at `origin` aims at `point` on a primitive."""
    raise NotImplementedError


@pdf_light.register(type(None))
def _(lights, scene, instance, number, primitive, origin, point, normal, time):
    return 0.0


@pdf_light.register(Lights)
def _(lights, scene, instance, number, primitive, origin, point, normal, time):
    found = _pdf_hit_all(lights.tables, scene, instance, number, primitive, origin, point, normal, time)
    return found / len(lights.tables)


@generic
def weight_emitted(lights, scene, instance, number, primitive, origin, point, normal, time, pdf):
    """Weight of light that a path, of density `pdf` from `origin` on, finds at `point` on a primitive."""
    raise NotImplementedError


@weight_emitted.register(type(None))
@weight_emitted.register(Unaimed)
def _(lights, scene, instance, number, primitive, origin, point, normal, time, pdf):
    return 1.0


@weight_emitted.register(Lights)
def _(lights, scene, instance, number, primitive, origin, point, normal, time, pdf):
    by_light = pdf_light(lights, scene, instance, number, primitive, origin, point, normal, time)
    return weight_found(lights.heuristic, pdf, by_light)


@generic
def surroundings(lights, scene, direction, pdf):
    """Radiance that a ray which leaves the scene meets; weighted, see `arriving`."""
    raise NotImplementedError


@surroundings.register(type(None))
def _(lights, scene, direction, pdf):
    return background(scene.environment, direction)


@surroundings.register(Lights)
def _(lights, scene, direction, pdf):
    found = _arriving_all(lights.tables, scene, direction, pdf, len(lights.tables), lights.heuristic)
    return add(background(lights.unaimed, direction), found)


@surroundings.register(Unaimed)
def _(lights, scene, direction, pdf):
    # As for the camera: all of it counts.
    found = _arriving_all(lights.tables, scene, direction, math.inf, len(lights.tables), None)
    return add(background(lights.unaimed, direction), found)
