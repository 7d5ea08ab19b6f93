"""How far away things are (m), from what the views of a light field see.

Two ways, each with a confidence in 0..1, and both together:

- **focus**: for planes at many distances all views are brought over the middle one, as for a photograph focused there;
  what is there agrees in all of them, what is not differs.  Where something nearer hides a place from some views, those
  of one side of the aperture see it: of the four halves of the aperture and the whole, the one that agrees best counts.
  Differences are averaged along what looks alike in the middle view, by the guided filter.
- **slopes**: a point is a line in an epipolar slice, which is steeper the nearer it is.  The structure tensor of the
  slices through the middle row and column of views gives the line's direction, finer than any step between planes.

Distances are those along the axis from the plane of the views, as of the AOV `depth`.  All are found as 1 / distance,
in which a step moves pixels by the same everywhere.

References: Kang, Szeliski, Chai 2001, "Handling Occlusions in Dense Multi-view Stereo"; Wang, Efros, Ramamoorthi 2015,
    "Occlusion-aware Depth Estimation Using Light-field Cameras"; Tao et al. 2013, "Depth from Combining Defocus and
    Correspondence Using Light-Field Cameras"; He, Sun, Tang 2010, "Guided Image Filtering"; Hosni et al. 2013, "Fast
    Cost-Volume Filtering for Visual Correspondence and Beyond"; Wanner, Goldluecke 2014, "Variational Light Field
    Analysis for Disparity Estimation and Super-Resolution"; Diebold, Goldluecke 2013, "Epipolar Plane Image Refocusing
    for Improved Depth Estimation and Occlusion Handling".
"""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.lightfield.coverage import at_nearest, continued, lit_view, require_lit, within_lens
from raytracer.lightfield.warping import Spline, tone
from raytracer.plenoptic.field import LightField
from raytracer.plenoptic.views import Views

Method = Literal["focus", "slopes", "both"]
METHODS: tuple[Method, ...] = ("focus", "slopes", "both")

Update = Callable[[float, float], object]
"""Told of the work that is done, and of all that is wanted."""

_Picture = NDArray[np.float64]

_MOST_VIEWS = 49
"""Views that are compared: of larger arrays every second, third ... one, as noise is low enough with so many."""

_STEP = 1.0 / 3.0
"""Pixels by which the outermost view moves from plane to plane: textures, and the parabola through three planes, are
smooth over so little."""

_MOST_PLANES = 192
"""Where views are so far apart that more were needed, planes are farther apart."""

_COARSE_STEP, _COARSE_REACH = 0.5, 8.0
"""Pixels that what is at a plane moves between neighbouring views: from plane to plane, and at most, in the search for
where there is anything.  Light fields are called densely sampled below one or two."""

_TAILS = 0.001
"""Part of all pixels at each end of the distances found by the search that is taken for mistakes."""

_BUDGET = 256 * 2**20
"""Bytes for the differences of the planes that are worked on at once."""

_HALVES = 4
"""Left, right, lower and upper one; the middle row and column are in both of theirs."""

_INLIER = 0.5
"""Squared differences as large as this share of the middle view's own variance count half; larger ones are those of
something else that is seen, and how different that is tells nothing."""

_LIKENESS = 0.02
"""Of the guided filter: contrast, squared, as a share of the picture's variance, from which on an edge is kept."""

_RADIUS = 1
"""Of the guided filter's boxes, in pixels."""

_SMOOTHED = 1.0
"""Standard deviation (pixels) of the Gaussian whose derivatives are taken: sampled, a narrower one's are wrong."""

_TENSOR = 1.5
"""Standard deviation of the Gaussian over which the structure tensor is averaged, pixels and views."""

_NEAR = 2.0 * _TENSOR
"""Views from a view whose part in the average at it is more than an eighth of the view's own."""

_SHEAR, _STEEPEST = 0.5, 0.375
"""Pixels a view: from shear to shear, and the greatest slope taken from one, half of that with something to spare.
Differences between views are derivatives where slopes are small."""

_OWN, _BESIDE = 0.6, 0.1
"""Standard deviation (pixels) of the Gaussian that tells a pixel's own texture, and the share of the texture around it
that it must have for a confidence of a half."""

_SURE_SLOPE = 0.2
"""Pixels a view by which a slope may be wrong, by what its line leaves unexplained, for a confidence of a half."""

_WITNESS, _DOUBT = 0.5, 0.5
"""What the confidence of slopes counts beside that of focus, and what is left of it where both do not agree."""

