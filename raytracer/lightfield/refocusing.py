"""Photographs that are focused after the shot, in metres.

The picture of a lens focused at 1 / w is, at the place x, what all points u of the lens see of the point there:
I(x) = mean over u of L(u, x - u (w - w0)), with L as `plenoptic.views` has it.  It has the framing of the views.

References: Isaksen, McMillan, Gortler 2000, "Dynamically Reparameterized Light Fields"; Ng et al. 2005, "Light Field
Photography with a Hand-held Plenoptic Camera", sec. 3; Ng 2005, "Fourier Slice Photography", eq. 4.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from raytracer.apertures.interface import ApertureSpec
from raytracer.errors import InputError
from raytracer.film.image import Image
from raytracer.lightfield.coverage import at_nearest, continued, lit_view
from raytracer.lightfield.depth import Update
from raytracer.lightfield.interpolation import INTERPOLATIONS, Interpolation, Shift, shift_by
from raytracer.lightfield.openings import cell_weights, transmitted
from raytracer.plenoptic.field import LIT, LightField, Rays
from raytracer.plenoptic.focusing import FocusPlane, diameter_of, inverse_of_alpha, inverse_of_slope
from raytracer.plenoptic.views import Views

Array = NDArray[np.float64]

Method: TypeAlias = Literal["shift", "fourier", "rays"]

METHODS: tuple[Method, ...] = get_args(Method)

_Item = TypeVar("_Item")

EMPTY = "pixels_without_rays"
"""The setting of a picture by rays that tells of its black pixels."""

# Rays that are read from a file at a time.
_RAYS_AT_ONCE = 1 << 20


class Window(NamedTuple):
    """A part of a view: pixels left <= x < right, top <= y < bottom."""

    left: int
    top: int
    right: int
    bottom: int


class Opening(NamedTuple):
    """An opening.

    diameter, of the round one that is as large (m), or None for all that the views look through; shape, packed, None
    for a disc; center, right and up (m).
    """

    diameter: float | None
    shape: Any
    center: tuple[float, float]


def refocus(
    field: LightField,
    distance: float | None = None,
    *,
    alpha: float | None = None,
    slope: float | None = None,
    f_number: float | None = None,
    aperture: float | None = None,
    aperture_shape: ApertureSpec | str | None = None,
    center: tuple[float, float] = (0.0, 0.0),
    tilt: float = 0.0,
    swing: float = 0.0,
    method: Method = "shift",
    interpolation: Interpolation = "lanczos",
    crop: tuple[int, int, int, int] | None = None,
    scale: float = 1.0,
    update: Update | None = None,
) -> Image:
    """The photograph of a lens that was focused at a distance.

    Its brightness is that of the whole opening: radiance stays what it is, whatever the aperture.

    Parameters
    ----------
    distance : of the plane of focus (m), along the axis, from the plane of the views; inf allowed; by default that in
        which all views see the same.
    alpha : in its place, how many times as far from the lens the film is (Ng 2005); `focusing.inverse_of_alpha`.
    slope : in its place, by how many pixels what is in focus moves from view to view, against the view; greater for
        what is nearer.  All that light fields without metres have.
    f_number, aperture : of the opening, or its diameter (m); by default all that the views look through.
    aperture_shape : the same as for a lens in a scene, a spec or the name of one, of the area of that disc.
    center : of the opening, right and up (m): looking from there, as it were.
    tilt, swing : by how much the plane of focus leans away at its top, and to the right (deg).
    method : "shift", shift-and-sum of the views; "fourier", a slice of their spectrum; "rays", a sum over the rays
        that were kept, each where it went.
    interpolation : of "shift", between pixels; a tilted plane takes splines of the order of linear or else cubic.
    crop : (x0, y0, x1, y1), the pixels x0 <= x < x1, y0 <= y < y1 only.  By "shift" no more is read than it needs.
    scale : of "rays", pixels of the picture along one of the views'.
    update : told of the progress: what is done, and of how much.

    Pixels that not all views see, or that not all have light at, are the mean of those that do; by "fourier", what got
    no light in a view is as what is next to it.

    Raises
    ------
    InputError : what the light field, or the method, cannot do.
    """
    plane = _plane(_inverse(field, distance, alpha, slope), tilt, swing)
    opening = _opening(field.views, f_number, aperture, aperture_shape, center)
    return _pictures(field, [plane], opening, method, interpolation, crop, scale, update)[0]


def focal_stack(
    field: LightField,
    distances: Sequence[float] = (),
    *,
    slopes: Sequence[float] = (),
    f_number: float | None = None,
    aperture: float | None = None,
    aperture_shape: ApertureSpec | str | None = None,
    center: tuple[float, float] = (0.0, 0.0),
    tilt: float = 0.0,
    swing: float = 0.0,
    method: Method = "shift",
    interpolation: Interpolation = "lanczos",
    crop: tuple[int, int, int, int] | None = None,
    scale: float = 1.0,
    update: Update | None = None,
) -> list[Image]:
    """As `refocus`, at several distances (m) or slopes: each view is read once, or transformed once, for all.

    Raises
    ------
    InputError : as `refocus`; or neither distances nor slopes are given, or both.
    """
    if (len(distances) == 0) == (len(slopes) == 0):
        raise InputError("a focal stack needs distances, or slopes")
    inverses = [_inverse(field, distance, None, None) for distance in distances]
    inverses += [_inverse(field, None, None, slope) for slope in slopes]
    planes = [_plane(inverse, tilt, swing) for inverse in inverses]
    opening = _opening(field.views, f_number, aperture, aperture_shape, center)
    return _pictures(field, planes, opening, method, interpolation, crop, scale, update)


# ---- What was asked for


def _inverse(field: LightField, distance: float | None, alpha: float | None, slope: float | None) -> float:
    """One over the distance of the plane of focus (1/m)."""
    views = field.views
    given = {"distance": distance, "alpha": alpha, "slope": slope}
    names = [name for name, value in given.items() if value is not None]
    if len(names) > 1:
        raise InputError(f"{names[0]} and {names[1]} both set the plane of focus: give one of them")
    if names and names[0] != "slope" and not field.is_metric:
        raise InputError(f"this light field does not know how large it is, so {names[0]} says nothing: give a slope")
    try:
        if alpha is not None:
            return inverse_of_alpha(views, alpha)
        if slope is not None:
            return inverse_of_slope(views, slope)
    except ValueError as error:
        raise InputError(str(error)) from None
    if distance is None:
        return views.inverse_focus
    if not distance > 0.0:
        raise InputError(f"a plane of focus must be farther than 0, got {distance:g} m")
    return 1.0 / distance


def _plane(inverse: float, tilt: float, swing: float) -> FocusPlane:
    for name, angle in (("tilt", tilt), ("swing", swing)):
        if not -90.0 < angle < 90.0:
            raise InputError(f"{name} must be between -90 and 90 degrees, got {angle:g}")
    # Of the plane through (0, 0, d) along (1, 0, tan swing) and (0, 1, tan tilt), seen at the tangents x and y:
    # z = d + z x tan swing + z y tan tilt.
    return FocusPlane(inverse, -inverse * math.tan(math.radians(swing)), -inverse * math.tan(math.radians(tilt)))


def _opening(
    views: Views,
    f_number: float | None,
    aperture: float | None,
    shape: ApertureSpec | str | None,
    center: tuple[float, float],
) -> Opening:
    if f_number is not None and aperture is not None:
        raise InputError("f_number and aperture both set the size of the opening: give one of them")
    if f_number is not None:
        try:
            aperture = diameter_of(views, f_number)
        except ValueError as error:
            raise InputError(str(error)) from None
    if aperture is not None and not 0.0 < aperture < math.inf:
        raise InputError(f"an aperture must be greater than 0 and finite, got {aperture:g} m")
    if aperture is None and (shape is not None or center != (0.0, 0.0)):
        aperture = views.aperture
        if aperture is None:
            raise InputError("an aperture's shape or place needs its size: give aperture")
    return Opening(aperture, _packed(shape), center)


def _packed(shape: ApertureSpec | str | None) -> Any:
    if shape is None:
        return None
    if isinstance(shape, str):
        shape = named_aperture(shape)
    from raytracer.assets.images import read_image

    # What apertures load are pictures.
    try:
        return shape.pack({key: read_image(getattr(shape, key)) for key in shape.loads})
    except ValueError as error:
        raise InputError(str(error)) from None


def named_aperture(text: str) -> ApertureSpec:
    """An aperture as a scene has it: a type, or a mapping in YAML, `{type: polygon, blades: 7}`.

    Raises
    ------
    InputError : it is none.
    """
    from pydantic import TypeAdapter, ValidationError

    from raytracer.document import parse
    from raytracer.kinds import APERTURES

    root = parse(text, "", option=f"aperture_shape {text}")
    try:
        found = TypeAdapter(APERTURES.union_or_name()).validate_python(None if root is None else root.plain())
    except ValidationError as error:
        reason = str(error.errors()[0]["msg"]).removeprefix("Value error, ")
        wanted = reason or "must be a type of aperture, or a mapping such as {type: polygon, blades: 6}"
        raise InputError(f"aperture_shape {text}: {wanted}") from None
    assert isinstance(found, ApertureSpec)
    return found


def _window(views: Views, crop: tuple[int, int, int, int] | None) -> Window:
    width, height = views.width, views.height
    if crop is None:
        return Window(0, 0, width, height)
    window = Window(*crop)
    if not (0 <= window.left < window.right <= width and 0 <= window.top < window.bottom <= height):
        corners = ",".join(map(str, crop))
        raise InputError(f"crop {corners} must lie within a view, 0,0,{width},{height}, and hold at least a pixel")
    return window


# ---- Pictures


def _pictures(
    field: LightField,
    planes: list[FocusPlane],
    opening: Opening,
    method: Method,
    interpolation: Interpolation,
    crop: tuple[int, int, int, int] | None,
    scale: float,
    update: Update | None,
) -> list[Image]:
    if method not in METHODS:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {method}")
    if interpolation not in INTERPOLATIONS:
        raise InputError(f"interpolation must be one of {', '.join(INTERPOLATIONS)}, got {interpolation}")
    if scale != 1.0 and method != "rays":
        raise InputError("only method rays has a scale: views have pixels of their own")
    window = _window(field.views, crop)
    is_tilted = any(plane.right != 0.0 or plane.up != 0.0 for plane in planes)
    notes: list[dict[str, int]] = [{} for _ in planes]
    if method == "rays":
        if field.rays is None:
            raise InputError("there are no rays in this light field: render it with --aov rays, or refocus by shift")
        integrated = [
            re_integrated(field.rays, field.views, plane, opening, window, scale) for plane in _told(planes, update)
        ]
        found = [picture for picture, _ in integrated]
        notes = [{EMPTY: int((count == 0.0).sum())} for _, count in integrated]
    elif field.views.rows * field.views.columns == 1:
        raise InputError(
            "there is but one view, which has its focus for good" + (": refocus by rays" if field.rays else "")
        )
    else:
        weights = cell_weights(field.views, *opening)
        if method == "fourier":
            if is_tilted:
                raise InputError("a tilted plane is no slice of the spectrum: refocus by shift")
            from raytracer.lightfield.fourier import FourierRefocuser

            inverses = [plane.middle for plane in planes]
            slices = FourierRefocuser(field, inverses, weights)
            found = [_part(slices.picture(inverse), window) for inverse in _told(inverses, update)]
        elif is_tilted:
            found = [_warp_and_sum(field, plane, weights, interpolation, window) for plane in _told(planes, update)]
        else:
            found = _shift_and_sum(field, [plane.middle for plane in planes], weights, interpolation, window, update)
    return [
        Image(radiance=picture, settings={**field.settings, **_settings(plane, opening, method), **note})
        for picture, plane, note in zip(found, planes, notes, strict=True)
    ]


def _told(items: Sequence[_Item], update: Update | None) -> Iterator[_Item]:
    """One after the other, each told of when it is done."""
    for number, item in enumerate(items, 1):
        yield item
        if update is not None:
            update(number, len(items))


def _part(picture: Array, window: Window) -> Array:
    return picture[window.top : window.bottom, window.left : window.right]


def _settings(plane: FocusPlane, opening: Opening, method: Method) -> dict[str, str | float | int]:
    """For the headers of files."""
    settings: dict[str, str | float | int] = {
        # Without the last digits, that are of one over one over it.
        "refocused_m": float(f"{1.0 / plane.middle:.14g}") if plane.middle else math.inf,
        "refocused_by": method,
    }
    if opening.diameter is not None:
        settings["aperture_mm"] = 1e3 * opening.diameter
    return settings


class _Sum:
    """A picture that is summed up: views at the same height are moved sideways, and their sum is moved up or down."""

    def __init__(self, views: Views, inverse: float, interpolation: Interpolation, window: Window) -> None:
        self._views, self._interpolation, self._window = views, interpolation, window
        self._shift = views.shift(inverse)
        width, height = window.right - window.left, window.bottom - window.top
        self._sum, self._seen = np.zeros((height, width, 3)), np.zeros((height, width))

    def aside(self, row: int, column: int) -> Shift:
        """How a view is moved sideways."""
        shift = self._shift[row, column, 0]
        return shift_by(shift, self._window.left, self._window.right, self._views.width, self._interpolation)

    def down(self, row: int, column: int) -> Shift:
        """How it is moved up or down."""
        shift = self._shift[row, column, 1]
        return shift_by(shift, self._window.top, self._window.bottom, self._views.height, self._interpolation)

    def level(self, first: int, last: int) -> None:
        """Go on with views of another height, of which rows of pixels are given."""
        width = self._window.right - self._window.left
        self._rows, self._count = np.zeros((last - first, width, 3)), np.zeros(width)

    def add(self, weight: float, aside: Shift, block: Array, start: int) -> None:
        """Add a view, of which columns of pixels from `start` on are given."""
        if aside.seen.any():
            self._rows += (weight * aside.seen)[:, None] * aside.of(block, start, 1)
            self._count += weight * aside.seen

    def finish_level(self, down: Shift, first: int, lit: NDArray[np.bool_] | None = None) -> None:
        """Move what was added, of which rows of pixels from `first` on are there; keep what is `lit` of the window."""
        if down.seen.any():
            moved, seen = down.seen[:, None, None] * down.of(self._rows, first, 0), np.outer(down.seen, self._count)
            self._sum += moved if lit is None else np.where(lit[..., None], moved, 0.0)
            self._seen += seen if lit is None else np.where(lit, seen, 0.0)

    def lit(self, row: int, column: int, lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Find the pixels of the window that a view shows and that are lit: `lit` is of the view."""
        right, down = self._shift[row, column]
        rows = np.arange(self._window.top, self._window.bottom) + down
        return at_nearest(lit, rows[:, None], (np.arange(self._window.left, self._window.right) + right)[None, :])

    def mean(self) -> Array:
        """The picture."""
        seen = self._seen[..., None]
        return np.divide(self._sum, seen, out=self._sum, where=seen > 0.0)


