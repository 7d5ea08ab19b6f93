"""Objects, groups and instances: what is packed of them, and that it looks as if it had been written out."""

import math

import numpy as np
import pytest

from raytracer.core.motion.interpolation import pose_at
from raytracer.plugins.shapes.scatter import Scatter
from raytracer.scene.pack.scene import pack
from raytracer.schema.transform import matrix_of
from raytracer.util.errors import SceneError
from tests.scene.assets.test_meshes import ply_text
from tests.small_scenes import assert_mean, image, scene

CAMERA = "camera: {type: pinhole, look_from: [0, 1, 7], look_at: [0, 0, 0], vfov: 40, shutter: 1}\n"

PLY = ply_text([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)], [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])


def packed(text, base=None):
    return pack(scene(CAMERA + text, filled=False, base=base))


def poses(found):
    """Matrices (n, 4, 4) of the instances that stand still."""
    rows = found.scene.instances.pose
    return np.concatenate([rows, np.broadcast_to([[[0.0, 0.0, 0.0, 1.0]]], (len(rows), 1, 4))], axis=1)


def table_bytes(found):
    return sum(column.nbytes for table in found.scene.primitives for column in table if column is not None)


# ---- What is packed


GROVE = """
groups:
  leaf:
    - {type: sphere, center: [0, 0, 0], radius: 0.1}
  tree:
    - {type: box, min: [0, 0, 0], max: [1, 2, 1]}
    - {type: instance, of: leaf, placements: [[{translate: [1, 0, 0]}], [{scale: 2}, {translate: [0, 3, 0]}]]}
objects:
  - {type: instance, of: tree, transform: [{scale: [1, 2, 1]}, {translate: [5, 0, 0]}]}
  - {type: instance, of: tree}
"""


def test_groups_in_groups_are_multiplied_out():
    found = packed(GROVE)
    assert [type(table).__name__ for table in found.scene.primitives] == ["Parallelograms", "Spheres"]
    assert [len(table.material) for table in found.scene.primitives] == [6, 1]
    outer = matrix_of(scene(CAMERA + GROVE, filled=False).objects[0].transform)
    expected = []
    for placed in (outer, np.eye(4)):
        near, far = np.eye(4), np.diag([2.0, 2.0, 2.0, 1.0])
        near[0, 3], far[1, 3] = 1.0, 3.0
        expected += [placed @ near, placed @ far, placed]
    assert sorted(map(np.ndarray.tolist, poses(found))) == sorted(map(np.ndarray.tolist, np.array(expected)))
    assert np.bincount(found.objects.instance_objects).tolist() == [3, 3]

    # Each group is where its rows are: boxes in one table, leaves in the other.
    assert [sorted(group) for group in found.objects.groups] == [[1], [0]]
    assert all(owner.number.tolist() == [-1] for owner in found.objects.owners)


def test_thousands_of_placements_take_the_memory_of_their_transforms(tmp_path):
    (tmp_path / "rock.ply").write_bytes(PLY)

    def field(count):
        lines = [f"  - {{type: instance, of: rock, transform: [{{translate: [{i}, 0, 0]}}]}}\n" for i in range(count)]
        return packed("groups: {rock: [{type: mesh, file: rock.ply}]}\nobjects:\n" + "".join(lines), base=tmp_path)

    few, many = field(10), field(2000)
    assert table_bytes(few) == table_bytes(many)
    assert type(few.scene) is type(many.scene)
    columns = [column for column in many.scene.instances if isinstance(column, np.ndarray) and len(column) == 2000]
    assert sum(column.nbytes for column in columns) == 2000 * (12 * 8 + 4)
    many.build()


@pytest.mark.parametrize(
    "second",
    [
        "{type: mesh, file: rock.ply, transform: [{scale: -2}]}",
        "{type: instance, of: rock, transform: [{scale: -2}], material: {type: lambertian}}",
    ],
)
def test_a_mesh_that_is_named_twice_is_stored_once(tmp_path, second):
    (tmp_path / "rock.ply").write_bytes(PLY)
    (tmp_path / "other.ply").write_bytes(PLY.replace(b"0 0 1", b"0 0 2"))
    first = "{type: mesh, name: rock, file: rock.ply, material: {type: metal}}"
    found = packed(f"objects: [{first}, {second}, {{type: mesh, file: other.ply}}]\n", base=tmp_path)
    (table,) = found.scene.primitives
    # What stands once is baked, and no instance.
    assert len(table.material) == 8
    assert len(found.scene.instances.group) == 2
    np.testing.assert_array_equal(poses(found), [np.eye(4), np.diag([-2.0, -2.0, -2.0, 1.0])])

    # The second has a material of its own, and the first that of the primitives.
    material = found.scene.instances.material
    assert material[0] == -1
    assert material[1] in set(found.materials) - {int(table.material[-1])}


