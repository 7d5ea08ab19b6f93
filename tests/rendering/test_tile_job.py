"""Samples that are taken elsewhere: the picture is the same to the last bit, in whatever order they come back."""

from collections import deque
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from raytracer import rendering, scheduling
from raytracer.accumulation import FilmView
from raytracer.aovs.interface import Aovs, Coverage, Mean, Vote
from raytracer.errands import Errand, Haul, arrays_of, brought, collected, take
from raytracer.errors import OutputError
from raytracer.interior import ranks_of
from raytracer.noise import Tally
from raytracer.paths import workspace
from raytracer.preparation import film_for, prepare, view
from raytracer.rendering import render
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import Canvas, Crew, Window, tiles
from tests.rendering import scene
from tests.test_adaptive import HALVES


class Others:
    """Others who are this very process; they bring the last errand of up to `ahead` first.

    Raises what `trouble` is after some errands.
    """

    threads = 3
    workers: Sequence[str] = ("one",)

    def __init__(self, ahead: int = 1, trouble: BaseException | None = None, after: int = 5) -> None:
        self.ahead, self.trouble, self.left = ahead, trouble, after
        self.errands: list[Errand] = []

    def engage(self, spec: SceneSpec, **settings: Any) -> "Others":
        self.prepared = prepare(spec)
        return self

    def run(
        self,
        draw: Callable[[], Errand | None],
        bring: Callable[[Errand, Haul], object],
        crew: Crew,
        deadline: float | None,
    ) -> None:
        out: deque[Errand] = deque()
        while not crew.stopped:
            while len(out) < self.ahead and (errand := draw()) is not None:
                out.append(errand)
            if not out:
                return
            self.left -= 1
            if self.trouble is not None and self.left < 0:
                raise self.trouble
            errand = out.pop()
            self.errands.append(errand)
            bring(errand, self.take(errand))
            crew.tick()

    def take(self, errand: Errand) -> Haul:
        size = scheduling.TILE
        target = view(film_for(self.prepared.scene, size, size))
        return take(self.prepared.scene, target, workspace(solids=ranks_of(self.prepared.scene.interior)), errand)


def halves(**settings: Any) -> SceneSpec:
    # Tiles of unequal size, and a last packet that is not whole.
    return scene(HALVES, **{"width": 44, "height": 36, "spp": 37, "max_depth": 4, **settings})


@pytest.mark.parametrize("ahead", [1, 4])
def test_bits_do_not_depend_on_where_samples_are_taken(ahead: int) -> None:
    here = render(halves(), threads=2)
    others = Others(ahead)
    far = render(halves(), cluster=others)
    assert len(others.errands) > 8
    assert far.complete
    np.testing.assert_array_equal(far.image.radiance, here.image.radiance)
    assert far.image.variance is not None
    assert here.image.variance is not None
    np.testing.assert_array_equal(far.image.variance, here.image.variance)
    assert far.stats.error == here.stats.error
    assert far.stats.rays == here.stats.rays
    assert (far.stats.threads, far.stats.workers) == (3, ["one"])


def test_bits_do_not_depend_on_it_where_samples_go_where_they_are_needed() -> None:
    here = render(halves(spp=2048), noise=0.02, threads=2)
    others = Others(ahead=3)
    far = render(halves(spp=2048), noise=0.02, cluster=others)
    assert any(errand.mean_only for errand in others.errands)
    np.testing.assert_array_equal(far.image.radiance, here.image.radiance)
    assert far.stats.error == here.stats.error
    assert far.stats.pilot_samples == here.stats.pilot_samples > 0
    assert far.stats.rays == here.stats.rays


def test_a_crop_goes_elsewhere_as_the_whole_picture_does() -> None:
    here = render(halves(), crop=(5, 3, 40, 30), threads=2)
    far = render(halves(), crop=(5, 3, 40, 30), cluster=Others(2))
    np.testing.assert_array_equal(far.image.radiance, here.image.radiance)


def test_what_has_come_back_is_kept_when_the_others_are_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    found = render(halves(), cluster=Others(trouble=OutputError("the cable is cut")))
    assert found.failure == "the cable is cut"
    assert not found.complete
    assert not found.interrupted
    assert 0 < found.stats.samples < 44 * 36 * 37
    monkeypatch.setattr(rendering, "_warn", lambda sentence: None)
    with pytest.raises(OutputError, match="the cable is cut"):
        rendering.render_image(halves(), cluster=Others(trouble=OutputError("the cable is cut")))


def test_an_interrupt_ends_work_elsewhere() -> None:
    found = render(halves(), cluster=Others(trouble=KeyboardInterrupt()))
    assert found.interrupted
    assert found.failure is None
    assert 0 < found.stats.samples < 44 * 36 * 37


# ---- What an errand takes along


def film(seed: int = 1, height: int = 20, width: int = 24) -> FilmView:
    """A film with something of everything that a film may gather, from pixel (100, 50) on."""
    random = np.random.default_rng(seed)

    def counts() -> Any:
        return random.integers(0, 100, (height, width))

    def values(channels: int) -> Any:
        return random.normal(size=(height, width, channels))

    layers = Aovs((Mean(None, values(4), 2, 3), Vote(None, counts(), counts(), 5), Coverage(values(2))))
    return FilmView(values(3), values(3), counts(), counts(), 100, 50, layers, values(4))


