"""Compiled inner loops of super-resolution: places of samples, and normal equations of the pixels around them.

The picture has `factor` pixels along one of a view.  A sample is the mean over a square of `factor` by `factor` pixels
of it, anywhere; that is interpolated linearly between the means over squares of whole pixels, of which there are
(rows, columns).
"""

import math

from raytracer.core.compiler.dispatch import entry, kernel

STEPS = 4
"""Steps of the search for a sample's place, each of which divides its error by the depth's slope."""


@entry
def find_places(inverse, away, rows, columns, begin, end, places):
    """Find the places in the depth's own view of samples of another view, by fixed-point iteration.

    inverse : 1 / distance, float64 (height, width), linear between pixels.
    away : pixels right and up by which the other view is away, for each unit of 1 / distance; and the 1 / distance of
        what all views see at the same pixel.
    rows, columns : places in the other view, float64 (n,), of which begin ... end - 1 are searched for.
    places : float64 (2, n), rows and columns that are found.
    """
    right, up, zero = away
    for sample in range(begin, end):
        row, column = rows[sample], columns[sample]
        for _ in range(STEPS):
            moved = zero - _bilinear(inverse, row, column)
            row, column = rows[sample] + up * moved, columns[sample] - right * moved
        places[0, sample], places[1, sample] = row, column


@kernel
def _bilinear(values, row, column):
    """Interpolate values linearly; beyond the edge its values are repeated.  What is no place is taken for 0."""
    height, width = values.shape
    row = min(row, height - 1.0) if row > 0.0 else 0.0
    column = min(column, width - 1.0) if column > 0.0 else 0.0
    top, left = int(row), int(column)
    bottom, right = min(top + 1, height - 1), min(left + 1, width - 1)
    down, across = row - top, column - left
    upper = values[top, left] + across * (values[top, right] - values[top, left])
    lower = values[bottom, left] + across * (values[bottom, right] - values[bottom, left])
    return upper + down * (lower - upper)


@entry
def reject_samples(places, values, bounds, begin, end, is_own):
    """Reject samples that are not within the view, or whose value is out of bounds there.

    places, values : float64 (2, n) and linear (n, 3).
    bounds : least and greatest square root of values, float64 (2, height, width, 3).
    is_own : bool (n,); False is set for samples that are rejected, of begin ... end - 1.
    """
    _, height, width, _ = bounds.shape
    for sample in range(begin, end):
        row, column = places[0, sample], places[1, sample]
        if not (0.0 <= row <= height - 1.0 and 0.0 <= column <= width - 1.0):
            is_own[sample] = False
            continue
        y, x = int(row + 0.5), int(column + 0.5)
        for channel in range(3):
            value = math.sqrt(max(values[sample, channel], 0.0))
            if not bounds[0, y, x, channel] <= value <= bounds[1, y, x, channel]:
                is_own[sample] = False


@entry
def add_samples(values, places, is_own, factor, first, last, products, sums):
    """Add samples to the normal equations, in their order, for the rows first ... last - 1 of means.

    products : float64 (5, rows, columns), sums of products of the weights of neighbouring means: of a mean with itself,
        with that to its right, and with those below it, to the left, in the middle and to the right.
    sums : float64 (3, rows, columns), of weighted values.
    """
    _, rows, columns = sums.shape
    for sample in range(len(is_own)):
        if not is_own[sample]:
            continue
        top, left = factor * places[0, sample], factor * places[1, sample]
        row, column = min(int(top), rows - 2), min(int(left), columns - 2)
        down, right = top - row, left - column
        if first <= row < last:
            _add_pair(products, sums, values, sample, row, column, 1.0 - down, right)
            for right_below in range(2):
                below = down * (right if right_below else 1.0 - right)
                products[3 + right_below, row, column] += (1.0 - down) * (1.0 - right) * below
                products[2 + right_below, row, column + 1] += (1.0 - down) * right * below
        if first <= row + 1 < last:
            _add_pair(products, sums, values, sample, row + 1, column, down, right)


@kernel
def _add_pair(products, sums, values, sample, row, column, weight, right):
    """Add a sample to two means side by side, which have this weight together."""
    here, beside = weight * (1.0 - right), weight * right
    products[0, row, column] += here * here
    products[1, row, column] += here * beside
    products[0, row, column + 1] += beside * beside
    for channel in range(3):
        sums[channel, row, column] += here * values[sample, channel]
        sums[channel, row, column + 1] += beside * values[sample, channel]


@entry
def multiply(products, factor, prior, picture, means, weighted, result):
    """Multiply a picture by the matrix of the normal equations, and add `prior` times the picture.

    picture, result : float64 (height, width).
    means, weighted : scratch, float64 (rows, columns).
    """
    rows, columns = means.shape
    share = 1.0 / factor**2
    for row in range(rows):
        for column in range(columns):
            total = 0.0
            for down in range(factor):
                for right in range(factor):
                    total += picture[row + down, column + right]
            means[row, column] = share * total
    for row in range(rows):
        for column in range(columns):
            total = products[0, row, column] * means[row, column]
            if column + 1 < columns:
                total += products[1, row, column] * means[row, column + 1]
            if column > 0:
                total += products[1, row, column - 1] * means[row, column - 1]
            # The matrix is symmetric.
            for right in range(-1, 2):
                if 0 <= column + right < columns and row + 1 < rows:
                    total += products[3 + right, row, column] * means[row + 1, column + right]
                if 0 <= column - right < columns and row > 0:
                    total += products[3 + right, row - 1, column - right] * means[row - 1, column - right]
            weighted[row, column] = total
    _spread(weighted, factor, prior, picture, result)


@entry
def spread(means, factor, prior, picture, result):
    """Spread means evenly over their squares of pixels, and add `prior` times a picture: the transpose of averaging.

    means : float64 (rows, columns).
    picture, result : float64 (height, width).
    """
    _spread(means, factor, prior, picture, result)


@kernel
def _spread(means, factor, prior, picture, result):
    rows, columns = means.shape
    height, width = result.shape
    for row in range(height):
        for column in range(width):
            total = 0.0
            for y in range(max(0, row - factor + 1), min(rows, row + 1)):
                for x in range(max(0, column - factor + 1), min(columns, column + 1)):
                    total += means[y, x]
            result[row, column] = total / factor**2 + prior * picture[row, column]
