"""Calls of a scene's materials by their reference, and the selectors that choose among them.

A primitive names its material by one number, row * kinds + kind: the kinds are a constant of the compiled scene.
Kinds from len(materials) on are selectors, which name another material.
"""

from typing import Any, NamedTuple

from raytracer.core.compiler.dispatch import kernel, optional, switch
from raytracer.core.sampling import sample_2d
from raytracer.plugins.materials.base import interface


def _scatter_row(table, index, textures, site, direction, normal, front, draws):
    return interface.scatter(interface.row(table, index, textures, site), direction, normal, front, draws)


def _evaluate_row(table, index, textures, site, direction, normal, front, outgoing):
    return interface.evaluate(interface.row(table, index, textures, site), direction, normal, front, outgoing)


def _reflectance_row(table, index, textures, site):
    return interface.reflectance(interface.row(table, index, textures, site))


_scatter_any = switch(kernel(_scatter_row))
_evaluate_any = switch(kernel(_evaluate_row))
_emission_any = switch(interface.emission)
_reflectance_any = switch(kernel(_reflectance_row))


class Selectors(NamedTuple):
    """Packed selectors.

    tables : one a kind of selector.
    """

    tables: tuple[Any, ...]


@optional
def selector_count(selectors):
    """Count the kinds of selectors."""
    return 0


@selector_count.register(Selectors)
def selector_count_selectors(selectors):
    return len(selectors.tables)


@kernel
def scatter_at(scene, surface, draws):
    """Call `scatter` of an Interaction's material, which is no selector."""
    kinds = len(scene.materials) + selector_count(scene.selectors)
    kind, index = surface.material % kinds, surface.material // kinds
    site, direction, normal = surface.site, surface.direction, surface.normal
    return _scatter_any(scene.materials, kind, index, scene.textures, site, direction, normal, surface.front, draws)


@kernel
def evaluate_at(scene, surface, outgoing):
    """Call `evaluate` of an Interaction's material, which is no selector."""
    kinds = len(scene.materials) + selector_count(scene.selectors)
    kind, index = surface.material % kinds, surface.material // kinds
    site, direction, normal = surface.site, surface.direction, surface.normal
    return _evaluate_any(scene.materials, kind, index, scene.textures, site, direction, normal, surface.front, outgoing)


@kernel
def emission_at(scene, reference, front, site):
    """Call `emission` of a material that is no selector."""
    kinds = len(scene.materials) + selector_count(scene.selectors)
    return _emission_any(scene.materials, reference % kinds, reference // kinds, front, scene.textures, site)


@kernel
def reflectance_at(scene, reference, site):
    """Call `reflectance` of a material that is no selector."""
    kinds = len(scene.materials) + selector_count(scene.selectors)
    return _reflectance_any(scene.materials, reference % kinds, reference // kinds, scene.textures, site)


_select_any = switch(interface.select)


@kernel
def _resolve_selectors(selectors, scene, reference, front, site, u):
    first = len(scene.materials)
    kinds = first + len(selectors.tables)
    while reference >= 0 and reference % kinds >= first:
        reference, u = _select_any(
            selectors.tables, reference % kinds - first, reference // kinds, front, scene.textures, site, u
        )
    return reference


@optional
def select_at(selectors, scene, reference, front, site, draws):
    """Resolve the selectors of a surface's material for a path: a reference, or PASSTHROUGH."""
    return reference


@select_at.register(Selectors)
def select_at_selectors(selectors, scene, reference, front, site, draws):
    u, _ = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.SELECT)
    return _resolve_selectors(selectors, scene, reference, front, site, u)


@optional
def select_for_shadow_ray(selectors, scene, reference, front, site, draws):
    """Resolve the selectors of a surface's material for a shadow ray: as `select_at`, by another random number."""
    return reference


@select_for_shadow_ray.register(Selectors)
def select_for_shadow_ray_selectors(selectors, scene, reference, front, site, draws):
    _, u = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.SELECT)
    return _resolve_selectors(selectors, scene, reference, front, site, u)


@optional
def selected_emission(selectors, scene, reference, front, site, draws):
    """Return the radiance of a point that next-event estimation chose, of the material that its selectors show."""
    return emission_at(scene, reference, front, site)


@selected_emission.register(Selectors)
def selected_emission_selectors(selectors, scene, reference, front, site, draws):
    shown = select_for_shadow_ray(selectors, scene, reference, front, site, draws)
    return interface.BLACK if shown == interface.PASSTHROUGH else emission_at(scene, shown, front, site)