def test_what_turns_is_an_instance_and_what_goes_straight_is_not():
    text = "objects:\n  - {type: sphere, center: [1, 0, 0], radius: 1, motion: MOTION}\n"
    straight = packed(text.replace("MOTION", "{velocity: [1, 0, 0]}"))
    assert straight.scene.instances is None
    assert type(straight.scene.primitives[0]).__name__ == "Translated"
    assert straight.scene.shutter is not None
    turning = packed(text.replace("MOTION", "{spin: {axis: [0, 0, 1], rate: 90}}"))
    instances = turning.scene.instances
    assert len(instances.pose) == 0
    assert turning.scene.shutter is not None
    moved = np.array(pose_at(instances.trajectories, 0, 1.0)) @ [1.0, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(moved, [0.0, 1.0, 0.0], atol=1e-12)
    still = packed(text.replace("MOTION", "{spin: {axis: [0, 0, 1], rate: 0}}"))
    assert still.scene.instances is None
    assert (still.objects.groups, still.objects.placements) == ([], [])
    assert still.scene.shutter is None


def test_what_moves_in_a_group_moves_where_that_is_placed():
    found = packed("""
groups:
  wheel:
    - {type: box, min: [-1, -0.1, 0], max: [1, 0.1, 0.1], motion: {spin: {axis: [0, 0, 1], rate: 90}}}
    - {type: sphere, center: [0, 0, 0], radius: 0.1, motion: {velocity: [0, 0, 1]}}
objects:
  - {type: instance, of: wheel, transform: [{scale: 3}, {translate: [5, 0, 0]}]}
  - {type: instance, of: wheel, motion: {velocity: [0, 2, 0]}}
""")
    instances = found.scene.instances
    trajectories = instances.trajectories
    # The hub goes straight on in its group; of its two placements one stands still, and one moves.
    assert len(instances.pose) == 1
    assert len(trajectories.first) - 1 == 3
    ends = sorted((np.array(pose_at(trajectories, i, 1.0)) @ [1.0, 0.0, 0.0, 1.0]).round(9).tolist() for i in range(3))
    assert ends == [[0.0, 3.0, 0.0], [1.0, 2.0, 0.0], [5.0, 3.0, 0.0]]
    assert len(found.objects.placements) == 1 + len({len(step.poses) for step in found.objects.placements[1:]})


def test_scattered_copies_stand_apart_on_their_ground():
    text = (
        "groups: {ball: [{type: sphere, center: [0, 0, 0], radius: 0.1}]}\nobjects:\n"
        "  - {type: scatter, of: ball, count: 500, seed: SEED, corner: [1, 2, 3], edges: [[40, 0, 0], [0, 0, 20]], "
        "scale: [0.5, 2], tilt: 10, turn: 90, spacing: 0.7}\n"
    )
    found = poses(packed(text.replace("SEED", "1")))
    assert len(found) == 500
    place = found[:, :3, 3] - [1.0, 2.0, 3.0]
    assert (place[:, 1] == 0.0).all()
    assert ((place >= 0.0) & (place <= [40.0, 0.0, 20.0])).all()
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    assert apart[~np.eye(500, dtype=bool)].min() >= 0.7
    size = np.linalg.norm(found[:, :3, 1], axis=1)
    assert ((size >= 0.5) & (size <= 2.0)).all()
    assert size.min() < 0.6
    assert size.max() > 1.9
    lean = np.degrees(np.arccos(np.clip(found[:, 1, 1] / size, -1.0, 1.0)))
    assert 8.0 < lean.max() <= 10.0 + 1e-9
    # Uniform over a cone of 10 degrees: half of the solid angle is within 7.07.
    assert np.mean(lean < math.degrees(math.acos(0.5 + 0.5 * math.cos(math.radians(10.0))))) == pytest.approx(
        0.5, abs=0.1
    )
    gram = np.einsum("nji,njk->nik", found[:, :3, :3], found[:, :3, :3])
    np.testing.assert_allclose(gram, size[:, None, None] ** 2 * np.eye(3), atol=1e-12)
    assert (np.linalg.det(found[:, :3, :3]) > 0.0).all()

    np.testing.assert_array_equal(poses(packed(text.replace("SEED", "1"))), found)
    assert not np.array_equal(poses(packed(text.replace("SEED", "2"))), found)


def test_scattered_places_are_the_first_that_are_free():
    # Most of the places that are tried where an area is nearly full are left out before they are looked at by turns.
    scatter = Scatter(of="ball", count=300, seed=5, corner=(1, 0, 2), edges=((1, 0, 0), (0, 0, 1)), spacing=0.0455)
    random = np.random.Generator(np.random.PCG64(5))
    places = []
    rounds = 0
    while len(places) < 300:
        rounds += 1
        for point in np.array([1.0, 0.0, 2.0]) + random.random((300, 2)) @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]):
            if len(places) < 300 and all(math.dist(point, other) >= 0.0455 for other in places):
                places.append(point)
    assert rounds > 5
    np.testing.assert_array_equal(scatter.poses({})[:, :3, 3], places)


