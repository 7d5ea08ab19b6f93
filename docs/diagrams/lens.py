"""The thin lens: its rays, Gauss's equation, how a renderer samples it, and what is out of focus."""

from docs.diagrams.base import BLUE, GREEN, INK, OCHRE, PURPLE, VERMILLION, Point, Sheet
from raytracer.optics.thin_lens import circle_of_confusion, far_limit, image_distance, near_limit

_FOCAL_LENGTH, _OBJECT, _HEIGHT = 2.0, 5.0, 1.4

# Behind words that stand on lines.
PLAIN = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}


def _along(start: Point, through: Point, x: float) -> Point:
    """Return the point of a line at `x`."""
    return x, start[1] + (through[1] - start[1]) * (x - start[0]) / (through[0] - start[0])


def focal_point() -> Sheet:
    """Draw that parallel rays meet in the focal point, and rays from the focal point leave parallel."""
    sheet = Sheet((-4.0, 4.4), (-1.6, 1.6), rows=2)
    heights = (1.0, 0.5, 0.0, -0.5, -1.0)
    for row, side in enumerate((1.0, -1.0)):
        sheet.use(row)
        sheet.axis(-4.0, 4.0)
        sheet.lens(0.0, 1.3, thickness=0.13)
        focus = (side * _FOCAL_LENGTH, 0.0)
        for height in heights:
            if side > 0:
                end = _along((0.0, height), focus, 3.0)
                sheet.ray((-3.8, height), (0.0, height), end, color=BLUE)
            else:
                sheet.ray(focus, (0.0, height), (3.8, height), color=BLUE)
        sheet.dot(focus)
        sheet.text((focus[0], -0.3 if side < 0 else 0.42), "$F$" if side < 0 else "$F'$")
        ends = sorted((0.0, focus[0]))
        sheet.length((ends[0], -1.4), (ends[1], -1.4), "$f$", (0.0, 0.2))
    return sheet


def three_rays() -> Sheet:
    """Draw an object, its image, and the three rays that find it."""
    sheet = Sheet((-5.8, 5.0), (-2.0, 2.2))
    image = image_distance(_FOCAL_LENGTH, _OBJECT)
    small = -_HEIGHT * image / _OBJECT
    tip, end = (-_OBJECT, _HEIGHT), (image, small)
    sheet.axis(-5.6, 4.6)
    sheet.lens(0.0, 1.9, thickness=0.1)
    sheet.arrow((-_OBJECT, 0.0), tip, color=GREEN, width=2.4)
    sheet.arrow((image, 0.0), end, color=GREEN, width=2.4)
    sheet.ray(tip, (0.0, _HEIGHT), end, color=VERMILLION)
    sheet.ray(tip, end, color=BLUE)
    sheet.ray(tip, (0.0, small), end, color=OCHRE)
    for x, name in ((-_FOCAL_LENGTH, "$F$"), (_FOCAL_LENGTH, "$F'$")):
        sheet.dot((x, 0.0))
        sheet.text((x, 0.28 if x > 0 else -0.28), name)
    sheet.text((-2.6, _HEIGHT + 0.2), "parallel to the axis: through $F'$", VERMILLION)
    sheet.text((1.0, 1.0), "through the middle: straight on", BLUE, ha="left")
    sheet.text((0.3, small - 0.25), "through $F$: parallel to the axis", OCHRE, ha="left")
    sheet.text((-_OBJECT, -0.25), "object")
    sheet.text((image + 0.55, small / 2), "image")
    return sheet


def gauss() -> Sheet:
    """Draw the two pairs of similar triangles from which Gauss's equation follows."""
    sheet = Sheet((-5.8, 5.2), (-1.9, 1.9), rows=2)
    image = image_distance(_FOCAL_LENGTH, _OBJECT)
    small = -_HEIGHT * image / _OBJECT
    tip, end, foot = (-_OBJECT, _HEIGHT), (image, small), (image, 0.0)
    for row in range(2):
        sheet.use(row)
        if row == 0:
            sheet.area([tip, (-_OBJECT, 0.0), (0.0, 0.0)], BLUE, 0.25)
            sheet.area([end, foot, (0.0, 0.0)], BLUE, 0.25)
            sheet.line(tip, end, color=BLUE)
            sheet.text((4.35, 1.2), r"$h_i / h_o = z_i / z_o$", BLUE, size=12)
        else:
            focus = (_FOCAL_LENGTH, 0.0)
            sheet.area([(0.0, _HEIGHT), (0.0, 0.0), focus], VERMILLION, 0.25)
            sheet.area([end, foot, focus], VERMILLION, 0.25)
            sheet.line(tip, (0.0, _HEIGHT), end, color=VERMILLION)
            sheet.text((4.3, 1.2), r"$h_i / h_o = (z_i - f) / f$", VERMILLION, size=12)
            sheet.dot(focus)
            sheet.text((_FOCAL_LENGTH, 0.28), "$F'$")
            sheet.length((0.0, -0.75), (_FOCAL_LENGTH, -0.75), "$f$", (0.0, -0.25))
        sheet.axis(-5.6, 4.6)
        sheet.lens(0.0, 1.75, thickness=0.07)
        sheet.arrow((-_OBJECT, 0.0), tip, color=GREEN, width=2.4)
        sheet.arrow(foot, end, color=GREEN, width=2.4)
        sheet.text((-_OBJECT - 0.35, _HEIGHT / 2), "$h_o$")
        sheet.text((image + 0.35, small / 2), "$h_i$")
        sheet.length((-_OBJECT, -1.5), (0.0, -1.5), "$z_o$", (0.0, 0.25))
        sheet.length((0.0, -1.5), (image, -1.5), "$z_i$", (0.0, 0.25))
    return sheet


