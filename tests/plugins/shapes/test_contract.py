"""Contract of shapes, tested for every kind that there is, under transforms of every sort.

Each shape is lowered to its table, built into Embree, and shot at; the answers are checked against the shape's own
definition in float64, carried to world space by its matrix.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.core.primitives.base.interface import areas, geometry
from raytracer.plugins.shapes.base.interface import PlacementSpec
from raytracer.scene.assets import LOADERS
from raytracer.schema.registry import SHAPES
from raytracer.schema.transform import matrix_of
from tests.plugins.materials.kernels import frame
from tests.plugins.shapes.kernels import cast, pdf_of, sample, uniform_directions, unit

Array = NDArray[np.float64]

TETRAHEDRON = [[0, 0, 0], [1.5, 0, 0], [0, 1, 0], [0, 0, 2]], [[1, 3, 2], [1, 2, 4], [1, 4, 3], [2, 3, 4]]
OCTAHEDRON = (
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]],
    [[1, 3, 5], [3, 2, 5], [2, 4, 5], [4, 1, 5], [3, 1, 6], [2, 3, 6], [4, 2, 6], [1, 4, 6]],
)


class Example(NamedTuple):
    """A shape and its definition, before any transform.

    outside, for points on it (n, 3), its outside normals (n, 3), and NaN for a point not on it; a closed shape has
    its centre at `center`, inside of it; area under a matrix; uniform, whether only uniform scaling suits it.
    """

    keys: dict[str, Any]
    outside: Callable[[Array], Array]
    center: Array | None
    area: Callable[[Array], float]
    uniform: bool


def _polygon_area(*corners):
    """Area of a convex polygon whose corners are moved by a matrix."""

    def area(matrix):
        moved = np.array(corners, float) @ matrix[:3, :3].T
        total = sum(np.cross(moved[i] - moved[0], moved[i + 1] - moved[0]) for i in range(1, len(moved) - 1))
        return float(0.5 * np.linalg.norm(total))

    return area


def _flat(normal, through, inside):
    """Normals of a flat shape."""

    def outside(points):
        n = unit(normal)[0]
        on = (np.abs((points - through) @ n) < 1e-6) & inside(points)
        return np.where(on[:, None], n, np.nan)

    return outside


def _sphere(points):
    out = points - [0.3, 0.2, -0.1]
    on = np.abs(np.linalg.norm(out, axis=1) - 0.8) < 1e-6
    return np.where(on[:, None], unit(out), np.nan)


def _faces(normals, distances):
    """Normals of a convex polyhedron: faces n . p = d, the inside at n . p < d."""

    def outside(points):
        n = unit(normals)
        heights = points @ n.T - np.array(distances)
        face = np.argmax(heights, axis=1)
        on = np.abs(heights.max(axis=1)) < 1e-6
        return np.where(on[:, None], n[face], np.nan)

    return outside


def _box_area(matrix):
    x, y, z = matrix[:3, 0] * 1.0, matrix[:3, 1] * 2.0, matrix[:3, 2] * 0.5
    return float(2.0 * sum(np.linalg.norm(np.cross(a, b)) for a, b in ((x, y), (y, z), (z, x))))


def _mesh_area(vertices, faces):
    return lambda matrix: sum(_polygon_area(*np.array(vertices)[np.array(face) - 1])(matrix) for face in faces)


_TETRAHEDRON_FACES = _faces(
    [[0, 0, -1], [0, -1, 0], [-1, 0, 0], [1 / 1.5, 1, 0.5]], [0, 0, 0, 1.0 / np.hypot(np.hypot(1 / 1.5, 1), 0.5)]
)
_OCTAHEDRON_FACES = _faces([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], [1.0 / np.sqrt(3.0)] * 8)


def _scaled_sphere_area(matrix):
    return float(4.0 * np.pi * 0.64 * abs(np.linalg.det(matrix[:3, :3])) ** (2.0 / 3.0))


EXAMPLES = {
    "sphere": Example(
        {"type": "sphere", "center": [0.3, 0.2, -0.1], "radius": 0.8},
        _sphere, np.array([0.3, 0.2, -0.1]), _scaled_sphere_area, True,
    ),
    "sphere inside out": Example(
        {"type": "sphere", "center": [0.3, 0.2, -0.1], "radius": -0.8},
        lambda points: -_sphere(points), None, _scaled_sphere_area, True,
    ),
    "quad": Example(
        {"type": "quad", "corner": [0.1, 0, 0.2], "edges": [[1, 0.5, 0], [0, 1, 0.3]]},
        _flat(np.cross([1, 0.5, 0], [0, 1, 0.3]).tolist(), [0.1, 0, 0.2], lambda p: np.ones(len(p), bool)),
        None, _polygon_area([0.1, 0, 0.2], [1.1, 0.5, 0.2], [1.1, 1.5, 0.5], [0.1, 1, 0.5]), False,
    ),
    "disc": Example(
        {"type": "disc", "center": [0.1, 0.2, 0.3], "normal": [1, 2, -2], "radius": 0.7},
        _flat([1, 2, -2], [0.1, 0.2, 0.3], lambda p: np.linalg.norm(p - [0.1, 0.2, 0.3], axis=1) < 0.7 * (1 + 1e-6)),
        None, lambda matrix: np.pi * 0.49 * abs(np.linalg.det(matrix[:3, :3])) ** (2.0 / 3.0), True,
    ),
    "box": Example(
        {"type": "box", "min": [-0.5, -1, 0], "max": [0.5, 1, 0.5]},
        _faces([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], [0.5, 0.5, 1, 1, 0.5, 0]),
        np.array([0.0, 0.0, 0.25]), _box_area, False,
    ),
    "triangle": Example(
        {"type": "triangle", "vertices": [[0, 0, 0.5], [1, 0.25, 0], [0.25, 1, 0]]},
        _flat(np.cross([1, 0.25, -0.5], [0.25, 1, -0.5]).tolist(), [0, 0, 0.5], lambda p: np.ones(len(p), bool)),
        None, _polygon_area([0, 0, 0.5], [1, 0.25, 0], [0.25, 1, 0]), False,
    ),
    "mesh": Example(
        {"type": "mesh", "file": "tetrahedron.obj"},
        _TETRAHEDRON_FACES, np.array([0.2, 0.2, 0.2]), _mesh_area(*TETRAHEDRON), False,
    ),
    "smooth mesh": Example(
        {"type": "mesh", "file": "octahedron.obj", "smooth": True},
        _OCTAHEDRON_FACES, np.zeros(3), _mesh_area(*OCTAHEDRON), False,
    ),
}  # fmt: skip

UNIFORM = {
    "as it is": [],
    "turned, scaled and moved": [{"rotate": {"axis": [1, 2, 3], "angle": 50}}, {"scale": 3}, {"translate": [4, -5, 6]}],
    "mirrored": [{"scale": [-1, 1, 1]}, {"rotate": {"axis": [0, 1, 1], "angle": 20}}],
    "through the origin": [{"scale": -0.5}, {"translate": [0, 2, 0]}],
    "small": [{"scale": 0.001}],
    "large": [{"rotate": {"axis": [1, 1, 3], "angle": 200}}, {"scale": 5000}],
}
ANY = {
    "stretched": [{"scale": [1, 3, 0.5]}, {"rotate": {"axis": [1, 0, 1], "angle": 70}}],
    "sheared mirror": {"matrix": [[1, 0.5, 0, 1], [0, -1, 0.3, 2], [0.2, 0, 1, 3], [0, 0, 0, 1]]},
}

CASES = [
    pytest.param(name, transform, id=f"{name}, {how}")
    for name, example in EXAMPLES.items()
    for how, transform in {**UNIFORM, **({} if example.uniform else ANY)}.items()
]

every_shape = pytest.mark.parametrize(("name", "transform"), CASES)


@pytest.fixture
def lower(tmp_path):
    """Makes an example's table and matrix."""
    for name, mesh in (("tetrahedron", TETRAHEDRON), ("octahedron", OCTAHEDRON)):
        lines = (f"{kind} {a} {b} {c}\n" for kind, rows in zip("vf", mesh, strict=True) for a, b, c in rows)
        (tmp_path / f"{name}.obj").write_text("".join(lines))

    def lower(name, transform, material=7):
        keys = {**EXAMPLES[name].keys, "transform": transform}
        spec = SHAPES.specs()[keys["type"]].model_validate(keys)
        assets = {key: LOADERS[kind](tmp_path / getattr(spec, key)) for key, kind in spec.loads.items()}
        matrix = matrix_of(spec.transform)
        return spec.pack(matrix, material, assets), matrix

    return lower


