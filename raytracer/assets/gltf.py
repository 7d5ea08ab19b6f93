"""glTF 2.0 meshes (.gltf, .glb): the triangles of all nodes of the scene, each where its node puts it.

References: Khronos Group, "glTF 2.0 Specification".
"""

from pathlib import Path

import numpy as np

from raytracer.assets.polygons import BrokenMeshError, Floats, Integers, Parts


def read(path: Path) -> Parts:
    """Vertices, triangles, and normals if any of the meshes has them; those of the others are (0, 0, 0).

    Raises
    ------
    BrokenMeshError : the file is broken or holds no triangles.
    OSError : the file cannot be read.
    """
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False, skip_materials=True)
    except (OSError, MemoryError):
        raise
    except Exception as error:
        # A broken file raises anything, from KeyError to struct.error.
        raise BrokenMeshError("is broken, or not a glTF 2.0 file") from error

    vertices: list[Floats] = []
    faces: list[Integers] = []
    normals: list[Floats] = []
    has_normals = False
    offset = 0
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not isinstance(mesh, trimesh.Trimesh):
            continue
        linear = matrix[:3, :3]
        own = len(mesh.vertices)
        vertices.append(mesh.vertices @ linear.T + matrix[:3, 3])

        # A mirroring node turns triangles inside out; normals go by the cofactors, which need no inverse.
        faces.append((mesh.faces if np.linalg.det(linear) >= 0 else mesh.faces[:, ::-1]) + offset)
        offset += own

        # Normals that were not in the file are not there yet; asking the mesh for them would make them.
        if "vertex_normals" in mesh._cache.cache:
            has_normals = True
            cofactors = np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]])
            normals.append(mesh.vertex_normals @ cofactors.T * np.sign(np.linalg.det(linear)))
        else:
            normals.append(np.zeros((own, 3)))
    if not faces:
        raise BrokenMeshError("has no triangles")
    return Parts(np.concatenate(vertices), np.concatenate(faces), np.concatenate(normals) if has_normals else None)
