"""glTF files bring their materials: what the specification says lands in the scene, and what is broken is told."""

import base64
import io
import json
import struct

import numpy as np
import PIL.Image
import pytest

from raytracer.plugins.materials.cutout import CutoutTable
from raytracer.plugins.materials.principled import PrincipledTable
from raytracer.scene.assets import read_image, read_mesh
from raytracer.scene.assets.gltf import read_image_bytes
from raytracer.scene.assets.gltf_materials import read_materials
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import InputError, SceneError

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
# In glTF the first texel is at (0, 0), and v runs downwards.
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
FACES = np.array([0, 1, 2, 0, 2, 3], np.uint16)


def uri(data, mime="application/octet-stream"):
    return f"data:{mime};base64,{base64.b64encode(data).decode()}"


def png(pixels):
    file = io.BytesIO()
    PIL.Image.fromarray(np.array(pixels, np.uint8)).save(file, "PNG")
    return file.getvalue()


COLORS = png([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]])
HOLES = png([[[200, 200, 200, 255], [200, 200, 200, 0]]])


def document(materials, *, used=None, images=(), samplers=None, **more):
    """A file of one square for each of the materials `used` (all by default), with a texture for each image."""
    data = CORNERS.tobytes() + UV.tobytes() + FACES.tobytes()
    which = list(range(len(materials or []))) if used is None else used
    primitives = [
        {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, **({} if item is None else {"material": item})}
        for item in which or [None]
    ]
    result = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "buffers": [{"byteLength": len(data), "uri": uri(data)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        **more,
    }
    if materials is not None:
        result["materials"] = materials
    if images:
        result["images"] = [{"uri": uri(image, "image/png")} for image in images]
        result["textures"] = [{"source": number, "sampler": 0} for number in range(len(images))]
        result["samplers"] = samplers or [{}]
    return result


def written(folder, content):
    path = folder / "model.gltf"
    path.write_text(json.dumps(content))
    return path


def only(folder, material, **more):
    """Read a file's one material."""
    return read_materials(written(folder, document([material], **more)), "model.gltf")[0]


SCENE = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0]}
film: {width: 4, height: 4}
objects:
  - {type: mesh, file: model.gltf}
