"""Run many renders, one after the other, as a shell loop does, and check that they leave no files behind.

    python -m tests.reliability.many --renders 64

All are to end with status 0 and equal files; and after the first, neither the kernel cache nor the folders of temporary
files and shared memory, nor that of the output, hold more than before.
"""

import argparse
import os
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from tests.reliability.processes import BALL, run


class Many(NamedTuple):
    """The outcomes of renders: exit statuses, different pictures, and paths that were there after and not before."""

    statuses: list[int]
    pictures: int
    left: list[str]

    @property
    def is_clean(self):
        """Tell if all went well, and nothing was left."""
        return not any(self.statuses) and self.pictures == 1 and not self.left


def many(folder, renders):
    """Render a scene so many times, by `rt render`, from and to a folder."""
    (folder / "ball.yaml").write_text(BALL)
    (folder / "tmp").mkdir()
    own = {"RAYTRACER_CACHE_DIR": "cache", "RAYTRACER_KEY_DIR": "key", "TMPDIR": "tmp"}
    environment = {**os.environ, **{name: str(folder / place) for name, place in own.items()}}
    statuses, pictures, there = [], set(), []
    for _ in range(renders):
        statuses.append(run(["render", "ball.yaml", "-o", "out/picture.exr", "-q"], folder, env=environment).status)
        pictures.add((folder / "out" / "picture.exr").read_bytes())
        there.append(paths(folder))
    return Many(statuses, len(pictures), sorted(there[-1] - there[0]))


def paths(folder):
    """List the files there, and memory that processes share, with their sizes."""
    # Shared memory lies directly in its folder; folders in it are those of other programs.
    shared = Path("/dev/shm").glob("*")
    return {f"{path} {path.stat().st_size}" for path in (*folder.rglob("*"), *shared) if path.is_file()}


def main():
    """Render, and report the outcomes."""
    parser = argparse.ArgumentParser(prog="python -m tests.reliability.many", description=__doc__.split("\n\n")[0])
    parser.add_argument("--renders", type=int, default=64)
    with tempfile.TemporaryDirectory() as made:
        found = many(Path(made), parser.parse_args().renders)
    print(found)
    return 0 if found.is_clean else 1


if __name__ == "__main__":
    sys.exit(main())
