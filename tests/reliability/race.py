"""Many processes that start together on an empty kernel cache, and without a key to sign what goes there.

    python -m tests.reliability.race --processes 32
    python -m tests.reliability.race --processes 8 --killed 3
    python -m tests.reliability.race --processes 8 --damaged

All are to succeed with equal pictures, and one of them alone to compile.  With `--killed` so many others are killed by
SIGKILL while they compile, before; with `--damaged` the file of each kernel is there, with a flipped bit.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from raytracer.core.compiler.signing_key import FILE_NAME

_KERNELS = (".nbc", ".part")

_SCENE = """
film: {width: 32, height: 32}
render: {spp: 8, max_depth: 3}
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}
"""

# Renders once all are ready to, and tells what it did: whether it took the kernel from the cache, and the picture.
_RACER = """
import hashlib, sys, time
from pathlib import Path
import raytracer as rt
from raytracer.kernel.path_tracer import render_tile
scene = rt.load(sys.argv[1])
Path(sys.argv[2]).touch()
while not Path(sys.argv[3]).exists():
    time.sleep(0.01)
began = time.perf_counter()
image = rt.render(scene, threads=1)
digest = hashlib.sha256(image.radiance.tobytes()).hexdigest()
print(render_tile.counts["compiled"], digest, time.perf_counter() - began)
"""


class Race(NamedTuple):
    """The outcome of a race: exit statuses, digests of pictures, how many compiled, and what else is left."""

    statuses: list[int]
    pictures: set[str]
    compiled: int
    slowest: float
    left: list[str]
    told: str

    @property
    def is_won(self):
        """Tell if all have the same picture, one alone compiled, and only kernels, times, locks and a key are left."""
        return not any(self.statuses) and len(self.pictures) == 1 and self.compiled == 1 and not self.left


def race(folder, processes):
    """Let processes start together, with the kernel cache `folder/cache` as it is."""
    scene, start = folder / "scene.yaml", folder / f"start-{time.monotonic_ns()}"
    scene.write_text(_SCENE)
    ready = [folder / f"{start.name}-{number}" for number in range(processes)]
    racers = [_racer(folder, scene, path, start) for path in ready]
    while not all(path.exists() or racer.poll() is not None for path, racer in zip(ready, racers, strict=True)):
        time.sleep(0.05)
    start.touch()
    told = [racer.communicate() for racer in racers]
    lines = [out.split() for out, _ in told if out]
    files = [path for path in (*(folder / "cache").rglob("*"), *(folder / "key").iterdir()) if path.is_file()]
    return Race(
        [racer.returncode for racer in racers],
        {digest for _, digest, _ in lines},
        sum(int(misses) for misses, _, _ in lines),
        max((float(seconds) for _, _, seconds in lines), default=0.0),
        [path.name for path in files if path.suffix not in (*_KERNELS, ".lock", ".took") and path.name != FILE_NAME],
        "".join(error for _, error in told),
    )


def _racer(folder, scene, ready, start):
    given = [sys.executable, "-W", "error", "-c", _RACER, str(scene), str(ready), str(start)]
    own = {f"RAYTRACER_{name.upper()}_DIR": str(folder / name) for name in ("cache", "key")}
    return subprocess.Popen(given, env={**os.environ, **own}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _kernels(folder):
    """List the files of kernels and of parts of them."""
    return sorted(path for path in (folder / "cache").rglob("*") if path.suffix in _KERNELS)


def kill_compilers(folder, count):
    """Kill processes while they hold the lock and compile; return their number."""
    scene = folder / "scene.yaml"
    scene.write_text(_SCENE)
    killed = 0
    for number in range(count):
        start = folder / f"at-once-{number}"
        start.touch()
        racer = _racer(folder, scene, folder / f"victim-{number}", start)
        while racer.poll() is None and not list((folder / "cache").rglob("*.lock")):
            time.sleep(0.02)
        time.sleep(0.3 + 0.5 * number)
        racer.send_signal(signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
        racer.communicate()
        killed += not list((folder / "cache").rglob("*.nbc"))
    return killed


def damage(folder, seed):
    """Flip a bit of every kernel that is there; return their number."""
    places = np.random.default_rng(seed)
    found = _kernels(folder)
    for path in found:
        content = bytearray(path.read_bytes())
        content[places.integers(len(content))] ^= 1 << int(places.integers(8))
        path.write_bytes(content)
    return len(found)


def main():
    """Race, and report the outcome."""
    parser = argparse.ArgumentParser(prog="python -m tests.reliability.race", description=__doc__.split("\n\n")[0])
    parser.add_argument("--processes", type=int, default=32)
    parser.add_argument("--killed", type=int, default=0, help="processes that are killed while they compile, before")
    parser.add_argument("--damaged", action="store_true", help="race once more, with damaged files")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        if given.killed:
            print(f"{kill_compilers(folder, given.killed)} of {given.killed} killed while they compiled")
        done = [race(folder, given.processes)]
        if given.damaged:
            print(f"{damage(folder, 1)} kernels damaged")
            done.append(race(folder, given.processes))
    print(*done, sep="\n")
    return 0 if all(found.is_won for found in done) and len({*map(str, (found.pictures for found in done))}) == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
