"""Make the pictures and the mesh that scenes in this folder use: `python bench/peers/make_files.py`."""

from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image

FOLDER = Path(__file__).parent


def tiles() -> None:
    """Paint an upright F on coloured tiles, 8 bits, so that a turned or mirrored texture shows."""
    picture = np.zeros((32, 48, 3), np.uint8)
    picture[..., 0] = 60 + 3 * np.arange(48)
    picture[..., 1] = 80 + 4 * np.arange(32)[:, None]
    picture[..., 2] = 120
    for rows, columns in (((4, 28), (8, 14)), ((4, 9), (8, 30)), ((14, 19), (8, 24))):
        picture[slice(*rows), slice(*columns)] = (240, 220, 60)
    PIL.Image.fromarray(picture).save(FOLDER / "tiles.png")


def sky() -> None:
    """Paint a smooth sky with a small bright sun and a dark ground, equirectangular, top row up."""
    rows, columns = 64, 128
    polar = np.pi * (np.arange(rows) + 0.5) / rows
    around = 2.0 * np.pi * (np.arange(columns) + 0.5) / columns
    up = np.cos(polar)[:, None, None]
    radiance = np.where(up > 0, (1 - up) * [0.6, 0.7, 0.8] + up * [0.1, 0.2, 0.6], np.array([0.1, 0.08, 0.05]))
    radiance = radiance * (1 + 0.5 * np.sin(around)[None, :, None])
    radiance[18:20, 40:42] = (300.0, 260.0, 200.0)
    channels = {name: np.ascontiguousarray(radiance[..., i], np.float32) for i, name in enumerate("RGB")}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(FOLDER / "sky.exr"))


def wave(cells: int = 8) -> None:
    """Make a wavy sheet over [-1, 1]^2 with normals and texture coordinates."""
    u, v = (axis.ravel() for axis in np.meshgrid(*[np.arange(cells + 1) / cells] * 2))
    x, y = 2 * u - 1, 2 * v - 1
    slope = 0.6 * np.cos(3 * x)
    normals = np.stack([-slope, np.zeros_like(x), np.ones_like(x)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lines = ["# A wavy sheet, made by make_files.py."]
    lines += [f"v {a:.6f} {b:.6f} {c:.6f}" for a, b, c in zip(x, y, 0.2 * np.sin(3 * x), strict=True)]
    lines += [f"vt {a:.6f} {b:.6f}" for a, b in zip(u, v, strict=True)]
    lines += ["vn " + " ".join(f"{value:.6f}" for value in normal) for normal in normals]
    for row in range(cells):
        for column in range(cells):
            a = 1 + row * (cells + 1) + column
            for corners in ((a, a + 1, a + cells + 2), (a, a + cells + 2, a + cells + 1)):
                lines.append("f " + " ".join(f"{i}/{i}/{i}" for i in corners))
    (FOLDER / "wave.obj").write_text("\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    tiles()
    wave()
    sky()
