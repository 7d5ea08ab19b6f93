"""Photographs that are focused after the shot, in metres.

The picture of a lens focused at 1 / w is, at the place x, the mean over all points u of the lens of the light that
comes from the point there: I(x) = mean over u of L(u, x - u (w - w0)), with L as in `film.light_field.views`.  It has
the framing of the views.

References: Isaksen, McMillan, Gortler 2000, "Dynamically Reparameterized Light Fields"; Ng et al. 2005, "Light Field
Photography with a Hand-held Plenoptic Camera", sec. 3; Ng 2005, "Fourier Slice Photography", eq. 4.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple, TypeAlias, TypedDict, Unpack, get_args

import numpy as np
from numpy.typing import NDArray

from raytracer.film.image import Image
from raytracer.film.light_field.field import LightField, Rays
from raytracer.film.light_field.focusing import FocusPlane, alpha_to_inverse_distance, slope_to_inverse_distance
from raytracer.film.light_field.views import Views
from raytracer.film.window import Window, crop_window
from raytracer.lightfield.memory import count_that_fit
from raytracer.lightfield.refocusing.ray_integration import integrate_rays
from raytracer.lightfield.refocusing.shift_and_sum import INTERPOLATIONS, Interpolation, shift_and_sum, warp_and_sum
from raytracer.lightfield.synthetic_aperture import RefocusAperture, cell_weights, make_aperture
from raytracer.plugins.apertures.base.interface import ApertureSpec
from raytracer.util.errors import InputError
from raytracer.util.progress import Update, report_progress

FloatArray = NDArray[np.float64]

Method: TypeAlias = Literal["shift", "fourier", "rays"]

METHODS: tuple[Method, ...] = get_args(Method)

EMPTY_PIXELS_KEY = "pixels_without_rays"
"""Setting of a picture by rays: the number of its pixels that no ray came to, which are black."""


class RefocusOptions(TypedDict, total=False):
    """Keyword options of `refocus` and `focal_stack`, which explains them; defaults are those of `_Settings`."""

    f_number: float | None
    aperture: float | None
    aperture_shape: ApertureSpec | str | None
    center: tuple[float, float]
    tilt: float
    swing: float
    method: Method
    interpolation: Interpolation
    crop: tuple[int, int, int, int] | None
    scale: float
    update: Update | None


class _Settings(NamedTuple):
    """Options of `refocus` with their defaults."""

    f_number: float | None = None
    aperture: float | None = None
    aperture_shape: ApertureSpec | str | None = None
    center: tuple[float, float] = (0.0, 0.0)
    tilt: float = 0.0
    swing: float = 0.0
    method: Method = "shift"
    interpolation: Interpolation = "lanczos"
    crop: tuple[int, int, int, int] | None = None
    scale: float = 1.0
    update: Update | None = None


def refocus(
    field: LightField,
    distance: float | None = None,
    *,
    alpha: float | None = None,
    slope: float | None = None,
    **options: Unpack[RefocusOptions],
) -> Image:
    """Focus a light field at a distance: the photograph of a lens that was focused there.

    Its brightness is that of the whole opening: radiance stays what it is, whatever the aperture.

    Parameters
    ----------
    distance : of the plane of focus (m), along the axis, from the plane of the views; inf allowed; by default that in
        which all views see the same.
    alpha : in its place, the ratio of the film's distance from the lens to that which the views have (Ng 2005);
        `focusing.alpha_to_inverse_distance`.
    slope : in its place, the pixels that a point in focus moves from view to view, against the view; greater for
        nearer points.  The only way for light fields without metres.
    f_number, aperture : of the opening, or its diameter (m); by default all that the views look through.
    aperture_shape : the same as for a lens in a scene, a spec or the name of one, of the area of that disc.
    center : of the opening, right and up (m): the photograph is taken from there.
    tilt, swing : angles by which the plane of focus leans away at its top, and to the right (deg).
    method : "shift", shift-and-sum of the views; "fourier", a slice of their spectrum; "rays", a sum over the rays
        that were kept, each through the point where it went.
    interpolation : of "shift", between pixels; a tilted plane takes splines of the order of linear or else cubic.
    crop : (x0, y0, x1, y1), the pixels x0 <= x < x1, y0 <= y < y1 only.  By "shift" no more is read than it needs.
    scale : of "rays", pixels of the picture along one of the views'.
    update : called with the work that is done, and with all of it.

    Pixels that not all views see, or that not all have light at, are the mean of those that do; by "fourier", pixels
    without light in a view are taken from their neighbours.

    Raises
    ------
    InputError : the light field, or the method, cannot do what the options ask for.
    """
    settings = _Settings(**options)
    return next(_refocus_planes(field, [_inverse_distance(field, distance, alpha, slope)], settings))


def focal_stack(
    field: LightField,
    distances: Sequence[float] = (),
    *,
    slopes: Sequence[float] = (),
    **options: Unpack[RefocusOptions],
) -> list[Image]:
    """Focus as `refocus` at several distances (m) or slopes: each view is read once, or transformed once, for all.

    Raises
    ------
    InputError : as `refocus`; or neither distances nor slopes are given, or both.
    """
    return list(iterate_focal_stack(field, distances, slopes=slopes, **options))


def iterate_focal_stack(
    field: LightField,
    distances: Sequence[float] = (),
    *,
    slopes: Sequence[float] = (),
    **options: Unpack[RefocusOptions],
) -> Iterator[Image]:
    """Focus as `focal_stack`, one picture after the other: as many are made at once as fit into memory.

    It is `lightfield.memory.memory_limit` that gives the memory.

    Raises
    ------
    InputError : as `focal_stack`.
    """
    if (len(distances) == 0) == (len(slopes) == 0):
        raise InputError("a focal stack needs distances, or slopes")
    settings = _Settings(**options)
    inverses = [_inverse_distance(field, distance, None, None) for distance in distances]
    inverses += [_inverse_distance(field, None, None, slope) for slope in slopes]
    return _refocus_planes(field, inverses, settings)


def _inverse_distance(field: LightField, distance: float | None, alpha: float | None, slope: float | None) -> float:
    """Compute one over the distance of the plane of focus (1/m), from the one of three options that is given."""
    views = field.views
    given = {"distance": distance, "alpha": alpha, "slope": slope}
    names = [name for name, value in given.items() if value is not None]
    if len(names) > 1:
        raise InputError(f"{names[0]} and {names[1]} both set the plane of focus: give one of them")
    if names and names[0] != "slope" and not field.is_metric:
        raise InputError(f"this light field does not know how large it is, so {names[0]} says nothing: give a slope")
    try:
        if alpha is not None:
            return alpha_to_inverse_distance(views, alpha)
        if slope is not None:
            return slope_to_inverse_distance(views, slope)
    except ValueError as error:
        raise InputError(str(error)) from None
    if distance is None:
        return views.inverse_focus
    if not distance > 0.0:
        raise InputError(f"a plane of focus must be farther than 0, got {distance:g} m")
    return 1.0 / distance


def _focus_plane(inverse: float, tilt: float, swing: float) -> FocusPlane:
    """Make the plane of focus at one over a distance on the axis (1/m), tilted and swung (deg)."""
    for name, angle in (("tilt", tilt), ("swing", swing)):
        if not -90.0 < angle < 90.0:
            raise InputError(f"{name} must be between -90 and 90 degrees, got {angle:g}")
    # Of the plane through (0, 0, d) along (1, 0, tan swing) and (0, 1, tan tilt), seen at the tangents x and y:
    # z = d + z x tan swing + z y tan tilt.
    return FocusPlane(inverse, -inverse * math.tan(math.radians(swing)), -inverse * math.tan(math.radians(tilt)))


def _refocus_planes(field: LightField, inverses: list[float], settings: _Settings) -> Iterator[Image]:
    """Focus at one over each of `inverses` (1/m), by the method of the settings."""
    planes = [_focus_plane(inverse, settings.tilt, settings.swing) for inverse in inverses]
    aperture = make_aperture(
        field.views, settings.f_number, settings.aperture, settings.aperture_shape, settings.center
    )
    method = settings.method
    if method not in METHODS:
        raise InputError(f"method must be one of {', '.join(METHODS)}, got {method}")
    if settings.interpolation not in INTERPOLATIONS:
        raise InputError(f"interpolation must be one of {', '.join(INTERPOLATIONS)}, got {settings.interpolation}")
    if settings.scale != 1.0 and method != "rays":
        raise InputError("only method rays has a scale: views have pixels of their own")
    window = crop_window((field.views.width, field.views.height), settings.crop, "a view")
    pictures: Iterator[tuple[FloatArray, dict[str, int]]]
    if method == "rays":
        if field.rays is None:
            raise InputError("there are no rays in this light field: render it with --aov rays, or refocus by shift")
        pictures = _integrate_planes(field.rays, field.views, planes, aperture, window, settings)
    elif field.views.rows * field.views.columns == 1:
        raise InputError(
            "there is but one view, which has its focus for good" + (": refocus by rays" if field.rays else "")
        )
    else:
        pictures = ((picture, {}) for picture in _sum_views(field, planes, aperture, window, settings))
    for (picture, note), plane in zip(pictures, planes, strict=True):
        yield Image(radiance=picture, settings={**field.settings, **_image_settings(plane, aperture, method), **note})


def _integrate_planes(
    rays: Rays, views: Views, planes: list[FocusPlane], aperture: RefocusAperture, window: Window, settings: _Settings
) -> Iterator[tuple[FloatArray, dict[str, int]]]:
    """Integrate the rays into the picture of each plane, and count the pixels that none came to."""
    for plane in report_progress(planes, settings.update):
        picture, count = integrate_rays(rays, views, plane, aperture, window, settings.scale)
        yield picture, {EMPTY_PIXELS_KEY: int((count == 0.0).sum())}


_PLANE_BYTES, _VIEW_BYTES = 64, 320
"""Bytes a pixel of a picture that is summed up, and of what else there is meanwhile: a view, a row of them, a shift."""


def _sum_views(
    field: LightField, planes: list[FocusPlane], aperture: RefocusAperture, window: Window, settings: _Settings
) -> Iterator[FloatArray]:
    """Sum the views into the picture of each plane, shifted, warped, or as slices of their spectrum."""
    weights = cell_weights(field.views, *aperture)
    is_tilted = any(plane.right != 0.0 or plane.up != 0.0 for plane in planes)
    inverses = [plane.middle for plane in planes]
    if settings.method == "fourier":
        if is_tilted:
            raise InputError("a tilted plane is no slice of the spectrum: refocus by shift")
        from raytracer.lightfield.refocusing.fourier import FourierRefocuser

        refocuser = FourierRefocuser(field, inverses, weights)
        rows, columns = slice(window.top, window.bottom), slice(window.left, window.right)
        for inverse in report_progress(inverses, settings.update):
            yield refocuser.picture(inverse)[rows, columns]
        return
    width, height = window.right - window.left, window.bottom - window.top
    # Tilted planes are made one by one, of whole views.
    fixed = _VIEW_BYTES * (field.views.width * field.views.height if is_tilted else width * height)
    size = f"refocusing {width} x {height} pixels"
    most = count_that_fit(fixed, _PLANE_BYTES * width * height, size, "a smaller --crop takes less")
    if is_tilted:
        for plane in report_progress(planes, settings.update):
            yield warp_and_sum(field, plane, weights, settings.interpolation, window)
        return
    starts = range(0, len(inverses), most)
    for number, first in enumerate(starts):

        def update(done: float, total: float, number: int = number) -> None:
            if settings.update is not None:
                settings.update(number * total + done, len(starts) * total)

        part = inverses[first : first + most]
        yield from shift_and_sum(field, part, weights, settings.interpolation, window, update)


def _image_settings(plane: FocusPlane, aperture: RefocusAperture, method: Method) -> dict[str, str | float | int]:
    """Collect the settings of a photograph for the headers of files."""
    settings: dict[str, str | float | int] = {
        # Without the last digits, which are rounding of one over one over it.
        "refocused_m": float(f"{1.0 / plane.middle:.14g}") if plane.middle else math.inf,
        "refocused_by": method,
    }
    if aperture.diameter is not None:
        settings["aperture_mm"] = 1e3 * aperture.diameter
    return settings
