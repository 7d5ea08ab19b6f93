"""Renders what is measured: replicates of a scene, and rounds of a scene and its variants.

What needs the machine comes in a `Bench`, so that tests run on made-up pictures and times.
"""

import enum
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cost.arms import Variant
from raytracer.cost.tiles import Tiles, choose
from raytracer.development import finish
from raytracer.embree import PACKET
from raytracer.film.film import Film
from raytracer.noise import mse_by_tile, scale_of, weights
from raytracer.preparation import Patch, Prepared, prepare, render_tiles
from raytracer.sampling import SAMPLERS
from raytracer.scene.objects import Assets
from raytracer.scene.pack import Packed
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import TILE, Window

Array = NDArray[np.float64]

REPLICATES = 4

# The first measurement of the pace takes as many samples as this lasts for, in seconds.
_WARM_SECONDS = 0.25

# What the pilot may take of the time for the prediction, and its samples in each of two pictures.
_PILOT_SHARE = 0.2
_PILOT_SPP = 8

# Tiles are drawn half evenly, half by the pilot's error: a tile that the pilot misjudges counts at most twice as much.
_EVEN_SHARE = 0.5

# Samples of a run, and with how many tiles it is preferred to one of fewer samples on more tiles.
_RUNS = ((4096, 1024), (1024, 256), (256, 16), (64, 8), (16, 2))
_FIRST_LEVEL = 16

# The same for one round of an arm, of which the means are kept; and how many seconds it takes, of those for all.
_ROUND_RUNS = ((1024, 64), (256, 64), (64, 16), (32, 16), (16, 8), (8, 2))
_MOST_TILES = 192
_MOST_BYTES = 2**30
_BYTES_OF_TILE = 3 * 8 * TILE * TILE
_ROUND_SECONDS = (0.2, 1.0)

# An early mean is kept at this fraction of a round's samples, if that is a whole number of packets.
_EARLY = 4


def develop(prepared: Prepared, picture: Array) -> float:
    """Seconds that it takes to make an image of a film with these means (height, width, 3)."""
    height, width, _ = picture.shape
    film = Film.empty(width, height)
    film.mean[...], film.count[...] = picture, 2
    start = time.perf_counter()
    finish(film, prepared.spec)
    return time.perf_counter() - start


class Bench(NamedTuple):
    """What does the work: functions of `preparation`, and `develop`; tests put others in their place."""

    prepare: Callable[[SceneSpec, Packed | None], Prepared]
    render: Callable[[Prepared, Sequence[Window], int, int, int, Sequence[int]], Patch]
    develop: Callable[[Prepared, Array], float]


MACHINE = Bench(prepare, render_tiles, develop)


class Subject(NamedTuple):
    """A scene that is ready, and how it is rendered."""

    prepared: Prepared
    bench: Bench
    threads: int

    def render(self, windows: Sequence[Window], spp: int, seed: int, keep: Sequence[int] = ()) -> Patch:
        """See `preparation.render_tiles`."""
        return self.bench.render(self.prepared, windows, spp, seed, self.threads, keep)

    @property
    def sampler(self) -> str:
        """Its name."""
        return self.prepared.spec.render.sampler

    @property
    def is_progressive(self) -> bool:
        """Whether the first samples of a long run are those of a short one."""
        short, long = (SAMPLERS[self.sampler](0, spp) for spp in (_FIRST_LEVEL, 2 * _FIRST_LEVEL))
        return short == long


class Purpose(enum.IntEnum):
    """What seeds are drawn for."""

    PILOT = 1
    REPLICATE = 2
    ROUND = 3
    CONTROL = 4


def seeds(seed: int, purpose: Purpose, count: int) -> list[int]:
    """Seeds that have nothing to do with each other, nor with those of another purpose."""
    return [int(state) for state in np.random.SeedSequence((seed, purpose)).generate_state(count)]


# ---- How fast, and where the noise is


