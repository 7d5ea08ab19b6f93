"""Intersection of packets of eight rays to the scene with a surface: the formulas of `ray_tracing` and `aspheres`."""

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.simd import any_lane, select, sqrt_lanes
from raytracer.optics.lens_system.aspheres import MAX_STEPS, ROUNDING, SurfaceShapes


@optional
def intersect_packet(shapes, lens, surface, ray, weight):
    """Intersect rays to the scene with a surface, by the shapes of a lens's surfaces.

    Parameters
    ----------
    ray : (x, y, z, a, b, g), places (mm), z from the surface's vertex on, and unit directions.
    weight : 0 for rays that are lost already.

    Returns
    -------
    x, y, z of the crossing, unit normal to the film's side, cosine between it and the direction that the rays come
    from, and a mask of the rays that do cross.
    """
    return intersect_packet_sphere(lens.curvature[surface], ray)


@kernel
def intersect_packet_sphere(curvature, ray):
    """Intersect rays with a sphere: see `ray_tracing.intersect_sphere`."""
    x, y, z, a, b, g = ray
    before = -(x * a + y * b + z * g)
    x, y, z = x + before * a, y + before * b, z + before * g
    f = curvature * (x * x + y * y + z * z) - 2.0 * z
    square = g * g - curvature * f
    cosine = sqrt_lanes(select(square > 0.0, square, 0.0))
    rest = f / (g - cosine)
    x, y, z = x + rest * a, y + rest * b, z + rest * g
    normal = (-(curvature * x), -(curvature * y), 1.0 - curvature * z)
    return (x, y, z), normal, cosine, (square > 0.0) & (normal[2] > 0.0) & (g < 0.0)


@kernel
def _positive(value):
    return select(value < 0.0, -value, value)


@kernel
def _intersect_packet_quadric(shapes, surface, ray):
    """Intersect rays with a quadric, from their closest points to the vertex; also return the distances from there."""
    x, y, z, a, b, g = ray
    u, v, w = shapes.quadric[surface, 0], shapes.quadric[surface, 1], shapes.quadric[surface, 2]
    along = u * a * a + v * b * b + w * g * g
    f = u * x * x + v * y * y + w * z * z - 2.0 * z
    slope = g - (u * x * a + v * y * b + w * z * g)
    square = slope * slope - along * f
    straight = sqrt_lanes(select(square > 0.0, square, 0.0))
    onward = slope < 0.0
    distance = select(onward, f, slope + straight) / select(onward, slope - straight, along)
    x, y, z = x + distance * a, y + distance * b, z + distance * g
    p, q, r = -(u * x), -(v * y), 1.0 - w * z
    scale = 1.0 / sqrt_lanes(p * p + q * q + r * r)
    return (x, y, z), (scale * p, scale * q, scale * r), scale * straight, (square > 0.0) & (r > 0.0), distance


@kernel
def _intersect_packet_asphere(shapes, surface, ray, guess, weight):
    """Intersect rays with an even asphere: Newton's method, with an interval of each ray that brackets the crossing."""
    x, y, z, a, b, g = ray
    c, w = shapes.quadric[surface, 0], shapes.quadric[surface, 2]
    limit = shapes.limit[surface] * shapes.limit[surface]
    before, behind = (shapes.max_sag[surface] - z) / g, (shapes.min_sag[surface] - z) / g
    distance = select((before < guess) & (guess < behind), guess, -z / g)
    open_rays = select(g < 0.0, weight, 0.0)
    px, py, pz, slope = x, y, z, z
    for _ in range(MAX_STEPS):
        px, py, pz = x + distance * a, y + distance * b, z + distance * g
        square = px * px + py * py
        s = select(square < limit, square, limit)
        straight = 1.0 - c * w * s
        straight = sqrt_lanes(select(straight > 0.0, straight, 0.0))
        rest, slope = 0.0 * s, 0.0 * s
        for term in range(shapes.coefficients.shape[1] - 1, -1, -1):
            coefficient = shapes.coefficients[surface, term]
            rest = rest * s + coefficient
            slope = slope * s + (2.0 * term + 4.0) * coefficient
        sag = c * s / (1.0 + straight) + rest * s * s
        slope = select(square <= limit, c / straight + slope * s, 0.0)
        off = sag - pz
        wrong = _positive(off) > ROUNDING * (_positive(z) + _positive(distance * g) + _positive(sag))
        wrong = wrong & (open_rays > 0.0)
        if not any_lane(wrong):
            break
        before = select(off < 0.0, distance, before)
        behind = select(off < 0.0, behind, distance)
        onward = distance - off / (slope * (px * a + py * b) - g)
        onward = select((before < onward) & (onward < behind), onward, 0.5 * (before + behind))
        distance = select(wrong, onward, distance)
    p, q = -(slope * px), -(slope * py)
    scale = 1.0 / sqrt_lanes(p * p + q * q + 1.0)
    normal = (scale * p, scale * q, scale)
    cosine = -(normal[0] * a + normal[1] * b + normal[2] * g)
    return (px, py, pz), normal, cosine, (cosine > 0.0) & (g < 0.0)


@intersect_packet.register(SurfaceShapes)
def intersect_packet_surface_shapes(shapes, lens, surface, ray, weight):
    if shapes.plain[surface]:
        return intersect_packet_sphere(lens.curvature[surface], ray)
    x, y, z, a, b, g = ray
    before = -(x * a + y * b + z * g)
    near = (x + before * a, y + before * b, z + before * g, a, b, g)
    point, normal, cosine, met, distance = _intersect_packet_quadric(shapes, surface, near)
    if shapes.aspheric[surface]:
        return _intersect_packet_asphere(shapes, surface, near, distance, weight)
    return point, normal, cosine, met
