"""Lenses of few numbers, and benches to look at them on."""

from pathlib import Path

import numpy as np

from raytracer.analysis.lens_design.performance.optical_bench import OpticalBench, crossing
from raytracer.analysis.lens_design.performance.results import Settings
from raytracer.optics.glass import AIR, constant_index_glass
from raytracer.optics.lens_system.first_order import entrance_pupil
from raytracer.optics.lens_system.lens import Element, Lens
from raytracer.scene.assets.lenses import read_lens

SHIPPED = sorted((Path(__file__).parents[3] / "scenes" / "lenses").glob("*.yaml"))


QUICK = Settings(steps=9, rays=16, fields=(0.0, 0.7, 1.0))


def shipped(name):
    return read_lens(next(path for path in SHIPPED if path.stem == name))


THIN = 1e-9
"""A thickness (mm) that is none, but keeps surfaces in order."""


def lens_of(*rows, name="test"):
    """From curvature, thickness, glass, radius, and what else an element has, of each surface."""
    return Lens(name, tuple(Element(*row[:4], **(row[4] if len(row) > 4 else {})) for row in rows))


def stop(thickness, radius):
    return (0.0, thickness, AIR, radius, {"kind": "flat", "is_stop": True})


def thin_lens(focal_length, shape, glass, radius):
    """shape : (c1 + c2) / (c1 - c2)."""
    difference = 1.0 / (focal_length * (float(glass.ior()) - 1.0))
    c1, c2 = 0.5 * difference * (shape + 1.0), 0.5 * difference * (shape - 1.0)
    return lens_of((c1, THIN, glass, radius, {"is_stop": True}), (c2, 0.0, AIR, 2.0 * radius))


def symmetric_lens():
    """Two equal menisci on both sides of a stop."""
    glass = constant_index_glass(1.6)
    front = [(1.0 / 20.0, 3.0, glass, 9.0), (1.0 / 28.0, 5.0, AIR, 8.0)]
    rear = [(-1.0 / 28.0, 3.0, glass, 8.0), (-1.0 / 20.0, 0.0, AIR, 9.0)]
    return lens_of(*front, stop(5.0, 2.5), *rear)


def plano_convex(radius=10.0):
    return lens_of((0.0, 5.0, constant_index_glass(1.5), 12.5, {"kind": "flat"}), (-1.0 / 50.0, 0.0, AIR, radius))


def aspheric_pair():
    """Without any symmetry or correction, with a conic, coefficients, and the stop between."""
    glass, other = constant_index_glass(1.5), constant_index_glass(1.7)
    return lens_of(
        (0.02, 4.0, glass, 14.0, {"kind": "asphere", "conic": -0.6, "coefficients": (1e-6, -2e-9)}),
        (-0.008, 6.0, AIR, 14.0),
        stop(5.0, 6.0),
        (-0.015, 2.0, other, 12.0, {"kind": "conic", "conic": 0.4}),
        (0.006, 3.0, AIR, 12.0),
        (0.011, 3.0, glass, 13.0),
        (-0.022, 0.0, AIR, 13.0, {"kind": "asphere", "coefficients": (2e-6,)}),
    )


def cylinder_pair():
    """Two crossed cylinders around the stop, the second twice as strong and half as far, so that both planes focus."""
    glass = constant_index_glass(1.5)
    return lens_of(
        (1.0 / 50.0, 3.0, glass, 12.0, {"kind": "cylindrical", "axis": "x"}),
        (0.0, 20.0, AIR, 12.0, {"kind": "flat"}),
        stop(30.0, 6.0),
        (1.0 / 25.0, 3.0, glass, 12.0, {"kind": "cylindrical", "axis": "y"}),
        (0.0, 0.0, AIR, 12.0, {"kind": "flat"}),
    )


def bench_at(lens, film=None, **settings):
    """With the film at the paraxial focus, if no other place is given."""
    number = lens.stop()
    surfaces = lens.packed()
    pupil = entrance_pupil(surfaces).z
    bench = OpticalBench(lens, Settings(**settings), number, lens.elements[number].radius, 0.0, pupil)
    focus = crossing(surfaces, bench.marginal_ray(surfaces)) if film is None else film
    return OpticalBench(lens, bench.settings, number, bench.stop_radius, focus, pupil)


def sensor(largest):
    return (1.2 * largest, 1.6 * largest)


def limit(sizes, ratios):
    """Extrapolate ratios that are off by the square of a size, from the two smallest sizes."""
    (a, b), (p, q) = sizes[-2:], tuple(ratios)[-2:]
    weight = (b / a) ** 2
    return float((q - weight * p) / (1.0 - weight))


def rays_close_to(origin, direction, along, apart, *, parallel):
    """Two rays on both sides of one (2, 3), parallel to it, or through the point from which it comes."""
    steps = apart * np.array([[1.0], [-1.0]]) * np.asarray(along)
    if parallel:
        return np.asarray(origin) + steps, np.broadcast_to(direction, (2, 3))
    ways = np.asarray(direction) + steps
    return np.broadcast_to(origin, (2, 3)), ways / np.linalg.norm(ways, axis=1, keepdims=True)


def closest(points, directions):
    """Find the point where two rays (2, 3) come closest: the middle of the shortest way between them."""
    between = points[1] - points[0]
    a, b = directions
    product = a @ b
    first, second = between @ a, between @ b
    way = (first - product * second) / (1.0 - product**2)
    other = (product * first - second) / (1.0 - product**2)
    return 0.5 * (points[0] + way * a + points[1] + other * b)
