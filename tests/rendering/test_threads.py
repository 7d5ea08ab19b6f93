"""Renders under load: more threads than processors, others at work, several at once, forks; the same bits always."""

import multiprocessing
import os
import subprocess
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

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
from tests.rendering.halves import halves

PATIENCE = 120.0


@pytest.fixture(scope="module")
def specs():
    """A scene, and another one."""
    first = halves(width=256, height=256, spp=8, max_depth=2)
    return first, apply_overrides(first, {"objects.ball.radius": 0.2, "film.width": 128})


@pytest.fixture(scope="module")
def expected(specs):
    return [bits(spec, threads=1) for spec in specs]


def bits(spec, **settings):
    return render(spec, **settings).image.radiance.tobytes()


def test_any_number_of_threads_gives_the_same_bits(specs, expected):
    # 256 tiles, so as many threads where more are asked for.
    before = threading.active_count()
    for threads in (3, 64, 1024):
        assert bits(specs[0], threads=threads) == expected[0]
    assert threading.active_count() == before


def test_each_of_many_renders_at_once_is_that_of_one_alone(specs, expected):
    # Of the same scene and of another, with many threads each, with one cache for some; one of them is interrupted.
    long = apply_overrides(specs[0], {"render.spp": 100_000})
    works = [(specs[0], None), (specs[1], cache := RenderCache()), (specs[0], cache), (specs[1], None), (long, None)]
    together = threading.Barrier(len(works))

    def soon(progress):
        if progress.done > 0:
            raise KeyboardInterrupt

    def work(given):
        together.wait()
        return render(given[0], threads=16, cache=given[1], progress=soon if given[0] is long else None)

    with ThreadPoolExecutor(len(works)) as pool:
        *whole, ended = pool.map(work, works)
    assert [one.image.radiance.tobytes() for one in whole] == [*expected, *expected]
    assert not any(one.interrupted for one in whole)
    # What is there of the one that was ended is what that many samples make.
    assert ended.interrupted
    assert ended.fewest_samples < 100_000
    assert np.isfinite(ended.image.radiance).all()


@contextmanager
def busy(count):
    """Processes that take all the time they get."""
    command = [sys.executable, "-S", "-c", "print(1, flush=True)\nwhile True: pass"]
    others = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(count)]
    try:
        for other in others:
            other.stdout.readline()
        yield
    finally:
        for other in others:
            other.kill()
            other.communicate()


def test_a_machine_that_is_busy_with_others_gives_the_same_bits(specs, expected):
    with busy(2 * (os.cpu_count() or 1)):
        assert bits(specs[0]) == expected[0]


# ---- Forks, which take over what the process has but its other threads


def forked(work):
    """Call a function in a fork of this process, and return its result."""
    ours, theirs = multiprocessing.Pipe()
    child = multiprocessing.get_context("fork").Process(target=lambda: theirs.send(work()))
    child.start()
    try:
        assert ours.poll(PATIENCE), "the forked process hangs"
        return ours.recv()
    finally:
        child.kill()
        child.join()


FORKS = pytest.mark.skipif(
    sys.platform != "linux", reason="what the systems' libraries hold does not outlive a fork elsewhere"
)


@FORKS
def test_a_forked_process_renders_as_its_parent_does(specs, expected):
    assert forked(lambda: [bits(spec, threads=2) for spec in specs]) == expected
    # And the parent goes on.
    assert bits(specs[0]) == expected[0]


@FORKS
def test_a_process_forked_while_a_thread_compiles_does_not_wait_for_it(specs, expected):
    compiling, over = threading.Event(), threading.Event()

    def compile_for_long():
        with compiler_lock:
            compiling.set()
            over.wait(PATIENCE)

    def held_and_rendered():
        # By the main thread: a new one may be given the identity of the one that was left behind.
        with compiler_lock:
            pass
        return bits(specs[0], threads=2)

    other = threading.Thread(target=compile_for_long)
    other.start()
    compiling.wait()
    try:
        assert forked(held_and_rendered) == expected[0]
    finally:
        over.set()
        other.join()


# ---- What threads share


def test_one_thread_compiles_and_warns_and_changes_filters_of_warnings(tmp_path):
    path = tmp_path / "a.png"
    PIL.Image.fromarray(np.zeros((2, 2, 3), np.uint8)).save(path)
    reader = threading.Thread(target=read_image, args=(path,))
    with compiler_lock, warnings.catch_warnings():
        reader.start()
        reader.join(0.2)
        assert reader.is_alive()
    reader.join()


def test_warnings_of_a_scene_get_through_while_others_compile():
    # A camera within a thing is warned of.
    within = {"camera.look_from": [0.8, -0.4, -0.6], "film.width": 8, "film.height": 8}
    doubtful = apply_overrides(halves(), within)
    compiling, done, found = threading.Event(), threading.Event(), []

    def compile_as_numba_does():
        with compiler_lock, warnings.catch_warnings(record=True) as caught:
            compiling.set()
            done.wait(0.3)
        found.extend(caught)

    other = threading.Thread(target=compile_as_numba_does)

    def render_meanwhile():
        other.start()
        compiling.wait()
        rt.render(doubtful, spp=1, threads=1)
        done.set()

    with pytest.warns(rt.SceneWarning) as told:
        render_meanwhile()
    # Its own, and not only those of the specks that fill it up.
    assert any("is inside objects[5]" in str(each.message) for each in told)
    other.join()
    assert not found


def test_the_terminal_is_put_back_whoever_silences_it():
    before, second_ready = os.fstat(2), threading.Event()

    def second():
        second_ready.set()
        with suppress_library_output():
            pass

    other = threading.Thread(target=second)
    with suppress_library_output():
        other.start()
        second_ready.wait()
        other.join(0.1)
    other.join()
    assert os.path.samestat(os.fstat(2), before)


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
def test_a_cold_start_by_many_threads_compiles_each_kind_once(tmp_path):
    text = """
camera: {{type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}}
film: {{width: 16, height: 16}}
render: {{spp: 16, max_depth: 2}}
environment: {{type: constant, radiance: 1}}
objects: [{{type: sphere, center: [0, 0, {z}], radius: 1, material: {{type: {material}, albedo: 0.5}}}}]
"""
    for number, material in enumerate(("lambertian", "metal", "lambertian", "metal")):
        (tmp_path / f"{number}.yaml").write_text(text.format(z=0.1 * number, material=material))
    command = [sys.executable, "-W", "error", "-c", _COLD, str(tmp_path)]
    own = {**os.environ, "RAYTRACER_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(command, env=own, capture_output=True, text=True, timeout=600, check=False)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "2\n")
