"""Maps between a lens's picture and the one that an ideal projection would give, and OpenCV's models of them.

A point of the scene is where its chief ray lands.  Ideal is the rectilinear projection, x = f tan(angle), as of a
pinhole; or, of lenses that see too wide for it, the equidistant one, f angle.  f is that of the middle of the picture,
so that both agree there.  Points on the film are millimetres from its middle, x to the right and y down in the picture;
pixels are as OpenCV has them: whole numbers in their middles.

References: OpenCV 4, "Camera Calibration and 3D Reconstruction" and "Fisheye camera model"; Brown 1966, "Decentering
Distortion of Lenses"; Kannala, Brandt 2006, "A Generic Camera Model and Calibration Method for Conventional,
Wide-Angle, and Fish-Eye Lenses".
"""

import io
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.lens_report.analysis import chief
from raytracer.lens_report.analysis.bench import Bench, landing, out_to_scene, unit
from raytracer.lens_report.analysis.study import plain
from raytracer.lenses.surfaces import part, trace_rays

Array = NDArray[np.float64]
Ideal = Literal["rectilinear", "equidistant"]

# Half the field (degrees) from which on an equidistant picture is the ideal one, and up to which a pinhole has a model.
_WIDE = 65.0
_WIDEST_PINHOLE = 80.0

# Knots of the tables: their cubics and quintics are then off by less than a nanometre.
_KNOTS = 401
_KNOTS_ACROSS = 33

# How far outside the film light is followed, as a part of half its diagonal: what an ideal picture asks for.
_BEYOND = 1.3

_ROUNDS = 40

# Steps of Newton's method end when they are this part of what they look for: a few roundings of it.
_SETTLED = 1e-13

# What has not come this near to its goal, as a part of the film, has none; and by as much places may lie outside.
_MISSED = 1e-9

# How far from a right angle (radians) a slope still has a tangent that is worth drawing, and the least field to fit.
_GRAZING = 1e-6

# Rows of a map that are made at a time, since what they pass through takes many times their room.
_BAND = 64

_FITTED = 41
_FINE_PX = 0.1
_PLAINEST = ("pinhole", "fisheye", "rational")


class Grid(NamedTuple):
    """Pixels: how many, and how large (mm)."""

    width: int
    height: int
    pitch: float

    @property
    def centre(self) -> tuple[float, float]:
        """The middle of the picture (pixels)."""
        return 0.5 * (self.width - 1), 0.5 * (self.height - 1)

    def points(self, first: int = 0, last: int | None = None) -> Array:
        """The middles of all pixels (mm), (height, width, 2), or of the rows from `first` to before `last`."""
        cx, cy = self.centre
        rows = np.arange(first, self.height if last is None else min(last, self.height))
        x, y = np.meshgrid(np.arange(self.width) - cx, rows - cy)
        return self.pitch * np.stack([x, y], axis=-1)

    def pixels(self, points: Array) -> Array:
        """Points of the film (mm) as pixels."""
        return np.asarray(points / self.pitch + np.array(self.centre))


class Model(NamedTuple):
    """A model of OpenCV's.

    name : "pinhole" (k1, k2, p1, p2, k3), "rational" (k1, k2, p1, p2, k3, k4, k5, k6) or "fisheye" (k1 ... k4).
    rms_px, largest_px : how far from the traced chief rays it puts points of the film.
    """

    name: str
    coefficients: Array
    rms_px: float
    largest_px: float


