"""Compiled inner loops of the plane sweep: how a shifted view differs from the reference view, and the guided filter.

Each call is for one plane, so that threads share the planes, and reads and writes every number once.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry, kernel

Weights = tuple[float, float, float, float]


class ShiftedView(NamedTuple):
    """A view that is shifted over the reference view, as `Spline.shifted` does.

    coefficients : of the view's spline, float64 (3, height, width).
    lit : uint8 (height, width), 1 for pixels of the view that got light.
    halves : (halves,), 1 for the halves of the aperture that the view is in.
    whole : whole pixels right and down.
    weights : of the splines for the rest of each.
    nearest : whole pixels right and down to the nearest pixel.
    part : first row and column that is seen, and those after the last.
    """

    coefficients: NDArray[np.float64]
    lit: NDArray[np.uint8]
    halves: NDArray[np.uint8]
    whole: tuple[int, int]
    weights: tuple[Weights, Weights]
    nearest: tuple[int, int]
    part: tuple[int, int, int, int]


@entry
def add_differences(view, middle, tolerance, scratch, cost, count):
    """Add the robust differences of a shifted view from the reference view to the sums of a plane.

    view : a ShiftedView.
    middle : the reference view, float64 (3, height, width).
    scratch : float64 (2, width + 3).
    cost, count : float64 and uint16 (halves, height, width), the sums.
    """
    coefficients, lit, halves = view.coefficients, view.lit, view.halves
    right, down = view.whole
    across, along = view.weights
    near_right, near_down = view.nearest
    top, left, bottom, end = view.part
    height, width = coefficients.shape[1:]
    row, total = scratch[0], scratch[1]
    for y in range(top, bottom):
        for x in range(end - left):
            total[x] = 0.0
        for channel in range(3):
            plane, y_above = coefficients[channel], y + down - 1
            _blend_rows(
                plane[_mirrored(y_above, height)],
                plane[_mirrored(y_above + 1, height)],
                plane[_mirrored(y_above + 2, height)],
                plane[_mirrored(y_above + 3, height)],
                along,
                row[1:],
            )
            # One pixel is read beyond the edges.
            row[0], row[width + 1] = row[_mirrored(-1, width) + 1], row[_mirrored(width, width) + 1]
            row[width + 2] = 0.0
            _add_squares(row[left + right :], across, middle[channel, y, left:end], total)
        for x in range(end - left):
            mean = total[x] / 3.0
            # Geman and McClure's robust cost: squares of small differences, 1 for large ones.
            total[x] = mean / (mean + tolerance)
        mask = lit[y + near_down, left + near_right :]
        for half in range(len(halves)):
            if halves[half]:
                _add_lit(total, mask, cost[half, y, left:end], count[half, y, left:end])


@kernel
def _mirrored(index, size):
    """Mirror an index at most one beyond the first and the last, at the middles of these pixels."""
    inside = size - 1 - abs(size - 1 - abs(index))
    return max(inside, 0)


@kernel
def _blend_rows(first, second, third, fourth, weights, blended):
    """Evaluate a spline vertically: the weighted sum of four rows of coefficients."""
    for x in range(len(first)):
        blended[x] = weights[0] * first[x] + weights[1] * second[x] + weights[2] * third[x] + weights[3] * fourth[x]


@kernel
def _add_squares(row, weights, middle, total):
    """Evaluate a spline horizontally, and add its squared differences from the reference view."""
    for x in range(len(middle)):
        value = weights[0] * row[x] + weights[1] * row[x + 1] + weights[2] * row[x + 2] + weights[3] * row[x + 3]
        difference = value - middle[x]
        total[x] += difference * difference


@kernel
def _add_lit(difference, lit, cost, count):
    """Add the differences of lit pixels, and count these."""
    for x in range(len(cost)):
        cost[x] += difference[x] * lit[x]
        count[x] += lit[x]


@entry
def smooth_costs(cost, count, guide, guide_mean, guide_weight, scratch, rows, least):
    """Smooth the costs of a plane by the guided filter: the whole aperture's, and each half's; keep the least of these.

    cost, count : (halves, height, width); where nothing is counted, the cost is 1, the greatest that there is.
    guide : the reference view, float64 (height, width).
    guide_mean, guide_weight : its mean around each pixel, and one over its regularized variance.
    scratch, rows : float64 (3, height, width) and (2, width).
    least : float64 (height, width), the result.
    """
    halves, height, width = cost.shape
    mean = scratch[0]
    for choice in range(halves + 1):
        begin, end = (0, halves) if choice == halves else (choice, choice + 1)
        for y in range(height):
            for x in range(width):
                total, seen = 0.0, 0
                for half in range(begin, end):
                    total += cost[half, y, x]
                    seen += count[half, y, x]
                mean[y, x] = total / seen if seen > 0 else 1.0
        _guided_filter(mean, guide, guide_mean, guide_weight, scratch, rows, choice == 0, least)


@kernel
def _guided_filter(picture, guide, guide_mean, guide_weight, scratch, rows, is_first, least):
    """Filter a picture, and keep the least of the result and of what is there already; see `GuidedFilter`."""
    height, width = picture.shape
    slope, offset = scratch[1], scratch[2]
    sums, products = rows[0], rows[1]
    for y in range(height):
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        for x in range(width):
            sums[x] = picture[above, x] + picture[y, x] + picture[below, x]
            products[x] = (
                guide[above, x] * picture[above, x] + guide[y, x] * picture[y, x] + guide[below, x] * picture[below, x]
            )
        for x in range(width):
            before, after = max(x - 1, 0), min(x + 1, width - 1)
            mean = (sums[before] + sums[x] + sums[after]) / 9.0
            product = (products[before] + products[x] + products[after]) / 9.0
            slope[y, x] = (product - guide_mean[y, x] * mean) * guide_weight[y, x]
            offset[y, x] = mean - slope[y, x] * guide_mean[y, x]
    for y in range(height):
        above, below = max(y - 1, 0), min(y + 1, height - 1)
        for x in range(width):
            sums[x] = slope[above, x] + slope[y, x] + slope[below, x]
            products[x] = offset[above, x] + offset[y, x] + offset[below, x]
        for x in range(width):
            before, after = max(x - 1, 0), min(x + 1, width - 1)
            value = guide[y, x] * ((sums[before] + sums[x] + sums[after]) / 9.0)
            value += (products[before] + products[x] + products[after]) / 9.0
            least[y, x] = value if is_first else min(least[y, x], value)
