"""A scene's camera and objects in numbers: what it sees, what is sharp, and how far things go in the picture."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.interface import defocus_of, project
from raytracer.cameras.moving import MovingCamera
from raytracer.errors import InputError, shown
from raytracer.film.film import Film
from raytracer.motion import compose, row_at
from raytracer.photography import circle_of_confusion, far_limit, focal_length_of, hyperfocal, near_limit
from raytracer.scene.focus import middle_of
from raytracer.scene.spec import SceneSpec
from raytracer.scene.whereabouts import Whereabouts
from raytracer.units import METRES_PER_MILLIMETRE, parse_quantity
from raytracer.vec import Vec3

SHARP = 1.0 / 1500.0
"""Circle of confusion that is called sharp, as a fraction of the sensor's diagonal: Ray 2002, sec. 22.2."""

# Straight parts of the way of what turns.
_PARTS = 64

# More roundings than a coordinate meets on its way from the scene to the film.
_ROUNDINGS = 64

_GIGABYTE = 1e9


class Circle(NamedTuple):
    """The largest blur that counts as sharp; `unit` is mm on the film, or px."""

    size: float
    unit: str


def parse_circle(text: str) -> Circle:
    """A circle of confusion as `--circle` takes it: `0.03 mm`, `2 px`.

    Raises
    ------
    InputError : it is neither, or not greater than 0.
    """
    pixels = text.strip().removesuffix("px")
    in_pixels = pixels != text.strip()
    try:
        size = parse_quantity(pixels if in_pixels else text, "number" if in_pixels else "optic")
    except ValueError:
        size = math.nan
    if not 0.0 < size < math.inf:
        raise InputError(f"'--circle': must be a length on the film or in pixels, 0.03 mm or 2 px, got {shown(text)}")
    return Circle(size, "px" if in_pixels else "mm")


