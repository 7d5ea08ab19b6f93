"""Super-resolution: a view with more pixels than the light field's, from all views.

Views sample a point at places that differ by parts of a pixel, so that together they resolve more than each.  Of all
pictures with smaller pixels, the one is computed whose mean over each view's pixel, at the place where its depth puts
it, is nearest to that pixel: least squares, by conjugate gradients.  The normal equations take nine numbers a pixel, so
that views are read once, one at a time.

A pixel is taken to be the mean over its square, as the film's box filter makes it.  Where pixels were interpolated
between microlenses, as of hexagons, the microlenses' own samples are used, each at its place: interpolated values hold
no more, and were not measured at their place.

The weight of the interpolated middle view beside the views depends on their noise, which detail finer than a pixel
amplifies: it is chosen such that the pictures of two halves of the views agree best (cross-validation).

References: Irani, Peleg 1991, "Improving Resolution by Image Registration"; Elad, Feuer 1997, "Restoration of a Single
    Superresolution Image from Several Blurred, Noisy, and Undersampled Measured Images"; Bishop, Favaro 2012, "The
    Light Field Camera: Extended Depth of Field, Aliasing, and Superresolution"; Stone 1974, "Cross-Validatory Choice
    and Assessment of Statistical Predictions".
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import lit_view, within_lens
from raytracer.lightfield.depth.depth_map import Depth, depth_map
from raytracer.lightfield.kernels.super_resolution import add_samples, find_places, multiply, reject_samples, spread
from raytracer.lightfield.memory import MORE_MEMORY, require_memory
from raytracer.lightfield.splines import Spline, sqrt_tone
from raytracer.util.errors import InputError
from raytracer.util.progress import Update, report_progress

FloatArray = NDArray[np.float64]

_MOST_FACTOR = 4

_PRIORS = tuple(0.02 * 2.0**step for step in range(7))
"""Candidate weights of the interpolated view, as shares of the mean number of views' pixels on one: it decides what no
view determines, and counts for little elsewhere.  For 9 x 9 views of 80 x 64 pixels, with four times as many a
side, 0.02 is best without noise, and 0.3 with 15 % of it; with less the depth's own errors come through in any case."""

_ITERATIONS, _TOLERANCE = 40, 1e-4
"""Most iterations of conjugate gradients, and the residual, as a share of the right side, at which they end: less than
eight bits resolve."""

_NEIGHBOURS = 5
"""Products of neighbours' weights: with itself, the one to the right, and three below; they are symmetric."""

_EQUATION_BYTES, _SOLVER_BYTES = 250, 72
"""Bytes a pixel of the picture: of the equations of both halves, and of each thread that solves them."""

_MOST_PIECES = 16
"""Most pieces of a view's samples, and bands of the picture, that threads share."""

_SIGMAS = 3.0
"""Standard deviations of the noise: values farther outside the range around a pixel in the middle view are of another
point."""

_NORMAL = 1.4826
"""Ratio of the standard deviation of a normal distribution to the median of its magnitudes."""


def supersampled(
    field: LightField,
    factor: int = 2,
    depth: Depth | None = None,
    *,
    threads: int | None = None,
    update: Update | None = None,
) -> FloatArray:
    """Compute one view with `factor` times as many pixels along each side: float64 (factor height, factor width, 3).

    Parameters
    ----------
    factor : 2, 3 or 4.
    depth : of the view; default: estimated first, by `depth_map`.
    threads : that share the work; default: all.
    update : called with the work that is done, and with all of it.

    Raises
    ------
    InputError : as `depth_map`; another factor; or it takes more memory than `memory.memory_limit` gives.
    """
    if not 2 <= factor <= _MOST_FACTOR:
        raise InputError(f"views can have 2 to {_MOST_FACTOR} times as many pixels along a side, got {factor}")
    count = threads or os.cpu_count() or 1
    pixels = factor**2 * field.views.width * field.views.height
    size = pixels * (_EQUATION_BYTES + _SOLVER_BYTES * min(count, len(_PRIORS)))
    require_memory(size, f"super-resolution {factor} times as fine", f"a smaller --scale takes less, or {MORE_MEMORY}")
    with ThreadPoolExecutor(count) as pool:
        if depth is None:
            depth = depth_map(field, threads=threads, update=update)
        middle, lit = lit_view(field, depth.row, depth.column)
        halves = _add_views(field, depth, _value_bounds(middle, lit), factor, pool, update)
        start = upsample_cubic(middle, factor)
        prior = _best_prior(halves[0], halves[1], start, pool)
        both = halves[0]
        both.absorb(halves.pop())
        picture = both.solve(start, prior, pool)
    if lit is not None:
        # Neither the middle view nor any other has seen the rest.
        picture[~(both.known() | np.kron(lit, np.ones((factor, factor), dtype=bool)))] = 0.0
    return picture


