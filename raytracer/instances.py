"""Instances: groups of primitives that are placed many times, or move, and where a ray meets them."""

from raytracer.jit import generic
from raytracer.primitives.interface import hit_any, pdf_point_any, sample_point_any


@generic
def meet(instances, scene, instance, table, primitive, origin, direction, near, time):
    """The geometry.Hit, in world space, of what Embree found at distance `near`: `instance` is MISS for none."""
    raise NotImplementedError


@meet.register(type(None))
def _(instances, scene, instance, table, primitive, origin, direction, near, time):
    return hit_any(scene.primitives, table, primitive, origin, direction, near, time, scene.accuracy)


@generic
def sample_placed(instances, scene, instance, table, primitive, reference, u1, u2, time):
    """A geometry.LightPoint, in world space, on an emitting primitive; `instance` is -1 for none."""
    raise NotImplementedError


@sample_placed.register(type(None))
def _(instances, scene, instance, table, primitive, reference, u1, u2, time):
    return sample_point_any(scene.primitives, table, primitive, reference, u1, u2, time)


@generic
def pdf_placed(instances, scene, instance, table, primitive, reference, point, normal, time):
    """Density of `sample_placed` in solid angle (1/sr) at a point in world space."""
    raise NotImplementedError


@pdf_placed.register(type(None))
def _(instances, scene, instance, table, primitive, reference, point, normal, time):
    return pdf_point_any(scene.primitives, table, primitive, reference, point, normal, time)