def _shift_and_sum(
    field: LightField,
    inverses: list[float],
    weights: Array,
    interpolation: Interpolation,
    window: Window,
    update: Update | None,
) -> list[Array]:
    """Pictures focused at one over each of `inverses`: float64 (height, width, 3) of the window."""
    views = field.views
    sums = [_Sum(views, inverse, interpolation, window) for inverse in inverses]
    levels: defaultdict[tuple[float, ...], list[tuple[int, int]]] = defaultdict(list)
    wanted, done = np.argwhere(weights > 0.0), 0
    for row, column in wanted:
        # What is lit differs from view to view, so that each is moved up or down by itself.
        alone = (row, column) if LIT in field.layers else ()
        levels[(float(views.position[row, column, 1]), *alone)].append((int(row), int(column)))
    for places in levels.values():
        downs = [picture.down(*places[0]) for picture in sums]
        first, last = _span(downs, views.height)
        for picture in sums:
            picture.level(first, last)
        for row, column in places:
            # Take out of the view what any of the pictures needs.
            asides = [picture.aside(row, column) for picture in sums]
            start, stop = _span(asides, views.width)
            block = np.asarray(field.radiance[row, column, first:last, start:stop], dtype=np.float64)
            lit = field.lit(row, column)
            if lit is not None:
                block = continued(block, lit[first:last, start:stop])
            for picture, aside in zip(sums, asides, strict=True):
                picture.add(weights[row, column], aside, block, start)
            done += 1
            if update is not None:
                update(done, len(wanted))
        for picture, down in zip(sums, downs, strict=True):
            picture.finish_level(down, first, None if lit is None else picture.lit(*places[0], lit))
    return [picture.mean() for picture in sums]