def _add_views(
    field: LightField,
    depth: Depth,
    bounds: FloatArray,
    factor: int,
    pool: ThreadPoolExecutor,
    update: Update | None,
) -> "list[_NormalEquations]":
    """Add the samples of all views to the normal equations of two halves of the views."""
    views = field.views
    halves = [_NormalEquations(views.height, views.width, factor) for _ in range(2)]
    indices = np.argwhere(within_lens(views)).tolist()
    # The next view is read meanwhile.
    ahead = pool.submit(_read_samples, field, *indices[0])
    for number, (row, column) in enumerate(report_progress(indices, update)):
        samples = ahead.result()
        if number + 1 < len(indices):
            ahead = pool.submit(_read_samples, field, *indices[number + 1])
        offset = views.position[row, column] - views.position[depth.row, depth.column]
        places = _find_places(depth, views, offset, samples, bounds, pool)
        # Neighbours are in different halves; the middle view is in that which is solved for.
        half = halves[(row + column - depth.row - depth.column) % 2]
        half.add(samples.value, places, samples.is_own, pool)
    return halves


def _find_places(
    depth: Depth,
    views: Views,
    offset: NDArray[np.float64],
    samples: "_Samples",
    bounds: FloatArray,
    pool: ThreadPoolExecutor,
) -> FloatArray:
    """Find the places (2, n) in the depth's own view of a view's samples, `offset` (m) away; reject those hidden."""
    right, up = (offset / views.plane.pixel).tolist()
    away = right, up, views.inverse_focus
    places = np.empty((2, len(samples.row)))

    def find(begin: int, end: int) -> None:
        find_places(depth.inverse, away, samples.row, samples.column, begin, end, places)
        reject_samples(places, samples.value, bounds, begin, end, samples.is_own)

    _share(pool, find, len(samples.row))
    return places


def _share(pool: ThreadPoolExecutor, work: Callable[[int, int], object], count: int) -> None:
    """Share work on 0 ... count - 1 among threads, which get the first number of a piece and that after its last."""
    edges = [count * piece // _MOST_PIECES for piece in range(_MOST_PIECES + 1)]
    list(pool.map(work, edges[:-1], edges[1:]))


class _Samples(NamedTuple):
    """Samples of a view: those of its microlenses where they are known, or else its pixels.

    value : linear, float64 (n, 3).
    row, column (px) : of their places in the view, float64 (n,).
    is_own : False for samples that are not of what the middle view sees, bool (n,).
    """

    value: FloatArray
    row: FloatArray
    column: FloatArray
    is_own: NDArray[np.bool_]


def _read_samples(field: LightField, row: int, column: int) -> _Samples:
    """Read the samples of a view, of which those are marked that are lit."""
    if field.samples is not None:
        values = np.asarray(field.samples.value[row, column], dtype=np.float64)
        columns, rows = np.ascontiguousarray(field.samples.place.T)
        is_lit = np.asarray(np.isfinite(values).all(axis=-1))
        return _Samples(np.where(is_lit[:, None], values, 0.0), rows, columns, is_lit)
    view, lit = field.view(row, column), field.lit(row, column)
    rows, columns = (grid.astype(np.float64).ravel() for grid in np.indices(view.shape[:2]))
    is_lit = np.ones(rows.shape, dtype=bool) if lit is None else lit.ravel()
    return _Samples(view.reshape(-1, 3), rows, columns, is_lit)


def upsample_cubic(view: FloatArray, factor: int) -> FloatArray:
    """Upsample a view by cubic interpolation alone: float64 (factor height, factor width, 3)."""
    rows, columns = ((np.arange(factor * size) + 0.5) / factor - 0.5 for size in view.shape[:2])
    return Spline(view).at(*np.broadcast_arrays(rows[:, None], columns[None, :]))[0]


def _value_bounds(middle: FloatArray, lit: NDArray[np.bool_] | None) -> FloatArray:
    """Bound the values that a pixel's own point may have, by the range of the pixels around it, and noise.

    middle : the reference view, linear (height, width, 3).
    lit : mask of its lit pixels, bool (height, width); None for all.  Others have no bounds.

    Returns the least and the greatest square roots, (2, height, width, 3).
    """
    from scipy import ndimage

    values = sqrt_tone(middle)
    noise = _SIGMAS * _noise(values)
    low = ndimage.minimum_filter(values, (3, 3, 1), mode="nearest") - noise
    high = ndimage.maximum_filter(values, (3, 3, 1), mode="nearest") + noise
    if lit is not None:
        low[~lit], high[~lit] = -np.inf, np.inf
    return np.stack([low, high])


def _noise(values: FloatArray) -> float:
    """Estimate the standard deviation of noise from second differences, which smooth changes do not affect.

    Immerkaer 1996, "Fast Noise Variance Estimation", with the median in place of the mean.
    """
    from scipy import ndimage

    mask = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])
    differences = ndimage.convolve(values, mask[..., None], mode="mirror")
    return float(_NORMAL * np.median(np.abs(differences)) / np.sqrt((mask**2).sum()))


