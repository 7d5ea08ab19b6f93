"""The memory of a render, estimated and measured, and the memory that there is."""

import os
import subprocess
import sys

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.core.compiler import cache as kernel_cache
from raytracer.core.embree import Accel
from raytracer.core.geometry import Geometry, Primitive
from raytracer.kernel.path_tracer import render_tile
from raytracer.rendering import memory_budget
from raytracer.rendering.compilation import compile_scene
from raytracer.rendering.memory_budget import (
    MemoryEstimate,
    PictureMemory,
    StructureMemory,
    check_memory,
    structure_bytes,
)
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import prepare_scene, render
from raytracer.scene.cache import RenderCache
from raytracer.scene.pack.scene import pack
from raytracer.util.errors import InputError
from raytracer.util.machine import MemoryLimit
from tests.rendering.halves import halves
from tests.repository import SCENES, need_files_of

_NEEDED = MemoryEstimate(100_000_000, {"the ray caster's structure": 300_000_000, "the picture": 2_000_000_000})


def test_too_little_is_refused_with_both_numbers_and_what_helps():
    with pytest.raises(InputError) as error:
        check_memory(_NEEDED, 2_000_000_000)
    assert str(error.value) == (
        "this would take about 2.4 GB of memory, and there are 2 GB allowed by --max-memory; 2 GB of it are the "
        "picture: a smaller film, --crop, fewer AOVs or no --denoise take less, as do the views of an array by "
        "rt lightfield render --memory"
    )
    check_memory(_NEEDED, 2_400_000_000)


def test_what_the_machine_may_have_is_not_refused(monkeypatch):
    # 2.3 GB would be added, of which estimates are right to a quarter.
    for free, fits in ((1_700_000_000, False), (1_900_000_000, True), (2_400_000_000, True)):
        monkeypatch.setattr(
            memory_budget,
            "memory_limits",
            lambda free=free: iter([MemoryLimit(10**12, "there"), MemoryLimit(free, "here")]),
        )
        if fits:
            check_memory(_NEEDED)
        else:
            with pytest.raises(InputError, match=r"there are 1\.8 GB here"):
                check_memory(_NEEDED)