_FEWEST_IN_LINE = 3

_WITNESSES = 2
"""Other views that must have light at a pixel for its depth to be known: one agrees somewhere by chance."""


@dataclass(frozen=True, eq=False)
class Depth:
    """How far away it is what a view sees.

    Attributes
    ----------
    inverse : float64 (height, width), 1 / distance (1/m); of a light field whose geometry is not known, pixels from
        view to view.
    confidence : float64 (height, width) in 0..1; 0 where all distances explain the views as well, as without texture.
    row, column : of the view.
    lit : which pixels of the view got light, bool (height, width), None for all; `inverse` is continued over others.
    """

    inverse: _Picture
    confidence: _Picture
    row: int
    column: int
    lit: NDArray[np.bool_] | None = None

    @property
    def distance(self) -> _Picture:
        """Distance along the axis from the plane of the views (m), float64 (height, width); inf for infinity.

        It is nan where there is no light.
        """
        with np.errstate(divide="ignore"):
            return self.known(np.where(self.inverse > 0.0, 1.0 / np.maximum(self.inverse, 0.0), np.inf))

    def known(self, values: _Picture) -> _Picture:
        """Mask values (height, width): nan where there is no light."""
        return values if self.lit is None else np.where(self.lit, values, np.nan)


class _Estimate(NamedTuple):
    inverse: _Picture
    confidence: _Picture


def depth_map(
    field: LightField,
    *,
    row: int | None = None,
    column: int | None = None,
    method: Method = "both",
    near: float | None = None,
    far: float | None = None,
    threads: int | None = None,
    update: Update | None = None,
) -> Depth:
    """How far away it is what one view sees.

    Views are read one at a time.  Memory is 256 MB for planes, and for slopes six grey pictures a view of a row:
    0.7 GB in all for 17 x 17 views of 512 x 384.

    Parameters
    ----------
    row, column : of the view; default: the middle.
    near, far : distances (m) between which things are; default: searched for, among distances at which things move by
        at most 8 pixels between neighbouring views, as seen from the plane where all views see the same.
    threads : that work; default: all.
    update : told of the progress.

    Raises
    ------
    InputError : there are too few views, no such view, no such method, or `near` is not nearer than `far`.
    """
    if method not in METHODS:
        raise InputError(f"no method {method}; there are {', '.join(METHODS)}")
    middle = reference(field.views, row, column)
    require_lit(field, *middle)
    grid = within_lens(field.views)
    others = [index for index in zip(*np.nonzero(grid), strict=True) if index != middle]
    if not others:
        raise InputError("depth needs at least two views, and the light field has one")

    counter = _Counter(update)
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        bounds = _bounds(field, middle, others, near, far, pool, counter)
        found: list[_Estimate] = []
        step = 0.0
        if method in {"focus", "both"}:
            planes = _planes(field.views, middle, others, bounds)
            step = float(planes[1] - planes[0])
            found.append(_from_focus(field, middle, _thinned(field.views, middle), planes, pool, counter))
        if method in {"slopes", "both"}:
            found.append(_from_slopes(field, middle, bounds, pool, counter))
    estimate = found[0] if len(found) == 1 else _together(*found, agreeing=step)
    confidence = np.clip(estimate.confidence, 0.0, 1.0)
    lit = field.lit(*middle)
    if lit is None:
        return Depth(estimate.inverse, confidence, *middle)
    confidence = np.where(lit & _is_witnessed(field, others), confidence, 0.0)
    return Depth(continued(estimate.inverse, lit), confidence, *middle, lit)


