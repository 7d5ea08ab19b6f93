"""A view with more pixels than the light field's, from all views.

Views see a point at places that differ by parts of a pixel, so that together they know more of it than each.  Of all
pictures with smaller pixels, that is searched for whose mean over each view's pixel, at the place where its depth puts
it, is nearest to what the pixel saw: least squares, by conjugate gradients.  All that is needed of the views is nine
numbers a pixel, so that they are read once, one at a time.

A pixel is taken to be the mean over its square, as the film's box filter makes it.  Where pixels were interpolated
between microlenses, as of hexagons, those are taken in their place, each where it is: what is interpolated knows no
more, and is not what was seen at its place.

How much the interpolated middle view counts beside the views depends on their noise, which detail finer than a pixel
multiplies: it is what makes the pictures of two halves of the views most alike (cross-validation).

References: Irani, Peleg 1991, "Improving Resolution by Image Registration"; Elad, Feuer 1997, "Restoration of a Single
    Superresolution Image from Several Blurred, Noisy, and Undersampled Measured Images"; Bishop, Favaro 2012, "The
    Light Field Camera: Extended Depth of Field, Aliasing, and Superresolution"; Stone 1974, "Cross-Validatory Choice
    and Assessment of Statistical Predictions".
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.errors import InputError
from raytracer.lightfield.coverage import at_nearest, lit_view, within_lens
from raytracer.lightfield.depth import Depth, Update, depth_map
from raytracer.lightfield.perspectives import shifts
from raytracer.lightfield.warping import Spline, tone
from raytracer.plenoptic.field import LightField
from raytracer.plenoptic.views import Views

_Picture = NDArray[np.float64]

_MOST_FACTOR = 4

_PRIORS = tuple(0.02 * 2.0**step for step in range(7))
"""Weights of the interpolated view, as shares of the mean number of views' pixels on one, from which one is chosen: it
decides what no view knows, and is outvoted where they do.  Of 9 x 9 views of 80 x 64 pixels, with four times as many a
side, 0.02 is best without noise, and 0.3 with 15 % of it; with less the depth's own errors come through in any case."""

_ITERATIONS, _ENOUGH = 40, 1e-4
"""Of conjugate gradients, at most, and the residual as a share of the right side at which they end: less than what
eight bits tell."""

_STEPS = 4
"""Of the search for a pixel's place, each of which divides its error by the depth's slope."""

_NEIGHBOURS = ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))
"""Rows down and columns right: one of each two neighbours' directions, since products are the same both ways."""


_DEVIATIONS = 3.0
"""Of the noise: values farther outside of what is around a pixel in the middle view are of something else."""

_NORMAL = 1.4826
"""Standard deviation of what is normally distributed, over the median of its magnitudes."""


