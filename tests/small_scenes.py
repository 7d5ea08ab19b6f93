"""Small scenes, rendered for tests.

A scene's type is what gets compiled, for about five seconds each, so scenes that need not differ in type are filled up
to one: the kinds of primitives and materials that a scene lacks come as specks of a nanometre far below everything,
where no ray of these tests meets them.  Where `lit`, an environment and lamps of hardly any light come too: scenes in
the dark, under a sky and with lamps are of one type then.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.film.image import Image
from raytracer.rendering.render import render
from raytracer.rendering.session import Rendered
from raytracer.scene.load import build
from raytracer.scene.spec import SceneSpec

_SPECKS = """
  - {type: disc, center: [0, -97, 0], normal: [0, 1, 0], radius: 1.0e-9, material: {type: metal, albedo: 0.5}}
  - {type: quad, corner: [0, -98, 0], edges: [[1.0e-9, 0, 0], [0, 0, 1.0e-9]], material: {type: dielectric}}
  - {type: sphere, center: [0, -99, 0], radius: 1.0e-9, material: {type: emitter, radiance: 0}}
  - {type: triangle, vertices: [[0, -96, 0], [1.0e-9, -96, 0], [0, -96, 1.0e-9]], material: {type: lambertian}}
"""

_LAMP = "  - {type: sphere, center: [0, -95, 0], radius: 1.0e-9, material: {type: emitter, radiance: 1.0e-30}}\n"

NIGHT = "environment: {type: constant, radiance: 1.0e-30}\n"
"""Too little light to be seen in any picture."""


def scene_text(
    text: str, *, width: int = 16, height: int = 16, filled: bool = True, lit: bool = False, **settings: Any
) -> str:
    """A scene file of its `camera`, `environment`, `materials` and, last, its `objects`.

    filled : with specks of all kinds, so that it shares its compiled kernel with other scenes.
    lit : with an environment and lamps, of its own or such as nobody sees, so that it shares it with even more.
    settings : of `render`; by default of 64 independent samples, exact, and without an end before 50 segments.
    """
    chosen = {"spp": 64, "max_depth": 50, "rr_depth": 1000, "sampler": "independent", "accuracy": "exact", **settings}
    render = ", ".join(f"{key}: {value}" for key, value in chosen.items())
    head = f"\nfilm: {{width: {width}, height: {height}}}\nrender: {{{render}}}\n"
    specks = _SPECKS if filled else "\n"
    if lit:
        head += "" if "environment:" in text else NIGHT
        specks = specks.replace("radiance: 0", "radiance: 1.0e-30") + _LAMP
    return head + text.rstrip() + specks


def scene(text: str, *, base: Path | None = None, **settings: Any) -> SceneSpec:
    """The checked scene of `scene_text(text, **settings)`; `base` is what names of files in it are relative to."""
    return build(scene_text(text, **settings), "test.yaml", base=base, allow_files="/")


def rendered(text: str, *, seed: int = 1, threads: int = 2, **settings: Any) -> Rendered:
    """`scene(text, **settings)`, rendered."""
    result = render(scene(text, **settings), seed=seed, threads=threads)
    assert result.stats.nan_samples == 0
    return result


def image(text: str, **settings: Any) -> Image:
    """The image of `scene(text, **settings)`."""
    return rendered(text, **settings).image


def mean(picture: Image) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean of all pixels by channel (3,), and its standard deviation (3,), from the variances of the pixels."""
    assert picture.variance is not None
    pixels = picture.radiance.shape[0] * picture.radiance.shape[1]
    return picture.radiance.mean(axis=(0, 1)), np.sqrt(picture.variance.sum(axis=(0, 1))) / pixels


def assert_mean(picture: Image, expected: float, *, sigmas: float = 4.0, relative_noise: float = 0.01) -> None:
    """The mean of a picture, in every channel, is `expected` within its noise, and the noise is small enough to tell.

    sigmas : 4 puts one honest mean in 16,000 outside.
    relative_noise : the largest standard deviation of the mean, relative to `expected`, that the test is content with.
    """
    value, deviation = mean(picture)
    assert np.all(deviation <= relative_noise * expected), f"too noisy to tell: {deviation} of {expected}"
    rounding = 1e-6 * expected
    error = np.abs(value - expected)
    assert np.all(error <= sigmas * deviation + rounding), (
        f"{value} is not {expected}: off by {error / expected} of it, {error / np.maximum(deviation, 1e-300)} sigma"
    )
