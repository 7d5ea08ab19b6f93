"""Scenes far from the origin are packed near it, and are the same scenes there."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from raytracer.analysis.explain import explain
from raytracer.core.geometry import Hit
from raytracer.core.motion.trajectory import (
    MAX_STEPS,
    compose,
    conjugate_trajectory,
    decompose,
    max_rotation_radius,
    recentre_rotation,
    row_at,
    translate_trajectory,
)
from raytracer.core.world_origin import to_authored_space
from raytracer.kernel.aovs.base.layers import measure
from raytracer.kernel.aovs.surface import PositionQuantity
from raytracer.plugins.cameras.base.interface import translate_camera as moved_camera
from raytracer.plugins.cameras.base.moving import MovingCamera, pack_camera
from raytracer.plugins.lights.base.interface import Lights
from raytracer.plugins.lights.base.interface import translate_lights as moved_lights
from raytracer.plugins.media.base.interface import translate_media as moved_media
from raytracer.plugins.media.grid import Grid
from raytracer.plugins.media.homogeneous import Homogeneous
from raytracer.scene.load import load
from raytracer.scene.object_bounds import ObjectBounds
from raytracer.scene.pack.layout import lay_out
from raytracer.scene.pack.origin_shift import shift_origin
from raytracer.scene.pack.scene import pack
from raytracer.scene.scene_assets import SceneAssets
from raytracer.schema.registry import LIGHTS, MEDIA
from raytracer.schema.transform import Rotate, Step
from tests.plugins.cameras.kernels import weighted_rays
from tests.plugins.cameras.test_cameras import CASES as CAMERAS
from tests.plugins.cameras.test_cameras import camera
from tests.plugins.lights.kernels import aim, table_of
from tests.plugins.lights.test_kinds import EXAMPLES as LIGHT_EXAMPLES
from tests.plugins.media.kernels import fly_many, packed, transmittance_many
from tests.scene.assets.test_meshes import obj_text, ply_binary, ply_text, stl_text
from tests.scene.gltf_files import accessor, data_uri, gltf_text
from tests.small_scenes import scene
from tests.vectorised import rows, vectorised

ROOT = Path(__file__).parents[3]
GENERATED = ("instances", "million", "next_week")
LARGE = ("frozen_drop", "silky_water", "studio", "no_lens", "pinhole", "focal_lengths", "sensor_sizes", "dolly_zoom")
SHIPPED = [
    pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if path.stem in LARGE else [])
    for path in sorted((ROOT / "scenes").rglob("*.yaml"))
    if path.stem not in GENERATED and path.parent.name != "lenses"
]

BY = (1048576.0, -2097152.0, 524288.0)
"""Powers of two, so that what is moved by them has the same bits when it is moved back."""

FAR = (1_000_000.0, -1_000_000.0, 1_000_000.0)

Array = NDArray[np.float64]


def packed_scene(text, base=None):
    return pack(scene(text, filled=False, base=base))


def at(x, y, z, place=FAR):
    """The text of a point, moved."""
    return str([x + place[0], y + place[1], z + place[2]])


def view(place=FAR, more=""):
    return (
        f"camera: {{type: pinhole, look_from: {at(0, 1, 4, place)}, look_at: {at(0, 0, 0, place)}{more}}}\nobjects:\n"
    )


def ball(place=FAR, more=""):
    return f"  - {{type: sphere, center: {at(0, 0, 0, place)}, radius: 1{more}}}\n"


# ---- When


@pytest.mark.parametrize("path", SHIPPED)
def test_no_shipped_scene_is_moved(path):
    spec = load(path)
    assets = SceneAssets(spec)
    layout = lay_out(spec, assets)
    found, origin = shift_origin(spec, layout, assets)
    assert origin is None
    assert found is layout


@pytest.mark.parametrize("away", [0.0, 1.0, 10.0, 30.0])
def test_what_is_near_keeps_its_place_and_its_bits(away):
    found = packed_scene(view((away, 0, 0)) + ball((away, 0, 0)))
    assert (found.scene.origin, found.shift) == (None, (0.0, 0.0, 0.0))
    assert found.scene.primitives[0].center[0].tolist() == [away, 0.0, 0.0]


def test_what_is_small_and_goes_a_long_way_keeps_its_place():
    # The box of its way is a hundred times as large as it is; the coordinates in its group are no larger for that.
    text = view((0, 0, 0), ", shutter: {open: 0, close: 1}") + ball((0, 0, 0))
    moon = "  - {type: box, min: [5, 0, 0], max: [5.1, 0.1, 0.1], motion: {spin: {axis: [0, 1, 0], rate: 360}}}\n"
    assert packed_scene(text + moon).scene.origin is None


def test_what_is_enlarged_where_it_is_placed_counts_as_large_as_it_is_there():
    # A grain 5 m off its own origin, made a thousand times as large: the coordinates would reach 5 km.
    text = view((0, 0, 0)) + ball((0, 0, 0))
    grain = "groups: {grain: [{type: box, min: [5, 0, 0], max: [5.001, 0.001, 0.001]}]}\n"
    place = "transform: [{translate: [-5, 0, 0]}, {scale: 1000}, {rotate: {axis: [1, 2, 3], angle: 40}}]"
    found = packed_scene(grain + text + f"  - {{type: instance, of: grain, {place}}}\n").scene.origin
    assert found.world == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(found.groups, [[5.0, 0.0, 0.0]], rtol=0.0, atol=2e-3)


@pytest.mark.parametrize("away", [200.0, 1e4, 1e6, 1e9, 1e12])
def test_what_is_far_is_moved_to_where_it_is_seen(away):
    found = packed_scene(view((away, away, 0)) + ball((away, away, 0)))
    (center,) = found.scene.primitives[0].center
    assert np.abs(center).max() <= 4.0
    np.testing.assert_array_equal(np.add(center, found.scene.origin.world), [away, away, 0.0])
    np.testing.assert_allclose(np.subtract(found.scene.camera.frame.origin, center), [0.0, 1.0, 4.0], atol=2e-16 * away)


def test_what_the_camera_sees_close_by_decides():
    text = view() + ball()
    ground = f"  - {{type: sphere, center: {at(0, -1001, 0)}, radius: 1000}}\n"
    lamp = "  - {type: sphere, center: [0, 0, 0], radius: 100, material: {type: emitter, radiance: 1}}\n"
    pebbles = "".join(f"  - {{type: sphere, center: {at(0.1 * n, -0.99, 2)}, radius: 0.01}}\n" for n in range(-5, 5))
    others = "".join(f"  - {{type: sphere, center: [{3 * n}, 0, 0], radius: 1}}\n" for n in range(20))
    for more in (ground + lamp + pebbles, others):
        np.testing.assert_allclose(packed_scene(text + more).scene.origin.world, FAR, atol=8.0)
    # A telephoto view leaves the scene where it is: float32 has to hold the way there in any case.
    tele = f"camera: {{type: pinhole, look_from: {list(FAR)}, look_at: [0, 0, 0], vfov: 1e-4}}\nobjects:\n"
    assert packed_scene(tele + ball((0, 0, 0))).scene.origin is None


def test_explain_says_where():
    text = view(more=", focus_on: ball, aperture: 20").replace("pinhole", "thin_lens") + ball(more=", name: ball")
    found = explain(scene(text, filled=False))
    assert found.effects["recentring"].active
    assert "1000000" in found.effects["recentring"].why
    near = view((0, 0, 0), ", focus_on: ball, aperture: 20").replace("pinhole", "thin_lens")
    same = explain(scene(near + ball((0, 0, 0), ", name: ball"), filled=False))
    assert not same.effects["recentring"].active
    # In its numbers nothing has moved.
    assert found.objects["ball"] == pytest.approx(same.objects["ball"], rel=1e-9)
    assert found.camera == pytest.approx(same.camera, rel=1e-9)


def test_focusing_finds_what_is_seen_far_away():
    text = view(more=", focus_at: [0.5, 0.5], aperture: 20").replace("pinhole", "thin_lens")
    assert packed_scene(text + ball()).spec.camera.focus_distance == pytest.approx(np.sqrt(17.0) - 1.0, rel=1e-6)


# ---- What is moved: every kind


@pytest.mark.parametrize("keys", CAMERAS)
def test_every_camera_moves_with_the_world(keys):
    rng = np.random.default_rng(2)
    x, y = rng.uniform(0, 40, 200), rng.uniform(0, 30, 200)
    own = camera(**keys).pack(40, 30)
    origins, directions, weights = weighted_rays(own, x, y)
    others, theirs, same = weighted_rays(moved_camera(own, BY), x, y)
    seen = weights != 0.0
    np.testing.assert_allclose((others - origins)[seen], np.broadcast_to(BY, (200, 3))[seen], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(theirs[seen], directions[seen], rtol=0.0, atol=1e-15)
    np.testing.assert_array_equal(same, weights)


TURNED = {"rotate": {"axis": [0, 1, 0], "angle": 70}}
MOTIONS = [
    {"velocity": [1, 2, 3]},
    {"spin": {"axis": [1, 2, 3], "rate": 90, "center": [1, 0, 2]}, "velocity": [0, 1, 0]},
    {"keyframes": [{"time": 0, "transform": []}, {"time": 1, "transform": [TURNED]}]},
]


@pytest.mark.parametrize("motion", MOTIONS)
def test_moving_cameras_move_with_the_world(motion):
    exposed = camera(look_from=[0, 1, 4], look_at=[0, 1, 0], shutter={"open": 0, "close": 1}, motion=motion)
    own = pack_camera(exposed, 4, 3)
    assert isinstance(own, MovingCamera)
    other = moved_camera(own, BY)
    for time in np.linspace(0.0, 1.0, 9):
        pose, moved = (compose(row_at(found.trajectories.rows, float(time))) for found in (own, other))
        eye = np.append(own.camera.frame.origin, 1.0)
        there = moved @ np.append(other.camera.frame.origin, 1.0)
        np.testing.assert_allclose((there - pose @ eye)[:3], BY, rtol=0.0, atol=1e-8)
        np.testing.assert_allclose(moved[:3, :3], pose[:3, :3], rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("kind", LIGHTS.specs())
@pytest.mark.parametrize("number", [0, -1])
def test_every_light_moves_with_the_world(kind, number):
    table = table_of(kind, LIGHT_EXAMPLES[kind][number])
    here = aim(Lights((table,), None), None, (0.25, 0.5, -0.125), 100)
    there = (0.25 + BY[0], 0.5 + BY[1], -0.125 + BY[2])
    found = aim(Lights((moved_lights(table, BY),), None), None, there, 100)
    np.testing.assert_allclose(found.direction, here.direction, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(found.weight, here.weight, rtol=1e-12)
    np.testing.assert_array_equal(found.pdf, here.pdf)


MEDIUM_EXAMPLES = {
    "homogeneous": (Homogeneous(absorption=(0.5, 1.0, 2.0), scattering=(0.5, 0.5, 0.5)), {}),
    "grid": (
        Grid(file="x.npy", min=(-1.0, -1.0, -1.0), max=(1.0, 2.0, 1.0), extinction=3.0),
        {"file": np.random.default_rng(1).random((5, 9, 4), np.float32)},
    ),
}


@pytest.mark.parametrize("kind", MEDIA.specs())
def test_every_medium_moves_with_the_world(kind):
    spec, assets = MEDIUM_EXAMPLES[kind]
    own = packed(spec, assets=[assets])
    other = moved_media(own, BY)
    start, way = (0.25, 0.5, -3.0), (0.0, 0.0, 1.0)
    there = tuple(float(x + y) for x, y in zip(start, BY, strict=True))
    flights = [(own, {"origin": start}), (other, {"origin": there})]
    here, found = (fly_many(table, 500, **place, direction=way, distance=5.0) for table, place in flights)
    np.testing.assert_allclose(found[0], here[0], rtol=1e-7)
    np.testing.assert_array_equal(found[1], here[1])
    one, other = (transmittance_many(table, 500, **place, direction=way, distance=5.0) for table, place in flights)
    np.testing.assert_allclose(other, one, rtol=1e-6)


def test_objects_are_where_their_files_say(tmp_path):
    (tmp_path / "map.obj").write_bytes(as_obj(_CORNERS + MAP))
    text = view(MAP) + "  - {type: mesh, file: map.obj, name: town, transform: [{scale: 2}]}\n"
    spec = scene(text, filled=False, base=tmp_path)
    expected = 2.0 * (0.5 * (_CORNERS.min(axis=0) + _CORNERS.max(axis=0)) + MAP)
    np.testing.assert_allclose(ObjectBounds(spec, SceneAssets(spec)).center(0, 0.0), expected, rtol=0.0, atol=2.0**-20)


# ---- As it was written


def test_positions_are_those_of_the_world_as_it_was_written():
    found = packed_scene(view() + ball())
    zero = (0.0, 0.0, 0.0)
    place = tuple(found.scene.primitives[0].center[0].tolist())
    hit = Hit(place, zero, zero, 0.0, 0.0, 0.0, 0, zero, zero, zero)
    assert measure(PositionQuantity(), found.scene, SimpleNamespace(hit=hit)) == FAR


def written(found, instance, points):
    return vectorised(to_authored_space)(found.scene.origin, found.scene.instances, instance, rows(points))


def test_solid_textures_are_looked_up_in_the_world_as_it_was_written():
    found = packed_scene(view() + ball())
    points = np.random.default_rng(3).normal(size=(100, 3))
    local = points + FAR - found.scene.origin.world
    np.testing.assert_allclose(written(found, -1, local), points + FAR, rtol=0.0, atol=2.0**-32)


MAP = (512_000.25, 31.5, 5_240_000.75)
"""Where a mesh lies in the coordinates of a map (m)."""

_CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.125, 0.0], [0.0, 1.0, 0.25], [0.5, 0.5, 1.0]])
_FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def as_obj(vertices):
    return obj_text(_FACES.tolist(), vertices.tolist())


def as_gltf(vertices):
    """What the format keeps in float32 near the origin, a node puts where it belongs."""
    away = vertices[0]
    data = (vertices - away).astype("<f4").tobytes() + _FACES.astype("<u4").tobytes()
    return gltf_text(
        nodes=[{"mesh": 0, "translation": away.tolist()}],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        buffers=[{"uri": data_uri(data), "byteLength": len(data)}],
        bufferViews=[{"buffer": 0, "byteOffset": start, "byteLength": 48} for start in (0, 48)],
        accessors=[*accessor(count=4), {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"}],
    ).encode()


FORMATS = {
    "map.obj": as_obj,
    "map.ply": lambda vertices: ply_binary("<", _FACES.tolist(), vertices.tolist(), "d"),
    "ascii.ply": lambda vertices: ply_text(_FACES.tolist(), vertices.tolist()),
    "map.stl": lambda vertices: stl_text(_FACES.tolist(), vertices.tolist()),
    "map.gltf": as_gltf,
}

FORMS = {
    "baked": "  - {type: mesh, file: NAME}\n",
    "placed": "  - {type: mesh, file: NAME, transform: [{rotate: {axis: [0, 1, 0], angle: 0}}], name: first}\n"
    "  - {type: instance, of: first, transform: [{translate: [2, 0, 0]}]}\n",
    "spinning": "  - {type: mesh, file: NAME, motion: {spin: {axis: [0, 1, 0], rate: 30, center: PLACE}}}\n",
    "keyed": "  - {type: mesh, file: NAME, motion: {keyframes: [{time: 0, transform: []}, "
    "{time: 0.25, transform: [{translate: [0, 1, 0]}]}, {time: 1, transform: [{translate: [0, 1, 1]}]}]}}\n",
    "deforming": "  - {type: mesh, frames: [{time: 0, file: NAME}, {time: 1, file: other.obj}]}\n",
}


def corners_in_the_world(found, time):
    """Return the first object's vertices as the scene was written, by what Embree has and where that is placed."""
    table, instances = found.scene.primitives[0], found.scene.instances
    vertices = np.asarray(table.vertices, np.float64)
    if vertices.ndim == 3:
        vertices = vertices[0] + time * (vertices[1] - vertices[0])
    pose = np.eye(4)
    if instances is not None and instances.trajectories is not None:
        pose = compose(row_at(instances.trajectories.rows, time))
    elif instances is not None:
        pose[:3] = instances.pose[0]
    return np.asarray(vertices @ pose[:3, :3].T + pose[:3, 3] + found.scene.origin.world)


