"""No ray meets again what it leaves: ten million of them, over all shapes, motions, sizes and ways of leaving."""

import itertools

import numpy as np
import pytest
import trimesh

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.fresnel import fresnel_dielectric, refract
from raytracer.core.vec import dot, neg, reflect
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from tests.core.motion.kernels import shooter
from tests.plugins.shapes.kernels import uniform_directions, unit
from tests.vectorised import rows, vectorised

# Each about its own origin, of a size of one, with what it takes to stretch it.
FLAT = {
    "quad": "type: quad, corner: [-0.7, -0.5, 0], edges: [[1.4, 0.2, 0], [-0.1, 1, 0]]",
    "disc": "type: disc, center: [0, 0, 0], normal: [0, 0, 1], radius: 0.9",
    "triangle": "type: triangle, vertices: [[-0.9, -0.5, 0], [0.9, -0.4, 0], [0.1, 0.8, 0]]",
}
CONVEX = {
    "sphere": "type: sphere, center: [0, 0, 0], radius: 1",
    "hollow": "type: sphere, center: [0, 0, 0], radius: -1",
    "box": "type: box, min: [-0.6, -0.5, -0.4], max: [0.5, 0.5, 0.6]",
    "mesh": "type: mesh, file: FILE_0.obj",
    "smooth mesh": "type: mesh, file: FILE_0.obj, smooth: true",
}
BENT = {"deforming": "type: mesh, frames: FRAMES", "smooth deforming": "type: mesh, smooth: true, frames: FRAMES"}
SHAPES = FLAT | CONVEX | BENT
STRETCHES = {"sphere": "[1, 0.3, 0.7]", "mesh": "[0.5, 0.2, 0.6]", "disc": "[-1, 0.5, 1]"}
OBJECTS = [*((name, "[1, 1, 1]") for name in SHAPES), *STRETCHES.items()]
MOTIONS = [*itertools.product(OBJECTS, (False, True), (False, True))]
"""Shapes with their stretch, and whether each flies and spins."""

WAYS = ("any", "mirror", "refraction", "grazing", "straight on")
"""Ways in which rays leave: in any direction; as from a mirror; as through glass of 1.5 to 1; at a slant down to 1e-8;
and as through what lets them pass."""


@kernel
def _bent(direction, normal):
    """As from a mirror, and as through glass."""
    outside = dot(direction, normal) < 0.0
    side, eta = normal if outside else neg(normal), 1.5 if outside else 1.0 / 1.5
    cosine = min(1.0, -dot(direction, side))
    reflected, cos_t = fresnel_dielectric(cosine, eta)
    mirrored = reflect(direction, side)
    return mirrored, mirrored if reflected == 1.0 else refract(direction, side, cosine, cos_t, eta)


def onward(ways, directions, normals, rng):
    """Directions in which rays go on."""
    anywhere = uniform_directions(len(ways), int(rng.integers(1 << 31)))
    height = rng.choice([-1.0, 1.0], len(ways)) * 10.0 ** (-8.0 * rng.random(len(ways)))
    along = unit(anywhere - (anywhere * normals).sum(axis=1)[:, None] * normals)
    grazing = unit(along + height[:, None] * normals)
    choices = np.stack([anywhere, *vectorised(_bent)(rows(directions), rows(normals)), grazing, directions])
    return choices[ways, np.arange(len(ways))]


def numbers(vector):
    return f"[{', '.join(repr(float(x)) for x in vector)}]"


def write_meshes(folder):
    """Three frames for each object, all alike: a file that two objects name would be placed by instances."""
    mesh = trimesh.creation.icosphere(1)
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in mesh.faces + 1)
    for time in range(3):
        bent = mesh.vertices * (1.0 + 0.2 * time * np.sin(3.0 * mesh.vertices[:, :1] + time))
        vertices = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in bent.tolist())
        for number in range(len(MOTIONS)):
            (folder / f"{number}_{time}.obj").write_text(vertices + faces)