@dataclass(frozen=True)
class Distortion:
    """What a lens does to places in the picture.

    scale : f in x and in y (mm).
    grid : pixels of the film.
    ideal : which projection it is against.
    models : those that fit, the one to be taken first; `missing` says why others are not there.
    """

    name: str
    setting: Mapping[str, Any]
    scale: tuple[float, float]
    grid: Grid
    ideal: Ideal
    models: tuple[Model, ...]
    missing: Mapping[str, str]
    _table: "_Table"

    def undistorted(self, points: Array) -> Array:
        """Where the ideal picture has what lands at points of the film (mm, (..., 2)); NaN where nothing does."""
        return self._table.ideal(np.asarray(points, np.float64))

    def distorted(self, points: Array) -> Array:
        """Where on the film lands what the ideal picture has at points (mm, (..., 2)); NaN where there is nothing."""
        return self._table.real(np.asarray(points, np.float64))

    def camera_matrix(self) -> Array:
        """OpenCV's, (3, 3), in pixels."""
        (fx, fy), (cx, cy) = self.scale, self.grid.centre
        return np.array([[fx / self.grid.pitch, 0.0, cx], [0.0, fy / self.grid.pitch, cy], [0.0, 0.0, 1.0]])

    def maps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """In pixels, (height, width, 2): what `cv2.remap` takes to undo the distortion, and what it takes to make it.

        The first says for each pixel of the ideal picture where the lens's has it, the second the other way round.
        """
        grid = self.grid
        there = np.empty((grid.height, grid.width, 2), np.float32)
        back = np.empty_like(there)
        for first in range(0, grid.height, _BAND):
            points = grid.points(first, first + _BAND)
            there[first : first + _BAND] = grid.pixels(self.distorted(points))
            back[first : first + _BAND] = grid.pixels(self.undistorted(points))
        return there, back

    def largest_px(self) -> float:
        """How far a point of the film is at most from where the ideal projection has it (pixels)."""
        edge = _fitted_points(self.grid)
        moved = np.linalg.norm(self.undistorted(edge) - edge, axis=-1) / self.grid.pitch
        return float(np.nanmax(moved)) if np.isfinite(moved).any() else math.nan


# ---- From traced rays


class _Table(NamedTuple):
    """Points of the film to ideal points and back, in millimetres."""

    ideal: Callable[[Array], Array]
    real: Callable[[Array], Array]


def distortion(bench: Bench, width: int, *, ideal: Ideal | None = None) -> Distortion:
    """Trace what a lens on the bench does to places in the picture, and fit OpenCV's models to it.

    Parameters
    ----------
    width : pixels across the film.
    ideal : the projection to compare with; by default the rectilinear one, up to 65 degrees from the axis.

    Raises
    ------
    ValueError : no chief ray reaches the film.
    """
    across, down = bench.settings.sensor_mm
    pitch = across / width
    grid = Grid(width, max(1, round(down / pitch)), pitch)
    tangents, scale, widest = (_round if bench.lens.is_round() else _skew)(bench)
    chosen: Ideal = ideal or ("rectilinear" if widest < _WIDE else "equidistant")
    table = tangents(chosen)
    models, missing = _models(table, tangents, chosen, scale, grid, widest)
    settings = bench.settings
    setting = {
        "f_number": settings.f_number,
        "focus_distance_mm": settings.focus_distance_mm,
        "sensor_mm": settings.sensor_mm,
        "wavelength_nm": bench.primary,
    }
    return Distortion(bench.lens.name, setting, scale, grid, chosen, models, missing, table)


_Found = tuple[Callable[[Ideal], _Table], tuple[float, float], float]


def _projected(angle: Array, ideal: Ideal) -> Array:
    """An ideal projection of angles (radians), of f = 1; NaN where there is none."""
    if ideal == "equidistant":
        return angle
    return np.where(np.abs(angle) < 0.5 * math.pi - _GRAZING, np.tan(angle), np.nan)


