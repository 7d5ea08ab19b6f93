"""Plots of a study: error against time, a map of the error, and the picture itself.

Each is made twice, as a file and for the page.
"""

import io
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytracer.analysis.cost.results import ConvergencePoint, Prediction, Study
from raytracer.core.error_estimate.intervals import Interval
from raytracer.film.exposure import luminance
from raytracer.report import wording
from raytracer.report.figure import (
    IN_PAGE,
    ON_PAPER,
    Curve,
    PageFigure,
    ink,
    new_figure,
    page_figure,
    series_id,
    style,
    to_png,
    to_svg,
)
from raytracer.report.palette import BLUE, GREEN, VERMILLION
from raytracer.util import srgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

# Grey that is visible on white and on black.
_UNMEASURED = (0.5, 0.5, 0.5, 0.25)

# The map's pictures are no wider or higher than this; the file with the numbers has all pixels.
_LARGEST_EDGE = 1600

# Size of letters on the page (pt), where a figure is as wide as a narrow window.
_LETTERS = 9.0

# Blocks of pixels along an edge whose error is told under the pointer.
_LARGEST_GRID = 160

# Factor of time beyond the last measurement up to which is drawn.
_MAX_EXTRAPOLATION = 1e5


# ---- Convergence


def _usable(points: tuple[ConvergencePoint, ...]) -> list[ConvergencePoint]:
    return [p for p in points if p.seconds > 0.0 and 0.0 < p.error.value < math.inf and math.isfinite(p.seconds)]


def _time_range_end(predicted: Prediction, points: list[ConvergencePoint]) -> float:
    """Return the seconds up to which the plot goes."""
    last = points[-1].seconds
    wanted = [predicted.target_seconds.high, predicted.target_seconds.value, predicted.budget or last]
    return max([last, *(t for t in wanted if math.isfinite(t) and t < _MAX_EXTRAPOLATION * last)])


def _draw_convergence(axes: "Axes", study: Study, points: list[ConvergencePoint]) -> list[Curve]:
    """Draw the curves; returns those that are told under the pointer."""
    predicted = study.prediction
    seconds = np.array([p.seconds for p in points])
    errors = np.array([p.error.value for p in points])
    until = _time_range_end(predicted, points)

    # Draw the two slopes through the last measurement, to compare with.
    guide = np.geomspace(seconds[0], until, 2)
    for slope, dashes, words in ((-0.5, (6, 3), "slope -1/2: independent samples"), (-0.75, (2, 2), "slope -3/4")):
        along = errors[-1] * (guide / seconds[-1]) ** slope
        axes.plot(guide, along, color=ink(), alpha=0.55, linewidth=1.0, dashes=dashes, label=words)

    # Draw the fit from the first measurement on, if it is known, and the measurements on top of it.
    curves = [Curve("measured", seconds, 100.0 * errors)]
    per_sample, fixed = predicted.per_sample.value, predicted.fixed.value
    if per_sample > 0.0 and math.isfinite(fixed) and predicted.error(1.0) > 0.0:
        fit, last = "fit to what was measured", max(points[-1].spp, (until - fixed) / per_sample)
        spp = np.geomspace(points[0].spp, last, 200)
        times, fitted = fixed + per_sample * spp, np.array([predicted.error(n) for n in spp])
        axes.plot(times, fitted, color=BLUE, linewidth=2.0, label=fit, gid=series_id(len(curves)))
        curves.append(Curve(fit, times, 100.0 * fitted))
    ends = np.array([_error_bar(p.error) for p in points]).T
    measured = axes.errorbar(
        seconds, errors, yerr=ends, fmt="o", color=BLUE, capsize=3.0, markersize=6.0, label="measured, 95 % interval"
    )
    measured.lines[0].set_gid(series_id(0))
    for point in points:
        axes.annotate(
            f"{point.spp:,} spp",
            (point.seconds, point.error.value),
            xytext=(7, 6),
            textcoords="offset points",
            fontsize="small",
        )

    # Draw target and budget, and where the fit meets the target.
    label = f"target {wording.format_given_percent(predicted.target)}"
    axes.axhline(predicted.target, color=VERMILLION, linewidth=1.5, linestyle="-.", label=label)
    if predicted.budget is not None and predicted.budget > 0.0:
        label = f"budget {wording.format_given_duration(predicted.budget)}"
        axes.axvline(predicted.budget, color=GREEN, linewidth=1.5, linestyle=":", label=label)
    at = predicted.target_seconds
    if math.isfinite(at.value) and 0.0 < at.value <= until:
        axes.errorbar(
            [at.value],
            [predicted.target],
            xerr=np.transpose([_error_bar(at)]) if 0.0 < at.low <= at.value <= at.high < math.inf else None,
            fmt="D",
            color=VERMILLION,
            capsize=4.0,
            markersize=7.0,
            label=f"target reached, predicted: {wording.format_duration(at.value)}",
        )
    return curves