def sampling_a_lens() -> Sheet:
    """Draw the rays of one pixel of a pinhole and of a thin lens."""
    focus, film, size = -5.0, 2.0, 0.55
    sheet = Sheet((-7.6, 3.2), (-1.75, 1.9), rows=2)
    pixel = (film, -size)
    meeting = _along(pixel, (0.0, 0.0), focus)
    for row in range(2):
        sheet.use(row)
        sheet.axis(-7.4, film)
        sheet.box((film, -1.2), (0.12, 2.4))
        if row == 0:
            for sign in (1.0, -1.0):
                sheet.line((0.0, sign * 0.06), (0.0, sign * 1.3), width=2.6)
            sheet.ray(pixel, _along(pixel, (0.0, 0.0), -7.2))
            sheet.text((0.0, 1.6), "pinhole: one ray for a pixel")
        else:
            sheet.lens(0.0, 1.3, thickness=0.09)
            sheet.line((focus, -1.5), (focus, 1.75), color=GREEN, dashed=True)
            for height in (1.05, 0.55, 0.0, -0.55, -1.05):
                on_lens = (0.0, height)
                sheet.ray(pixel, on_lens, _along(on_lens, meeting, -7.2), width=1.0)
            sheet.dot(meeting)
            sheet.text((focus + 0.2, meeting[1] + 0.42), "$x'''$", ha="left")
            sheet.text((0.3, 1.3), "$x''$", size=11)
            sheet.text((-1.7, 1.65), "thin lens: through random points of it")
            sheet.text((focus + 0.1, -1.6), "plane of focus", GREEN, ha="left")
        sheet.dot(pixel)
        sheet.text((film + 0.4, -size), "$x'$")
        sheet.text((film + 0.06, 1.4), "film")
    return sheet


def circle_of_confusion_diagram() -> Sheet:
    """Draw the disc that a point nearer than the plane of focus makes on the film."""
    focal_length, focus, subject, radius = 2.0, 7.0, 4.2, 1.3
    film, image = image_distance(focal_length, focus), image_distance(focal_length, subject)
    sheet = Sheet((-7.6, 5.8), (-2.3, 2.1))
    sheet.axis(-7.4, 5.0)
    sheet.lens(0.0, radius, thickness=0.12)
    for sign in (1.0, -1.0):
        sheet.line((-focus, 0.0), (0.0, sign * radius), (film, 0.0), color=BLUE, width=0.9, dashed=True)
        sheet.ray((-subject, 0.0), (0.0, sign * radius), (image, 0.0))
    sheet.line((film, -1.6), (film, 1.6), width=2.4)
    half = circle_of_confusion(2 * radius, film, focus, subject) / 2
    sheet.line((film, -half), (film, half), color=VERMILLION, width=5.0)
    sheet.length((film + 0.25, -half), (film + 0.25, half), "$C$", (0.28, 0.28), VERMILLION)
    for x, name, color, y in (
        (-focus, "in focus", BLUE, 0.35),
        (-subject, "nearer", VERMILLION, 0.35),
        (film, "film", INK, 1.8),
    ):
        if name != "film":
            sheet.dot((x, 0.0), color)
        sheet.text((x, y), name, color)
    sheet.length((-0.35, -radius), (-0.35, radius), "$A$", (-0.3, 0.45))
    sheet.length((0.0, -1.85), (film, -1.85), "$z_s$", (0.0, 0.25))
    sheet.length((0.0, -2.2), (image, -2.2), "$z_i$", (1.75, 0.2))
    sheet.dot((image, 0.0), VERMILLION)
    sheet.text((4.9, 1.2), r"$\frac{C}{A} = \frac{|z_s - z_i|}{z_i}$", size=15)
    return sheet


