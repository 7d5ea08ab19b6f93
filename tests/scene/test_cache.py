"""What renders of like scenes share is what each would have made for itself, and is made once."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from raytracer.core.geometry import Geometry, Primitive, pad_buffer
from raytracer.rendering import statistics
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import prepare_scene, render, render_prepared
from raytracer.rendering.statistics import PhaseTimer
from raytracer.scene import cache as cache_module
from raytracer.scene.assets import LOADERS
from raytracer.scene.cache import RenderCache, is_identical
from raytracer.scene.load import load
from raytracer.scene.overrides import apply_overrides
from raytracer.scene.pack.scene import pack
from raytracer.scene.scene_assets import AccelInput
from raytracer.util.errors import InputError
from tests.repository import ROOT
from tests.scene.assets.test_meshes import ply_text
from tests.scene.gltf_files import CORNERS, write_gltf
from tests.small_scenes import scene

# Something of each that packing keeps: textures, media, solids that overlap, a moving object, instances, a sky, files.
_RICH = """
camera:
  {type: thin_lens, look_from: [0, 1, 6], look_at: [0, 0.5, 0], vfov: 40, focus_distance: 5, aperture: 20 mm,
   shutter: {open: 0, close: 0.1}}
film: {width: 8, height: 8}
render: {spp: 8}
environment: {type: image, file: sky.npy}
textures: {squares: {type: checker, scale: 0.5, even: 0.2, odd: 0.8}, wood: {type: image, file: wood.png}}
materials:
  floor: {type: lambertian, albedo: squares}
  board: {type: lambertian, albedo: wood}
  glass: {type: dielectric, priority: 2}
  water: {type: dielectric, ior: 1.33, priority: 1, absorption: [0.1, 0.2, 0.3]}
media: {haze: {type: homogeneous, scattering: 0.01}}
medium: haze
groups:
  pair: [{type: sphere, center: [0, 0, 0], radius: 0.1}, {type: box, min: [0, 0, 0], max: [0.1, 0.1, 0.1]}]
objects:
  - {type: quad, name: floor, corner: [-9, 0, -9], edges: [[0, 0, 18], [18, 0, 0]], material: floor}
  - {type: mesh, name: tree, file: mesh.ply, material: board}
  - {type: sphere, name: drop, center: [0, 0.5, 1], radius: 0.5, material: water}
  - {type: sphere, center: [0.4, 0.5, 1], radius: 0.4, material: glass}
  - {type: sphere, center: [-2, 0.5, 0], radius: 0.5, material: floor, motion: {velocity: [1, 0, 0]}}
  - {type: instance, of: pair, transform: [{translate: [1, 2, 0]}]}