def _round(bench: Bench) -> _Found:
    """By the distance from the axis alone."""
    from scipy.interpolate import CubicSpline

    nm = bench.primary
    rows = chief.table(bench, "y", nm)
    half = 0.5 * math.hypot(*bench.settings.sensor_mm)
    reach = min(_BEYOND * half, float(rows.height[-1]))
    if not reach > 0.0:
        raise ValueError("no chief ray of the lens reaches the film")
    heights = np.linspace(0.0, reach, _KNOTS)
    angles = np.radians(chief.of_heights(bench, "y", nm, heights).field_deg)
    lit = np.isfinite(angles)
    lit[0] = True
    angles[0] = 0.0
    count = int(np.argmin(lit)) if not lit.all() else _KNOTS
    heights, angles = heights[:count], angles[:count]
    if count < 4:
        raise ValueError("no chief ray of the lens reaches the film")

    def odd(values: Array) -> Any:
        return CubicSpline(np.concatenate([-heights[:0:-1], heights]), np.concatenate([-values[:0:-1], values]))

    scale = float(1.0 / odd(angles)(0.0, 1))
    widest = math.degrees(float(np.interp(half, heights, angles)))

    def table(ideal: Ideal) -> _Table:
        values = scale * _projected(angles, ideal)
        there = int(np.argmin(np.isfinite(values))) if not np.isfinite(values).all() else len(values)
        known, wanted = heights[:there], values[:there]
        spline = CubicSpline(np.concatenate([-known[:0:-1], known]), np.concatenate([-wanted[:0:-1], wanted]))

        def forth(points: Array) -> Array:
            r = np.linalg.norm(points, axis=-1)
            return _along(points, r, np.where(r <= known[-1], spline(r), np.nan))

        def back(points: Array) -> Array:
            q = np.linalg.norm(points, axis=-1)
            r = np.interp(q, wanted, known, right=np.nan)
            for _ in range(_ROUNDS):
                step = (spline(r) - q) / spline(r, 1)
                r = r - step
                if not np.nanmax(np.abs(step), initial=0.0) > 10.0 * _SETTLED * known[-1]:
                    break
            return _along(points, q, r)

        return _Table(forth, back)

    return table, (scale, scale), widest


def _along(points: Array, lengths: Array, wanted: Array) -> Array:
    """Points moved along their direction from the middle, to other lengths."""
    ratio = np.divide(wanted, lengths, out=np.ones_like(lengths), where=lengths > 0.0)
    return points * ratio[..., None]


