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

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import lit_at_nearest, lit_view, within_lens
from raytracer.lightfield.depth.depth_map import Depth, depth_map
from raytracer.lightfield.splines import Spline, sqrt_tone
from raytracer.lightfield.views.synthesis import pixel_shifts
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

_STEPS = 4
"""Steps of the search for a pixel's place, each of which divides its error by the depth's slope."""

_NEIGHBOURS = ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))
"""Rows down and columns right of neighbours: one of each two opposite directions, since products are symmetric."""

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
    threads : that estimate the depth; default: all.
    update : called with the work that is done, and with all of it.

    Raises
    ------
    InputError : as `depth_map`, or another factor.
    """
    if not 2 <= factor <= _MOST_FACTOR:
        raise InputError(f"views can have 2 to {_MOST_FACTOR} times as many pixels along a side, got {factor}")
    if depth is None:
        depth = depth_map(field, threads=threads, update=update)
    views = field.views
    middle, lit = lit_view(field, depth.row, depth.column)
    bounds = _ValueBounds(middle, lit)
    halves = [_NormalEquations(views.height, views.width, factor) for _ in range(2)]
    indices = np.argwhere(within_lens(views)).tolist()
    for row, column in report_progress(indices, update):
        offset = views.position[row, column] - views.position[depth.row, depth.column]
        values, rows, columns, is_lit = _read_samples(field, row, column)
        places = _to_depth_view(depth, views, offset, rows, columns)
        # Neighbours are in different halves; the middle view is in that which is solved for.
        half = halves[(row + column - depth.row - depth.column) % 2]
        half.add(values, *places, is_lit & bounds.contain(values, *places))
    start = upsample_cubic(middle, factor)
    prior = _best_prior(halves[0], halves[1], start)
    both = halves[0].combined(halves[1])
    picture = both.solve(start, prior)
    if lit is not None:
        # Neither the middle view nor any other has seen the rest.
        picture[~(both.known() | np.kron(lit, np.ones((factor, factor), dtype=bool)))] = 0.0
    return picture


def _read_samples(
    field: LightField, row: int, column: int
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Read the samples of a view: those of its microlenses where they are known, or else its pixels.

    Values (n, 3), rows and columns of their places in the view (px, n), and which are lit (n).
    """
    if field.samples is not None:
        values = np.asarray(field.samples.value[row, column], dtype=np.float64)
        columns, rows = field.samples.place.T
        is_lit = np.asarray(np.isfinite(values).all(axis=-1))
        return np.where(is_lit[:, None], values, 0.0), rows, columns, is_lit
    view, lit = field.view(row, column), field.lit(row, column)
    rows, columns = (grid.astype(np.float64).ravel() for grid in np.indices(view.shape[:2]))
    is_lit = np.ones(rows.shape, dtype=bool) if lit is None else lit.ravel()
    return view.reshape(-1, 3), rows, columns, is_lit


def upsample_cubic(view: FloatArray, factor: int) -> FloatArray:
    """Upsample a view by cubic interpolation alone: float64 (factor height, factor width, 3)."""
    rows, columns = ((np.arange(factor * size) + 0.5) / factor - 0.5 for size in view.shape[:2])
    return Spline(view).at(*np.broadcast_arrays(rows[:, None], columns[None, :]))[0]


