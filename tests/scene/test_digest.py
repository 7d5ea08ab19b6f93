"""What a picture depends on: files that scenes name, and files that these name; hashes and bundles of them."""

import importlib.metadata
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from raytracer.scene import digest as digest_module
from raytracer.scene.assets import companion_files, read_mesh
from raytracer.scene.bundle import Bundle, bundle, unbundle
from raytracer.scene.digest import digest
from raytracer.scene.files import input_files
from raytracer.scene.load import build, load
from raytracer.util.errors import InputError
from raytracer.util.path_sandbox import ROOT_MARKER
from tests.scene.gltf_files import CORNERS, data_uri, write_gltf

PLAIN = """\
camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}
film: {width: 8, height: 6}
objects:
  - {type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: {type: lambertian}}
"""

FILES = """\
camera: {type: thin_lens, look_from: [0, 0, 4], vfov: 40, aperture: 10 mm,
         aperture_shape: {type: image, file: data/mask.png}}
film: {width: 8, height: 6}
environment: {type: image, file: SKY}
textures: {dots: {type: image, file: data/mask.png}}
materials: {dotted: {type: mixture, materials: [{type: lambertian, albedo: {type: image, file: other.png}}, dots]},
            dots: {type: lambertian, albedo: dots}}
media: {smoke: {type: grid, file: data/smoke.npy}}
groups: {pair: [{type: mesh, file: ../meshes/box.gltf}]}
objects:
  - {type: instance, of: pair, placements: places.csv}
  - {type: mesh, frames: [{time: 0, file: tri.obj}, {time: 1, file: ./tri.obj}], material: dotted}
"""

NAMED = [
    (("camera", "aperture_shape", "file"), "data/mask.png"),
    (("environment", "file"), "SKY"),
    (("textures", "dots", "file"), "data/mask.png"),
    (("materials", "dotted", "materials", 0, "albedo", "file"), "other.png"),
    (("media", "smoke", "file"), "data/smoke.npy"),
    (("groups", "pair", 0, "file"), "../meshes/box.gltf"),
    (("groups", "pair", 0, "file"), "../meshes/bins/a b.bin"),
    (("groups", "pair", 0, "file"), "../meshes/../shared/skin.png"),
    (("objects", 0, "placements"), "places.csv"),
    (("objects", 1, "frames", 0, "file"), "tri.obj"),
    (("objects", 1, "frames", 1, "file"), "./tri.obj"),
]


def picture(path, value=128):
    import PIL.Image

    path.parent.mkdir(parents=True, exist_ok=True)
    PIL.Image.new("RGB", (2, 2), (value, value, value)).save(path)


def gltf(path, buffer="bins/a%20b.bin", image="../shared/skin.png"):
    """A triangle in a glTF file, its numbers and its picture in files that it names."""
    (path.parent / "bins").mkdir(parents=True, exist_ok=True)
    (path.parent / "bins" / "a b.bin").write_bytes(CORNERS.tobytes())
    write_gltf(
        path,
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0}],
        images=[{"uri": image}],
        buffers=[{"uri": buffer, "byteLength": 36}],
    )


@pytest.fixture
def folder(tmp_path):
    """A scene's folder with all that `FILES` names."""
    home = tmp_path / "home"
    (tmp_path / ROOT_MARKER).touch()
    for name in ("data/mask.png", "other.png"):
        picture(home / name)
    picture(tmp_path / "shared" / "skin.png")
    picture(tmp_path / "sky" / "sky.png")
    gltf(tmp_path / "meshes" / "box.gltf")
    np.save(home / "data" / "smoke.npy", np.ones((2, 2, 2), np.float32))
    (home / "places.csv").write_text("x,y,z\n0,0,0\n1,0,0\n")
    (home / "tri.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nmtllib paint.mtl\n")
    (home / "scene.yaml").write_text(FILES.replace("SKY", str(tmp_path / "sky" / "sky.png")))
    return home


def scene_in(folder):
    return load(folder / "scene.yaml")


# ---- Files


