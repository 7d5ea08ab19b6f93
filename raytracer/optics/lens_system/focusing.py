"""Focusing: the place of the film, or the shift of a group, for a plane to be sharp, by rays through the glass.

The criterion of sharpness is one ray, through the zone of the pupil that halves its area ("marginal"), or the least
root mean square radius of the spot that light through all of the pupil makes of a point ("rms").  Either gives the
place of the image by tracing light of a point of the axis to the film, without a search.  So a lens that moves as a
whole is focused by it alone, however small the aperture or near the plane; where a group moves, its place is a root,
which is bracketed before it is solved for.

In a lens with cylinders light in the two planes of their axes counts together.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.lens_system.first_order import cardinal_points, entrance_pupil, paraxial_heights
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.optics.lens_system.surfaces import LensSurfaces

FOCUS_CRITERIA = ("marginal", "rms")
"""Criteria of sharpness."""

# Relative height in the pupil of the ray that is traced for "marginal": half of the pupil's area lies within.
# Kingslake, Johnson 2010, ch. 6, on the 0.7 zone; after a blocked ray one of half the height is tried.
_ZONE = math.sqrt(0.5)
_MAX_HALVINGS = 16

# Rays of a spot go through the middles of rings of equal area.
_SPOT = np.sqrt((np.arange(256) + 0.5) / 256.0)

# Search for the edge of a spot's light: in so many parts of an interval, and again in the one that holds it, to 2^-39
# of the paraxial edge; where light passes only closer by the axis, until it is found there.
_PARTS, _ROUNDS, _MAX_ROUNDS = 32, 8, 16

# Places of a group, or of a plane, between which a change of sign is searched; the stride of those of a group that are
# tried for the nearest plane; and its greatest magnification: a bit more than 1, since aberrations shift the plane.
_PLACES, _STRIDE = 33, 8
_MAX_MAGNIFICATION = 1.25

# Changes of sign that are examined, and images for each: a lens that focuses has a root, and a pole or two.  With 33
# places that is 441 images at most, of which a lens that focuses takes about 45.
_MAX_SIGN_CHANGES, _MAX_ITERATIONS = 4, 100


class FocusState(NamedTuple):
    """The focus of a lens.

    shift (mm) : of its group towards the scene.
    film (mm) : place of the film on the axis, in the frame of the lens as it is packed with that shift.
    """

    shift: float
    film: float


class _Pencil(NamedTuple):
    """Light of a point of the axis that enters a lens, in the plane of z and another axis.

    lens : packed.
    distance (mm) : of the point before the first surface on the way; may be infinite.
    towards_film : direction of the light.
    across : the other axis, "x" or "y".
    """

    lens: LensSurfaces
    distance: float
    towards_film: bool
    across: str

    def trace(self, sizes: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
        """Trace rays by their heights (mm) in the plane of the first vertex.

        Returns
        -------
        Mask of the rays that get through; their heights (mm) in the plane of the last vertex, and their slopes there.
        """
        ends = (float(self.lens.vertex[0]), float(self.lens.vertex[-1]))
        first, last = ends if self.towards_film else ends[::-1]
        side, axis = 1.0 if self.towards_film else -1.0, "xy".index(self.across)
        starts, ways = np.zeros((len(sizes), 3)), np.zeros((len(sizes), 3))
        starts[:, axis], starts[:, 2] = sizes, first
        ways[:, axis], ways[:, 2] = sizes / self.distance, side
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        weights, points, onward = trace_rays(self.lens, starts, ways, self.towards_film)
        passed = weights > 0.0
        slopes = onward[passed, axis] * side / onward[passed, 2]
        return passed, points[passed, axis] + side * (last - points[passed, 2]) * slopes, slopes

    def _paraxial_edge(self) -> float:
        """Find the height (mm) at which a paraxial ray would touch a rim."""
        reached = np.abs(paraxial_heights(self.lens, 1.0, 1.0 / self.distance, self.towards_film, self.across))
        radius = np.asarray(self.lens.radius if self.towards_film else self.lens.radius[::-1])
        return 1.0 / float((reached / radius).max())

    def zone(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Trace the ray of the zone: its height and slope (1,); empty if no light gets through."""
        size = _ZONE * self._paraxial_edge()
        for halving in range(_MAX_HALVINGS):
            passed, where, slopes = self.trace(np.array([size / 2.0**halving]))
            if passed[0]:
                break
        return where, slopes

    def spot(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Trace the rays of the spot: their heights and slopes (n,); empty if no light gets through."""
        low, high = 0.0, 2.0 * self._paraxial_edge()
        for number in range(1, _MAX_ROUNDS + 1):
            sizes = np.linspace(low, high, _PARTS + 1)
            blocked = np.flatnonzero(~self.trace(sizes[1:])[0])
            if not len(blocked):
                low = high
                break
            low, high = float(sizes[blocked[0]]), float(sizes[blocked[0] + 1])
            if low > 0.0 and number >= _ROUNDS:
                break
        return self.trace(low * _SPOT)[1:] if low > 0.0 else (np.empty(0), np.empty(0))


def image_distance(lens: LensSurfaces, distance: float, towards_film: bool, how: str = "marginal") -> float:
    """Find the distance (mm) behind the last surface on its way at which light of a point of the axis meets the axis.

    distance (mm) : of the point before the first surface on the way; may be infinite.

    The result is infinite where the light leaves as a parallel beam, and negative where it diverges.

    Raises
    ------
    ValueError : none of the light gets through.
    """
    product, squares, count = 0.0, 0.0, 0
    is_round = lens.shapes is None or np.array_equal(lens.shapes.quadric[:, 0], lens.shapes.quadric[:, 1])
    for across in "y" if is_round else "xy":
        pencil = _Pencil(lens, distance, towards_film, across)
        where, slopes = pencil.spot() if how == "rms" else pencil.zone()
        product, squares = product + float(where @ slopes), squares + float(slopes @ slopes)
        count += len(slopes)
    if count == 0:
        raise ValueError(f"no light of a point {distance:g} mm before the lens gets through it")
    # Least squares of heights + behind x slopes; for a single ray, where it meets the axis.
    return -product / squares if squares > 0.0 else math.inf


def film_position(lens: Lens, how: str = "marginal", *, stop_radius: float | None = None) -> float:
    """Find the place of the film on the axis (mm) for infinity, with the group that focuses where the file has it.

    Raises
    ------
    ValueError : the lens makes no image of what is far away.
    """
    packed = lens.packed(stop_radius=stop_radius)
    behind = image_distance(packed, math.inf, towards_film=True, how=how)
    if not 0.0 < behind < math.inf:
        raise ValueError("the lens makes no image behind it of what is far away")
    return float(packed.vertex[-1]) + behind


def _pupil_distance(packed: LensSurfaces) -> float:
    """Compute the distance of the entrance pupil behind the front vertex (mm)."""
    way = entrance_pupil(packed).z - float(packed.vertex[0])
    if math.isinf(way):
        raise ValueError("the entrance pupil of the lens is at infinity, so that no distance is measured from it")
    return way


def _shifts(lens: Lens, packed: LensSurfaces, film: float) -> list[NDArray[np.float64]]:
    """List places of the group that focuses (mm towards the scene), from that for infinity to its limit each way."""
    first, last = lens.focus.first - 1, lens.focus.last - 1
    # A group with nothing before or behind it moves until the image is as large as the object, as a whole lens does.
    most = abs(cardinal_points(packed).focal_length)
    ahead = lens.elements[first - 1].thickness if first > 0 else most
    if last + 1 < len(lens.elements):
        behind = lens.elements[last].thickness
    else:
        behind = min(most, film - float(packed.vertex[-1])) * (_PLACES - 1) / _PLACES
    return [np.linspace(0.0, ahead, _PLACES), np.linspace(0.0, -behind, _PLACES)]


def _shift_group(lens: Lens, packed: LensSurfaces, shift: float) -> LensSurfaces:
    """Move the group that focuses towards the scene (mm)."""
    vertex = packed.vertex.copy()
    vertex[lens.focus.first - 1 : lens.focus.last] -= shift
    return packed._replace(vertex=vertex)


def _defocus(packed: LensSurfaces, away: float, film: float, how: str) -> float:
    """Compute the defocus of a plane (1/mm), positive with its image before the film; NaN if no light gets through.

    It has no pole where light leaves parallel.

    away (mm) : distance of the plane before the front vertex.
    """
    try:
        behind = image_distance(packed, away, towards_film=True, how=how) if away > 0.0 else math.nan
    except ValueError:
        return math.nan
    return 1.0 / behind - 1.0 / (film - float(packed.vertex[-1]))


def _find_root(off: Callable[[float], float], places: NDArray[np.float64]) -> float | None:
    """Find the first root of `off` between places; None if it does not change its sign between two of them.

    Raises
    ------
    ValueError : it changes its sign at more than `_MAX_SIGN_CHANGES` places before it is 0.
    """
    from scipy.optimize import brentq

    values = np.array([off(float(place)) for place in places])
    changes = np.flatnonzero(values[:-1] * values[1:] <= 0.0)
    for change in map(int, changes[:_MAX_SIGN_CHANGES]):
        try:
            root = float(brentq(off, float(places[change]), float(places[change + 1]), maxiter=_MAX_ITERATIONS))
        except (ValueError, RuntimeError):
            # No light gets through for a place on the way, or the function is too rough there to be bisected.
            continue
        # At a pole, where the image is in the last vertex, the sign changes too.
        if abs(off(root)) <= np.abs(values[change : change + 2]).max():
            return root
    if len(changes) > _MAX_SIGN_CHANGES:
        raise ValueError(
            f"the lens has no steady focus: its image jumps past the film at {len(changes)} places, and "
            f"{_MAX_SIGN_CHANGES} are looked into"
        )
    return None


def _sharp_distance(packed: LensSurfaces, film: float, how: str) -> float:
    """Find the distance (mm) before the entrance pupil of the plane that is sharp on a film; infinite if there is none.

    If that is in the lens, it is about the nearest plane before it.
    """
    # By magnification: the plane is f / magnification before the front focus.
    points = cardinal_points(packed)
    size, front = abs(points.focal_length), points.front_focus - float(packed.vertex[0])
    most = _MAX_MAGNIFICATION if front <= 0.0 else min(_MAX_MAGNIFICATION, size / front)
    magnified = np.linspace(0.0, most, _PLACES)[1:-1]

    def off(magnification: float) -> float:
        return _defocus(packed, size / magnification - front, film, how)

    root = _find_root(off, magnified)
    if root is None:
        # The image of the nearest plane is not yet as far behind as the film, or none is before it.
        if not off(float(magnified[-1])) > 0.0:
            return math.inf
        root = float(magnified[-1])
    return size / root - front + _pupil_distance(packed)


class FocusRange(NamedTuple):
    """The range in which a lens focuses (mm).

    film : see `film_position`.
    nearest : distance before the entrance pupil of the nearest plane.
    shift : with which that is sharp.
    """

    film: float
    nearest: float
    shift: float


@functools.lru_cache(maxsize=64)
def focus_range(lens: Lens, how: str = "marginal", stop_radius: float | None = None) -> FocusRange:
    """Find the range in which a lens focuses.

    A lens that moves as a whole does so until the image is as large as the object; a group until it meets its
    neighbours.

    Raises
    ------
    ValueError : the lens makes no image of what is far away.
    """
    film, packed = film_position(lens, how, stop_radius=stop_radius), lens.packed(stop_radius=stop_radius)
    if lens.focus.moves != "group":
        return FocusRange(film, _sharp_distance(packed, film + abs(cardinal_points(packed).focal_length), how), 0.0)
    shifts = np.concatenate([way[_STRIDE::_STRIDE] for way in _shifts(lens, packed, film)])
    nearest = min(
        (_sharp_distance(_shift_group(lens, packed, shift), film, how), shift) for shift in map(float, shifts)
    )
    return FocusRange(film, *nearest)


def focus_shift(lens: Lens, distance: float, how: str = "marginal", *, stop_radius: float | None = None) -> FocusState:
    """Focus a lens on a plane.

    Parameters
    ----------
    distance (mm) : of the plane from the paraxial entrance pupil, at the d line, of the lens as it is then focused;
        may be infinite.
    how : criterion of sharpness, one of `FOCUS_CRITERIA`.
    stop_radius (mm) : of the stop; its widest by default.

    Raises
    ------
    ValueError : the plane is nearer than the lens can focus, and then it names the nearest one that is possible; or the
        lens makes no image of what is far away.
    """
    if how not in FOCUS_CRITERIA:
        raise ValueError(f"focus is by {' or '.join(FOCUS_CRITERIA)}, not by {how}")
    if distance == math.inf:
        return FocusState(0.0, film_position(lens, how, stop_radius=stop_radius))
    film, nearest, most = focus_range(lens, how, stop_radius)
    if not distance >= nearest:
        raise ValueError(
            f"the lens cannot focus at {distance:g} mm: the nearest plane that it can is {nearest:g} mm before its "
            "entrance pupil"
        )
    packed = lens.packed(stop_radius=stop_radius)
    if lens.focus.moves != "group":
        away = distance - _pupil_distance(packed)
        return FocusState(0.0, float(packed.vertex[-1]) + image_distance(packed, away, towards_film=True, how=how))

    def off(shift: float) -> float:
        moved = _shift_group(lens, packed, shift)
        return _defocus(moved, distance - _pupil_distance(moved), film, how)

    # On the way to the nearest plane; at its end, if rounding hides it there.
    root = _find_root(off, np.linspace(0.0, most, _PLACES))
    return FocusState(most if root is None else root, film)


def focus_lens(lens: Lens, distance: float, how: str = "marginal") -> tuple[Lens, float]:
    """Focus a lens as `focus_shift` does; also find the place of the film (mm) in the focused lens's own frame."""
    shift, film = focus_shift(lens, distance, how)
    with_front = lens.focus.moves == "group" and lens.focus.first == 1
    return lens.focused(shift), film + shift if with_front else film
