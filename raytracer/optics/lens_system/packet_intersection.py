"""Where eight rays at once, on their way to the scene, cross a surface: the formulas of `surfaces` and `aspheres`."""

from raytracer.jit import generic, kernel
from raytracer.lanes import anywhere, root, select
from raytracer.lenses.aspheres import MOST_STEPS, ROUNDING, Shapes


@generic
def cross(shapes, lens, surface, ray, weight):
    """Where rays to the scene cross a surface, by what is known of the shapes of a lens's surfaces.

    ray : (x, y, z, a, b, g), places (mm), z from the surface's vertex on, and unit directions.
    weight : 0 for rays that are lost already.

    Returns
    -------
    x, y, z of the crossing, unit normal to the film's side, cosine between it and where the rays come from, and which
    rays do cross.
    """
    raise NotImplementedError


@cross.register(type(None))
def _(shapes, lens, surface, ray, weight):
    return cross_sphere(lens.curvature[surface], ray)


@kernel
def cross_sphere(curvature, ray):
    """`cross`, of a sphere: see `surfaces.meet_surface`."""
    x, y, z, a, b, g = ray
    before = -(x * a + y * b + z * g)
    x, y, z = x + before * a, y + before * b, z + before * g
    f = curvature * (x * x + y * y + z * z) - 2.0 * z
    square = g * g - curvature * f
    cosine = root(select(square > 0.0, square, 0.0))
    rest = f / (g - cosine)
    x, y, z = x + rest * a, y + rest * b, z + rest * g
    normal = (-(curvature * x), -(curvature * y), 1.0 - curvature * z)
    return (x, y, z), normal, cosine, (square > 0.0) & (normal[2] > 0.0) & (g < 0.0)


@kernel
def _positive(value):
    return select(value < 0.0, -value, value)


@kernel
def _cross_quadric(shapes, surface, ray):
    """`cross`, of a quadric, from the closest points to the vertex; and how far that is."""
    x, y, z, a, b, g = ray
    u, v, w = shapes.quadric[surface, 0], shapes.quadric[surface, 1], shapes.quadric[surface, 2]
    along = u * a * a + v * b * b + w * g * g
    f = u * x * x + v * y * y + w * z * z - 2.0 * z
    slope = g - (u * x * a + v * y * b + w * z * g)
    square = slope * slope - along * f
    straight = root(select(square > 0.0, square, 0.0))
    onward = slope < 0.0
    distance = select(onward, f, slope + straight) / select(onward, slope - straight, along)
    x, y, z = x + distance * a, y + distance * b, z + distance * g
    p, q, r = -(u * x), -(v * y), 1.0 - w * z
    scale = 1.0 / root(p * p + q * q + r * r)
    return (x, y, z), (scale * p, scale * q, scale * r), scale * straight, (square > 0.0) & (r > 0.0), distance


@kernel
def _cross_asphere(shapes, surface, ray, guess, weight):
    """`cross`, of an even asphere: Newton's method, with a part of each ray in which the crossing is."""
    x, y, z, a, b, g = ray
    c, w = shapes.quadric[surface, 0], shapes.quadric[surface, 2]
    limit = shapes.limit[surface] * shapes.limit[surface]
    before, behind = (shapes.highest[surface] - z) / g, (shapes.lowest[surface] - z) / g
    distance = select((before < guess) & (guess < behind), guess, -z / g)
    open_rays = select(g < 0.0, weight, 0.0)
    px, py, pz, slope = x, y, z, z
    for _ in range(MOST_STEPS):
        px, py, pz = x + distance * a, y + distance * b, z + distance * g
        square = px * px + py * py
        s = select(square < limit, square, limit)
        straight = 1.0 - c * w * s
        straight = root(select(straight > 0.0, straight, 0.0))
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
        if not anywhere(wrong):
            break
        before = select(off < 0.0, distance, before)
        behind = select(off < 0.0, behind, distance)
        onward = distance - off / (slope * (px * a + py * b) - g)
        onward = select((before < onward) & (onward < behind), onward, 0.5 * (before + behind))
        distance = select(wrong, onward, distance)
    p, q = -(slope * px), -(slope * py)
    scale = 1.0 / root(p * p + q * q + 1.0)
    normal = (scale * p, scale * q, scale)
    cosine = -(normal[0] * a + normal[1] * b + normal[2] * g)
    return (px, py, pz), normal, cosine, (cosine > 0.0) & (g < 0.0)


@cross.register(Shapes)
def _(shapes, lens, surface, ray, weight):
    if shapes.plain[surface]:
        return cross_sphere(lens.curvature[surface], ray)
    x, y, z, a, b, g = ray
    before = -(x * a + y * b + z * g)
    near = (x + before * a, y + before * b, z + before * g, a, b, g)
    point, normal, cosine, met, distance = _cross_quadric(shapes, surface, near)
    if shapes.aspheric[surface]:
        return _cross_asphere(shapes, surface, near, distance, weight)
    return point, normal, cosine, met