def _skew(bench: Bench) -> _Found:
    """By both coordinates, for lenses with cylinders, which have two planes of symmetry."""
    from scipy.interpolate import RectBivariateSpline

    across, down = (0.5 * size for size in bench.settings.sensor_mm)
    reach = np.array([across, down]) * 1.1
    xs, ys = (np.linspace(0.0, r, _KNOTS_ACROSS) for r in reach)
    wanted = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)

    # Find the directions at the stop by Newton's method, from the middle's linear ones.
    small = 1e-4
    start, _ = _from_stop(bench, np.array([[small, 0.0], [0.0, small]]))
    slope = np.array([start[0, 0], start[1, 1]]) / small
    tangents = wanted / slope
    for _ in range(_ROUNDS):
        landed, _ = _from_stop(bench, tangents)
        columns = [(_from_stop(bench, tangents + small * axis)[0] - landed) / small for axis in np.eye(2)]
        jacobian = np.stack(columns, axis=-1)
        missed = landed - wanted
        good = np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(missed).all(axis=1)
        step = np.zeros_like(tangents)
        step[good] = np.linalg.solve(jacobian[good], missed[good][..., None])[..., 0]
        tangents = tangents - step
        if np.abs(step).max() < _SETTLED:
            break
    landed, out = _from_stop(bench, tangents)
    if not np.isfinite(landed).all():
        raise ValueError("chief rays of the lens do not reach all of the film: choose a smaller sensor")
    shape = (_KNOTS_ACROSS, _KNOTS_ACROSS)
    axial = out[:, :2] / -out[:, 2:]
    axial_small = _from_stop(bench, np.array([[small, 0.0], [0.0, small]]))
    scale = tuple(float(axial_small[0][n, n] / (axial_small[1][n, n] / -axial_small[1][n, 2])) for n in (0, 1))
    angles = np.arctan(np.linalg.norm(axial, axis=1))
    widest = math.degrees(float(angles.max()))

    def table(ideal: Ideal) -> _Table:
        lengths = np.linalg.norm(axial, axis=1)
        ratio = np.divide(_projected(angles, ideal), lengths, out=np.ones_like(lengths), where=lengths > 0.0)
        values = axial * ratio[:, None] * np.array(scale)
        x, y = (values[:, n].reshape(shape) for n in (0, 1))
        knots = [np.concatenate([-k[:0:-1], k]) for k in (xs, ys)]
        # x is odd in x and even in y.
        wide = [_mirrored(x, -1.0, 1.0), _mirrored(y, 1.0, -1.0)]
        splines = [RectBivariateSpline(*knots, part, kx=5, ky=5, s=0.0) for part in wide]

        def forth(points: Array) -> Array:
            found = np.stack([spline.ev(points[..., 0], points[..., 1]) for spline in splines], axis=-1)
            outside = (np.abs(points) > reach * (1.0 + _MISSED)).any(axis=-1)
            found[outside] = np.nan
            return found

        def back(points: Array) -> Array:
            at = np.clip(points, -reach, reach)
            for _ in range(_ROUNDS):
                value = np.stack([spline.ev(at[..., 0], at[..., 1]) for spline in splines], axis=-1)
                rows = [
                    np.stack([spline.ev(at[..., 0], at[..., 1], dx, 1 - dx) for dx in (1, 0)], axis=-1)
                    for spline in splines
                ]
                step = np.linalg.solve(np.stack(rows, axis=-2), (value - points)[..., None])[..., 0]
                moved = np.clip(at - step, -reach, reach)
                still = np.abs(moved - at).max(initial=0.0) < _SETTLED * reach.max()
                at = moved
                if still:
                    break
            missed = np.linalg.norm(forth(at) - points, axis=-1)
            at[~(missed < _MISSED * reach.max())] = np.nan
            return at

        return _Table(forth, back)

    return table, (scale[0], scale[1]), widest


def _mirrored(values: Array, first: float, second: float) -> Array:
    """A quadrant's values (k, k) in all four, times a sign where the first or second coordinate changes its own."""
    tall = np.concatenate([first * values[:0:-1], values], axis=0)
    return np.concatenate([second * tall[:, :0:-1], tall], axis=1)


def _from_stop(bench: Bench, tangents: Array) -> tuple[Array, Array]:
    """Where chief rays land on the film (n, 2), upright, and the directions to their points of the scene (n, 3).

    tangents : x / z and y / z of their directions at the middle of the stop, (n, 2), upright.
    """
    surfaces, stop = bench.wide(), bench.stop
    onward = unit(np.column_stack([-tangents, np.ones(len(tangents))]))
    centre = np.broadcast_to((0.0, 0.0, float(surfaces.vertex[stop])), onward.shape)
    entered, origin, out = out_to_scene(surfaces, stop, centre, -onward)
    left, points, directions = trace_rays(part(surfaces, stop, len(surfaces.curvature)), centre, onward)
    landed = -landing(points, directions, left, bench.film)
    if not math.isinf(bench.distance):
        out = chief.object_points(bench, origin, out) - np.array([0.0, 0.0, bench.pupil])
    lost = (entered <= 0.0) | ~np.isfinite(landed).all(axis=1)
    landed[lost] = np.nan
    return landed, np.where(lost[:, None], np.nan, out)


# ---- OpenCV's models


def pinhole(coefficients: Array, points: Array) -> Array:
    """OpenCV's distortion of points x / z, y / z (..., 2), by k1, k2, p1, p2, k3[, k4, k5, k6]."""
    k1, k2, p1, p2, k3, k4, k5, k6 = np.concatenate([coefficients, np.zeros(8 - len(coefficients))])
    x, y = points[..., 0], points[..., 1]
    s = x * x + y * y
    radial = (1.0 + s * (k1 + s * (k2 + s * k3))) / (1.0 + s * (k4 + s * (k5 + s * k6)))
    across = x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x)
    down = y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([across, down], axis=-1)


