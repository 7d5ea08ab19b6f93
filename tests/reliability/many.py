"""Run many renders, one after the other, as a shell loop does, and check that they leave no files behind.

    python -m tests.reliability.many --renders 64

All are to end with status 0 and equal files; and after the first, neither the kernel cache nor the folders of temporary
files and shared memory, nor that of the output, hold more than before.
"""

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

_SCENE = """
film: {width: 48, height: 32}
render: {spp: 16, max_depth: 4}
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 0.5}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}
"""

_SHARED = Path("/dev/shm")


class Many(NamedTuple):
    """The outcomes of renders: exit statuses, different pictures, and paths that were there after and not before."""

    statuses: list[int]
    pictures: int
    left: list[str]

    @property
    def is_clean(self) -> bool:
        """Tell if all went well, and nothing was left."""
        return not any(self.statuses) and self.pictures == 1 and not self.left


def many(folder: Path, renders: int) -> Many:
    """Render a scene so many times, by `rt render`, from and to a folder."""
    (folder / "scene.yaml").write_text(_SCENE)
    (folder / "tmp").mkdir()
    own = {"RAYTRACER_CACHE_DIR": "cache", "RAYTRACER_KEY_DIR": "key", "TMPDIR": "tmp"}
    environment = {**os.environ, **{name: str(folder / place) for name, place in own.items()}}
    statuses, pictures, before = [], set(), None
    for _ in range(renders):
        output = folder / "out" / "picture.exr"
        given = ["render", str(folder / "scene.yaml"), "-o", str(output), "--quiet"]
        command = "import sys; from raytracer.cli.base.app import main; sys.exit(main())"
        statuses.append(
            subprocess.run([sys.executable, "-c", command, *given], env=environment, check=False).returncode
        )
        pictures.add(hashlib.sha256(output.read_bytes()).hexdigest())
        if before is None:
            before = _paths(folder)
    return Many(statuses, len(pictures), sorted(_paths(folder) - (before or set())))


def _paths(folder: Path) -> set[str]:
    # Memory that processes share lies directly there; folders are those of other programs.
    shared = _SHARED.iterdir() if _SHARED.is_dir() else ()
    return {f"{path} {path.stat().st_size}" for path in (*folder.rglob("*"), *shared) if path.is_file()}


def main() -> int:
    """Render, and report the outcomes."""
    parser = argparse.ArgumentParser(prog="python -m tests.reliability.many", description=__doc__.split("\n\n")[0])
    parser.add_argument("--renders", type=int, default=64)
    with tempfile.TemporaryDirectory() as made:
        found = many(Path(made), parser.parse_args().renders)
    print(
        f"{len(found.statuses)} renders: {found.statuses.count(0)} with status 0, {found.pictures} different pictures, "
        f"left over: {len(found.left)} {found.left[:8]}"
    )
    return 0 if found.is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