def test_a_render_is_refused_before_it_is_built(monkeypatch, tmp_path, capsys):
    spec, path, output = halves(), tmp_path / "halves.yaml", tmp_path / "a.png"
    monkeypatch.setattr("raytracer.scene.pack.scene.PackedScene.build", lambda *given: pytest.fail("built"))
    with pytest.raises(InputError, match="there are 10 MB allowed"):
        render(spec, max_memory=10**7)
    spec.save(path)
    assert main(["render", str(path), "-o", str(output), "-q", "--max-memory", "50 MB"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert "50 MB allowed by --max-memory" in said[-1]
    assert not output.exists()


def test_parts_of_a_picture_count_as_large_as_they_are(monkeypatch):
    monkeypatch.setattr("raytracer.rendering.render.compile_kernel", lambda *given: 0)
    # 150 MB take some 26 GB by 176 bytes a pixel; a part of a hundredth does not.
    spec = halves(width=15_000, height=10_000)
    most = memory_budget.resident_bytes() + 2 * 10**9
    with pytest.raises(InputError, match="this would take about"):
        prepare_scene(spec, RenderOptions(max_memory=most))
    with pytest.raises(InputError, match="this would take about"):
        prepare_scene(spec, RenderOptions(max_memory=most, crop=(0, 0, 15_000, 5_000)))
    prepare_scene(spec, RenderOptions(max_memory=most), max_pixels=1_500_000)
    prepare_scene(spec, RenderOptions(max_memory=most, crop=(0, 0, 1500, 1000)))


def test_what_a_picture_takes_adds_up():
    plain = PictureMemory(pixels=1, film=64, spp=64)
    # Film and tally, and as much again where a checkpoint copies them.
    assert plain.bytes() >= 64 + 48
    assert plain._replace(with_checkpoints=True).bytes() == 2 * (64 + 48)
    assert PictureMemory(pixels=10**6, film=64, spp=64).bytes() == 10**6 * plain.bytes()
    for more in ({"film": 144}, {"photograph": memory_budget.EXPOSED_BYTES}, {"denoise": True}):
        assert plain._replace(**more).bytes() > plain.bytes()
    # The denoiser bounds its own scratch memory.
    large = PictureMemory(pixels=10**8, film=64, denoise=True).bytes() - PictureMemory(pixels=10**8, film=64).bytes()
    assert large < 7 * 10**9


def test_a_structure_that_is_there_takes_nothing_more(monkeypatch):
    monkeypatch.setattr("raytracer.rendering.render.compile_kernel", lambda *given: 0)
    spec, cache = halves(), RenderCache()
    first = prepare_scene(spec, cache=cache).packed
    assert memory_budget.structure_memory(first).resident > 0
    assert memory_budget.structure_memory(first, RenderCache()).resident > 0
    assert memory_budget.structure_memory(first, cache) == StructureMemory(0, 0)


def _triangles(count):
    side = int((count / 2) ** 0.5)
    x, y = np.meshgrid(np.arange(side + 1), np.arange(side + 1))
    heights = np.random.default_rng(1).random((side + 1) ** 2)
    vertices = np.stack([x.ravel(), y.ravel(), heights], 1).astype(np.float32)
    corner = np.arange(side * (side + 1)).reshape(side, side + 1)[:, :-1].ravel()
    halves = ([corner, corner + 1, corner + side + 1], [corner + 1, corner + side + 2, corner + side + 1])
    indices = np.concatenate([np.stack(half, 1) for half in halves]).astype(np.uint32)
    return {0: Geometry(Primitive.TRIANGLE, (vertices,), indices)}


def _spheres(count):
    rows = np.random.default_rng(1).random((count, 4), dtype=np.float32) * np.array([100, 100, 100, 0.5], np.float32)
    return {0: Geometry(Primitive.SPHERE, (rows,))}


@pytest.mark.parametrize("made", [_triangles, _spheres])
def test_a_structure_takes_what_is_estimated(made):
    # By the process's own memory, which grows by some MB at a time, and of which other tests may have left some.
    geometries = made(1_000_000)
    before = memory_budget.resident_bytes()
    kept = Accel(geometries)
    grown = memory_budget.resident_bytes() - before
    estimate = structure_bytes(geometries, (), ())
    assert kept.address
    assert grown < 1.25 * estimate.peak
    assert estimate.resident <= estimate.peak


def test_a_kernel_that_is_compiled_takes_no_compiler(monkeypatch, tmp_path):
    packed = pack(halves())
    compile_scene(packed.spec, packed)
    assert memory_budget.kernel_bytes(packed, ()) < 2e7
    # In another process, with another cache, it is compiled.
    monkeypatch.setattr(kernel_cache, "CACHE_FOLDER", tmp_path / "kernels")
    monkeypatch.setattr(render_tile, "_codes", {})
    assert memory_budget.kernel_bytes(packed, ()) > 1e8


def test_what_moves_takes_more_by_pose():
    rest = Geometry(Primitive.TRIANGLE, (np.zeros((3, 3), np.float32),), np.zeros((1000, 3), np.uint32))
    found = [structure_bytes({0: rest._replace(vertices=rest.vertices * poses)}, (), ()) for poses in (1, 2, 3, 9)]
    assert [one.peak for one in found] == sorted(one.peak for one in found)
    assert found[3].peak - found[2].peak == 6 * (found[2].peak - found[1].peak)
    assert structure_bytes({}, ({0: rest}, {0: rest}), ()).resident == 2 * found[0].resident


# ---- Estimates and measurements

_PEAK = "from raytracer.rendering.statistics import peak_rss_bytes; print(peak_rss_bytes())"


def test_the_peak_is_that_of_this_process_and_not_of_the_one_that_started_it():
    held = np.ones(10**8)
    done = subprocess.run([sys.executable, "-c", _PEAK], capture_output=True, text=True, check=True, timeout=120)
    assert 2**24 < int(done.stdout) < held.nbytes


_MEASURED = """
import sys
from raytracer.rendering import memory_budget
from raytracer.rendering.checkpoint import CheckpointWriter
from raytracer.rendering.render import render
from raytracer.rendering.statistics import peak_rss_bytes
from raytracer.scene.load import load

estimates, check_memory = [], memory_budget.check_memory
def noted(needed, limit=None):
    estimates.append(needed.total)
    check_memory(needed, limit)
memory_budget.check_memory = noted
scene, width, height, aovs, denoise, path = sys.argv[1:]
size = {"film.width": int(width), "film.height": int(height)} if int(width) else {}
writer = CheckpointWriter(path, every=1.0) if path else None
names = aovs.split(",") if aovs else ()
done = render(load(scene, size), spp=8, aovs=names, denoise=bool(denoise), checkpoint_writer=writer)
print(estimates[0], peak_rss_bytes())
"""

_PHOTOGRAPH = """
film: {width: 1600, height: 1200}
render: {max_depth: 4}
camera: {type: thin_lens, look_from: [0, 1, 4], look_at: [0, 0.5, 0], focal_length: 35, f_number: 2, focus_distance: 4,
         iso: 100, shutter: 1/100 s, sensor: {format: full_frame, noise: true}}
environment: {type: gradient, horizon: [1000, 1000, 1000], zenith: [500, 700, 1000]}
objects:
  - {type: sphere, center: [0, 0.5, 0], radius: 0.5, material: {type: lambertian, albedo: 0.5}}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "width", "height", "aovs", "denoise", "keeps"),
    [
        ("cover", 1200, 675, "", "", ""),
        ("cornell", 4000, 3000, "", "", ""),
        ("million", 0, 0, "", "", ""),
        ("cornell", 2000, 1500, "depth,normal,albedo", "", ""),
        ("cornell", 2000, 1500, "", "", "checkpoint"),
        ("cornell", 1000, 750, "", "denoise", ""),
        ("photograph", 0, 0, "", "", ""),
    ],
)
def test_estimates_are_within_a_quarter_of_what_is_taken(name, width, height, aovs, denoise, keeps, tmp_path):
    need_files_of(name)
    if denoise:
        pytest.importorskip("pyoidn")
    (tmp_path / "photograph.yaml").write_text(_PHOTOGRAPH)
    path = tmp_path / "photograph.yaml" if name == "photograph" else SCENES / f"{name}.yaml"
    kept = os.fspath(tmp_path / keeps) if keeps else ""
    given = [os.fspath(path), str(width), str(height), aovs, denoise, kept]
    words = [sys.executable, "-c", _MEASURED, *given]
    environment = {**os.environ, "RAYTRACER_CACHE_DIR": str(tmp_path / "kernels")}
    estimates = []
    # The first compiles the kernel, and the second has it from the cache.
    for _ in range(2):
        done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=900, env=environment)
        estimate, peak = map(int, done.stdout.split())
        assert estimate == pytest.approx(peak, rel=0.25)
        estimates.append(estimate)
    assert estimates[1] < estimates[0] - 150e6
