"""`rt compare`: measures how far apart images are, and tests whether by more than their noise."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import check_files, print_json, report_written
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.analysis.compare import Comparison, FolderComparison, FolderPair, PassCriteria

EXAMPLE = """\b
Examples:
  rt compare render.exr reference.exr
  rt compare render.png reference.png --fail-above flip=0.05 --fail-below ssim=0.98
  rt compare a.exr b.exr --difference signed.png --difference flip=flip.png
  rt compare a.exr b.exr --difference wipe.html
  rt compare outputs/before outputs/after --fail-above relmse=0.001 --json
"""

_FAILED = 1


def compare(
    a: Annotated[str, Argument(metavar="A", help="Image, or folder of images.")],
    b: Annotated[str, Argument(metavar="B", help="What it is compared with: the reference.")],
    metric: Annotated[
        list[str] | None,
        takes(
            "NAME,...",
            "What to measure: mae, mse, rmse, relmse, mrse, psnr, ssim, flip; may repeat.  Default: all, but for "
            "flip of large images, which takes long.",
        ),
    ] = None,
    fail_above: Annotated[
        list[str] | None, takes("METRIC=VALUE", "Fail if a metric is above this: flip=0.05; may repeat.")
    ] = None,
    fail_below: Annotated[
        list[str] | None, takes("METRIC=VALUE", "The same for psnr and ssim, which are better when larger.")
    ] = None,
    test: Annotated[
        bool | None,
        Option(
            "--test/--no-test",
            help="Whether the z-test of the variances that .exr files hold has to pass.  Default: if there is nothing "
            "else that could fail, and both images hold theirs.",
        ),
    ] = None,
    alpha: Annotated[
        float | None,
        Option(help="How often images that differ by their noise only may fail the z-test.  Default: 0.001."),
    ] = None,
    difference: Annotated[
        list[str] | None,
        takes(
            "[KIND=]FILE",
            "Write a picture of the difference, .png, of the kind signed (default), absolute, relative, flip, z "
            "or side-by-side; or .html, a page to wipe between the images.  Of folders: a folder of pictures.  "
            "May repeat.",
        ),
    ] = None,
    as_json: options.AsJson = False,
    quiet: options.Findings = False,
) -> int:
    """Compare an image with a reference, or all images of a folder with those of the same name in another.

    .png and .jpg are compared in what they hold; .exr, .hdr and .npy in linear light, but for psnr and ssim, which are
    of what a display shows.  Exit status 1 if something that was asked for is not so, or an image of a folder has
    none to be compared with.
    """
    above, below = _parse_bounds("--fail-above", fail_above), _parse_bounds("--fail-below", fail_below)
    are_folders = Path(a).is_dir() and Path(b).is_dir()
    for one, other in ((a, b), (b, a)):
        if Path(one).is_dir() and not are_folders:
            if not Path(other).exists():
                raise InputError(f"{other}: no such folder")
            raise InputError(f"{one} is a folder, and {other} is not: compare two images or two folders")
    pictures = [_parse_difference(text, are_folders) for text in difference or []]

    from raytracer.analysis.compare import ALPHA, PassCriteria, normalize_criteria, normalize_metric_names

    names = None if metric is None else normalize_metric_names(name for text in metric for name in text.split(","))
    checks = normalize_criteria(PassCriteria(above, below, test, ALPHA if alpha is None else alpha))
    compare_both = _compare_folders if are_folders else _compare_files
    comparison: Comparison | FolderComparison = compare_both(a, b, names, checks, pictures, quiet)
    if as_json:
        print_json(comparison.json())
    else:
        print(comparison.text(), end="")
    return _FAILED if comparison.passed is False else 0


class _Output(NamedTuple):
    """A picture of differences to write."""

    kind: str
    path: Path


def _parse_bounds(option: str, texts: list[str] | None) -> dict[str, float]:
    """Parse the bounds on metrics that an option gives."""
    bounds: dict[str, float] = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not equals or math.isnan(number):
            raise InputError(f"{option} {text}: must be METRIC=NUMBER, as in relmse=0.01")
        bounds[name.strip().lower()] = number
    return bounds


def _parse_difference(text: str, are_folders: bool) -> _Output:
    """Parse the kind and file that `--difference` names."""
    from raytracer.analysis.compare import KINDS, check_kind

    kind, equals, name = text.partition("=")
    if not equals or "/" in kind or "." in kind:
        kind, name = "", text
    path = Path(name)
    is_page = path.suffix.lower() in (".html", ".htm")
    kind = kind or ("wipe" if is_page else KINDS[0])
    check_kind(kind)
    if not name:
        raise InputError(f"--difference {text}: names no file")
    if kind == "wipe" and not is_page:
        raise InputError(f"--difference {text}: a page to wipe is written to a file .html")
    if kind != "wipe" and is_page:
        raise InputError(f"--difference {text}: only the kind wipe is a page; other kinds are written as .png")
    if kind != "wipe" and not are_folders and path.suffix.lower() != ".png":
        raise InputError(f"--difference {text}: pictures of differences are written as .png, or .html to wipe")
    if are_folders and kind != "wipe" and path.is_file():
        raise InputError(f"--difference {text}: is a file, and the pictures of a folder are written to a folder")
    return _Output(kind, path)


def _compare_files(
    a: str, b: str, names: tuple[str, ...] | None, checks: "PassCriteria", pictures: list[_Output], quiet: bool
) -> "Comparison":
    from raytracer.analysis.compare import compare_images, encode, read
    from raytracer.util.atomic_write import write_bytes

    check_files(picture.path for picture in pictures)
    comparison = compare_images(read(a, "A"), read(b, "B"), names, checks)
    # What cannot be shown is known before anything is written.
    files = [(picture.path, encode(comparison, picture.kind)) for picture in pictures]
    for path, data in files:
        write_bytes(path, data)
        report_written(path, quiet=quiet)
    return comparison


def _compare_folders(
    a: str, b: str, names: tuple[str, ...] | None, checks: "PassCriteria", pictures: list[_Output], quiet: bool
) -> "FolderComparison":
    from raytracer.analysis.compare import compare_folders, encode
    from raytracer.analysis.compare.difference_image import WipePage
    from raytracer.util.atomic_write import write_bytes
    from raytracer.util.progress import Bar

    wipes = {picture.path: WipePage() for picture in pictures if picture.kind == "wipe"}
    with Bar(" pairs", quiet=quiet, desc="compare") as bar:

        def done(pair: "FolderPair", number: int, count: int) -> None:
            for picture in pictures:
                if pair.comparison is None:
                    continue
                if picture.kind == "wipe":
                    wipes[picture.path].add(pair.comparison, pair.name)
                else:
                    write_bytes(picture.path / f"{pair.name}.png", encode(pair.comparison, picture.kind))
            bar.update(number, count)

        comparisons = compare_folders(a, b, metrics=names, checks=checks, done=done)
    for path, views in wipes.items():
        write_bytes(path, views.page(f"{a} against {b}"))
    report_written(*(picture.path for picture in pictures), quiet=quiet)
    return comparisons
