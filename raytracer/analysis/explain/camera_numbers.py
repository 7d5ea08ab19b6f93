"""A scene's camera and objects in numbers: field of view, depth of field, exposure, and motion in the picture."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.core.motion.trajectory import compose, row_at
from raytracer.core.vec import Vec3
from raytracer.film.film import Film
from raytracer.optics.thin_lens import (
    circle_of_confusion,
    far_limit,
    focal_length_from_distances,
    hyperfocal,
    near_limit,
)
from raytracer.plugins.cameras.base.interface import camera_defocus, project
from raytracer.plugins.cameras.base.moving import MovingCamera
from raytracer.scene.object_bounds import ObjectBounds
from raytracer.scene.pack.autofocus import mid_exposure_time
from raytracer.scene.spec import SceneSpec
from raytracer.schema.units import METRES_PER_MILLIMETRE, parse_quantity
from raytracer.util.errors import InputError, format_value

SHARP = 1.0 / 1500.0
"""Circle of confusion that counts as sharp, as a fraction of the sensor's diagonal: Ray 2002, sec. 22.2."""

# Straight parts that a curved way is divided into.
_PARTS = 64

# Upper bound of the roundings of a coordinate from the scene to the film.
_ROUNDINGS = 64


class Circle(NamedTuple):
    """Largest blur that counts as sharp, the circle of confusion.

    unit : "mm" on the film, or "px".
    """

    size: float
    unit: str


def parse_circle(text: str) -> Circle:
    """Parse a circle of confusion as `--circle` takes it, `0.03 mm` or `2 px`; raise an InputError if it is none."""
    pixels = text.strip().removesuffix("px")
    in_pixels = pixels != text.strip()
    try:
        size = parse_quantity(pixels if in_pixels else text, "number" if in_pixels else "optic")
    except ValueError:
        size = math.nan
    if not 0.0 < size < math.inf:
        raise InputError(
            f"'--circle': must be a length on the film or in pixels, 0.03 mm or 2 px, got {format_value(text)}"
        )
    return Circle(size, "px" if in_pixels else "mm")


class CameraView:
    """A scene's camera, packed for a picture of some size.

    shift : added to the scene's coordinates to get the packed camera's (m).
    """

    def __init__(self, spec: SceneSpec, packed: Any, shift: Vec3 = (0.0, 0.0, 0.0)) -> None:
        self.spec = spec
        self._shift = np.array(shift)
        self._packed = packed
        self._is_still = not isinstance(packed, MovingCamera)
        self._still_camera = packed if self._is_still else packed.camera
        self._defocus = camera_defocus(self._still_camera)
        self.numbers = spec.camera.describe(spec.film.width, spec.film.height)
        self._timing = spec.camera.timing()
        self._middle = mid_exposure_time(spec)

    def blur(self, depth: float) -> float:
        """Compute the diameter of the blur (px) of a point at a distance along the axis (m); NaN without a lens."""
        if self._defocus is None:
            return math.nan
        if self.pupil() == 0.0:
            return 0.0
        return circle_of_confusion(self.pupil(), 1.0 / self.pixel(), self.focus(), depth)

    def pupil(self) -> float:
        """Return the diameter of the opening that blurs (m), of a lens of glass its entrance pupil; 0 without one."""
        return 0.0 if self._defocus is None else self._defocus.diameter

    def focus(self) -> float:
        """Return the distance of the plane of focus (m); behind the camera, and negative, for a pinhole with a size."""
        inverse = 0.0 if self._defocus is None else self._defocus.inverse_focus
        return 1.0 / inverse if inverse != 0.0 else math.inf

    def pixel(self) -> float:
        """Return the edge of a pixel's image at a distance of 1; of a lens of glass, near the axis."""
        return math.nan if self._defocus is None else self._defocus.pixel

    def millimetres(self, pixels: float) -> float:
        """Convert a length on the film to mm; NaN if the film has no size."""
        return 1e-3 * self.numbers.get("pixel_pitch_um", math.nan) * pixels

    def project(self, point: NDArray[np.float64], time: float) -> tuple[float, float, float]:
        """Project a point at a time of the scene (s): film position (px) and depth (m)."""
        point = point + self._shift
        if not self._is_still:
            # Move the point to where the camera at rest would see it alike.
            opening = self.spec.camera.shutter_interval()
            passed = (time - opening.open) / (opening.close - opening.open)
            pose = compose(row_at(self._packed.trajectories.rows, passed))
            point = np.linalg.solve(pose, [*point, 1.0])[:3]
        x, y, depth = project(self._still_camera, tuple(map(float, point)), None)
        return float(x), float(y), float(depth)

    def object_numbers(self, where: ObjectBounds, number: int) -> dict[str, float]:
        """Compute the known numbers of an object in the middle of the exposure."""
        x, y, depth = self.project(where.center(number, self._middle), self._middle)
        numbers = {"distance_m": depth, "x_px": x, "y_px": y}
        if depth > 0.0:
            blur = self.blur(depth)
            numbers |= {"circle_of_confusion_mm": self.millimetres(blur), "circle_of_confusion_px": blur}
        if not self._is_still or where.moves(number):
            numbers |= self._motion(where, number)
        return {name: value for name, value in numbers.items() if not math.isnan(value)}

    def _motion(self, where: ObjectBounds, number: int) -> dict[str, float]:
        """Measure the way of an object in the picture: of its middle, and of its fastest corner."""
        motion = self.spec.objects[number].motion
        straight = self._is_still and motion is not None and motion.spin is None and motion.keyframes is None
        half = 0.5 * self._timing.seconds()
        times = np.linspace(self._middle - half, self._middle + half, 2 if straight else _PARTS + 1).tolist()
        numbers = {"streak_px": self._length([where.center(number, time) for time in times], times)}
        if not straight:
            corners = zip(*(where.corners(number, time) for time in times), strict=True)
            numbers["corner_streak_px"] = max(self._length(way, times) for way in corners)
        # The skew of a turning object is no single number: it bends.
        if self._timing.readout > 0.0 and (motion is None or motion.spin is None):
            numbers |= self._skew(where, number)
        return numbers

    def _length(self, way: Sequence[NDArray[np.float64]], times: Sequence[float]) -> float:
        """Measure the way of a point (m) in the picture (px); NaN if it is not always before the camera."""
        places = [self.project(point, time)[:2] for point, time in zip(way, times, strict=True)]
        rounding = 2.0 * self._rounding(way[0], times[0])
        if all(math.dist(places[0], place) <= rounding for place in places):
            return 0.0
        return math.fsum(math.dist(a, b) for a, b in pairwise(places))

    def _rounding(self, point: NDArray[np.float64], time: float) -> float:
        """Bound the rounding error of the projection of a point (px), within which motion counts as none.

        n roundings of relative size u change a number by a part of at most n u / (1 - n u): Higham 2002, "Accuracy and
        Stability of Numerical Algorithms", 2nd ed., lemma 3.1.
        """
        roundings = _ROUNDINGS * 0.5 * np.finfo(np.float64).eps
        part = roundings / (1.0 - roundings)
        camera: Any = self.spec.camera
        error = part * max(map(abs, (*point, *camera.look_from)))
        place = self.project(point, time)[:2]
        shifts = [self.project(point + shift, time)[:2] for shift in error * np.eye(3)]
        return part * math.hypot(*place) + math.fsum(math.dist(place, shifted) for shifted in shifts)

    def _skew(self, where: ObjectBounds, number: int) -> dict[str, float]:
        """Measure the shift of the end of the picture against its beginning, by a rolling shutter."""
        half = 0.5 * self._timing.readout
        times = (self._middle - half, self._middle + half)
        points = [where.center(number, time) for time in times]
        begin, end = (self.project(point, time) for point, time in zip(points, times, strict=True))
        across = self._timing.direction in ("up", "down")
        lines = self.spec.film.height if across else self.spec.film.width
        skew = abs(end[0] - begin[0] if across else end[1] - begin[1])
        if skew <= 2.0 * self._rounding(points[0], times[0]):
            skew = 0.0
        return {"skew_px": skew, "skew_deg": math.degrees(math.atan(skew / lines))}


