"""Options of a study, and their checks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from raytracer.analysis.cost.warnings import MIN_ROUNDS, MIN_TILES
from raytracer.rendering.worker_pool import available_threads
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError

ROUNDS = 9
"""Renders of each variant."""

MAX_ROUNDS = 1000
"""Rounds of which the pictures are kept, at least a tile of each variant."""


@dataclass(frozen=True)
class StudyOptions:
    """Options of a study.

    target : relative error to be reached, such as 0.01.
    budget : seconds that a render may take; None if that is not asked.
    rounds : renders of each variant, 9 to 1000.
    variants : names of the variants to measure; all if None, no comparison if empty.
    tiles : number of 16 x 16 tiles of the picture to measure, 16 or more, or all; as many as there is time for if None.
    threads : number of threads; all processors if None.
    seed : of all random numbers; the scene's if None.
    """

    target: float = 0.01
    budget: float | None = None
    rounds: int = ROUNDS
    variants: Sequence[str] | None = None
    tiles: int | None = None
    threads: int | None = None
    seed: int | None = None


@dataclass(frozen=True, kw_only=True)
class StudySettings(StudyOptions):
    """Options of a study with their defaults filled in."""

    threads: int
    seed: int


def check_options(options: StudyOptions, spec: SceneSpec, tile_count: int) -> StudySettings:
    """Check the options for a picture of `tile_count` tiles, and fill in their defaults.

    Raises
    ------
    InputError : a target, budget or number that makes no sense.
    """
    defaults = {
        "threads": options.threads or available_threads(),
        "seed": spec.render.seed if options.seed is None else options.seed,
    }
    settings = StudySettings(**(vars(options) | defaults))
    if not 0.0 < settings.target < 1.0:
        raise InputError(f"target {settings.target:g}: must be greater than 0 and less than 1, which is 100 %")
    if settings.budget is not None and not 0.0 < settings.budget < math.inf:
        raise InputError(f"budget {settings.budget:g}: must be a time greater than 0")
    for name, value, least in (
        ("rounds", settings.rounds, MIN_ROUNDS),
        ("tiles", settings.tiles, min(MIN_TILES, tile_count)),
        ("threads", settings.threads, 1),
    ):
        if value is not None and value < least:
            raise InputError(f"{name} {value}: must be at least {least}")
    if settings.rounds > MAX_ROUNDS:
        raise InputError(f"rounds {settings.rounds}: must be at most {MAX_ROUNDS}, since the pictures of all are kept")
    return settings
