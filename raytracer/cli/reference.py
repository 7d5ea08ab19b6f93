"""`rt reference`: small pictures to check scenes against later."""

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.analysis.regression.reference_file import Reference
    from raytracer.analysis.regression.render_reference import ReferenceScene

EXAMPLE = """\b
Examples:
  rt reference scenes/cover.yaml -o tests/references
  rt reference scenes/*.yaml -o tests/references --width 72
  rt reference scenes/cover.yaml -o tests/references -D camera.f_number=2 --name cover_open
  rt reference tests/references/*.npz
"""


def reference(
    scenes: Annotated[
        list[Path],
        Argument(metavar="SCENE", help="Scene files; or references (.npz), which are rendered anew as they were."),
    ],
    output: Annotated[Path | None, options.output("DIR", "Folder of the references.  Default: references.")] = None,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    name: Annotated[str | None, Option(help="Name of the reference.  Default: that of the scene's file.")] = None,
    width: Annotated[int | None, Option(help="Width of the picture (px).  Default: 64.", min=1)] = None,
    spp: Annotated[int | None, options.declare("spp", "Samples per pixel.  Default: 4096.")] = None,
    seed: Annotated[int | None, options.declare("seed", "Seed of all random numbers.  Default: 12345.")] = None,
    threads: options.Threads = None,
    quiet: options.Quiet = False,
) -> None:
    """Render references: small pictures that know their noise, for `rt check` to judge later ones by.

    Each is a file DIR/<scene>.npz, of mean, variance and settings, small enough to be kept with the sources.  One that
    is there already is replaced, and how the picture has changed is told.
    """
    if name is not None and len(scenes) > 1:
        raise InputError(f"--name {name}: is for one scene, and there are {len(scenes)}")
    if name is not None and name != Path(name).name:
        raise InputError(f"--name {name}: is a name, not a path; -o names the folder")

    # Find out what is wrong before the work, not after.
    from raytracer.analysis.regression.reference_file import SUFFIX, load_reference, save_reference
    from raytracer.analysis.regression.render_reference import (
        SEED,
        SPP,
        WIDTH,
        load_recipe_scene,
        prepare_reference_scene,
        render_reference,
    )
    from raytracer.rendering.progress import show_in_batch
    from raytracer.scene.cache import RenderCache
    from raytracer.scene.overrides import parse_overrides
    from raytracer.util.atomic_write import check_file
    from raytracer.util.progress import BatchBar

    overrides = parse_overrides(define or [])
    folder = output or Path("references")
    work: dict[Path, tuple[ReferenceScene, int, int]] = {}
    for scene in scenes:
        if scene.suffix.lower() == SUFFIX:
            _check_alone(scene, name=name, output=output, width=width, define=define)
            path, recipe = scene, load_reference(scene).recipe
            try:
                reference_scene = load_recipe_scene(recipe, scene.parent, allow_files or [])
            except InputError as error:
                raise InputError(f"{scene}: {error}") from error
            samples, number = spp or recipe.spp, recipe.seed if seed is None else seed
        else:
            path = folder / f"{name or scene.stem}{SUFFIX}"
            reference_scene = prepare_reference_scene(scene, folder, overrides, width or WIDTH, allow_files or [])
            samples, number = spp or SPP, SEED if seed is None else seed
        if path in work:
            raise InputError(f"{scene}: {path} is another scene's already; --name names a reference")
        check_file(path)
        work[path] = reference_scene, samples, number

    cache = RenderCache()
    with BatchBar(quiet=quiet) as bar:

        def warn(sentence: str) -> None:
            bar.say(f"rt: warning: {sentence}", sys.stderr)

        for count, (path, (reference_scene, samples, number)) in enumerate(work.items()):
            show = show_in_batch(bar, count, len(work), path.stem)
            rendered = render_reference(
                reference_scene, spp=samples, seed=number, threads=threads, cache=cache, progress=show, warn=warn
            )
            sentence = _describe(path, rendered)
            save_reference(path, *rendered)
            if not quiet:
                bar.say(sentence, sys.stderr)


def _check_alone(
    path: Path, *, name: str | None, output: Path | None, width: int | None, define: list[str] | None
) -> None:
    """Refuse options that change a reference, if it is to be rendered as it was."""
    for option, given in (("--name", name), ("-o", output), ("--width", width), ("-D", define)):
        if given:
            raise InputError(f"{option}: {path} is a reference, which is rendered anew as it was; give its scene")


def _describe(path: Path, reference: "Reference") -> str:
    """Describe a new reference, and how it differs from the one that it replaces."""
    from raytracer.analysis.compare import z_test
    from raytracer.analysis.regression.check import detectable_change
    from raytracer.analysis.regression.reference_file import load_reference
    from raytracer.analysis.regression.render_reference import gain_ratio
    from raytracer.report.wording import format_percent

    height, width, _ = reference.mean.shape
    sentence = f"{path}: {width} x {height}, {reference.recipe.spp} spp"
    change = format_percent(detectable_change(reference, reference.recipe.spp))
    sentence += f"; a check by as many finds {change} more or less light"
    if reference.recipe.dropped:
        sentence += f"; {reference.recipe.dropped} samples were not finite and were dropped"
    with contextlib.suppress(InputError):
        before = load_reference(path)
        # With the seed that it has as well, the two are not independent, and differ all the less.
        ratio = gain_ratio(before.recipe.gains, reference.recipe.gains)
        spp = before.recipe.spp / reference.recipe.spp
        verdict = z_test(ratio * reference.mean, ratio**2 * reference.variance, before.mean, before.variance, ratio=spp)
        sentence += f"; what it replaces: {verdict.reason}"
    return sentence
