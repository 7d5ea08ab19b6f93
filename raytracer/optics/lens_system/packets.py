"""Packets of eight rays through a lens, from the film to the scene, as a camera traces them for every sample.

The formulas are those of `ray_tracing` and `aspheres`, in lanes, so that no ray costs a branch, and one that is lost
does not keep the others waiting.
"""

import math

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.simd import WIDTH, any_lane, gather_lanes, load, select, sqrt_lanes, store
from raytracer.optics.lens_system.aspheres import MAX_STEPS, ROUNDING, SurfaceShapes
from raytracer.optics.lens_system.ray_tracing import index_row
from raytracer.optics.lens_system.surfaces import Indices, aperture_transmission

# Rows of a packet of rays: origin (mm), unit direction, wavelength (nm), weight, and crossing of the stop (mm).  The
# others are the camera's: one over the density of its rays, the number that sampled the wavelength, and free ones.
ORIGIN, DIRECTION, WAVELENGTH, WEIGHT, CROSSING, EXTENT, DRAWN, FREE, ROWS = 0, 3, 6, 7, 8, 10, 11, 12, 16


@optional
def index_rows(indices, packet):
    """Find each wavelength in the table of indices: row, and fraction of the way to the next; None without a table."""


@index_rows.register(Indices)
def index_rows_indices(indices, packet):
    for lane in range(WIDTH):
        row, part = index_row(indices, packet[WAVELENGTH, lane])
        packet[CROSSING, lane], packet[CROSSING + 1, lane] = row, part
    return load(packet, CROSSING), load(packet, CROSSING + 1)


@optional
def index_at(indices, lens, row, gap):
    """Look up the index of refraction in the gap before a surface, or behind the last one, for all lanes."""
    return lens.ior[gap]


@index_at.register(Indices)
def index_at_indices(indices, lens, row, gap):
    number, part = row
    low = gather_lanes(indices.ior, number, gap)
    return low + part * (gather_lanes(indices.ior, number + 1.0, gap) - low)


@optional
def diaphragm_rim_radius(diaphragm, radius):
    """Find the radius (mm) within which light may cross the stop, before its shape is tested."""
    return radius


@diaphragm_rim_radius.register(tuple)
def diaphragm_rim_radius_tuple(diaphragm, radius):
    return math.inf


@optional
def apply_diaphragm(diaphragm, lens, packet):
    """Multiply the weights of a packet by the transmission of a diaphragm that is not round."""


@apply_diaphragm.register(tuple)
def apply_diaphragm_tuple(diaphragm, lens, packet):
    scale = 1.0 / lens.radius[lens.stop]
    for lane in range(WIDTH):
        if packet[WEIGHT, lane] > 0.0:
            x, y = packet[CROSSING, lane], packet[CROSSING + 1, lane]
            packet[WEIGHT, lane] *= aperture_transmission(diaphragm, scale * x, scale * y)


@kernel
def trace_packet(lens, packet):
    """Trace eight rays from the film to the scene; a ray that is lost has the weight 0, and is anywhere.

    packet : float64 (ROWS, WIDTH), in which origins and directions become those before the lens.
    """
    x, y, z = load(packet, ORIGIN), load(packet, ORIGIN + 1), load(packet, ORIGIN + 2)
    a, b, g = load(packet, DIRECTION), load(packet, DIRECTION + 1), load(packet, DIRECTION + 2)
    weight, row = load(packet, WEIGHT), index_rows(lens.indices, packet)
    gap = len(lens.curvature)
    behind = index_at(lens.indices, lens, row, gap)
    for surface in range(gap - 1, -1, -1):
        vertex, radius = lens.vertex[surface], lens.radius[surface]
        if surface == lens.stop:
            radius = diaphragm_rim_radius(lens.diaphragm, radius)
        (x, y, z), (u, v, w), cosine, met = intersect_packet(
            lens.shapes, lens, surface, (x, y, z - vertex, a, b, g), weight
        )
        z = z + vertex
        weight = select(met & (x * x + y * y <= radius * radius), weight, 0.0)
        if surface == lens.stop:
            store(packet, CROSSING, x)
            store(packet, CROSSING + 1, y)
            # A diaphragm in air bends nothing.
            if lens.ior[surface] == 1.0 and lens.ior[surface + 1] == 1.0:
                continue

        # Refract.
        before = index_at(lens.indices, lens, row, surface)
        ratio = behind / before
        sine2 = ratio * ratio * ((1.0 - cosine) * (1.0 + cosine))
        weight = select(sine2 < 1.0, weight, 0.0)
        turn = ratio * cosine - sqrt_lanes(1.0 - select(sine2 < 1.0, sine2, 1.0))
        a, b, g = ratio * a + turn * u, ratio * b + turn * v, ratio * g + turn * w
        behind = before
    store(packet, ORIGIN, x)
    store(packet, ORIGIN + 1, y)
    store(packet, ORIGIN + 2, z)
    store(packet, DIRECTION, a)
    store(packet, DIRECTION + 1, b)
    store(packet, DIRECTION + 2, g)
    store(packet, WEIGHT, weight)
    apply_diaphragm(lens.diaphragm, lens, packet)


# ---- Intersection with a surface


@optional
def intersect_packet(shapes, lens, surface, ray, weight):
    """Intersect rays to the scene with a surface, by the shapes of a lens's surfaces.

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
