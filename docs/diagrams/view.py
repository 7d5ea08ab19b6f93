"""What a camera sees: inside it, through a pinhole, by focal length and by sensor."""

import math

from docs.diagrams.base import BLUE, FAINT, GREEN, INK, OCHRE, PURPLE, VERMILLION, Sheet
from raytracer.optics.sensor_formats import SENSORS
from raytracer.optics.thin_lens import crop_factor, field_of_view

FULL_FRAME_MM = (36.0, 24.0)


def inside_a_camera() -> Sheet:
    """Draw a camera's section: lens, opening, shutter and sensor in a dark box."""
    sheet = Sheet((-6.5, 6.0), (-2.9, 2.7))
    for corner, size in (((-1.0, 1.7), (5.0, 0.25)), ((-1.0, -1.95), (5.0, 0.25)), ((3.75, -1.95), (0.25, 3.9))):
        sheet.box(corner, size, FAINT)
    for y in (1.25, -1.5):
        sheet.box((-3.0, y), (2.2, 0.25), FAINT)
    for y in (1.25, -1.95):
        sheet.box((-1.0, y), (0.25, 0.7), FAINT)
    sheet.axis(-6.5, 3.4)
    sheet.lens(-2.4, 1.2)
    sheet.box((-1.6, 0.55), (0.12, 0.7), INK)
    sheet.box((-1.6, -1.25), (0.12, 0.7), INK)
    sheet.box((2.3, 0.4), (0.1, 1.3), INK)
    sheet.box((2.3, -1.7), (0.1, 1.3), INK)
    sheet.box((3.0, -1.1), (0.18, 2.2), VERMILLION)
    for height in (0.9, 0.0, -0.9):
        sheet.ray((-6.4, height), (-2.4, height), (3.0, 0.0), color=BLUE)
    for x, y, text in (
        (-2.4, 2.2, "lens"),
        (-1.5, -2.5, "aperture\nhow wide"),
        (2.35, -2.5, "shutter\nhow long"),
        (3.1, 2.25, "film or sensor\nhow sensitive (ISO)"),
        (-5.6, 1.5, "light of\nthe scene"),
    ):
        sheet.text((x, y), text)
    return sheet


def pinhole() -> Sheet:
    """Draw the inverted image of a pinhole camera, and the disc that its hole makes of a point."""
    far, film, hole, height = -6.0, 2.2, 0.36, 1.5
    sheet = Sheet((-6.8, 4.2), (-2.3, 2.2))
    sheet.axis(-6.6, film)
    sheet.arrow((far, 0.0), (far, height), color=GREEN, width=2.4)
    for sign in (1.0, -1.0):
        sheet.line((0.0, sign * 0.5 * hole), (0.0, sign * 1.9), width=2.6)
    sheet.box((film, -1.9), (0.15, 3.8))
    ends = [height + (0.5 * sign * hole - height) * (film - far) / -far for sign in (1.0, -1.0)]
    for sign, end in zip((1.0, -1.0), ends, strict=True):
        sheet.ray((far, height), (0.0, 0.5 * sign * hole), (film, end))
    sheet.ray((far, 0.0), (0.0, 0.0), (film, 0.0), color=BLUE)
    sheet.arrow((film, 0.0), (film, sum(ends) / 2), color=GREEN, width=2.4)
    sheet.length((film + 0.45, ends[0]), (film + 0.45, ends[1]), r"$d\,(1 + f / z)$", (0.95, 0.0))
    sheet.length((far, -1.6), (0.0, -1.6), "$z$", (0.0, 0.25))
    sheet.length((0.0, -1.6), (film, -1.6), "$f$", (0.0, 0.25))
    sheet.length((-0.25, -0.5 * hole), (-0.25, 0.5 * hole), "$d$", (-0.3, 0.0))
    sheet.text((far, height + 0.3), "object")
    sheet.text((0.0, 2.1), "pinhole")
    sheet.text((film + 0.1, 2.1), "film: upside down")
    return sheet


