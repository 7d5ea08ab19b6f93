"""`rt reference`: small pictures to check scenes against later."""

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from raytracer.cli import options
from raytracer.errors import InputError

if TYPE_CHECKING:
    from raytracer.regression.making import Source
    from raytracer.regression.references import Reference

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
        typer.Argument(
            metavar="SCENE", help="Scene files; or references (.npz), which are rendered anew as they were."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="Folder of the references.  Default: references.",
            show_default=False,
        ),
    ] = None,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    name: Annotated[
        str | None,
        typer.Option(help="Name of the reference.  Default: that of the scene's file.", show_default=False),
    ] = None,
    width: Annotated[
        int | None, typer.Option(help="Width of the picture (px).  Default: 64.", min=1, show_default=False)
    ] = None,
    spp: Annotated[
        int | None,
        typer.Option(help="Samples per pixel.  Default: 4096.", min=1, max=2**31 - 1, show_default=False),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Seed of all random numbers.  Default: 12345.", min=0, max=2**32 - 1, show_default=False),
    ] = None,
    threads: options.Threads = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no summary.")] = False,
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
    from raytracer.film.output import check_file
    from raytracer.regression import making
    from raytracer.regression.bar import Bar
    from raytracer.regression.references import SUFFIX, load_reference, save_reference
    from raytracer.scene.load import parse_overrides
    from raytracer.stock import Stock

    overrides = parse_overrides(define or [])
    folder = output or Path("references")
    work: dict[Path, tuple[Source, int, int]] = {}
    for scene in scenes:
        if scene.suffix.lower() == SUFFIX:
            _check_alone(scene, name=name, output=output, width=width, define=define)
            path, recipe = scene, load_reference(scene).recipe
            try:
                found = making.source_of(recipe, scene.parent, allow_files or [])
            except InputError as error:
                raise InputError(f"{scene}: {error}") from error
            samples, number = spp or recipe.spp, recipe.seed if seed is None else seed
        else:
            path = folder / f"{name or scene.stem}{SUFFIX}"
            found = making.source(scene, folder, overrides, width or making.WIDTH, allow_files or [])
            samples, number = spp or making.SPP, making.SEED if seed is None else seed
        if path in work:
            raise InputError(f"{scene}: {path} is another scene's already; --name names a reference")
        check_file(path)
        work[path] = found, samples, number

    stock = Stock()
    with Bar(len(work), quiet=quiet) as bar:
        for count, (path, (found, samples, number)) in enumerate(work.items()):
            made = making.make(
                found,
                spp=samples,
                seed=number,
                threads=threads,
                stock=stock,
                progress=bar.of(count, path.stem),
                warn=lambda sentence: bar.say(f"rt: warning: {sentence}", sys.stderr),
            )
            sentence = _sentence(path, made)
            save_reference(path, *made)
            if not quiet:
                bar.say(sentence, sys.stderr)


def _check_alone(
    path: Path, *, name: str | None, output: Path | None, width: int | None, define: list[str] | None
) -> None:
    """Refuse what would make another reference of one that is to be rendered as it was."""
    for option, given in (("--name", name), ("-o", output), ("--width", width), ("-D", define)):
        if given:
            raise InputError(f"{option}: {path} is a reference, which is rendered anew as it was; give its scene")


def _sentence(path: Path, made: "Reference") -> str:
    """What was made, and how it differs from what stood there before."""
    from raytracer.comparison import z_test
    from raytracer.noise.wording import percent
    from raytracer.regression.checking import finds
    from raytracer.regression.making import gain_ratio
    from raytracer.regression.references import load_reference

    height, width, _ = made.mean.shape
    found = f"{path}: {width} x {height}, {made.recipe.spp} spp"
    found += f"; a check by as many finds {percent(finds(made, made.recipe.spp))} more or less light"
    if made.recipe.dropped:
        found += f"; {made.recipe.dropped} samples were not finite and were dropped"
    with contextlib.suppress(InputError):
        before = load_reference(path)
        # With the seed that it has as well, the two are not independent, and differ all the less.
        ratio = gain_ratio(before.recipe.gains, made.recipe.gains)
        spp = before.recipe.spp / made.recipe.spp
        verdict = z_test(ratio * made.mean, ratio**2 * made.variance, before.mean, before.variance, ratio=spp)
        found += f"; what it replaces: {verdict.reason}"
    return found


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog=EXAMPLE)(reference)
