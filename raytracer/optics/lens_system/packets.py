"""Packets of eight rays through a lens, from the film to the scene, as a camera traces them for every sample.

The formulas are those of `ray_tracing.trace`, in lanes, so that no ray costs a branch, and one that is lost does not
keep the others waiting.
"""

import math

from raytracer.core.compiler.dispatch import kernel, optional
from raytracer.core.simd import WIDTH, gather_lanes, load, select, sqrt_lanes, store
from raytracer.optics.lens_system.diaphragm import aperture_transmission
from raytracer.optics.lens_system.packet_intersection import intersect_packet
from raytracer.optics.lens_system.ray_tracing import index_row
from raytracer.optics.lens_system.surfaces import Indices

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
