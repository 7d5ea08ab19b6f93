"""Write what ``scenes/studio.yaml`` is made of: a radio as glTF, a leaf, and the lamps round them.

    python scenes/generate/studio.py [FOLDER]

The files are small and in the repository; all of their pictures are painted here.
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

import numpy as np
import PIL.Image
import trimesh
from numpy.typing import NDArray
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from raytracer.film.formats import hdr

FOLDER = Path(__file__).parents[1] / "studio"

WIDTH, HEIGHT, DEPTH = 0.6, 0.36, 0.2  # of the radio, metres

Floats = NDArray[np.float64]


def picture(values: Floats, colors: int = 256) -> PIL.Image.Image:
    """Return values in 0..1 of shape (h, w), (h, w, 3) or (h, w, 4) as an image, of few colours to be small."""
    bytes_ = np.round(255.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8)
    levels = 255.0 / max(1, colors - 1)
    bytes_ = np.round(np.round(bytes_ / levels) * levels).astype(np.uint8)
    image = PIL.Image.fromarray(bytes_)
    # Read back as a file, which trimesh then stores as it is.
    file = io.BytesIO()
    image.save(file, "PNG", optimize=True)
    return PIL.Image.open(file)


def grid(height: int, width: int) -> tuple[Floats, Floats]:
    """Return u and v, upwards, at the middles of the texels."""
    v, u = np.mgrid[height - 0.5 : -0.5 : -1.0, 0.5:width] / np.array([height, width])[:, None, None]
    return u, v


def wood(size: int = 96) -> tuple[Floats, Floats]:
    """Return colour (sRGB) and height of planks with a grain along u."""
    u, v = grid(size, size)
    plank = np.floor(3.0 * v)
    tone = 0.5 + 0.5 * np.sin(12.9 * plank + 1.0)
    grain = np.sin(60.0 * v + 3.0 * np.sin(5.0 * u + 2.0 * plank) + 9.0 * tone)
    groove = np.clip(np.abs((3.0 * v) % 1.0 - 0.5) * 2.0 - 0.88, 0.0, 0.12) / 0.12
    base = np.array([0.55, 0.33, 0.16]) * (0.85 + 0.2 * tone + 0.08 * grain)[..., None]
    return base * (1.0 - 0.7 * groove)[..., None], 0.004 * (0.04 * grain - groove)


def normals(height: Floats, across: float, down: float) -> Floats:
    """Return the normal map of a height (m) over a face of this size (m): green is up."""
    du = np.gradient(height, axis=1) * height.shape[1] / across
    dv = -np.gradient(height, axis=0) * height.shape[0] / down
    vectors = np.stack([-du, -dv, np.ones_like(height)], axis=-1)
    vectors /= np.linalg.norm(vectors, axis=-1, keepdims=True)
    return 0.5 + 0.5 * vectors


def face(origin: Floats, right: Floats, up: Floats) -> trimesh.Trimesh:
    """Return a rectangle whose picture stands upright, seen from the side of right x up."""
    corners = np.array([origin, origin + right, origin + right + up, origin + up])
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


UV = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def textured(mesh: trimesh.Trimesh, material: PBRMaterial) -> trimesh.Trimesh:
    """Give a mesh a material; rectangles get the whole of its pictures."""
    uv = UV if len(mesh.vertices) == 4 else np.zeros((len(mesh.vertices), 2))
    mesh.visual = TextureVisuals(uv=uv, material=material)
    return mesh


def radio() -> trimesh.Scene:
    """Return the radio: a box of planks, a grille with holes, a lit dial, and two knobs of brass."""
    color, height = wood()
    # glTF keeps roughness in green and metalness in blue.
    shine = np.stack([np.zeros_like(height), 0.35 + 0.3 * (color[..., 0] < 0.3), np.zeros_like(height)], axis=-1)
    planks = PBRMaterial(
        name="planks",
        baseColorTexture=picture(color, 32),
        metallicRoughnessTexture=picture(shine, 16),
        normalTexture=picture(normals(height, WIDTH, HEIGHT), 64),
        metallicFactor=1.0,
        roughnessFactor=1.0,
    )
    u, v = grid(64, 64)
    holes = np.hypot((12.0 * u) % 1.0 - 0.5, (12.0 * v) % 1.0 - 0.5) < 0.3
    cloth = np.dstack([np.full((64, 64, 3), [0.75, 0.68, 0.5]), np.where(holes, 0.0, 1.0)])
    grille = PBRMaterial(
        name="grille",
        baseColorTexture=picture(cloth, 16),
        metallicFactor=1.0,
        roughnessFactor=0.35,
        alphaMode="MASK",
        alphaCutoff=0.5,
        doubleSided=True,
    )
    u, v = grid(32, 128)
    ticks = ((20.0 * u) % 1.0 < 0.12) & (v < np.where((4.0 * u) % 1.0 < 0.1, 0.7, 0.4))
    glow = np.where(ticks[..., None], [0.05, 0.02, 0.0], [1.0, 0.75, 0.35])
    dial = PBRMaterial(
        name="dial",
        baseColorFactor=[0, 0, 0, 255],
        emissiveFactor=[1.0, 1.0, 1.0],
        emissiveTexture=picture(glow, 16),
        metallicFactor=0.0,
        roughnessFactor=0.1,
    )
    brass = PBRMaterial(name="brass", baseColorFactor=[240, 200, 110, 255], metallicFactor=1.0, roughnessFactor=0.25)
    black = PBRMaterial(name="inside", baseColorFactor=[12, 12, 12, 255], metallicFactor=0.0, roughnessFactor=0.9)

    x, y, z = (np.array(axis) for axis in ((WIDTH, 0.0, 0.0), (0.0, HEIGHT, 0.0), (0.0, 0.0, DEPTH)))
    low = np.array([-0.5 * WIDTH, 0.0, -0.5 * DEPTH])
    parts = [
        # Behind the grille lies a dark board; the front is planks round it.
        textured(face(low + z - 0.03 * z, x, y), black),
        textured(face(low + z, x, 0.2 * y), planks),
        textured(face(low + 0.9 * y + z, x, 0.1 * y), planks),
        textured(face(low + 0.2 * y + z, 0.06 * x, 0.7 * y), planks),
        textured(face(low + 0.2 * y + 0.94 * x + z, 0.06 * x, 0.7 * y), planks),
        textured(face(low + 0.2 * y + 0.06 * x + z, 0.44 * x, 0.7 * y), grille),
        textured(face(low + 0.2 * y + 0.5 * x + z, 0.44 * x, 0.4 * y), planks),
        textured(face(low + 0.6 * y + 0.5 * x + z, 0.44 * x, 0.3 * y), dial),
        textured(face(low + x, -x, y), planks),
        textured(face(low, z, y), planks),
        textured(face(low + x + z, -z, y), planks),
        textured(face(low + y + z, x, -z), planks),
    ]
    for place in (0.61, 0.83):
        knob = trimesh.creation.cylinder(0.034, 0.03, sections=40)
        knob.apply_translation(low + place * x + 0.39 * y + z + np.array([0.0, 0.0, 0.015]))
        parts.append(textured(trimesh.Trimesh(knob.vertices, knob.faces, process=False), brass))
    scene = trimesh.Scene()
    for number, part in enumerate(parts):
        scene.add_geometry(part, geom_name=f"part {number}")
    return scene


def leaf(size: int = 128) -> PIL.Image.Image:
    """Return a leaf on nothing: green with veins, and its outline as alpha."""
    u, v = grid(size, size)
    along, across = v, np.abs(u - 0.5)
    width = 0.36 * np.sin(np.pi * np.clip(along, 0.0, 1.0) ** 0.8) ** 0.9
    teeth = 0.012 * np.abs((14.0 * along) % 1.0 - 0.5)
    stem = (across < 0.012) & (along < 0.98)
    there = (across < width - teeth) & (along > 0.06) | stem
    veins = (np.abs((9.0 * (along - 0.9 * across)) % 1.0 - 0.5) < 0.05) | (across < 0.01)
    color = np.where(veins[..., None], [0.62, 0.72, 0.3], [0.22, 0.5, 0.12])
    color = color * (0.85 + 0.15 * np.cos(9.0 * along + 4.0 * across))[..., None]
    return picture(np.dstack([color, there]), 48)


def lamps(height: int = 64) -> Floats:
    """Return radiance (h, 2 h, 3) all round: grey walls, two soft boxes, and a strip behind."""
    v, u = np.mgrid[0.5:height, 0.5 : 2 * height] / np.array([height, 2 * height])[:, None, None]
    elevation, azimuth = 90.0 - 180.0 * v, 360.0 * u
    grey = 0.10 + 0.10 * np.clip(elevation, -30.0, 90.0) / 90.0
    radiance = np.repeat(grey[..., None], 3, axis=2)

    def box(middle: tuple[float, float], size: tuple[float, float], color: tuple[float, float, float]) -> None:
        """Set a rectangle of angles (degrees), soft at its edges."""
        across = (azimuth - middle[0] + 180.0) % 360.0 - 180.0
        inside = np.minimum(0.5 * size[0] - np.abs(across), 0.5 * size[1] - np.abs(elevation - middle[1]))
        radiance[...] += np.clip(inside / 4.0, 0.0, 1.0)[..., None] * np.array(color)

    box((130.0, 45.0), (50.0, 40.0), (9.0, 8.6, 8.0))
    box((235.0, 35.0), (40.0, 50.0), (3.2, 3.6, 4.2))
    box((0.0, 55.0), (120.0, 14.0), (4.0, 4.0, 4.0))
    return radiance


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "radio.glb").write_bytes(radio().export(file_type="glb"))
    leaf().save(folder / "leaf.png", optimize=True)
    (folder / "lamps.hdr").write_bytes(hdr.encode(lamps(), {}))
    for path in sorted(folder.iterdir()):
        print(f"{path}: {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
