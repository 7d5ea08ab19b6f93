"""`rt lightfield refocus`: photographs that are focused after the shot."""

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import print_json, report_written
from raytracer.cli.lightfield import base
from raytracer.cli.lightfield.base import File, Memory, Quiet
from raytracer.rendering.options import parse_crop
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from raytracer.film.image import Image
    from raytracer.film.light_field.field import LightField

EXAMPLE = """\b
Examples:
  rt lightfield refocus array.lf --distance 2.5 -o near.png
  rt lightfield refocus array.lf --distance 1:4:20 -o stack.gif             20 planes from 1 to 4 m
  rt lightfield refocus array.lf --distance 1:inf:20:inverse -o stack.webp  by equal steps of 1/distance
  rt lightfield refocus lytro.lf --distance 80cm --f-number 18 -o deep.exr
  rt lightfield refocus array.lf --distance 2 --aperture 40mm --aperture-shape "{type: polygon, blades: 6}" -o bokeh.png
  rt lightfield refocus array.lf --distance 2 --tilt 60deg -o table.png
  rt lightfield refocus rays.lf --distance 2 --method rays -o exact.exr

\b
Several distances, as a list or START:STOP:COUNT, make a focal stack: one .gif or .webp that runs through it, or a
picture each, numbered.
"""

_MOST_PLANES = 10_000

_FRAME_BYTES = 6
"""Bytes a pixel of an animation's frame, until all are encoded."""


def refocus(
    file: File,
    output: Annotated[list[Path], options.output("OUT", ".png .jpg .exr .hdr .npy, or .gif .webp.  May repeat.")],
    distance: Annotated[
        list[str] | None,
        takes(
            "LENGTH",
            "Plane of focus along the axis: 2.5, 80cm, inf; 1,2,4; or START:STOP:COUNT.  May repeat.  Default: "
            "the plane in which all views see the same.",
            "--distance",
            "-d",
        ),
    ] = None,
    alpha: Annotated[
        float | None, takes("A", "In place of a distance: how many times as far from the lens the film is.")
    ] = None,
    slope: Annotated[
        list[str] | None,
        takes("PX", "In place of a distance: pixels by which what is in focus moves from view to view; also a range."),
    ] = None,
    f_number: Annotated[float | None, takes("N", "Aperture.  Default: all that there is.", "--f-number")] = None,
    aperture: Annotated[
        str | None, takes("LENGTH", "Its diameter, in place of an f-number: 40mm (plain: metres).")
    ] = None,
    aperture_shape: Annotated[
        str | None, takes("SHAPE", "Its shape, as in a scene: {type: polygon, blades: 6}.")
    ] = None,
    center: Annotated[str | None, takes("X,Y", "Its middle, right and up from that of the lens: 2mm,0.")] = None,
    tilt: Annotated[str, takes("ANGLE", "By how much the plane of focus leans away at its top.")] = "0",
    swing: Annotated[str, takes("ANGLE", "By how much it leans away to the right.")] = "0",
    method: Annotated[
        str,
        takes(
            "NAME",
            "shift, fourier (sooner done for many planes), or rays, where they are kept.",
            autocompletion=complete_from("shift", "fourier", "rays"),
        ),
    ] = "shift",
    interpolation: Annotated[str, takes("NAME", "Between pixels, of shift: lanczos, cubic or linear.")] = "lanczos",
    scale: Annotated[float, takes("X", "Of rays: pixels of the picture along one of the views'.")] = 1.0,
    crop: options.Crop = None,
    fps: Annotated[float, Option(help="Pictures a second of an animation.", min=0.1, max=50.0)] = 8.0,
    as_json: options.AsJson = False,
    memory: Memory = "2GB",
    quiet: Quiet = False,
) -> None:
    """Focus a light field: the photograph that a lens would have taken, focused at a distance in metres."""
    from raytracer.film.formats.registry import animation_suffixes

    distances = _numbers("--distance", distance, "length")
    slopes = _numbers("--slope", slope, "number")
    if sum(map(bool, (distances, slopes, alpha is not None))) > 1:
        raise InputError("--distance, --alpha and --slope set the plane of focus: give one of them")
    animations = animation_suffixes(with_images=False)
    base.check_outputs(output, (*base.picture_suffixes(), *animations), "a photograph")
    planes = max(len(distances), len(slopes))
    for path in output:
        if path.suffix.lower() in animations and planes < 2:
            raise InputError(f"{path}: an animation needs several distances: --distance 1:4:20")
    arguments: dict[str, Any] = {
        "f_number": f_number,
        "aperture": None if aperture is None else options.parse_dimension("--aperture", aperture, "length"),
        "aperture_shape": aperture_shape,
        "center": _center(center),
        "tilt": options.parse_dimension("--tilt", tilt, "angle"),
        "swing": options.parse_dimension("--swing", swing, "angle"),
        "method": method,
        "interpolation": interpolation,
        "scale": scale,
        "crop": None if crop is None else options.parse_value("--crop", crop, parse_crop),
    }

    from raytracer.lightfield.refocusing.refocus import iterate_focal_stack
    from raytracer.lightfield.refocusing.refocus import refocus as refocus_field
    from raytracer.util.progress import Bar

    with base.open_within(file, memory) as field, Bar(" steps", quiet=quiet) as bar:
        arguments["update"] = bar.update
        with options.name_in_errors(file):
            if planes > 1:
                images = iterate_focal_stack(field, distances, slopes=slopes, **arguments)
            else:
                plane = (*distances, None)[0], (*slopes, None)[0]
                images = iter([refocus_field(field, plane[0], alpha=alpha, slope=plane[1], **arguments)])
            files, taken = _write(images, planes, output, fps)
        note = _note_out_of_range(field, taken) or _note_black_pixels(taken)
    report_written(*files, quiet=quiet)
    if note and not quiet:
        print(f"note: {note}", file=sys.stderr)
    if as_json:
        print_json(_to_json(field, taken, files))


