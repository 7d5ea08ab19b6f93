"""`rt lightfield info`: prints what a file holds."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.outputs import print_json
from raytracer.cli.lightfield.base import File, open_any

if TYPE_CHECKING:
    from raytracer.film.light_field.field import LightField
    from raytracer.film.light_field.posed_field import PosedLightField
    from raytracer.film.light_field.posed_views import PosedViews

EXAMPLE = """\b
Examples:
  rt lightfield info outputs/array.lf
  rt lightfield info outputs/array.lf --json
  rt lightfield info outputs/array.lf --check     reads all of it, to know that it is whole
  rt lightfield info IMG_0001.lfp                 what a Lytro's photograph says of itself
"""


_ROUNDING = 2.0**-23
"""Part of the size of a scene by which the rounding of poses moves a point, which other programs write in float32."""


def info(
    file: File,
    check: Annotated[bool, Option("--check", help="Read everything, and fail where the file is damaged.")] = False,
    as_json: options.AsJson = False,
) -> None:
    """Show what a light field holds: views, their places and pixels, and where it can be focused.

    Of a .lfp or .lfr file, a photograph by a Lytro, it shows the metadata; --json prints all of them.
    """
    from raytracer.film.light_field import lf
    from raytracer.lightfield.decoding.lytro.container import is_container

    if is_container(file):
        _show_photo(file, check, as_json)
        return
    with open_any(file) as field:
        if check:
            _read_all(field)
        numbers = {**_common_numbers(field), "file_bytes": Path(file).stat().st_size}
        if isinstance(field, lf.OpenPosedField):
            numbers |= _posed_numbers(field.views)
            describe = _posed_lines
        else:
            numbers |= _numbers(field)
            describe = _planar_lines
    if as_json:
        print_json(numbers)
    else:
        print(_format(numbers, describe(numbers)), end="")
        if check:
            print("all of it was read, and is whole")


def _show_photo(file: str, check: bool, as_json: bool) -> None:
    """Show the metadata of a photograph in a container."""
    from raytracer.lightfield.decoding.lytro.photo import open_photo
    from raytracer.lightfield.decoding.lytro.summary import summarize
    from raytracer.util.errors import one_line

    photo = open_photo(file)
    if check:
        photo.read()
    if as_json:
        print_json(dict(photo.all_metadata))
        return
    lines = summarize(photo)
    width = max(map(len, lines))
    print("".join(f"{key:<{width}}  {one_line(text)}\n" for key, text in lines.items()), end="")
    if check:
        print("all of it was read, and is whole")


def _read_all(field: "LightField | PosedLightField") -> None:
    import numpy as np

    samples = () if field.samples is None else (field.samples.value,)
    for array in (field.radiance, *field.layers.values(), *samples):
        for view in np.ndindex(field.views.rows, field.views.columns):
            array[view]
    for part in field.rays or ():
        if part is not None:
            part[:]


def _common_numbers(field: "LightField | PosedLightField") -> dict[str, Any]:
    """Return those of the numbers that `--json` prints which all light fields have."""
    views = field.views
    return {
        "rows": views.rows,
        "columns": views.columns,
        "width": views.width,
        "height": views.height,
        "units": str(field.settings.get("units", "metres")),
        "dtype": str(field.radiance.dtype),
        "bytes": math.prod(field.radiance.shape) * field.radiance.dtype.itemsize,
        "layers": {
            name: {"shape": list(layer.shape), "dtype": str(layer.dtype)} for name, layer in field.layers.items()
        },
        "settings": {
            key: _number(value) if isinstance(value, float) else value for key, value in field.settings.items()
        },
    }


def _posed_numbers(views: "PosedViews") -> dict[str, Any]:
    """Return the numbers of views with poses of their own."""
    import numpy as np

    places = views.pose[..., 0, :].reshape(-1, 3)
    middle = views.focus_point()
    away = None if middle is None else np.linalg.norm(places - middle, axis=1)
    pixel = float(np.median(views.plane[..., 0]))
    return {
        "poses": views.rows * views.columns,
        "pixel": pixel,
        "field_of_view_deg": [2.0 * math.degrees(math.atan(0.5 * n * pixel)) for n in (views.width, views.height)],
        "low": places.min(axis=0).tolist(),
        "high": places.max(axis=0).tolist(),
        "focus_point": None if middle is None else middle.tolist(),
        "distance": None if away is None else [float(away.min()), float(away.max())],
    }


def _numbers(field: "LightField") -> dict[str, Any]:
    """Return the numbers of views in one plane: None for what is not known, "inf" for infinity."""
    import numpy as np

    from raytracer.film.light_field.focusing import refocusable, view_spacing
    from raytracer.lightfield.coverage import lit_views

    views = field.views
    near, far = refocusable(views)
    step = view_spacing(views)
    size = np.ptp(views.position.reshape(-1, 2), axis=0).tolist()
    pixel = views.plane.pixel
    field_of_view = [2.0 * math.degrees(math.atan(0.5 * n * pixel)) for n in (views.width, views.height)]
    return {
        "lit_views": int(lit_views(field).sum()),
        "spacing": [step.right, step.up],
        "extent": size,
        "focus_distance": _number(views.focus_distance),
        "refocus_near": _number(near),
        "refocus_far": _number(far),
        "pixel": pixel,
        "field_of_view_deg": field_of_view,
        "aperture": views.aperture,
        "focal_length_mm": views.focal_length,
        "cell": None if views.cell is None else list(views.cell),
        "pose": None if views.pose is None else views.pose._asdict(),
        "microlenses": 0 if field.samples is None else len(field.samples.place),
        "rays": 0 if field.rays is None else len(field.rays.weight),
    }


def _number(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)


def _format(info: dict[str, Any], geometry: dict[str, str]) -> str:
    """Format the lines that all light fields have, and between them those of the geometry."""
    from raytracer.util.errors import one_line

    unlit = info["rows"] * info["columns"] - info.get("lit_views", info["rows"] * info["columns"])
    lines = {
        "views": f"{info['columns']} x {info['rows']}, each {info['width']} x {info['height']} pixels"
        + (f"; {info['lit_views']} of them got light" if unlit else ""),
        "radiance": f"{info['dtype']}, {info['bytes'] / 1e6:.4g} MB, in a file of {info['file_bytes'] / 1e6:.4g} MB",
        **geometry,
    }
    if info["layers"]:
        lines["layers"] = ", ".join(info["layers"])
    if info.get("microlenses"):
        lines["microlenses"] = f"{info['microlenses']}, between which the views' pixels were interpolated"
    if info.get("rays"):
        lines["rays"] = f"{info['rays']}, kept as they were rendered"
    lines |= {f"  {one_line(key)}": str(value) for key, value in info["settings"].items()}
    width = max(map(len, lines))
    return "".join(f"{key:<{width}}  {one_line(text)}\n" for key, text in lines.items())


def _planar_lines(info: dict[str, Any]) -> dict[str, str]:
    """Describe the geometry of views in one plane."""
    is_metric, lines = info["units"] == "metres", {}
    if is_metric:
        is_one = info["rows"] * info["columns"] == 1
        across, down = info["spacing"]
        wide, high = info["extent"]
        if not is_one:
            lines["spacing"] = (
                f"{_length(across)} to the right, {_length(down)} down; {_length(wide)} x {_length(high)} in all"
            )
        lines["field of view"] = "{:.4g} x {:.4g} deg".format(*info["field_of_view_deg"])
        lines["focus distance"] = _distance(info["focus_distance"])
        near, far = _distance(info["refocus_near"]), _distance(info["refocus_far"])
        if is_one:
            lines["refocusable"] = "by the rays, at any distance" if info["rays"] else "no: there is but one view"
        else:
            lines["refocusable"] = f"{near} to {far}, a pixel from view to view at most"
    else:
        lines["spacing"] = (
            "not known in metres: places are in steps of one view, and 1 / distance is in pixels per view"
        )
    if info["aperture"] is not None:
        lines["aperture"] = _length(info["aperture"]) if is_metric else f"{info['aperture']:.4g} steps of one view"
    if info["focal_length_mm"] is not None:
        lines["focal length"] = f"{info['focal_length_mm']:.6g} mm"
    return lines


def _posed_lines(info: dict[str, Any]) -> dict[str, str]:
    """Describe the geometry of views with poses of their own."""
    unit = " m" if info["units"] == "metres" else ", in a unit that is not known"
    low, high = (", ".join(f"{number:.4g}" for number in info[key]) for key in ("low", "high"))
    lines = {
        "poses": f"{info['poses']}, of its own for each view; from {low} to {high}{unit}",
        "field of view": "{:.4g} x {:.4g} deg".format(*info["field_of_view_deg"]),
    }
    if info["focus_point"] is None:
        return lines | {"all look at": "no point: they look in parallel"}
    near, far = info["distance"]
    least = _ROUNDING * far
    point = ", ".join(f"{0.0 if abs(number) < least else number:.4g}" for number in info["focus_point"])
    first, last = f"{near:.4g}", f"{far:.4g}"
    span = first if first == last else f"{first} to {last}"
    return lines | {"all look at": f"{point}{unit}, or away from it, {span} off"}


def _length(metres: float) -> str:
    return f"{metres:.4g} m" if metres >= 1.0 else f"{1e3 * metres:.4g} mm"


def _distance(metres: float | str) -> str:
    return "infinity" if isinstance(metres, str) else f"{metres:.4g} m"
