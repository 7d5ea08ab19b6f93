"""What is told before anything is rendered: numbers that cannot be, and such as float32 cannot hold."""

import math
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.scene.warnings import find_warnings
from raytracer.util.errors import InputError
from tests.hard_cases.harness import ROUNDING, hard_case
from tests.small_scenes import image, scene

HEAD = """\
film: {width: 64, height: 48}
environment: {type: constant, radiance: 1}
materials:
  grey: {type: lambertian, albedo: 0.5}
  red: {type: lambertian, albedo: [0.6, 0.1, 0.1]}
"""

PINHOLE = "type: pinhole, look_from: [0, 0, 0], look_at: [0, 0, -1], vfov: 40"


def packed(*objects, camera=PINHOLE, base=None):
    """The packed scene of these objects."""
    text = f"{HEAD}camera: {{{camera}}}\nobjects:\n" + "".join(f"  - {{{item}}}\n" for item in objects)
    return pack(build(text, "scene.yaml", base=base))


def is_taken(*objects, **settings):
    """Tell if a scene is packed without an error."""
    try:
        packed(*objects, **settings)
    except InputError:
        return False
    return True


def point(vector):
    return f"[{', '.join(repr(float(part)) for part in vector)}]"


def _told(packed, kind):
    return [item for item in find_warnings(packed) if item.kind == kind]


@hard_case(2, "Embree 4.4, measured: 15 % of the rays at 0.99 of a radius miss", "too_far", quick=200, thorough=20_000)
def too_far_to_be_hit(count):
    """Spheres that are too far away for float32.

    They have radii of 10^-4 to 10^4 m, and are 10^3 to 10^7 radii away.

    A naive program says nothing, or warns of large coordinates, whatever the sphere's size.  Ours warns where the
    distance is more than 10^5 radii: both ways of being wrong are counted, beyond a factor of 2 from that, and none is
    tolerated.
    """
    rng = np.random.default_rng(2)
    radius, radii = 10.0 ** rng.uniform(-4.0, 4.0, count), 10.0 ** rng.uniform(3.0, 7.0, count)
    decided = (radii < 0.5e5) | (radii > 2e5)
    radius, radii = radius[decided], radii[decided]
    direction = rng.normal(size=(len(radius), 3))
    center = (radius * radii / np.linalg.norm(direction, axis=1))[:, None] * direction
    places = zip(center, radius.tolist(), strict=True)
    found = packed(*(f"type: sphere, center: {point(place)}, radius: {size!r}" for place, size in places))
    # Where the packed scene has its origin is not what this is about.
    warned = np.zeros(len(radius), bool)
    warned[[int(item.keys[1]) for item in _told(found, "objects too far away for their size")]] = True
    by_coordinates = np.abs(center).max(axis=1) > 1e5
    yield "spheres judged wrongly", by_coordinates != (radii > 1e5), warned != (radii > 1e5)


_NOTHING = (
    "type: sphere, center: [0, 0, -3], radius: 0",
    "type: sphere, center: [0, 0, -3], radius: -0.0",
    "type: sphere, center: [0, 0, -3], radius: 1e-25",
    "type: disc, center: [0, 0, -3], normal: [0, 0, 1], radius: 0",
    "type: disc, center: [0, 0, -3], normal: [0, 0, 0], radius: 1",
    "type: quad, corner: [0, 0, -3], edges: [[0, 0, 0], [0, 1, 0]]",
    "type: quad, corner: [0, 0, -3], edges: [[1, 1, 0], [-2, -2, 0]]",
    "type: triangle, vertices: [[0, 0, -3], [1, 0, -3], [2, 0, -3]]",
    "type: triangle, vertices: [[0, 0, -3], [0, 0, -3], [1, 0, -3]]",
    "type: box, min: [0, 0, -3], max: [1, 0, -2]",
    "type: box, min: [0, 0, -3], max: [1, 1, -2], transform: [{scale: [1, 0, 1]}]",
    "type: sphere, center: [0, 0, -3], radius: 1, transform: [{scale: 0}]",
    "type: sphere, center: [0, 0, -3], radius: 1, transform: [{scale: 1e-25}]",
    "type: sphere, center: [0, 0, 0], radius: 1, transform: [{scale: [1e-14, 2e-14, 1e-14]}]",
    "type: mesh, file: line.obj",
)