def _error_bar(interval: Interval) -> tuple[float, float]:
    """Return the lengths of an error bar below and above; 0 where its ends are not known."""
    value, low, high = interval
    if not 0.0 < low <= value <= high < math.inf:
        return 0.0, 0.0
    return value - low, high - value


def _ticks(axes: "Axes") -> None:
    """Label both axes with plain numbers, more of them where they span little."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    for axis, low, high, words in (
        (axes.xaxis, *axes.get_xlim(), lambda x: f"{x:,g}"),
        (axes.yaxis, *axes.get_ylim(), lambda y: f"{100.0 * y:g} %"),
    ):
        decades = math.log10(high / low)
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 3.0 else (1.0,), numticks=30))
        axis.set_major_formatter(FuncFormatter(lambda value, _, words=words: words(value)))
        axis.set_minor_locator(LogLocator(subs=range(1, 10), numticks=30) if decades < 6.0 else NullLocator())
        axis.set_minor_formatter(NullFormatter())


def _plot_convergence(study: Study, size: tuple[float, float]) -> "tuple[Figure, list[Curve]] | None":
    """Plot error against time in the style that is set, of a size (inches); None without an error to show."""
    points = _usable(study.prediction.points)
    if not points:
        return None
    figure = new_figure(*size, "constrained")
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    curves = _draw_convergence(axes, study, points)
    axes.set_xlabel("time of a render of the whole picture [s]")
    axes.set_ylabel("relative error (RMS)")
    axes.margins(0.06)
    axes.grid(which="major")
    axes.autoscale_view()
    _ticks(axes)
    figure.legend(loc="outside lower center", ncols=2, fontsize="small")
    return figure, curves


def convergence_svg(study: Study) -> bytes | None:
    """Plot relative error against seconds, both logarithmic, as an SVG file on white; None without an error to show."""
    with style(ON_PAPER):
        plotted = _plot_convergence(study, (7.6, 5.8))
        return None if plotted is None else to_svg(plotted[0])


def convergence_for_page(study: Study) -> PageFigure | None:
    """Plot `convergence_svg` for a page."""
    title = "Relative error against time, both axes logarithmic: measured points, fit, target and budget."
    with style(IN_PAGE, _LETTERS):
        plotted = _plot_convergence(study, (5.4, 4.6))
        if plotted is None:
            return None
        labels = "time (s)", "relative error (%)"
        return page_figure(plotted[0].axes[0], "convergence", title, labels, plotted[1], (1.0, 100.0))


# ---- Where the error is


def _downsample(error: Array, largest: int = _LARGEST_EDGE) -> Array:
    """Average blocks of pixels, by the root of their mean square, until no edge has more than `largest`."""
    block = -(-max(error.shape) // largest)
    if block <= 1:
        return error
    height, width = (-(-edge // block) * block for edge in error.shape)
    padded = np.full((height, width), np.nan)
    padded[: error.shape[0], : error.shape[1]] = error
    cells = padded.reshape(height // block, block, width // block, block).swapaxes(1, 2)
    known = np.isfinite(cells)
    count = known.sum(axis=(2, 3))
    squares = np.where(known, cells, 0.0) ** 2
    return np.where(count > 0, np.sqrt(squares.sum(axis=(2, 3)) / np.maximum(count, 1)), np.nan)


def has_error_map(study: Study) -> bool:
    """Tell if there is a pixel of which an error above 0 is known."""
    return bool(np.any(np.isfinite(study.error_map) & (study.error_map > 0.0)))


def _plot_error_map(study: Study, longest: float = 7.0) -> "tuple[Figure, float] | None":
    """Plot the error of each pixel in the style that is set, and return the inches of a pixel; None without an error.

    longest : width of the map, or 1.3 times its height if that is more (inches).
    """
    import matplotlib as mpl
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if not has_error_map(study):
        return None
    error = _downsample(study.error_map)
    positive = error[np.isfinite(error) & (error > 0.0)]
    low, high = (float(x) for x in np.percentile(positive, (5.0, 99.5)))
    if high < 2.0 * low:
        low, high = low / math.sqrt(2.0), high * math.sqrt(2.0)

    # The scale goes where it has room.
    height, width = error.shape
    scale = longest / max(width, 1.3 * height)
    below = width >= height
    figure = new_figure(width * scale + 1.3 * (not below), height * scale + 0.9 * below, "constrained")
    axes = figure.add_subplot()
    colours = mpl.colormaps["viridis"].with_extremes(bad=_UNMEASURED)
    shown = np.ma.masked_invalid(np.maximum(error, low))
    image = axes.imshow(shown, norm=LogNorm(low, high), cmap=colours, interpolation="none")
    axes.set_axis_off()
    bar = figure.colorbar(
        image, ax=axes, extend="both", location="bottom" if below else "right", pad=0.02, fraction=0.05, aspect=30
    )
    # From five decades on every second one has a number, as there is no room for more.
    bar.long_axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 1e3 * low else (1.0,), numticks=5))
    bar.long_axis.set_major_formatter(FuncFormatter(lambda value, _: f"{100.0 * value:g} %"))
    bar.long_axis.set_minor_formatter(NullFormatter())
    at = f" at {study.prediction.points[-1].spp:,} spp" if study.prediction.points else ""
    bar.set_label(f"relative error of a pixel{at}{'; grey: not measured' if np.isnan(error).any() else ''}")
    return figure, scale


def error_map_png(study: Study) -> bytes | None:
    """Plot the relative error of each pixel with a logarithmic colour map, on white; None without an error to show."""
    with style(ON_PAPER):
        plotted = _plot_error_map(study)
        return None if plotted is None else to_png(plotted[0], max(150.0, 1.1 / plotted[1]))


def error_map_for_page(study: Study) -> PageFigure | None:
    """Plot `error_map_png` for a page, with the error (%) of blocks of pixels to be told under the pointer."""
    with style(IN_PAGE, _LETTERS):
        plotted = _plot_error_map(study, 4.8)
        if plotted is None:
            return None
        title = "Map of the relative error of each measured pixel."
        made = page_figure(plotted[0].axes[0], "map", title, ("x (px)", "y (px)"), [])
    height, width = study.error_map.shape
    ranges = [[0.0, float(width)], [float(height), 0.0]]
    blocks = _downsample(study.error_map, _LARGEST_GRID)
    values = [[None if math.isnan(value) else float(f"{100.0 * value:.3g}") for value in row] for row in blocks]
    # The last blocks of a row may reach beyond the picture.
    block = -(-max(height, width) // _LARGEST_GRID)
    return made._replace(
        data=made.data | {"ranges": ranges, "grid": {"label": "error (%)", "step": block, "values": values}}
    )


def picture_png(study: Study) -> bytes | None:
    """Encode the rendered picture, exposed so that little is clipped; transparent where nothing was rendered.

    None if nothing was.  Its 99th percentile of luminance is white.
    """
    from PIL import Image

    known: NDArray[np.bool_] = np.asarray(np.isfinite(study.picture).all(axis=-1))
    if not known.any():
        return None
    values = np.where(known[..., None], study.picture, 0.0)
    white = float(np.percentile(luminance(values)[known], 99.0))
    shown = srgb.to_uint8(values / white if white > 0.0 else values)
    picture = Image.fromarray(np.dstack([shown, np.where(known, 255, 0).astype(np.uint8)]))
    picture.thumbnail((_LARGEST_EDGE, _LARGEST_EDGE))
    data = io.BytesIO()
    picture.save(data, format="PNG", optimize=True)
    return data.getvalue()
