"""glTF files bring their materials: what the specification says lands in the scene, and what is broken is told."""

import base64
import io
import json
import struct

import numpy as np
import PIL.Image
import pytest

from raytracer.scene.assets import read_image, read_mesh
from raytracer.scene.assets.gltf import read_image_bytes
from raytracer.scene.assets.gltf_materials import read_materials
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import InputError, SceneError
from tests.scene.gltf_files import data_uri, gltf_text

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
# In glTF the first texel is at (0, 0), and v runs downwards.
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
FACES = np.array([0, 1, 2, 0, 2, 3], np.uint16)


def png(pixels):
    file = io.BytesIO()
    PIL.Image.fromarray(np.array(pixels, np.uint8)).save(file, "PNG")
    return file.getvalue()


COLORS = png([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]])
HOLES = png([[[200, 200, 200, 255], [200, 200, 200, 0]]])
TEXTURED = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}


def document(materials, *, used=None, images=(), samplers=({},), **more):
    """A file of one square for each of the materials `used` (all by default), with a texture for each image."""
    data = CORNERS.tobytes() + UV.tobytes() + FACES.tobytes()
    square = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}
    which = list(range(len(materials or []))) if used is None else used
    parts = [{**square, **({} if item is None else {"material": item})} for item in which or [None]]
    views = [{"buffer": 0, "byteOffset": start, "byteLength": n} for start, n in ((0, 48), (48, 32), (80, 12))]
    kinds = ((5126, 4, "VEC3"), (5126, 4, "VEC2"), (5123, 6, "SCALAR"))
    if materials is not None:
        more = {"materials": materials, **more}
    if images:
        textures = [{"source": number, "sampler": 0} for number in range(len(images))]
        files = [{"uri": data_uri(image, "image/png")} for image in images]
        more = {"images": files, "textures": textures, "samplers": list(samplers), **more}
    accessors = [
        {"bufferView": view, "componentType": kind, "count": count, "type": shape}
        for view, (kind, count, shape) in enumerate(kinds)
    ]
    buffers = [{"byteLength": len(data), "uri": data_uri(data)}]
    meshes = [{"primitives": parts}]
    return json.loads(gltf_text(meshes=meshes, buffers=buffers, bufferViews=views, accessors=accessors, **more))


@pytest.fixture
def written(tmp_path):
    """Write a file of `document`s."""

    def write(content):
        path = tmp_path / "model.gltf"
        path.write_text(json.dumps(content))
        return path

    return write


@pytest.fixture
def only(written):
    """Read a file's one material."""
    return lambda material, **more: read_materials(written(document([material], **more)), "model.gltf")[0]


SCENE = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0]}
film: {width: 4, height: 4}
objects:
  - {type: mesh, file: model.gltf}
