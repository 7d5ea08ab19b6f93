"""What a scene makes the program do: its effects, each with a reason, and its camera and objects in numbers."""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.interface import project
from raytracer.cameras.moving import MovingCamera
from raytracer.cameras.perspective import PerspectiveCamera
from raytracer.errors import InputError, shown
from raytracer.motion import compose, row_at
from raytracer.photography import circle_of_confusion, far_limit, focal_length_of, hyperfocal, near_limit
from raytracer.scene.effects import Effect, effects_of
from raytracer.scene.focus import middle_of
from raytracer.scene.objects import Assets
from raytracer.scene.pack import pack
from raytracer.scene.spec import SceneSpec
from raytracer.scene.whereabouts import Whereabouts, label
from raytracer.units import parse_quantity

SHARP = 1.0 / 1500.0
"""Circle of confusion that is called sharp, as a fraction of the sensor's diagonal: Ray 2002, sec. 22.2."""

_SLOWEST_LENS = 0.5
"""The least f-number of a lens in air that is free of coma: 1 / (2 sin 90 deg), Born & Wolf 1999, sec. 4.8.2."""

# Straight parts of the way of what turns.
_PARTS = 64

# Moving objects without a name that the text lists; `--json` has them all.
_MOST_LISTED = 8

_COLUMNS_OF_TEXT = 100


@dataclass(frozen=True)
class Explanation:
    """What is simulated and what not; and numbers, by names that end in their units, infinite ones included.

    kind, of the camera; camera, its numbers; objects, those of each object that has a name or moves; warnings, one
    sentence for each thing in which the picture will differ from what the camera would take.
    """

    effects: dict[str, Effect]
    kind: str
    camera: dict[str, float]
    objects: dict[str, dict[str, float]]
    warnings: list[str]

    def json(self) -> dict[str, Any]:
        """For `--json`; infinity, which JSON lacks, becomes the text "inf"."""
        return {
            "effects": {name: effect._asdict() for name, effect in self.effects.items()},
            "camera": _finite(self.camera),
            "objects": {name: _finite(numbers) for name, numbers in self.objects.items()},
            "warnings": self.warnings,
        }

    def text(self) -> str:
        """As a person reads it."""
        width = max(map(len, self.effects))
        effects = [
            f"{heading}\n" + "".join(f"  {name:<{width}}  {effect.why}\n" for name, effect in group)
            for heading, group in (
                ("Simulated", [item for item in self.effects.items() if item[1].active]),
                ("Left out", [item for item in self.effects.items() if not item[1].active]),
            )
        ]
        warnings = "".join(f"  {sentence}\n" for sentence in map(_wrapped, self.warnings))
        parts = [*effects, _camera_text(self.kind, self.camera), _objects_text(self.objects)]
        return "\n".join(part for part in [*parts, f"Warnings\n{warnings}" if warnings else ""] if part)


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


def explain(spec: SceneSpec, *, circle: Circle | None = None) -> Explanation:
    """Explain a checked scene.

    Parameters
    ----------
    circle : the blur at which the depth of field ends; 1/1500 of the diagonal of the sensor, or without one of the
        picture, if None.

    Raises
    ------
    SceneError : the scene cannot be packed.
    InputError : a circle in mm for a camera whose film has no size.
    """
    assets = Assets(spec)
    packed = pack(spec, assets=assets)
    spec, scene = packed.spec, packed.scene
    view = _View(spec, scene.camera)
    where = Whereabouts(spec, assets)
    numbers = view.numbers | _depth_of_field(view, circle) | _timing(spec)
    objects = {label(spec, number): view.object(where, number) for number in _explained(spec, where)}
    effects = effects_of(spec, scene)
    return Explanation(effects, spec.camera.type, numbers, objects, _warnings(spec, view, numbers))


def _explained(spec: SceneSpec, where: Whereabouts) -> list[int]:
    """The objects that have a name, or move."""
    return [number for number, item in enumerate(spec.objects) if item.name is not None or where.moves(number)]


# ---- Numbers


