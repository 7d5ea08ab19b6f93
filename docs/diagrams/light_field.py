"""The plenoptic function, two planes, and what happens inside a light-field camera."""

import math
from collections.abc import Callable

import numpy as np

from docs.diagrams.base import BLUE, FAINT, GREEN, INK, OCHRE, PURPLE, SENSOR, VERMILLION, Point, Sheet

_COLOURS = (VERMILLION, OCHRE, GREEN, BLUE, PURPLE)


def _eye(sheet: Sheet, x: float, y: float, size: float = 0.16) -> None:
    """Draw who looks, from above, at a point."""
    sheet.dot((x, y), INK, 5.0)
    for angle in np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False):
        end = (x + 3.4 * size * math.cos(angle), y + 3.4 * size * math.sin(angle))
        sheet.line((x + size * math.cos(angle), y + size * math.sin(angle)), end, color=BLUE, width=0.9)


def plenoptic_function() -> Sheet:
    """Draw what each argument of the plenoptic function adds: directions, colours, times, places."""
    sheet = Sheet((0.0, 16.4), (-2.3, 1.9))
    names = (
        (r"$P(\theta, \varphi)$", "a grey snapshot\nof all directions"),
        (r"$P(\theta, \varphi, \lambda)$", "in colour"),
        (r"$P(\theta, \varphi, \lambda, t)$", "a film"),
        (r"$P(\theta, \varphi, \lambda, t, \mathbf{V})$", "a film from any\nplace: all there is"),
    )
    for number, (formula, words) in enumerate(names):
        middle = 2.0 + 4.1 * number
        sheet.text((middle, 1.55), formula, size=11)
        sheet.text((middle, -1.75), words)
        places = [(middle, 0.0)]
        if number == 3:
            places = [(middle + dx, dy) for dx, dy in ((-1.0, 0.6), (0.2, 0.5), (1.2, 0.7), (-0.5, -0.5), (0.9, -0.45))]
        for x, y in places:
            _rose(sheet, x, y, 1.0 if len(places) == 1 else 0.42, coloured=number > 0)
        if number == 2:
            for step in (-0.85, 0.85):
                _rose(sheet, middle + step, 0.0, 0.55, coloured=True)
            sheet.arrow((middle - 1.2, -1.15), (middle + 1.2, -1.15), FAINT, 1.0)
            sheet.text((middle + 1.4, -1.15), "$t$")
    return sheet


def _rose(sheet: Sheet, x: float, y: float, size: float, *, coloured: bool) -> None:
    """Draw the light that arrives at a point from all directions."""
    for number, angle in enumerate(np.linspace(0.0, 2.0 * math.pi, 15, endpoint=False)):
        color = _COLOURS[number % len(_COLOURS)] if coloured else FAINT
        far, near = size * (0.85 + 0.15 * math.cos(3.0 * angle)), 0.22 * size
        start = (x + far * math.cos(angle), y + far * math.sin(angle))
        sheet.arrow(start, (x + near * math.cos(angle), y + near * math.sin(angle)), color, 0.9)


def sampled_plenoptic_function() -> Sheet:
    """Draw a room from above in which light is recorded at points, all around each."""
    sheet = Sheet((0.0, 10.0), (0.0, 4.6))
    sheet.box((0.05, 0.05), (9.9, 4.5), "none", INK, linewidth=2.0)
    sheet.box((4.3, 1.9), (1.4, 0.8), GREEN)
    sheet.text((5.0, 2.3), "object", "white")
    for x in (1.2, 2.9, 7.1, 8.8):
        for y in (0.9, 2.3, 3.7):
            _eye(sheet, x, y)
    for y in (0.9, 3.7):
        _eye(sheet, 5.0, y)
    return sheet