def test_placements_of_files(tmp_path):
    matrices = np.stack([np.diag([1.0 + i, 1.0, -2.0, 1.0]) for i in range(5)])
    matrices[:, :3, 3] = np.random.default_rng(1).normal(size=(5, 3))
    np.save(tmp_path / "four.npy", matrices)
    np.save(tmp_path / "three.npy", matrices[:, :3].astype(np.float32))
    table = "x, y, z, scale, angle, axis_x, axis_y, axis_z\n1,2,3,2,90,0,0,2\n4,5,6,1,0,1,0,0\n"
    (tmp_path / "table.csv").write_text(table)
    (tmp_path / "stretched.csv").write_text("z,y,x,scale_y,angle,axis_z\n3,2,1,-4,90,1\n")

    def read(file):
        ball = "groups: {ball: [{type: sphere, center: [0, 0, 0], radius: 1}]}\n"
        item = f"{{type: instance, of: ball, placements: {file}, transform: [{{translate: [0, 0, 7]}}]}}"
        return poses(packed(f"{ball}objects: [{item}]\n", base=tmp_path))

    moved = matrices.copy()
    moved[:, 2, 3] += 7.0
    np.testing.assert_array_equal(read("four.npy"), moved)
    np.testing.assert_allclose(read("three.npy"), moved, rtol=1e-7)
    turned = [[0, -2, 0, 1], [2, 0, 0, 2], [0, 0, 2, 10], [0, 0, 0, 1]]
    still = [[1, 0, 0, 4], [0, 1, 0, 5], [0, 0, 1, 13], [0, 0, 0, 1]]
    np.testing.assert_allclose(read("table.csv"), [turned, still], atol=1e-12)
    stretched = [[0, 4, 0, 1], [1, 0, 0, 2], [0, 0, 1, 10], [0, 0, 0, 1]]
    np.testing.assert_allclose(read("stretched.csv"), [stretched], atol=1e-12)


# ---- Emitters in instances


LANTERN = """
groups:
  lantern:
    - {type: sphere, center: [0, 0.5, 0], radius: 0.2, material: {type: emitter, radiance: [9, 6, 3]}}
    - {type: quad, corner: [-0.4, 1, -0.4], edges: [[0.8, 0, 0], [0, 0, 0.8]], material: {type: metal}}
  plain: [{type: sphere, center: [0, 0, 0], radius: 0.3, material: {type: metal}}]
objects:
  - {type: quad, corner: [-9, -1, -9], edges: [[0, 0, 18], [18, 0, 0]], material: {type: lambertian}}
  - {type: quad, corner: [-9, 9, -9], edges: [[1, 0, 0], [0, 0, 1]], material: {type: emitter, radiance: 1}}
  - {type: instance, of: lantern, placements: [[{scale: 2}], [{translate: [2, 0, 0]}], [{translate: [-2, 0, 0]}]]}
  - {type: instance, of: plain}
  - {type: instance, of: plain, transform: [{translate: [0, 0, 2]}], material: {type: emitter, radiance: 4}}
"""


