"""`rt convert`: from image files to others, developed anew."""

import glob
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from raytracer.cli.base import options
from raytracer.cli.base.completion import complete_from
from raytracer.cli.base.options import Sizing, takes
from raytracer.cli.base.outputs import report_written
from raytracer.cli.base.picture_names import name_pictures
from raytracer.rendering.options import parse_crop
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from raytracer.film.image import Image
    from raytracer.scene.render_settings import Film

EXAMPLE = """\b
Examples:
  rt convert cover.exr cover.png --exposure 1.5 --tone-curve filmic
  rt convert cover.exr cover.jpg --white-balance 3200K --crop 100,50,740,410 --size 320x180
  rt convert frames/*.exr pngs/ --tone-curve filmic
  rt convert depth.pfm depth.npy
"""

_MOST_EV = 100.0


def convert(
    inputs: Annotated[list[str], Argument(metavar="IN...", help="Images: .exr .hdr .npy .pfm linear, .png .jpg.")],
    output: Annotated[
        str, Argument(metavar="OUT", help="Image to write; or a folder, FOLDER/, for one or many; or -.")
    ],
    image_format: Annotated[
        str | None,
        takes(
            "SUFFIX",
            "Format of images in a folder, or on standard output: png, exr, ...  Default: png.",
            "--format",
            autocompletion=complete_from("png", "jpg", "exr", "hdr", "npy", "pfm"),
        ),
    ] = None,
    exposure: Annotated[float, takes("EV", "Stops by which to make them brighter: 1 is twice the light.")] = 0.0,
    white_balance: Annotated[
        str | None, takes("LIGHT", "Light that is to look white: auto, 3200K, or gains [0.6, 1, 2.4].")
    ] = None,
    tone_curve: Annotated[
        str | None,
        takes("CURVE", "How .png and .jpg show linear values: linear, filmic, or {type: filmic, white: 8}."),
    ] = None,
    crop: Annotated[str | None, takes("X0,Y0,X1,Y1", "Keep only the pixels X0 <= x < X1, Y0 <= y < Y1.")] = None,
    size: Annotated[str | None, takes("WxH", "Scale what is left to this many pixels: 640x360.")] = None,
    scale: Annotated[str | None, takes("PERCENT", "Scale what is left by this: 50%.")] = None,
    quiet: Annotated[bool, Option("--quiet", "-q", help="Do not say what was written.")] = False,
) -> None:
    """Write images in another format: exposed, balanced, cropped and scaled in linear light.

    The steps are taken in this order: crop, size, exposure, white balance, and the tone curve if the file is for a
    display.  An image that needs none of them keeps its numbers, as far as the format holds them.
    """
    from raytracer.film.image_file import check_writable, load

    if not math.isfinite(exposure) or abs(exposure) > _MOST_EV:
        raise InputError(f"--exposure {exposure:g}: must be stops, from {-_MOST_EV:g} to {_MOST_EV:g}")
    film = _parse_film(white_balance, tone_curve)
    window = None if crop is None else options.parse_value("--crop", crop, parse_crop)
    sizing = options.parse_sizing(size, scale)
    names = [name for word in inputs for name in _expand(word)]
    named = {name: paths[0] for name, paths in name_pictures(names, [output], image_format).items()}
    for path in named.values():
        check_writable(path)
    for name, path in named.items():
        pixels = _scale(_crop(load(name), window, name), sizing)
        _develop(pixels * 2.0**exposure, film).save(path)
        report_written(path, quiet=quiet)


def _expand(word: str) -> list[str]:
    """List the files of a pattern, which a shell may have left as it is."""
    if not glob.has_magic(word) or Path(word).exists():
        return [word]
    if not (names := sorted(glob.glob(word))):
        raise InputError(f"{word}: no such files")
    return names


def _parse_film(white_balance: str | None, tone_curve: str | None) -> "Film":
    """Parse the two settings as those of a scene's film."""
    from pydantic import ValidationError

    from raytracer.scene.overrides import parse_overrides
    from raytracer.scene.render_settings import Film
    from raytracer.schema.validation_errors import error_sentence

    words = {"white_balance": white_balance, "tone_curve": tone_curve}
    values = parse_overrides(f"{key}={text}" for key, text in words.items() if text is not None)
    try:
        return Film.model_validate({"width": 1, "height": 1, **values})
    except ValidationError as error:
        detail = error.errors(include_url=False)[0]
        key = str(detail["loc"][0])
        raise InputError(f"--{key.replace('_', '-')} {words[key]}: {error_sentence(detail)}") from None


def _crop(pixels: "NDArray[np.float64]", crop: tuple[int, int, int, int] | None, name: str) -> "NDArray[np.float64]":
    """Cut out the pixels of a crop."""
    from raytracer.film.window import crop_window

    height, width, _ = pixels.shape
    window = crop_window((width, height), crop, name)
    return pixels[window.top : window.bottom, window.left : window.right]


def _scale(pixels: "NDArray[np.float64]", sizing: Sizing) -> "NDArray[np.float64]":
    """Scale an image by a triangle filter, which gives no values beyond those that are there."""
    import numpy as np
    import PIL.Image

    height, width, _ = pixels.shape
    size = sizing.of(width, height)
    if size == (width, height):
        return pixels
    channels = [PIL.Image.fromarray(channel.astype(np.float32)) for channel in np.moveaxis(pixels, 2, 0)]
    scaled = [np.asarray(each.resize(size, PIL.Image.Resampling.BILINEAR), np.float64) for each in channels]
    return np.stack(scaled, axis=2)


def _develop(pixels: "NDArray[np.float64]", film: "Film") -> "Image":
    """Balance an image, and give it the tone curve."""
    from raytracer.film.exposure import CropWindow
    from raytracer.film.image import Image
    from raytracer.film.photograph import DevelopSettings, develop_photograph

    height, width, _ = pixels.shape
    settings = DevelopSettings(None, None, film.white_balance, film.tone_curve)
    return develop_photograph(Image(pixels), settings, CropWindow(width, height, 0, 0), 0, {})[0]
