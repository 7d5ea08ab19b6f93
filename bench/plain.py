"""Start the yardstick: a plain path tracer in C++ (plain.cpp) on the same Embree, for scenes of few kinds.

    python bench/plain.py scenes/cover.yaml --width 400 --height 225 --spp 64

Compiles plain.cpp with the machine's C++ compiler, writes the scene to a file that it reads, and becomes that program.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from raytracer.core.embree_library import find_library
from raytracer.core.primitives.triangles import Triangles
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack

SOURCE = Path(__file__).with_name("plain.cpp")
KINDS = ("lambertian", "metal", "dielectric", "emitter")
COMPILER = os.environ.get("CXX", "c++")


def has_compiler() -> bool:
    """Tell if the machine has a C++ compiler."""
    return shutil.which(COMPILER) is not None


def build(folder: Path) -> Path:
    """Compile the program into a folder."""
    library, program = find_library(), folder / "plain"
    options = ["-std=c++17", "-O3", "-march=native", "-ffast-math", "-fno-finite-math-only", "-pthread"]
    # Embree's own library is found beside it, by a name that only the wheel knows.
    paths = [f"-Wl,-rpath,{library.parent}", f"-Wl,-rpath-link,{library.parent}"]
    subprocess.run([COMPILER, *options, str(SOURCE), "-o", str(program), str(library), *paths], check=True)
    return program


def material_row(spec: Any) -> tuple[Any, ...]:
    """Return the row of a material: kind, colour, parameter."""
    color = getattr(spec, "albedo", getattr(spec, "radiance", (1.0, 1.0, 1.0)))
    parameter = spec.ior.base if spec.type == "dielectric" else getattr(spec, "fuzz", 0.0)
    return KINDS.index(spec.type), color, parameter


def camera_rows(spec: Any, aspect: float) -> list[Any]:
    """Return the eye, the corner and edges of the plane in focus, and the lens's half axes."""
    eye = np.array(spec.look_from)
    back = eye - np.array(spec.look_at)
    back /= np.linalg.norm(back)
    right = np.cross(spec.up, back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    focus = getattr(spec, "focus_distance", 1.0)
    radius = focus * np.tan(np.radians(getattr(spec, "defocus_angle", 0.0) or 0.0) / 2)
    height = 2.0 * focus * np.tan(np.radians(spec.vfov) / 2)
    corner = eye - focus * back + height / 2 * (up - aspect * right)
    return [eye, corner, height * aspect * right, -height * up, radius * right, radius * up]


def write_scene(path: Path, width: int, height: int, out: Path) -> None:
    """Write a scene as plain.cpp reads it.

    Raises
    ------
    ValueError : it has what plain.cpp does not know.
    """
    spec = load(path)
    rows: list[tuple[Any, ...]] = []
    spheres, sphere_material, faces, face_material = [], [], [], []
    vertices = np.empty((0, 3), np.float32)
    light = [np.zeros(3)] * 4
    for item in spec.objects:
        material = spec.materials[item.material] if isinstance(item.material, str) else item.material
        rows.append(material_row(material))
        if item.type == "sphere":
            spheres.append([*item.center, item.radius])
            sphere_material.append(len(rows) - 1)
        elif item.type == "quad":
            corner, (a, b) = np.array(item.corner), np.array(item.edges)
            start = len(vertices)
            corners = np.array([corner, corner + a, corner + a + b, corner + b], np.float32)
            vertices = np.concatenate([vertices, corners])
            faces.append(start + np.array([[0, 1, 2], [0, 2, 3]]))
            face_material += [len(rows) - 1] * 2
            if material.type == "emitter":
                light = [corner, a, b, np.array(material.radiance)]
        elif item.type == "mesh":
            (table,) = (table for table in pack(spec).scene.primitives if isinstance(table, Triangles))
            faces.append(len(vertices) + table.faces.astype(np.int64))
            vertices = np.concatenate([vertices, table.vertices])
            face_material += [len(rows) - 1] * len(table.faces)
        else:
            raise ValueError(f"{path}: plain.cpp knows no {item.type}")
    sky = [spec.environment.horizon, spec.environment.zenith] if spec.environment else [np.zeros(3)] * 2
    all_faces = np.concatenate([*faces, np.empty((0, 3))])
    counts = (len(spheres), len(vertices), len(all_faces), len(rows), spec.render.max_depth, spec.render.rr_depth)
    with out.open("wb") as file:
        file.write(np.array(counts, np.int32).tobytes())
        file.write(np.array([*camera_rows(spec.camera, width / height), *sky, *light], np.float32).tobytes())
        file.write(np.array(spheres, np.float32).tobytes() + np.array(sphere_material, np.int32).tobytes())
        file.write(vertices.tobytes() + all_faces.astype(np.uint32).tobytes())
        file.write(np.array(face_material, np.int32).tobytes())
        file.write(table_of(rows).tobytes())


def table_of(rows: list[tuple[Any, ...]]) -> Any:
    """Make the table of materials."""
    return np.array(rows, np.dtype([("kind", "i4"), ("color", "f4", 3), ("parameter", "f4")]))


def main() -> None:
    """Build, write, become the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    for name in ("width", "height", "spp"):
        parser.add_argument(f"--{name}", type=int, required=True)
    parser.add_argument("--threads", type=int, default=available_threads())
    parser.add_argument("--robust", action="store_true", help="Embree's watertight intersections")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        program, scene = build(Path(folder)), Path(folder) / "scene.bin"
        write_scene(arguments.scene, arguments.width, arguments.height, scene)
        numbers = (arguments.width, arguments.height, arguments.spp, arguments.threads, int(arguments.robust))
        sys.exit(subprocess.run([program, scene, *map(str, numbers)], check=False).returncode)


if __name__ == "__main__":
    main()