def _extent(matrix):
    """Return the size of coordinates about a shape that lies within 2 of the origin before its transform."""
    return float(np.abs(matrix[:3, 3]).max() + 2.0 * np.linalg.norm(matrix[:3, :3], 2))


def _shots(matrix, count, seed):
    """Rays at a shape from all sides: from 4 units off towards points within 0.8 of its place, all moved along."""
    rng = np.random.default_rng(seed)
    origins = 4.0 * uniform_directions(count, seed)
    targets = [0.3, 0.3, 0.1] + 0.8 * rng.uniform(-1.0, 1.0, (count, 3))
    moved = (np.column_stack([rows, np.ones(count)]) @ matrix[:3].T for rows in (origins, targets))
    start, end = moved
    return start, unit(end - start)


def _expected_normals(name, matrix, points):
    """The definition's outside normals at world points: the inverse transpose takes them over, on their own side.

    References: Pharr et al. 2023, sec. 3.10.3.
    """
    inverse = np.linalg.inv(matrix)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    return unit(EXAMPLES[name].outside(local) @ inverse[:3, :3])


def test_every_kind_has_an_example():
    # Those that place others have no primitives of their own.
    kinds = {name for name, spec in SHAPES.specs().items() if not issubclass(spec, PlacementSpec)}
    assert {example.keys["type"] for example in EXAMPLES.values()} == kinds


