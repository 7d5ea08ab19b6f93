"""WebP files (.webp), which textures are read from, 8 bits a channel; and animations, of a quality of 90."""

from functools import partial

from raytracer.film.formats.base import pillow
from raytracer.film.formats.base.image_format import ImageFormat

_QUALITY = 90

FORMAT = ImageFormat(
    (".webp",),
    is_linear=False,
    is_lossy=True,
    encode_frames=partial(pillow.encode_frames, name="WEBP", quality=_QUALITY, method=4),
    decode_stored=pillow.decode_stored,
    order=60,
)