class _View:
    """A scene's camera, as it was packed for a picture of some size."""

    def __init__(self, spec: SceneSpec, packed: Any) -> None:
        self.spec = spec
        self._packed = packed
        self._rests = not isinstance(packed, MovingCamera)
        self._resting = packed if self._rests else packed.camera
        self.numbers = spec.camera.describe(spec.film.width, spec.film.height)
        self._timing = spec.camera.timing()
        self._middle = middle_of(spec)

    def blur(self, depth: float) -> float:
        """Diameter of the blur of a point at a distance along the axis (m), in pixels; NaN where there is no lens."""
        if not isinstance(self._resting, PerspectiveCamera):
            return math.nan
        if self.pupil() == 0.0:
            return 0.0
        return circle_of_confusion(self.pupil(), 1.0 / self.pixel(), self.focus(), depth)

    def pupil(self) -> float:
        """Diameter of the opening that blurs (m); 0 for a point, or where there is none."""
        lens = getattr(self._resting, "lens", None)
        return 0.0 if lens is None else 2.0 * float(lens.radius)

    def focus(self) -> float:
        """Distance of the plane of focus (m); behind the camera, and negative, for a mere hole."""
        inverse = self._resting.lens.inverse_focus
        return 1.0 / inverse if inverse != 0.0 else math.inf

    def pixel(self) -> float:
        """Edge of a pixel's image at a distance of 1."""
        return float(self._resting.plane.pixel)

    def millimetres(self, pixels: float) -> float:
        """A length on the film (mm); NaN if it has no size."""
        return 1e-3 * self.numbers.get("pixel_pitch_um", math.nan) * pixels

    def place(self, point: NDArray[np.float64], time: float) -> tuple[float, float, float]:
        """Where a point is seen at a time of the scene (s): film position in pixels, and its depth (m)."""
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
        return math.fsum(math.dist(a, b) for a, b in pairwise(places))

    def _skew(self, where: Whereabouts, number: int) -> dict[str, float]:
        """How far a rolling shutter shifts the end of the picture against its beginning, across the readout."""
        half = 0.5 * self._timing.readout
        begin, end = (
            self.place(where.center(number, time), time) for time in (self._middle - half, self._middle + half)
        )
        across = self._timing.direction in ("up", "down")
        lines = self.spec.film.height if across else self.spec.film.width
        skew = abs(end[0] - begin[0] if across else end[1] - begin[1])
        return {"skew_px": skew, "skew_deg": math.degrees(math.atan(skew / lines))}


def _depth_of_field(view: _View, circle: Circle | None) -> dict[str, float]:
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
    image, focus = 1e-3 * view.numbers.get("image_distance_mm", 1e3), view.focus()
    focal_length, size = focal_length_of(image, focus), image * view.pixel() * pixels
    f_number = focal_length / view.pupil()
    near, far = (limit(focal_length, f_number, size, focus) for limit in (near_limit, far_limit))
    numbers = {"circle_px": pixels, "near_limit_m": near, "far_limit_m": far, "depth_of_field_m": far - near}
    if pitch is None:
        return numbers
    return numbers | {"circle_mm": 1e3 * size, "hyperfocal_m": hyperfocal(focal_length, f_number, size)}


def _timing(spec: SceneSpec) -> dict[str, float]:
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


def _warnings(spec: SceneSpec, view: _View, numbers: Mapping[str, float]) -> list[str]:
    """In what the picture will differ from that of such a camera."""
    sentences = []
    airy, pitch, f_number = (numbers.get(name, math.nan) for name in ("airy_disc_um", "pixel_pitch_um", "f_number"))
    if airy > pitch:
        sentences.append(
            f"diffraction is left out: at f/{f_number:.4g} the Airy disc of green light (550 nm) is "
            f"{_number(airy)} um wide, and a pixel {_number(pitch)} um, so a real picture would be softer"
        )
    if f_number < _SLOWEST_LENS:
        sentences.append(
            f"f/{f_number:.4g} is faster than f/0.5, which no lens in air can be: the ideal lens has no such limit"
        )
    if view.pupil() == 0.0 and math.isfinite(f_number):
        sentences.append(
            f"the aperture of f/{f_number:.4g} sets the exposure but blurs nothing, since a {spec.camera.type} camera "
            "sees through a point"
        )
    return sentences


# ---- Text


class _Line(NamedTuple):
    """How a number is shown: its name in the results, and in words; and its unit."""

    key: str
    words: str
    unit: str = ""


_GROUPS = {
    "Field of view": (
        _Line("hfov_deg", "horizontal", "deg"),
        _Line("vfov_deg", "vertical", "deg"),
        _Line("dfov_deg", "diagonal", "deg"),
        _Line("fov_deg", "across the circle", "deg"),
        _Line("pixel_at_1m_mm", "a pixel at 1 m", "mm"),
    ),
    "Sensor": (
        _Line("sensor_width_mm", "width", "mm"),
        _Line("sensor_height_mm", "height", "mm"),
        _Line("film_width_mm", "width in the picture", "mm"),
        _Line("film_height_mm", "height in the picture", "mm"),
        _Line("pixel_pitch_um", "pixel pitch", "um"),
        _Line("crop_factor", "crop factor"),
        _Line("iso", "ISO speed"),
    ),
    "Lens": (
        _Line("focal_length_mm", "focal length", "mm"),
        _Line("equivalent_focal_length_mm", "equivalent on 36 x 24 mm", "mm"),
        _Line("f_number", "f-number"),
        _Line("entrance_pupil_mm", "entrance pupil", "mm"),
        _Line("aperture_diameter_mm", "diameter of the lens", "mm"),
        _Line("airy_disc_um", "Airy disc (550 nm)", "um"),
    ),
    "Focus": (
        _Line("focus_distance_m", "focus distance", "m"),
        _Line("image_distance_mm", "image distance", "mm"),
        _Line("magnification", "magnification"),
        _Line("circle_mm", "sharp up to a circle of", "mm"),
        _Line("circle_px", "sharp up to a circle of", "px"),
        _Line("near_limit_m", "near limit", "m"),
        _Line("far_limit_m", "far limit", "m"),
        _Line("depth_of_field_m", "depth of field", "m"),
        _Line("hyperfocal_m", "hyperfocal distance", "m"),
        _Line("blur_at_infinity_px", "blur at infinity", "px"),
    ),
    "Exposure": (
        _Line("shutter_s", "shutter", "s"),
        _Line("readout_s", "readout", "s"),
        _Line("ev100", "EV100"),
    ),
}