MESHES = [*((name, form) for name in FORMATS for form in ("baked", "spinning")), *(("map.obj", form) for form in FORMS)]


@pytest.mark.parametrize(("name", "form"), sorted(set(MESHES)))
def test_meshes_in_the_coordinates_of_a_map_keep_their_form(tmp_path, name, form):
    vertices = _CORNERS + MAP
    (tmp_path / name).write_bytes(FORMATS[name](vertices))
    (tmp_path / "other.obj").write_bytes(as_obj(np.add(vertices, [0.0, 0.0, 1.0])))
    text = FORMS[form].replace("NAME", name).replace("PLACE", str(list(MAP)))
    found = packed_scene(view(MAP, ", shutter: {open: 0, close: 1}") + text, tmp_path)
    for time in (0.0, 0.5, 1.0):
        expected = vertices
        if form == "spinning":
            turn = Step(rotate=Rotate(axis=(0.0, 1.0, 0.0), angle=30.0 * time)).matrix()[:3, :3]
            expected = _CORNERS @ turn.T + MAP
        if form == "keyed":
            expected = vertices + np.array([0.0, min(1.0, 4.0 * time), max(0.0, (time - 0.25) / 0.75)])
        if form == "deforming":
            expected = vertices + np.array([0.0, 0.0, time])
        there = corners_in_the_world(found, time)
        # Float32 near the origin is good to 2^-22 m; written out there, its numbers are 0.5 m apart.
        near = np.linalg.norm(there[:, None] - expected, axis=2).min(axis=0)
        assert near.max() <= 2.0**-22
        assert np.abs(np.float32(expected) - expected).max() > 0.1