"""


@pytest.fixture
def packed(written):
    def make(content, scene=SCENE):
        return pack(build(scene, "scene.yaml", base=written(content).parent)).scene

    return make


# ---- Values

DEFAULT = {
    "type": "principled",
    "base_color": [1.0, 1.0, 1.0],
    "metallic": 1.0,
    "roughness": 1.0,
    "ior": 1.5,
    "two_sided": False,
}


def test_defaults_are_the_specifications_and_factors_and_extensions_land(only):
    assert only({}) == DEFAULT
    pbr = {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.25}
    extensions = {
        "KHR_materials_emissive_strength": {"emissiveStrength": 8.0},
        "KHR_materials_ior": {"ior": 1.33},
        "KHR_materials_transmission": {"transmissionFactor": 0.75},
    }
    given = {"pbrMetallicRoughness": pbr, "emissiveFactor": [1.0, 0.5, 0.0], "doubleSided": True}
    assert only({**given, "extensions": extensions}) == {
        "type": "principled",
        "base_color": [0.1, 0.2, 0.3],
        "metallic": 0.5,
        "roughness": 0.25,
        "emission": [8.0, 4.0, 0.0],
        "transmission": 0.75,
        "ior": 1.33,
        "two_sided": True,
    }


def test_textures_keep_channels_factors_and_wrapping(only):
    pbr = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}, "roughnessFactor": 0.5}
    material = {"pbrMetallicRoughness": pbr, "normalTexture": {"index": 0, "scale": 0.5}}
    found = only(material, images=(COLORS, COLORS), samplers=[{"wrapS": 33071, "wrapT": 33648}])
    image = {"type": "image", "wrap": ["clamp", "mirror"]}
    assert found["base_color"] == {**image, "file": "model.gltf#0"}
    assert found["metallic"] == {**image, "file": "model.gltf#1", "channel": "b"}
    assert found["roughness"] == {**image, "file": "model.gltf#1", "channel": "g", "factor": 0.5}
    assert (found["normal_map"], found["normal_scale"]) == ({**image, "file": "model.gltf#0"}, 0.5)


def test_alpha_is_a_cutout(only):
    base = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.5]}}
    assert only(base, images=(HOLES,))["type"] == "principled"
    blend = only({**base, "alphaMode": "BLEND"}, images=(HOLES,))
    assert blend["opacity"] == {"type": "image", "file": "model.gltf#0", "channel": "a", "factor": 0.5}
    assert "threshold" not in blend
    assert only({**base, "alphaMode": "MASK"}, images=(HOLES,))["threshold"] == 0.5
    # A picture without alpha is opaque: the factor alone is what is there.
    assert only({**base, "alphaMode": "BLEND"}, images=(COLORS,))["opacity"] == 0.5


def test_texture_transform_is_turned_with_v(only):
    # Where the specification looks up (u, v), with v down: offset + rotation (scale (u, v)).
    offset, scale, angle = np.array([0.1, 0.3]), np.array([2.0, 0.5]), 0.7
    transform = {"offset": offset.tolist(), "scale": scale.tolist(), "rotation": angle}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    found = only({"pbrMetallicRoughness": {"baseColorTexture": texture}}, images=(COLORS,))["base_color"]

    def turned(x, y, angle):
        return np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])

    for uv in np.random.default_rng(1).random((5, 2)):
        expected = offset + turned(*(scale * uv), -angle)
        up = np.array(found["scale"]) * (uv[0], 1.0 - uv[1])
        ours = np.array(found["offset"]) + turned(*up, np.radians(found["rotation"]))
        np.testing.assert_allclose((ours[0], 1.0 - ours[1]), expected, atol=1e-12)


# ---- Meshes


def test_faces_know_their_materials_and_v_runs_upwards(written):
    mesh = read_mesh(written(document([{}, {}], used=[1, None, 0])))
    np.testing.assert_array_equal(mesh.uv[:4], CORNERS[:, :2])
    # Behind the last comes glTF's default.
    assert sorted(mesh.kinds.tolist()) == [0, 0, 1, 1, 2, 2]
    assert read_mesh(written(document(None))).kinds is None


def test_faces_that_are_dropped_take_their_materials_along(written):
    content = document([{}, {}])
    content["buffers"].append({"byteLength": 12, "uri": data_uri(np.array([0, 0, 1, 0, 2, 3], np.uint16).tobytes())})
    content["bufferViews"].append({"buffer": 1, "byteOffset": 0, "byteLength": 12})
    content["accessors"].append({**content["accessors"][2], "bufferView": 3})
    content["meshes"][0]["primitives"][0]["indices"] = 3
    mesh = read_mesh(written(content))
    assert mesh.degenerate == 1
    assert sorted(mesh.kinds.tolist()) == [0, 1, 1]


def test_binary_files_hold_their_images(tmp_path):
    content = document([TEXTURED])
    data = base64.b64decode(content["buffers"][0].pop("uri").partition(",")[2])
    content["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": len(COLORS)})
    data += COLORS
    content["buffers"][0]["byteLength"] = len(data)
    content["images"], content["textures"] = [{"bufferView": 3, "mimeType": "image/png"}], [{"source": 0}]
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    path = tmp_path / "model.glb"
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)
    assert read_image_bytes(path, 0) == (COLORS, ".png")
    np.testing.assert_array_equal(read_image(f"{path}#0").texels[0, 0], [255, 0, 0])
    mesh = read_mesh(path)
    assert (len(mesh.faces), mesh.kinds.tolist()) == (2, [0, 0])
    assert read_materials(path, "m.glb")[0]["base_color"] == {"type": "image", "file": "m.glb#0"}


# ---- Scenes


def test_a_mesh_brings_a_material_for_each_face(packed):
    colors = [[0.25, 0.5, 0.75, 1.0], [1.0, 0.0, 0.0, 1.0]]
    world = packed(document([{"pbrMetallicRoughness": {"baseColorFactor": color}} for color in colors]))
    (table,) = world.materials
    rows = world.primitives[0].material
    assert {tuple(table.base_color.values[row]) for row in rows} == {(0.25, 0.5, 0.75), (1.0, 0.0, 0.0)}
    assert (type(table).__name__, len(rows)) == ("PrincipledTable", 4)


def test_only_materials_of_faces_are_packed_and_the_scenes_own_takes_their_place(packed):
    world = packed(document([{"alphaMode": "BLEND"}, {}], used=[1]))
    assert (len(world.materials), world.selectors, world.textures) == (1, None, None)
    scene = SCENE.replace("model.gltf", "model.gltf, material: {type: metal}")
    world = packed(document([{"alphaMode": "BLEND"}, {"pbrMetallicRoughness": []}]), scene)
    assert [type(table).__name__ for table in world.materials] == ["MetalTable"]


def test_alpha_makes_light_pass(packed):
    world = packed(document([{"alphaMode": "MASK", **TEXTURED}], images=(HOLES,)))
    assert world.transparency is not None
    (table,) = world.selectors.tables
    assert (type(table).__name__, table.threshold.tolist()) == ("CutoutTable", [0.5])


def test_two_of_one_file_share_its_triangles(packed):
    # One brings its materials, the other has the scene's: instances of groups of their own.
    scene = SCENE + "  - {type: mesh, file: model.gltf, material: {type: metal}}\n  - {type: mesh, file: model.gltf}\n"
    world = packed(document([{}, {"emissiveFactor": [1, 1, 1]}]), scene)
    assert len(world.instances.group) == 3
    assert len(set(world.instances.group.tolist())) == 2


# ---- What is broken

TWICE = {"baseColorTexture": {"index": 0, "texCoord": 1}}
BROKEN = [
    ("has material 0 with pbrMetallicRoughness that is no mapping", "materials", {"pbrMetallicRoughness": []}),
    ("a baseColorFactor that is not 4 num", "materials", {"pbrMetallicRoughness": {"baseColorFactor": [1, 1]}}),
    ("a metallicFactor that is no number", "materials", {"pbrMetallicRoughness": {"metallicFactor": "1"}}),
    ("material 0, counted from 0, whose metallic", "materials", {"pbrMetallicRoughness": {"metallicFactor": 2}}),
    ("item 7 of its textures", "materials", {"emissiveTexture": {"index": 7}, "emissiveFactor": [1, 1, 1]}),
    ("has material 0 with the alphaMode 'GLASS'", "materials", {"alphaMode": "GLASS"}),
    ("a second set of texture coordinates", "materials", {"pbrMetallicRoughness": TWICE}),
    ("a format that is not supported", "textures", {"extensions": {"KHR_texture_basisu": {"source": 0}}}),
    ("names 'no such.png' as image 0, and there is no such file", "images", {"uri": "no such.png"}),
    ("has broken base64 text as image 0", "images", {"uri": "data:image/png;base64,!!!"}),
    ("broken", "images", {"uri": data_uri(b"\x89PNG and no more")}),
    ("an image of a format that is not supported (number 0", "images", {"uri": data_uri(b"GIF89a")}),
    ("names item '../../secret.png' of its images", "textures", {"source": "../../secret.png"}),
    ("names item 99 of its bufferViews", "images", {"bufferView": 99}),
]


@pytest.mark.parametrize(("words", "key", "item"), BROKEN)
def test_what_is_broken_is_told_in_a_sentence(packed, words, key, item):
    with pytest.raises(SceneError) as caught:
        packed({**document([TEXTURED], images=(COLORS,)), key: [item]})
    assert words in str(caught.value)
    assert "scene.yaml:5: objects[0].file" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_cut_off_is_told(tmp_path):
    path = tmp_path / "model.glb"
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 100) + struct.pack("<II", 1000, 0x4E4F534A) + b"{}")
    for read in (read_mesh, lambda path: read_image_bytes(path, 0), lambda path: read_materials(path, "m")):
        with pytest.raises(InputError, match=r"model\.glb: ends early"):
            read(path)
