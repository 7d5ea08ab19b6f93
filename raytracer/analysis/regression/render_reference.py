"""Rendering of references: small pictures of many independent samples, and digests of what they are rendered from."""

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer import __version__
from raytracer.analysis.regression.reference_file import MAX_WIDTH, Recipe, Reference
from raytracer.film.image import Image
from raytracer.film.white_balance import AUTO
from raytracer.optics.to_yaml import spec_to_plain
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import render
from raytracer.scene.files import check_names_allowed, input_files
from raytracer.scene.load import load
from raytracer.scene.overrides import apply_overrides
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError
from raytracer.util.path_sandbox import AllowFiles, make_sandbox, unreadable_reason

if TYPE_CHECKING:
    from raytracer.scene.cache import RenderCache

WIDTH = 64
SPP = 4096
SEED = 12345

MIN_SPP = 16
"""Least samples per pixel for a usable variance (`compare.z_test`)."""

_INDEPENDENT = {"render.sampler": "independent"}
"""Overrides for independent samples, whose variance is that of the picture; stratified ones have less noise."""


SCENE = "the scene"
"""Name of the scene itself in `digests`."""

_DIGITS = 16


class ReferenceScene(NamedTuple):
    """A scene to be rendered for a reference.

    spec : with all overrides.
    scene, overrides : as in `Recipe`.
    """

    spec: SceneSpec
    scene: str | None
    overrides: dict[str, Any]


def prepare_reference_scene(
    scene: str | os.PathLike[str] | SceneSpec,
    folder: Path,
    overrides: Mapping[str, Any] | None = None,
    width: int | None = WIDTH,
    allow_files: AllowFiles = (),
) -> ReferenceScene:
    """Prepare a scene for a reference: small, and with independent samples.

    Parameters
    ----------
    scene : a scene file, or a scene that was built in code.
    folder : folder of the reference.
    overrides : values by dotted path that stand in place of the scene's.
    width : of the picture (px), if the scene's own is larger; None for the scene's own.
    allow_files : folders in which a scene file may name files, besides its own.

    Raises
    ------
    InputError : the scene or an override is wrong, or the picture is too large to be kept.
    """
    all_overrides = {**_INDEPENDENT, **(overrides or {})}
    if isinstance(scene, SceneSpec):
        name, spec = None, apply_overrides(scene, all_overrides)
    else:
        name, spec = _relative(scene, folder), load(scene, all_overrides, allow_files=allow_files)
    size = spec.film
    if width is not None and width < size.width:
        small = {"film.width": width, "film.height": max(1, round(width * size.height / size.width))}
        all_overrides |= small
        spec = apply_overrides(spec, small)
    if spec.picture()[0] > MAX_WIDTH:
        raise InputError(
            f"a picture {spec.picture()[0]} pixels wide is too large to be kept with the sources: at most {MAX_WIDTH}"
        )
    return ReferenceScene(spec, name, all_overrides)


def load_recipe_scene(recipe: Recipe, folder: Path, allow_files: AllowFiles = ()) -> ReferenceScene:
    """Load the current scene of a reference in `folder`.

    allow_files : folders in which the scene and the reference's overrides may name files, besides the scene's own.

    Raises
    ------
    InputError : it is missing, it or an override of the reference is wrong, or it is built in code.
    """
    if recipe.scene is None:
        raise InputError("its scene is built by a test, which alone can render it")
    path = folder / recipe.scene
    # As short as a user would write it.
    shortest = Path(os.path.normpath(path))
    if reason := unreadable_reason(shortest):
        raise InputError(f"its scene {shortest} {reason}")
    try:
        check_names_allowed(recipe.overrides, make_sandbox(shortest.parent, allow_files))
    except ValueError as error:
        raise InputError(f"an override of it: {error}") from None
    return ReferenceScene(load(shortest, recipe.overrides, allow_files=allow_files), recipe.scene, recipe.overrides)


def _relative(scene: str | os.PathLike[str], folder: Path) -> str:
    # Links are left as they are, so that the path holds wherever the project is.
    try:
        return Path(os.path.relpath(scene, folder)).as_posix()
    except ValueError:
        raise InputError(f"{os.fspath(scene)}: must be on the drive of its reference's folder, {folder}") from None


def render_reference(
    scene: ReferenceScene,
    *,
    spp: int = SPP,
    seed: int = SEED,
    threads: int | None = None,
    cache: "RenderCache | None" = None,
    progress: Callable[[Progress], None] | None = None,
    warn: Callable[[str], object] | None = None,
) -> Reference:
    """Render the reference of a scene.

    Parameters
    ----------
    spp : samples a pixel: many, since they are taken once, and all that is checked later is checked against them.
    seed : of all random numbers; a check takes another.
    threads, cache, progress, warn : see `rendering.render`.

    Raises
    ------
    InputError : too few samples, a picture whose noise is not known, or see `rendering.render`.
    KeyboardInterrupt : the user has ended it.
    """
    if spp < MIN_SPP:
        raise InputError(f"a reference takes at least {MIN_SPP} samples per pixel, to know its own noise; got {spp}")
    rendered = render(scene.spec, spp=spp, seed=seed, threads=threads, cache=cache, progress=progress, warn=warn)
    if rendered.interrupted:
        raise KeyboardInterrupt
    image = rendered.image
    recipe = Recipe(
        scene=scene.scene,
        overrides=scene.overrides,
        spp=spp,
        seed=seed,
        version=__version__,
        inputs=digests(scene.spec),
        dropped=rendered.stats.nan_samples,
        gains=measured_gains(scene.spec, image),
    )
    return Reference(image.radiance, require_variance(image), recipe)


def require_variance(image: Image) -> NDArray[np.float64]:
    """Return the variance of an image of `MIN_SPP` samples or more.

    Raises
    ------
    InputError : it is not known.
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
    """Return the gains of the channels that were measured on the picture itself; None if none were."""
    is_balanced, is_metered = spec.film.white_balance == AUTO, "metering" in image.settings
    if not is_balanced and not is_metered:
        return None
    gain = float(image.settings["exposure_gain"]) if is_metered else 1.0
    balance = str(image.settings["white_balance_gains"]).split(",") if is_balanced else ("1", "1", "1")
    red, green, blue = (gain * float(part) for part in balance)
    return red, green, blue


def gain_ratio(
    reference: tuple[float, float, float] | None, measured: tuple[float, float, float] | None
) -> NDArray[np.float64]:
    """Compute the factors (3,) from the gains of a picture to those of a reference; 1 where either is not measured.

    The noise of metering is common to all pixels, and in no pixel's variance.
    """
    return np.ones(3) if reference is None or measured is None else np.array(reference) / np.array(measured)


# ---- Digests


def digests(spec: SceneSpec) -> dict[str, str]:
    """Compute digests of the scene's values, however its file is written, and of each of its files, by name.

    Raises
    ------
    InputError : a file cannot be read.
    """
    text = json.dumps(spec_to_plain(spec), sort_keys=True, default=str)
    by_name = {SCENE: _digest(text.encode())}
    for file in input_files(spec):
        by_name[file.name] = _digest(file.path.read_bytes())
    return by_name


def changed_inputs(before: Mapping[str, str], after: Mapping[str, str]) -> tuple[str, ...]:
    """List names whose digests differ, or that only one of the two has."""
    return tuple(name for name in dict.fromkeys([*before, *after]) if before.get(name) != after.get(name))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:_DIGITS]