def supersampled(
    field: LightField,
    factor: int = 2,
    depth: Depth | None = None,
    *,
    threads: int | None = None,
    update: Update | None = None,
) -> _Picture:
    """One view with `factor` times as many pixels along each side: float64 (factor height, factor width, 3).

    Parameters
    ----------
    factor : 2, 3 or 4.
    depth : of the view; default: found first, by `depth_map`.
    threads : that search for the depth; default: all.
    update : told of the progress.

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
    bounds = _Bounds(middle, lit)
    halves = [_Equations(views.height, views.width, factor) for _ in range(2)]
    indices = np.argwhere(within_lens(views))
    for number, (row, column) in enumerate(indices):
        offset = views.position[row, column] - views.position[depth.row, depth.column]
        seen = _seen(field, int(row), int(column))
        home = _home(depth, views, offset, seen.rows, seen.columns)
        # Neighbours in different halves; the middle view, which the other weighs against, in that which is solved for.
        half = halves[(row + column - depth.row - depth.column) % 2]
        half.add(seen.values, *home, seen.is_lit & bounds.hold(seen.values, *home))
        if update is not None:
            update(number + 1, len(indices))
    start = enlarged(middle, factor)
    prior = _best_prior(halves[0], halves[1], start)
    both = halves[0].plus(halves[1])
    found = both.solved(start, prior)
    if lit is not None:
        # Of what neither the middle view nor any other has seen, nothing is known.
        found[~(both.known() | np.kron(lit, np.ones((factor, factor), dtype=bool)))] = 0.0
    return found


class _Seen(NamedTuple):
    """Samples of a view: values (n, 3), their places in its pixels, rows (n,) and columns (n,), and is_lit (n,)."""

    values: _Picture
    rows: _Picture
    columns: _Picture
    is_lit: NDArray[np.bool_]


def _seen(field: LightField, row: int, column: int) -> _Seen:
    """Read the samples of a view: of its microlenses where those are known, and else its pixels."""
    if field.samples is not None:
        values = np.asarray(field.samples.value[row, column], dtype=np.float64)
        columns, rows = field.samples.place.T
        is_lit = np.asarray(np.isfinite(values).all(axis=-1))
        return _Seen(np.where(is_lit[:, None], values, 0.0), rows, columns, is_lit)
    view, lit = field.view(row, column), field.lit(row, column)
    rows, columns = (grid.astype(np.float64).ravel() for grid in np.indices(view.shape[:2]))
    is_lit = np.ones(rows.shape, dtype=bool) if lit is None else lit.ravel()
    return _Seen(view.reshape(-1, 3), rows, columns, is_lit)


def enlarged(view: _Picture, factor: int) -> _Picture:
    """A view with more pixels by cubic interpolation alone: float64 (factor height, factor width, 3)."""
    rows, columns = ((np.arange(factor * size) + 0.5) / factor - 0.5 for size in view.shape[:2])
    return Spline(view).at(*np.broadcast_arrays(rows[:, None], columns[None, :]))[0]


def _home(
    depth: Depth, views: Views, offset: NDArray[np.float64], rows: _Picture, columns: _Picture
) -> tuple[_Picture, _Picture]:
    """Find in the depth's own view what a view `offset` (m) away sees at places: rows and columns."""
    from scipy import ndimage

    at_row, at_column = rows, columns
    for _ in range(_STEPS):
        inverse = ndimage.map_coordinates(depth.inverse, np.stack([at_row, at_column]), order=1, mode="nearest")
        right, down = shifts(views, offset, inverse)
        at_row, at_column = rows - down, columns - right
    return at_row, at_column


class _Bounds:
    """Values that may be those of a pixel's own point: between those of the pixels around it, and noise.

    Parameters
    ----------
    middle : the view that is compared with, linear (height, width, 3).
    lit : where that is known, bool (height, width); None for everywhere.  Elsewhere any value may be right.
    """

    def __init__(self, middle: _Picture, lit: NDArray[np.bool_] | None) -> None:
        from scipy import ndimage

        values = tone(middle)
        noise = _DEVIATIONS * _noise(values)
        self._low = ndimage.minimum_filter(values, (3, 3, 1), mode="nearest") - noise
        self._high = ndimage.maximum_filter(values, (3, 3, 1), mode="nearest") + noise
        self._lit = lit

    def hold(self, values: _Picture, rows: _Picture, columns: _Picture) -> NDArray[np.bool_]:
        """Tell which linear values (n, 3) are within, all channels, for the pixels at these places (n,): bool (n,)."""
        row, column = (
            np.clip(np.rint(places), 0, size - 1).astype(np.int64)
            for places, size in zip((rows, columns), self._low.shape[:2], strict=True)
        )
        low, high = self._low[row, column], self._high[row, column]
        shown = tone(values)
        is_within = ((shown >= low) & (shown <= high)).all(axis=-1)
        return np.asarray(is_within if self._lit is None else is_within | ~at_nearest(self._lit, rows, columns))


def _noise(values: _Picture) -> float:
    """Standard deviation of noise, by the differences that are left when all smooth changes are taken away.

    Immerkaer 1996, "Fast Noise Variance Estimation", with the median in place of the mean.
    """
    from scipy import ndimage

    mask = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])
    left = ndimage.convolve(values, mask[..., None], mode="mirror")
    return float(_NORMAL * np.median(np.abs(left)) / np.sqrt((mask**2).sum()))


def _best_prior(half: "_Equations", other: "_Equations", start: _Picture) -> float:
    """Choose the weight of the interpolated view with which two halves of the views agree best on the picture.

    The noise of the halves is independent, so that the distance of one half's picture from the least smoothed one of
    the other is that from the truth, and by how much the latter is off, which is the same for all.  How well the
    other half's pixels are predicted would not do: of detail finer than they are they tell next to nothing.
    """
    weight = half.weight + other.weight
    if half.weight == 0.0 or other.weight == 0.0:
        return _PRIORS[0] * weight
    grey = start.mean(axis=-1, keepdims=True)
    half, reference = half.grey(), other.grey().solved(grey, _PRIORS[0] * weight)
    found = [float(((half.solved(grey, share * weight) - reference) ** 2).mean()) for share in _PRIORS]
    return _PRIORS[int(np.argmin(found))] * weight


