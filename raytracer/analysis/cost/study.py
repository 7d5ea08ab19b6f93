"""Study of what accuracy costs in time for one scene: prepare, predict, compare, report.

Each step is a function of the results of the steps before.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.bench import MACHINE, Bench, Subject
from raytracer.analysis.cost.machine import load_average, machine
from raytracer.analysis.cost.measure_scene import (
    SceneMeasurement,
    WarmScene,
    assemble_picture,
    measure_scene,
    picture_tiles,
    warm_scene,
)
from raytracer.analysis.cost.measure_variants import ComparisonOutcome, measure_variants
from raytracer.analysis.cost.phase_timer import Progress, StudyTimer
from raytracer.analysis.cost.plan import plan
from raytracer.analysis.cost.predict import PictureCost, PredictionGoal, predict
from raytracer.analysis.cost.results import Prediction, Study
from raytracer.analysis.cost.study_options import StudyOptions, StudySettings, check_options
from raytracer.analysis.cost.variant import Variant
from raytracer.analysis.cost.variants import make_variants, reasons_without_variant, select_variants
from raytracer.analysis.cost.warnings import STUDY_WARNINGS, StudyConditions
from raytracer.core.error_estimate.metric import worst_pixel_share
from raytracer.core.error_estimate.rates import sampler_exponent
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.pack.scene import PackedScene, pack
from raytracer.scene.spec import SceneSpec
from raytracer.scene.warnings import emit_warnings

Array = NDArray[np.float64]

_DEFAULTS = StudyOptions()

# Below this number of pixels, the worst 0.1 % are less than one.
_FEWEST_FOR_SHARE = 1000


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
        measurement = measure_scene(warm, settings, tick)
        picture = assemble_picture(warm, measurement)
    with timer.phase("develop"):
        develop_seconds = bench.develop(prepared, np.where(np.isnan(picture), measurement.scale, picture))
    _split_prepare_phase(seconds, prepared.seconds, develop_seconds)
    rays = warm.pilot.rays if warm.pilot else math.nan
    cost = PictureCost(picture.shape[0] * picture.shape[1], rays, settings.threads, _fixed_seconds(seconds))
    prediction = predict(
        measurement.replicates,
        measurement.scale,
        cost,
        PredictionGoal(settings.target, settings.budget),
        sampler_exponent(warm.subject.sampler),
        settings.seed,
    )
    # Variants of a black picture cannot be compared.
    variants = variants if measurement.scale > 0.0 else []
    outcome = measure_variants(warm, measurement, prediction, cost, variants, settings, timer)
    return Study(
        scene=name,
        plan=items,
        prediction=prediction,
        variants=outcome.variants,
        seconds=seconds,
        machine=_machine_conditions(outcome, load, settings),
        picture=picture,
        interrupted=outcome.interrupted,
        rounds=outcome.rounds,
        **_describe_measurement(warm, measurement, prediction, outcome, load, settings),
    )


def _select_variants(packed: PackedScene, settings: StudySettings) -> list[Variant]:
    """Select the variants to measure; the control is among them, if there are any."""
    if settings.variants is None:
        return make_variants(packed.spec, packed)
    if not settings.variants:
        return []
    reasons = reasons_without_variant(packed.spec, packed)
    return select_variants(make_variants(packed.spec, packed), settings.variants, reasons)


def _split_prepare_phase(seconds: dict[str, float], prepared: dict[str, float], develop: float) -> None:
    """Replace the time of preparing a scene by those of its parts."""
    del seconds["prepare"]
    seconds |= {"build": prepared["build"], "compile": prepared["compile"], "develop": develop}


def _fixed_seconds(seconds: dict[str, float]) -> float:
    """Sum the seconds of a render besides its samples, and besides compiling, which is done once for many."""
    return sum(seconds[phase] for phase in ("load", "pack", "build", "develop"))


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


def _describe_measurement(
    warm: WarmScene,
    measurement: SceneMeasurement,
    prediction: Prediction,
    outcome: ComparisonOutcome,
    load: float | None,
    settings: StudySettings,
) -> dict[str, Any]:
    """Make the fields of `Study` about the picture, its measured tiles, their errors, and warnings."""
    replicates = measurement.replicates
    width, height = warm.subject.prepared.spec.picture()
    last = replicates.means[replicates.levels[-1]]
    errors = np.full((height, width), math.nan)
    replicates.tiles.spread(np.sqrt(np.mean(measurement.weight * last.var(axis=0, ddof=1), axis=1)), errors)
    share = math.nan
    if last.shape[1] >= _FEWEST_FOR_SHARE:
        share = worst_pixel_share(last, measurement.weight, stands=replicates.tiles.weight[replicates.tiles.owner])
    conditions = StudyConditions(
        prediction=prediction,
        tiles=len(warm.windows),
        tiles_measured=len(replicates.tiles.windows),
        scale=measurement.scale,
        top_share=share,
        bad=replicates.bad + outcome.bad,
        rounds=outcome.rounds,
        rounds_asked=settings.rounds,
        interrupted=outcome.interrupted,
        load=load,
        threads=settings.threads,
        processors=available_threads(),
    )
    return {
        "width": width,
        "height": height,
        "warnings": tuple(record.text for record in STUDY_WARNINGS.find(conditions)),
        "tiles": len(warm.windows),
        "tiles_measured": len(replicates.tiles.windows),
        "top_share": share,
        "error_map": errors,
    }
