"""Rays through a lens eight at a time, from the film to the scene: what a camera does for every sample.

The formulas are those of `surfaces.trace`, in lanes, so that no ray costs a branch, and one that is lost does not keep
the others waiting.
"""

import math

from raytracer.jit import generic, kernel
from raytracer.lanes import WIDTH, load, pick, root, select, store
from raytracer.lenses.crossings import cross
from raytracer.lenses.diaphragm import covers
from raytracer.lenses.surfaces import Indices, row_of

# Rows of a packet of rays: origin (mm), unit direction, wavelength (nm), weight, and where it crosses the stop (mm);
# what comes behind is the camera's: over how much its rays are spread, the number that drew the wavelength, and more.
ORIGIN, DIRECTION, WAVELENGTH, WEIGHT, CROSSING, EXTENT, DRAWN, FREE, ROWS = 0, 3, 6, 7, 8, 10, 11, 12, 16


@generic
def rows_of(indices, packet):
    """The rows of the table of indices between which each wavelength lies, and how far."""
    raise NotImplementedError


@rows_of.register(type(None))
def _(indices, packet):
    return None


@rows_of.register(Indices)
def _(indices, packet):
    for lane in range(WIDTH):
        row, part = row_of(indices, packet[WAVELENGTH, lane])
        packet[CROSSING, lane], packet[CROSSING + 1, lane] = row, part
    return load(packet, CROSSING), load(packet, CROSSING + 1)


@generic
def index_at(indices, lens, row, gap):
    """The index of refraction in the gap before a surface, or behind the last one, for all lanes."""
    raise NotImplementedError


@index_at.register(type(None))
def _(indices, lens, row, gap):
    return lens.ior[gap]


@index_at.register(Indices)
def _(indices, lens, row, gap):
    number, part = row
    low = pick(indices.ior, number, gap)
    return low + part * (pick(indices.ior, number + 1.0, gap) - low)


@generic
def rim(diaphragm, radius):
    """How far from the axis light may cross the stop, before its shape is looked at."""
    raise NotImplementedError


@rim.register(type(None))
def _(diaphragm, radius):
    return radius


@rim.register(tuple)
def _(diaphragm, radius):
    return math.inf


@generic
def shaped(diaphragm, lens, packet):
    """Take the light that a diaphragm stops, which is not round, from the weights of a packet."""
    raise NotImplementedError


@shaped.register(type(None))
def _(diaphragm, lens, packet):
    return


@shaped.register(tuple)
def _(diaphragm, lens, packet):
    scale = 1.0 / lens.radius[lens.stop]
    for lane in range(WIDTH):
        if packet[WEIGHT, lane] > 0.0:
            x, y = packet[CROSSING, lane], packet[CROSSING + 1, lane]
            packet[WEIGHT, lane] *= covers(diaphragm, scale * x, scale * y)


@kernel
def trace_packet(lens, packet):
    """Follow eight rays from the film to the scene; what is lost has its weight set to 0, and is anywhere.

    packet : float64 (ROWS, WIDTH), in which origins and directions become those before the lens.
    """
    x, y, z = load(packet, ORIGIN), load(packet, ORIGIN + 1), load(packet, ORIGIN + 2)
    a, b, g = load(packet, DIRECTION), load(packet, DIRECTION + 1), load(packet, DIRECTION + 2)
    weight, row = load(packet, WEIGHT), rows_of(lens.indices, packet)
    gap = len(lens.curvature)
    behind = index_at(lens.indices, lens, row, gap)
    for surface in range(gap - 1, -1, -1):
        vertex, radius = lens.vertex[surface], lens.radius[surface]
        if surface == lens.stop:
            radius = rim(lens.diaphragm, radius)
        (x, y, z), (u, v, w), cosine, met = cross(lens.shapes, lens, surface, (x, y, z - vertex, a, b, g), weight)
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
        turn = ratio * cosine - root(1.0 - select(sine2 < 1.0, sine2, 1.0))
        a, b, g = ratio * a + turn * u, ratio * b + turn * v, ratio * g + turn * w
        behind = before
    store(packet, ORIGIN, x)
    store(packet, ORIGIN + 1, y)
    store(packet, ORIGIN + 2, z)
    store(packet, DIRECTION, a)
    store(packet, DIRECTION + 1, b)
    store(packet, DIRECTION + 2, g)
    store(packet, WEIGHT, weight)
    shaped(lens.diaphragm, lens, packet)