def test_all_files_are_told_and_those_that_files_name(folder):
    scene = scene_in(folder)
    sky = str(folder.parent / "sky" / "sky.png")
    found = input_files(scene)
    by_scene = [(keys, name) for keys, name in NAMED if not name.startswith(("../meshes/bins", "../meshes/.."))]
    assert [(item.keys, item.name.replace(sky, "SKY")) for item in found if item.kind != "companion"] == by_scene
    companion = {os.path.realpath(item.path) for item in found if item.kind == "companion"}
    root = folder.parent.resolve()
    assert companion == {str(root / "meshes" / "bins" / "a b.bin"), str(root / "shared" / "skin.png")}
    assert all(item.path.is_file() for item in found)


def test_a_glb_file_or_one_with_its_data_inside_names_no_others(tmp_path):
    gltf(tmp_path / "in.gltf", data_uri(CORNERS.tobytes()), "missing.png")
    assert companion_files("mesh", tmp_path / "in.gltf") == ()
    (tmp_path / "broken.glb").write_bytes(b"glTF" + bytes(4))
    assert companion_files("mesh", tmp_path / "broken.glb") == ()
    assert companion_files("mesh", tmp_path / "nowhere.gltf") == ()
    assert companion_files("grid", tmp_path / "in.gltf") == ()


# ---- Digest


def test_what_says_the_same_has_one_digest():
    scene = build(PLAIN, "a.yaml")
    for text in (
        PLAIN.replace("vfov: 40", "vfov: 40.0 deg"),
        PLAIN.replace("8, height: 6", "8, height: 6.0") + "# a comment\n",
        PLAIN.replace("{width: 8, height: 6}", "{height: 6, width: 8}"),
    ):
        assert digest(build(text, "b.yaml")) == digest(scene)
    assert len(digest(scene)) == 64


def test_what_says_another_thing_has_another():
    seen = {digest(build(PLAIN, "a.yaml"))}
    for text in (
        PLAIN.replace("vfov: 40", "vfov: 40.000001"),
        PLAIN.replace("radius: 1,", "radius: 2,"),
        PLAIN.replace("type: lambertian", "type: metal"),
        PLAIN.replace("type: lambertian", "type: lambertian, bump: null"),
        PLAIN + "medium: null\n",
        PLAIN + "materials: {a: {type: metal}}\n",
        PLAIN + "materials: {b: {type: metal}}\n",
    ):
        found = digest(build(text, "a.yaml"))
        assert found not in seen
        seen.add(found)


def test_settings_count_unless_they_are_none():
    scene = build(PLAIN, "a.yaml")
    assert digest(scene, spp=None, crop=None) == digest(scene)
    assert digest(scene, crop=(0, 0, 1, 1)) == digest(scene, crop=[0, 0, 1, 1])
    assert len({digest(scene, **given) for given in ({}, {"spp": 1}, {"seed": 1}, {"spp": 2}, {"noise": 0.1})}) == 5
    with pytest.raises(TypeError):
        digest(scene, spp=object())


def test_the_program_and_the_libraries_that_compute_and_read_files_count(monkeypatch):
    scene, version = build(PLAIN, "a.yaml"), importlib.metadata.version
    seen, changed = {digest(scene)}, set()
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "0.1" if name in changed else version(name))
    for library in ("numba", "embreex", "Pillow", "OpenEXR"):
        changed.add(library)
        digest_module.program_hash.cache_clear()
        seen.add(digest(scene))
    digest_module.program_hash.cache_clear()
    assert len(seen) == 5


def test_an_overridden_scene_has_the_digest_of_one_that_was_loaded_so():
    scene = build(PLAIN, "a.yaml")
    digest(scene)
    for overrides in ({"camera.vfov": 20}, {"objects.ball.radius": 2}, {"objects.ball.radius": 3}):
        assert digest(scene.replace(overrides)) == digest(build(PLAIN, "a.yaml", overrides))


