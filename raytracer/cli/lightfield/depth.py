"""`rt lightfield depth`: estimates how far away everything is, in metres."""

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import print_json, report_written
from raytracer.cli.lightfield import base
from raytracer.cli.lightfield.base import Far, File, Memory, Near, Quiet, parse_distance
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.film.formats.base.image_format import ImageFormat
    from raytracer.film.light_field.field import LightField
    from raytracer.lightfield.depth.depth_map import Depth

EXAMPLE = """\b
Examples:
  rt lightfield depth array.lf -o depth.png -o depth.exr
  rt lightfield depth array.lf --near 1 --far 4 -o depth.npy --confidence sure.png
  rt lightfield depth array.lf --method slopes --view 0,0 -o corner.pfm
  rt lightfield depth array.lf -o depth.npy --error error.npy
  rt lightfield depth array.lf --truth --json

\b
.png      colours, near bright, far dark, by equal steps of 1 / distance
.exr      the view, with the layers depth (m), error (m, standard error) and confidence
.npy .pfm metres alone; inf is infinity, nan where no light came (grey in .png)
"""

_SURE = 0.5
"""Confidence from which on the summary counts a pixel."""

_TAILS = 0.01
"""Share of sure pixels at each end that the summary's distances and the picture's colours do not stretch to.

Some are sure and wrong, as where a pattern repeats: one alone would take most of the colours.
"""

_ALMOST_ALL = f"{100.0 * (1.0 - 2.0 * _TAILS):g} %"


def depth(
    file: File,
    output: Annotated[list[Path] | None, options.output("OUT", ".png .exr .npy .pfm.  May repeat.")] = None,
    confidence: Annotated[Path | None, takes("OUT", "How sure each pixel is, 0 to 1: .png .npy .pfm.")] = None,
    error: Annotated[Path | None, takes("OUT", "Standard error of each pixel, in metres: .png .npy .pfm.")] = None,
    truth: Annotated[
        bool,
        Option("--truth", help="Measure the errors against the file's own layer depth, as the benchmark of HCI does."),
    ] = False,
    method: Annotated[
        str, Option(help="focus, slopes, or both.", autocompletion=complete_from("focus", "slopes", "both"))
    ] = "both",
    view: Annotated[str | None, takes("ROW,COLUMN", "What is seen from there.  Default: the middle.")] = None,
    near: Near = None,
    far: Far = None,
    threads: options.Threads = None,
    as_json: options.AsJson = False,
    memory: Memory = "2GB",
    quiet: Quiet = False,
) -> None:
    """Find how far away everything is that a view sees, in metres along the axis, and how sure that is.

    From focus (at which distance all views agree) and from the slopes of lines in epipolar slices.  Where there is no
    texture, or one that repeats, many distances agree: the error is large there, and the confidence low.
    """
    outputs = output or []
    from raytracer.film.formats.registry import image_formats, map_suffixes

    base.check_outputs(outputs, map_suffixes(), "a depth map")
    maps = [path for path in (confidence, error) if path is not None]
    base.check_outputs(maps, map_suffixes(with_image=False), "a map")
    row, column = base.parse_view("--view", view) or (None, None)
    bounds = {"near": parse_distance("--near", near), "far": parse_distance("--far", far)}

    from raytracer.lightfield.depth.depth_map import METHODS, depth_map
    from raytracer.util.atomic_write import write_bytes
    from raytracer.util.progress import Bar

    if method not in METHODS:
        raise InputError(f"--method {method}: must be one of {', '.join(METHODS)}")
    with base.open_within(file, memory) as field, Bar(" steps", quiet=quiet) as bar:
        with options.name_in_errors(file):
            exact = _true_distances(field) if truth else None
            depths = depth_map(
                field, row=row, column=column, method=method, threads=threads, update=bar.update, **bounds
            )
        for path in outputs:
            image_format = image_formats()[path.suffix.lower()]
            if image_format.has_layers:
                layers = {"depth": depths.distance, "error": depths.distance_error, "confidence": depths.confidence}
                base.save_picture(field.view(depths.row, depths.column), path, field, layers)
            else:
                write_bytes(path, _encode_depths(depths, field, image_format))
        if confidence is not None:
            write_bytes(confidence, _encode_confidence(depths, image_formats()[confidence.suffix.lower()]))
        if error is not None:
            write_bytes(error, _encode_error(depths, field, image_formats()[error.suffix.lower()]))
        summary = _summary(depths, field, method)
        if exact is not None:
            with options.name_in_errors(file):
                summary["truth"] = _measured(depths, field, exact)
    report_written(*outputs, *maps, quiet=quiet)
    if as_json:
        print_json(summary)
    elif not quiet:
        _print(summary)


def _encode_depths(depths: "Depth", field: "LightField", image_format: "ImageFormat") -> bytes:
    """Encode a depth map as a file."""
    import numpy as np

    from raytracer.report.colour_maps import depth_colours

    inverse = depths.known(depths.inverse)
    if image_format.encode_map is not None:
        return image_format.encode_map(depths.distance if field.is_metric else inverse)
    assert image_format.encode_pixels is not None
    is_known = np.isfinite(inverse)
    sure = inverse[is_known & (depths.confidence >= np.median(depths.confidence[is_known]))]
    low, high = np.quantile(sure, [_TAILS, 1.0 - _TAILS])
    return image_format.encode_pixels(depth_colours(inverse, float(low), float(high)))


