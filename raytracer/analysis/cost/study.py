"""What accuracy costs in time, for one scene: get ready, predict, compare, report.

Each step is a function of what the steps before have found.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cost.arms import Variant, kept, select, variants
from raytracer.cost.compare import Basis, Names, floor_of, other_arm, rays_per_sample, scene_arm
from raytracer.cost.doubts import FEWEST_ROUNDS, FEWEST_TILES, Circumstances, doubts
from raytracer.cost.machine import load_average, machine
from raytracer.cost.measure import (
    MACHINE,
    Bench,
    Entry,
    Pilot,
    Purpose,
    Replicates,
    Rounds,
    Subject,
    compete,
    drawn,
    entered,
    extent_of_replicates,
    extent_of_round,
    levels_of,
    pilot,
    replicates,
    seeds,
    warm_up,
)
from raytracer.cost.plan import plan
from raytracer.cost.predict import Picture, Question, predict, relative
from raytracer.cost.results import Arm, PlanItem, Prediction, Study
from raytracer.cost.tiles import Tiles, part
from raytracer.errors import InputError
from raytracer.noise import Rate, steepest_of, top_share
from raytracer.scene.concerns import heed
from raytracer.scene.objects import Assets
from raytracer.scene.pack import Packed, pack
from raytracer.scene.spec import SceneSpec
from raytracer.scheduling import Window, available_threads
from raytracer.scheduling import tiles as tiles_of

Array = NDArray[np.float64]

PREDICTION_SECONDS = 60.0
"""About how long the scene is rendered for its prediction."""

COMPARISON_SECONDS = 120.0
"""About how long arms are rendered, if there are not very many or few of them."""

ROUNDS = 9
"""How often each arm is rendered."""

MOST_ROUNDS = 1000
"""Rounds of which the pictures are kept, at least a tile of each arm."""

# Rounds that tell noise at all, of those that there are when a comparison is ended early.
_FEWEST_FINISHED = 2

_SCENE = Names("scene", "scene", "the scene as it is")

# Below this, the worst 0.1 % are less than a pixel.
_FEWEST_FOR_SHARE = 1000


class Progress(NamedTuple):
    """What is being done, and what fraction of it is."""

    phase: str
    fraction: float


class Asked(NamedTuple):
    """What the user wants: see `study`."""

    target: float
    budget: float | None
    rounds: int
    arms: Sequence[str] | None
    tiles: int | None
    threads: int
    seed: int


class Ready(NamedTuple):
    """A scene that is warm: its tiles, samples per second, and a first look at the picture if that is quick."""

    subject: Subject
    windows: Sequence[Window]
    pace: float
    pilot: Pilot | None


class Measured(NamedTuple):
    """The scene's replicates: scale, the picture's mean; weight (P, 3) of squared errors."""

    replicates: Replicates
    scale: float
    weight: Array


class Contest(NamedTuple):
    """What became of the arms: rows of the table, whole rounds, and samples that were not finite."""

    arms: tuple[Arm, ...] = ()
    rounds: int = 0
    bad: int = 0
    interrupted: bool = False


def study(
    spec: SceneSpec,
    *,
    target: float = 0.01,
    budget: float | None = None,
    rounds: int = ROUNDS,
    arms: Sequence[str] | None = None,
    tiles: int | None = None,
    threads: int | None = None,
    seed: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    name: str = "scene",
    load_seconds: float = 0.0,
    bench: Bench = MACHINE,
    warn: Callable[[str], object] | None = None,
) -> Study:
    """Measure what a scene's accuracy costs, on some tiles of its picture.

    Parameters
    ----------
    target : relative error to be reached, such as 0.01.
    budget : seconds that a render may take; None if that is not asked.
    rounds : how often each arm is rendered, 9 to 1000.
    arms : names of variants; all if None, no comparison if empty.
    tiles : how many 16 x 16 tiles of the picture are measured, 16 or more, or all; as many as there is time for if
        None.
    threads : how many work; all processors if None.
    seed : of all random numbers; the scene's if None.
    progress : told what is being done.
    name : of the scene, in the report.
    load_seconds : what loading the scene took, which is a part of every render's time.
    bench : what does the work.
    warn : told what the scene makes one doubt, a sentence each (docs/warnings.md).

    Returns
    -------
    What was found.  An interrupt while arms are measured ends that, and what there is by then is returned.

    Raises
    ------
    InputError : a target, budget, number or name that makes no sense, or a scene that cannot be packed.
    """
    own_seed = spec.render.seed if seed is None else seed
    asked = Asked(target, budget, rounds, arms, tiles, threads or available_threads(), own_seed)
    _check(asked, len(_tiles_of(spec)))
    load = load_average()
    clock = _Clock(progress, load_seconds)

    with clock.phase("pack"):
        packed = pack(spec)
    heed(packed, warn)
    with clock.phase("plan"):
        chosen = _chosen(packed, asked)
        items = plan(spec, packed)
    with clock.phase("prepare"):
        prepared = bench.prepare(spec, packed)
    with clock.phase("warm up"):
        ready = _warmed(Subject(prepared, bench, asked.threads), asked)
    with clock.phase("predict") as tell:
        measured = _measured(ready, asked, tell)
        picture = _picture(ready, measured)
    with clock.phase("develop"):
        develop_seconds = bench.develop(prepared, np.where(np.isnan(picture), measured.scale, picture))
    _note_parts(clock.seconds, prepared.seconds, develop_seconds)
    rays = ready.pilot.rays if ready.pilot else math.nan
    whole = Picture(picture.shape[0] * picture.shape[1], rays, asked.threads, _fixed(clock.seconds))
    prediction = predict(
        measured.replicates,
        measured.scale,
        whole,
        Question(asked.target, asked.budget),
        steepest_of(ready.subject.sampler),
        asked.seed,
    )
    # There is nothing to compare in the dark.
    chosen = chosen if measured.scale > 0.0 else []
    contest = _contest(ready, measured, prediction, whole, chosen, asked, clock)
    return _report(name, items, ready, measured, picture, prediction, contest, clock.seconds, load, asked)


# ---- Steps


def _tiles_of(spec: SceneSpec) -> list[Window]:
    """All tiles of the picture."""
    return tiles_of(Window(0, 0, *spec.picture()))


def _check(asked: Asked, tiles: int) -> None:
    """Refuse what makes no sense for a picture of so many tiles."""
    if not 0.0 < asked.target < 1.0:
        raise InputError(f"target {asked.target:g}: must be greater than 0 and less than 1, which is 100 %")
    if asked.budget is not None and not 0.0 < asked.budget < math.inf:
        raise InputError(f"budget {asked.budget:g}: must be a time greater than 0")
    for name, value, least in (
        ("rounds", asked.rounds, FEWEST_ROUNDS),
        ("tiles", asked.tiles, min(FEWEST_TILES, tiles)),
        ("threads", asked.threads, 1),
    ):
        if value is not None and value < least:
            raise InputError(f"{name} {value}: must be at least {least}")
    if asked.rounds > MOST_ROUNDS:
        raise InputError(f"rounds {asked.rounds}: must be at most {MOST_ROUNDS}, since the pictures of all are kept")


def _chosen(packed: Packed, asked: Asked) -> list[Variant]:
    """The variants that are measured; the control among them, if there are any."""
    if asked.arms is None:
        return variants(packed.spec, packed)
    if not asked.arms:
        return []
    return select(variants(packed.spec, packed), asked.arms, kept(packed.spec, packed))


def _warmed(subject: Subject, asked: Asked) -> Ready:
    windows = _tiles_of(subject.prepared.spec)
    pace = warm_up(subject, windows, asked.seed)
    return Ready(subject, windows, pace, pilot(subject, windows, PREDICTION_SECONDS, pace, asked.seed))


def _measured(ready: Ready, asked: Asked, tell: Callable[[float], None]) -> Measured:
    size = extent_of_replicates(ready.windows, PREDICTION_SECONDS, ready.pace, asked.tiles)
    sample = drawn(ready.windows, size.tiles, ready.pilot, asked.seed)
    levels = levels_of(size.spp, ready.subject.is_progressive)
    found = replicates(ready.subject, sample, levels, asked.seed, tell)
    best = found.means[levels[-1]].mean(axis=0)
    scale = _scale(ready, sample, best)
    return Measured(found, scale, relative(best, scale))


def _scale(ready: Ready, sample: Tiles, best: Array) -> float:
    """Size of the picture's mean, from what is known of some tiles, `best` (P, 3), and the pilot's look at all of them.

    The pilot's mean is corrected by what it is wrong by in the tiles that have been measured: it has so few samples
    that all of them may have missed a small light.

    References: Särndal, Swensson and Wretman 1992, "Model Assisted Survey Sampling", section 6.3 (the difference
        estimator).
    """
    stands = sample.weight[sample.owner]
    if ready.pilot is None:
        return abs(float(np.average(best.mean(axis=1), weights=stands)))
    place = {window: tile for tile, window in enumerate(ready.windows)}
    seen = np.isin(ready.pilot.tiles.owner, [place[window] for window in sample.windows])
    wrong = (best - ready.pilot.mean[seen]).mean(axis=1)
    return abs(float(ready.pilot.mean.mean() + (stands @ wrong) / len(ready.pilot.mean)))


def _picture(ready: Ready, measured: Measured) -> Array:
    """The best of what was rendered, (height, width, 3), nan where nothing was."""
    width, height = ready.subject.prepared.spec.picture()
    picture = np.full((height, width, 3), math.nan)
    if ready.pilot:
        ready.pilot.tiles.spread(ready.pilot.mean, picture)
    found = measured.replicates
    found.tiles.spread(found.means[found.levels[-1]].mean(axis=0), picture)
    return picture


def _note_parts(seconds: dict[str, float], prepared: dict[str, float], develop: float) -> None:
    """Tell the parts of making a scene ready, in place of their sum."""
    del seconds["prepare"]
    seconds |= {"build": prepared["build"], "compile": prepared["compile"], "develop": develop}


def _fixed(seconds: dict[str, float]) -> float:
    """Seconds that a render takes besides its samples, and besides compiling, which is done once for many."""
    return sum(seconds[phase] for phase in ("load", "pack", "build", "develop"))


def _contest(
    ready: Ready,
    measured: Measured,
    prediction: Prediction,
    whole: Picture,
    chosen: Sequence[Variant],
    asked: Asked,
    clock: "_Clock",
) -> Contest:
    """Measure the scene and its variants against each other."""
    if not chosen:
        return Contest()
    tiles = measured.replicates.tiles
    turns = asked.rounds * (len(chosen) + 1)
    size = extent_of_round(tiles.windows, COMPARISON_SECONDS / turns, ready.pace, asked.tiles, turns)
    sample, pixels = part(tiles, size.tiles, np.random.default_rng(asked.seed))
    try:
        with clock.phase("compile arms") as tell:
            arms = _entered(ready.subject, chosen, sample.windows, tell)
    except KeyboardInterrupt:
        return Contest(interrupted=True)
    with clock.phase("compare") as tell:
        all_rounds = compete(_entries(ready.subject, arms, asked), sample, size.spp, asked.rounds, tell)
    if not all_rounds or len(all_rounds[0].mean) < _FEWEST_FINISHED:
        return Contest(interrupted=True)
    scene, *others = all_rounds

    # The weights are from other samples than those that they weigh: else what is dark by chance would count for more.
    basis = Basis(
        scene=scene,
        tiles=sample,
        weight=measured.weight[pixels],
        prediction=prediction,
        rate=Rate(prediction.linear, prediction.steep, prediction.early),
        picture=whole,
        rays=rays_per_sample(measured.replicates, whole),
        seed=asked.seed,
    )
    rows = _rows(basis, chosen, arms, others)
    bad = sum(rounds.bad for rounds in all_rounds)
    return Contest((scene_arm(basis, _SCENE), *rows), len(scene.mean), bad, len(scene.mean) < asked.rounds)


def _entered(
    scene: Subject, chosen: Sequence[Variant], windows: Sequence[Window], tell: Callable[[float], None]
) -> list[Subject | str]:
    """Each variant made ready and warm, or one sentence why that cannot be."""
    arms: list[Subject | str] = []
    assets = Assets(scene.prepared.spec)
    for number, variant in enumerate(chosen):
        try:
            arms.append(entered(scene, variant, windows, assets))
        except InputError as error:
            arms.append(str(error))
        tell((number + 1) / len(chosen))
    return arms


def _entries(scene: Subject, arms: Sequence[Subject | str], asked: Asked) -> list[Entry]:
    """The scene and the arms that can take part.

    In a round all have the same seed, since what random numbers they share is no part of a difference.  The control
    has seeds of its own: it is to show what differs by chance.
    """
    subjects = [arm for arm in arms if isinstance(arm, Subject)]
    common, own = (seeds(asked.seed, purpose, asked.rounds) for purpose in (Purpose.ROUND, Purpose.CONTROL))
    sloped = any(arm.sampler != scene.sampler for arm in subjects)
    return [
        Entry(scene, common, sloped),
        *(Entry(arm, own if arm is scene else common, arm.sampler != scene.sampler) for arm in subjects),
    ]


def _rows(
    basis: Basis, chosen: Sequence[Variant], arms: Sequence[Subject | str], others: Sequence[Rounds]
) -> Iterator[Arm]:
    """A row for each variant; the first is the control, which tells what a difference is."""
    remaining = iter(others)
    floor = floor_of(basis, others[0])
    for variant, arm in zip(chosen, arms, strict=True):
        names = Names(variant.name, variant.group, variant.what)
        if isinstance(arm, str):
            yield Arm(*names, failed=arm)
        else:
            yield other_arm(basis, names, next(remaining), arm.sampler, floor, same_mean=variant.same_mean)


def _report(
    name: str,
    items: tuple[PlanItem, ...],
    ready: Ready,
    measured: Measured,
    picture: Array,
    prediction: Prediction,
    contest: Contest,
    seconds: dict[str, float],
    load: float | None,
    asked: Asked,
) -> Study:
    """All that was found."""
    found = measured.replicates
    width, height = ready.subject.prepared.spec.picture()
    last = found.means[found.levels[-1]]
    errors = np.full((height, width), math.nan)
    found.tiles.spread(np.sqrt(np.mean(measured.weight * last.var(axis=0, ddof=1), axis=1)), errors)
    share = math.nan
    if last.shape[1] >= _FEWEST_FOR_SHARE:
        share = top_share(last, measured.weight, stands=found.tiles.weight[found.tiles.owner])
    circumstances = Circumstances(
        prediction=prediction,
        tiles=len(ready.windows),
        tiles_measured=len(found.tiles.windows),
        scale=measured.scale,
        top_share=share,
        bad=found.bad + contest.bad,
        rounds=contest.rounds,
        rounds_asked=asked.rounds,
        interrupted=contest.interrupted,
        load=load,
        threads=asked.threads,
        processors=available_threads(),
    )
    return Study(
        scene=name,
        width=width,
        height=height,
        plan=items,
        prediction=prediction,
        arms=contest.arms,
        seconds=seconds,
        machine={
            **machine(),
            "threads": asked.threads,
            "processors": available_threads(),
            "load_before": load,
            "load_after": load_average(),
            "seed": asked.seed,
            "rounds": contest.rounds,
            "samples_per_round": contest.arms[0].spp if contest.arms else 0,
        },
        warnings=doubts(circumstances),
        tiles=len(ready.windows),
        tiles_measured=len(found.tiles.windows),
        top_share=share,
        error_map=errors,
        picture=picture,
        interrupted=contest.interrupted,
        rounds=contest.rounds,
    )


class _Clock:
    """Seconds by phase; tells what is being done."""

    def __init__(self, progress: Callable[[Progress], None] | None, load_seconds: float) -> None:
        self._progress = progress or (lambda _: None)
        self.seconds = {"load": load_seconds}

    @contextmanager
    def phase(self, name: str) -> Iterator[Callable[[float], None]]:
        """Time what is done within, which is given a function to tell what fraction of it is done."""
        start = time.perf_counter()
        self._progress(Progress(name, 0.0))
        try:
            yield lambda fraction: self._progress(Progress(name, fraction))
        finally:
            self.seconds[name] = time.perf_counter() - start
