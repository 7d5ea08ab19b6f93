"""glTF files of one triangle, of which tests replace parts."""

import base64
import json

import numpy as np

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")


def data_uri(data, mime="application/octet-stream"):
    return f"data:{mime};base64,{base64.b64encode(data).decode()}"


def accessor(**more):
    return [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", **more}]


def gltf_text(**more):
    """Make the text of a file of one triangle, but for what is given."""
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": accessor(),
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": data_uri(CORNERS.tobytes())}],
        **more,
    }
    return json.dumps(document)


def write_gltf(path, **more):
    path.write_text(gltf_text(**more))
    return path