# ---- Options


def _numbers(option: str, texts: list[str] | None, dimension: Literal["length", "number"]) -> list[float]:
    """Parse an option that may repeat, each time a list of numbers and ranges."""
    return [
        number for text in texts or () for part in text.split(",") for number in _range(option, part.strip(), dimension)
    ]


def _range(option: str, text: str, dimension: Literal["length", "number"]) -> list[float]:
    """Parse START:STOP:COUNT, START:STOP:COUNT:inverse, or a number."""
    parts = text.split(":")
    if len(parts) == 1:
        return [options.parse_dimension(option, text, dimension)]
    is_inverse = len(parts) == 4 and parts[3].strip() == "inverse" and dimension == "length"
    if not (len(parts) == 3 or is_inverse) or not parts[2].strip().isdecimal():
        form = "START:STOP:COUNT, such as 1:4:20" + (", or 1:inf:20:inverse" if dimension == "length" else "")
        raise InputError(f"{option} {text}: a range is {form}")
    start, stop = (options.parse_dimension(option, part, dimension) for part in parts[:2])
    count = int(parts[2])
    if not 2 <= count <= _MOST_PLANES:
        raise InputError(f"{option} {text}: a range has from 2 to {_MOST_PLANES} planes")
    if is_inverse:
        if min(start, stop) <= 0.0:
            raise InputError(f"{option} {text}: distances must be greater than 0")
        inverses = _steps(1.0 / start, 1.0 / stop, count)
        return [1.0 / inverse if inverse > 0.0 else math.inf for inverse in inverses]
    if not (math.isfinite(start) and math.isfinite(stop)):
        more = f": to infinity by equal steps of 1/distance: {':'.join(parts)}:inverse" if dimension == "length" else ""
        raise InputError(f"{option} {text}: has no equal steps{more}")
    return _steps(start, stop, count)


def _steps(start: float, stop: float, count: int) -> list[float]:
    """Return numbers at equal steps; the first and the last are exact."""
    between = [start + (stop - start) * number / (count - 1) for number in range(1, count - 1)]
    return [start, *between, stop]