def _encode_confidence(depths: "Depth", image_format: "ImageFormat") -> bytes:
    """Encode a map of confidence as a file."""
    import numpy as np

    if image_format.encode_map is not None:
        return image_format.encode_map(depths.confidence)
    assert image_format.encode_pixels is not None
    return image_format.encode_pixels(np.rint(255.0 * depths.confidence).astype(np.uint8))


def _encode_error(depths: "Depth", field: "LightField", image_format: "ImageFormat") -> bytes:
    """Encode a map of the standard error as a file: metres, or as a picture by its logarithm."""
    import numpy as np

    from raytracer.report.colour_maps import depth_colours

    error = depths.distance_error if field.is_metric else depths.disparity_error(field.views)
    assert error is not None
    if image_format.encode_map is not None:
        return image_format.encode_map(error)
    assert image_format.encode_pixels is not None
    logarithm = np.log(np.where(np.isfinite(error) & (error > 0.0), error, np.nan))
    if not np.isfinite(logarithm).any():
        return image_format.encode_pixels(depth_colours(logarithm, 0.0, 1.0))
    low, high = np.nanquantile(logarithm, [_TAILS, 1.0 - _TAILS])
    return image_format.encode_pixels(depth_colours(logarithm, float(low), float(high)))


def _true_distances(field: "LightField") -> Any:
    """Return the layer of true distances; raise an InputError if there is none in metres."""
    from raytracer.film.light_field.field import DEPTH_LAYER

    if not field.is_metric or DEPTH_LAYER not in field.layers:
        raise InputError("--truth needs a light field in metres with the layer depth, as `--aov depth` renders it")
    return field.layers[DEPTH_LAYER]


def _measured(depths: "Depth", field: "LightField", layer: Any) -> dict[str, Any]:
    """Measure a depth map against the layer of true distances; None stands for what there is nothing of."""
    import numpy as np

    from raytracer.lightfield.depth.measures import BAD, measure_depth

    exact = np.asarray(layer[depths.row, depths.column], dtype=np.float64).reshape(depths.inverse.shape)
    try:
        measures = measure_depth(field.views, depths, exact)
    except ValueError as error:
        raise InputError(str(error)) from None
    angles = {"planes_degrees": measures.planes_degrees, "curved_degrees": measures.curved_degrees}
    return {
        "mse_x100": measures.mse_x100,
        **{f"bad_{limit:g}": share for limit, share in zip(BAD, measures.bad, strict=True)},
        **{name: angle if math.isfinite(angle) else None for name, angle in angles.items()},
    }


def _summary(depths: "Depth", field: "LightField", method: str) -> dict[str, Any]:
    """Return the numbers that `--json` prints; None stands for infinity."""
    import numpy as np

    is_sure = depths.confidence >= _SURE
    error = depths.distance_error if field.is_metric else depths.disparity_error(field.views)
    view, share = [depths.row, depths.column], float(is_sure.mean())
    summary: dict[str, Any] = {"method": method, "view": view, "sure_share": share}
    if is_sure.any():
        values = (depths.distance if field.is_metric else depths.inverse)[is_sure]
        # Not by interpolation, which has no answer between a number and infinity.
        shares = (_TAILS, 0.5, 1.0 - _TAILS)
        names = ("near_m", "median_m", "far_m") if field.is_metric else ("least_px", "median_px", "most_px")
        summary |= {
            name: float(value) if math.isfinite(value) else None
            for name, value in zip(names, np.quantile(values, shares, method="inverted_cdf"), strict=True)
        }
        if error is not None:
            middle = float(np.quantile(error[is_sure], 0.5, method="inverted_cdf"))
            summary["error_m" if field.is_metric else "error_px"] = middle if math.isfinite(middle) else None
    return summary


def _print(summary: dict[str, Any]) -> None:
    print(f"{100.0 * summary['sure_share']:.1f} % of the pixels are sure (confidence of {_SURE:g} or more)")
    if "near_m" in summary:
        values = (summary[name] for name in ("near_m", "median_m", "far_m"))
        near, median, far = ("infinity" if value is None else f"{value:.4g} m" for value in values)
        print(f"{_ALMOST_ALL} of these are {near} to {far} away, half of them at most {median}")
        if summary.get("error_m") is not None:
            print(f"half of these have a standard error of at most {_metres(summary['error_m'])}")
    elif "least_px" in summary:
        low, high = summary["least_px"], summary["most_px"]
        print(
            f"{_ALMOST_ALL} of these move by {low:.3g} to {high:.3g} pixels from view to view; "
            "metres need the geometry, which is not known"
        )
    if "truth" in summary:
        _print_truth(summary["truth"])
    sys.stdout.flush()


def _metres(length: float) -> str:
    """Say a small length in mm."""
    return f"{1e3 * length:.3g} mm" if length < 1.0 else f"{length:.3g} m"


def _print_truth(measures: dict[str, Any]) -> None:
    """Print the measures of the benchmark."""
    print(f"against the layer depth: mean squared error x 100: {measures['mse_x100']:.3g} px^2")
    shares = (f"{100.0 * value:.3g} % > {name[4:]} px" for name, value in measures.items() if name.startswith("bad_"))
    print(f"errors of the disparity: {', '.join(shares)}")
    for name, what in (("planes_degrees", "planes"), ("curved_degrees", "curved surfaces")):
        if measures[name] is not None:
            print(f"median angle between normals on {what}: {measures[name]:.3g} degrees")
