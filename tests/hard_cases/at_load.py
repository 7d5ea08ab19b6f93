"""What is told before anything is rendered: numbers that cannot be, and such as float32 cannot hold."""

import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.embree import Accel
from raytracer.scene.load import build
from raytracer.scene.pack.scene import PackedScene, pack
from raytracer.scene.warnings import find_warnings
from raytracer.schema.registry import CAMERAS
from raytracer.util.errors import InputError
from tests.hard_cases.harness import Measured, hard_case
from tests.small_scenes import image, scene

Array = NDArray[np.float64]

EPSILON = float(np.finfo(np.float64).eps)

HEAD = """\
film: {width: 64, height: 48}
environment: {type: constant, radiance: 1}
materials:
  grey: {type: lambertian, albedo: 0.5}
  red: {type: lambertian, albedo: [0.6, 0.1, 0.1]}
"""

PINHOLE = "type: pinhole, look_from: [0, 0, 0], look_at: [0, 0, -1], vfov: 40"


def _packed(*objects: str, camera: str = PINHOLE, base: Path | None = None) -> PackedScene:
    """The packed scene of these objects."""
    text = f"{HEAD}camera: {{{camera}}}\nobjects:\n" + "".join(f"  - {{{item}}}\n" for item in objects)
    return pack(build(text, "scene.yaml", base=base))


def _let_through(trials: Sequence[Callable[[], object]]) -> float:
    """Count the scenes that are packed without an error."""
    through = 0
    for trial in trials:
        try:
            trial()
        except InputError:
            continue
        through += 1
    return float(through)


def _point(vector: Sequence[float] | Array) -> str:
    return f"[{', '.join(repr(float(part)) for part in vector)}]"


@hard_case(
    2,
    "Embree 4.4, measured: 15 % of the rays at 0.99 of a radius miss",
    quick=200,
    thorough=20_000,
    scene="02_too_far.yaml",
)
def too_far_to_be_hit(count: int) -> list[Measured]:
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
    packed = _packed(
        *(
            f"type: sphere, center: {_point(place)}, radius: {size!r}"
            for place, size in zip(center, radius.tolist(), strict=True)
        )
    )
    # Where the packed scene has its origin is not what this is about.
    told = [item for item in find_warnings(packed) if item.kind == "objects too far away for their size"]
    warned = np.zeros(len(radius), bool)
    warned[[int(item.keys[1]) for item in told]] = True
    wanted = radii > 1e5
    by_coordinates = np.abs(center).max(axis=1) > 1e5
    return [
        Measured(
            "spheres judged wrongly",
            naive=float(np.count_nonzero(by_coordinates != wanted)),
            ours=float(np.count_nonzero(warned != wanted)),
            tolerance=0.0,
        )
    ]


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
def shapes_that_are_nothing(_: int) -> list[Measured]:
    """Shapes of no size.

    Zero radii, edges and scales, and such as float32 takes for zero.

    A naive loader takes numbers as they are, and all of these: nobody learns why an object is not in the picture, or
    why it is black.  Each must be an error.
    """
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "line.obj").write_text("v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n")
        trials = [lambda item=item: _packed(item, base=Path(folder)) for item in _NOTHING]
        through = _let_through(trials)
    return [Measured(f"of {len(_NOTHING)}, let through", naive=float(len(_NOTHING)), ours=through, tolerance=0.0)]


# ---- Triangles


@hard_case(
    13,
    "pbrt-v4 shapes_test.cpp (Triangle.BadCases); Embree 4.4, measured",
    quick=300,
    thorough=100_000,
    scene="13_slivers.yaml",
)
def triangles_without_an_area(count: int) -> list[Measured]:
    """Triangles without an area, and without numbers.

    A mesh in which every third triangle is a point or a line, and files with vertices that are no numbers.

    Rays never hit such triangles, so a naive program leaves them in and says nothing.  How many there are, and which is
    the first, must be told to the last one; and files with NaN or infinite vertices must be refused.
    """
    rng = np.random.default_rng(13)
    # Coordinates with few digits, so that what is on a line is exactly so.
    a, b, c = rng.integers(-512, 512, (3, count, 3)) / 64.0
    c[(np.cross(b - a, c - a) == 0.0).all(axis=1)] += [0.0, 0.0, 16.0]
    b[(np.cross(b - a, c - a) == 0.0).all(axis=1)] += [0.0, 32.0, 0.0]
    bad = rng.random(count) < 1.0 / 3.0
    kind = rng.integers(0, 3, count)
    c[bad & (kind == 0)] = (2.0 * b - a)[bad & (kind == 0)]
    c[bad & (kind == 1)] = b[bad & (kind == 1)]
    b[bad & (kind == 2)], c[bad & (kind == 2)] = a[bad & (kind == 2)], a[bad & (kind == 2)]
    wrong = np.flatnonzero((np.cross(b - a, c - a) == 0.0).all(axis=1))
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)
        _write_obj(base / "slivers.obj", np.stack([a, b, c], axis=1))
        packed = _packed("type: mesh, file: slivers.obj", base=base)
        told = [item.text for item in find_warnings(packed) if item.kind == "triangles without an area"]
        right = f"has {len(wrong):,} triangles without an area (the first is number {wrong[0]},"
        kept = len(packed.scene.primitives[0].material)
        names = []
        for number, value in enumerate(("nan", "inf", "-inf")):
            names.append(f"bad{number}.obj")
            (base / names[-1]).write_text(f"v 0 0 0\nv 1 0 0\nv 0 {value} 0\nf 1 2 3\n")
        through = _let_through([lambda name=name: _packed(f"type: mesh, file: {name}", base=base) for name in names])
    return [
        Measured(
            "triangles neither kept nor reported, or reported wrongly",
            naive=float(len(wrong)),
            ours=abs(count - kept - len(wrong)) + (0.0 if len(told) == 1 and right in told[0] else float(len(wrong))),
            tolerance=0.0,
        ),
        Measured("of 3 files that hold no numbers, let through", naive=3.0, ours=through, tolerance=0.0),
    ]


