"""Kernels of pictures from any pose: the views that each point is seen by best, and the blend of what they see.

Depth is as in `view_surfaces`.
"""

import math

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.compiler.entry import entry
from raytracer.lightfield.kernels.view_surfaces import PIXEL, from_view, place, ray_angle, to_view

AT_EDGE = 0.5 * math.pi
"""Penalty (rad) of a point at an edge in a view, whose pixels there are means of what is before and behind it."""


@kernel
def _share_seen(depth, slopes, pixel, x, y, inverse, off):
    """Return by which share a view sees a point at a place: of the four pixels around it, bilinearly.

    Also return the share of those that see nothing else.
    """
    height, width = depth.shape
    left, top = math.floor(x - 0.5), math.floor(y - 0.5)
    tx, ty = x - 0.5 - left, y - 0.5 - top
    share, clean = 0.0, 0.0
    for j in range(2):
        for i in range(2):
            weight = (tx if i == 1 else 1.0 - tx) * (ty if j == 1 else 1.0 - ty)
            px, py = min(max(int(left) + i, 0), width - 1), min(max(int(top) + j, 0), height - 1)
            if sees(depth[py, px], slopes[py, px, 2], pixel, inverse, off):
                share += weight
                clean += weight * slopes[py, px, 3]
    return share, clean


@kernel
def sees(depth, slope, pixel, inverse, off):
    """Tell if a pixel sees a point at one over a distance: what they differ by is within what both may be off by."""
    return abs(inverse - depth) <= off * inverse + (0.0 if math.isnan(slope) else slope) + pixel * depth


@entry
def rank_view(source, depth, slopes, target, surface, view, best):
    """Enter a view among those that each pixel of a picture is best seen by.

    best : float64 (height, width, k, 2), the penalty and the number of the k best views, the best first; inf for none.

    The penalty is the angle between the rays plus what the view lacks in resolution, as by Buehler et al., sec. 4.
    """
    height, width = depth.shape
    tall, wide, count = best.shape[:3]
    for y in range(tall):
        for x in range(wide):
            inverse = surface[y, x, 0]
            if math.isnan(inverse):
                continue
            px, py, pz = from_view(target, x + 0.5, y + 0.5, inverse)
            right, up, ahead = to_view(source, px, py, pz, inverse)
            if ahead <= 0.0:
                continue
            place_x, place_y = place(source, right, up, ahead)
            if not (0.5 <= place_x <= width - 0.5 and 0.5 <= place_y <= height - 0.5):
                continue
            penalty = ray_angle(source, target, px, py, pz, inverse)
            # Pixels of the view against those of the picture, on the surface.
            coarse = ahead * source[PIXEL] / target[PIXEL] - 1.0
            penalty += max(coarse, 0.0)
            if penalty >= best[y, x, count - 1, 0]:
                continue
            off = surface[y, x, 1] / (inverse * ahead) if inverse > 0.0 else 0.0
            share, clean = _share_seen(depth, slopes, source[PIXEL], place_x, place_y, inverse / ahead, off)
            penalty += AT_EDGE * (1.0 - clean)
            if share < 0.5 or penalty >= best[y, x, count - 1, 0]:
                continue
            at = count - 1
            while at > 0 and best[y, x, at - 1, 0] > penalty:
                best[y, x, at, 0], best[y, x, at, 1] = best[y, x, at - 1, 0], best[y, x, at - 1, 1]
                at -= 1
            best[y, x, at, 0], best[y, x, at, 1] = penalty, view


@kernel
def _cubic(t, i):
    """Return the weight of neighbour i, -1 to 2, of a place t after neighbour 0 (Keys 1981)."""
    a = abs(t - i)
    if a < 1.0:
        return (1.5 * a - 2.5) * a * a + 1.0
    return ((-0.5 * a + 2.5) * a - 4.0) * a + 2.0 if a < 2.0 else 0.0


@entry
def add_view(source, radiance, target, surface, view, weights, total):
    """Add what a view sees of each pixel's point to a picture.

    source : a `view_surfaces.Surface`.
    weights : float64 (height, width, k, 2), weight and number of the views of each pixel.
    total : float64 (height, width, 4), the sum of weighted radiance, and of weights.
    """
    camera = source.camera
    tall, wide, count = weights.shape[:3]
    for y in range(tall):
        for x in range(wide):
            weight = 0.0
            for i in range(count):
                if weights[y, x, i, 1] == view:
                    weight = weights[y, x, i, 0]
            if weight <= 0.0:
                continue
            inverse = surface[y, x, 0]
            px, py, pz = from_view(target, x + 0.5, y + 0.5, inverse)
            right, up, ahead = to_view(camera, px, py, pz, inverse)
            place_x, place_y = place(camera, right, up, ahead)
            off = surface[y, x, 1] / (inverse * ahead) if inverse > 0.0 else 0.0
            red, green, blue, share = _sample(source, radiance, place_x, place_y, inverse / ahead, off)
            if share > 0.0:
                total[y, x, 0] += weight * red / share
                total[y, x, 1] += weight * green / share
                total[y, x, 2] += weight * blue / share
                total[y, x, 3] += weight


@kernel
def _sample(source, radiance, x, y, inverse, off):
    """Sample a view at a place by those of its pixels that see a point: cubic where all around do, else linear.

    Return red, green and blue, each times the last number.
    """
    depth, slopes, pixel = source.depth, source.slopes, source.camera[PIXEL]
    height, width = depth.shape
    left, top = math.floor(x - 0.5), math.floor(y - 0.5)
    tx, ty = x - 0.5 - left, y - 0.5 - top
    is_whole = left >= 1 and top >= 1 and left + 2 < width and top + 2 < height
    if is_whole:
        for j in range(-1, 3):
            for i in range(-1, 3):
                at_y, at_x = top + j, left + i
                is_whole = is_whole and sees(depth[at_y, at_x], slopes[at_y, at_x, 2], pixel, inverse, off)
    red, green, blue, share = 0.0, 0.0, 0.0, 0.0
    first, last = (-1, 3) if is_whole else (0, 2)
    for j in range(first, last):
        for i in range(first, last):
            at_y, at_x = min(max(top + j, 0), height - 1), min(max(left + i, 0), width - 1)
            if is_whole:
                part = _cubic(tx, i) * _cubic(ty, j)
            elif sees(depth[at_y, at_x], slopes[at_y, at_x, 2], pixel, inverse, off):
                part = (tx if i == 1 else 1.0 - tx) * (ty if j == 1 else 1.0 - ty)
            else:
                continue
            red += part * radiance[at_y, at_x, 0]
            green += part * radiance[at_y, at_x, 1]
            blue += part * radiance[at_y, at_x, 2]
            share += part
    return red, green, blue, share
