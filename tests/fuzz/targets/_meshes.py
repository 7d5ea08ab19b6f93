"""What every mesh that was read keeps to."""

from pathlib import Path

import numpy as np

from raytracer.scene.assets import read_mesh


def load(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    mesh = read_mesh(path)
    count = len(mesh.vertices)
    assert mesh.vertices.shape == (count, 3)
    assert mesh.vertices.dtype == np.float64
    assert np.isfinite(mesh.vertices).all()
    assert mesh.faces.shape == (len(mesh.faces), 3)
    assert mesh.faces.dtype == np.uint32
    assert len(mesh.faces) >= 1
    assert mesh.faces.max() < count
    if mesh.normals is not None:
        lengths = np.linalg.norm(mesh.normals, axis=1)
        assert mesh.normals.shape == (count, 3)
        assert ((np.abs(lengths - 1.0) < 1e-12) | (lengths == 0.0)).all()
    if mesh.uv is not None:
        assert mesh.uv.shape == (count, 2)
        assert np.isfinite(mesh.uv).all()
    if mesh.kinds is not None:
        assert mesh.kinds.shape == (len(mesh.faces),)
        assert mesh.kinds.min() >= 0