def _span(shifts: list[Shift], size: int) -> tuple[int, int]:
    """From the first to after the last of the pixels 0 ... size - 1 that shifts have to do with, one at least."""
    first = min(max(min(shift.low for shift in shifts), 0), size - 1)
    return first, max(min(max(shift.high for shift in shifts), size), first + 1)


def _warp_and_sum(
    field: LightField, plane: FocusPlane, weights: Array, interpolation: Interpolation, window: Window
) -> Array:
    """The picture of a tilted plane of focus: float64 (height, width, 3) of the window."""
    from scipy.ndimage import map_coordinates

    views, order = field.views, 1 if interpolation == "linear" else 3
    x, y = np.meshgrid(np.arange(window.left, window.right), np.arange(window.top, window.bottom))
    right = views.plane.left + views.plane.pixel * (x + 0.5)
    up = views.plane.top - views.plane.pixel * (y + 0.5)
    moved = (views.inverse_focus - plane.middle - plane.right * right - plane.up * up) / views.plane.pixel
    total, seen = np.zeros((*x.shape, 3)), np.zeros(x.shape)
    for row, column in np.argwhere(weights > 0.0):
        place_x = x + views.position[row, column, 0] * moved
        place_y = y - views.position[row, column, 1] * moved
        within = (np.abs(place_x - 0.5 * (views.width - 1)) <= 0.5 * views.width) & (
            np.abs(place_y - 0.5 * (views.height - 1)) <= 0.5 * views.height
        )
        if not within.any():
            continue
        view, lit = lit_view(field, row, column)
        if lit is not None:
            within &= at_nearest(lit, place_y, place_x)
        for channel in range(3):
            found = map_coordinates(view[..., channel], [place_y, place_x], order=order, mode="nearest")
            total[..., channel] += weights[row, column] * within * found
        seen += weights[row, column] * within
    return np.divide(total, seen[..., None], out=total, where=seen[..., None] > 0.0)