def depth_of_field(view: CameraView, circle: Circle | None) -> dict[str, float]:
    """Compute the limits of what is sharp; without a size of the film, those that follow from angles alone."""
    film, pitch = view.spec.film, view.numbers.get("pixel_pitch_um")
    if circle is not None and circle.unit == "mm" and pitch is None:
        raise InputError(
            "'--circle': a length needs a film that has a size, by the camera's sensor or focal length: give pixels"
        )
    if view.pupil() == 0.0 or view.focus() < 0.0:
        return {}
    if circle is None:
        sensor = [view.numbers.get(f"sensor_{side}_mm", math.nan) for side in ("width", "height")]
        diagonal = math.hypot(film.width, film.height) if pitch is None else math.hypot(*sensor)
        circle = Circle(SHARP * diagonal, "px" if pitch is None else "mm")
    pixels = circle.size if circle.unit == "px" else circle.size / view.millimetres(1.0)

    # Sharpness depends on angles alone, so any image distance serves where the film has no size.
    image, focus = METRES_PER_MILLIMETRE * view.numbers.get("image_distance_mm", 1e3), view.focus()
    focal_length, size = focal_length_from_distances(image, focus), image * view.pixel() * pixels
    f_number = focal_length / view.pupil()
    near, far = (limit(focal_length, f_number, size, focus) for limit in (near_limit, far_limit))
    numbers = {"circle_px": pixels, "near_limit_m": near, "far_limit_m": far, "depth_of_field_m": far - near}
    if pitch is None:
        return numbers
    return numbers | {
        "circle_mm": size / METRES_PER_MILLIMETRE,
        "hyperfocal_m": hyperfocal(focal_length, f_number, size),
    }


def multi_view_size(spec: SceneSpec) -> dict[str, float]:
    """Compute the size of a picture that is made of many views, and the memory of its film."""
    width, height = spec.picture()
    if (width, height) == (spec.film.width, spec.film.height):
        return {}
    film = Film.empty(1, 1, is_clamped=spec.render.clamp is not None)
    pixel = sum(array.nbytes for array in vars(film).values() if array is not None)
    return {
        "view_width_px": float(spec.film.width),
        "view_height_px": float(spec.film.height),
        "picture_width_px": float(width),
        "picture_height_px": float(height),
        "film_gigabytes": pixel * width * height / 1e9,
    }


def exposure(spec: SceneSpec) -> dict[str, float]:
    """Return the shutter's numbers, and the speed."""
    timing = spec.camera.timing()
    numbers = {"shutter_s": timing.seconds(), "readout_s": timing.readout, "iso": spec.camera.iso_speed()}
    return {name: number for name, number in numbers.items() if number}