def warm_up(subject: Subject, windows: Sequence[Window], seed: int) -> float:
    """Samples per second of all threads, once caches are warm: ever more of the picture, until it can be told."""
    rng = np.random.default_rng(seed)
    count, spp = 1, PACKET
    while True:
        tiles = choose(windows, count, rng)
        patch = subject.render(tiles.windows, spp, seed)
        if patch.busy.sum() >= _WARM_SECONDS * subject.threads:
            return float(tiles.pixels.sum() * spp * subject.threads / patch.busy.sum())
        # Four times the work: more of the picture first, then more samples.
        more = min(4 * count, len(windows))
        count, spp = more, spp * max(1, (4 * count) // more)


class Pilot(NamedTuple):
    """A first look at the whole picture.

    mean (P, 3), and its scale; squares (T,), the squared error of each tile; rays, that a sample in every pixel takes.
    """

    tiles: Tiles
    mean: Array
    scale: float
    squares: Array
    rays: float


def pilot(subject: Subject, windows: Sequence[Window], seconds: float, pace: float, seed: int) -> Pilot | None:
    """Two pictures of a few samples; None if that takes too much of the seconds there are."""
    tiles = choose(windows, len(windows), np.random.default_rng(seed))
    if 2 * _PILOT_SPP * tiles.pixels.sum() / pace > _PILOT_SHARE * seconds:
        return None
    patches = [subject.render(windows, _PILOT_SPP, own) for own in seeds(seed, Purpose.PILOT, 2)]
    pictures = np.stack([tiles.flat(patch.mean) for patch in patches])
    mean = pictures.mean(axis=0)
    scale = scale_of(mean)
    squares = mse_by_tile(pictures, weights(mean, scale), tiles.owner).sums
    return Pilot(tiles, mean, scale, squares, sum(float(patch.rays.sum()) for patch in patches) / (2 * _PILOT_SPP))


def drawn(windows: Sequence[Window], count: int, first_look: Pilot | None, seed: int) -> Tiles:
    """A sample of `count` tiles, most where the pilot saw most noise."""
    size = None
    if first_look is not None and (total := float(first_look.squares.sum())) > 0.0:
        size = _EVEN_SHARE / len(windows) + (1.0 - _EVEN_SHARE) * first_look.squares / total
    return choose(windows, count, np.random.default_rng(seed), size)


# ---- Replicates of the scene


class Extent(NamedTuple):
    """How much is rendered: samples of each pixel, and how many tiles."""

    spp: int
    tiles: int


def extent(
    windows: Sequence[Window],
    samples: float,
    runs: Sequence[tuple[int, int]],
    tiles: int | None = None,
) -> Extent:
    """What a number of samples is spent on: as many tiles as they buy, and more samples in each if tiles abound.

    Parameters
    ----------
    runs : samples of a pixel, falling, and how many tiles are enough to afford them.
    tiles : how many, if the user has said so.
    """
    pixels = sum((w.right - w.left) * (w.bottom - w.top) for w in windows) / len(windows)
    for spp, enough in runs:
        affordable = int(samples / (spp * pixels))
        if affordable >= min(enough if tiles is None else tiles, len(windows)):
            break
    return Extent(spp, min(max(affordable, enough) if tiles is None else tiles, len(windows)))


def extent_of_replicates(windows: Sequence[Window], seconds: float, pace: float, tiles: int | None) -> Extent:
    """What all replicates together take so many seconds for."""
    return extent(windows, seconds * pace / REPLICATES, _RUNS, tiles)


def extent_of_round(windows: Sequence[Window], seconds: float, pace: float, tiles: int | None, turns: int) -> Extent:
    """What an arm takes about so many seconds for, a fraction of one or one.

    turns : how many means are kept, of all arms in all rounds: the more, the fewer tiles.
    """
    least, most = _ROUND_SECONDS
    room = max(1, min(_MOST_TILES, _MOST_BYTES // (turns * _BYTES_OF_TILE)))
    asked = None if tiles is None else min(tiles, room)
    size = extent(windows, min(max(seconds, least), most) * pace, _ROUND_RUNS, asked)
    return size._replace(tiles=min(size.tiles, room))


def levels_of(spp: int, is_progressive: bool) -> tuple[int, ...]:
    """Samples at which the error is looked at on the way to `spp`: powers of two, or of four if each is a run."""
    last = spp.bit_length() - 1
    first = min(_FIRST_LEVEL.bit_length() - 1, last - 1)
    return tuple(1 << k for k in range(last, first - 1, -1 if is_progressive else -2))[::-1]


class Replicates(NamedTuple):
    """R renders of the same tiles with nothing in common.

    means, by spp, (R, P, 3), each what a render of that many samples holds; busy (R, T), seconds of a thread for one
    sample in every pixel of a tile; rays (R, T), for the same; bad, samples that were not finite.
    """

    tiles: Tiles
    means: dict[int, Array]
    busy: Array
    rays: Array
    bad: int

    @property
    def levels(self) -> tuple[int, ...]:
        """Samples per pixel, rising."""
        return tuple(self.means)


def replicates(
    subject: Subject, tiles: Tiles, levels: Sequence[int], seed: int, tick: Callable[[float], None]
) -> Replicates:
    """Render them.  `tick` is called with what fraction is done."""
    runs = seeds(seed, Purpose.REPLICATE, REPLICATES)
    means: dict[int, list[Array]] = {spp: [] for spp in levels}
    busy, rays, bad = [], [], 0
    for number, own in enumerate(runs):
        for keep, spp in _runs(levels, subject.is_progressive):
            patch = subject.render(tiles.windows, spp, own, keep)
            for n in keep:
                means[n].append(tiles.flat(patch.levels[n]))
            bad += patch.nan_samples
        busy.append(patch.busy / levels[-1])
        rays.append(patch.rays / levels[-1])
        tick((number + 1) / len(runs))
    return Replicates(
        tiles, {spp: np.stack(parts) for spp, parts in means.items()}, np.stack(busy), np.stack(rays), bad
    )


def _runs(levels: Sequence[int], is_progressive: bool) -> list[tuple[tuple[int, ...], int]]:
    """Which levels each render yields, and its samples: one render all of them, if its sampler lets it."""
    return [(tuple(levels), levels[-1])] if is_progressive else [((spp,), spp) for spp in levels]


# ---- Rounds of variants


def casts_alike(a: Packed, b: Packed) -> bool:
    """Whether one ray caster's structure does for both: it takes most of the memory of a large scene."""
    if a.robust != b.robust or len(a.scene.primitives) != len(b.scene.primitives):
        return False
    return all(
        _equal(*pair) for pair in ((a.geometries, b.geometries), (a.groups, b.groups), (a.placements, b.placements))
    )


def _equal(a: Any, b: Any) -> bool:
    """Whether nested tuples, lists and mappings hold equal arrays."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a is b or (a.dtype == b.dtype and np.array_equal(a, b))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_equal(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)) and isinstance(b, (tuple, list)):
        return len(a) == len(b) and all(map(_equal, a, b))
    return bool(a == b)


def entered(scene: Subject, variant: Variant, windows: Sequence[Window], assets: Assets) -> Subject:
    """A variant of a subject, compiled and warm; one that differs in nothing is the subject itself.

    assets : the scene's files.

    Raises
    ------
    InputError : the variant cannot be packed.
    """
    if variant.group == "control":
        return scene
    prepared = scene.prepared
    spec = variant.respec(prepared.spec)
    if variant.packs_anew:
        packed = variant.pack(prepared.spec, assets)
        if casts_alike(packed, prepared.packed):
            packed = packed._replace(built=prepared.accel)
        prepared = scene.bench.prepare(spec, packed)
    subject = scene._replace(prepared=prepared._replace(spec=spec, scene=variant.repack(prepared.scene)))
    subject.render(windows, PACKET, spec.render.seed)
    return subject


class Entry(NamedTuple):
    """An arm that takes part: what is rendered, its seeds by round, and whether its slope is to be told."""

    subject: Subject
    seeds: Sequence[int]
    sloped: bool


class Rounds(NamedTuple):
    """An arm in R rounds.

    mean (R, P, 3), at `spp` samples; early (R, P, 3), at `early_spp`, or None; busy (R, T), seconds of a thread, and
    rays (R, T), for one sample in every pixel of a tile; dropped int64 (R,), samples that were not finite.
    """

    spp: int
    mean: Array
    early: Array | None
    busy: Array
    rays: Array
    dropped: NDArray[np.int64]

    @classmethod
    def room(cls, entry: Entry, tiles: Tiles, spp: int, rounds: int) -> "Rounds":
        """Room for rounds that are still to be rendered."""
        pictures, by_tile = (rounds, int(tiles.pixels.sum()), 3), (rounds, len(tiles.windows))
        is_sloped = entry.sloped and (spp // _EARLY) % PACKET == 0
        return cls(
            spp,
            np.empty(pictures),
            np.empty(pictures) if is_sloped else None,
            np.empty(by_tile),
            np.empty(by_tile),
            np.empty(rounds, dtype=np.int64),
        )

    def first(self, rounds: int) -> "Rounds":
        """Some of them."""
        early = None if self.early is None else self.early[:rounds]
        return Rounds(
            self.spp, self.mean[:rounds], early, self.busy[:rounds], self.rays[:rounds], self.dropped[:rounds]
        )

    @property
    def early_spp(self) -> int:
        """Samples of the early mean."""
        return self.spp // _EARLY

    @property
    def bad(self) -> int:
        """Samples that were not finite."""
        return int(self.dropped.sum())


def rotation(arms: int, turn: int) -> list[int]:
    """The order of arms in a round: in as many rounds as there are arms, each is at each place once."""
    return [(turn + place) % arms for place in range(arms)]


def compete(
    entries: Sequence[Entry], tiles: Tiles, spp: int, rounds: int, tick: Callable[[float], None]
) -> list[Rounds]:
    """Render all arms on the same tiles, round by round; an interrupt ends it with what whole rounds there are.

    Returns
    -------
    What each arm did; nothing if no round was completed.
    """
    found = [Rounds.room(entry, tiles, spp, rounds) for entry in entries]
    whole = 0
    try:
        for turn in range(rounds):
            for place, arm in enumerate(rotation(len(entries), turn)):
                _take_turn(entries[arm], tiles, turn, found[arm])
                tick((turn + (place + 1) / len(entries)) / rounds)
            whole += 1
    except KeyboardInterrupt:
        pass
    return [arm.first(whole) for arm in found] if whole else []


def _take_turn(entry: Entry, tiles: Tiles, turn: int, found: Rounds) -> None:
    """Render an arm once, and note what was found."""
    subject, seed, spp, early_spp = entry.subject, entry.seeds[turn], found.spp, found.early_spp
    if found.early is None:
        patch = subject.render(tiles.windows, spp, seed)
    elif subject.is_progressive:
        patch = subject.render(tiles.windows, spp, seed, (early_spp,))
        found.early[turn] = tiles.flat(patch.levels[early_spp])
    else:
        found.early[turn] = tiles.flat(subject.render(tiles.windows, early_spp, seed).mean)
        patch = subject.render(tiles.windows, spp, seed)
    found.mean[turn], found.dropped[turn] = tiles.flat(patch.mean), patch.nan_samples
    found.busy[turn], found.rays[turn] = patch.busy / spp, patch.rays / spp