@hard_case(8, "Embree 4.4, measured: a sphere of radius 0 is hit, with a normal of (0, 0, 0)")
def shapes_that_are_nothing(_):
    """Shapes of no size.

    Zero radii, edges and scales, and such as float32 takes for zero.

    A naive loader takes numbers as they are, and all of these: nobody learns why an object is not in the picture, or
    why it is black.  Each must be an error.
    """
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "line.obj").write_text("v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n")
        taken = [is_taken(item, base=Path(folder)) for item in _NOTHING]
    yield f"of {len(taken)}, let through", len(taken), taken


# ---- Triangles


@hard_case(13, "pbrt-v4 shapes_test.cpp (Triangle.BadCases); Embree 4.4, measured", "slivers", 300, 100_000)
def triangles_without_an_area(count):
    """Triangles without an area, and without numbers.

    A mesh in which every third triangle is a point or a line, and files with vertices that are no numbers.

    Rays never hit such triangles, so a naive program leaves them in and says nothing.  How many there are, and which is
    the first, must be told to the last one; and files with NaN or infinite vertices must be refused.
    """
    rng = np.random.default_rng(13)
    # Coordinates with few digits, so that what is on a line is exactly so.
    a, b, c = rng.integers(-512, 512, (3, count, 3)) / 64.0

    def is_flat():
        return (np.cross(b - a, c - a) == 0.0).all(axis=1)

    c[is_flat()] += [0.0, 0.0, 16.0]
    b[is_flat()] += [0.0, 32.0, 0.0]
    bad = rng.random(count) < 1.0 / 3.0
    kind = rng.integers(0, 3, count)
    in_line, edge, corner = (bad & (kind == number) for number in range(3))
    c[in_line] = (2.0 * b - a)[in_line]
    c[edge] = b[edge]
    b[corner], c[corner] = a[corner], a[corner]
    wrong = np.flatnonzero(is_flat())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.obj"

        def write(vertices):
            faces = (f"f {first} {first + 1} {first + 2}" for first in range(1, len(vertices), 3))
            path.write_text("\n".join([*(f"v {x!r} {y!r} {z!r}" for x, y, z in vertices), *faces]) + "\n")

        write(np.stack([a, b, c], axis=1).reshape(-1, 3).tolist())
        found = packed("type: mesh, file: mesh.obj", base=path.parent)
        told = "".join(item.text for item in _told(found, "triangles without an area"))
        taken = []
        for value in (math.nan, math.inf, -math.inf):
            write([[0, 0, 0], [1, 0, 0], [0, value, 0]])
            taken.append(is_taken("type: mesh, file: mesh.obj", base=path.parent))
    is_right = told.count(f"has {len(wrong):,} triangles without an area (the first is number {wrong[0]},") == 1
    lost = abs(count - len(found.scene.primitives[0].material) - len(wrong))
    what = "triangles neither kept nor reported, or reported wrongly"
    yield what, len(wrong), lost + (0 if is_right else len(wrong))
    yield "of 3 files that hold no numbers, let through", 3, taken


_WALL = "type: quad, corner: [-1, -1, 0], edges: [[2, 0, 0], [0, 2, 0]], material: grey"
_PICTURES = (
    ("type: quad, corner: [{x}, -0.5, {z}], edges: [[0.7, 0, 0], [0, 0.9, 0]], material: red", 1.0),
    ("type: triangle, vertices: [[{x}, -0.5, {z}], [1, -0.5, {z}], [1, 0.7, {z}]], material: red", 2.0),
)
"""Pictures on the wall, and where they touch it with an edge only."""