def test_an_errand_takes_along_all_that_a_film_gathers() -> None:
    whole = film()
    windows = (Window(100, 50, 116, 66), Window(116, 50, 124, 66), Window(100, 66, 116, 70))
    errand = Errand((0, 1, 2), windows, (8, 8, 8), (16, 16, 16), ((), (), ()), None, collected(whole, windows))
    assert errand.gathered is not None
    assert len(errand.gathered) == len(arrays_of(whole)) == 9
    haul = Haul(errand.gathered, np.zeros((0, 3)), np.zeros(3, dtype=np.int64), np.zeros(3))
    for window, found in zip(windows, brought(errand, haul), strict=True):
        rows, columns = slice(window.top - 50, window.bottom - 50), slice(window.left - 100, window.right - 100)
        for array, part in zip(arrays_of(whole), found.arrays, strict=True):
            np.testing.assert_array_equal(part, array[rows, columns])


def test_means_at_marks_come_back_with_their_tiles() -> None:
    windows = (Window(0, 0, 2, 1), Window(2, 0, 3, 2))
    errand = Errand((0, 1), windows, (0, 8), (32, 16), ((8, 16), ()), None, None, mean_only=True)
    noted = np.arange(12.0).reshape(4, 3)
    haul = Haul((np.ones((4, 3)),), noted, np.zeros(2, dtype=np.int64), np.zeros(2))
    first, second = brought(errand, haul)
    assert [mark for mark, _ in first.noted] == [8, 16]
    np.testing.assert_array_equal(first.noted[1][1], noted[2:].reshape(1, 2, 3))
    assert second.noted == ()


# ---- How much an errand is


class Clockwork(Others):
    """Others who take so many seconds for a sample of a tile, and no samples at all."""

    def __init__(self, pace: float, threads: int) -> None:
        super().__init__(ahead=2 * threads)
        self.pace, self.threads = pace, threads

    def take(self, errand: Errand) -> Haul:
        pixels = sum((right - left) * (bottom - top) for left, top, right, bottom in errand.windows)
        nothing = np.zeros((pixels, 3))
        counts = np.zeros(pixels, dtype=np.int64)
        noted = [
            np.zeros(((right - left) * (bottom - top) * len(marks), 3))
            for (left, top, right, bottom), marks in zip(errand.windows, errand.marks, strict=True)
        ]
        samples = np.subtract(errand.ends, errand.begins)
        return Haul((nothing, nothing, counts, counts), np.concatenate(noted), samples, self.pace * samples)


def canvas(others: Others, width: int, height: int) -> Canvas:
    """A film that gathers nothing."""
    blank = np.zeros((height, width, 3))
    counts = np.zeros((height, width), dtype=np.int64)
    windows = tiles(Window(0, 0, width, height))
    stub: Any = SimpleNamespace(sampler=None)
    return Canvas(stub, FilmView(blank, blank, counts, counts, 0, 0, None), windows, Crew(1), Tally(windows), others)


@pytest.mark.parametrize(
    ("pace", "threads", "width", "height"),
    [(1e-4, 1, 640, 360), (1e-4, 8, 640, 360), (1e-2, 4, 160, 90), (1, 4, 48, 32)],
)
def test_errands_are_worth_the_way_and_the_last_ones_are_short(
    pace: float, threads: int, width: int, height: int
) -> None:
    others = Clockwork(pace, threads)
    work = canvas(others, width, height)
    work.first_pass(1000)
    others.errands.clear()
    work.by_turns(1000)
    assert np.all(work.counts == 1000)
    np.testing.assert_array_equal(work.rays, 1000)

    # Each tile goes on where it was, and its mean is known at every power of two.
    at = dict.fromkeys(range(len(work.windows)), 8)
    seen: dict[int, list[int]] = {tile: [8] for tile in at}
    for errand in others.errands:
        for tile, begin, end, marks in zip(errand.tiles, errand.begins, errand.ends, errand.marks, strict=True):
            assert begin == at[tile] < end
            assert end == 1000 or end % 8 == 0
            at[tile] = end
            seen[tile] += [*marks, end]
    for stops in seen.values():
        assert {8, 16, 32, 64, 128, 256, 512} <= set(stops)

    seconds = [pace * float(np.subtract(errand.ends, errand.begins).sum()) for errand in others.errands]
    packet = 8 * pace
    assert max(seconds) <= max(2.0, packet) + 1e-9
    assert all(len(errand.tiles) <= 256 for errand in others.errands)
    # The way costs 15 ms: that is to be little of the whole, where this takes more than some seconds.
    assert len(seconds) * 0.015 <= max(0.03 * sum(seconds), 1.0 * threads)
    assert max(seconds[-threads:]) <= max(0.2, packet)


def test_an_end_by_the_clock_sends_nothing_that_would_be_late(monkeypatch: pytest.MonkeyPatch) -> None:
    time = 0.0
    monkeypatch.setattr(scheduling, "now", lambda: time)
    others = Clockwork(0.01, 2)
    others.ahead = 1
    work = canvas(others, 160, 90)
    work.first_pass(8)
    others.errands.clear()
    take_all = others.take

    def slowly(errand: Errand) -> Haul:
        nonlocal time
        haul = take_all(errand)
        time += float(haul.seconds.sum()) / others.threads
        return haul

    monkeypatch.setattr(others, "take", slowly)
    work.by_turns(10_000, deadline=30.0)
    assert 29.0 < time < 30.5
    assert work.counts.min() > 8
