"""Run one process for an hour, and check that its memory does not grow.

    python -m tests.reliability.hour --minutes 60
    python -m tests.reliability.hour --minutes 10 --renders

Sweeps a small scene over cameras, films, materials, geometry and AOVs, again and again in one process, with one cache
for all; or calls `rt.render` in a loop.  Images are written and removed.  The resident memory is looked at each two
seconds, and its slope after the first five minutes, a line by least squares, is to be below 1 MB a minute.
"""

import argparse
import itertools
import shutil
import sys
import tempfile
import threading
import time
import tracemalloc
from pathlib import Path

import numpy as np
import psutil
import trimesh

import raytracer as rt
from raytracer.scene.cache import RenderCache
from raytracer.scene.overrides import apply_overrides

SETTLED_SECONDS = 300.0
"""Time before this does not count: caches are filled, and the allocator finds its size."""

MOST_SLOPE = 1e6
"""Bytes a minute."""

_EVERY_SECONDS = 2.0
_MINUTE = 60.0
_MEGABYTE = 1e6

_SCENE = """
film: {width: 48, height: 32}
render: {spp: 8, max_depth: 4}
camera: {type: thin_lens, look_from: [0, 1, 4], look_at: [0, 0.5, 0], focal_length: 35, f_number: 2, focus_distance: 4}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.5, 0.7, 1.0]}
materials:
  floor: {type: lambertian, albedo: {type: checker, scale: 0.3, even: 0.3, odd: 0.6}}
  ball: {type: metal, albedo: 0.7, fuzz: 0.2}
objects:
  - {type: quad, corner: [-9, 0, -9], edges: [[0, 0, 18], [18, 0, 0]], material: floor}
  - {type: sphere, center: [0, 0.5, 0], radius: 0.5, material: ball}
  - {type: mesh, file: ball.obj, transform: [{translate: [1, 0.5, 0]}], material: ball}
"""

# Asked for in turn, so that neither files nor geometry nor kernels stay what they were.
_SWEEPS = (
    {"camera.f_number": "1:20:50", "camera.focus_distance": "1:10:4"},
    {"film.width": "16:96:41", "film.height": [16, 33]},
    {"objects.1.radius": "0.1:0.9:100"},
    {"materials.ball.albedo": "0.1:0.9:100", "render.seed": [1, 2]},
    {"render.spp": "1:100:100"},
    {"camera.look_from": [[x, 1.0, 4.0] for x in np.linspace(-2.0, 2.0, 50).tolist()]},
)


def sweeps(spec, folder):
    """Sweep for ever; yield the points of each sweep once it is done and its pictures are gone."""
    cache = RenderCache()
    for number, values in enumerate(itertools.cycle(_SWEEPS)):
        # Every second one keeps its pictures in memory.
        target = folder / f"sweep-{number}" if number % 2 == 0 else None
        formats = ("png", "exr") if number % 3 == 0 else ("png",)
        aovs = ("depth", "normal") if number % 4 == 0 else ()
        found = rt.sweep(spec, values, folder=target, formats=formats, aovs=aovs, cache=cache)
        assert all(taken.status == "done" for taken in found.results), [taken.reason for taken in found.results]
        points = len(found.results)
        del found
        if target is not None:
            shutil.rmtree(target)
        yield points


def renders(spec, folder):
    """Render for ever, with a scene that is new each time, and write the picture."""
    for number in itertools.count():
        changed = apply_overrides(spec, {"objects.1.radius": 0.1 + 0.8 * (number % 97) / 97.0, "render.seed": number})
        noise, denoise = (0.2, False) if number % 5 == 0 else (None, number % 7 == 0)
        image = rt.render(changed, noise=noise, denoise=denoise, aovs=("albedo",) if noise is None else ())
        path = folder / f"{number}.exr"
        image.save(path)
        path.unlink()
        yield 1


class Watch(threading.Thread):
    """Measures this process's resident memory every few seconds."""

    def __init__(self):
        super().__init__(daemon=True)
        self.seconds, self.resident = [], []
        self._begin, self.over, self._process = time.monotonic(), threading.Event(), psutil.Process()
        self.start()

    def run(self):
        while not self.over.wait(_EVERY_SECONDS):
            self.seconds.append(self.passed())
            self.resident.append(self._process.memory_info().rss)

    def passed(self):
        """Return the seconds since the start."""
        return time.monotonic() - self._begin


def slope(seconds, resident, settled):
    """Fit the bytes a minute after `settled` seconds, with their standard error if deviations are independent.

    Raises
    ------
    ValueError : fewer than three values are left.
    """
    kept = np.array(seconds) >= settled
    minutes, values = np.array(seconds)[kept] / _MINUTE, np.array(resident, dtype=float)[kept]
    if len(values) < 3:
        raise ValueError(f"nothing to fit after {settled:g} s")
    fit, covariance = np.polyfit(minutes, values, 1, cov="unscaled")
    deviations = values - np.polyval(fit, minutes)
    variance = float(deviations @ deviations) / (len(values) - 2)
    return float(fit[0]), float(np.sqrt(covariance[0, 0] * variance))


def main():
    """Run for so many minutes, and report the growth of the memory."""
    parser = argparse.ArgumentParser(prog="python -m tests.reliability.hour", description=__doc__.split("\n\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--settled", type=float, default=SETTLED_SECONDS / _MINUTE, help="minutes that do not count")
    parser.add_argument("--renders", action="store_true", help="a loop of rt.render in place of sweeps")
    parser.add_argument("--series", type=Path, help="a CSV file of seconds, bytes and points done")
    parser.add_argument("--trace", action="store_true", help="show which lines hold what was added (slow)")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        trimesh.creation.icosphere(subdivisions=2, radius=0.4).export(folder / "ball.obj")
        (folder / "scene.yaml").write_text(_SCENE)
        watch, done, counts, before = Watch(), 0, [], None
        for points in (renders if given.renders else sweeps)(rt.load(folder / "scene.yaml"), folder):
            done += points
            counts.append((watch.passed(), done))
            if given.trace and before is None and watch.passed() > _MINUTE * given.settled:
                tracemalloc.start(8)
                before = tracemalloc.take_snapshot()
            print(f"{watch.passed() / _MINUTE:5.1f} min {done:7,} points", end="\r", flush=True)
            if watch.passed() > _MINUTE * given.minutes:
                break
        watch.over.set()
        watch.join()
    if before is not None:
        for line in tracemalloc.take_snapshot().compare_to(before, "traceback")[:12]:
            print(line, *line.traceback.format()[-8:], sep="\n")
    if given.series is not None:
        finished = np.interp(watch.seconds, *zip(*counts, strict=True))
        rows = zip(watch.seconds, watch.resident, finished, strict=True)
        given.series.write_text("".join(f"{s:.1f},{b},{n:.0f}\n" for s, b, n in rows))
    found, error = slope(watch.seconds, watch.resident, _MINUTE * given.settled)
    print(
        f"{done:,} points in {watch.seconds[-1] / _MINUTE:.1f} min; from minute {given.settled:g} on resident memory "
        f"grew by {found / _MEGABYTE:.3f} +- {error / _MEGABYTE:.3f} MB a minute, "
        f"to {watch.resident[-1] / _MEGABYTE:.0f} MB"
    )
    return 0 if found < MOST_SLOPE else 1


if __name__ == "__main__":
    sys.exit(main())