def fisheye(coefficients: Array, angles: Array) -> Array:
    """OpenCV's distances from the middle, of f = 1, of angles (radians), by k1 to k4."""
    k1, k2, k3, k4 = coefficients
    s = angles * angles
    return np.asarray(angles * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))))


def _fitted_points(grid: Grid) -> Array:
    """Points that are spread evenly over the film up to its corners (mm), (n, 2)."""
    half = 0.5 * grid.pitch * np.array([grid.width, grid.height])
    x, y = np.meshgrid(*(np.linspace(-h, h, _FITTED) for h in half))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def _models(
    table: _Table,
    tables: Callable[[Ideal], _Table],
    chosen: Ideal,
    scale: tuple[float, float],
    grid: Grid,
    widest: float,
) -> tuple[tuple[Model, ...], dict[str, str]]:
    points = _fitted_points(grid)
    seen = (table if chosen == "equidistant" else tables("equidistant")).ideal(points) / np.array(scale)
    lit = np.isfinite(seen).all(axis=1)
    points, seen = points[lit], seen[lit]
    angles = np.linalg.norm(seen, axis=1)
    focal = np.array(scale) / grid.pitch
    real = points / np.array(scale)

    found: dict[str, Model] = {}
    missing: dict[str, str] = {}
    radius = max(float(angles.max()), _GRAZING)
    found["fisheye"] = _fit("fisheye", 4, (0, 1, 2, 3), radius, lambda k: _ray(seen, fisheye(k, angles)), real, focal)
    if widest > _WIDEST_PINHOLE:
        why = f"the lens sees {widest:.1f}° from the axis, and a pinhole's model ends before 90°"
        missing |= {"pinhole": why, "rational": why}
    else:
        tangent = _ray(seen, np.tan(angles))
        radius = math.tan(radius)
        found["pinhole"] = _fit("pinhole", 5, (0, 1, 4), radius, lambda k: pinhole(k, tangent), real, focal)
        found["rational"] = _fit("rational", 8, (0, 1, 4, 5, 6, 7), radius, lambda k: pinhole(k, tangent), real, focal)

    # The plainest model that will do, or is about as good as the best.
    least = min(model.rms_px for model in found.values())
    plainest = sorted(found.values(), key=lambda model: _PLAINEST.index(model.name))
    first = next(model for model in plainest if model.largest_px <= _FINE_PX or model.rms_px <= 1.1 * least)
    return (first, *(model for model in found.values() if model is not first)), missing


def _ray(seen: Array, lengths: Array) -> Array:
    """Points in the directions of `seen` from the middle, at other distances."""
    return _along(seen, np.linalg.norm(seen, axis=-1), lengths)


def _fit(
    name: str,
    count: int,
    free: tuple[int, ...],
    radius: float,
    model: Callable[[Array], Array],
    wanted: Array,
    focal: Array,
) -> Model:
    """The coefficients that are free, by least squares of pixels; a lens that is centred has no tangential ones."""
    from scipy.optimize import least_squares

    # Each is told in units of its effect at the corner, so that they are alike in size.
    powers = {4: (1, 2, 3, 4), 5: (1, 2, 0, 0, 3), 8: (1, 2, 0, 0, 3, 1, 2, 3)}[count]
    units = np.array([radius ** (-2.0 * powers[index]) for index in free])

    def spread(values: Array) -> Array:
        whole = np.zeros(count)
        whole[list(free)] = units * values
        return whole

    def missed(values: Array) -> Array:
        return np.asarray(((model(spread(values)) - wanted) * focal).ravel())

    best = least_squares(missed, np.zeros(len(free)), method="trf", xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=300)
    off = np.linalg.norm(missed(best.x).reshape(-1, 2), axis=1)
    return Model(name, spread(best.x), float(np.sqrt(np.mean(off**2))), float(off.max()))