def _is_witnessed(field: LightField, others: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """Find the pixels at which enough of some views have light to tell a depth by: bool (height, width)."""
    seen = np.zeros((field.views.height, field.views.width), dtype=np.int64)
    for other in others:
        lit = field.lit(*other)
        seen += 1 if lit is None else lit
    return seen >= _WITNESSES


class _Counter:
    """Adds up the work of several stages, for `update`."""

    def __init__(self, update: Update | None) -> None:
        self._update = update
        self._done = self._wanted = 0

    def expect(self, more: int) -> None:
        self._wanted += more

    def step(self) -> None:
        self._done += 1
        if self._update is not None:
            self._update(self._done, self._wanted)


def reference(views: Views, row: int | None, column: int | None) -> tuple[int, int]:
    """Row and column of a view, the middle by default.

    Raises
    ------
    InputError : there is none.
    """
    middle = views.nearest()
    found = middle[0] if row is None else row, middle[1] if column is None else column
    if not (0 <= found[0] < views.rows and 0 <= found[1] < views.columns):
        raise InputError(
            f"no view {found[0]},{found[1]}: the light field has {views.rows} rows of {views.columns}, counted from 0"
        )
    return found


def _offsets(views: Views, reference: tuple[int, int]) -> NDArray[np.float64]:
    """Places of the views as seen from one of them (m), (rows, columns, 2)."""
    return np.asarray(views.position - views.position[reference])


def _spacing(views: Views) -> float:
    """Middle distance of a view to its nearest neighbour (m)."""
    from scipy import spatial

    places = views.position[within_lens(views)]
    away, _ = spatial.KDTree(places).query(places, k=2)
    return float(np.median(away[:, 1]))


def _thinned(views: Views, reference: tuple[int, int]) -> list[tuple[int, int]]:
    """Views to compare with one of them: at most so many, evenly spread over all."""
    side = math.isqrt(_MOST_VIEWS)
    rows = min(views.rows, max(side, _MOST_VIEWS // views.columns))
    columns = min(views.columns, max(side, _MOST_VIEWS // views.rows))
    chosen_rows = {round(place) for place in np.linspace(0, views.rows - 1, rows)}
    chosen_columns = {round(place) for place in np.linspace(0, views.columns - 1, columns)}
    grid = within_lens(views)
    return [
        (row, column)
        for row in sorted(chosen_rows)
        for column in sorted(chosen_columns)
        if grid[row, column] and (row, column) != reference
    ]


# ---- where there is anything ----


def _bounds(
    field: LightField,
    reference: tuple[int, int],
    others: Sequence[tuple[int, int]],
    near: float | None,
    far: float | None,
    pool: ThreadPoolExecutor,
    counter: _Counter,
) -> tuple[float, float]:
    """Least and greatest 1 / distance at which there is anything."""
    for name, distance in (("near", near), ("far", far)):
        if distance is not None and not distance > 0.0:
            raise InputError(f"{name} must be a distance greater than 0, got {distance:g}")
    if near is not None and far is not None:
        if not near < far:
            raise InputError(f"near must be less than far, got {near:g} and {far:g}")
        return 1.0 / far, 1.0 / near

    # Nothing is beyond infinity, where distances are known at all.
    views = field.views
    scale = views.plane.pixel / _spacing(views)
    low = views.inverse_focus - _COARSE_REACH * scale
    high = views.inverse_focus + _COARSE_REACH * scale
    low = 1.0 / far if far is not None else max(0.0, low) if field.is_metric else low
    high = 1.0 / near if near is not None else high
    if not low < high:
        raise InputError("near and far leave no distance at which views can be told from each other")

    # Neighbours alone tell roughly, and cannot be mistaken for each other's places in a pattern that repeats.
    away = np.array([np.hypot(*_offsets(views, reference)[other]) for other in others])
    order = np.argsort(away, kind="stable")[: (_HALVES + 4)]
    neighbours = [others[number] for number in order]
    count = max(3, math.ceil((high - low) / (_COARSE_STEP * scale)) + 1)
    planes = np.linspace(low, high, count)
    coarse = _from_focus(field, reference, neighbours, planes, pool, counter)
    lit = field.lit(*reference)
    known = np.ones(coarse.confidence.shape, dtype=bool) if lit is None else lit
    sure = coarse.inverse[known & (coarse.confidence >= np.median(coarse.confidence[known]))]
    step = planes[1] - planes[0]
    least, most = np.quantile(sure, [_TAILS, 1.0 - _TAILS])
    return max(low, least - step), min(high, most + step)


def _planes(
    views: Views, reference: tuple[int, int], others: Sequence[tuple[int, int]], bounds: tuple[float, float]
) -> NDArray[np.float64]:
    """1 / distance of planes, evenly, such that no view moves by more than a step from one to the next."""
    offsets = _offsets(views, reference)
    farthest = max(float(np.hypot(*offsets[other])) for other in others)
    moved = (bounds[1] - bounds[0]) * farthest / views.plane.pixel
    return np.linspace(*bounds, min(_MOST_PLANES, max(3, math.ceil(moved / _STEP) + 1)))


# ---- from focus ----


class _Guided:
    """The guided filter with one picture as its guide: averages along what looks alike there."""

    def __init__(self, guide: _Picture) -> None:
        self._guide = guide
        self._mean = self._box(guide)
        self._variance = np.maximum(self._box(guide * guide) - self._mean**2, 0.0)
        # Some variance, however flat the picture is.
        self._likeness = max(_LIKENESS * float(guide.var()), np.finfo(np.float64).tiny)

    def __call__(self, picture: _Picture) -> _Picture:
        mean = self._box(picture)
        slope = (self._box(self._guide * picture) - self._mean * mean) / (self._variance + self._likeness)
        return np.asarray(self._box(slope) * self._guide + self._box(mean - slope * self._mean))

    def _box(self, picture: _Picture) -> _Picture:
        from scipy import ndimage

        return np.asarray(ndimage.uniform_filter(picture, 2 * _RADIUS + 1, mode="nearest"))


def _from_focus(
    field: LightField,
    reference: tuple[int, int],
    others: Sequence[tuple[int, int]],
    planes: NDArray[np.float64],
    pool: ThreadPoolExecutor,
    counter: _Counter,
) -> _Estimate:
    """The plane at which views agree best, pixel by pixel, and between planes by a parabola."""
    middle = tone(lit_view(field, *reference)[0])
    height, width = middle.shape[:2]
    guided = _Guided(middle.mean(axis=-1))
    tolerance = max(_INLIER * float(middle.var(axis=(0, 1)).mean()), np.finfo(np.float64).tiny)

    block = max(1, min(len(planes), _BUDGET // (_HALVES * height * width * 10)))
    counter.expect(len(others) * math.ceil(len(planes) / block))
    best = _Best((height, width))
    for first in range(0, len(planes), block):
        some = planes[first : first + block]
        cost = np.zeros((len(some), _HALVES, height, width))
        seen = np.zeros((len(some), _HALVES, height, width), dtype=np.uint16)
        for other in others:
            _compare(field, middle, reference, other, some, cost, seen, tolerance, pool)
            counter.step()

        def agreed(number: int, cost: _Picture = cost, seen: NDArray[np.uint16] = seen) -> _Picture:
            # What no view sees is as good as any other plane.
            whole = guided(_mean(cost[number].sum(axis=0), seen[number].sum(axis=0)))
            for half in range(_HALVES):
                np.minimum(whole, guided(_mean(cost[number, half], seen[number, half])), out=whole)
            return whole

        for found in pool.map(agreed, range(len(some))):
            best.add(found)
    number, confidence = best.result()
    return _Estimate(planes[0] + number * (planes[1] - planes[0]), confidence)


def _mean(total: _Picture, count: NDArray[np.integer]) -> _Picture:
    """The mean difference of what was compared, and the greatest that there is where nothing was."""
    return np.where(count > 0, total / np.maximum(count, 1), 1.0)


def _compare(
    field: LightField,
    middle: _Picture,
    reference: tuple[int, int],
    other: tuple[int, int],
    planes: NDArray[np.float64],
    cost: _Picture,
    seen: NDArray[np.uint16],
    tolerance: float,
    pool: ThreadPoolExecutor,
) -> None:
    """Add how far a view differs from the middle one, for all planes, to the halves that the view is in."""
    views = field.views
    offset = _offsets(views, reference)[other]
    # Places that are the same but for rounding are in both halves.
    exact = float(np.finfo(np.float32).eps) * _spacing(views)
    halves = [
        half
        for half, is_in in enumerate((offset[0] <= exact, offset[0] >= -exact, offset[1] <= exact, offset[1] >= -exact))
        if is_in
    ]
    view, lit = lit_view(field, *other)
    spline = Spline(tone(view))

    def one(number: int) -> None:
        right, down = offset * ((views.inverse_focus - planes[number]) / views.plane.pixel) * (1.0, -1.0)
        moved, part = spline.moved(float(right), float(down))
        difference = ((moved[part] - middle[part]) ** 2).mean(axis=-1)
        # Geman and McClure's: from squares for small differences to 1 for large ones.
        difference /= difference + tolerance
        counted: int | NDArray[np.bool_] = 1
        if lit is not None:
            rows, columns = (np.arange(along.start, along.stop) for along in part)
            counted = at_nearest(lit, (rows + down)[:, None], (columns + right)[None, :])
            difference *= counted
        for half in halves:
            cost[number, half][part] += difference
            seen[number, half][part] += counted

    list(pool.map(one, range(len(planes))))


class _Best:
    """The least of values that come one after the other, with its neighbours, and their mean; pixel by pixel."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._count = 0
        self._sum = np.zeros(shape)
        self._number = np.zeros(shape, dtype=np.int64)
        self._least, self._before, self._after = (np.full(shape, np.inf) for _ in range(3))
        self._last = np.full(shape, np.inf)

    def add(self, values: _Picture) -> None:
        is_next = self._number == self._count - 1
        self._after = np.where(is_next, values, self._after)
        is_better = values < self._least
        self._before = np.where(is_better, self._last, self._before)
        self._least = np.where(is_better, values, self._least)
        self._number = np.where(is_better, self._count, self._number)
        self._after = np.where(is_better, np.inf, self._after)
        self._last = values
        self._sum += values
        self._count += 1

    def result(self) -> tuple[_Picture, _Picture]:
        """Number of the least one, and between them by a parabola; and how far below the mean it is, in 0..1."""
        has_both = np.isfinite(self._before) & np.isfinite(self._after)
        before = np.where(has_both, self._before, self._least)
        after = np.where(has_both, self._after, self._least)
        curvature = before - 2.0 * self._least + after
        is_curved = curvature > 0.0
        between = np.where(is_curved, 0.5 * (before - after) / np.where(is_curved, curvature, 1.0), 0.0)
        mean = self._sum / self._count
        confidence = np.where(mean > 0.0, 1.0 - self._least / np.where(mean > 0.0, mean, 1.0), 0.0)
        return self._number + np.clip(between, -0.5, 0.5), confidence


# ---- from slopes ----


def _from_slopes(
    field: LightField,
    reference: tuple[int, int],
    bounds: tuple[float, float],
    pool: ThreadPoolExecutor,
    counter: _Counter,
) -> _Estimate:
    """The directions of lines in the epipolar slices through a view, horizontal and vertical."""
    lines = [line for line in _lines(field.views, reference) if len(line) >= _FEWEST_IN_LINE]
    if not lines:
        raise InputError("slopes need at least three views in a row or a column: use the method focus")
    shape = (field.views.height, field.views.width)
    total, weight, confidence = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for line in lines:
        inverse, coherence, energy = _along_line(field, reference, line, bounds, pool, counter)
        # The direction across which there is more texture tells more.
        told = coherence * energy
        total += told * inverse
        weight += told
        confidence = np.maximum(confidence, coherence)
    inverse = np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), field.views.inverse_focus)
    return _Estimate(inverse, np.where(weight > 0.0, confidence, 0.0))


def _lines(views: Views, reference: tuple[int, int]) -> Iterator[list[tuple[int, int]]]:
    """The lit views of the row and of the column of one of them, from left to right and from top to bottom."""
    grid = within_lens(views)
    row, column = reference
    in_row = [(row, other) for other in range(views.columns) if grid[row, other]]
    in_column = [(other, column) for other in range(views.rows) if grid[other, column]]
    yield sorted(in_row, key=lambda index: float(views.position[index][0]))
    yield sorted(in_column, key=lambda index: -float(views.position[index][1]))


def _along_line(
    field: LightField,
    reference: tuple[int, int],
    line: list[tuple[int, int]],
    bounds: tuple[float, float],
    pool: ThreadPoolExecutor,
    counter: _Counter,
) -> tuple[_Picture, _Picture, _Picture]:
    """1 / distance, coherence and energy of the gradients along the line, pixel by pixel."""
    views = field.views
    offsets = np.array([_offsets(views, reference)[index] for index in line])
    is_row = bool(np.ptp(offsets[:, 0]) >= np.ptp(offsets[:, 1]))
    places = offsets[:, 0] if is_row else -offsets[:, 1]
    # Views at one place would make derivatives of nothing.
    keep = np.concatenate([[True], np.diff(places) > 0.0])
    line = [index for index, kept in zip(line, keep, strict=True) if kept]
    offsets, places = offsets[keep], places[keep]
    spacing = float(places[-1] - places[0]) / (len(places) - 1)

    # Shears, around each of which slopes are small.
    scale = views.plane.pixel / spacing
    count = max(1, math.ceil((bounds[1] - bounds[0]) / (_SHEAR * scale)))
    shears = bounds[0] + (np.arange(count) + 0.5) * ((bounds[1] - bounds[0]) / count)
    counter.expect(count)
    splines = list(pool.map(lambda index: Spline(tone(lit_view(field, *index)[0]).mean(axis=-1)), line))
    at = int(np.abs(places).argmin())

    def one(shear: float) -> tuple[_Picture, _Picture, _Picture]:
        shifts = offsets * ((views.inverse_focus - shear) / views.plane.pixel) * (1.0, -1.0)
        volume = np.stack(
            [spline.moved(float(s[0]), float(s[1]))[0] for spline, s in zip(splines, shifts, strict=True)]
        )
        slope, coherence, energy = _tensor(volume, places / spacing, at, 2 if is_row else 1)
        coherence = np.where(np.abs(slope) <= _STEEPEST, coherence, 0.0)
        return shear - slope * scale, coherence, energy

    best: tuple[_Picture, _Picture, _Picture] | None = None
    for shear in shears:
        found = one(float(shear))
        counter.step()
        if best is None:
            best = found
            continue
        is_better = found[1] > best[1]
        best = tuple(np.where(is_better, new, old) for new, old in zip(found, best, strict=True))  # type: ignore[assignment]
    assert best is not None
    near = np.abs(places / spacing) <= _NEAR
    lit = _lit_in_line(field, [index for index, is_near in zip(line, near, strict=True) if is_near])
    return best if lit is None else (best[0], np.where(lit, best[1], 0.0), best[2])


def _lit_in_line(field: LightField, line: Sequence[tuple[int, int]]) -> _Picture | None:
    """Find the pixels at which all of some views have light, as has all that the tensor averages; None for all."""
    from scipy import ndimage

    masks = [lit for index in line if (lit := field.lit(*index)) is not None]
    if not masks:
        return None
    reach = 2 * math.ceil(_TENSOR) + 1
    return np.asarray(ndimage.minimum_filter(np.logical_and.reduce(masks), reach, mode="nearest"))


def _tensor(
    volume: NDArray[np.float64], places: NDArray[np.float64], at: int, axis: int
) -> tuple[_Picture, _Picture, _Picture]:
    """The structure tensor of slices (views, height, width), for one view: slope (pixels a view), confidence, energy.

    Wanner & Goldluecke 2014, sec. 3; but by least squares along the views, where the noise is: the tensor's own
    direction takes it to be the same along both axes.
    """
    from scipy import ndimage

    # Exact derivatives of smoothed views, and differences from view to view, which move by a fraction of a pixel.
    sigma = [0.0, _SMOOTHED, _SMOOTHED]
    orders = [int(axis == other) for other in range(3)]
    smooth = ndimage.gaussian_filter(volume, sigma, mode="nearest")
    along = ndimage.gaussian_filter(volume, sigma, order=orders, mode="nearest")
    across = np.gradient(smooth, places, axis=0)
    weights = np.exp(-0.5 * ((places - places[at]) / _TENSOR) ** 2)
    weights /= weights.sum()

    def averaged(first: NDArray[np.float64], second: NDArray[np.float64]) -> _Picture:
        return np.asarray(
            ndimage.gaussian_filter(np.einsum("v,vyx,vyx->yx", weights, first, second), _TENSOR, mode="nearest")
        )

    xx, xu, uu = averaged(along, along), averaged(along, across), averaged(across, across)
    # Least squares, and what they leave: noise, and what is no line.
    has_any = xx > 0.0
    safe = np.where(has_any, xx, 1.0)
    slope = np.where(has_any, -xu / safe, 0.0)
    left = np.maximum(uu - xu * xu / safe, 0.0)
    confidence = np.where(has_any, xx / np.where(has_any, xx + left / _SURE_SLOPE**2, 1.0), 0.0)
    # Beside an edge it is the edge that the average knows of, and not what is there.
    own = ndimage.gaussian_filter(along[at] ** 2, _OWN, mode="nearest")
    confidence *= np.where(has_any, own / np.where(has_any, own + _BESIDE * xx, 1.0), 0.0)
    return slope, confidence, xx


def _together(focus: _Estimate, slopes: _Estimate, *, agreeing: float) -> _Estimate:
    """Where both agree, their mean by confidence, slopes by half of it; else that of focus, half as sure.

    Focus knows of what hides what, and slopes do not, so that they are another witness for it.
    """
    agree = np.abs(focus.inverse - slopes.inverse) <= agreeing
    theirs = _WITNESS * slopes.confidence
    weight = focus.confidence + theirs
    safe = np.where(weight > 0.0, weight, 1.0)
    mean = (focus.confidence * focus.inverse + theirs * slopes.inverse) / safe
    return _Estimate(
        np.where(agree & (weight > 0.0), mean, focus.inverse),
        np.where(agree, 1.0, _DOUBT) * focus.confidence,
    )
