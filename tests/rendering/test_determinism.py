"""The same scene, seed and samples give the same bits, however the work is divided."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raytracer
from raytracer.core.embree import PACKET
from raytracer.rendering import tile_scheduler
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import render
from raytracer.rendering.session import Rendered
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec
from tests.repository import GENERATED, ROOT, SCENES, need_files_of

WIDTH, HEIGHT, SPP = 44, 36, 37


def scene(name: str, sampler: str | None = None) -> SceneSpec:
    """A scene of the repository at a small size, cut by tiles of 16 into unequal ones; SPP is not a whole packet."""
    need_files_of(name)
    overrides: dict[str, Any] = {"film.width": WIDTH, "film.height": HEIGHT, "render.spp": SPP}
    if sampler is not None:
        overrides["render.sampler"] = sampler
    return load(SCENES / f"{name}.yaml", overrides)


# What these have besides the other scenes' kinds are materials, media, priorities and textures, which know nothing of
# threads.  Of the two that disperse, the prism is the smaller.
LARGE = {"diamond", "metals", "nested", "next_week", "studio", "textures"}

NAMES = [
    pytest.param(path.stem, marks=[pytest.mark.slow] if path.stem in LARGE | GENERATED.keys() else [])
    for path in sorted(SCENES.glob("*.yaml"))
]


def radiance(spec: SceneSpec, **keys: Any) -> NDArray[np.float64]:
    return render(spec, **keys).image.radiance


def assert_same(a: Rendered, b: Rendered) -> None:
    """Check that radiance and variance are bit-identical, and as many rays were traced."""
    np.testing.assert_array_equal(a.image.radiance, b.image.radiance)
    assert a.image.variance is not None
    assert b.image.variance is not None
    np.testing.assert_array_equal(a.image.variance, b.image.variance)
    assert a.stats.rays == b.stats.rays


@pytest.mark.parametrize("name", NAMES)
def test_threads_do_not_matter(name: str) -> None:
    # The sampler of the references, so that both tests compile one kernel; others are the cover's, below.
    spec = scene(name, "independent")
    one = render(spec, threads=1)
    assert one.stats.nan_samples == 0
    assert one.image.radiance.any()
    for threads in (2, 4, 13):
        assert_same(render(spec, threads=threads), one)


@pytest.mark.parametrize("name", NAMES)
def test_a_crop_is_that_part_of_the_picture(name: str) -> None:
    spec = scene(name, "independent")
    whole = radiance(spec)
    for left, top, right, bottom in ((0, 0, 7, 5), (13, 9, 31, 33), (43, 35, 44, 36)):
        np.testing.assert_array_equal(radiance(spec, crop=(left, top, right, bottom)), whole[top:bottom, left:right])


@pytest.mark.parametrize("sampler", ["independent", "stratified", "sobol"])
def test_threads_and_crops_do_not_matter_to_a_sampler(sampler: str) -> None:
    spec = scene("cover", sampler)
    one = render(spec, threads=1)
    assert_same(render(spec, threads=4), one)
    np.testing.assert_array_equal(radiance(spec, crop=(13, 9, 31, 33)), one.image.radiance[9:33, 13:31])


@pytest.mark.parametrize("sampler", ["independent", "stratified", "sobol"])
def test_passes_and_tiles_do_not_matter(monkeypatch: pytest.MonkeyPatch, sampler: str) -> None:
    spec = scene("cover", sampler)
    usual = render(spec, threads=2)
    monkeypatch.setattr(tile_scheduler, "TILE_SIZE", 7)
    assert_same(render(spec, threads=2), usual)
    monkeypatch.setattr(tile_scheduler, "pass_end", lambda begin, spp: min(spp, begin + PACKET))
    assert_same(render(spec, threads=2), usual)
    monkeypatch.setattr(tile_scheduler, "pass_end", lambda begin, spp: spp)
    assert_same(render(spec, threads=2), usual)


@pytest.mark.parametrize("start", [0, 8, 24, 40, 1000])
def test_passes_cover_the_samples_in_whole_packets_and_end_at_powers_of_two(start: int) -> None:
    for spp in (1001, 1037, 2048, 100_000):
        ends = [start]
        while ends[-1] < spp:
            ends.append(tile_scheduler.pass_end(ends[-1], spp))
            assert ends[-2] < ends[-1] <= ends[-2] + 256
        assert ends[-1] == spp
        assert all(end % PACKET == 0 for end in ends[:-1])
        # Errors are told from means at these.
        assert {n for n in (8, 16, 32, 64, 128, 256, 512, 1024) if start < n <= spp} <= set(ends)
    assert tile_scheduler.pass_end(0, 3) == 3


@pytest.mark.parametrize("sampler", ["independent", "sobol"])
def test_an_early_end_leaves_the_first_samples(sampler: str) -> None:
    # Pixels that got n samples before an interruption are those of a render of n samples.
    spec = scene("cover", sampler)

    def interrupt(progress: Progress) -> None:
        if progress.done > 0:
            raise KeyboardInterrupt

    result = render(spec, spp=1_000_000, threads=2, progress=interrupt)
    assert result.interrupted
    assert not result.complete
    assert result.fewest_samples < 1_000_000
    np.testing.assert_array_equal(result.image.radiance.shape, (HEIGHT, WIDTH, 3))

    # Time runs out: a pixel is then that of a render of as many samples as its tile has, whole packets of them.
    timed = render(spec, spp=1_000_000, threads=2, time_limit=0.5, aovs=["samples"])
    assert not timed.complete
    assert not timed.interrupted
    counts = timed.image.layers["samples"]
    assert counts.min() == timed.fewest_samples >= tile_scheduler.FIRST_PASS
    assert counts.max() == timed.image.samples
    for count in np.unique(counts)[:8]:
        assert count % PACKET == 0
        picture = radiance(spec, spp=int(count))
        np.testing.assert_array_equal(timed.image.radiance[counts == count], picture[counts == count])


@pytest.mark.parametrize(("sampler", "noise"), [("independent", 0.03), ("sobol", 0.015)])
def test_threads_do_not_matter_where_samples_go_where_the_error_is(sampler: str, noise: float) -> None:
    spec = scene("cover", sampler)
    one = render(spec, noise=noise, threads=1)
    # Otherwise it would only be a render with another number of samples.
    assert one.complete
    assert one.stats.pilot_samples > 0
    assert len(np.unique(render(spec, noise=noise, threads=2, aovs=["samples"]).image.layers["samples"])) > 1
    for threads in (2, 4):
        again = render(spec, noise=noise, threads=threads)
        assert_same(again, one)
        assert again.stats.error == one.stats.error


@pytest.mark.parametrize("sampler", ["independent", "stratified", "sobol"])
def test_seeds_matter(sampler: str) -> None:
    spec = scene("cover", sampler)
    pictures = [radiance(spec, seed=seed) for seed in (0, 1, 2**32 - 1)]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        # Even the sky straight through a pixel varies by where in the pixel samples fall, but for its blue, always 1.
        assert (pictures[a] != pictures[b])[..., :2].mean() > 0.99
    np.testing.assert_array_equal(radiance(spec, seed=1), pictures[1])


def test_neighbours_and_channels_are_not_copies() -> None:
    # Noise that two pixels share would show: their errors must not be correlated.
    spec = scene("cover", "independent")
    noise = radiance(spec, seed=3) - radiance(spec, seed=4)
    grey = noise.mean(axis=2)
    deviation = 1.0 / np.sqrt(grey.size)
    for shifted in (np.roll(grey, 1, axis=1), np.roll(grey, 1, axis=0), np.roll(grey, (1, 1), axis=(0, 1))):
        correlation = (grey * shifted).mean() / (grey * grey).mean()
        # Heavy tails make the correlation of honest noise wider than that of normal noise, by 2 or so.
        assert abs(correlation) < 10.0 * deviation


def test_another_process_has_the_same_bits() -> None:
    program = (
        "from tests.rendering.test_determinism import radiance, scene; import hashlib; "
        "print(hashlib.sha256(radiance(scene('glass', 'independent')).tobytes()).hexdigest())"
    )
    package = Path(raytracer.__file__).parent.parent
    digests = {
        subprocess.run(
            [sys.executable, "-c", program],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": f"{package}{os.pathsep}{ROOT}"},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for _ in range(2)
    }
    digests.add(hashlib.sha256(radiance(scene("glass", "independent")).tobytes()).hexdigest() + "\n")
    assert len(digests) == 1
