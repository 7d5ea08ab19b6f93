"""Kernels of pictures from any pose: surfaces drawn from the depth of views.

Depth is one over the distance along an axis throughout, 0 for what is infinitely far, NaN where nothing is known; so a
point of a view's ray is `ahead + inverse * origin`, with a last coordinate of `inverse`, which may be 0.
"""

import math

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.compiler.entry import entry

# Rows of a camera in a table: position, right, up, forward, and the size of a pixel, left and top of the image plane.
ORIGIN, RIGHT, UP, FORWARD, PIXEL, LEFT, TOP, CAMERA = 0, 3, 6, 9, 12, 13, 14, 15

SLOPES = 4
"""Numbers that `pixel_slopes` measures of a pixel."""

SURFACE = 4
"""Numbers of a pixel of a surface in a picture; see `draw_surface`."""

STEEPEST = 6.0
"""Slope of a surface against a view's picture, depth over width, above which a step of depth is an edge: so obliquely a
view shows little of a surface, and others more."""

BEND = 2.0
"""Factor by which a surface may get steeper from one pixel to the next."""


FLAT = 0.25
"""By how much of its change from pixel to pixel, and of a pixel's width, a surface may be off a plane at its edge."""

SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))
"""Steps to the neighbours of a pixel."""


@kernel
def _axis(camera, first, x, y, z):
    return camera[first] * x + camera[first + 1] * y + camera[first + 2] * z


@kernel
def to_view(camera, x, y, z, inverse):
    """Transform a point to a view: right, up and ahead, to be divided by each other, and `inverse` as it was."""
    x -= inverse * camera[ORIGIN]
    y -= inverse * camera[ORIGIN + 1]
    z -= inverse * camera[ORIGIN + 2]
    return _axis(camera, RIGHT, x, y, z), _axis(camera, UP, x, y, z), _axis(camera, FORWARD, x, y, z)


@kernel
def from_view(camera, x, y, inverse):
    """Make the point that a view sees at a place of its picture (px), at one over a distance."""
    right, up = camera[LEFT] + camera[PIXEL] * x, camera[TOP] - camera[PIXEL] * y
    return (
        camera[FORWARD] + right * camera[RIGHT] + up * camera[UP] + inverse * camera[ORIGIN],
        camera[FORWARD + 1] + right * camera[RIGHT + 1] + up * camera[UP + 1] + inverse * camera[ORIGIN + 1],
        camera[FORWARD + 2] + right * camera[RIGHT + 2] + up * camera[UP + 2] + inverse * camera[ORIGIN + 2],
    )


@kernel
def place(camera, right, up, ahead):
    """Return the place (px) in a view's picture of a point in front of it."""
    return (right / ahead - camera[LEFT]) / camera[PIXEL], (camera[TOP] - up / ahead) / camera[PIXEL]


@kernel
def _depth_at(depth, x, y):
    """Return the depth of a pixel; NaN outside of the picture."""
    return depth[y, x] if 0 <= x < depth.shape[1] and 0 <= y < depth.shape[0] else math.nan


@kernel
def _is_step(depth, pixel, x, y, dx, dy):
    """Tell if a surface breaks off between a pixel and the next; also where nothing is known of one."""
    a, b = _depth_at(depth, x, y), _depth_at(depth, x + dx, y + dy)
    step = abs(b - a)
    # d(1/z) over a pixel of a plane of slope s is 1/z times s times a pixel's tangent.
    if not step <= STEEPEST * pixel * max(a, b):
        return True
    # A plane goes on as it came; what a pixel's width changes in depth, is no step.
    before, after = abs(a - _depth_at(depth, x - dx, y - dy)), abs(_depth_at(depth, x + 2 * dx, y + 2 * dy) - b)
    slope = max(0.0 if math.isnan(before) else before, 0.0 if math.isnan(after) else after)
    return step > BEND * slope + pixel * max(a, b)


@kernel
def _may_be_mean(depth, pixel, x, y, dx, dy):
    """Tell if the depth of a pixel with an edge between it and a neighbour may be a mean of what is on both sides.

    It is one where it is off the plane on which the next two pixels on its own side go on.  It may be one before what
    goes on smoothly behind it.
    """
    is_before = _depth_at(depth, x + dx, y + dy) < depth[y, x]
    if is_before and not _is_step(depth, pixel, x + dx, y + dy, dx, dy):
        return True
    if _is_step(depth, pixel, x, y, -dx, -dy) or _is_step(depth, pixel, x - dx, y - dy, -dx, -dy):
        return False
    first, second = _depth_at(depth, x - dx, y - dy), _depth_at(depth, x - 2 * dx, y - 2 * dy)
    return abs(depth[y, x] - 2.0 * first + second) > FLAT * (abs(first - second) + pixel * first)