def _write_obj(path: Path, triangles: Array) -> None:
    vertices = [f"v {x!r} {y!r} {z!r}" for x, y, z in triangles.reshape(-1, 3).tolist()]
    faces = [f"f {3 * number + 1} {3 * number + 2} {3 * number + 3}" for number in range(len(triangles))]
    path.write_text("\n".join([*vertices, *faces]) + "\n")


@hard_case(
    14, "z-fighting: every renderer; Gottschalk, Lin, Manocha 1996", quick=24, thorough=1000, scene="14_coplanar.yaml"
)
def surfaces_in_one_place(pairs: int) -> list[Measured]:
    """Two surfaces in one plane.

    A picture in the plane of a wall, of all sizes, turned and moved at random.

    Which of the two a ray meets is left to rounding.  A naive check compares the planes as they come out of the
    transforms, and finds few of them, or boxes, and finds too many; ours must find all, whatever transform made them,
    and none where the second is ten offsets off, or only touches the first with an edge.  Also, a scene that is built
    again must show the same.
    """
    rng = np.random.default_rng(14)
    missed, alarms, naive_missed, naive_alarms = 0, 0, 0, 0
    for trial in range(pairs):
        axis, angle, shift = rng.normal(size=3), rng.uniform(0.0, 360.0), rng.uniform(-9.0, 9.0, 3)
        size = 10.0 ** rng.uniform(-3.0, 3.0)
        place = f"{{translate: {_point(size * shift)}}}"
        steps = f"{{scale: {size!r}}}, {{rotate: {{axis: {_point(axis)}, angle: {angle!r}}}}}, {place}"
        picture, beside = _PICTURES[trial % len(_PICTURES)]
        # Coordinates reach 9 + 2 sqrt(2) sizes and an edge, and offsets are 4 * 2^-23 of that.
        gap = 10.0 * 4.0 * 2.0**-23 * 16.0
        flush, off, next_to = (picture.format(x=x, z=z) for x, z in ((0.0, 0.0), (0.0, gap), (beside, 0.0)))
        missed += not _contacts(_WALL, flush, steps)
        alarms += bool(_contacts(_WALL, off, steps) + _contacts(_WALL, next_to, steps))
        equal, overlap = _naive(size, axis, angle, size * shift)
        naive_missed, naive_alarms = naive_missed + (not equal), naive_alarms + overlap
    flush, wall = (f"{item}, transform: [{steps}]" for item in (_PICTURES[0][0].format(x=0.0, z=0.0), _WALL))
    first, again, other = (
        _seen(_packed(*both), size * shift, size) for both in ((wall, flush), (wall, flush), (flush, wall))
    )
    swapped = np.where(other < 0, -1, 1 - other)
    return [
        Measured(f"of {pairs} pairs, not reported", naive=float(naive_missed), ours=float(missed), tolerance=0.0),
        Measured(
            f"of {pairs} pairs that are apart, reported", naive=float(naive_alarms), ours=float(alarms), tolerance=0.0
        ),
        Measured(
            "rays that meet another surface when all is built again (naive: in another order)",
            naive=float(np.count_nonzero(first != swapped)),
            ours=float(np.count_nonzero(first != again)),
            tolerance=0.0,
        ),
    ]


_WALL = "type: quad, corner: [-1, -1, 0], edges: [[2, 0, 0], [0, 2, 0]], material: grey"
_PICTURES = (
    ("type: quad, corner: [{x}, -0.5, {z}], edges: [[0.7, 0, 0], [0, 0.9, 0]], material: red", 1.0),
    ("type: triangle, vertices: [[{x}, -0.5, {z}], [1, -0.5, {z}], [1, 0.7, {z}]], material: red", 2.0),
)
"""Pictures on the wall, and where they touch it with an edge only."""