def depth_of_field() -> Sheet:
    """Draw the near and the far limit, whose points make discs of the allowed circle on the film."""
    focal_length, focus, radius, circle = 1.6, 5.0, 0.8, 0.16
    film = image_distance(focal_length, focus)
    f_number = focal_length / (2 * radius)
    near = near_limit(focal_length, f_number, circle, focus)
    far = far_limit(focal_length, f_number, circle, focus)
    sheet = Sheet((-8.2, 4.3), (-2.0, 1.7))
    sheet.area([(-far, -1.2), (-near, -1.2), (-near, 1.2), (-far, 1.2)], GREEN, 0.15)
    sheet.axis(-8.0, 4.0)
    sheet.lens(0.0, radius, thickness=0.14)
    for subject, color in ((far, BLUE), (near, VERMILLION)):
        end = image_distance(focal_length, subject)
        for sign in (1.0, -1.0):
            stop = _along((0.0, sign * radius), (end, 0.0), max(end, film))
            sheet.line((-subject, 0.0), (0.0, sign * radius), stop, color=color, width=1.0)
        sheet.line((-subject, -1.2), (-subject, 1.2), color=color, dashed=True)
        sheet.dot((-subject, 0.0), color)
    sheet.line((-focus, -1.2), (-focus, 1.2), color=INK, dashed=True)
    sheet.line((film, -1.0), (film, 1.0), width=2.0)
    sheet.length((film + 0.35, -circle / 2), (film + 0.35, circle / 2), "$c$", (0.3, 0.0))
    sheet.text((film, 1.25), "film")
    sheet.text((-far, 1.45), "far limit", BLUE)
    sheet.text((-focus, -1.0), "focus", bbox=PLAIN)
    sheet.text((-near, 1.45), "near limit", VERMILLION)
    sheet.length((-near, -1.35), (0.0, -1.35), "$D_N$", (0.0, 0.22))
    sheet.length((-far, -1.75), (0.0, -1.75), "$D_F$", (0.6, 0.22))
    sheet.length((-far, -1.35), (-near, -1.35), "depth of field", (0.0, -0.2), GREEN)
    return sheet


def depth_of_focus() -> Sheet:
    """Draw how far the film may stand before and behind the image of a point."""
    image, radius, circle = 4.6, 1.3, 0.42
    # Similar triangles: the circle is to the opening as the distance to the image is to that of the image.
    side = image * circle / (2.0 * radius)
    sheet = Sheet((-3.0, 8.2), (-2.35, 2.0))
    sheet.axis(-2.8, image + side)
    sheet.area([(0.0, radius), (0.0, -radius), (image, 0.0)], BLUE, 0.16)
    sheet.area([(image, 0.0), (image + side, circle / 2), (image + side, -circle / 2)], VERMILLION, 0.5)
    sheet.area([(image, 0.0), (image - side, circle / 2), (image - side, -circle / 2)], VERMILLION, 0.5)
    sheet.lens(0.0, radius, thickness=0.12)
    for sign in (1.0, -1.0):
        end = _along((0.0, sign * radius), (image, 0.0), 6.4)
        sheet.ray((-2.8, sign * radius), (0.0, sign * radius), end, color=BLUE, width=1.0)
        place = image + sign * side
        sheet.line((place, -1.2), (place, 1.2), color=VERMILLION, dashed=True)
    sheet.line((image, -1.2), (image, 1.2), width=2.0)
    sheet.length((image + side + 0.28, -circle / 2), (image + side + 0.28, circle / 2), "$c$", (0.3, 0.0), VERMILLION)
    sheet.length((-0.4, -radius), (-0.4, radius), "$A$", (-0.3, 0.0))
    sheet.length((0.0, -1.75), (image, -1.75), "$z_i$", (0.0, 0.22))
    sheet.length((image - side, 1.4), (image + side, 1.4), "$t$: the film may be here", (0.0, 0.25), VERMILLION)
    sheet.length((image, -1.45), (image + side, -1.45), "$t / 2$", (0.0, -0.28), VERMILLION)
    sheet.text((7.3, -0.9), r"$\frac{t / 2}{c} = \frac{z_i}{A}$", size=15)
    return sheet


def f_numbers() -> Sheet:
    """Draw three lenses with their focal lengths and diameters to scale."""
    sheet = Sheet((-70.0, 570.0), (-75.0, 75.0), rows=3)
    for row, (length, diameter, color) in enumerate(((100, 50, BLUE), (200, 100, VERMILLION), (400, 100, PURPLE))):
        sheet.use(row)
        sheet.axis(-60.0, 430.0)
        sheet.area([(0.0, diameter / 2), (length, 0.0), (0.0, -diameter / 2)], color)
        sheet.lens(0.0, diameter / 2, thickness=0.14)
        sheet.line((length, -22.0), (length, 22.0), width=2.4)
        sheet.length((-24.0, -diameter / 2), (-24.0, diameter / 2), f"{diameter}", (-20.0, 0.0))
        sheet.length((0.0, -62.0), (length, -62.0), f"{length} mm", (0.0, 13.0))
        sheet.text((430.0, 22.0), f"{length} / {diameter} = f/{length / diameter:g}", color, size=12, ha="left")
    return sheet


DIAGRAMS = {
    "focal_point": focal_point,
    "three_rays": three_rays,
    "gauss": gauss,
    "sampling_a_lens": sampling_a_lens,
    "circle_of_confusion": circle_of_confusion_diagram,
    "depth_of_field": depth_of_field,
    "depth_of_focus": depth_of_focus,
    "f_numbers": f_numbers,
}