def _center(text: str | None) -> tuple[float, float]:
    if text is None:
        return 0.0, 0.0
    right, up = base.parse_position("--center", text)
    if not (math.isfinite(right) and math.isfinite(up)):
        raise InputError(f"--center {text}: must be finite")
    return right, up


# ---- Results


class _Taken(NamedTuple):
    """Settings and size of a picture that was written.

    settings : that it was made with.
    pixels : number of its pixels.
    """

    settings: "Mapping[str, str | float | int]"
    pixels: int


def _write(images: "Iterator[Image]", count: int, output: list[Path], fps: float) -> tuple[list[Path], list[_Taken]]:
    """Write each picture as it comes, to numbered files if there are several; animations at the end.

    Returns the files, and what is to be known of the pictures.
    """
    from raytracer.film.formats.registry import animation_suffixes
    from raytracer.lightfield.memory import require_memory
    from raytracer.util.atomic_write import write_bytes

    animations = [path for path in output if path.suffix.lower() in animation_suffixes(with_images=False)]
    files: dict[Path, list[Path]] = {path: [] for path in output}
    frames, taken = [], []
    for number, image in enumerate(images, 1):
        taken.append(_Taken(image.settings, image.radiance[..., 0].size))
        if animations:
            size = _FRAME_BYTES * count * taken[0].pixels
            require_memory(size, f"an animation of {count} planes", "numbered pictures take less")
            frames.append(image.display())
        for path in output:
            if path not in animations:
                name = path.name if count <= 1 else f"{path.stem}_{number:0{len(str(count))}}{path.suffix}"
                files[path].append(path.with_name(name))
                image.save(files[path][-1])
    for path in animations:
        from raytracer.film.animation import encode

        write_bytes(path, encode(frames, path.suffix.lower().removeprefix("."), fps=fps, boomerang=True))
        files[path].append(path)
    return [file for path in output for file in files[path]], taken


def _note_out_of_range(field: "LightField", images: list[_Taken]) -> str | None:
    """Return a note if a plane of focus is beyond those for which the views are close enough together."""
    from raytracer.film.light_field.focusing import refocusable

    if images[0].settings["refocused_by"] == "rays" or not field.is_metric:
        return None
    near, far = refocusable(field.views)
    distances = [float(image.settings["refocused_m"]) for image in images]
    outside = [distance for distance in distances if not near <= distance <= far]
    if not outside:
        return None
    planes = f"{outside[0]:.4g} m is" if len(outside) == 1 else f"{len(outside)} planes are"
    return (
        f"{planes} beyond {near:.4g} to {far:.4g} m, within which views next to each other differ by a pixel at most: "
        "edges out of focus come apart"
    )


def _note_black_pixels(images: list[_Taken]) -> str | None:
    """Return a note if rays leave pixels black."""
    from raytracer.lightfield.refocusing.refocus import EMPTY_PIXELS_KEY

    share = max(float(image.settings.get(EMPTY_PIXELS_KEY, 0)) / image.pixels for image in images)
    if share == 0.0:
        return None
    from raytracer.report.wording import format_percent

    black = f"no ray comes to {format_percent(share)} of the pixels, which are black"
    return f"{black}: more spp, a wider aperture, or a smaller scale"


def _to_json(field: "LightField", images: list[_Taken], files: list[Path]) -> dict[str, Any]:
    """Return the data for `--json`: distances in metres, or slopes in pixels per view if metres are not known."""
    from raytracer.film.light_field.focusing import refocusable, view_spacing

    def finite(number: float) -> float | None:
        return number if math.isfinite(number) else None

    distances = [float(image.settings["refocused_m"]) for image in images]
    names = [str(path) for path in files]
    if not field.is_metric:
        step = max(view_spacing(field.views)) / field.views.plane.pixel
        slopes = [step * (1.0 / distance - field.views.inverse_focus) for distance in distances]
        return {"slopes_px": slopes, "files": names}
    near, far = refocusable(field.views)
    return {
        "distances_m": [finite(distance) for distance in distances],
        "refocusable_m": [finite(near), finite(far)],
        "files": names,
    }