def re_integrated(
    rays: Rays, views: Views, plane: FocusPlane, opening: Opening, window: Window, scale: float = 1.0
) -> tuple[Array, Array]:
    """The picture of a plane of focus, of rays that were kept, and how many came to each pixel.

    Both float64, (height, width, 3) and (height, width) of the window.  A pixel is the mean of the rays that come to it
    from the plane, through the opening; black where none does.

    Raises
    ------
    InputError : `scale` is not above 0, or the opening is wider than the lens.
    """
    if not 0.0 < scale < math.inf:
        raise InputError(f"scale must be greater than 0 and finite, got {scale:g}")
    if opening.diameter is not None:
        cell_weights(views, *opening)
    pixel = views.plane.pixel / scale
    left, top = round(scale * window.left), round(scale * window.top)
    width, height = round(scale * window.right) - left, round(scale * window.bottom) - top
    if width < 1 or height < 1:
        raise InputError(f"scale {scale:g} leaves no pixel of {window.right - window.left} x {window.bottom - top}")
    sums, count = np.zeros((height * width, 3)), np.zeros(height * width)
    for first in range(0, len(rays.weight), _RAYS_AT_ONCE):
        part = slice(first, first + _RAYS_AT_ONCE)
        right, up, x, y = np.asarray(rays.place[part], dtype=np.float64).T
        slope, rise = x - views.inverse_focus * right, y - views.inverse_focus * up

        # Where it meets the plane: at the tangents slope + q right and rise + q up, with q one over the distance there.
        inverse = (plane.middle + plane.right * slope + plane.up * rise) / (1.0 - plane.right * right - plane.up * up)
        column = np.floor((slope + inverse * right - views.plane.left) / pixel) - left
        row = np.floor((views.plane.top - rise - inverse * up) / pixel) - top
        weight = np.asarray(rays.weight[part], dtype=np.float64)
        value = np.asarray(rays.value[part], dtype=np.float64)
        if opening.diameter is not None:
            passes = transmitted(right - opening.center[0], up - opening.center[1], opening.diameter, opening.shape)
            weight, value = weight * passes, value * passes[:, None]
        hits = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        place = (row[hits] * width + column[hits]).astype(np.int64)
        count += np.bincount(place, weight[hits], minlength=len(count))
        for channel in range(3):
            sums[:, channel] += np.bincount(place, value[hits, channel], minlength=len(count))
    found = np.divide(sums, count[:, None], out=np.zeros_like(sums), where=count[:, None] != 0.0)
    return found.reshape(height, width, 3), count.reshape(height, width)