def _best_prior(
    half: "_NormalEquations", other: "_NormalEquations", start: FloatArray, pool: ThreadPoolExecutor
) -> float:
    """Choose the weight of the interpolated view with which two halves of the views agree best on the picture.

    The noise of the halves is independent, so that the squared distance of one half's picture from the least smoothed
    one of the other is that from the truth, plus the error of the latter, which is the same for all weights.
    Prediction of the other half's pixels would not do: they hold next to no detail finer than they are.
    """
    weight = half.weight + other.weight
    if half.weight == 0.0 or other.weight == 0.0:
        return _PRIORS[0] * weight
    grey = start.mean(axis=-1)
    reference = pool.submit(other.solve_channel, other.sums.mean(axis=0), grey, _PRIORS[0] * weight)
    sums = half.sums.mean(axis=0)
    pictures = pool.map(lambda share: half.solve_channel(sums, grey, share * weight), _PRIORS)
    errors = [float(((picture - reference.result()) ** 2).mean()) for picture in pictures]
    return _PRIORS[int(np.argmin(errors))] * weight


class _NormalEquations:
    """Normal equations of views' pixels, each the mean over a square of a picture that is linear between its pixels.

    Attributes
    ----------
    sums : of weighted values, (3, rows, columns): of all means over `factor` by `factor` pixels, one for each pixel
        that a square can begin at.
    """

    def __init__(self, height: int, width: int, factor: int) -> None:
        self._factor, self._size = factor, (height, width)
        shape = factor * (height - 1) + 1, factor * (width - 1) + 1
        self._products = np.zeros((_NEIGHBOURS, *shape))
        self.sums = np.zeros((3, *shape))

    def add(self, values: FloatArray, places: FloatArray, is_own: NDArray[np.bool_], pool: ThreadPoolExecutor) -> None:
        """Add the samples of a view, with their places (2, n) in pixels of the view that is computed."""

        # A band of the picture is with one thread, so that sums do not depend on the order of threads.
        def add(first: int, last: int) -> None:
            add_samples(values, places, is_own, self._factor, first, last, self._products, self.sums)

        _share(pool, add, self.sums.shape[1])

    def absorb(self, other: "_NormalEquations") -> None:
        """Add the equations of other views."""
        self._products += other._products
        self.sums += other.sums

    @property
    def weight(self) -> float:
        """Mean number of views' pixels on one of the picture."""
        return float(self._products[0].mean())

    def known(self) -> NDArray[np.bool_]:
        """Find the pixels of the picture that any sample lies on."""
        known = np.zeros(tuple(self._factor * size for size in self._size))
        spread(self._products[0], self._factor, 0.0, known, known)
        return known > 0.0

    def solve(self, start: FloatArray, prior: float, pool: ThreadPoolExecutor) -> FloatArray:
        """Solve for the picture (height, width, 3) that explains the pixels best.

        start : picture that is kept where no view has samples.
        prior : weight of its pixels beside that of a sample.
        """
        channels = np.moveaxis(start, -1, 0)
        pictures = pool.map(lambda sums, plain: self.solve_channel(sums, plain, prior), self.sums, channels)
        return np.stack(list(pictures), axis=-1)

    def solve_channel(self, sums: FloatArray, start: FloatArray, prior: float) -> FloatArray:
        """Solve for one channel (height, width), of which the `sums` are given."""
        from scipy.sparse.linalg import LinearOperator, cg

        plain = np.ascontiguousarray(start)
        means, weighted = np.empty_like(sums), np.empty_like(sums)

        def matrix(values: NDArray[np.float64]) -> NDArray[np.float64]:
            result = np.empty_like(plain)
            multiply(self._products, self._factor, prior, values.reshape(plain.shape), means, weighted, result)
            return result.ravel()

        right = np.empty_like(plain)
        spread(sums, self._factor, prior, plain, right)
        operator = LinearOperator((plain.size,) * 2, matvec=matrix, dtype=np.float64)
        solution, _ = cg(operator, right.ravel(), x0=plain.ravel(), rtol=_TOLERANCE, maxiter=_ITERATIONS)
        return np.asarray(solution.reshape(plain.shape))


_FACTOR = 2
"""Pixels along the side of one, by which detail finer than a pixel is told from its aliases in each view."""


def all_in_focus(
    field: LightField, depth: Depth | None = None, *, threads: int | None = None, update: Update | None = None
) -> FloatArray:
    """Render the scene as one view sees it, sharp at all distances, float64 (height, width, 3).

    The picture of `supersampled` with two pixels a side, averaged to one: the mean over a pixel's square of what all
    views know of it.  Their plain mean would be blurred by interpolating each between its own pixels.  So it is sharp
    as through a pinhole, with the light, and the lower noise, of the whole aperture (Isaksen, McMillan, Gortler 2000,
    sec. 3, a focal surface in place of a plane); views in which something hides a point are left out.

    The parameters are those of `supersampled`.

    Raises
    ------
    InputError : as `depth_map`.
    """
    fine = supersampled(field, _FACTOR, depth, threads=threads, update=update)
    height, width = field.views.height, field.views.width
    return np.asarray(fine.reshape(height, _FACTOR, width, _FACTOR, 3).mean(axis=(1, 3)))
