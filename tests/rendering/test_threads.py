"""Several threads that render at once, and must not disturb each other."""

import os
import subprocess
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

import raytracer as rt
from raytracer.core.compiler.lock import compiler_lock
from raytracer.film.formats.exr import suppress_library_output
from raytracer.rendering.render import render
from raytracer.scene.assets import read_image
from raytracer.scene.cache import RenderCache
from raytracer.scene.overrides import apply_overrides
from tests.small_scenes import scene

_THREADS = 4

_SPHERE = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}
"""


def test_pictures_are_those_of_one_thread() -> None:
    first = scene(_SPHERE, spp=64)
    specs = [apply_overrides(first, {"objects.0.radius": radius}) for radius in (1.0, 0.5, 1.0, 0.25)]
    expected = [render(spec, threads=1).image.radiance for spec in specs]
    assert not np.array_equal(expected[0], expected[1])
    together, cache = threading.Barrier(_THREADS), RenderCache()

    def work(number: int) -> Any:
        together.wait()
        return render(specs[number], threads=2, cache=cache if number % 2 else None).image.radiance

    with ThreadPoolExecutor(_THREADS) as pool:
        for found, wanted in zip(pool.map(work, range(_THREADS)), expected, strict=True):
            assert np.array_equal(found, wanted)


def test_one_thread_compiles_and_warns_and_changes_filters_of_warnings(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    PIL.Image.fromarray(np.zeros((2, 2, 3), np.uint8)).save(path)
    reader = threading.Thread(target=read_image, args=(path,))
    with compiler_lock, warnings.catch_warnings():
        reader.start()
        reader.join(0.2)
        assert reader.is_alive()
    reader.join()


def test_warnings_of_a_scene_get_through_while_others_compile() -> None:
    # A camera within a thing is warned of.
    doubtful = apply_overrides(scene(_SPHERE), {"camera.look_from": [0.0, 0.0, 0.5], "film.width": 8, "film.height": 8})
    compiling, done = threading.Event(), threading.Event()
    found: list[Any] = []

    def compile_as_numba_does() -> None:
        with compiler_lock, warnings.catch_warnings(record=True) as caught:
            compiling.set()
            done.wait(0.3)
        found.extend(caught)

    other = threading.Thread(target=compile_as_numba_does)

    def render_meanwhile() -> None:
        other.start()
        compiling.wait()
        rt.render(doubtful, spp=1, threads=1)
        done.set()

    with pytest.warns(rt.SceneWarning):
        render_meanwhile()
    other.join()
    assert not found


def test_the_terminal_is_put_back_whoever_silences_it() -> None:
    def which() -> tuple[int, int]:
        status = os.fstat(2)
        return status.st_dev, status.st_ino

    before, second_ready = which(), threading.Event()

    def second() -> None:
        second_ready.set()
        with suppress_library_output():
            pass

    other = threading.Thread(target=second)
    with suppress_library_output():
        other.start()
        second_ready.wait()
        other.join(0.1)
    other.join()
    assert which() == before


_COLD = """
import threading, sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
import raytracer as rt

scenes = sorted(Path(sys.argv[1]).glob("*.yaml"))
together = threading.Barrier(len(scenes))

def work(path):
    together.wait()
    return rt.render(rt.load(path), threads=1).radiance

with ThreadPoolExecutor(len(scenes)) as pool:
    found = list(pool.map(work, scenes))
for path, radiance in zip(scenes, found):
    assert (rt.render(rt.load(path), threads=2).radiance == radiance).all(), path
from raytracer.kernel.path_tracer import render_tile
print(render_tile.counts["compiled"])
"""


@pytest.mark.slow
def test_a_cold_start_by_many_threads_compiles_each_kind_once(tmp_path: Path) -> None:
    text = """
camera: {{type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}}
film: {{width: 16, height: 16}}
render: {{spp: 16, max_depth: 2}}
environment: {{type: constant, radiance: 1}}
objects: [{{type: sphere, center: [0, 0, {z}], radius: 1, material: {{type: {material}, albedo: 0.5}}}}]
"""
    for number, material in enumerate(("lambertian", "metal", "lambertian", "metal")):
        (tmp_path / f"{number}.yaml").write_text(text.format(z=0.1 * number, material=material))
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _COLD, str(tmp_path)],
        env={**os.environ, "RAYTRACER_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "2\n")
