"""The same scene, seed and samples give the same bits, however the work is divided."""

import hashlib

import numpy as np
import pytest

from raytracer.core.embree import PACKET
from raytracer.rendering import tile_scheduler
from raytracer.rendering.render import render
from raytracer.scene.load import load
from tests.rendering.halves import HEIGHT, SPP, WIDTH, assert_same, assert_same_samples, halves
from tests.repository import GENERATED, SCENES, need_files_of, run_python

CROPS = ((0, 0, 7, 5), (13, 9, 31, 33), (43, 35, 44, 36))
SAMPLERS = pytest.mark.parametrize("sampler", ["independent", "stratified", "sobol"])

# What these have besides the other scenes' kinds are materials, media, priorities and textures, which know nothing of
# threads; glass that disperses, tests/kernel/test_dispersion.py knows.
LARGE = {"diamond", "metals", "nested", "next_week", "prism", "studio", "textures"} | GENERATED.keys()


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(path.stem, marks=[pytest.mark.slow] if path.stem in LARGE else [])
        for path in sorted(SCENES.glob("*.yaml"))
    ],
)
def test_threads_and_crops_do_not_matter(name):
    # The sampler of the references, so that both tests compile one kernel.
    need_files_of(name)
    keys = {"film.width": WIDTH, "film.height": HEIGHT, "render.spp": SPP, "render.sampler": "independent"}
    spec = load(SCENES / f"{name}.yaml", keys)
    one = render(spec, threads=1)
    assert one.stats.nan_samples == 0
    assert one.image.radiance.any()
    for threads in (2, 13):
        assert_same(render(spec, threads=threads), one)
    for left, top, right, bottom in CROPS:
        part = render(spec, crop=(left, top, right, bottom)).image.radiance
        np.testing.assert_array_equal(part, one.image.radiance[top:bottom, left:right])


@SAMPLERS
def test_threads_crops_tiles_and_passes_do_not_matter_to_a_sampler(monkeypatch, sampler):
    spec = halves(sampler=sampler)
    one = render(spec, threads=1)
    for left, top, right, bottom in CROPS:
        part = render(spec, crop=(left, top, right, bottom)).image.radiance
        np.testing.assert_array_equal(part, one.image.radiance[top:bottom, left:right])
    assert_same(render(spec, threads=4), one)
    monkeypatch.setattr(tile_scheduler, "TILE_SIZE", 7)
    assert_same_samples(render(spec, threads=2), one)
    for pass_end in (lambda begin, spp: min(spp, begin + PACKET), lambda begin, spp: spp):
        monkeypatch.setattr(tile_scheduler, "pass_end", pass_end)
        assert_same_samples(render(spec, threads=2), one)


@pytest.mark.parametrize("start", [0, 8, 24, 40, 1000])
def test_passes_cover_the_samples_in_whole_packets_and_end_at_powers_of_two(start):
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
def test_an_early_end_leaves_the_first_samples(sampler):
    # Time runs out: a pixel is then that of a render of as many samples as its tile has, whole packets of them.
    spec = halves(sampler=sampler)
    timed = render(spec, spp=1_000_000, threads=2, time_limit=0.1, aovs=["samples"])
    assert not timed.complete
    assert not timed.interrupted
    counts = timed.image.layers["samples"]
    assert counts.min() == timed.fewest_samples >= tile_scheduler.FIRST_PASS
    assert counts.max() == timed.image.samples
    for count in np.unique(counts)[[0, -1]]:
        assert count % PACKET == 0
        picture = render(spec, spp=int(count)).image.radiance
        np.testing.assert_array_equal(timed.image.radiance[counts == count], picture[counts == count])


@pytest.mark.parametrize(("sampler", "noise"), [("independent", 0.04), ("sobol", 0.03)])
def test_threads_do_not_matter_where_samples_go_where_the_error_is(sampler, noise):
    spec = halves(sampler=sampler)
    one = render(spec, noise=noise, threads=1, aovs=["samples"])
    # Otherwise it would only be a render with another number of samples.
    assert one.complete
    assert one.stats.pilot_samples > 0
    assert len(np.unique(one.image.layers["samples"])) > 1
    for threads in (2, 4):
        assert_same(render(spec, noise=noise, threads=threads, aovs=["samples"]), one)


@SAMPLERS
def test_seeds_matter(sampler):
    spec = halves(sampler=sampler)
    pictures = [render(spec, seed=seed).image.radiance for seed in (0, 1, 2**32 - 1)]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        # On the right, where there is noise.
        assert (pictures[a] != pictures[b])[:, WIDTH // 2 + 1 :].mean() > 0.9
    np.testing.assert_array_equal(render(spec, seed=1).image.radiance, pictures[1])


def test_neighbours_are_not_copies():
    # Noise that two pixels share would show: their errors must not be correlated.
    one, other = (render(halves(), seed=seed).image.radiance[:, WIDTH // 2 + 1 :, 0] for seed in (3, 4))
    noise = one - other
    for shifted in (np.roll(noise, 1, axis=1), np.roll(noise, 1, axis=0), np.roll(noise, (1, 1), axis=(0, 1))):
        correlation = (noise * shifted).mean() / (noise * noise).mean()
        # Heavy tails make the correlation of honest noise wider than that of normal noise, by 2 or so.
        assert abs(correlation) < 10.0 / np.sqrt(noise.size)


def digest():
    return hashlib.sha256(render(halves()).image.radiance.tobytes()).hexdigest()


def test_another_process_has_the_same_bits():
    program = "from tests.rendering.test_determinism import digest; print(digest(), end='')"
    assert run_python("-c", program) == digest()
