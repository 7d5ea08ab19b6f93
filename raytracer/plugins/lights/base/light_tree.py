"""Light tree: a choice among many lights by their power and distance, in logarithmic time.

A perfect binary tree over the lights in Morton order: node 1 is the root, node i has the children 2 i and 2 i + 1, and
the leaves follow each other.  Each node bounds its lights, and a child is chosen in proportion to the importance of its
bounds.  The normal of the lit surface takes no part, so that the probability is known for hits of paths as well.

References: Conty Estevez, Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting", HPG (bounds,
importance); Lin, Yuksel 2020, "Real-Time Stochastic Lightcuts", I3D, sec. 4 (perfect binary tree in Morton order);
Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 12.6.3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.primitives.base.interface import Boxes
from raytracer.core.sampling.alias import AliasTable, build_alias
from raytracer.core.vec import Vec3, dot, sub
from raytracer.plugins.lights.base.light_choice import choose_light, count_lights, light_probability, translate_choice
from raytracer.plugins.materials.base.interface import split_random_number

Array = NDArray[np.float64]
_CENTER, _RADIUS2, _POWER, _COLUMNS = 0, 3, 4, 5

_BITS = 21
"""Of each coordinate in a Morton code of 63."""


class LightTree(NamedTuple):
    """A tree over n lights, with 2^k >= n leaves.

    nodes (2^(k+1), 5) float64 : center (m) and squared radius (m2) of the bounding sphere, and power over the most.
    row (2^k,) int32 : of the light of a leaf.
    leaf (n,) int32 : of the light of a row.
    """

    nodes: Array
    row: NDArray[np.int32]
    leaf: NDArray[np.int32]


# ---- Building


def build_choice(powers: Array, boxes: Boxes | None) -> AliasTable | LightTree:
    """Choose among lights by a tree; by power alone where there is no choice, or nothing bounds them."""
    if boxes is None or np.count_nonzero(powers) < 2:
        return build_alias(powers)
    return build_light_tree(powers, boxes)


def _morton_order(places: Array) -> NDArray[np.int64]:
    """Sort points (n, 3) along a Z curve."""
    low = places.min(axis=0)
    extent = float((places - low).max())
    cells = ((places - low) * ((2**_BITS - 1) / extent if extent > 0.0 else 0.0)).astype(np.uint64)
    code = np.zeros(len(places), np.uint64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


def build_light_tree(powers: Array, boxes: Boxes) -> LightTree:
    """Build the tree of lights of these powers (n,), in any common unit."""
    count = len(powers)
    order = _morton_order(0.5 * (boxes[0] + boxes[1]))
    leaves = 1 << (count - 1).bit_length()
    leaf, row = np.empty(count, np.int32), np.zeros(leaves, np.int32)
    leaf[order], row[:count] = np.arange(count), order

    # What is left of the leaves has no power, and boxes that add nothing to others.
    lower, upper, power = np.full((leaves, 3), np.inf), np.full((leaves, 3), -np.inf), np.zeros(leaves)
    lower[:count], upper[:count], power[:count] = boxes[0][order], boxes[1][order], powers[order] / powers.max()
    nodes = np.zeros((2 * leaves, _COLUMNS))
    while True:
        level = nodes[len(power) : 2 * len(power)]
        used = np.isfinite(lower[:, 0])
        half = 0.5 * (upper[used] - lower[used])
        level[used, _CENTER : _CENTER + 3] = lower[used] + half
        level[used, _RADIUS2] = (half**2).sum(axis=1)
        level[:, _POWER] = power
        if len(power) == 1:
            return LightTree(nodes, row, leaf)
        lower, upper = np.minimum(lower[0::2], lower[1::2]), np.maximum(upper[0::2], upper[1::2])
        power = power[0::2] + power[1::2]


# ---- Kernels


@kernel
def _importance(tree, node, point):
    """Estimate the irradiance at a point by the lights of a node, within their bounds as at their rim.

    0 only for a light without extent at the point itself.  Which way emitters face takes no part: it chose better among
    ten, and so took 11 % off the squared error of bench/peers/kinds.yaml, for 12 % more time.

    References: Conty Estevez, Kulla 2018, eq. 3, without its cosines.
    """
    nodes = tree.nodes
    to = sub(point, (nodes[node, _CENTER], nodes[node, _CENTER + 1], nodes[node, _CENTER + 2]))
    distance2 = max(dot(to, to), nodes[node, _RADIUS2])
    return nodes[node, _POWER] / distance2 if distance2 > 0.0 else 0.0


@choose_light.register(LightTree)
def choose_light_by_tree(choice, point, u):
    leaves = len(choice.row)
    node, probability = 1, 1.0
    while node < leaves:
        node *= 2
        first, second = _importance(choice, node, point), _importance(choice, node + 1, point)
        if first + second == 0.0:
            return 0, 0.0, u
        share = first / (first + second)
        is_first, u = split_random_number(u, share)
        if is_first:
            probability *= share
        else:
            node += 1
            probability *= second / (first + second)
    return np.int64(choice.row[node - leaves]), probability, u


@light_probability.register(LightTree)
def light_probability_by_tree(choice, point, row):
    node, probability = len(choice.row) + np.int64(choice.leaf[row]), 1.0
    while node > 1:
        this = _importance(choice, node, point)
        if this == 0.0:
            return 0.0
        probability *= this / (this + _importance(choice, node ^ 1, point))
        node >>= 1
    return probability


@translate_choice.register(LightTree)
def translate_choice_by_tree(choice: LightTree, by: Vec3) -> LightTree:
    nodes = choice.nodes.copy()
    nodes[:, _CENTER : _CENTER + 3] += by
    return choice._replace(nodes=nodes)


@count_lights.register(LightTree)
def count_lights_tree(choice):
    return len(choice.leaf)
