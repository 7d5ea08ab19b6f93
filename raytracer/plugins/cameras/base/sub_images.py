"""Sub-images behind microlenses: their lattice, the rays that their pixels see, and what they resolve."""

import math

from raytracer.film.light_field.lattice import Lattice
from raytracer.film.light_field.lenslets import Lenslets
from raytracer.film.light_field.views import Pose, Views
from raytracer.plugins.cameras.base.microlenses import Arrangement, MainLens, Microlenses
from raytracer.plugins.cameras.base.placement import CameraFrame
from raytracer.schema.units import METRES_PER_MILLIMETRE

_ROW = math.sqrt(3.0) / 2.0
"""Distance of the rows of a hexagonal lattice, over the distance of neighbours in a row."""


def make_lenslets(
    lenses: Microlenses, array: Arrangement, main: MainLens, frame: CameraFrame, plane_of_focus: float
) -> Lenslets:
    """Lay out the sub-images of a camera whose plane of focus is at a distance (m)."""
    pixel, sharp = METRES_PER_MILLIMETRE * main.film.height / main.height, 1.0 / plane_of_focus
    # The plane that the microlenses see: by 1/F = 1/f - 1/z, turned to the side of the scene by the pupils' sizes.
    moved = (1.0 / main.image - 1.0 / array.image) / METRES_PER_MILLIMETRE
    return Lenslets(
        lattice=_make_lattice(lenses, array, main),
        width=main.width,
        height=main.height,
        middle=(0.5 * main.width, 0.5 * main.height),
        slope=pixel / (METRES_PER_MILLIMETRE * array.image * array.magnification),
        stride=pixel * array.image / array.distance,
        inverse_distance=sharp + moved * main.pupil / main.image,
        inverse_focus=sharp,
        aperture=METRES_PER_MILLIMETRE * main.diameter,
        focal_length=main.focal_length,
        pose=Pose(frame.origin, frame.right, frame.up, frame.forward),
        blur=_blur_on_main_lens(lenses, array),
    )


def _blur_on_main_lens(lenses: Microlenses, array: Arrangement) -> float:
    """Return the shift on the main lens of the point that a pixel sees, by the shift on the microlens (m/px)."""
    # For microlenses that are sharp on the main lens the blur would be rounding.
    is_sharp = lenses.arrangement == "plenoptic" and None in (lenses.focal_length, lenses.distance)
    if is_sharp or lenses.model == "pinhole":
        return 0.0
    return METRES_PER_MILLIMETRE * array.pitch / array.spacing * array.blur


def _make_lattice(lenses: Microlenses, array: Arrangement, main: MainLens) -> Lattice:
    """Make the lattice of the middles of the sub-images: of an integer size in pixels they fit between the edges."""
    width, height, spacing = main.width, main.height, array.spacing
    turn = math.radians(lenses.rotation)
    cosine, sine = spacing * math.cos(turn), spacing * math.sin(turn)
    along, down = (cosine, -sine), (sine, cosine)
    x, y = 0.5 * width, 0.5 * height
    if lenses.pitch is None and lenses.layout == "square":
        # Sub-images from edge to edge of pixels, those that are left over on both sides.
        x, y = (_first_center(size, spacing) for size in (width, height))
    shift = array.magnification * height / main.film.height
    origin = (x + shift * lenses.offset[0], y - shift * lenses.offset[1])
    if lenses.layout == "square":
        return Lattice(origin, along, down)
    return Lattice(origin, along, (0.5 * along[0] + _ROW * down[0], 0.5 * along[1] + _ROW * down[1]))


def _first_center(size: int, spacing: float) -> float:
    """Return the middle of the first sub-image between two edges, with as many pixels left over on both sides."""
    return math.floor(0.5 * (size - math.floor(size / spacing) * spacing)) + 0.5 * spacing


def microlens_solid_angle(lenses: Microlenses, array: Arrangement) -> float:
    """Return the solid angle in which a pixel sees its microlens: its area over the square of its distance."""
    area = array.pitch * array.pitch * (_ROW if lenses.layout == "hexagonal" else 1.0)
    return area / (array.distance * array.distance)


def describe_resolution(array: Arrangement, layout: Lenslets, views: Views) -> dict[str, float]:
    """Return numbers of the places and directions that microlenses resolve, by name with unit."""
    numbers = {
        "microlens_pitch_um": 1e3 * array.pitch,
        "sub_image_px": array.spacing,
        "view_columns": float(views.columns),
        "view_rows": float(views.rows),
        "view_width_px": float(views.width),
        "view_height_px": float(views.height),
    }
    return numbers | ({"seen_by_microlenses": layout.overlap} if layout.is_focused else {})