@kernel
def _goes_on(depth, slopes, pixel, x, y, dx, dy):
    """Tell if a neighbour is of the same surface and sees nothing else."""
    return not _is_step(depth, pixel, x, y, dx, dy) and slopes[y + dy, x + dx, 2] >= 0.0


@entry
def pixel_slopes(depth, pixel, slopes):
    """Measure the change of depth over a pixel of a view, by neighbours on the same surface: right, down, and most.

    depth : float64 (height, width).
    slopes : float64 (height, width, 4), the result: the third is NaN where a pixel has no neighbour on its surface, or
        may see another, too; the last is 1 where all four are on its surface, so that the pixel sees nothing else.
    """
    height, width = depth.shape
    for y in range(height):
        for x in range(width):
            is_whole, neighbours = True, 0
            for dx, dy in SIDES:
                if not _is_step(depth, pixel, x, y, dx, dy):
                    neighbours += 1
                elif _may_be_mean(depth, pixel, x, y, dx, dy):
                    is_whole = False
            slopes[y, x, 2] = 0.0 if is_whole and neighbours > 0 else math.nan
            slopes[y, x, 3] = 1.0 if neighbours == 4 else 0.0
    for y in range(height):
        for x in range(width):
            for axis in range(2):
                total, count = 0.0, 0
                for sign in (-1, 1):
                    dx, dy = (sign, 0) if axis == 0 else (0, sign)
                    if _goes_on(depth, slopes, pixel, x, y, dx, dy):
                        change = depth[y + dy, x + dx] - depth[y, x]
                        total += sign * change
                        count += 1
                        # What is not a number stays.
                        slopes[y, x, 2] += max(abs(change) - slopes[y, x, 2], 0.0)
                slopes[y, x, axis] = total / count if count > 0 else 0.0


@kernel
def _corner(depth, slopes, pixel, x, y, dx, dy):
    """Return the depth of a pixel's corner: the mean of the pixels around it that are of its surface."""
    total, count = depth[y, x] + 0.5 * (dx * slopes[y, x, 0] + dy * slopes[y, x, 1]), 1
    if _goes_on(depth, slopes, pixel, x, y, dx, 0):
        total += depth[y, x + dx] - 0.5 * (dx * slopes[y, x + dx, 0] - dy * slopes[y, x + dx, 1])
        count += 1
    if _goes_on(depth, slopes, pixel, x, y, 0, dy):
        total += depth[y + dy, x] + 0.5 * (dx * slopes[y + dy, x, 0] - dy * slopes[y + dy, x, 1])
        count += 1
    return max(total / count, 0.0)


@entry
def draw_surface(source, depth, slopes, target, surface, quad):
    """Draw the surface that a view sees into the picture of a camera, where it is nearer, or seen better, than others.

    source, target : float64 (15,), rows of cameras.
    depth, slopes : of the view, as `pixel_slopes` makes them.
    surface : float64 (height, width, 4), of the picture: depth, NaN where nothing is known yet; how far it may be off;
        the angle (rad) between the rays of both; and the depth that it must be farther than.
    quad : float64 (4, 3), overwritten.
    """
    height, width = depth.shape
    tall, wide = surface.shape[:2]
    for y in range(height):
        for x in range(width):
            if not slopes[y, x, 2] >= 0.0:
                continue
            is_ahead = True
            low_x, high_x, low_y, high_y = math.inf, -math.inf, math.inf, -math.inf
            for i in range(4):
                dx, dy = 2 * (i & 1) - 1, 2 * (i >> 1) - 1
                inverse = _corner(depth, slopes, source[PIXEL], x, y, dx, dy)
                px, py, pz = from_view(source, x + 0.5 + 0.5 * dx, y + 0.5 + 0.5 * dy, inverse)
                right, up, ahead = to_view(target, px, py, pz, inverse)
                if ahead <= 0.0:
                    is_ahead = False
                    break
                place_x, place_y = place(target, right, up, ahead)
                quad[i, 0], quad[i, 1], quad[i, 2] = place_x, place_y, inverse / ahead
                low_x, high_x = min(low_x, place_x), max(high_x, place_x)
                low_y, high_y = min(low_y, place_y), max(high_y, place_y)
            if not is_ahead or high_x < 0.5 or low_x > wide or high_y < 0.5 or low_y > tall:
                continue
            # What the depth may be off by: its change over a pixel, and a pixel's own width; as a part of that from the
            # camera, which is farther by `ahead`.
            px, py, pz = from_view(source, x + 0.5, y + 0.5, depth[y, x])
            _, _, ahead = to_view(target, px, py, pz, depth[y, x])
            off = (source[PIXEL] + (slopes[y, x, 2] / depth[y, x] if depth[y, x] > 0.0 else 0.0)) / ahead
            angle = ray_angle(source, target, px, py, pz, depth[y, x])
            _fill(quad, 0, 1, 2, off, angle, surface)
            _fill(quad, 1, 3, 2, off, angle, surface)


