"""From a scene to its reference: a small picture of many samples, taken independently of each other."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import __version__
from raytracer.errors import InputError
from raytracer.film.image import Image
from raytracer.film.white_balance import AUTO
from raytracer.reach import AllowFiles, reach_of, unreadable
from raytracer.regression.inputs import digests
from raytracer.regression.references import WIDEST, Recipe, Reference
from raytracer.rendering import Progress, render
from raytracer.scene.edit import overridden
from raytracer.scene.load import check_values, load
from raytracer.scene.spec import SceneSpec

if TYPE_CHECKING:
    from raytracer.stock import Stock

WIDTH = 64
SPP = 4096
SEED = 12345

FEWEST_SPP = 16
"""Samples a pixel that it takes for a variance to tell anything (`comparison.z_test`)."""

_INDEPENDENT = {"render.sampler": "independent"}
"""Stratified samples are better than their own variance says; of independent ones it tells the picture's."""


class Source(NamedTuple):
    """A scene that is ready to be rendered for a reference.

    spec : with all overrides; scene, overrides : as in `Recipe`.
    """

    spec: SceneSpec
    scene: str | None
    overrides: dict[str, Any]


def source(
    scene: str | os.PathLike[str] | SceneSpec,
    folder: Path,
    overrides: Mapping[str, Any] | None = None,
    width: int | None = WIDTH,
    allow_files: AllowFiles = (),
) -> Source:
    """A scene, made small and sampled independently.

    Parameters
    ----------
    scene : a scene file, or a scene that was built in code.
    folder : where the reference is to be.
    overrides : values by dotted path that stand in place of the scene's.
    width : of the picture (px), if the scene's own is larger; None for the scene's own.
    allow_files : folders in which a scene file may name files, besides its own.

    Raises
    ------
    InputError : the scene or an override is wrong, or the picture is too large to be kept.
    """
    all_overrides = {**_INDEPENDENT, **(overrides or {})}
    if isinstance(scene, SceneSpec):
        name, spec = None, overridden(scene, all_overrides)
    else:
        name, spec = _relative(scene, folder), load(scene, all_overrides, allow_files=allow_files)
    size = spec.film
    if width is not None and width < size.width:
        small = {"film.width": width, "film.height": max(1, round(width * size.height / size.width))}
        all_overrides |= small
        spec = overridden(spec, small)
    if spec.picture()[0] > WIDEST:
        raise InputError(
            f"a picture {spec.picture()[0]} pixels wide is too large to be kept with the sources: at most {WIDEST}"
        )
    return Source(spec, name, all_overrides)


def source_of(recipe: Recipe, folder: Path, allow_files: AllowFiles = ()) -> Source:
    """The scene of a reference in `folder`, as it is now.

    allow_files : folders in which the scene and the reference's overrides may name files, besides the scene's own.

    Raises
    ------
    InputError : it is not there, or it or an override of the reference is wrong; or it is built in code.
    """
    if recipe.scene is None:
        raise InputError("its scene is built by a test, which alone can render it")
    path = folder / recipe.scene
    # As short as a user would write it.
    shortest = Path(os.path.normpath(path))
    if reason := unreadable(shortest):
        raise InputError(f"its scene {shortest} {reason}")
    try:
        check_values(recipe.overrides, reach_of(shortest.parent, allow_files))
    except ValueError as error:
        raise InputError(f"an override of it: {error}") from None
    return Source(load(shortest, recipe.overrides, allow_files=allow_files), recipe.scene, recipe.overrides)


def _relative(scene: str | os.PathLike[str], folder: Path) -> str:
    # Links are left as they are, so that the path holds wherever the project is.
    try:
        return Path(os.path.relpath(scene, folder)).as_posix()
    except ValueError:
        raise InputError(f"{os.fspath(scene)}: must be on the drive of its reference's folder, {folder}") from None


def make(
    found: Source,
    *,
    spp: int = SPP,
    seed: int = SEED,
    threads: int | None = None,
    stock: "Stock | None" = None,
    progress: Callable[[Progress], None] | None = None,
    warn: Callable[[str], object] | None = None,
) -> Reference:
    """Render the reference of a scene.

    Parameters
    ----------
    spp : samples a pixel: many, since they are taken once, and all that is checked later is checked against them.
    seed : of all random numbers; a check takes another.
    threads, stock, progress, warn : see `rendering.render`.

    Raises
    ------
    InputError : too few samples, a picture whose noise is not known, or see `rendering.render`.
    KeyboardInterrupt : the user has ended it.
    """
    if spp < FEWEST_SPP:
        raise InputError(f"a reference takes at least {FEWEST_SPP} samples per pixel, to know its own noise; got {spp}")
    rendered = render(found.spec, spp=spp, seed=seed, threads=threads, stock=stock, progress=progress, warn=warn)
    if rendered.interrupted:
        raise KeyboardInterrupt
    image = rendered.image
    recipe = Recipe(
        scene=found.scene,
        overrides=found.overrides,
        spp=spp,
        seed=seed,
        version=__version__,
        inputs=digests(found.spec),
        dropped=rendered.stats.nan_samples,
        gains=measured_gains(found.spec, image),
    )
    return Reference(image.radiance, known_variance(image), recipe)


def known_variance(image: Image) -> NDArray[np.float64]:
    """The variance of an image of `FEWEST_SPP` samples or more.

    Raises
    ------
    InputError : nothing tells it.
    """
    if image.variance is None:
        raise InputError(
            "the noise behind a Bayer mosaic is not known, so that no two pictures can be told apart: "
            "-D camera.sensor.bayer=null leaves the mosaic out"
        )
    if not np.isfinite(image.variance).all():
        raise InputError("a pixel has fewer than two samples that are finite, so that its noise is not known")
    return image.variance


def measured_gains(spec: SceneSpec, image: Image) -> tuple[float, float, float] | None:
    """What the light of each channel was multiplied by, as far as that was measured on the picture; else None."""
    is_balanced, is_metered = spec.film.white_balance == AUTO, "metering" in image.settings
    if not is_balanced and not is_metered:
        return None
    gain = float(image.settings["exposure_gain"]) if is_metered else 1.0
    balance = str(image.settings["white_balance_gains"]).split(",") if is_balanced else ("1", "1", "1")
    red, green, blue = (gain * float(part) for part in balance)
    return red, green, blue


def gain_ratio(
    kept: tuple[float, float, float] | None, measured: tuple[float, float, float] | None
) -> NDArray[np.float64]:
    """What brings a picture to the gains of a reference (3,), where both are measured on the pictures; 1 elsewhere.

    The noise of what is metered is one of all pixels together, which no pixel's variance tells.
    """
    return np.ones(3) if kept is None or measured is None else np.array(kept) / np.array(measured)
