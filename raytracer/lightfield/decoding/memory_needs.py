"""Memory that decoding of a raw picture takes, and its refusal where that is more than is given."""

from raytracer.lightfield.memory import require_memory

_CHANNEL_BYTES, _DARK_BYTES, _MOSAIC_BYTES, _SOURCE_BYTES = 21, 4, 11, 12
"""Bytes a pixel of the raw picture: for each channel, and more for each with a dark picture; with colour filters; and
where pictures are in memory already, as those of containers are."""

_HELD_BYTES, _GRID_BYTES, _LARGEST_GRID, _LIT_BYTES = 16, 290, 190_000_000, 13
"""To look for the grid: bytes a pixel and channel of the pictures beside it; bytes a pixel of small pictures, and most
bytes, for the cells and the spectrum, which are of a part of large ones; and bytes a pixel for what of it is lit."""

_VIEW_PIXEL_BYTES, _VIEW_BYTES = 2000, 40_000
"""Bytes a pixel of one view, for what is interpolated and for the views that threads make; and of each view, for the
part of the lens that it sees."""

_RAY_BYTES = 350
"""Bytes a pixel of the raw picture of a focused camera, or of all views if they have more, for its rays and these."""

_INSTEAD = "pictures of which the borders are cut off take less"


def require_decoding(
    name: str, shape: tuple[int, ...], *, has_dark: bool, is_mosaic: bool, in_memory: bool, finds_grid: bool
) -> None:
    """Refuse to prepare a raw picture of some shape, (height, width) or (height, width, channels), that does not fit.

    name : of the picture, for the sentence.
    in_memory : the caller holds the pictures.

    Raises
    ------
    InputError : it takes more memory than is given.
    """
    height, width = shape[:2]
    pixels, channels = width * height, shape[2] if len(shape) > 2 else 1
    held = (_DARK_BYTES * channels if has_dark else 0) + (_SOURCE_BYTES if in_memory else 0)
    size = pixels * (held + _CHANNEL_BYTES * channels + (_MOSAIC_BYTES if is_mosaic else 0))
    if finds_grid:
        looking = max(min(_GRID_BYTES * pixels, _LARGEST_GRID), _LIT_BYTES * pixels)
        size = max(size, pixels * (held + _HELD_BYTES * channels) + looking)
    require_memory(size, f"decoding {name}, {width} x {height} pixels,", _INSTEAD)


def require_views(name: str, kept: int, count: int, width: int, height: int) -> None:
    """Refuse to make count x count views of width x height pixels if that does not fit beside `kept` bytes.

    Raises
    ------
    InputError : it takes more memory than is given.
    """
    size = kept + _VIEW_PIXEL_BYTES * width * height + _VIEW_BYTES * count * count
    require_memory(size, f"making {count} x {count} views of {name}", _INSTEAD)


def require_light_field(name: str, stored: int) -> None:
    """Refuse to keep all views in memory if their `stored` bytes do not fit.

    Raises
    ------
    InputError : they take more memory than is given.
    """
    require_memory(stored, f"keeping all views of {name}", "fewer views (--views) take less")


def require_rays(name: str, raw_pixels: int, view_pixels: int) -> None:
    """Refuse to make the rays and all views of a raw picture of a focused camera that do not fit.

    Raises
    ------
    InputError : it takes more memory than is given.
    """
    pixels = max(raw_pixels, view_pixels)
    require_memory(_RAY_BYTES * pixels, f"sorting the rays of {name} into views, {pixels} pixels,", _INSTEAD)
