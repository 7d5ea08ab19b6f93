"""`rt lightfield depth`: how far away everything is, in metres."""

import io
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from raytracer.cli import options
from raytracer.cli.lightfield import _pictures
from raytracer.cli.lightfield._common import File, Quiet, check_outputs, opened, wrote
from raytracer.errors import InputError

if TYPE_CHECKING:
    from raytracer.lightfield.depth import Depth
    from raytracer.plenoptic.field import LightField

EXAMPLE = """\b
Examples:
  rt lightfield depth array.lf -o depth.png -o depth.exr
  rt lightfield depth array.lf --near 1 --far 4 -o depth.npy --confidence sure.png
  rt lightfield depth array.lf --method slopes --view 0,0 -o corner.pfm
  rt lightfield depth array.lf --json

\b
.png      colours, near bright, far dark, by equal steps of 1 / distance
.exr      the view, with the layers depth (m) and confidence
.npy .pfm metres alone; inf is infinity, nan where no light came (grey in .png)
"""

_SUFFIXES = (".png", ".exr", ".npy", ".pfm")
_CONFIDENCE_SUFFIXES = (".png", ".npy", ".pfm")

_SURE = 0.5
"""Confidence from which on the summary counts a pixel."""

_TAILS = 0.01
"""Share of sure pixels at each end that the summary's distances and the picture's colours do not stretch to.

Some are sure and wrong, as where a pattern repeats: one alone would take most of the colours.
"""

_ALMOST_ALL = f"{100.0 * (1.0 - 2.0 * _TAILS):g} %"


def register(group: typer.Typer) -> None:
    """Add the command to the group."""
    group.command("depth", epilog=EXAMPLE)(depth)


def depth(
    file: File,
    output: Annotated[
        list[Path] | None, typer.Option("--output", "-o", metavar="OUT", help=".png .exr .npy .pfm.  May repeat.")
    ] = None,
    confidence: Annotated[
        Path | None, typer.Option(metavar="OUT", help="How sure each pixel is, 0 to 1: .png .npy .pfm.")
    ] = None,
    method: Annotated[str, typer.Option(help="focus, slopes, or both.")] = "both",
    view: Annotated[
        str | None, typer.Option(metavar="ROW,COLUMN", help="What is seen from there.  Default: the middle.")
    ] = None,
    near: _pictures.Near = None,
    far: _pictures.Far = None,
    threads: options.Threads = None,
    as_json: options.AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Find how far away everything is that a view sees, in metres along the axis, and how sure that is.

    From focus (at which distance all views agree) and from the slopes of lines in epipolar slices.  Where there is no
    texture, all distances agree: the confidence is low there.
    """
    outputs = output or []
    check_outputs(outputs, _SUFFIXES, "a depth map")
    if confidence is not None:
        check_outputs([confidence], _CONFIDENCE_SUFFIXES, "a map of confidence")
    index = _pictures.pair("--view", view) or (None, None)
    nearest, farthest = _pictures.distance("--near", near), _pictures.distance("--far", far)

    from raytracer.film.output import write_bytes
    from raytracer.lightfield.depth import METHODS, depth_map
    from raytracer.progress import Bar

    if method not in METHODS:
        raise InputError(f"--method {method}: must be one of {', '.join(METHODS)}")
    with opened(file) as field, Bar(" steps", quiet=quiet) as bar:
        try:
            found = depth_map(
                field,
                row=index[0],
                column=index[1],
                method=method,
                near=nearest,
                far=farthest,
                threads=threads,
                update=bar.update,
            )
        except InputError as error:
            raise InputError(f"{file}: {error}") from None
        for path in outputs:
            if path.suffix.lower() == ".exr":
                layers = {"depth": found.distance, "confidence": found.confidence}
                _pictures.save(field.view(found.row, found.column), path, field, layers)
            else:
                write_bytes(path, _encoded(found, field, path.suffix.lower()))
        if confidence is not None:
            write_bytes(confidence, _confidence(found, confidence.suffix.lower()))
        told = _summary(found, field, method)
    for path in [*outputs, *([] if confidence is None else [confidence])]:
        wrote(path, quiet)
    if as_json:
        print(json.dumps(told, indent=2, allow_nan=False))
    elif not quiet:
        _print(told)


def _encoded(found: "Depth", field: "LightField", suffix: str) -> bytes:
    """A depth map as a file."""
    import numpy as np

    from raytracer.film import pfm
    from raytracer.lightfield.colouring import coloured

    inverse = found.known(found.inverse)
    values = found.distance if field.is_metric else inverse
    if suffix == ".pfm":
        return pfm.encode(values)
    if suffix == ".npy":
        return _npy(values)
    is_known = np.isfinite(inverse)
    sure = inverse[is_known & (found.confidence >= np.median(found.confidence[is_known]))]
    low, high = np.quantile(sure, [_TAILS, 1.0 - _TAILS])
    return _png(coloured(inverse, float(low), float(high)))


def _confidence(found: "Depth", suffix: str) -> bytes:
    import numpy as np

    from raytracer.film import pfm

    if suffix == ".pfm":
        return pfm.encode(found.confidence)
    if suffix == ".npy":
        return _npy(found.confidence)
    return _png(np.rint(255.0 * found.confidence).astype(np.uint8))


def _npy(values: Any) -> bytes:
    import numpy as np

    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=False)
    return buffer.getvalue()


def _png(pixels: Any) -> bytes:
    import PIL.Image

    buffer = io.BytesIO()
    PIL.Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def _summary(found: "Depth", field: "LightField", method: str) -> dict[str, Any]:
    """What was found, as data; infinity is None."""
    import numpy as np

    is_sure = found.confidence >= _SURE
    told: dict[str, Any] = {
        "method": method,
        "view": [found.row, found.column],
        "sure_share": float(is_sure.mean()),
    }
    if is_sure.any():
        values = (found.distance if field.is_metric else found.inverse)[is_sure]
        # Not by interpolation, which has no answer between a number and infinity.
        shares = (_TAILS, 0.5, 1.0 - _TAILS)
        names = ("near_m", "median_m", "far_m") if field.is_metric else ("least_px", "median_px", "most_px")
        told |= {
            name: float(value) if math.isfinite(value) else None
            for name, value in zip(names, np.quantile(values, shares, method="inverted_cdf"), strict=True)
        }
    return told


def _print(told: dict[str, Any]) -> None:
    print(f"{100.0 * told['sure_share']:.1f} % of the pixels are sure (confidence of {_SURE:g} or more)")
    if "near_m" in told:
        near, median, far = (
            "infinity" if v is None else f"{v:.4g} m" for v in (told[n] for n in ("near_m", "median_m", "far_m"))
        )
        print(f"{_ALMOST_ALL} of these are {near} to {far} away, half of them at most {median}")
    elif "least_px" in told:
        print(
            f"{_ALMOST_ALL} of these move by {told['least_px']:.3g} to {told['most_px']:.3g} pixels from view to view; "
            "metres need the geometry, which is not known"
        )
    sys.stdout.flush()
