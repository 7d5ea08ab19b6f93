"""Rounds of renders of a scene and its variants, in turn and on the same tiles."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.bench import Subject
from raytracer.analysis.cost.tile_sample import TileSample
from raytracer.analysis.cost.variants import Variant
from raytracer.core.embree import PACKET
from raytracer.film.window import Window
from raytracer.scene.pack.scene import PackedScene
from raytracer.scene.scene_assets import SceneAssets

Array = NDArray[np.float64]

# Early means are taken at the samples of a round divided by this, if that is an integer number of packets.
_EARLY = 4


def shares_accel(a: PackedScene, b: PackedScene) -> bool:
    """Tell if one ray caster's structure serves both scenes: it takes most of the memory of a large scene."""
    one, other = a.accel_input(), b.accel_input()
    if (one.robust, one.first_instance) != (other.robust, other.first_instance):
        return False
    return all(_equal(*pair) for pair in zip(one[:3], other[:3], strict=True))


def _equal(a: Any, b: Any) -> bool:
    """Tell if nested tuples, lists and mappings hold equal arrays."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a is b or (a.dtype == b.dtype and np.array_equal(a, b))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_equal(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)) and isinstance(b, (tuple, list)):
        return len(a) == len(b) and all(map(_equal, a, b))
    return bool(a == b)


def prepare_variant(scene: Subject, variant: Variant, windows: Sequence[Window], assets: SceneAssets) -> Subject:
    """Compile and warm up a variant of a subject; the control is the subject itself.

    assets : the scene's files.

    Raises
    ------
    InputError : the variant cannot be packed.
    """
    if variant.group == "control":
        return scene
    prepared = scene.prepared
    spec = variant.spec_variant(prepared.spec)
    if variant.needs_repacking:
        packed = variant.pack(prepared.spec, assets)
        if shares_accel(packed, prepared.packed):
            packed = packed._replace(built=prepared.accel)
        prepared = scene.bench.prepare(spec, packed)
    subject = scene._replace(prepared=prepared._replace(spec=spec, scene=variant.packed_variant(prepared.scene)))
    subject.render(windows, PACKET, spec.render.seed)
    return subject


class VariantRun(NamedTuple):
    """A variant to be rendered.

    subject : the compiled variant.
    seeds : one for each round.
    needs_slope : True to measure how its error falls with samples.
    """

    subject: Subject
    seeds: Sequence[int]
    needs_slope: bool


class Rounds(NamedTuple):
    """Results of a variant in R rounds.

    spp : samples per pixel of `mean`.
    mean : (R, P, 3).
    early : (R, P, 3), means at `early_spp`, or None.
    busy : (R, T), seconds of a thread for one sample in every pixel of a tile.
    rays : (R, T), rays for the same.
    dropped : int64 (R,), samples that were not finite.
    """

    spp: int
    mean: Array
    early: Array | None
    busy: Array
    rays: Array
    dropped: NDArray[np.int64]

    @classmethod
    def workspace(cls, entry: VariantRun, tiles: TileSample, spp: int, rounds: int) -> "Rounds":
        """Allocate the results of rounds that are to be rendered."""
        pictures, by_tile = (rounds, int(tiles.pixels.sum()), 3), (rounds, len(tiles.windows))
        early = np.empty(pictures) if entry.needs_slope and (spp // _EARLY) % PACKET == 0 else None
        return cls(spp, np.empty(pictures), early, np.empty(by_tile), np.empty(by_tile), np.empty(rounds, np.int64))

    def first(self, rounds: int) -> "Rounds":
        """Return the first `rounds` of them."""
        early = None if self.early is None else self.early[:rounds]
        return Rounds(
            self.spp, self.mean[:rounds], early, self.busy[:rounds], self.rays[:rounds], self.dropped[:rounds]
        )

    @property
    def early_spp(self) -> int:
        """Samples per pixel of the early mean."""
        return self.spp // _EARLY

    @property
    def bad(self) -> int:
        """Number of samples that were not finite."""
        return int(self.dropped.sum())


def variant_order(count: int, turn: int) -> list[int]:
    """Order of variants in a round: in as many rounds as there are variants, each is at each place once."""
    return [(turn + place) % count for place in range(count)]


def render_rounds(
    entries: Sequence[VariantRun], tiles: TileSample, spp: int, rounds: int, tick: Callable[[float], None]
) -> list[Rounds]:
    """Render all variants on the same tiles, round by round; an interrupt ends it after the last complete round.

    Returns
    -------
    The rounds of each entry; none if no round was completed.
    """
    results = [Rounds.workspace(entry, tiles, spp, rounds) for entry in entries]
    completed = 0
    try:
        for turn in range(rounds):
            for place, number in enumerate(variant_order(len(entries), turn)):
                _render_turn(entries[number], tiles, turn, results[number])
                tick((turn + (place + 1) / len(entries)) / rounds)
            completed += 1
    except KeyboardInterrupt:
        pass
    return [result.first(completed) for result in results] if completed else []


def _render_turn(entry: VariantRun, tiles: TileSample, turn: int, result: Rounds) -> None:
    """Render a variant once, and store its results."""
    subject, seed, spp, early_spp = entry.subject, entry.seeds[turn], result.spp, result.early_spp
    if result.early is None:
        patch = subject.render(tiles.windows, spp, seed)
    elif subject.is_progressive:
        patch = subject.render(tiles.windows, spp, seed, (early_spp,))
        result.early[turn] = tiles.flat(patch.levels[early_spp])
    else:
        result.early[turn] = tiles.flat(subject.render(tiles.windows, early_spp, seed).mean)
        patch = subject.render(tiles.windows, spp, seed)
    result.mean[turn], result.dropped[turn] = tiles.flat(patch.mean), patch.nan_samples
    result.busy[turn], result.rays[turn] = patch.busy / spp, patch.rays / spp