lights: [{type: point, position: [0, 5, 0], intensity: 3}]
"""


@pytest.fixture
def rich(tmp_path):
    """A scene with files."""
    import PIL.Image

    _write_mesh(tmp_path / "mesh.ply", 1.0)
    PIL.Image.fromarray(np.full((4, 4, 3), 90, np.uint8)).save(tmp_path / "wood.png")
    np.save(tmp_path / "sky.npy", np.linspace(0.1, 1.0, 8 * 16 * 3, dtype=np.float32).reshape(8, 16, 3))
    (tmp_path / "rich.yaml").write_text(_RICH)
    return tmp_path / "rich.yaml"


def _write_mesh(path, height):
    path.write_bytes(ply_text([(0, 1, 2), (0, 2, 3)], [(0, 0, 0), (1, 0, 0), (1, height, 0), (0, height, 0)]))


def _alone(spec):
    return pack(spec)._replace(built=None)


# Overrides that leave the world as it is, and those that do not.
_SEEN_OTHERWISE = [
    {"camera.aperture": "5 mm"},
    {"camera.aperture": 0},
    {"camera.focus_distance": 2},
    {"camera.focus_on": "tree", "camera.focus_distance": None},
    {"camera.vfov": 20},
    {"camera.look_at": [0.5, 0.5, 0.0]},
    {"film.width": 20, "film.filter": "mitchell"},
    {"render.max_depth": 1},
    {"render.light_sampling": "paths", "lights": []},
    {"render.sampler": "stratified", "render.spp": 16, "render.seed": 7},
    {"render.accuracy": "fast"},
    {"render.clamp": 5},
]
_ANOTHER_WORLD = [
    {"camera.look_from": [0.0, 0.6, 1.0]},
    {"camera.look_from": [3.0e6, 0.0, 0.0], "camera.look_at": [0.0, 0.0, 0.0]},
    {"camera.shutter": {"open": 0.0, "close": 0.0}},
    {"camera.shutter": {"open": 0.05, "close": 0.2}},
    {"materials.floor.albedo": 0.3},
    {"objects.2.radius": 0.25},
    {"environment.rotation": 30},
]


def test_what_is_packed_from_a_cache_is_what_is_packed_anew(rich):
    cache, spec = RenderCache(), load(rich)
    every = [*_SEEN_OTHERWISE, *_ANOTHER_WORLD, *_SEEN_OTHERWISE[:2]]
    for overrides in every:
        changed = apply_overrides(spec, overrides)
        assert is_identical(pack(changed, provider=cache)._replace(built=None), _alone(changed)), overrides
    assert cache.counts.files_read == 3
    assert cache.counts.worlds_packed == 1 + len(_ANOTHER_WORLD)


def test_settings_that_a_scene_did_not_set_are_told_from_those_it_did():
    ball = "camera: {type: pinhole}\nobjects: [{type: sphere, center: [0, 0, 0.0], radius: 1}]"
    one, other = (scene(text, filled=False).objects for text in (ball, ball.replace("1}", "1, name: null}")))
    assert not is_identical(one, other)
    assert is_identical(one, one[:1])


ALIKE = [
    ((1.0, 2.0), (1.0, 2.0)),
    ({"a": 1, "b": 2}, {"a": 1, "b": 2}),
    (np.array([np.nan, 0.0]), np.array([np.nan, 0.0])),
]
UNLIKE = [
    (0.0, -0.0),
    (1, 1.0),
    ((1.0, 2.0), (1.0, 2.0, 3.0)),
    ({"a": 1, "b": 2}, {"b": 2, "a": 1}),
    (np.array([0.0]), np.array([-0.0])),
    (np.zeros(2, np.float32), np.zeros(2)),
    (np.zeros((2, 1)), np.zeros((1, 2))),
    (np.array([True, False]), np.array([True, True])),
]


def test_the_same_is_the_same_to_the_last_bit():
    assert all(is_identical(one, other) for one, other in ALIKE)
    assert not any(is_identical(one, other) for one, other in UNLIKE)


# ---- Files


def test_a_file_is_read_once_until_it_changes(tmp_path):
    cache, path = RenderCache(), tmp_path / "mesh.ply"
    _write_mesh(path, 1.0)
    first = cache.read("mesh", path)
    assert cache.read("mesh", path) is first
    _write_mesh(path, 2.5)
    second = cache.read("mesh", path)
    assert second.vertices.max() == 2.5
    # As long and as old as it was, but another file.
    status = path.stat()
    _write_mesh(tmp_path / "other.ply", 3.5)
    os.utime(tmp_path / "other.ply", ns=(status.st_atime_ns, status.st_mtime_ns))
    os.replace(tmp_path / "other.ply", path)
    assert cache.read("mesh", path).vertices.max() == 3.5
    assert cache.counts.files_read == 3
    # As large as before, in its place, and with its time put back.
    _write_mesh(path, 4.5)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert cache.read("mesh", path).vertices.max() == 4.5
    path.unlink()
    with pytest.raises(InputError, match="no such file"):
        cache.read("mesh", path)


def test_a_changed_file_is_another_world(rich):
    cache, spec = RenderCache(), load(rich)
    before = pack(spec, provider=cache)
    _write_mesh(rich.parent / "mesh.ply", 0.5)
    after = pack(spec, provider=cache)
    assert is_identical(after._replace(built=None), _alone(spec))
    assert not is_identical(before.objects.geometries, after.objects.geometries)
    (rich.parent / "wood.png").unlink()
    with pytest.raises(InputError, match=r"wood\.png: no such file"):
        pack(spec, provider=cache)


def test_a_mesh_is_read_again_when_a_file_that_it_names_changes(tmp_path):
    cache, path = RenderCache(), tmp_path / "triangle.gltf"
    write_gltf(path, buffers=[{"uri": "points.bin", "byteLength": 36}])
    (tmp_path / "points.bin").write_bytes(CORNERS.tobytes())
    assert cache.read("mesh", path).vertices.max() == 1.0
    assert cache.read("mesh", path).vertices.max() == 1.0
    assert cache.counts.files_read == 1
    (tmp_path / "points.bin").write_bytes((2 * CORNERS).tobytes())
    os.utime(tmp_path / "points.bin", ns=(1, 1))
    assert cache.read("mesh", path).vertices.max() == 2.0


def test_many_threads_read_a_file_once(tmp_path, monkeypatch):
    together, count = threading.Barrier(4), 4
    read = []
    path = tmp_path / "a.npy"
    path.write_bytes(b"")

    def load(path):
        read.append(path)
        return object()

    monkeypatch.setattr(cache_module, "LOADERS", {**LOADERS, "grid": load})
    cache = RenderCache()

    def work(_):
        together.wait()
        return cache.read("grid", path)

    with ThreadPoolExecutor(count) as pool:
        found = set(map(id, pool.map(work, range(count))))
    assert len(read) == len(found) == 1


# ---- Structures


def _triangle(size):
    corners = pad_buffer(size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.float32)
    return {0: Geometry(Primitive.TRIANGLE, (corners,), pad_buffer(np.array([[0, 1, 2]]), np.uint32))}


def _structure(cache, size=1.0, *, first_instance=1, robust=True):
    return cache.build_accel(AccelInput(_triangle(size), (), (), first_instance, robust))


def test_a_structure_is_built_once_for_the_same_geometry():
    cache = RenderCache()
    first = _structure(cache)
    assert _structure(cache) is first
    assert _structure(cache, robust=False) is not first
    assert _structure(cache, 0.5) is not first
    assert _structure(cache, first_instance=2) is not first
    assert cache.counts.structures_built == 4
    assert _structure(cache).cast([0.1, 0.1, 1.0], [0.0, 0.0, -1.0]).distance == pytest.approx(1.0)


def test_what_was_not_used_for_longest_goes(monkeypatch):
    # Room for two triangles of 36 and 12 bytes.
    monkeypatch.setattr(cache_module, "_MAX_GEOMETRY_BYTES", 100)
    cache = RenderCache()
    for size in (1.0, 2.0, 1.0, 3.0):
        _structure(cache, size)
    assert cache.counts.structures_built == 3
    _structure(cache, 1.0)
    assert cache.counts.structures_built == 3
    _structure(cache, 2.0)
    assert cache.counts.structures_built == 4
    # What is heavier than all that is kept is kept as long as it is used.
    monkeypatch.setattr(cache_module, "_MAX_GEOMETRY_BYTES", 1)
    cache = RenderCache()
    assert _structure(cache) is _structure(cache)


def test_kernels_that_there_were_are_not_counted():
    cache = RenderCache()
    spec = scene(_SPHERE, lit=True)
    prepare_scene(spec)
    prepare_scene(spec, cache=cache)
    assert cache.counts == (0, 1, 1, 0)


# ---- Renders

_SPHERE = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}
"""