def _contacts(wall: str, picture: str, steps: str) -> int:
    """Count the warnings of surfaces that coincide."""
    packed = _packed(f"{wall}, transform: [{steps}]", f"{picture}, transform: [{steps}]")
    return sum(item.kind == "surfaces that coincide" for item in find_warnings(packed))


def _naive(size: float, axis: Array, angle: float, shift: Array) -> tuple[bool, bool]:
    """Tell if a naive check reports the pair, and one that only touches.

    It compares planes through three corners, number by number, or boxes round both.
    """
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(math.radians(angle) * axis / np.linalg.norm(axis))

    def moved(*corners: tuple[float, float, float]) -> Array:
        return size * turn.apply(np.array(corners)) + shift

    wall = moved((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    picture = moved((0, -0.5, 0), (0.7, -0.5, 0), (0.7, 0.4, 0), (0, 0.4, 0))
    beside = moved((1, -0.5, 0), (1.7, -0.5, 0), (1.7, 0.4, 0), (1, 0.4, 0))
    planes = []
    for a, b, _, d in (wall, picture):
        normal = np.cross(b - a, d - a)
        normal /= np.linalg.norm(normal)
        planes.append((*normal, normal @ a))
    overlap = (wall.min(axis=0) <= beside.max(axis=0)) & (beside.min(axis=0) <= wall.max(axis=0))
    return planes[0] == planes[1], bool(overlap.all())


def _seen(packed: PackedScene, middle: Array, size: float) -> NDArray[np.int64]:
    """Which object each of some rays towards the middle of the wall meets, -1 for none."""
    accel: Accel = packed.build()
    rng = np.random.default_rng(0)
    result = []
    for direction in rng.normal(size=(400, 3)):
        unit = direction / np.linalg.norm(direction)
        met = accel.cast(middle + 0.3 * size * rng.normal(size=3) - 3.0 * size * unit, unit)
        result.append(-1 if met is None else int(packed.objects.owners[met.geometry].number[met.primitive // 2]))
    return np.array(result)


@hard_case(14, "white furnace: Veach 1997, thesis, sec. 3.7", quick=16, thorough=256, scene="14_glass_on_a_floor.yaml")
def glass_on_a_floor(spp: int) -> list[Measured]:
    """A glass cube that stands exactly on a floor.

    Under an even sky, a white floor and clear glass show nothing but that sky, in each pixel.  Where the cube stands
    exactly on the floor, as one builds it, light that goes out by its lower face is below the floor already, and lost.
    That must be reported, and what the warning advises, to sink the cube by a millimetre, must lose none: each of up to
    300 vertices has a weight of 1, to an ulp.
    """

    def cube(lowest: float) -> str:
        return _GLASS.format(lowest=lowest)

    standing, sunk = (image(cube(lowest), width=8, height=8, spp=spp, max_depth=300) for lowest in (0.0, -1e-3))
    told = [
        sum(item.kind == "surfaces that coincide" for item in find_warnings(pack(scene(cube(lowest)))))
        for lowest in (0.0, -1e-3)
    ]
    return [
        Measured(
            "light that is lost (naive: exactly on the floor)",
            naive=float(1.0 - standing.radiance.mean()),
            ours=float(np.abs(1.0 - sunk.radiance).max()),
            tolerance=300.0 * EPSILON,
        ),
        Measured("wrong or missing warnings", naive=1.0, ours=float(abs(told[0] - 1) + told[1]), tolerance=0.0),
    ]


_GLASS = """
camera: {{type: pinhole, look_from: [0.3, 2.5, 2.2], look_at: [0, 0.5, 0], vfov: 30}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: box, min: [-9, -3, -9], max: [9, 0, 9], material: {{type: lambertian, albedo: 1}}}}
  - {{type: box, min: [-1, {lowest!r}, -1], max: [1, 1, 1], material: {{type: dielectric, ior: 1.5}}}}
"""


# ---- Cameras


@hard_case(25, "Gauss's equation: at the focal length the image is at infinity", quick=60, thorough=600)
def focused_at_its_focal_length(count: int) -> list[Measured]:
    """Lenses focused at their focal length, or nearer.

    The naive image distance 1 / (1/f - 1/F) is infinite or negative there, and the picture black, mirrored or full of
    NaN.  Each of these must be an error.
    """
    rng = np.random.default_rng(25)
    focal = np.round(10.0 ** rng.uniform(-3.0, 0.0, count), 6)
    focus = focal * np.where(np.arange(count) % 2, 1.0, rng.uniform(0.1, 1.0, count))
    with np.errstate(divide="ignore"):
        image = 1.0 / (1.0 / focal - 1.0 / focus)
    ball = "type: sphere, center: [0, 0, -3], radius: 1"

    def lens(length: float, distance: float) -> Callable[[], object]:
        keys = f"focal_length: {length!r} m, f_number: 2, focus_distance: {distance!r}"
        camera = f"type: thin_lens, look_at: [0, 0, -1], sensor: {{width: 36 mm, height: 27 mm}}, {keys}"
        return lambda: _packed(ball, camera=camera)

    through = _let_through(
        [lens(length, distance) for length, distance in zip(focal.tolist(), focus.tolist(), strict=True)]
    )
    nonsense = float(np.count_nonzero(~np.isfinite(image) | (image < 0.0)))
    assert _let_through([lens(0.05, 0.0501)]) == 1.0
    return [Measured(f"of {count}, let through", naive=nonsense, ours=through, tolerance=0.0)]


@hard_case(27, "tan(179.9 deg / 2) = 1145.915", scene="27_widest.yaml")
def widest_view(_: int) -> list[Measured]:
    """A view of 179.9 degrees, and of none.

    The naive tangent in float32 is off by a part in 10^4, since the angle's own rounding is magnified by
    2 / sin(vfov) = 1146; in float64 by that many times an ulp of the angle and a few more of the result.  What is no
    angle of view must be an error; the naive program goes on with a flat, infinite or mirrored film.
    """
    half = math.radians(179.9) / 2.0
    exact = 1.0 / math.tan(math.radians(0.1) / 2.0)
    camera = _packed(_BALL, camera=PINHOLE.replace("40", "179.9")).spec.camera
    height = camera.optics(64, 48).top
    tolerance = (2.0 / math.sin(2.0 * half) * half + 4.0) * EPSILON
    wrong = ("0", "180", "-40", "270", ".nan", ".inf")
    through = _let_through([lambda text=text: _packed(_BALL, camera=PINHOLE.replace("40", text)) for text in wrong])
    single = float(np.tan(np.float32(half)))
    return [
        Measured(
            "relative error of the film's half height",
            naive=abs(single / exact - 1.0),
            ours=abs(height / exact - 1.0),
            tolerance=tolerance,
        ),
        Measured(
            f"of {len(wrong)} angles that are none, let through", naive=float(len(wrong)), ours=through, tolerance=0.0
        ),
    ]


_BALL = "type: sphere, center: [0, 0, -3], radius: 1"


@hard_case(
    28, "Gram-Schmidt twice is enough: Giraud, Langou, Rozloznik 2005", quick=100, thorough=20_000, scene="28_up.yaml"
)
def view_along_up(count: int) -> list[Measured]:
    """Cameras that look along their up.

    It is parallel to the view, or 10^-6 rad from that.

    Parallel, there is no picture, and it must be an error; the naive frame is 0/0.  Nearly parallel, what is left of
    `up` after the view is taken out has lost digits in proportion, and a frame that is made in one go is skew by an ulp
    over the angle.  Ours must be orthonormal to 10^-12, which is what 10^-6 rad leave of float64 after one round, and a
    few ulp after two: 16.
    """
    pinhole: Any = CAMERAS.specs()["pinhole"]
    rng = np.random.default_rng(28)
    naive, ours = 0.0, 0.0
    for _ in range(count):
        forward = rng.normal(size=3)
        forward /= np.linalg.norm(forward)
        side = np.cross(forward, rng.normal(size=3))
        up = forward + 1e-6 * side / np.linalg.norm(side)
        frame = pinhole(look_at=tuple(forward.tolist()), up=tuple(up.tolist()), vfov=40.0).frame()
        ours = max(ours, _skew(np.array([frame.right, frame.up, frame.forward])))
        one = up / np.linalg.norm(up)
        across = one - forward * (one @ forward)
        across /= np.linalg.norm(across)
        naive = max(naive, _skew(np.array([np.cross(forward, across), across, forward])))
    axes = [(1, 0, 0), (0, -2, 0), (0, 0, 5), (1, 2, 3), (-0.1, 0.7, 1e5)]
    parallel = [
        f"type: pinhole, look_at: {_point(axis)}, up: {_point(3.0 * np.array(axis))}, vfov: 40" for axis in axes
    ]
    ball = "type: sphere, center: [0, 0, -300], radius: 1"
    through = _let_through([lambda camera=camera: _packed(ball, camera=camera) for camera in parallel])
    return [
        Measured("skewness of frames 1e-6 rad from parallel", naive=naive, ours=ours, tolerance=16.0 * EPSILON),
        Measured(f"of {len(axes)} views along up, let through", naive=float(len(axes)), ours=through, tolerance=0.0),
    ]


def _skew(frame: Array) -> float:
    """By how much rows (3, 3) are not orthonormal."""
    return float(np.abs(frame @ frame.T - np.eye(3)).max())