@every_shape
def test_tables_hold_contiguous_numbers_and_their_areas(lower, name, transform):
    table, matrix = lower(name, transform)
    assert table.material.tolist() == [7] * len(areas(table))
    for field, column in table._asdict().items():
        if column is not None:
            assert column.flags.c_contiguous, field
            assert column.dtype in (np.float64, np.float32, np.int32, np.uint32), field
            assert np.isfinite(column).all(), field
    # What Embree borrows must outlive the call, and end in 16 readable bytes: it loads 16 at a time.
    shape = geometry(table)
    for buffer in (*shape.vertices, shape.indices, shape.normals):
        if buffer is not None:
            assert buffer.flags.c_contiguous
            assert buffer.dtype.itemsize == 4
            assert buffer.base.nbytes >= buffer.nbytes + 16
    # Vertices of triangles are float32: their areas follow to a few ulps of that.
    rel = 1e-5 if "mesh" in name or name == "triangle" else 1e-12
    assert areas(table).sum() == pytest.approx(EXAMPLES[name].area(matrix), rel=rel)


@every_shape
def test_hits_lie_on_the_surface_with_the_normal_to_its_outside(lower, name, transform):
    table, matrix = lower(name, transform)
    origins, directions = _shots(matrix, 4000, 1)
    hits = cast((table,), origins, directions)
    met = hits.table == 0
    assert met.sum() > 300
    points = hits.point[met]
    extent = _extent(matrix)

    # On the ray, where Embree said so to float32 rounding along the normal; float64 rounding of what it solves.
    along = ((points - origins[met]) * directions[met]).sum(axis=1)
    off_ray = np.linalg.norm(points - origins[met] - along[:, None] * directions[met], axis=1)
    cosine = np.abs((hits.normal[met] * directions[met]).sum(axis=1))
    clear = cosine > 0.05
    assert (off_ray[clear] <= 1e-13 * extent / cosine[clear] ** 2).all()
    assert (np.abs(along - hits.near[met])[clear] <= 8.0 * 2.0**-23 * extent / cosine[clear] ** 2).all()

    # On the surface, by its definition, and normal to it.
    expected = _expected_normals(name, matrix, points)
    known = ~np.isnan(expected[:, 0]) & clear
    assert known.sum() > 0.97 * clear.sum()
    np.testing.assert_allclose(np.linalg.norm(hits.normal[met], axis=1), 1.0, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(hits.shading_normal[met], axis=1), 1.0, rtol=0.0, atol=1e-14)
    agree = (hits.normal[met] * expected).sum(axis=1)[known]
    # At an edge, within float32 of it, the definition may name the other face.
    assert (np.abs(agree - 1.0) < 1e-6).mean() > 0.999
    assert (hits.material[met] == 7).all()
    assert (hits.offset[met] > 0.0).all()

    # A closed shape is seen from outside from afar, and from inside from within.
    if EXAMPLES[name].center is not None:
        assert ((hits.normal[met] * directions[met]).sum(axis=1) < 0.0).all()
        hits = cast((table,), matrix[:3, :3] @ EXAMPLES[name].center + matrix[:3, 3], directions[:2000])
        assert (hits.table == 0).all()
        assert ((hits.normal * directions[:2000]).sum(axis=1) > 0.0).all()