def test_pictures_from_a_cache_have_the_bits_of_others():
    cache = RenderCache()
    first = scene(_SPHERE, lit=True)
    for overrides in ({"camera.vfov": 30}, {"objects.0.radius": 0.5}, {"camera.vfov": 25}, {}):
        spec = apply_overrides(first, overrides)
        shared = render(spec, spp=8, threads=2, cache=cache).image
        assert np.array_equal(shared.radiance, render(spec, spp=8, threads=2).image.radiance)
    assert cache.counts[1:3] == (2, 2)


def test_what_is_ready_may_be_rendered_again():
    spec = scene(_SPHERE, lit=True)
    prepared = prepare_scene(spec, RenderOptions(spp=8, threads=2))
    one, other = render_prepared(prepared), render_prepared(prepared)
    assert np.array_equal(one.image.radiance, other.image.radiance)
    assert not np.shares_memory(one.image.radiance, other.image.radiance)
    assert set(prepared.seconds) == {"load", "pack", "build", "compile"}
    assert set(one.stats.seconds) == {*prepared.seconds, "render", "develop", "total"}


def test_the_picture_of_a_dry_run_is_not_overwritten():
    kept = []
    spec = scene(_SPHERE, lit=True)

    def save(image):
        kept.extend([image, image.radiance.copy()])

    final = render(spec, spp=16, threads=2, time_limit=600.0, dry_run_save=save)
    saved, then = kept
    assert np.array_equal(saved.radiance, then)
    assert not np.array_equal(saved.radiance, final.image.radiance)


def test_a_pause_before_a_render_does_not_count(monkeypatch):
    seconds = iter([100.0, 107.0])
    monkeypatch.setattr(statistics, "now", lambda: next(seconds))
    phases = {"load": 2.0, "build": 1.0}
    timer = PhaseTimer(phases)
    assert timer.start_time == 97.0
    timer.lap("render")
    assert phases == {"load": 2.0, "build": 1.0, "render": 7.0}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cover", "cornell", "nested", "textures", "studio", "smoke", "bouncing", "fan"])
def test_shipped_scenes_are_packed_from_a_cache_as_anew(name):
    cache, spec = RenderCache(), load(ROOT / "scenes" / f"{name}.yaml")
    for overrides in ({}, {"film.width": 30}, {"render.max_depth": 2}, {"camera.look_at": [0.1, 0.2, 0.3]}, {}):
        changed = apply_overrides(spec, overrides)
        assert is_identical(pack(changed, provider=cache)._replace(built=None), _alone(changed)), overrides
    assert cache.counts.worlds_packed == 1