class View:
    """A scene's camera, as it was packed for a picture of some size.

    shift : what is added to the scene's coordinates to get the packed camera's (m).
    """

    def __init__(self, spec: SceneSpec, packed: Any, shift: Vec3 = (0.0, 0.0, 0.0)) -> None:
        self.spec = spec
        self._shift = np.array(shift)
        self._packed = packed
        self._rests = not isinstance(packed, MovingCamera)
        self._resting = packed if self._rests else packed.camera
        self._defocus = defocus_of(self._resting)
        self.numbers = spec.camera.describe(spec.film.width, spec.film.height)
        self._timing = spec.camera.timing()
        self._middle = middle_of(spec)

    def blur(self, depth: float) -> float:
        """Diameter of the blur of a point at a distance along the axis (m), in pixels; NaN where there is no lens."""
        if self._defocus is None:
            return math.nan
        if self.pupil() == 0.0:
            return 0.0
        return circle_of_confusion(self.pupil(), 1.0 / self.pixel(), self.focus(), depth)

    def pupil(self) -> float:
        """Diameter of the opening that blurs (m), of a lens of glass its entrance pupil; 0 for a point, or none."""
        return 0.0 if self._defocus is None else self._defocus.diameter

    def focus(self) -> float:
        """Distance of the plane of focus (m); behind the camera, and negative, for a mere hole."""
        inverse = 0.0 if self._defocus is None else self._defocus.inverse_focus
        return 1.0 / inverse if inverse != 0.0 else math.inf

    def pixel(self) -> float:
        """Edge of a pixel's image at a distance of 1; of a lens of glass, near the axis."""
        return math.nan if self._defocus is None else self._defocus.pixel

    def millimetres(self, pixels: float) -> float:
        """A length on the film (mm); NaN if it has no size."""
        return 1e-3 * self.numbers.get("pixel_pitch_um", math.nan) * pixels

    def place(self, point: NDArray[np.float64], time: float) -> tuple[float, float, float]:
        """Where a point is seen at a time of the scene (s): film position in pixels, and its depth (m)."""
        point = point + self._shift
        if not self._rests:
            # Bring the point to where the camera, if it rested, would see it as it does.
            opening = self.spec.camera.opening()
            passed = (time - opening.open) / (opening.close - opening.open)
            pose = compose(row_at(self._packed.trajectories.rows, passed))
            point = np.linalg.solve(pose, [*point, 1.0])[:3]
        x, y, depth = project(self._resting, tuple(map(float, point)), None)
        return float(x), float(y), float(depth)

    def object(self, where: Whereabouts, number: int) -> dict[str, float]:
        """The numbers of an object, as it is in the middle of the exposure; those that there are."""
        x, y, depth = self.place(where.center(number, self._middle), self._middle)
        numbers = {"distance_m": depth, "x_px": x, "y_px": y}
        if depth > 0.0:
            blur = self.blur(depth)
            numbers |= {"circle_of_confusion_mm": self.millimetres(blur), "circle_of_confusion_px": blur}
        if not self._rests or where.moves(number):
            numbers |= self._motion(where, number)
        return {name: value for name, value in numbers.items() if not math.isnan(value)}

    def _motion(self, where: Whereabouts, number: int) -> dict[str, float]:
        """How far an object goes in the picture: its middle, and the corner of its box that goes farthest."""
        motion = self.spec.objects[number].motion
        straight = self._rests and motion is not None and motion.spin is None and motion.keyframes is None
        half = 0.5 * self._timing.seconds()
        times = np.linspace(self._middle - half, self._middle + half, 2 if straight else _PARTS + 1).tolist()
        numbers = {"streak_px": self._length([where.center(number, time) for time in times], times)}
        if not straight:
            corners = zip(*(where.corners(number, time) for time in times), strict=True)
            numbers["corner_streak_px"] = max(self._length(way, times) for way in corners)
        # What turns does not lean but bends, which no one number tells.
        if self._timing.readout > 0.0 and (motion is None or motion.spin is None):
            numbers |= self._skew(where, number)
        return numbers

    def _length(self, way: Sequence[NDArray[np.float64]], times: Sequence[float]) -> float:
        """Length in pixels of the way of a point (m) in the picture; NaN if it is not always before the camera."""
        places = [self.place(point, time)[:2] for point, time in zip(way, times, strict=True)]
        rounding = 2.0 * self._rounding(way[0], times[0])
        if all(math.dist(places[0], place) <= rounding for place in places):
            return 0.0
        return math.fsum(math.dist(a, b) for a, b in pairwise(places))

    def _rounding(self, point: NDArray[np.float64], time: float) -> float:
        """By how much rounding may be off where a point is seen (px): what stays within this does not move.

        n roundings of relative size u change a number by a part of at most n u / (1 - n u): Higham 2002, "Accuracy and
        Stability of Numerical Algorithms", 2nd ed., lemma 3.1.
        """
        roundings = _ROUNDINGS * 0.5 * np.finfo(np.float64).eps
        part = roundings / (1.0 - roundings)
        camera: Any = self.spec.camera
        error = part * max(map(abs, (*point, *camera.look_from)))
        place = self.place(point, time)[:2]
        shifts = [self.place(point + shift, time)[:2] for shift in error * np.eye(3)]
        return part * math.hypot(*place) + math.fsum(math.dist(place, shifted) for shifted in shifts)

    def _skew(self, where: Whereabouts, number: int) -> dict[str, float]:
        """How far a rolling shutter shifts the end of the picture against its beginning, across the readout."""
        half = 0.5 * self._timing.readout
        times = (self._middle - half, self._middle + half)
        points = [where.center(number, time) for time in times]
        begin, end = (self.place(point, time) for point, time in zip(points, times, strict=True))
        across = self._timing.direction in ("up", "down")
        lines = self.spec.film.height if across else self.spec.film.width
        skew = abs(end[0] - begin[0] if across else end[1] - begin[1])
        if skew <= 2.0 * self._rounding(points[0], times[0]):
            skew = 0.0
        return {"skew_px": skew, "skew_deg": math.degrees(math.atan(skew / lines))}


def depth_of_field(view: View, circle: Circle | None) -> dict[str, float]:
    """The limits of what is sharp; without a size of the film, those that follow from angles alone."""
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

    # What is sharp is a matter of angles, so any distance of the film will do where it has none.
    image, focus = METRES_PER_MILLIMETRE * view.numbers.get("image_distance_mm", 1e3), view.focus()
    focal_length, size = focal_length_of(image, focus), image * view.pixel() * pixels
    f_number = focal_length / view.pupil()
    near, far = (limit(focal_length, f_number, size, focus) for limit in (near_limit, far_limit))
    numbers = {"circle_px": pixels, "near_limit_m": near, "far_limit_m": far, "depth_of_field_m": far - near}
    if pitch is None:
        return numbers
    return numbers | {
        "circle_mm": size / METRES_PER_MILLIMETRE,
        "hyperfocal_m": hyperfocal(focal_length, f_number, size),
    }


def of_views(spec: SceneSpec) -> dict[str, float]:
    """The size of a picture that is made of many views, and the memory that its film takes."""
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
        "film_gigabytes": pixel * width * height / _GIGABYTE,
    }


def exposure(spec: SceneSpec) -> dict[str, float]:
    """The shutter's numbers, and the speed."""
    timing, numbers = spec.camera.timing(), {}
    if timing.seconds() > 0.0:
        numbers["shutter_s"] = timing.seconds()
    if timing.readout > 0.0:
        numbers["readout_s"] = timing.readout
    speed = spec.camera.speed()
    if speed is not None:
        numbers["iso"] = speed
    return numbers