def view_by_focal_length() -> Sheet:
    """Draw one sensor behind lenses of three focal lengths, to scale, with the angles of view of its diagonal."""
    diagonal = math.hypot(*FULL_FRAME_MM)
    sheet = Sheet((-215.0, 270.0), (-70.0, 70.0), rows=3)
    for row, (focal_length, color) in enumerate(((17.0, VERMILLION), (50.0, BLUE), (200.0, GREEN))):
        sheet.use(row)
        angle = field_of_view(diagonal, focal_length)
        reach = min(200.0, 62.0 / math.tan(math.radians(angle / 2)))
        spread = reach * math.tan(math.radians(angle / 2))
        sheet.axis(-210.0, 230.0)
        sheet.area([(0.0, 0.0), (reach, spread), (reach, -spread)], color)
        for sign in (1.0, -1.0):
            sheet.line((-focal_length, -sign * diagonal / 2), (reach, sign * spread), color=color)
        sheet.box((-focal_length - 4.0, -diagonal / 2), (4.0, diagonal))
        sheet.lens(0.0, 17.0)
        sheet.length((-focal_length, -42.0), (0.0, -42.0), f"$f$ = {focal_length:g} mm", (0.0, -13.0))
        sheet.text((reach + 8.0, 0.0), f"{angle:.0f}°", color=color, size=13, ha="left")
    return sheet


def view_by_sensor() -> Sheet:
    """Draw three sensors behind one lens, with what each sees of it."""
    sheet = Sheet((-95.0, 190.0), (-62.0, 62.0))
    sheet.axis(-90.0, 170.0)
    kinds = (("full_frame", VERMILLION), ("aps_c", BLUE), ("1-inch", GREEN))
    for number, (name, color) in enumerate(kinds):
        diagonal, reach = math.hypot(*SENSORS[name]), 120.0
        angle = field_of_view(diagonal, 50.0)
        spread = reach * math.tan(math.radians(angle / 2))
        sheet.area([(0.0, 0.0), (reach, spread), (reach, -spread)], color, 0.12)
        for sign in (1.0, -1.0):
            sheet.line((-50.0, -sign * diagonal / 2), (reach, sign * spread), color=color)
        sheet.box((-53.0 - 3.0 * number, -diagonal / 2), (3.0, diagonal), color)
        label = f"{name.replace('_', ' ').replace('aps c', 'APS-C')}: {angle:.0f}°"
        sheet.text((reach + 4.0, spread), label, color=color, ha="left")
    sheet.lens(0.0, 22.0)
    sheet.length((-50.0, -40.0), (0.0, -40.0), "$f$ = 50 mm", (0.0, -8.0))
    return sheet


def nested_sensors() -> Sheet:
    """Draw the nine named sensors to scale, one in the other, with areas and crop factors."""
    sheet = Sheet((-1.0, 92.0), (-2.0, 42.5))
    colors = (VERMILLION, BLUE, GREEN, OCHRE, PURPLE)
    for number, (name, (width, height)) in enumerate(SENSORS.items()):
        color, y = colors[number % len(colors)], 40.2 - 4.6 * number
        sheet.box((0.0, 40.2 - height), (width, height), "none", color, linewidth=1.6)
        words = name.replace("_", " ").replace("aps ", "APS-").replace("APS-c", "APS-C").replace("APS-h", "APS-H")
        facts = f"{width:g} x {height:g} mm, {width * height / 100:.2f} cm², crop {crop_factor(width, height):.2f}"
        sheet.text((57.0, y - 0.8), words, color=color, ha="left")
        sheet.text((57.0, y - 2.7), facts, size=8.0, ha="left")
    return sheet


DIAGRAMS = {
    "inside_a_camera": inside_a_camera,
    "pinhole": pinhole,
    "view_by_focal_length": view_by_focal_length,
    "view_by_sensor": view_by_sensor,
    "nested_sensors": nested_sensors,
}