def two_planes() -> Sheet:
    """Draw a ray by the points where it crosses two planes."""
    sheet = Sheet((-1.0, 11.0), (-0.6, 4.6))

    def project(x: float, y: float, z: float) -> Point:
        return x + 0.45 * z, y + 0.32 * z

    def plane(x: float, name: tuple[str, str], color: str) -> Callable[[float, float], Point]:
        corners = [project(x, y, z) for y, z in ((0.0, 0.0), (2.9, 0.0), (2.9, 3.0), (0.0, 3.0))]
        sheet.area(corners, color, 0.18)
        sheet.line(*corners, corners[0], color=color)
        for step in (1.0, 2.0):
            sheet.line(project(x, 0.0, step), project(x, 2.9, step), color=color, width=0.5)
            sheet.line(project(x, 2.9 * step / 3, 0.0), project(x, 2.9 * step / 3, 3.0), color=color, width=0.5)
        sheet.text(project(x, -0.3, 1.5), name[0], color)
        sheet.text(project(x - 0.3, 1.5, 0.0), name[1], color)
        return lambda y, z: project(x, y, z)

    near, far = plane(1.5, ("$u$", "$v$"), BLUE), plane(7.0, ("$s$", "$t$"), VERMILLION)
    start, end = near(1.1, 1.0), far(1.9, 1.7)
    slope = (end[1] - start[1]) / (end[0] - start[0])
    left, right = (-0.6, start[1] - slope * (start[0] + 0.6)), (10.6, end[1] + slope * (10.6 - end[0]))
    sheet.line(left, start, color=INK, dashed=True)
    sheet.ray(start, end, color=INK)
    sheet.line(end, right, color=INK, dashed=True)
    sheet.dot(start, BLUE)
    sheet.dot(end, VERMILLION)
    sheet.text((start[0] + 0.15, start[1] - 0.32), "$(u, v)$", BLUE)
    sheet.text((end[0] + 0.25, end[1] - 0.32), "$(s, t)$", VERMILLION)
    sheet.text((5.0, 0.15), "$L(u, v, s, t)$", size=13)
    return sheet


def _crossing(start: Point, end: Point, half: float) -> Point:
    """Find where the line from a point outside to one within a square about the origin enters it."""
    steps = [(end[i] - start[i]) for i in (0, 1)]
    parts = [(math.copysign(half, start[i]) - start[i]) / steps[i] for i in (0, 1) if abs(start[i]) > half]
    part = max(parts)
    return start[0] + part * steps[0], start[1] + part * steps[1]


def object_in_a_box() -> Sheet:
    """Draw an object in a box, from above, and what two eyes see of it by the light that leaves the box."""
    half, eyes = 1.5, ((-5.2, -1.3), (-1.2, -3.6))
    seen = (
        ((-0.55, 0.37), (-0.74, 0.07), (-0.68, -0.23), (-0.4, -0.46)),
        ((-0.7, -0.2), (-0.35, -0.48), (0.1, -0.54), (0.5, -0.41)),
    )
    sheet = Sheet((-6.4, 7.6), (-4.0, 2.2))
    sheet.box((-half, -half), (2 * half, 2 * half), "none", INK, linewidth=2.0)
    sheet.area([(0.75 * math.cos(t), 0.55 * math.sin(t)) for t in np.linspace(0.0, 2 * math.pi, 40)], GREEN, 0.8)
    sheet.text((0.0, 0.0), "object", "white")
    for eye, targets, color in zip(eyes, seen, (BLUE, VERMILLION), strict=True):
        for target in targets:
            on_box = _crossing(eye, target, half)
            sheet.line(target, on_box, color=FAINT, width=1.0, dashed=True)
            sheet.ray(on_box, eye, color=color, width=1.2)
            sheet.dot(on_box, color, 4.0)
        sheet.dot(eye, INK, 7.0)
    sheet.text((eyes[0][0], eyes[0][1] - 0.35), "one eye")
    sheet.text((eyes[1][0] - 0.9, eyes[1][1]), "another")
    sheet.text((2.2, 1.0), "known for each point of the box:", ha="left")
    sheet.text((2.2, 0.5), "how much light leaves it in each direction", ha="left")
    sheet.text((2.2, -0.3), "an eye needs one value of each point\nthat it sees: that of its own direction", ha="left")
    sheet.text((0.0, 1.85), "box")
    return sheet