@kernel
def ray_angle(source, target, x, y, z, inverse):
    """Return the angle (rad) at a point between the rays to two cameras."""
    ax, ay, az = x - inverse * source[0], y - inverse * source[1], z - inverse * source[2]
    bx, by, bz = x - inverse * target[0], y - inverse * target[1], z - inverse * target[2]
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return math.atan2(math.sqrt(cx * cx + cy * cy + cz * cz), ax * bx + ay * by + az * bz)


@kernel
def _fill(quad, a, b, c, off, angle, surface):
    """Draw a triangle: one over a distance is linear on a picture."""
    ax, ay, aw = quad[a, 0], quad[a, 1], quad[a, 2]
    bx, by, bw = quad[b, 0], quad[b, 1], quad[b, 2]
    cx, cy, cw = quad[c, 0], quad[c, 1], quad[c, 2]
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    # Seen from behind, nothing is known of a surface.
    if not area > 0.0:
        return
    tall, wide = surface.shape[:2]
    first_x, last_x = max(math.ceil(min(ax, bx, cx) - 0.5), 0), min(math.floor(max(ax, bx, cx) - 0.5), wide - 1)
    first_y, last_y = max(math.ceil(min(ay, by, cy) - 0.5), 0), min(math.floor(max(ay, by, cy) - 0.5), tall - 1)
    for y in range(int(first_y), int(last_y) + 1):
        for x in range(int(first_x), int(last_x) + 1):
            px, py = x + 0.5, y + 0.5
            share_b = ((px - ax) * (cy - ay) - (cx - ax) * (py - ay)) / area
            share_c = ((bx - ax) * (py - ay) - (px - ax) * (by - ay)) / area
            if share_b < 0.0 or share_c < 0.0 or share_b + share_c > 1.0:
                continue
            inverse = aw + share_b * (bw - aw) + share_c * (cw - aw)
            # Views saw through what was there.
            if inverse >= surface[y, x, 3]:
                continue
            bound, known = off * inverse, surface[y, x, 0]
            slack = bound + surface[y, x, 1]
            # Nearer than all before; or of the same surface, and seen from nearer by.
            is_better = inverse >= known - slack and angle < surface[y, x, 2]
            if math.isnan(known) or inverse > known + slack or is_better:
                surface[y, x, 0] = inverse
                surface[y, x, 1] = bound
                surface[y, x, 2] = angle


@entry
def median_angle(source, depth, target, tall, wide, columns, rows, angles):
    """Return the median angle (rad) between the rays of a view and of a camera to points that both have in sight.

    columns, rows : int64 (n,), pixels of the view whose points are taken.
    angles : float64 (n * n,), overwritten.

    It is infinite where a camera has none of these points in its picture, of height x width pixels.
    """
    count = 0
    for y in rows:
        for x in columns:
            inverse = depth[y, x]
            if not inverse >= 0.0:
                continue
            px, py, pz = from_view(source, x + 0.5, y + 0.5, inverse)
            right, up, ahead = to_view(target, px, py, pz, inverse)
            if ahead <= 0.0:
                continue
            place_x, place_y = place(target, right, up, ahead)
            if 0.0 <= place_x <= wide and 0.0 <= place_y <= tall:
                angle, at = ray_angle(source, target, px, py, pz, inverse), count
                while at > 0 and angles[at - 1] > angle:
                    angles[at] = angles[at - 1]
                    at -= 1
                angles[at] = angle
                count += 1
    return angles[count // 2] if count > 0 else math.inf


@entry
def find_false(source, depth, slopes, target, surface, false):
    """Mark the points of a picture's surface that a view sees through, so that there is nothing.

    false : bool (height, width).
    """
    height, width = depth.shape
    tall, wide = false.shape
    for y in range(tall):
        for x in range(wide):
            inverse = surface[y, x, 0]
            if not inverse > 0.0 or false[y, x]:
                continue
            px, py, pz = from_view(target, x + 0.5, y + 0.5, inverse)
            right, up, ahead = to_view(source, px, py, pz, inverse)
            if ahead <= 0.0:
                continue
            place_x, place_y = place(source, right, up, ahead)
            if not (0.0 <= place_x < width and 0.0 <= place_y < height):
                continue
            at_x, at_y = int(place_x), int(place_y)
            # A pixel at an edge may hold a mean of what is before and behind.
            if slopes[at_y, at_x, 3] != 1.0:
                continue
            known, slope = depth[at_y, at_x], slopes[at_y, at_x, 2]
            if inverse / ahead - known > surface[y, x, 1] / ahead + slope + source[PIXEL] * known:
                false[y, x] = True