def _to_depth_view(
    depth: Depth, views: Views, offset: NDArray[np.float64], rows: FloatArray, columns: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Find the places in the depth's own view of what a view `offset` (m) away sees: rows and columns."""
    from scipy import ndimage

    at_row, at_column = rows, columns
    for _ in range(_STEPS):
        inverse = ndimage.map_coordinates(depth.inverse, np.stack([at_row, at_column]), order=1, mode="nearest")
        right, down = pixel_shifts(views, offset, inverse)
        at_row, at_column = rows - down, columns - right
    return at_row, at_column


class _ValueBounds:
    """Bounds of the values that a pixel's own point may have: the range of the pixels around it, and noise.

    middle : the reference view, linear (height, width, 3).
    lit : mask of its lit pixels, bool (height, width); None for all.  Others have no bounds.
    """

    def __init__(self, middle: FloatArray, lit: NDArray[np.bool_] | None) -> None:
        from scipy import ndimage

        values = sqrt_tone(middle)
        noise = _SIGMAS * _noise(values)
        self._low = ndimage.minimum_filter(values, (3, 3, 1), mode="nearest") - noise
        self._high = ndimage.maximum_filter(values, (3, 3, 1), mode="nearest") + noise
        self._lit = lit

    def contain(self, values: FloatArray, rows: FloatArray, columns: FloatArray) -> NDArray[np.bool_]:
        """Test linear values (n, 3) against the bounds of the pixels at places (n,), in all channels: bool (n,)."""
        height, width = self._low.shape[:2]
        row = np.clip(np.rint(rows), 0, height - 1).astype(np.int64)
        column = np.clip(np.rint(columns), 0, width - 1).astype(np.int64)
        low, high = self._low[row, column], self._high[row, column]
        shown = sqrt_tone(values)
        is_within = ((shown >= low) & (shown <= high)).all(axis=-1)
        return np.asarray(is_within if self._lit is None else is_within | ~lit_at_nearest(self._lit, rows, columns))


def _noise(values: FloatArray) -> float:
    """Estimate the standard deviation of noise from second differences, which smooth changes do not affect.

    Immerkaer 1996, "Fast Noise Variance Estimation", with the median in place of the mean.
    """
    from scipy import ndimage

    mask = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])
    differences = ndimage.convolve(values, mask[..., None], mode="mirror")
    return float(_NORMAL * np.median(np.abs(differences)) / np.sqrt((mask**2).sum()))


def _best_prior(half: "_NormalEquations", other: "_NormalEquations", start: FloatArray) -> float:
    """Choose the weight of the interpolated view with which two halves of the views agree best on the picture.

    The noise of the halves is independent, so that the squared distance of one half's picture from the least smoothed
    one of the other is that from the truth, plus the error of the latter, which is the same for all weights.
    Prediction of the other half's pixels would not do: they hold next to no detail finer than they are.
    """
    weight = half.weight + other.weight
    if half.weight == 0.0 or other.weight == 0.0:
        return _PRIORS[0] * weight
    grey = start.mean(axis=-1, keepdims=True)
    half, reference = half.grey(), other.grey().solve(grey, _PRIORS[0] * weight)
    errors = [float(((half.solve(grey, share * weight) - reference) ** 2).mean()) for share in _PRIORS]
    return _PRIORS[int(np.argmin(errors))] * weight


