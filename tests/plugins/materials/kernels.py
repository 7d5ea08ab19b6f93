"""Compiled loops over a material's functions."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry
from raytracer.core.geometry import Site
from raytracer.core.sampling import SAMPLERS, pixel_key
from raytracer.core.vec import Vec3
from raytracer.plugins.materials.base.interface import Draws, emission, evaluate, row, scatter
from raytracer.plugins.textures.base.interface import ParameterPacker
from raytracer.schema.spec import Spec

UP = (0.0, 0.0, 1.0)
SITE = Site((0.1, 0.2, 0.3), 0.25, 0.75, 1.5)


@entry
def _scatter_many(material, direction, normal, front, sampler, outgoing, weight, pdf):
    key = pixel_key(sampler, 0, 0)
    for index in range(len(pdf)):
        out = scatter(material, direction, normal, front, Draws(sampler, key, index, 8))
        for axis in range(3):
            outgoing[index, axis] = out.direction[axis]
            weight[index, axis] = out.weight[axis]
        pdf[index] = out.pdf


@entry
def _evaluate_many(material, direction, normal, front, outgoing, value, pdf):
    for index in range(len(pdf)):
        toward = (outgoing[index, 0], outgoing[index, 1], outgoing[index, 2])
        f_cos, density = evaluate(material, direction, normal, front, toward)
        for axis in range(3):
            value[index, axis] = f_cos[axis]
        pdf[index] = density


@entry
def _emission(table, front, site):
    return emission(table, 0, front, None, site)


def packed_row(spec: Spec, site: Site = SITE):
    """The record that the kernels take for one material, at a site."""
    return row(type(spec).pack([spec], ParameterPacker()), 0, None, site)


def incoming(degrees: float, azimuth: float = 0.4) -> Vec3:
    """Unit direction of travel onto a surface with normal +z, `degrees` from the normal."""
    theta = math.radians(degrees)
    return (math.sin(theta) * math.cos(azimuth), math.sin(theta) * math.sin(azimuth), -math.cos(theta))


def scatter_many(
    spec: Spec, direction: Vec3, count: int, *, front: bool = True, seed: int = 5, normal: Vec3 = UP
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Directions (count, 3), weights (count, 3) and pdfs (count,) of `scatter`."""
    outgoing, weight, pdf = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    sampler = SAMPLERS["independent"](seed, 1)
    _scatter_many(packed_row(spec), direction, normal, front, sampler, outgoing, weight, pdf)
    return outgoing, weight, pdf


def evaluate_many(
    spec: Spec, direction: Vec3, outgoing: NDArray[np.float64], *, front: bool = True, normal: Vec3 = UP
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """f |cos| (n, 3) and pdf (n,) of `evaluate` toward directions (n, 3)."""
    return evaluate_row(packed_row(spec), direction, outgoing, front=front, normal=normal)


def evaluate_row(
    material: NamedTuple, direction: Vec3, outgoing: NDArray[np.float64], *, front: bool = True, normal: Vec3 = UP
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Evaluate a row as `evaluate_many` does."""
    value, pdf = np.empty((len(outgoing), 3)), np.empty(len(outgoing))
    _evaluate_many(material, direction, normal, front, np.ascontiguousarray(outgoing), value, pdf)
    return value, pdf


def emitted(spec: Spec, front: bool) -> Vec3:
    """`emission`."""
    return tuple(_emission(type(spec).pack([spec], ParameterPacker()), front, SITE))


def mirrored(direction: Vec3) -> NDArray[np.float64]:
    """`direction` reflected at a surface with normal +z."""
    return np.array([direction[0], direction[1], -direction[2]])


def frame(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthonormal rows (3, 3) of which the last is the unit vector `axis`."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    s = np.cross(helper, axis)
    s /= np.linalg.norm(s)
    return np.array([s, np.cross(axis, s), axis])