def test_what_lies_far_in_its_group_is_moved_in_the_group(tmp_path):
    (tmp_path / "map.obj").write_bytes(as_obj(_CORNERS + MAP))
    back = str([-x for x in MAP])
    text = (
        "groups: {town: [{type: mesh, file: map.obj}]}\n"
        "camera: {type: pinhole, look_from: [0, 1, 4], look_at: [0, 0, 0]}\n"
        f"objects:\n  - {{type: instance, of: town, transform: [{{translate: {back}}}, {{rotate: {{axis: [0, 1, 0], "
        "angle: 30}}, {scale: [1, 2, 1]}]}\n"
    )
    found = packed_scene(text, tmp_path)
    assert found.scene.origin.world == (0.0, 0.0, 0.0)
    assert np.abs(found.scene.primitives[0].vertices).max() <= 2.0
    turn = Step(rotate=Rotate(axis=(0.0, 1.0, 0.0), angle=30.0)).matrix()[:3, :3]
    expected = _CORNERS @ turn.T * [1.0, 2.0, 1.0]
    np.testing.assert_allclose(corners_in_the_world(found, 0.0), expected, rtol=0.0, atol=2.0**-21)
    # In the group's own space textures are looked up as before.
    local = np.asarray(found.scene.primitives[0].vertices, np.float64)
    np.testing.assert_allclose(written(found, 0, local), _CORNERS + MAP, rtol=0.0, atol=2.0**-23)


