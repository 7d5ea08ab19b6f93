"""The medium that a path or a shadow ray is in, and how surfaces that it goes through change it."""

import numpy as np

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.vec import dot
from raytracer.kernel.interaction import load_ray
from raytracer.kernel.nested_dielectrics import copy_inside_counts, count_crossing
from raytracer.kernel.path_rows import load_number, store_number
from raytracer.plugins.materials.base.interface import WHITE
from raytracer.plugins.media.base.interface import NO_MEDIUM, Media, medium_behind, transmittance_at


@optional
def medium_at_camera(media):
    """Return the medium in which the camera stands; None where space is empty."""


@medium_at_camera.register(Media)
def medium_at_camera_media(media):
    return media.camera


# ---- Through surfaces


@kernel
def cross_surface(scene, inside_counts, row, medium, material, enters):
    """Count the solids of a ray that goes through a surface of an object of this material; returns its medium then."""
    crossing = count_crossing(scene.nested_dielectrics, inside_counts, row, material, enters)
    return _medium_after(scene.media, scene.nested_dielectrics, crossing, medium, material, enters)


@optional
def _medium_after(media, nested, crossing, medium, material, enters):
    """Return the medium behind a surface, for a ray that comes through `medium`."""
    return medium


@_medium_after.register(Media)
def _medium_after_media(media, nested, crossing, medium, material, enters):
    if crossing is None:
        return medium_behind(media, material, medium, enters)
    if crossing.rank < 0:
        return medium_behind(media, material, medium, enters)
    return medium if crossing.behind == crossing.before else medium_of_rank(media, nested, material, crossing.behind)


@kernel
def medium_of_rank(media, nested, material, rank):
    """Return the medium within solids of which `rank` is the highest, behind a surface of this material."""
    return np.int64(media.outside[material] if rank < 0 else media.inside[nested.surface[rank]])


@kernel
def cross_towards(scene, work, path, surface, outgoing):
    """Take a path through a surface, if it goes on to `outgoing` there: count its solids, and return its medium."""
    enters = dot(outgoing, surface.hit.normal) < 0.0
    if (dot(path.direction, surface.hit.normal) < 0.0) == enters:
        return cross_surface(scene, work.paths.inside_counts, path.sample, path.medium, surface.hit.material, enters)
    return path.medium


# ---- Shadow rays


@kernel
def start_shadow_medium(scene, work, slot, path):
    """Start a shadow ray in the medium and the solids that its path is in."""
    shadows = work.shadows
    store_number(shadows.medium, slot, path.medium)
    store_number(shadows.medium_numbers, slot, 0)
    copy_inside_counts(scene.nested_dielectrics, work.paths.inside_counts, path.sample, shadows.inside_counts, slot)


@kernel
def move_shadow_medium(scene, shadows, slot, to):
    """Copy the medium and the solids of a shadow ray to the slot in which it goes on."""
    store_number(shadows.medium, to, load_number(shadows.medium, slot))
    store_number(shadows.medium_numbers, to, load_number(shadows.medium_numbers, slot))
    copy_inside_counts(scene.nested_dielectrics, shadows.inside_counts, slot, shadows.inside_counts, to)


@kernel
def cross_shadow(scene, shadows, slot, material, enters):
    """Take a shadow ray through a surface of an object of this material: change its solids and its medium."""
    medium = load_number(shadows.medium, slot)
    medium = cross_surface(scene, shadows.inside_counts, slot, medium, material, enters)
    store_number(shadows.medium, slot, medium)


@kernel
def cross_shadow_towards(scene, shadows, slot, surface, outgoing):
    """Take a shadow ray through the surface where it starts, if it goes to `outgoing` there."""
    enters = dot(outgoing, surface.hit.normal) < 0.0
    if (dot(surface.direction, surface.hit.normal) < 0.0) == enters:
        cross_shadow(scene, shadows, slot, surface.hit.material, enters)


@optional
def shadow_transmittance(media, shadows, slot, distance, draws):
    """Compute the transmittance of a shadow ray's medium, over `distance` (m) from the ray's origin."""
    return WHITE


@shadow_transmittance.register(Media)
def shadow_transmittance_media(media, shadows, slot, distance, draws):
    medium = shadows.medium[slot]
    if medium == NO_MEDIUM:
        return WHITE
    origin, direction = load_ray(shadows.rays, slot)
    numbers = shadows.medium_numbers[slot]
    through, numbers = transmittance_at(media, medium, origin, direction, distance, draws, numbers)
    shadows.medium_numbers[slot] = numbers
    return through
