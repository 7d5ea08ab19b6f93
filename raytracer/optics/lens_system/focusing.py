"""Where the film must be for a plane to be sharp, and how a lens is moved for it, by rays through the glass.

What is sharp is decided by one ray, through the zone of the pupil that halves its area ("marginal"), or by the least
root mean square of distances from the middle of the spot that light through all of the pupil makes of a point ("rms").
Either gives the place of the image by light of a point of the axis that is followed to the film, without a search.  So
a lens that moves as a whole is focused by it alone, however small the aperture or near the plane; where a group moves,
its place is a root, which is in an interval before it is looked for.

In a lens with cylinders it is light in the two planes of their axes, together, that decides.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.lenses.first_order import cardinal_points, entrance_pupil, heights
from raytracer.lenses.lens import Lens
from raytracer.lenses.surfaces import LensSurfaces, trace_rays

HOW = ("marginal", "rms")
"""What may decide what is sharp."""

# The ray that decides where an image is sharp goes through the pupil here: half of the pupil's area lies within.
# Kingslake, Johnson 2010, ch. 6, on the 0.7 zone; a blocked ray is followed by one of half the height.
_ZONE = math.sqrt(0.5)
_MOST_HALVINGS = 16

# Those of a spot are in the middles of rings of equal area.
_SPOT = np.sqrt((np.arange(256) + 0.5) / 256.0)

# How the edge of a spot's light is looked for: in so many parts of an interval, and again in the one where it is, to
# 2^-39 of where it is for rays near the axis; where light passes only closer by the axis, until it is found there.
_PARTS, _ROUNDS, _MOST_ROUNDS = 32, 8, 16

# At how many places of a group, or of a plane, a change of sign is looked for; which of the former are tried for the
# nearest plane; and how near that is at most: a bit nearer than where its image is as large, which aberrations shift.
_PLACES, _STRIDE = 33, 8
_MOST_MAGNIFIED = 1.25

# How many changes of sign are looked into, and by how many images each: a lens that focuses has a root, and a pole or
# two.  With 33 places that is 441 images at most, of which a lens that focuses takes about 45.
_MOST_CHANGES, _MOST_ITERATIONS = 4, 100


class Focused(NamedTuple):
    """How a lens is focused: how far its group is moved towards the scene, and where the film is on the axis (mm).

    film : in the frame of the lens as it is packed with that shift.
    """

    shift: float
    film: float


class _Pencil(NamedTuple):
    """Light of a point of the axis on its way into a lens, in the plane of z and another axis, "x" or "y".

    distance : of the point before the first surface on the way (mm), may be infinite.
    """

    lens: LensSurfaces
    distance: float
    towards_film: bool
    across: str

    def followed(
        self, sizes: NDArray[np.float64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
        """Rays by their heights (mm) in the plane of the first vertex.

        Returns
        -------
        which get through; of these the heights (mm) in the plane of the last vertex, and the slopes there.
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

    def _near_axis(self) -> float:
        """The size at which a ray near the axis would touch a rim."""
        reached = np.abs(heights(self.lens, 1.0, 1.0 / self.distance, self.towards_film, self.across))
        radius = np.asarray(self.lens.radius if self.towards_film else self.lens.radius[::-1])
        return 1.0 / float((reached / radius).max())

    def zone(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Height and slope (1,) of the ray that decides; of none (0,) if no light gets through."""
        size = _ZONE * self._near_axis()
        for halving in range(_MOST_HALVINGS):
            passed, where, slopes = self.followed(np.array([size / 2.0**halving]))
            if passed[0]:
                break
        return where, slopes

    def spot(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Heights and slopes (n,) of rays up to that at the edge of the light; of none if no light gets through."""
        low, high = 0.0, 2.0 * self._near_axis()
        for number in range(1, _MOST_ROUNDS + 1):
            sizes = np.linspace(low, high, _PARTS + 1)
            blocked = np.flatnonzero(~self.followed(sizes[1:])[0])
            if not len(blocked):
                low = high
                break
            low, high = float(sizes[blocked[0]]), float(sizes[blocked[0] + 1])
            if low > 0.0 and number >= _ROUNDS:
                break
        return self.followed(low * _SPOT)[1:] if low > 0.0 else (np.empty(0), np.empty(0))


def _image(lens: LensSurfaces, distance: float, towards_film: bool, how: str = "marginal") -> float:
    """How far behind the last surface on its way (mm) the light of a point of the axis meets the axis again.

    distance : of the point before the first surface on the way (mm), may be infinite.  The result is infinite where the
    light leaves as a parallel beam, and negative where it spreads.

    Raises
    ------
    ValueError : none of the light gets through.
    """
    product, squares, count = 0.0, 0.0, 0
    for across in _planes(lens):
        pencil = _Pencil(lens, distance, towards_film, across)
        where, slopes = pencil.spot() if how == "rms" else pencil.zone()
        product, squares = product + float(where @ slopes), squares + float(slopes @ slopes)
        count += len(slopes)
    if count == 0:
        raise ValueError(f"no light of a point {distance:g} mm before the lens gets through it")
    # Least squares of heights + behind x slopes; for a single ray, where it meets the axis.
    return -product / squares if squares > 0.0 else math.inf


def _planes(lens: LensSurfaces) -> str:
    """The planes in which light is followed: one where the lens is round."""
    shapes = lens.shapes
    return "y" if shapes is None or np.array_equal(shapes.quadric[:, 0], shapes.quadric[:, 1]) else "xy"


def nearest_focus(lens: LensSurfaces, travel: float, how: str = "marginal") -> float:
    """Distance (mm) before the front vertex of the nearest plane that is sharp on a film this far behind the last one.

    Raises
    ------
    ValueError : so near behind the lens nothing is sharp.
    """
    distance = _image(lens, travel, towards_film=False, how=how)
    if distance <= 0.0:
        raise ValueError(
            f"nothing is sharp {travel:g} mm behind the lens: infinity is {_image(lens, math.inf, True, how):g} mm "
            "behind it"
        )
    return distance


def focus(lens: LensSurfaces, distance: float, travel: float, how: str = "marginal") -> float:
    """How far behind the last vertex (mm) the film must be for a plane at a distance before the front one to be sharp.

    Parameters
    ----------
    distance : of the plane (mm), greater than 0, may be infinite.
    travel : how far behind the last vertex the film can be (mm).
    how : what is sharp, one of `HOW`.

    Raises
    ------
    ValueError : the plane is nearer than the lens can focus; it names the nearest one that is possible.
    """
    nearest = nearest_focus(lens, travel, how)
    if not distance >= nearest:
        raise ValueError(
            f"the lens cannot focus at {distance:g} mm: the nearest plane that is sharp with the film {travel:g} mm "
            f"behind the lens is {nearest:g} mm before it"
        )
    return _image(lens, distance, towards_film=True, how=how)


# ---- Lenses


def film_place(lens: Lens, how: str = "marginal", *, stop_radius: float | None = None) -> float:
    """Where the film is on the axis (mm) for infinity to be sharp, the group that focuses being where the file has it.

    Raises
    ------
    ValueError : the lens makes no image of what is far away.
    """
    packed = lens.packed(stop_radius=stop_radius)
    behind = _image(packed, math.inf, towards_film=True, how=how)
    if not 0.0 < behind < math.inf:
        raise ValueError("the lens makes no image behind it of what is far away")
    return float(packed.vertex[-1]) + behind


def _way_to_pupil(packed: LensSurfaces) -> float:
    """How far the entrance pupil is behind the front vertex (mm)."""
    way = entrance_pupil(packed).z - float(packed.vertex[0])
    if math.isinf(way):
        raise ValueError("the entrance pupil of the lens is at infinity, so that no distance is measured from it")
    return way


def _shifts(lens: Lens, packed: LensSurfaces, film: float) -> list[NDArray[np.float64]]:
    """Places of the group that focuses (mm towards the scene), from that for infinity as far as it goes each way."""
    first, last = lens.focus.first - 1, lens.focus.last - 1
    # What has nothing before or behind it moves until the image is as large as the object, as a whole lens does.
    most = abs(cardinal_points(packed).focal_length)
    ahead = lens.elements[first - 1].thickness if first > 0 else most
    if last + 1 < len(lens.elements):
        behind = lens.elements[last].thickness
    else:
        behind = min(most, film - float(packed.vertex[-1])) * (_PLACES - 1) / _PLACES
    return [np.linspace(0.0, ahead, _PLACES), np.linspace(0.0, -behind, _PLACES)]


def _shifted(lens: Lens, packed: LensSurfaces, shift: float) -> LensSurfaces:
    vertex = packed.vertex.copy()
    vertex[lens.focus.first - 1 : lens.focus.last] -= shift
    return packed._replace(vertex=vertex)


def _off(packed: LensSurfaces, away: float, film: float, how: str) -> float:
    """By how much the image of a plane is before the film, in 1/mm, which have no pole where light leaves parallel.

    away : of the plane before the front vertex (mm).  NaN if no light of it gets through.
    """
    try:
        behind = _image(packed, away, towards_film=True, how=how) if away > 0.0 else math.nan
    except ValueError:
        return math.nan
    return 1.0 / behind - 1.0 / (film - float(packed.vertex[-1]))


def _first_root(off: Callable[[float], float], places: NDArray[np.float64]) -> float | None:
    """Find where `off` is first 0 on the way through places; None if it does not change its sign between two of them.

    Raises
    ------
    ValueError : it changes its sign at more than `_MOST_CHANGES` places before it is 0.
    """
    from scipy.optimize import brentq

    values = np.array([off(float(place)) for place in places])
    changes = np.flatnonzero(values[:-1] * values[1:] <= 0.0)
    for change in map(int, changes[:_MOST_CHANGES]):
        try:
            root = float(brentq(off, float(places[change]), float(places[change + 1]), maxiter=_MOST_ITERATIONS))
        except (ValueError, RuntimeError):
            # No light gets through for a place on the way, or what is there is too rough to be halved.
            continue
        # At a pole, where the image is in the last vertex, the sign changes too.
        if abs(off(root)) <= np.abs(values[change : change + 2]).max():
            return root
    if len(changes) > _MOST_CHANGES:
        raise ValueError(
            f"the lens has no steady focus: its image jumps past the film at {len(changes)} places, and "
            f"{_MOST_CHANGES} are looked into"
        )
    return None


def _sharp(packed: LensSurfaces, film: float, how: str) -> float:
    """Distance (mm) before the entrance pupil of the plane that is sharp on a film; infinite if there is none.

    Where that is in the lens, it is about the nearest plane before it.
    """
    # By magnification: the plane is f / magnification before the front focus.
    points = cardinal_points(packed)
    size, front = abs(points.focal_length), points.front_focus - float(packed.vertex[0])
    most = _MOST_MAGNIFIED if front <= 0.0 else min(_MOST_MAGNIFIED, size / front)
    magnified = np.linspace(0.0, most, _PLACES)[1:-1]

    def off(magnification: float) -> float:
        return _off(packed, size / magnification - front, film, how)

    found = _first_root(off, magnified)
    if found is None:
        # The image of what is nearest is not yet as far behind as the film, or none is before it.
        if not off(float(magnified[-1])) > 0.0:
            return math.inf
        found = float(magnified[-1])
    return size / found - front + _way_to_pupil(packed)


class _Range(NamedTuple):
    """How far a lens focuses.

    film, as of `film_place`; nearest, as of `nearest_distance`; shift, with which it is sharp (mm).
    """

    film: float
    nearest: float
    shift: float


@functools.lru_cache(maxsize=64)
def _range(lens: Lens, how: str, stop_radius: float | None) -> _Range:
    film, packed = film_place(lens, how, stop_radius=stop_radius), lens.packed(stop_radius=stop_radius)
    if lens.focus.moves != "group":
        return _Range(film, _sharp(packed, film + abs(cardinal_points(packed).focal_length), how), 0.0)
    shifts = np.concatenate([way[_STRIDE::_STRIDE] for way in _shifts(lens, packed, film)])
    return _Range(film, *min((_sharp(_shifted(lens, packed, shift), film, how), shift) for shift in map(float, shifts)))


def nearest_distance(lens: Lens, how: str = "marginal", *, stop_radius: float | None = None) -> float:
    """Distance (mm) before the entrance pupil of the nearest plane that a lens focuses.

    A lens that moves as a whole does so until the image is as large as the object; a group until it meets what is
    before or behind it.

    Raises
    ------
    ValueError : the lens makes no image of what is far away.
    """
    return _range(lens, how, stop_radius).nearest


def focus_shift(lens: Lens, distance: float, how: str = "marginal", *, stop_radius: float | None = None) -> Focused:
    """How to focus a lens on a plane.

    Parameters
    ----------
    distance : of the plane from the entrance pupil near the axis, at the d line, of the lens as it is then focused
        (mm); may be infinite.
    how : what is sharp, one of `HOW`.
    stop_radius : that of the stop (mm); its widest by default.

    Raises
    ------
    ValueError : the plane is nearer than the lens can focus, and then it names the nearest one that is possible; or the
        lens makes no image of what is far away.
    """
    if how not in HOW:
        raise ValueError(f"focus is by {' or '.join(HOW)}, not by {how}")
    if distance == math.inf:
        return Focused(0.0, film_place(lens, how, stop_radius=stop_radius))
    film, nearest, most = _range(lens, how, stop_radius)
    if not distance >= nearest:
        raise ValueError(
            f"the lens cannot focus at {distance:g} mm: the nearest plane that it can is {nearest:g} mm before its "
            "entrance pupil"
        )
    packed = lens.packed(stop_radius=stop_radius)
    if lens.focus.moves != "group":
        away = distance - _way_to_pupil(packed)
        return Focused(0.0, float(packed.vertex[-1]) + _image(packed, away, towards_film=True, how=how))

    def off(shift: float) -> float:
        moved = _shifted(lens, packed, shift)
        return _off(moved, distance - _way_to_pupil(moved), film, how)

    # On the way to the nearest plane; at its end, if rounding hides it there.
    found = _first_root(off, np.linspace(0.0, most, _PLACES))
    return Focused(most if found is None else found, film)


def focused(
    lens: Lens, distance: float, how: str = "marginal", *, stop_radius: float | None = None
) -> tuple[Lens, float]:
    """A lens focused on a plane, and where the film is on the axis (mm), in that lens's own frame; as `focus_shift`."""
    shift, film = focus_shift(lens, distance, how, stop_radius=stop_radius)
    with_front = lens.focus.moves == "group" and lens.focus.first == 1
    return lens.focused(shift), film + shift if with_front else film