def test_emitters_are_chosen_by_power_among_instances_too():
    found = packed(LANTERN).scene
    (lights,) = found.lights.tables
    glow = found.instances.emissive
    ball, own, override = 4 * math.pi * 0.04 * 18.0, 3.0 * 1.0, 4 * math.pi * 0.09 * 12.0
    total = own + ball * (4.0 + 1.0 + 1.0) + override
    by_variant = dict(zip(lights.variant.tolist(), lights.choice.pmf.tolist(), strict=True))
    assert len(by_variant) == 3
    assert sorted(by_variant.values()) == pytest.approx(sorted([own / total, ball * 6.0 / total, override / total]))
    assert by_variant[0] == pytest.approx(own / total)

    # Among the three lanterns by their sizes; the ball of metal does not shine, and its copy does.
    assert sorted(glow.probability.tolist()) == pytest.approx([0.0, 1 / 6, 1 / 6, 4 / 6, 1.0])
    assert np.count_nonzero(glow.variant < 0) == 1
    for start, stop in zip(glow.first[1:-1], glow.first[2:], strict=True):
        assert glow.cumulative[stop - 1] == pytest.approx(1.0)
        np.testing.assert_allclose(
            np.diff(glow.cumulative[start:stop], prepend=0.0), glow.probability[glow.member[start:stop]]
        )


# ---- What it looks like

GROUND = "  - {type: quad, corner: [-5, -1, -5], edges: [[0, 0, 10], [10, 0, 0]], material: {type: lambertian}}\n"
BAKED = """
  - {type: sphere, center: [0, 2, 0], radius: 0.5, material: {type: emitter, radiance: 8}}
  - {type: box, min: [-1, -1, -1], max: [1, 0, 1], material: {type: lambertian, albedo: 0.3}, TURN}
  - {type: sphere, center: [1.4, -0.4, 0.5], radius: 0.6, material: {type: dielectric}}
"""
PLACED = """
groups:
  things:
    - {type: sphere, center: [0, 1, 0], radius: 0.25, material: {type: emitter, radiance: 8}}
    - {type: box, min: [-0.5, -0.5, -0.5], max: [0.5, 0, 0.5], material: {type: lambertian, albedo: 0.3}, TURN}
    - {type: sphere, center: [0.7, -0.2, 0.25], radius: 0.3, material: {type: dielectric}}
objects:
  - {type: instance, of: things, transform: [{scale: 2}]}
"""
TURN = "transform: [{rotate: {axis: [0, 1, 0], angle: 25}}]"


def test_placed_looks_as_baked():
    # The same numbers drawn, the same hits to float64: the same picture but for paths that graze an edge.
    baked = image(CAMERA + "objects:\n" + GROUND + BAKED.replace("TURN", TURN), lit=True, spp=32)
    placed = image(CAMERA + PLACED.replace("TURN", TURN) + GROUND, spp=32)
    difference = np.abs(placed.radiance - baked.radiance).max(axis=2)
    assert np.median(difference) < 1e-9
    assert placed.radiance.mean() == pytest.approx(baked.radiance.mean(), rel=0.02)