# ---- Trajectories


def _arc(center, degrees, steps=2):
    """What turns about a point, in a plane."""
    rows = []
    for fraction in np.linspace(0.0, 1.0, steps):
        row = decompose(Step(rotate=Rotate(axis=(0.0, 0.0, 1.0), angle=float(degrees * fraction))).matrix())
        row[6:9], row[13:16] = -np.asarray(center), center
        rows.append(row)
    return np.array(rows)


def test_displacements_before_and_after_a_trajectory():
    rows, before, after = _arc((1.0, 2.0, 3.0), 80.0), (0.5, -1.0, 2.0), (3.0, 0.0, -7.0)
    rows[:, :6] = [2.0, 3.0, 0.5, 0.25, -0.5, 1.0]
    for fraction in (0.0, 0.3, 1.0):
        first, last = np.eye(4), np.eye(4)
        first[:3, 3], last[:3, 3] = before, after
        expected = last @ compose(row_at(rows, fraction)) @ first
        found = compose(row_at(translate_trajectory(rows, before, after), fraction))
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-14)
        opposite = compose(row_at(conjugate_trajectory(rows, after), fraction))
        first[:3, 3] = np.negative(after)
        np.testing.assert_allclose(opposite, last @ compose(row_at(rows, fraction)) @ first, rtol=0.0, atol=1e-13)