class _Equations:
    """The normal equations of views' pixels, as means over a square of a picture that is linear between its pixels."""

    def __init__(self, height: int, width: int, factor: int) -> None:
        self._factor = factor
        self._size = height, width
        # Of all means over `factor` by `factor` pixels: one for each pixel that a square can begin at.
        self._shape = factor * (height - 1) + 1, factor * (width - 1) + 1
        count = self._shape[0] * self._shape[1]
        self._products = {offset: np.zeros(count) for offset in _NEIGHBOURS}
        self._sums = np.zeros((3, count))

    def add(self, value: _Picture, rows: _Picture, columns: _Picture, is_own: NDArray[np.bool_]) -> None:
        """Add a view's pixels, with their places in pixels of the view that is searched for."""
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

    def plus(self, other: "_Equations") -> "_Equations":
        """Add the equations of both."""
        both = _Equations(*self._size, self._factor)
        both._products = {offset: own + other._products[offset] for offset, own in self._products.items()}
        both._sums = self._sums + other._sums
        return both

    @property
    def weight(self) -> float:
        """Mean number of views' pixels on one of the picture."""
        return float(self._products[0, 0].mean())

    def known(self) -> NDArray[np.bool_]:
        """Find the pixels of the picture that any view's pixel lies on."""
        return self._spread(self._products[0, 0].reshape(self._shape)) > 0.0

    def grey(self) -> "_Equations":
        """Put the equations of the mean of the channels in the place of each."""
        grey = _Equations(*self._size, self._factor)
        grey._products, grey._sums = self._products, np.broadcast_to(self._sums.mean(axis=0), self._sums.shape)
        return grey

    def solved(self, start: _Picture, prior: float) -> _Picture:
        """Solve for the picture (height, width, channels) that explains the pixels best, of the first channels.

        Parameters
        ----------
        start : a picture that it is like where no view tells.
        prior : what a pixel of that counts for beside a view's pixel that lies on it.
        """
        from scipy.sparse.linalg import LinearOperator, cg

        shape = start.shape[:2]

        def normal(picture: NDArray[np.float64]) -> NDArray[np.float64]:
            square = picture.reshape(shape)
            return np.asarray((self._spread(self._product(self._means(square))) + prior * square).ravel())

        operator = LinearOperator((start[..., 0].size,) * 2, matvec=normal, dtype=np.float64)
        found = np.empty_like(start)
        for channel in range(start.shape[2]):
            plain = start[..., channel]
            seen = self._spread(self._sums[channel].reshape(self._shape))
            right = seen.ravel() + prior * plain.ravel()
            solution, _ = cg(operator, right, x0=plain.ravel(), rtol=_ENOUGH, maxiter=_ITERATIONS)
            found[..., channel] = solution.reshape(shape)
        return found

    def _means(self, picture: _Picture) -> _Picture:
        """Means over all squares."""
        rows, columns = self._shape
        tall = np.zeros((rows, columns + self._factor - 1))
        for step in range(self._factor):
            tall += picture[step : step + rows]
        total = np.zeros((rows, columns))
        for step in range(self._factor):
            total += tall[:, step : step + columns]
        return total / self._factor**2

    def _spread(self, means: _Picture) -> _Picture:
        """The transposed of `_means`."""
        rows, columns = self._shape
        wide = np.zeros((rows, columns + self._factor - 1))
        for step in range(self._factor):
            wide[:, step : step + columns] += means
        whole = np.zeros((rows + self._factor - 1, columns + self._factor - 1))
        for step in range(self._factor):
            whole[step : step + rows] += wide
        return whole / self._factor**2

    def _product(self, means: _Picture) -> _Picture:
        """The symmetric matrix of products of neighbours' weights times the means."""
        flat = means.ravel()
        total = self._products[0, 0] * flat
        for (down, right), products in self._products.items():
            step = down * self._shape[1] + right
            if step:
                total[:-step] += products[:-step] * flat[step:]
                total[step:] += products[:-step] * flat[:-step]
        return total.reshape(self._shape)
