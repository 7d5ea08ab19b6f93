"""Interface of lights: the spec's methods, the generic functions for kernels, and the choice among the kinds.

A kind's file holds its YAML spec, its packed table (one row a light) and its cases of the functions below.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, TypeAlias

from raytracer.core.compiler.dispatch import fold, generic, kernel, optional, overridable, switch
from raytracer.core.geometry import spawn_offset
from raytracer.core.shutter.timing import Timing
from raytracer.core.vec import Vec3, add, max_abs, norm, scale, sub
from raytracer.plugins.environments.base.interface import background
from raytracer.plugins.lights.base.light_choice import translate_choice
from raytracer.plugins.materials.base.interface import BLACK
from raytracer.schema.fields import Quantity, Triple
from raytracer.schema.spec import Spec

Intensity: TypeAlias = Annotated[Vec3, Triple(Quantity(low=0.0), "an intensity", single=True)]
Irradiance: TypeAlias = Annotated[Vec3, Triple(Quantity(low=0.0), "an irradiance", single=True)]

_FAR = 2.0**100


class LightSpec(Spec):
    """Base of the kinds of the `lights` list."""

    power: ClassVar[str] = "intensity"
    """Key of what it radiates, by channel."""

    type: str

    def shines(self) -> bool:
        """Tell if it gives light."""
        return any(getattr(self, self.power))

    @staticmethod
    def pack(specs: Sequence[Any]) -> Any:
        """Pack lights of this kind that shine, one row a light."""
        raise NotImplementedError

    def is_visible_to_paths(self) -> bool:
        """Tell if a path may hit the light by chance, so that mirrors show it."""
        return False

    def pulse(self, timing: Timing) -> tuple[float, float] | None:
        """Return begin and end (s of scene time) of its light while the shutter is open; None if it always shines."""
        return None

    def at_exposure(self, timing: Timing, place: Vec3, timed: bool) -> Any:
        """Return the light as `pack` takes it, in the time of a shutter that is open for some time.

        place : position of the camera when the light's pulse begins (m).
        timed : paths have a time; without it a pulse is spread over the exposure.
        """
        return self


def unit_vector(vector: Vec3) -> Vec3:
    """Normalize any but the zero vector, whatever its length."""
    x, y, z = scale(1.0 / max(map(abs, vector)), vector)
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


class LightSample(NamedTuple):
    """Sample of the light that may reach a point.

    direction : unit vector towards the light.
    weight : unoccluded radiance (W/(m2 sr)) over the pdf.
    pdf (1/sr) : of the direction; infinite for a light without extent, 0 where nothing can arrive.
    target : the light's point.
    gap (m) : distance before the target at which a shadow ray ends; minus infinity for a light at infinity.
    """

    direction: Vec3
    weight: Vec3
    pdf: float
    target: Vec3
    gap: float


class Lights(NamedTuple):
    """Lights for next-event estimation, and for rays that leave the scene.

    tables : one a kind of light, each of which is sampled by itself.
    background_tables : the environment, if no table samples it; else None.
    heuristic : of multiple importance sampling, None for the power heuristic, or LightSamplingOnly.
    """

    tables: tuple[Any, ...]
    background_tables: Any
    heuristic: Any = None


class NoLightSampling(NamedTuple):
    """Lights at infinity without next-event estimation: tables, one a kind of light, and the environment or None."""

    tables: tuple[Any, ...]
    background_tables: Any


class LightSamplingOnly(NamedTuple):
    """Heuristic by which light counts by next-event estimation alone, and not where a path hits a light by chance.

    A path's hit still counts where it had a single possible direction, as at the camera and behind mirrors and glass,
    and where no light sample has that direction.
    """


@generic
def sample_light(table, scene, point, time, u, draws):
    """Choose a light of the table by the number `u`, and a point on it as seen from `point`: a LightSample."""


@overridable
def pdf_hit(table, scene, surface):
    """Return the density in solid angle (1/sr) with which `sample_light` at its vertex before draws an Interaction."""
    return 0.0


@overridable
def infinite_radiance(table, scene, direction, pdf, heuristic):
    """Return the radiance of the table's lights at infinity along a ray that leaves the scene.

    It is weighted by the heuristic: `pdf` is the density with which the ray's direction was drawn.
    """
    return BLACK


@overridable
def translate_lights(table: Any, by: Vec3) -> Any:
    """Move a table of lights with the world by a vector (m); by default its `position`, if it has one."""
    if not hasattr(table, "position"):
        return table
    return table._replace(position=table.position + by, choice=translate_choice(table.choice, by))


@kernel
def power_heuristic(pdf, other):
    """Weight a sample drawn with `pdf` that `other` might have drawn too; squares of densities could overflow.

    1 where the other never would have, or where the pdf is infinite, also where neither ratio is a number.

    References: Veach 1997, eq. 9.11 with beta = 2.
    """
    if other == 0.0 or math.isinf(pdf):
        return 1.0
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)


@optional
def mis_weight_light_sample(heuristic, pdf, by_path):
    """Weight a light sample of density `pdf`, whose direction a path would have drawn with density `by_path`."""
    return power_heuristic(pdf, by_path)


@mis_weight_light_sample.register(LightSamplingOnly)
def mis_weight_light_sample_light_sampling_only(heuristic, pdf, by_path):
    return 1.0


@optional
def mis_weight_path(heuristic, pdf, by_light):
    """Weight the light that a path of density `pdf` hit, and that light samples draw with density `by_light`."""
    return power_heuristic(pdf, by_light)


@mis_weight_path.register(LightSamplingOnly)
def mis_weight_path_light_sampling_only(heuristic, pdf, by_light):
    return 1.0 if by_light == 0.0 or math.isinf(pdf) else 0.0


@kernel
def point_light_sample(point, position, intensity, probability):
    """Make the LightSample at `point` of a light without extent, of this intensity (W/sr) and probability."""
    way = sub(position, point)
    distance = norm(way)
    if distance == 0.0 or probability == 0.0:
        return LightSample(way, BLACK, 0.0, position, 0.0)
    weight = scale(1.0 / (probability * distance * distance), intensity)
    # The light may lie on a surface, which float32 could find before it.
    gap = spawn_offset(max_abs(position) + distance)
    return LightSample(scale(1.0 / distance, way), weight, math.inf, position, gap)


@kernel
def infinite_light_sample(direction, weight, pdf):
    """Make the LightSample of a light at infinity.

    Its target lies so far away that the way there has the light's direction wherever on the scene it starts.
    """
    return LightSample(direction, weight, pdf, scale(_FAR, direction), -math.inf)


@kernel
def _plus(a, b):
    return a + b


_sample_any = switch(sample_light)
_pdf_hit_all = fold(pdf_hit, _plus)
_infinite_radiance_all = fold(infinite_radiance, add)


@kernel
def sample_light_of(lights, number, scene, point, time, u, draws):
    """Sample a light of the table of this number, as `sample_light` does."""
    return _sample_any(lights.tables, number, scene, point, time, u, draws)


@optional
def pdf_light(lights, scene, surface):
    """Return the density in solid angle (1/sr) with which light samples at its vertex before draw an Interaction.

    The Interaction is of one table at most, and each table is sampled by itself.
    """
    return 0.0


@pdf_light.register(Lights)
def pdf_light_lights(lights, scene, surface):
    return _pdf_hit_all(lights.tables, scene, surface)


@optional(NoLightSampling)
def mis_weight_emission(lights, scene, surface, pdf):
    """Weight the light of an Interaction, which a path met by a direction of density `pdf`."""
    return 1.0


@mis_weight_emission.register(Lights)
def mis_weight_emission_lights(lights, scene, surface, pdf):
    return mis_weight_path(lights.heuristic, pdf, pdf_light(lights, scene, surface))


@optional
def escaped_radiance(lights, scene, direction, pdf):
    """Return the radiance along a ray that leaves the scene, weighted as in `infinite_radiance`."""
    return background(scene.environment, direction)


@escaped_radiance.register(Lights)
def escaped_radiance_lights(lights, scene, direction, pdf):
    radiance = _infinite_radiance_all(lights.tables, scene, direction, pdf, lights.heuristic)
    return add(background(lights.background_tables, direction), radiance)


@escaped_radiance.register(NoLightSampling)
def escaped_radiance_no_light_sampling(lights, scene, direction, pdf):
    # As for the camera: all of it counts.
    radiance = _infinite_radiance_all(lights.tables, scene, direction, math.inf, None)
    return add(background(lights.background_tables, direction), radiance)