class _NormalEquations:
    """Normal equations of views' pixels, each the mean over a square of a picture that is linear between its pixels."""

    def __init__(self, height: int, width: int, factor: int) -> None:
        self._factor = factor
        self._size = height, width
        # Of all means over `factor` by `factor` pixels: one for each pixel that a square can begin at.
        self._shape = factor * (height - 1) + 1, factor * (width - 1) + 1
        count = self._shape[0] * self._shape[1]
        self._products = {offset: np.zeros(count) for offset in _NEIGHBOURS}
        self._sums = np.zeros((3, count))

    def add(self, value: FloatArray, rows: FloatArray, columns: FloatArray, is_own: NDArray[np.bool_]) -> None:
        """Add the samples of a view, with their places in pixels of the view that is computed."""
        height, width = self._size
        is_in = is_own & (rows >= 0.0) & (rows <= height - 1) & (columns >= 0.0) & (columns <= width - 1)
        top, left = self._factor * rows[is_in], self._factor * columns[is_in]
        row = np.minimum(top.astype(np.int64), self._shape[0] - 2)
        column = np.minimum(left.astype(np.int64), self._shape[1] - 2)
        down, right = top - row, left - column
        count, stride = self._sums.shape[1], self._shape[1]
        first = row * stride + column
        corners = {
            (0, 0): (first, (1.0 - down) * (1.0 - right)),
            (0, 1): (first + 1, (1.0 - down) * right),
            (1, 0): (first + stride, down * (1.0 - right)),
            (1, 1): (first + stride + 1, down * right),
        }
        values = value[is_in]
        for place, (index, weight) in corners.items():
            for channel in range(3):
                self._sums[channel] += np.bincount(index, weight * values[:, channel], count)
            for other, (_, weight_other) in corners.items():
                offset = other[0] - place[0], other[1] - place[1]
                if offset in self._products:
                    self._products[offset] += np.bincount(index, weight * weight_other, count)

    def combined(self, other: "_NormalEquations") -> "_NormalEquations":
        """Add the equations of both."""
        both = _NormalEquations(*self._size, self._factor)
        both._products = {offset: own + other._products[offset] for offset, own in self._products.items()}
        both._sums = self._sums + other._sums
        return both

    @property
    def weight(self) -> float:
        """Mean number of views' pixels on one of the picture."""
        return float(self._products[0, 0].mean())

    def known(self) -> NDArray[np.bool_]:
        """Find the pixels of the picture that any sample lies on."""
        return self._spread(self._products[0, 0].reshape(self._shape)) > 0.0

    def grey(self) -> "_NormalEquations":
        """Put the equations of the mean of the channels in the place of each."""
        grey = _NormalEquations(*self._size, self._factor)
        grey._products, grey._sums = self._products, np.broadcast_to(self._sums.mean(axis=0), self._sums.shape)
        return grey

    def solve(self, start: FloatArray, prior: float) -> FloatArray:
        """Solve for the picture (height, width, channels) that explains the pixels best, of the first channels.

        start : picture that is kept where no view has samples.
        prior : weight of its pixels beside that of a sample.
        """
        from scipy.sparse.linalg import LinearOperator, cg

        shape = start.shape[:2]

        def normal(values: NDArray[np.float64]) -> NDArray[np.float64]:
            square = values.reshape(shape)
            return np.asarray((self._spread(self._product(self._means(square))) + prior * square).ravel())

        operator = LinearOperator((start[..., 0].size,) * 2, matvec=normal, dtype=np.float64)
        picture = np.empty_like(start)
        for channel in range(start.shape[2]):
            plain = start[..., channel]
            seen = self._spread(self._sums[channel].reshape(self._shape))
            right = seen.ravel() + prior * plain.ravel()
            solution, _ = cg(operator, right, x0=plain.ravel(), rtol=_TOLERANCE, maxiter=_ITERATIONS)
            picture[..., channel] = solution.reshape(shape)
        return picture

    def _means(self, picture: FloatArray) -> FloatArray:
        """Average a picture over all squares."""
        rows, columns = self._shape
        tall = np.zeros((rows, columns + self._factor - 1))
        for step in range(self._factor):
            tall += picture[step : step + rows]
        total = np.zeros((rows, columns))
        for step in range(self._factor):
            total += tall[:, step : step + columns]
        return total / self._factor**2

    def _spread(self, means: FloatArray) -> FloatArray:
        """Apply the transpose of `_means`."""
        rows, columns = self._shape
        wide = np.zeros((rows, columns + self._factor - 1))
        for step in range(self._factor):
            wide[:, step : step + columns] += means
        whole = np.zeros((rows + self._factor - 1, columns + self._factor - 1))
        for step in range(self._factor):
            whole[step : step + rows] += wide
        return whole / self._factor**2

    def _product(self, means: FloatArray) -> FloatArray:
        """Multiply the means by the symmetric matrix of products of neighbours' weights."""
        flat = means.ravel()
        total = self._products[0, 0] * flat
        for (down, right), products in self._products.items():
            step = down * self._shape[1] + right
            if step:
                total[:-step] += products[:-step] * flat[step:]
                total[step:] += products[:-step] * flat[:-step]
        return total.reshape(self._shape)


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
