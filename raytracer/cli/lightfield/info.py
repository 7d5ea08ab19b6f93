"""`rt lightfield info`: prints what a file holds."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.outputs import print_json
from raytracer.cli.lightfield.base import File, open_light_field

if TYPE_CHECKING:
    from raytracer.film.light_field.field import LightField

EXAMPLE = """\b
Examples:
  rt lightfield info outputs/array.lf
  rt lightfield info outputs/array.lf --json
  rt lightfield info outputs/array.lf --check     reads all of it, to know that it is whole
  rt lightfield info IMG_0001.lfp                 what a Lytro's photograph says of itself
"""


def info(
    file: File,
    check: Annotated[bool, Option("--check", help="Read everything, and fail where the file is damaged.")] = False,
    as_json: options.AsJson = False,
) -> None:
    """Show what a light field holds: views, their places and pixels, and where it can be focused.

    Of a .lfp or .lfr file, a photograph by a Lytro, it shows the metadata; --json prints all of them.
    """
    from raytracer.lightfield.decoding.lytro.container import is_container

    if is_container(file):
        _show_photo(file, check, as_json)
        return
    with open_light_field(file) as field:
        if check:
            _read_all(field)
        numbers = {**_numbers(field), "file_bytes": Path(file).stat().st_size}
    if as_json:
        print_json(numbers)
    else:
        print(_format(numbers), end="")
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


def _read_all(field: "LightField") -> None:
    import numpy as np

    samples = () if field.samples is None else (field.samples.value,)
    for array in (field.radiance, *field.layers.values(), *samples):
        for view in np.ndindex(field.views.rows, field.views.columns):
            array[view]
    for part in field.rays or ():
        if part is not None:
            part[:]


def _numbers(field: "LightField") -> dict[str, Any]:
    """Return the numbers that `--json` prints: None for what is not known, "inf" for infinity."""
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
        "rows": views.rows,
        "columns": views.columns,
        "lit_views": int(lit_views(field).sum()),
        "width": views.width,
        "height": views.height,
        "units": str(field.settings.get("units", "metres")),
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
        "dtype": str(field.radiance.dtype),
        "bytes": math.prod(field.radiance.shape) * field.radiance.dtype.itemsize,
        "layers": {
            name: {"shape": list(layer.shape), "dtype": str(layer.dtype)} for name, layer in field.layers.items()
        },
        "microlenses": 0 if field.samples is None else len(field.samples.place),
        "rays": 0 if field.rays is None else len(field.rays.weight),
        "settings": {
            key: _number(value) if isinstance(value, float) else value for key, value in field.settings.items()
        },
    }


def _number(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)


def _format(info: dict[str, Any]) -> str:
    from raytracer.util.errors import one_line

    is_metric = info["units"] == "metres"
    unlit = info["rows"] * info["columns"] - info["lit_views"]
    lines = {
        "views": f"{info['columns']} x {info['rows']}, each {info['width']} x {info['height']} pixels"
        + (f"; {info['lit_views']} of them got light" if unlit else ""),
        "radiance": f"{info['dtype']}, {info['bytes'] / 1e6:.4g} MB, in a file of {info['file_bytes'] / 1e6:.4g} MB",
    }
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
    if info["layers"]:
        lines["layers"] = ", ".join(info["layers"])
    if info["microlenses"]:
        lines["microlenses"] = f"{info['microlenses']}, between which the views' pixels were interpolated"
    if info["rays"]:
        lines["rays"] = f"{info['rays']}, kept as they were rendered"
    lines |= {f"  {one_line(key)}": str(value) for key, value in info["settings"].items()}
    width = max(map(len, lines))
    return "".join(f"{key:<{width}}  {one_line(text)}\n" for key, text in lines.items())


def _length(metres: float) -> str:
    return f"{metres:.4g} m" if metres >= 1.0 else f"{1e3 * metres:.4g} mm"


def _distance(metres: float | str) -> str:
    return "infinity" if isinstance(metres, str) else f"{metres:.4g} m"