@hard_case(14, "z-fighting: every renderer; Gottschalk, Lin, Manocha 1996", "coplanar", quick=24, thorough=1000)
def surfaces_in_one_place(pairs):
    """Two surfaces in one plane.

    A picture in the plane of a wall, of all sizes, turned and moved at random.

    Which of the two a ray meets is left to rounding.  A naive check compares the planes as they come out of the
    transforms, and finds few of them, or boxes, and finds too many; ours must find all, whatever transform made them,
    and none where the second is ten offsets off, or only touches the first with an edge.  Also, a scene that is built
    again must show the same.
    """
    rng = np.random.default_rng(14)
    for trial in range(pairs):
        axis, angle, shift = rng.normal(size=3), rng.uniform(0.0, 360.0), rng.uniform(-9.0, 9.0, 3)
        size = 10.0 ** rng.uniform(-3.0, 3.0)
        turn = f"{{rotate: {{axis: {point(axis)}, angle: {angle!r}}}}}"
        steps = f", transform: [{{scale: {size!r}}}, {turn}, {{translate: {point(size * shift)}}}]"
        picture, beside = _PICTURES[trial % len(_PICTURES)]
        # Coordinates reach 9 + 2 sqrt(2) sizes and an edge, and offsets are 4 * 2^-23 of that.
        gap = 10.0 * 4.0 * 2.0**-23 * 16.0
        flush, off, next_to = (
            bool(_told(packed(_WALL + steps, picture.format(x=x, z=z) + steps), "surfaces that coincide"))
            for x, z in ((0.0, 0.0), (0.0, gap), (beside, 0.0))
        )
        equal, overlap = _naive(size, axis, angle, size * shift)
        yield f"of {pairs} pairs, not reported", not equal, not flush
        yield f"of {pairs} pairs that are apart, reported", overlap, off or next_to
    picture, wall = (item + steps for item in (_PICTURES[0][0].format(x=0.0, z=0.0), _WALL))
    first, again, other = (
        _seen(packed(*both), size * shift, size) for both in ((wall, picture), (wall, picture), (picture, wall))
    )
    what = "rays that meet another surface when all is built again (naive: in another order)"
    yield what, first != np.where(other < 0, -1, 1 - other), first != again


def _naive(size, axis, angle, shift):
    """Tell if a naive check reports the pair, and one that only touches.

    It compares planes through three corners, number by number, or boxes round both.
    """
    turn = Rotation.from_rotvec(math.radians(angle) * axis / np.linalg.norm(axis))

    def corners(left, right, low, high):
        flat = [(left, low, 0.0), (right, low, 0.0), (right, high, 0.0), (left, high, 0.0)]
        return size * turn.apply(np.array(flat)) + shift

    wall, picture, beside = corners(-1, 1, -1, 1), corners(0, 0.7, -0.5, 0.4), corners(1, 1.7, -0.5, 0.4)
    planes = []
    for a, b, _, d in (wall, picture):
        normal = np.cross(b - a, d - a)
        normal /= np.linalg.norm(normal)
        planes.append((*normal, normal @ a))
    overlap = (wall.min(axis=0) <= beside.max(axis=0)) & (beside.min(axis=0) <= wall.max(axis=0))
    return planes[0] == planes[1], bool(overlap.all())


def _seen(packed, middle, size):
    """Which object each of some rays towards the middle of the wall meets, -1 for none."""
    accel = packed.build()
    rng = np.random.default_rng(0)
    result = []
    for direction in rng.normal(size=(400, 3)):
        unit = direction / np.linalg.norm(direction)
        met = accel.cast(middle + 0.3 * size * rng.normal(size=3) - 3.0 * size * unit, unit)
        result.append(-1 if met is None else int(packed.objects.owners[met.geometry].number[met.primitive // 2]))
    return np.array(result)


_GLASS = """
camera: {{type: pinhole, look_from: [0.3, 2.5, 2.2], look_at: [0, 0.5, 0], vfov: 30}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: box, min: [-9, -3, -9], max: [9, 0, 9], material: {{type: lambertian, albedo: 1}}}}
  - {{type: box, min: [-1, {lowest!r}, -1], max: [1, 1, 1], material: {{type: dielectric, ior: 1.5}}}}
"""


@hard_case(14, "white furnace: Veach 1997, thesis, sec. 3.7", "glass_on_a_floor", quick=16, thorough=256)
def glass_on_a_floor(spp):
    """A glass cube that stands exactly on a floor.

    Under an even sky, a white floor and clear glass show nothing but that sky, in each pixel.  Where the cube stands
    exactly on the floor, as one builds it, light that goes out by its lower face is below the floor already, and lost.
    That must be reported, and what the warning advises, to sink the cube by a millimetre, must lose none: each of up to
    300 vertices has a weight of 1, to an ulp.
    """
    cubes = [_GLASS.format(lowest=lowest) for lowest in (0.0, -1e-3)]
    standing, sunk = (image(cube, lit=True, width=8, height=8, spp=spp, max_depth=300).radiance for cube in cubes)
    counts = [len(_told(pack(scene(cube)), "surfaces that coincide")) for cube in cubes]
    what = "light that is lost (naive: exactly on the floor)"
    yield what, 1.0 - standing.mean(), 1.0 - sunk, 600.0 * ROUNDING
    yield "wrong or missing warnings", 1, abs(counts[0] - 1) + counts[1]