def scenery(folder, size, away, rng):
    """`trace` in a scene of objects of a size (m), `away` sizes from the origin; their middles and velocities."""
    base, lines, centers, velocities = size * away * unit(rng.normal(size=3))[0], [], [], []
    for number, ((name, stretch), flies, spins) in enumerate(MOTIONS):
        center = base + 8.0 * size * (np.array([number % 4, number // 4 % 4, number // 16]) + rng.uniform(-0.1, 0.1, 3))
        velocity = size * rng.uniform(-1.0, 1.0, 3) * flies
        axis, turn, rate = rng.normal(size=(2, 3)), rng.uniform(10.0, 350.0), rng.uniform(20.0, 700.0) * spins
        frames = ", ".join(f"{{time: {time / 2}, file: {number}_{time}.obj}}" for time in range(3))
        lines.append(
            f"  - {{{SHAPES[name].replace('FILE', str(number)).replace('FRAMES', f'[{frames}]')}, transform: ["
            f"{{scale: {stretch}}}, {{rotate: {{axis: {numbers(axis[0])}, angle: {turn!r}}}}}, {{scale: {size!r}}}, "
            f"{{translate: {numbers(center)}}}], motion: {{velocity: {numbers(velocity)}, "
            f"spin: {{axis: {numbers(axis[1])}, rate: {rate!r}, center: {numbers(center)}}}}}}}\n"
        )
        centers.append(center)
        velocities.append(velocity)
    head = "film: {width: 1, height: 1}\ncamera: {type: pinhole, look_from: [0, 0, 9], shutter: 1}\nobjects:\n"
    packed = pack(build(head + "".join(lines), "every shape.yaml", base=folder, allow_files="/"))
    return shooter(packed), np.array(centers), np.array(velocities)


def self_hits(folder, size, away, count, seed, *, bare=False):
    """Count rays that left something, and those of them that met it again, wrongly; and the ways and shapes seen.

    Half of the rays start outside of an object, from up to a thousand sizes away, half within.  What is flat cannot be
    met twice, nor what is convex from outside.

    bare : rays go on from the hits themselves, without an offset.
    """
    rng = np.random.default_rng(seed)
    shoot, centers, velocities = scenery(folder, size, away, rng)
    which, ways, times = rng.integers(len(centers), size=count), rng.integers(len(WAYS), size=count), rng.random(count)
    times = times.astype(np.float32).astype(np.float64)
    middle = centers[which] + times[:, None] * velocities[which]
    reach = np.where(rng.random(count) < 0.5, 10.0 ** rng.uniform(0.3, 3.0, count), rng.uniform(0.0, 0.3, count))
    origins = middle + size * reach[:, None] * unit(rng.normal(size=(count, 3)))
    targets = middle + size * rng.uniform(0.0, 1.0, (count, 1)) * unit(rng.normal(size=(count, 3)))
    directions = unit(targets - origins)
    normals = shoot(origins, directions, times=times).normal
    met = np.isfinite(normals[:, 0])
    on = onward(ways, directions, np.where(met[:, None], normals, [0.0, 0.0, 1.0]), rng)
    first = shoot(origins, directions, on, times)
    again = shoot(np.where(met[:, None], first.point if bare else first.start, 1e30), on, times=times)
    same = met & (first.table == again.table) & (first.instance == again.instance)
    same &= first.primitive == again.primitive
    # Objects are at least as far apart as they are large.
    names = np.array([name for (name, _), _, _ in MOTIONS])[which]
    aimed = np.linalg.norm(first.point - middle, axis=1) < 2.0 * size
    cosine = (on * first.normal).sum(axis=1) * np.where(names == "hollow", -1.0, 1.0)
    # From within, a sphere is met again at the other end of the chord, 2 r cos away, and at least 2 a^2 / b cos for
    # an ellipsoid of semi-axes from a to b; all other primitives are flat.
    half = size * np.array([0.09 if stretch == STRETCHES["sphere"] else 1.0 for (_, stretch), _, _ in MOTIONS])[which]
    wrong = same & ((cosine > 0.0) | ~np.isin(names, ["sphere", "hollow"]) | (again.near < -half * cosine))
    wrong |= (cosine > 0.0) & (again.near < 0.5 * size) & np.isin(names, [*CONVEX])
    return met.sum(), (wrong & aimed).sum(), {*zip(names[met], ways[met], strict=True)}


@pytest.mark.slow
def test_ten_million_rays_leave_what_they_met(tmp_path):
    # Sizes 1e-6 to 1e6 m; resting, flying, spinning and rolling; baked, placed, stretched and mirrored.
    write_meshes(tmp_path)
    combinations = itertools.product(range(-6, 7, 2), (0.0, 3.0, 300.0))
    results = [self_hits(tmp_path, 10.0**p, away, 600_000, n) for n, (p, away) in enumerate(combinations)]
    rays, failures, seen = zip(*results, strict=True)
    assert sum(rays) > 10_000_000
    assert len(set.union(*seen)) == len(WAYS) * len(SHAPES)
    assert sum(failures) == 0


@pytest.mark.slow
def test_they_would_meet_it_without_an_offset(tmp_path):
    # The same rays from the hit itself: about half of those from what is flat find it again.
    write_meshes(tmp_path)
    rays, failures, _ = self_hits(tmp_path, 1e-6, 0.0, 20_000, 1, bare=True)
    assert failures > 0.1 * rays