def test_scenes_that_share_their_first_object_differ_by_the_others():
    scene = build(PLAIN, "a.yaml")
    second = build(PLAIN.replace("ball", "other"), "a.yaml").objects[0]
    third = build(PLAIN.replace("ball", "other").replace("radius: 1", "radius: 2"), "a.yaml").objects[0]
    scenes = [scene.model_copy(update={"objects": (*scene.objects, other)}) for other in (second, third)]
    assert len({digest(one) for one in (scene, *scenes)}) == 3


def test_what_each_file_holds_counts(folder):
    before = digest(scene_in(folder))
    assert digest(scene_in(folder)) == before
    for _, name in NAMED:
        path = folder.parent / "sky" / "sky.png" if name == "SKY" else folder / name
        data, status = path.read_bytes(), path.stat()
        path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
        # With its time put back.
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
        assert digest(scene_in(folder)) != before, name
        path.write_bytes(data)
    assert digest(scene_in(folder)) == before


def test_which_picture_of_a_file_counts(tmp_path):
    (tmp_path / "m.glb").write_bytes(b"glTF" + bytes(8))
    material = "{type: lambertian, albedo: {type: image, file: 'm.glb#NUMBER'}}"
    texts = (PLAIN.replace("{type: lambertian}", material.replace("NUMBER", number)) for number in "01")
    assert len({digest(build(text, "a.yaml", base=tmp_path)) for text in texts}) == 2


def test_what_a_file_is_called_does_not_count_but_which_places_share_it_does(folder):
    before = digest(scene_in(folder))
    text = (folder / "scene.yaml").read_text()
    shutil.copy(folder / "other.png", folder / "another.png")
    (folder / "scene.yaml").write_text(text.replace("other.png", "another.png"))
    assert digest(scene_in(folder)) == before
    (folder / "scene.yaml").write_text(text.replace("./tri.obj", "tri.obj"))
    assert digest(scene_in(folder)) != before


def test_a_file_that_went_away_is_told_by_its_key(folder):
    scene = scene_in(folder)
    (folder / "other.png").unlink()
    for ask in (digest, bundle):
        with pytest.raises(InputError, match=r"scene\.yaml:6: materials\.dotted.*'other\.png' cannot be read: No such"):
            ask(scene)


# ---- Bundles


def test_a_bundle_holds_all_that_the_scene_reads(folder, tmp_path):
    scene = scene_in(folder)
    expected = digest(scene)
    packed = bundle(scene)
    for name in ("home", "meshes", "shared", "sky"):
        shutil.rmtree(folder.parent / name)
    there = unbundle(packed, tmp_path / "there")
    assert digest(there) == expected
    assert all(item.path.resolve().is_relative_to((tmp_path / "there").resolve()) for item in input_files(there))
    assert len(read_mesh(there.base / there.groups["pair"][0].file).faces) == 1
    # Names that were one are one, and names that were two are two: what is stored once stays so.
    first, second = (frame.file for frame in there.objects[1].frames)
    assert first != second
    assert there.camera.aperture_shape.file == there.textures["dots"].file
    assert str(tmp_path) not in packed.text
    with pytest.raises(InputError, match=r"scene\.yaml:\d+: camera\.vfov: wrong"):
        raise there.error("wrong", "camera", "vfov")
    # Once more, over what is there.
    assert digest(unbundle(packed, tmp_path / "there")) == expected


@pytest.mark.parametrize("name", ["../evil", "/evil", "a/../../evil", "link/evil"])
def test_nothing_is_written_outside_of_the_folder(tmp_path, name):
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "in" / "link").symlink_to(tmp_path / "out")
    with pytest.raises(InputError, match="outside"):
        unbundle(Bundle(PLAIN, "a.yaml", {name: b"!"}), tmp_path / "in")
    assert not list(tmp_path.rglob("evil"))
    assert not Path("/evil").exists()


def test_a_mesh_that_names_a_file_by_its_absolute_path_cannot_travel(folder):
    gltf(folder.parent / "meshes" / "box.gltf", image=str(folder / "other.png"))
    with pytest.raises(
        InputError, match=r"groups\.pair\[0\]\.file: '\.\./meshes/box\.gltf' names a file by its absolute"
    ):
        bundle(scene_in(folder))