# ---- Files


def as_dict(found: Distortion) -> dict[str, Any]:
    """All but the maps, for JSON."""
    radii = np.linspace(0.0, 0.5 * found.grid.pitch * math.hypot(found.grid.width, found.grid.height), 65)
    across = np.stack([radii, np.zeros_like(radii)], axis=-1)
    content = {
        "lens": found.name,
        **found.setting,
        "ideal": found.ideal,
        "image_width": found.grid.width,
        "image_height": found.grid.height,
        "pixel_mm": found.grid.pitch,
        "focal_length_mm": found.scale,
        "camera_matrix": found.camera_matrix(),
        "largest_px": found.largest_px(),
        "models": [model._asdict() for model in found.models],
        "missing": dict(found.missing),
        "film_mm": radii,
        "ideal_mm": found.undistorted(across)[:, 0],
    }
    made: dict[str, Any] = plain(content)
    return made


def npz(found: Distortion) -> bytes:
    """Maps and models as NumPy's archive.

    `map_x`, `map_y`, `inverse_x`, `inverse_y` are float32 (height, width), as `cv2.remap` takes them.
    """
    there, back = found.maps()
    arrays: dict[str, Any] = {
        "map_x": there[..., 0],
        "map_y": there[..., 1],
        "inverse_x": back[..., 0],
        "inverse_y": back[..., 1],
        "camera_matrix": found.camera_matrix(),
        **{model.name: model.coefficients for model in found.models},
        "about": np.array(json.dumps(as_dict(found), allow_nan=False)),
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def opencv_yaml(found: Distortion) -> bytes:
    """The first model as `cv2.FileStorage` reads it."""
    model = found.models[0]
    lines = [
        "%YAML:1.0",
        "---",
        f"lens: {json.dumps(found.name)}",
        f"image_width: {found.grid.width}",
        f"image_height: {found.grid.height}",
        f"distortion_model: {model.name}",
        *_matrix("camera_matrix", found.camera_matrix()),
        *_matrix("distortion_coefficients", model.coefficients[None, :]),
        f"rms_px: {model.rms_px!r}",
        f"largest_px: {model.largest_px!r}",
    ]
    return ("\n".join(lines) + "\n").encode()


def _matrix(name: str, values: Array) -> list[str]:
    rows, columns = values.shape
    numbers = ", ".join(repr(float(value)) for value in values.ravel())
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {columns}",
        "   dt: d",
        f"   data: [ {numbers} ]",
    ]


def text(found: Distortion) -> str:
    """What was found, for a terminal."""
    (fx, fy), grid = found.scale, found.grid
    f = f"{fx:.6g} mm" if fx == fy else f"{fx:.6g} mm across and {fy:.6g} mm down"
    lines = [
        found.name,
        f"{grid.width} x {grid.height} pixels of {1000.0 * grid.pitch:.4g} µm",
        f"against the {found.ideal} projection, principal distance {f}",
        f"the farthest that a point of the film is off: {found.largest_px():.4g} px",
    ]
    for number, model in enumerate(found.models):
        names = {4: "k1 k2 k3 k4", 5: "k1 k2 p1 p2 k3", 8: "k1 k2 p1 p2 k3 k4 k5 k6"}[len(model.coefficients)].split()
        numbers = "  ".join(f"{n} = {value:.9g}" for n, value in zip(names, model.coefficients, strict=True))
        chosen = ", which is taken" if number == 0 and len(found.models) > 1 else ""
        lines += [
            f"{model.name}: off by {model.rms_px:.3g} px RMS, {model.largest_px:.3g} px at most{chosen}",
            f"  {numbers}",
        ]
    lines += [f"no {name}: {why}" for name, why in found.missing.items()]
    return "\n".join(lines) + "\n"
