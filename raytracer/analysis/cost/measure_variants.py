"""Measurement of a scene's variants against the scene, in rounds."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from raytracer.analysis.cost.bench import Purpose, StudyTimer, Subject, seeds
from raytracer.analysis.cost.compare import Baseline, baseline_result, noise_floor, variant_result
from raytracer.analysis.cost.measure_scene import Replicates, WarmScene
from raytracer.analysis.cost.predict import PictureCost
from raytracer.analysis.cost.results import Prediction, VariantResult
from raytracer.analysis.cost.rounds import Rounds, VariantRun, prepare_variant, render_rounds
from raytracer.analysis.cost.study_options import StudySettings
from raytracer.analysis.cost.tile_sample import choose_subset, round_workload
from raytracer.analysis.cost.variants import Variant
from raytracer.film.window import Window
from raytracer.scene.scene_assets import SceneAssets
from raytracer.util.errors import InputError

COMPARISON_SECONDS = 120.0
"""Approximate render time of all variants together, if there are not very many or few of them."""

# Rounds from which noise can be estimated at all, of a comparison that is ended early.
_FEWEST_FINISHED = 2


class ComparisonOutcome(NamedTuple):
    """Results of all variants.

    variants : rows of the table; the scene first.
    rounds : number of complete rounds.
    bad : number of samples that were not finite.
    """

    variants: tuple[VariantResult, ...] = ()
    rounds: int = 0
    bad: int = 0
    interrupted: bool = False


def measure_variants(
    warm: WarmScene,
    measured: Replicates,
    prediction: Prediction,
    picture: PictureCost,
    variants: Sequence[Variant],
    settings: StudySettings,
    timer: StudyTimer,
) -> ComparisonOutcome:
    """Measure the scene and its variants against each other; an interrupt ends it early."""
    if not variants:
        return ComparisonOutcome()
    tiles = measured.tiles
    turns = settings.rounds * (len(variants) + 1)
    workload = round_workload(tiles.windows, COMPARISON_SECONDS / turns, warm.pace, settings.tiles, turns)
    sample, pixels = choose_subset(tiles, workload.tiles, np.random.default_rng(settings.seed))
    try:
        with timer.phase("compile arms", "compile variants") as tick:
            subjects = _prepare_variants(warm.subject, variants, sample.windows, tick)
    except KeyboardInterrupt:
        return ComparisonOutcome(interrupted=True)
    with timer.phase("compare") as tick:
        all_rounds = render_rounds(
            _entries(warm.subject, subjects, settings), sample, workload.spp, settings.rounds, tick
        )
    if not all_rounds or len(all_rounds[0].mean) < _FEWEST_FINISHED:
        return ComparisonOutcome(interrupted=True)
    scene, *others = all_rounds

    # The weights are from other samples than those that they weigh: else what is dark by chance would count for more.
    basis = Baseline(
        scene=scene,
        tiles=sample,
        weight=measured.weight(measured.levels[-1])[pixels],
        prediction=prediction,
        picture=picture,
        rays=_rays_per_sample(measured, picture),
        seed=settings.seed,
    )
    rows = _rows(basis, variants, subjects, others)
    bad = sum(rounds.bad for rounds in all_rounds)
    completed = len(scene.mean)
    return ComparisonOutcome((baseline_result(basis), *rows), completed, bad, completed < settings.rounds)


def _rays_per_sample(measured: Replicates, picture: PictureCost) -> float:
    """Compute the rays of a sample of a pixel, over the whole picture."""
    if not math.isnan(picture.rays.value):
        return picture.rays.value / picture.pixels
    weight, pixels = measured.tiles.weight, measured.tiles.pixels
    return float((measured.rays.mean(axis=0) * weight).sum() / (pixels * weight).sum())


def _prepare_variants(
    scene: Subject, variants: Sequence[Variant], windows: Sequence[Window], tick: Callable[[float], None]
) -> list[Subject | str]:
    """Compile and warm up each variant, or say in one sentence why that cannot be done."""
    subjects: list[Subject | str] = []
    assets = SceneAssets(scene.prepared.spec)
    for number, variant in enumerate(variants):
        try:
            subjects.append(prepare_variant(scene, variant, windows, assets))
        except InputError as error:
            subjects.append(str(error))
        tick((number + 1) / len(variants))
    return subjects


def _entries(scene: Subject, subjects: Sequence[Subject | str], settings: StudySettings) -> list[VariantRun]:
    """List the scene and the variants that can be rendered.

    In a round all have the same seed, since what random numbers they share is no part of a difference.  The control
    has seeds of its own: it is to show what differs by chance.
    """
    compiled = [subject for subject in subjects if isinstance(subject, Subject)]
    common, own = (seeds(settings.seed, purpose, settings.rounds) for purpose in (Purpose.ROUND, Purpose.CONTROL))
    needs_slope = any(subject.sampler != scene.sampler for subject in compiled)
    return [
        VariantRun(scene, common, needs_slope),
        *(
            VariantRun(subject, own if subject is scene else common, subject.sampler != scene.sampler)
            for subject in compiled
        ),
    ]


def _rows(
    basis: Baseline, variants: Sequence[Variant], subjects: Sequence[Subject | str], others: Sequence[Rounds]
) -> Iterator[VariantResult]:
    """Make a row for each variant; the first is the control, which tells what a difference is."""
    remaining = iter(others)
    floor = noise_floor(basis, others[0])
    for variant, subject in zip(variants, subjects, strict=True):
        if isinstance(subject, str):
            yield VariantResult(*variant[:3], failed=subject)
        else:
            yield variant_result(basis, variant, next(remaining), subject.sampler, floor)