STRETCHED = """
camera: {type: pinhole, look_from: [3, 2, 0], look_at: [0.7, -1, 0.4], vfov: 0.01}
groups:
  lamp: [{type: sphere, center: [0, 0, 0], radius: 1, material: {type: emitter, radiance: 2}}]
objects:
  - {type: quad, corner: [-9, -1, -9], edges: [[0, 0, 18], [18, 0, 0]], material: {type: lambertian, albedo: 1}}
  - {type: instance, of: lamp, TRANSFORM}
"""


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_irradiance_below_a_placed_ellipsoid(mirror):
    # L / pi times the integral of the cosine over the directions that meet |A^-1 (p - b)| = 1; half of the samples aim
    # at the lamp and half find it by chance, so a wrong density of either shows.
    transform = f"transform: [{{scale: [0.3, 0.6, {1.2 * mirror}]}}, {{rotate: {{axis: [1, 1, 0], angle: 40}}}}]"
    text = STRETCHED.replace("TRANSFORM", transform)
    inverse = np.linalg.inv(matrix_of(scene(text, filled=False).objects[1].transform)[:3, :3])
    cells = 1000
    u, v = (np.stack(np.meshgrid(*2 * [np.arange(cells)], indexing="ij")).reshape(2, -1) + 0.5) / cells
    # Directions drawn by the cosine: the mean of what they meet is the integral over pi.
    ways = np.stack([np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(1 - u), np.sqrt(u) * np.sin(2 * np.pi * v)], axis=1)
    start, local = inverse @ [0.7, -1.0, 0.4], ways @ inverse.T
    b, a, c = local @ start, (local**2).sum(axis=1), start @ start - 1.0
    met = (b * b > a * c) & (b < 0.0)
    assert 0.05 < met.mean() < 0.5
    picture = image(text, spp=1024, width=8, height=8, max_depth=2)
    assert_mean(picture, 2.0 * float(met.mean()), relative_noise=0.005)


# ---- What is refused


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("of: tree}", "of: tre}", "unknown group or object 'tre'; did you mean 'tree'?"),
        ("of: leaf,", "of: tree,", "groups.tree[1].of: places 'tree' in itself: tree -> tree"),
        (
            "{type: sphere, center: [0, 0, 0], radius: 0.1}",
            "{type: instance, of: tree}",
            "in itself: leaf -> tree -> l",
        ),
        ("of: tree}", "of: tree, medium: fog}", "medium: takes effect together with a `material`"),
        ("of: tree}", "of: b, name: a}\n  - {type: instance, of: a, name: b}", "places 'a' in itself: a -> b -> a"),
    ],
)
def test_what_cannot_be_placed_is_refused(old, new, words):
    with pytest.raises(SceneError) as caught:
        scene(CAMERA + GROVE.replace(old, new), filled=False)
    assert words in str(caught.value)


def nested(levels, copies=1):
    """Groups, each with so many instances of the next, and an instance of the first."""
    inner = ["{type: sphere, center: [0, 0, 0], radius: 1}", *(f"{{type: instance, of: g{i}}}" for i in range(levels))]
    groups = [f"  g{i}: [{', '.join([item] * (copies if i else 1))}]\n" for i, item in enumerate(inner)]
    return f"groups:\n{''.join(groups)}objects: [{{type: instance, of: g{levels}}}]\n"


def test_groups_are_in_groups_to_a_depth():
    assert len(poses(packed(nested(63)))) == 1
    for levels in (64, 5000):
        with pytest.raises(SceneError, match=r"groups\.g64\[0\]\.of: places groups in groups more than 64 levels deep"):
            packed(nested(levels))


def test_groups_that_double_are_refused_before_they_are_written_out(monkeypatch):
    # 131,072 of the first; placed 1000 times, that is too many.
    places = "placements: [[], [{scale: 2}]]"
    groups = "".join(f"  g{i}: [{{type: instance, of: g{i - 1}, {places}}}]\n" for i in range(1, 18))
    scatter = "scatter, of: g17, count: 1000, corner: [0, 0, 0], edges: [[1, 0, 0], [0, 0, 1]]"
    ball = "groups:\n  g0: [{type: sphere, center: [0, 0, 0], radius: 1}]\n"
    with pytest.raises(SceneError, match="16,777,216 are possible"):
        packed(f"{ball}{groups}objects: [{{type: {scatter}}}]\n")
    monkeypatch.setattr("raytracer.scene.pack.layout._MAX_GROUP_INSTANCES", 1000)
    assert len(poses(packed(nested(8, copies=2)))) == 256
    with pytest.raises(SceneError, match="places groups in groups more than 1,000 times"):
        packed(nested(40, copies=2))


def test_an_area_without_room_is_refused():
    area = "count: 50, corner: [0, 0, 0], edges: [[1, 0, 0], [0, 0, 1]], spacing: 0.5"
    ball = "groups: {ball: [{type: sphere, center: [0, 0, 0], radius: 0.1}]}\n"
    with pytest.raises(SceneError, match=r"objects\[0\]: there is no room: at a spacing of 0.5 m, \d+ copies of 50"):
        packed(f"{ball}objects: [{{type: scatter, of: ball, {area}}}]\n")