@every_shape
def test_points_are_drawn_on_the_surface_with_their_pdf(lower, name, transform):
    table, matrix = lower(name, transform)
    reference = np.array([2.1, 2.6, 1.3, 1.0]) @ matrix[:3].T
    u = np.random.default_rng(4).random((2000, 2))
    for primitive in range(len(table.material)):
        points = sample((table,), 0, primitive, reference, u)
        expected = _expected_normals(name, matrix, points.point)
        known = ~np.isnan(expected[:, 0])
        assert known.mean() > 0.99
        np.testing.assert_allclose(np.linalg.norm(points.normal, axis=1), 1.0, rtol=0.0, atol=1e-14)
        assert (np.abs((points.normal * expected).sum(axis=1)[known] - 1.0) < 1e-6).mean() > 0.99
        np.testing.assert_allclose(points.twin, points.pdf, rtol=1e-9)
        assert (points.gap > 0.0).all()
        assert (points.gap < 0.1 * np.linalg.norm(points.point - reference, axis=1)).all()


def _row(table, primitive):
    """A table of one of its primitives."""
    if hasattr(table, "faces"):
        return table._replace(faces=table.faces[primitive : primitive + 1].copy(), material=table.material[:1])
    return type(table)(*(np.ascontiguousarray(column[primitive : primitive + 1]) for column in table))


PLACES = {"outside": [2.1, 2.6, 1.3, 1.0], "near": [0.65, 1.2, 0.6, 1.0], "far": [300.0, 200.0, 150.0, 1.0]}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_pdf_is_that_of_the_directions_to_the_points(lower, name, place):
    # Three expectations of g(direction), by points drawn and by rays cast: E[g] = integral of g pdf over what is met.
    # With g = 1 this is that the pdf integrates to 1; the components of the direction tell where it is large.
    table, matrix = lower(name, UNIFORM["turned, scaled and moved"])
    reference = np.array(PLACES[place]) @ matrix[:3].T
    # One number in each cell of a grid: as good as 200,000 independent ones, and better.
    side, independent = 160, 200_000
    count, rng = side * side, np.random.default_rng(6)
    cells = np.stack(np.divmod(np.arange(count), side), axis=1)
    for primitive in range(min(2, len(table.material))):
        single = _row(table, primitive)
        drawn = sample((single,), 0, 0, reference, (cells + rng.random((count, 2))) / side)
        ways = unit(drawn.point - reference)

        # Rays in a cone just wide enough for all of the primitive.
        axis = unit(ways.mean(axis=0))[0]
        lowest = max(-1.0, float((ways @ axis).min()) - 0.1 * (1.0 - float((ways @ axis).min())))
        u = (cells + rng.random((count, 2))) / side
        cosine, phi = 1.0 - (1.0 - lowest) * u[:, 0], 2.0 * np.pi * u[:, 1]
        sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
        axes = frame(axis)
        directions = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1) @ axes
        hits = cast((single,), np.tile(reference, (count, 1)), directions)
        met = hits.table == 0
        pdf = np.zeros(count)
        pdf[met] = pdf_of((single,), 0, 0, reference, hits.point[met], hits.normal[met])
        solid_angle = 2.0 * np.pi * (1.0 - lowest)
        for component in (np.ones(3), *np.eye(3), *axes):
            by_points = np.ones(count) if component.sum() == 3.0 else ways @ component
            by_rays = solid_angle * pdf * (np.ones(count) if component.sum() == 3.0 else directions @ component)
            deviation = np.hypot(by_points.std(), by_rays.std()) / np.sqrt(independent)
            assert abs(by_points.mean() - by_rays.mean()) < 4.5 * deviation + 1e-9, component
            assert deviation < 0.02


def test_what_cannot_take_a_transform_says_so():
    # A stretched sphere is an ellipsoid, of which there is no table: it is placed by an instance (tests/scene).
    for example in EXAMPLES.values():
        for transforms, suits in ((UNIFORM, True), (ANY, not example.uniform)):
            for transform in transforms.values():
                spec = SHAPES.specs()[example.keys["type"]].model_validate({**example.keys, "transform": transform})
                assert spec.supports_transform(matrix_of(spec.transform)) == suits


def test_smooth_normals_turn_with_the_mesh(lower):
    # The octahedron's smooth normals point from its centre at its corners, and near them anywhere close to a corner.
    for transform in (*UNIFORM.values(), ANY["sheared mirror"]):
        table, matrix = lower("smooth mesh", transform)
        corner = np.array([0.999, 0.0005, 0.0005])
        target = matrix[:3, :3] @ corner + matrix[:3, 3]
        origin = matrix[:3, :3] @ (3.0 * corner) + matrix[:3, 3]
        hits = cast((table,), origin, unit(target - origin))
        assert hits.table[0] == 0
        expected = unit(np.array([[1.0, 0.0, 0.0]]) @ np.linalg.inv(matrix[:3, :3]))[0]
        assert hits.shading_normal[0] @ expected > 0.999