def light_field_camera() -> Sheet:
    """Draw how each pixel behind a microlens sees the scene through its own part of the main lens."""
    focus, radius, lenslets, sensor = 6.0, 1.5, 3.0, 3.75
    sheet = Sheet((-7.2, 6.9), (-2.3, 2.2))
    sheet.axis(-7.0, lenslets)
    sheet.lens(0.0, radius, thickness=0.1)
    edges = np.linspace(-radius, radius, 6)
    for number, color in enumerate(_COLOURS):
        y = 0.5 * (edges[number] + edges[number + 1])
        behind = -y * (sensor - lenslets) / lenslets
        sheet.ray((-focus, 0.0), (0.0, y), (lenslets, 0.0), (sensor, behind), color=color)
        sheet.line((-0.02, edges[number] + 0.03), (-0.02, edges[number + 1] - 0.03), color=color, width=4.0, zorder=5)
    pitch = 2.0 * radius * (sensor - lenslets) / lenslets
    for step in (-2, -1, 0, 1, 2):
        sheet.lens(lenslets, 0.48 * pitch, step * pitch, thickness=0.22)
        for number, color in enumerate(reversed(_COLOURS)):
            corner = (sensor, (step - 0.5 + number / 5) * pitch)
            sheet.box(corner, (0.16, 0.17 * pitch), color if step == 0 else SENSOR, alpha=1.0 if step == 0 else 0.35)
    sheet.dot((-focus, 0.0), INK)
    for x, y, text in ((0.0, 2.0, "main lens: $u$"), (lenslets - 0.1, 2.0, "microlenses: $s$")):
        sheet.text((x, y), text)
    sheet.text((4.15, 0.0), "pixels: one for each\npart of the lens", ha="left")
    sheet.text((-focus, 0.35), "point in focus")
    return sheet


def refocusing() -> Sheet:
    """Draw why a place of a picture focused anew is seen at another place of each view."""
    lens, film, radius, alpha = 0.0, 4.0, 1.4, 0.72
    other = alpha * film
    sheet = Sheet((-0.9, 7.6), (-2.0, 2.1))
    for x, name, color in ((lens, "lens", BLUE), (other, "new film", VERMILLION), (film, "film", INK)):
        sheet.line((x, -1.6), (x, 1.6), color=color, width=2.0)
        sheet.text((x, 1.85), name, color)
    wanted = 0.55
    for u in (-radius, -0.5 * radius, 0.0, 0.5 * radius, radius):
        place = u + (wanted - u) / alpha
        sheet.ray((lens, u), (film, place), color=GREEN if u == 0.5 * radius else FAINT, width=1.0)
    u = 0.5 * radius
    sheet.dot((lens, u), BLUE)
    sheet.dot((film, u + (wanted - u) / alpha))
    sheet.dot((other, wanted), VERMILLION)
    sheet.text((lens - 0.3, u), "$u$", BLUE)
    sheet.text((other - 0.25, wanted + 0.3), "$s'$", VERMILLION)
    sheet.text((film + 0.25, u + (wanted - u) / alpha), "$s$")
    sheet.length((lens, -1.8), (other, -1.8), r"$\alpha F$", (0.0, 0.2))
    sheet.length((lens, -2.05), (film, -2.05), "$F$", (1.3, 0.2))
    sheet.text((5.9, 0.7), r"$s' = \alpha s + (1 - \alpha)\,u$", size=12)
    sheet.text((5.9, -0.1), r"$E(s', t') = \sum_u \sum_v L(u, v, s, t)$", size=12)
    return sheet


DIAGRAMS = {
    "plenoptic_function": plenoptic_function,
    "sampled_plenoptic_function": sampled_plenoptic_function,
    "two_planes": two_planes,
    "object_in_a_box": object_in_a_box,
    "light_field_camera": light_field_camera,
    "refocusing": refocusing,
}