"""


def packed(folder, content, scene=SCENE):
    written(folder, content)
    return pack(build(scene, "scene.yaml", base=folder)).scene


# ---- Values


def test_defaults_are_the_specifications(tmp_path):
    assert only(tmp_path, {}) == {
        "type": "principled",
        "base_color": [1.0, 1.0, 1.0],
        "metallic": 1.0,
        "roughness": 1.0,
        "ior": 1.5,
        "two_sided": False,
    }


def test_factors_and_extensions_land(tmp_path):
    found = only(
        tmp_path,
        {
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4],
                "metallicFactor": 0.5,
                "roughnessFactor": 0.25,
            },
            "emissiveFactor": [1.0, 0.5, 0.0],
            "doubleSided": True,
            "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 8.0},
                "KHR_materials_ior": {"ior": 1.33},
                "KHR_materials_transmission": {"transmissionFactor": 0.75},
            },
        },
    )
    assert found == {
        "type": "principled",
        "base_color": [0.1, 0.2, 0.3],
        "metallic": 0.5,
        "roughness": 0.25,
        "emission": [8.0, 4.0, 0.0],
        "transmission": 0.75,
        "ior": 1.33,
        "two_sided": True,
    }


def test_textures_keep_channels_factors_and_wrapping(tmp_path):
    found = only(
        tmp_path,
        {
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": 0},
                "metallicRoughnessTexture": {"index": 1},
                "roughnessFactor": 0.5,
            },
            "normalTexture": {"index": 0, "scale": 0.5},
        },
        images=(COLORS, COLORS),
        samplers=[{"wrapS": 33071, "wrapT": 33648}],
    )
    image = {"type": "image", "wrap": ["clamp", "mirror"]}
    assert found["base_color"] == {**image, "file": "model.gltf#0"}
    assert found["metallic"] == {**image, "file": "model.gltf#1", "channel": "b"}
    assert found["roughness"] == {**image, "file": "model.gltf#1", "channel": "g", "factor": 0.5}
    assert (found["normal_map"], found["normal_scale"]) == ({**image, "file": "model.gltf#0"}, 0.5)


def test_alpha_is_a_cutout(tmp_path):
    base = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.5]}}
    assert only(tmp_path, base, images=(HOLES,))["type"] == "principled"
    blend = only(tmp_path, {**base, "alphaMode": "BLEND"}, images=(HOLES,))
    assert blend["opacity"] == {"type": "image", "file": "model.gltf#0", "channel": "a", "factor": 0.5}
    assert "threshold" not in blend
    assert only(tmp_path, {**base, "alphaMode": "MASK"}, images=(HOLES,))["threshold"] == 0.5
    # A picture without alpha is opaque: the factor alone is what is there.
    assert only(tmp_path, {**base, "alphaMode": "BLEND"}, images=(COLORS,))["opacity"] == 0.5


def test_texture_transform_is_turned_with_v(tmp_path):
    # Where the specification looks up (u, v), with v down: offset + rotation (scale (u, v)).
    offset, scale, angle = np.array([0.1, 0.3]), np.array([2.0, 0.5]), 0.7
    found = only(
        tmp_path,
        {
            "pbrMetallicRoughness": {
                "baseColorTexture": {
                    "index": 0,
                    "extensions": {
                        "KHR_texture_transform": {"offset": offset.tolist(), "scale": scale.tolist(), "rotation": angle}
                    },
                }
            }
        },
        images=(COLORS,),
    )["base_color"]
    turn = np.radians(found["rotation"])
    for uv in np.random.default_rng(1).random((5, 2)):
        u, v = scale * uv
        expected = offset + np.array([np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u])
        x, y = np.array(found["scale"]) * (uv[0], 1.0 - uv[1])
        ours = np.array(found["offset"]) + np.array(
            [np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y]
        )
        np.testing.assert_allclose((ours[0], 1.0 - ours[1]), expected, atol=1e-12)


# ---- Meshes


def test_v_runs_upwards_in_meshes(tmp_path):
    mesh = read_mesh(written(tmp_path, document([{}])))
    assert mesh.uv is not None
    np.testing.assert_array_equal(mesh.uv, CORNERS[:, :2])


def test_faces_know_their_materials(tmp_path):
    mesh = read_mesh(written(tmp_path, document([{}, {}], used=[1, None, 0])))
    assert mesh.kinds is not None
    # Behind the last comes glTF's default.
    assert sorted(mesh.kinds.tolist()) == [0, 0, 1, 1, 2, 2]
    assert read_mesh(written(tmp_path, document(None))).kinds is None


def test_faces_that_are_dropped_take_their_materials_along(tmp_path):
    content = document([{}, {}])
    flat = np.array([0, 0, 1, 0, 2, 3], np.uint16).tobytes()
    content["buffers"].append({"byteLength": 12, "uri": uri(flat)})
    content["bufferViews"].append({"buffer": 1, "byteOffset": 0, "byteLength": 12})
    content["accessors"].append({**content["accessors"][2], "bufferView": 3})
    content["meshes"][0]["primitives"][0]["indices"] = 3
    mesh = read_mesh(written(tmp_path, content))
    assert mesh.degenerate == 1
    assert mesh.kinds is not None
    assert sorted(mesh.kinds.tolist()) == [0, 1, 1]


def test_binary_files_hold_their_images(tmp_path):
    content = document([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])
    data = base64.b64decode(content["buffers"][0].pop("uri").partition(",")[2])
    start = len(data)
    data += COLORS
    content["buffers"][0]["byteLength"] = len(data)
    content["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": len(COLORS)})
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
    assert (len(mesh.faces), mesh.kinds.tolist() if mesh.kinds is not None else None) == (2, [0, 0])
    assert read_materials(path, "m.glb")[0]["base_color"] == {"type": "image", "file": "m.glb#0"}


# ---- Scenes


def test_a_mesh_brings_a_material_for_each_face(tmp_path):
    colors = [[0.25, 0.5, 0.75, 1.0], [1.0, 0.0, 0.0, 1.0]]
    world = packed(tmp_path, document([{"pbrMetallicRoughness": {"baseColorFactor": color}} for color in colors]))
    (table,) = world.materials
    assert isinstance(table, PrincipledTable)
    rows = world.primitives[0].material
    found = {tuple(table.base_color.values[row]) for row in rows}
    assert found == {(0.25, 0.5, 0.75), (1.0, 0.0, 0.0)}
    assert len(rows) == 4


def test_only_materials_of_faces_are_packed(tmp_path):
    world = packed(tmp_path, document([{"alphaMode": "BLEND"}, {}], used=[1]))
    assert (len(world.materials), world.selectors, world.textures) == (1, None, None)


def test_a_material_in_the_scene_takes_their_place(tmp_path):
    scene = SCENE.replace("model.gltf", "model.gltf, material: {type: metal}")
    world = packed(tmp_path, document([{"alphaMode": "BLEND"}, {"pbrMetallicRoughness": []}]), scene)
    assert [type(table).__name__ for table in world.materials] == ["MetalTable"]


def test_alpha_makes_light_pass(tmp_path):
    material = {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    world = packed(tmp_path, document([material], images=(HOLES,)))
    assert world.transparency is not None
    (table,) = world.selectors.tables
    assert isinstance(table, CutoutTable)
    assert table.threshold.tolist() == [0.5]


def test_two_of_one_file_share_its_triangles(tmp_path):
    # One brings its materials, the other has the scene's: instances of groups of their own.
    scene = SCENE + "  - {type: mesh, file: model.gltf, material: {type: metal}}\n  - {type: mesh, file: model.gltf}\n"
    world = packed(tmp_path, document([{}, {"emissiveFactor": [1, 1, 1]}]), scene)
    assert world.instances is not None
    assert len(world.instances.group) == 3
    assert len(set(world.instances.group.tolist())) == 2


# ---- What is broken


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"materials": [{"pbrMetallicRoughness": []}]}, "has material 0 with pbrMetallicRoughness that is no mapping"),
        ({"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1]}}]}, "a baseColorFactor that is not 4 num"),
        ({"materials": [{"pbrMetallicRoughness": {"metallicFactor": "1"}}]}, "a metallicFactor that is no number"),
        (
            {"materials": [{"pbrMetallicRoughness": {"metallicFactor": 2}}]},
            "material 0, counted from 0, whose metallic",
        ),
        ({"materials": [{"emissiveTexture": {"index": 7}, "emissiveFactor": [1, 1, 1]}]}, "item 7 of its textures"),
        ({"materials": [{"alphaMode": "GLASS"}]}, "has material 0 with the alphaMode 'GLASS'"),
        (
            {"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}]},
            "a second set of texture coordinates",
        ),
        ({"textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]}, "a format that is not supported"),
        ({"images": [{"uri": "no such.png"}]}, "names 'no such.png' as image 0, and there is no such file"),
        ({"images": [{"uri": "data:image/png;base64,!!!"}]}, "has broken base64 text as image 0"),
        ({"images": [{"uri": uri(b"\x89PNG and no more")}]}, "broken"),
        ({"images": [{"uri": uri(b"GIF89a")}]}, "an image of a format that is not supported (number 0"),
        ({"images": [{"bufferView": 99}]}, "names item 99 of its bufferViews"),
    ],
)
def test_what_is_broken_is_told_in_a_sentence(tmp_path, change, words):
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    content = document([material], images=(COLORS,))
    with pytest.raises(SceneError) as caught:
        packed(tmp_path, {**content, **change})
    assert words in str(caught.value)
    assert "scene.yaml:5: objects[0].file" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_cut_off_is_told(tmp_path):
    path = tmp_path / "model.glb"
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 100) + struct.pack("<II", 1000, 0x4E4F534A) + b"{}")
    for read in (read_mesh, lambda path: read_image_bytes(path, 0), lambda path: read_materials(path, "m")):
        with pytest.raises(InputError, match=r"model\.glb: ends early"):
            read(path)
