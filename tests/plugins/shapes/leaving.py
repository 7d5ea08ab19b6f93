"""A scene with a shape of every kind, resting and moving, and rays that leave what they meet in it.

Rays of a packet go together, as in a render; hits, offsets and what is spawned are the program's own.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core import embree
from raytracer.core.compiler.dispatch import entry, generic, kernel
from raytracer.core.embree import GEOMETRY, MISS, PACKET, TFAR, TIME, Accel, RayPackets
from raytracer.core.fresnel import fresnel_dielectric, refract
from raytracer.core.geometry import Exact, spawn_point
from raytracer.core.instancing import Instances, intersect_instance, pose_of
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.translated import Translated
from raytracer.core.vec import basis, dot, neg, reflect, to_world
from raytracer.kernel.interaction import resolve_hit
from raytracer.scene.load import build
from raytracer.scene.pack.layout import lay_out
from raytracer.scene.pack.objects import Objects, pack_objects
from raytracer.scene.scene_assets import SceneAssets
from tests.plugins.shapes.kernels import unit

Array = NDArray[np.float64]

WAYS = ("any", "mirror", "refraction", "grazing", "straight on")
"""Ways in which rays leave: in any direction; as from a mirror; as through glass of 1.5 to 1; at a slant down to 1e-8;
and as through what lets them pass."""

ANY, MIRROR, REFRACTION, GRAZING, STRAIGHT = range(len(WAYS))


class Stage(NamedTuple):
    """The part of a scene that hits need."""

    primitives: tuple[Any, ...]
    accuracy: Any
    instances: Any


class Left(NamedTuple):
    """Rays that met something, and went on: by ray, what it met first and next.

    table, instance, primitive (n, 2), table -1 for nothing; near (n, 2), Embree's distances; offset (n,); normal,
    point and start (n, 3), and onward, the direction (n, 3); pose (n, 12), from the space of the first hit's primitive
    to the world's.
    """

    table: NDArray[np.int64]
    instance: NDArray[np.int64]
    primitive: NDArray[np.int64]
    near: Array
    offset: Array
    normal: Array
    point: Array
    start: Array
    onward: Array
    pose: Array


@kernel
def _onward(way, direction, normal, u1, u2):
    """A direction in which a ray goes on that came along `direction`."""
    side = normal if dot(direction, normal) < 0.0 else neg(normal)
    if way == STRAIGHT:
        return direction
    if way == MIRROR:
        return reflect(direction, side)
    if way == REFRACTION:
        cosine = min(1.0, -dot(direction, side))
        eta = 1.5 if dot(direction, normal) < 0.0 else 1.0 / 1.5
        reflected, cos_t = fresnel_dielectric(cosine, eta)
        return reflect(direction, side) if reflected == 1.0 else refract(direction, side, cosine, cos_t, eta)
    s, t = basis(side)
    angle = 2.0 * np.pi * u2
    height = 2.0 * u1 - 1.0
    if way == GRAZING:
        height = np.copysign(10.0 ** (-8.0 * abs(height)), height)
    radius = np.sqrt(1.0 - height * height)
    return to_world((radius * np.cos(angle), radius * np.sin(angle), height), s, t, side)


@generic
def _pose(instances, instance, time, row, out):
    raise NotImplementedError


@_pose.register(Instances)
def _pose_instances(instances, instance, time, row, out):
    if instance < 0:
        return
    pose = pose_of(instances, instance, time)
    for i in range(3):
        for j in range(4):
            out[row, 4 * i + j] = pose[i][j]


@entry
def _leave(accel, packet, stage, bare, origins, directions, times, ways, u, left):
    for first in range(0, len(origins), PACKET):
        count = min(PACKET, len(origins) - first)
        for lane in range(count):
            ray = first + lane
            origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
            direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
            embree.set_ray(packet, lane, origin, direction, np.inf)
            embree.store_float(packet, lane, TIME, times[ray])
        embree.intersect(accel, packet, count)
        for lane in range(count):
            ray = first + lane
            table = embree.load_int(packet, lane, GEOMETRY)
            left.table[ray, 0] = -1
            # A ray that has met nothing goes on to meet nothing.
            onward, start = (1.0, 0.0, 0.0), (1e30, 1e30, 1e30)
            if table != MISS:
                origin = (origins[ray, 0], origins[ray, 1], origins[ray, 2])
                direction = (directions[ray, 0], directions[ray, 1], directions[ray, 2])
                instance, primitive = resolve_hit(stage, packet, lane)
                near = np.float64(embree.load_float(packet, lane, TFAR))
                hit = intersect_instance(
                    stage.instances, stage, instance, table, primitive, origin, direction, near, times[ray]
                )
                onward = _onward(ways[ray], direction, hit.normal, u[ray, 0], u[ray, 1])
                start = hit.point if bare else spawn_point(hit, onward)
                left.table[ray, 0] = table
                left.instance[ray, 0] = instance
                left.primitive[ray, 0] = primitive
                left.near[ray, 0] = near
                left.offset[ray] = hit.offset
                _pose(stage.instances, instance, times[ray], ray, left.pose)
                for axis in range(3):
                    left.normal[ray, axis] = hit.normal[axis]
                    left.point[ray, axis] = hit.point[axis]
                    left.start[ray, axis] = start[axis]
                    left.onward[ray, axis] = onward[axis]
            embree.set_ray(packet, lane, start, onward, np.inf)
            embree.store_float(packet, lane, TIME, times[ray])
        embree.intersect(accel, packet, count)
        for lane in range(count):
            ray = first + lane
            table = embree.load_int(packet, lane, GEOMETRY)
            left.table[ray, 1] = -1
            if table != MISS:
                instance, primitive = resolve_hit(stage, packet, lane)
                left.table[ray, 1] = table
                left.instance[ray, 1] = instance
                left.primitive[ray, 1] = primitive
                left.near[ray, 1] = np.float64(embree.load_float(packet, lane, TFAR))


class Scenery(NamedTuple):
    """A built scene, and where its objects are: center (n, 3) and velocity (n, 3) of each, and radius, of all.

    objects, as packed, which knows whose the primitives and the instances are; names, of the objects.
    """

    stage: Stage
    accel: Accel
    packet: RayPackets
    center: Array
    velocity: Array
    radius: float
    objects: Objects
    names: tuple[str, ...]


def _icosphere(subdivisions):
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


def _write_meshes(folder, count):
    """Three frames for each object, all the same triangles."""
    if (folder / f"{count - 1}_2.obj").exists():
        return
    vertices, faces = _icosphere(1)
    for time in range(3):
        bent = vertices * (1.0 + 0.2 * time * np.sin(3.0 * vertices[:, :1] + time))
        for number in range(count):
            _write_obj(folder / f"{number}_{time}.obj", bent, faces)


def _write_obj(path, vertices, faces):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    path.write_text("\n".join(lines + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]) + "\n")


def _numbers(vector):
    return f"[{', '.join(repr(float(x)) for x in vector)}]"


_HEAD = """
film: {width: 1, height: 1}
camera: {type: pinhole, look_from: [0, 0, 9], look_at: [0, 0, 0], shutter: 1}
objects:
"""

_STEP = 8.0
"""Between the middles of two objects, in sizes."""


def scenery(folder, size, away, seed):
    """Objects of about this size (m), `away` sizes from the origin, each of a kind, each turned its own way."""
    rng = np.random.default_rng(seed)

    def turned():
        axis, angle = unit(rng.normal(size=3))[0], rng.uniform(10.0, 350.0)
        return f"{{rotate: {{axis: {_numbers(axis)}, angle: {angle!r}}}}}"

    unit_size = "scale: 1"
    shapes = {
        "sphere": ("type: sphere, center: [0, 0, 0], radius: 1", unit_size),
        "hollow": ("type: sphere, center: [0, 0, 0], radius: -1", unit_size),
        "quad": ("type: quad, corner: [-0.7, -0.5, 0], edges: [[1.4, 0.2, 0], [-0.1, 1, 0]]", unit_size),
        "disc": ("type: disc, center: [0, 0, 0], normal: [0, 0, 1], radius: 0.9", unit_size),
        "triangle": ("type: triangle, vertices: [[-0.9, -0.5, 0], [0.9, -0.4, 0], [0.1, 0.8, 0]]", unit_size),
        "box": ("type: box, min: [-0.6, -0.5, -0.4], max: [0.5, 0.5, 0.6]", unit_size),
        "mesh": ("type: mesh, file: FILE.obj", unit_size),
        "smooth mesh": ("type: mesh, file: FILE.obj, smooth: true", unit_size),
        "ellipsoid": ("type: sphere, center: [0, 0, 0], radius: 1", "scale: [1, 0.3, 0.7]"),
        "stretched mesh": (
            "type: mesh, file: FILE.obj",
            "scale: [1, 0.2, 0.6]}, {rotate: {axis: [1, 1, 0], angle: 40}}, {scale: [0.5, 1, 1]",
        ),
        "mirrored disc": ("type: disc, center: [0, 0, 0], normal: [0, 0, 1], radius: 0.9", "scale: [-1, 0.5, 1]"),
        "deforming": ("type: mesh, frames: FRAMES", unit_size),
        "smooth deforming": ("type: mesh, smooth: true, frames: FRAMES", unit_size),
    }
    motions = {"resting": (), "flying": ("velocity",), "spinning": ("spin",), "rolling": ("velocity", "spin")}
    side = int(np.ceil((len(shapes) * len(motions)) ** (1 / 3)))
    base = size * away * unit(rng.normal(size=3))[0]
    names, centers, velocities, lines = [], [], [], []
    for shape, (form, stretch) in shapes.items():
        for motion, parts in motions.items():
            number = len(names)
            place = np.array([number % side, number // side % side, number // side**2])
            center = base + size * _STEP * (place + rng.uniform(-0.1, 0.1, 3))
            velocity = size * rng.uniform(-2.0, 2.0, 3) if "velocity" in parts else np.zeros(3)
            moving = [f"velocity: {_numbers(velocity)}"] if "velocity" in parts else []
            if "spin" in parts:
                axis, rate = unit(rng.normal(size=3))[0], rng.uniform(20.0, 700.0)
                moving.append(f"spin: {{axis: {_numbers(axis)}, rate: {rate!r}, center: {_numbers(center)}}}")
            steps = f"[{{{stretch}}}, {turned()}, {{scale: {size!r}}}, {{translate: {_numbers(center)}}}]"
            moves = f", motion: {{{', '.join(moving)}}}" if moving else ""
            # A file that two objects name would be placed by instances.
            frames = ", ".join(f"{{time: {time / 2}, file: {number}_{time}.obj}}" for time in range(3))
            body = form.replace("FILE", f"{number}_0").replace("FRAMES", f"[{frames}]")
            lines.append(f"  - {{{body}, transform: {steps}{moves}}}")
            names.append(f"{motion} {shape}")
            centers.append(center)
            velocities.append(velocity)
    _write_meshes(folder, len(names))
    spec = build(_HEAD + "\n".join(lines) + "\n", "every shape.yaml", base=folder)
    assets = SceneAssets(spec)
    layout = lay_out(spec, assets)
    objects = pack_objects(spec, layout, [0] * len(layout.items), assets, textured=False, eye=np.zeros(3))
    accel = Accel(
        objects.geometries, objects.groups, objects.placements, first_instance=len(objects.primitives), robust=True
    )
    stage = Stage(objects.primitives, Exact(), objects.instances)
    places = np.array(centers), np.array(velocities), size
    return Scenery(stage, accel, embree.ray_packets(), *places, objects, tuple(names))


def leave(place, count, seed, *, bare=False):
    """Rays that leave what they meet; also the way that each left, and its time.

    Half of them start outside of an object, from up to a thousand sizes away, half within.

    bare : from the hits themselves, without an offset.
    """
    rng = np.random.default_rng(seed)
    which = rng.integers(0, len(place.center), count)
    ways = rng.integers(0, len(WAYS), count)
    times = rng.random(count, np.float32).astype(np.float64)
    middle = place.center[which] + times[:, None] * place.velocity[which]
    way = unit(rng.normal(size=(count, 3)))
    reach = np.where(rng.random(count) < 0.5, 10.0 ** rng.uniform(0.3, 3.0, count), rng.uniform(0.0, 0.3, count))
    origins = middle + place.radius * reach[:, None] * way
    targets = middle + place.radius * rng.uniform(0.0, 1.0, (count, 1)) * unit(rng.normal(size=(count, 3)))
    left = Left(
        *(np.full((count, 2), -1) for _ in range(3)), np.full((count, 2), np.inf), np.zeros(count),
        *(np.zeros((count, 3)) for _ in range(4)), np.tile(np.eye(3, 4).ravel(), (count, 1)),
    )  # fmt: skip
    rays = np.ascontiguousarray(origins), np.ascontiguousarray(unit(targets - origins))
    _leave(place.accel.address, place.packet, place.stage, bare, *rays, times, ways, rng.random((count, 2)), left)
    return left, ways, times


def objects_met(place, left):
    """The objects met first and next (n, 2), -1 for nothing."""
    result = np.full(left.table.shape, -1)
    for number, owners in enumerate(place.objects.owners):
        baked = (left.table == number) & (left.instance < 0)
        result[baked] = owners.number[np.searchsorted(owners.start, left.primitive[baked], side="right") - 1]
    placed = left.instance >= 0
    result[placed] = place.objects.instance_objects[left.instance[placed]]
    return result


def _chord(place, left, rays, times):
    """Return the true distance from the points where rays go on to the far side of their spheres, 0 if outside."""
    result = np.zeros(len(rays))
    for number, table in enumerate(place.stage.primitives):
        base, shift = (table.base, table.shift) if isinstance(table, Translated) else (table, None)
        mine = left.table[rays, 0] == number
        if not isinstance(base, Spheres) or not mine.any():
            continue
        chosen = rays[mine]
        row = left.primitive[chosen, 0]
        pose = left.pose[chosen].reshape(-1, 3, 4)
        inverse = np.linalg.inv(pose[:, :, :3])
        origin = (inverse @ (left.start[chosen] - pose[:, :, 3])[:, :, None])[:, :, 0]
        way = (inverse @ left.onward[chosen][:, :, None])[:, :, 0]
        center = base.center[row] + (0.0 if shift is None else times[chosen, None] * shift[row])
        out = origin - center
        # |out + t way| = r, by the root that cancels nothing where the ray starts inside.
        a, b = (way**2).sum(axis=1), (out * way).sum(axis=1)
        c = (out**2).sum(axis=1) - base.radius[row] ** 2
        root = np.sqrt(np.maximum(0.0, b * b - a * c))
        with np.errstate(divide="ignore", invalid="ignore"):
            result[mine] = np.where(c < 0.0, np.where(b > 0.0, -c / (b + root), (root - b) / a), 0.0)
    return result


CONVEX = ("sphere", "box", "mesh", "smooth mesh", "ellipsoid", "stretched mesh")
"""Objects that no ray meets again which leaves them outwards."""


def self_hits(place, left, times):
    """Which rays met again, wrongly, what they left (n,).

    What is flat cannot be met twice, nor what is convex from outside.  A sphere is met again from inside, at the other
    end of the chord: wrong is what lies nearer than half of it.
    """
    again = (left.table[:, 0] >= 0) & (left.table[:, 0] == left.table[:, 1])
    again &= (left.instance[:, 0] == left.instance[:, 1]) & (left.primitive[:, 0] == left.primitive[:, 1])
    (rays,) = np.nonzero(again)
    chord = _chord(place, left, rays, times)
    again[rays] = (chord == 0.0) | (left.near[rays, 1] < 0.5 * chord)

    met = objects_met(place, left)
    convex = np.array([name.split(" ", 1)[1] in CONVEX for name in place.names])
    outwards = (left.onward * left.normal).sum(axis=1) > 0.0
    again |= (met[:, 0] >= 0) & (met[:, 0] == met[:, 1]) & convex[met[:, 0]] & outwards
    return again


def stages(folder):
    """Sceneries of all sizes, at the origin and away from it."""
    combinations = [(10.0**power, away) for power in range(-6, 7, 2) for away in (0.0, 3.0, 300.0)]
    for number, (size, away) in enumerate(combinations):
        yield scenery(folder, size, away, number)