_COLUMNS = (
    _Line("distance_m", "distance", "m"),
    _Line("circle_of_confusion_mm", "blur", "mm"),
    _Line("circle_of_confusion_px", "blur", "px"),
    _Line("streak_px", "streak", "px"),
    _Line("corner_streak_px", "corner's streak", "px"),
    _Line("skew_px", "skew", "px"),
    _Line("skew_deg", "skew", "deg"),
)


def _finite(numbers: Mapping[str, float]) -> dict[str, float | str]:
    return {name: "inf" if math.isinf(value) else value for name, value in numbers.items()}


def _number(value: float) -> str:
    """Four digits, without an exponent where that is not longer."""
    if math.isinf(value):
        return "infinity"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.3e}"
    return np.format_float_positional(float(f"{value:.4g}"), trim="-")


def _quantity(value: float, line: _Line) -> str:
    """A number with its unit; short times as photographers write them."""
    if line.key == "f_number":
        return f"f/{_number(value)}" if math.isfinite(value) else "infinity"
    if line.unit == "s" and 0.0 < value < 0.5 and math.isclose(1.0 / value, round(1.0 / value), rel_tol=1e-9):
        return f"1/{round(1.0 / value)} s"
    return f"{_number(value)} {line.unit}".rstrip() if math.isfinite(value) else _number(value)


def _camera_text(kind: str, camera: Mapping[str, float]) -> str:
    """The camera's numbers in groups; those that no group knows come last, by their names."""
    if "entrance_pupil_mm" in camera:
        camera = {name: value for name, value in camera.items() if name != "aperture_diameter_mm"}
    known = {line.key for lines in _GROUPS.values() for line in lines}
    rest = tuple(_Line(name, name) for name in camera if name not in known)
    shown_lines = {
        heading: [line for line in lines if line.key in camera]
        for heading, lines in {**_GROUPS, "Further numbers": rest}.items()
    }
    width = max((len(line.words) for lines in shown_lines.values() for line in lines), default=0)
    groups = [
        "".join(
            [f"  {heading}\n", *(f"    {line.words:<{width}}  {_quantity(camera[line.key], line)}\n" for line in lines)]
        )
        for heading, lines in shown_lines.items()
        if lines
    ]
    return f"Camera: {kind}\n" + "".join(groups)


def _objects_text(objects: Mapping[str, Mapping[str, float]]) -> str:
    """A table, a row an object, of the columns that any object has."""
    if not objects:
        return ""
    rows, left_out = _chosen(objects)
    columns = [column for column in _COLUMNS if any(column.key in numbers for numbers in rows.values())]
    cells = [["object", *(f"{column.words} ({column.unit})" for column in columns)]]
    cells += [[name, *(_cell(numbers, column) for column in columns)] for name, numbers in rows.items()]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  " + "  ".join(_justified(row, widths)).rstrip() for row in cells]
    if left_out:
        lines.append(f"  and {left_out} more that move, which --json lists")
    return "Objects in the middle of the exposure; their blur is the circle of confusion\n" + "\n".join(lines) + "\n"


def _chosen(objects: Mapping[str, Mapping[str, float]]) -> tuple[dict[str, Mapping[str, float]], int]:
    """The objects with names, and those without that go farthest; and how many are left out."""
    unnamed = [name for name in objects if name.startswith("objects[")]
    farthest = sorted(unnamed, key=lambda name: -objects[name].get("streak_px", 0.0))[_MOST_LISTED:]
    return {name: numbers for name, numbers in objects.items() if name not in set(farthest)}, len(farthest)


def _wrapped(sentence: str) -> str:
    return "\n    ".join(textwrap.wrap(sentence, _COLUMNS_OF_TEXT))


def _cell(numbers: Mapping[str, float], column: _Line) -> str:
    return _number(numbers[column.key]) if column.key in numbers else "-"


def _justified(row: Sequence[str], widths: Iterable[int]) -> list[str]:
    """Names to the left, numbers to the right."""
    name, *numbers = row
    first, *others = widths
    return [f"{name:<{first}}", *(f"{number:>{width}}" for number, width in zip(numbers, others, strict=True))]