def test_a_pivot_far_away_is_replaced_by_straight_parts():
    # An eighth of a degree about a point 10 km away: 22 m of way, and 4 cm by which a float32 angle is wrong.
    rows = _arc((1e4, 0.0, 0.0), 0.125)
    found = recentre_rotation(rows, 2.0**-18)
    assert len(found) == MAX_STEPS
    assert max_rotation_radius(rows) == 1e4
    assert max_rotation_radius(found) == 0.0
    angle = np.radians(0.125) / (MAX_STEPS - 1)
    for fraction in np.linspace(0.0, 1.0, 1001):
        expected, there = (compose(row_at(some, float(fraction))) for some in (rows, found))
        assert np.abs(there - expected).max() <= 1e4 * angle**2 / 8.0 + 1e-11


def test_what_moves_without_turning_needs_no_more_steps():
    rows = _arc((1e6, 0.0, 0.0), 0.0, 3)
    rows[:, 13] += [0.0, 1.0, 3.0]
    found = recentre_rotation(rows, 2.0**-18)
    np.testing.assert_array_equal(found[:, 13:16], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    assert max_rotation_radius(found) == 0.0
    # Where straight parts were worse, a pivot far away stays.
    rows = _arc((1e4, 0.0, 0.0), 90.0, 7)
    assert recentre_rotation(rows, 2.0**-18) is rows
