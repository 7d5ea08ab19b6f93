"""Study of what accuracy costs in time for one scene: prepare, predict, compare, report.

Each step is a function of the results of the steps before.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.bench import MACHINE, Bench, Progress, StudyTimer, Subject
from raytracer.analysis.cost.machine import load_average, machine
from raytracer.analysis.cost.measure_scene import (
    Replicates,
    assemble_picture,
    count_rays,
    measure_scene,
    picture_tiles,
    warm_scene,
)
from raytracer.analysis.cost.measure_variants import ComparisonOutcome, measure_variants
from raytracer.analysis.cost.predict import PictureCost, predict
from raytracer.analysis.cost.results import PlanItem, Study
from raytracer.analysis.cost.study_options import StudyOptions, StudySettings, check_options
from raytracer.analysis.cost.variants import Variant, make_variants, reasons_without_variant, select_variants
from raytracer.analysis.cost.warnings import STUDY_WARNINGS, StudyConditions
from raytracer.core.error_estimate.metric import worst_pixel_share
from raytracer.core.error_estimate.rates import sampler_exponent
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.effects import effects_of
from raytracer.scene.pack.scene import PackedScene, pack
from raytracer.scene.render_settings import Render
from raytracer.scene.spec import SceneSpec
from raytracer.scene.warnings import emit_warnings

Array = NDArray[np.float64]

_DEFAULTS = StudyOptions()

# Below this number of pixels, the worst 0.1 % are less than one.
_FEWEST_FOR_SHARE = 1000


_TRADES: Mapping[str, str] = {
    "spp": "{} samples per pixel: time grows with them, and noise falls by their root or faster",
    "max_depth": "at most {} path segments: fewer are faster, and lose the light of longer paths",
    "sampler": "{}: how evenly samples are spread, which decides how fast noise falls, and takes time",
    "accuracy": "{}: how exactly hits are found; what is faster may leak light at edges",
    "light_sampling": "{}: lights are sampled (lights), met by paths (paths) or both (mis); sampling takes shadow "
    "rays, and saves noise",
    "seed": "{}: another seed gives other noise, at the same cost",
    "rr_depth": "Russian roulette after {} segments: sooner is faster, and noisier",
}
"""Descriptions of what a setting trades, by its key in the scene."""


def study(
    spec: SceneSpec,
    options: StudyOptions = _DEFAULTS,
    *,
    progress: Callable[[Progress], None] | None = None,
    name: str = "scene",
    load_seconds: float = 0.0,
    bench: Bench = MACHINE,
    warn: Callable[[str], object] | None = None,
) -> Study:
    """Measure what a scene's accuracy costs, on some tiles of its picture.

    An interrupt while variants are measured ends that, and the results so far are returned.

    Parameters
    ----------
    progress : called with the phase that is under way.
    name : of the scene, in the report.
    load_seconds : time that loading the scene took, which is a part of every render's time.
    bench : functions that use the machine.
    warn : called with each warning of the scene, one sentence (docs/warnings.md).

    Raises
    ------
    InputError : a target, budget, number or name that makes no sense, or a scene that cannot be packed.
    """
    settings = check_options(options, spec, len(picture_tiles(spec)))
    load = load_average()
    seconds = {"load": load_seconds}
    timer = StudyTimer(seconds, progress)

    with timer.phase("pack"):
        packed = pack(spec)
    emit_warnings(packed, warn)
    with timer.phase("plan"):
        variants = _select_variants(packed, settings)
        items = plan(spec, packed)
    with timer.phase("prepare"):
        prepared = bench.prepare(spec, packed)
    with timer.phase("warm up"):
        warm = warm_scene(Subject(prepared, bench, settings.threads), settings.seed)
    with timer.phase("predict") as tick:
        measured = measure_scene(warm, settings, tick)
        picture = assemble_picture(warm, measured)
    with timer.phase("develop"):
        develop_seconds = bench.develop(prepared, np.where(np.isnan(picture), measured.scale, picture))
    # Preparing is told by its parts.
    del seconds["prepare"]
    seconds |= {"build": prepared.seconds["build"], "compile": prepared.seconds["compile"], "develop": develop_seconds}
    cost = PictureCost(
        pixels=picture.shape[0] * picture.shape[1],
        rays=count_rays(warm, measured),
        threads=settings.threads,
        # Compiling is done once for many renders.
        fixed=sum(seconds[phase] for phase in ("load", "pack", "build", "develop")),
    )
    steepest = sampler_exponent(warm.subject.sampler)
    prediction = predict(measured, cost, settings, steepest)
    # Variants of a black picture cannot be compared.
    variants = variants if measured.scale > 0.0 else []
    outcome = measure_variants(warm, measured, prediction, cost, variants, settings, timer)
    height, width, _ = picture.shape
    result = Study(
        scene=name,
        width=width,
        height=height,
        plan=items,
        prediction=prediction,
        variants=outcome.variants,
        seconds=seconds,
        machine=_machine_conditions(outcome, load, settings),
        warnings=(),
        tiles=len(warm.windows),
        tiles_measured=len(measured.tiles.windows),
        top_share=_top_share(measured),
        error_map=_error_map(measured, width, height),
        picture=picture,
        interrupted=outcome.interrupted,
        rounds=outcome.rounds,
    )
    bad = measured.bad + outcome.bad
    conditions = StudyConditions(result, measured.scale, bad, settings.rounds)
    return replace(result, warnings=tuple(record.text for record in STUDY_WARNINGS.find(conditions)))


def _select_variants(packed: PackedScene, settings: StudySettings) -> list[Variant]:
    """Select the variants to measure; the control is among them, if there are any."""
    if settings.variants is None:
        return make_variants(packed.spec, packed)
    if not settings.variants:
        return []
    reasons = reasons_without_variant(packed.spec, packed)
    return select_variants(make_variants(packed.spec, packed), settings.variants, reasons)


def _machine_conditions(outcome: ComparisonOutcome, load: float | None, settings: StudySettings) -> dict[str, Any]:
    """Describe the machine and its load, and the settings that a repetition takes."""
    return {
        **machine(),
        "threads": settings.threads,
        "processors": available_threads(),
        "load_before": load,
        "load_after": load_average(),
        "seed": settings.seed,
        "rounds": outcome.rounds,
        "samples_per_round": outcome.variants[0].spp if outcome.variants else 0,
    }


def _top_share(measured: Replicates) -> float:
    """Compute the share of the squared error in the worst 0.1 % of the pixels; nan if there are too few."""
    last, tiles = measured.last, measured.tiles
    if last.shape[1] < _FEWEST_FOR_SHARE:
        return math.nan
    return worst_pixel_share(last, measured.weight(measured.levels[-1]), stands=tiles.weight[tiles.owner])


def _error_map(measured: Replicates, width: int, height: int) -> Array:
    """Compute the relative error of each pixel: (height, width), nan where not measured."""
    errors = np.full((height, width), math.nan)
    variance = measured.last.var(axis=0, ddof=1)
    measured.tiles.spread(np.sqrt(np.mean(measured.weight(measured.levels[-1]) * variance, axis=1)), errors)
    return errors


# ---- Plan


def plan(spec: SceneSpec, packed: PackedScene) -> tuple[PlanItem, ...]:
    """List the effects of a scene, simulated ones first, and its settings; `packed` is what `pack(spec)` gave.

    A simulated effect that has no variant without it says why.
    """
    effects, reasons = effects_of(packed.spec, packed.scene), reasons_without_variant(packed.spec, packed)
    items = [
        PlanItem("simulated", name, effect.why + (f"; no variant: {reasons[name]}" if name in reasons else ""))
        for name, effect in effects.items()
        if effect.active
    ]
    items += [PlanItem("left out", name, effect.why) for name, effect in effects.items() if not effect.active]
    return (*items, *_settings(spec))


def _settings(spec: SceneSpec) -> list[PlanItem]:
    """Describe each setting and what it trades; one without an entry in `_TRADES` by its own description."""
    items = []
    for key, field in Render.model_fields.items():
        value = getattr(spec.render, key)
        trade = _TRADES[key].format(value) if key in _TRADES else f"{value}: {field.description}"
        items.append(PlanItem("setting", key, trade))
    film = spec.film
    width, height = spec.picture()
    size = f"{width} x {height} pixels: time grows with their number, noise by pixel does not depend on it"
    of_filter = f"{film.filter.type}: a wider filter blurs, and what it weighs unevenly is noisier"
    return [*items, PlanItem("setting", "film", size), PlanItem("setting", "filter", of_filter)]
