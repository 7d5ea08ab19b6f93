"""Studies from Python: `rt.cost`, and its result as notebooks show it."""

import os
import warnings
from collections.abc import Sequence
from dataclasses import fields

from raytracer.analysis.cost import formatting
from raytracer.analysis.cost.plots import convergence_svg
from raytracer.analysis.cost.results import Study
from raytracer.analysis.cost.study import study
from raytracer.analysis.cost.study_options import ROUNDS, StudyOptions
from raytracer.analysis.cost.text import study_text
from raytracer.core.compiler.lock import compiler_lock
from raytracer.report import fragment
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import SceneWarning


class CostStudy(Study):
    """Results of `cost`: printed they are the text of `rt cost`, and a notebook shows their table and plot.

    The fields are those of `Study`: `prediction`, `variants`, `error_map` and more.
    """

    def __repr__(self) -> str:
        return study_text(self).rstrip()

    def _repr_html_(self) -> str:
        """Write the study for a notebook."""
        columns = formatting.columns(self)
        head = ("", *(column.title.replace("\n", " ") for column in columns.values()))
        rows = [
            (formatting.display_name(variant), *(column.words(variant) for column in columns.values()))
            for variant in self.variants
            if not variant.failed
        ]
        plot = convergence_svg(self)
        return fragment.join(
            [
                fragment.heading(self.scene, formatting.format_extent(self)),
                fragment.heading("", formatting.headline(self)),
                *([] if plot is None else [fragment.svg(plot, "relative error against time")]),
                fragment.table(("predicted", ""), formatting.prediction_rows(self.prediction), left=2),
                *([fragment.table(head, rows)] if rows else []),
                *(fragment.heading("", f"Read with care: {warning}") for warning in self.warnings),
            ]
        )


def cost(
    scene: SceneSpec | str | os.PathLike[str],
    *,
    target: float = 0.01,
    budget: float | None = None,
    rounds: int = ROUNDS,
    variants: Sequence[str] | None = None,
    tiles: int | None = None,
    threads: int | None = None,
    seed: int | None = None,
) -> CostStudy:
    """Measure what the accuracy of a scene, or of a scene file, costs in time, on some tiles of its picture.

    Parameters
    ----------
    target : relative error to be reached, such as 0.01.
    budget (s) : time that a render may take; None if that is not asked.
    rounds : renders of each variant, 9 to 1000.
    variants : names of the variants to measure; all if None, no comparison if empty.
    tiles : number of 16 x 16 tiles of the picture to measure, 16 or more, or all; as many as there is time for if None.
    threads : number of threads; all processors if None.
    seed : of all random numbers; the scene's if None.

    Raises
    ------
    InputError : a target, budget, number or name that makes no sense, or a scene that cannot be packed.
    """
    options = StudyOptions(target, budget, rounds, variants, tiles, threads, seed)
    spec, name = (load(scene), str(scene)) if isinstance(scene, str | os.PathLike) else (scene, "scene")
    found = study(spec, options, name=name, warn=_warn)
    return CostStudy(**{each.name: getattr(found, each.name) for each in fields(Study)})


def _warn(sentence: str) -> None:
    """Warn at the line that called `cost`."""
    with compiler_lock:
        warnings.warn(sentence, SceneWarning, stacklevel=6)
