"""Renders under load: more threads than processors, others at work, several at once; and the same bits always."""

import multiprocessing
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from raytracer.core.compiler.lock import compiler_lock
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import render
from raytracer.rendering.session import Rendered
from raytracer.scene.overrides import apply_overrides
from raytracer.scene.spec import SceneSpec
from tests.small_scenes import scene

_SPHERE = """
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: 1}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.5}}
"""

_PATIENCE = 120.0


def _scenes() -> tuple[SceneSpec, SceneSpec]:
    first = scene(_SPHERE, width=256, height=256, spp=8)
    return first, apply_overrides(first, {"objects.0.radius": 0.5, "film.width": 128})


def _bits(rendered: Rendered) -> bytes:
    return rendered.image.radiance.tobytes()


def test_any_number_of_threads_gives_the_same_bits() -> None:
    # 256 tiles, so as many threads where more are asked for.
    spec, _ = _scenes()
    expected = _bits(render(spec, threads=1))
    before = threading.active_count()
    for threads in (3, 64, 1024):
        assert _bits(render(spec, threads=threads)) == expected
    assert threading.active_count() == before


def test_each_of_many_renders_at_once_is_that_of_one_alone() -> None:
    # Of the same scene and of another, with many threads each, one of them interrupted.
    first, second = _scenes()
    long = apply_overrides(first, {"render.spp": 100_000})
    specs = (first, second, first, long)
    expected = [_bits(render(spec, threads=1)) for spec in (first, second)]
    together = threading.Barrier(len(specs))

    def soon(progress: Progress) -> None:
        if progress.done > 0:
            raise KeyboardInterrupt

    def work(spec: SceneSpec) -> Rendered:
        together.wait()
        return render(spec, threads=16, progress=soon if spec is long else None)

    with ThreadPoolExecutor(len(specs)) as pool:
        one, other, again, ended = pool.map(work, specs)
    assert [_bits(one), _bits(other), _bits(again)] == [expected[0], expected[1], expected[0]]
    assert not one.interrupted
    assert not other.interrupted
    # What is there of the one that was ended is what that many samples make.
    assert ended.interrupted
    assert ended.fewest_samples < 100_000
    assert np.isfinite(ended.image.radiance).all()


@contextmanager
def _busy(count: int) -> Iterator[None]:
    """Processes that take all the time they get."""
    others = [
        subprocess.Popen([sys.executable, "-S", "-c", "print(1, flush=True)\nwhile True: pass"], stdout=subprocess.PIPE)
        for _ in range(count)
    ]
    try:
        for other in others:
            assert other.stdout is not None
            other.stdout.readline()
        yield
    finally:
        for other in others:
            other.kill()
            other.communicate()


def test_a_machine_that_is_busy_with_others_gives_the_same_bits() -> None:
    spec, _ = _scenes()
    expected = _bits(render(spec, threads=1))
    with _busy(2 * (os.cpu_count() or 1)):
        assert _bits(render(spec)) == expected


# ---- Forks, which take over what the process has but its other threads


def _forked(work: Any) -> Any:
    """Call a function in a fork of this process, and return its result."""
    ours, theirs = multiprocessing.Pipe()
    child = multiprocessing.get_context("fork").Process(target=lambda: theirs.send(work()))
    child.start()
    try:
        assert ours.poll(_PATIENCE), "the forked process hangs"
        return ours.recv()
    finally:
        child.kill()
        child.join()


_FORKS = pytest.mark.skipif(
    sys.platform != "linux", reason="what the systems' libraries hold does not outlive a fork elsewhere"
)


@_FORKS
def test_a_forked_process_renders_as_its_parent_does() -> None:
    spec, other = _scenes()
    expected = [_bits(render(one)) for one in (spec, other)]
    assert _forked(lambda: [_bits(render(one, threads=2)) for one in (spec, other)]) == expected
    # And the parent goes on.
    assert _bits(render(spec)) == expected[0]


@_FORKS
def test_a_process_forked_while_a_thread_compiles_does_not_wait_for_it() -> None:
    spec, _ = _scenes()
    expected = _bits(render(spec))
    compiling, over = threading.Event(), threading.Event()

    def compile_for_long() -> None:
        with compiler_lock:
            compiling.set()
            over.wait(_PATIENCE)

    def held_and_rendered() -> bytes:
        # By the main thread: a new one may be given the identity of the one that was left behind.
        with compiler_lock:
            pass
        return _bits(render(spec, threads=2))

    other = threading.Thread(target=compile_for_long)
    other.start()
    compiling.wait()
    try:
        assert _forked(held_and_rendered) == expected
    finally:
        over.set()
        other.join()
