"""Names, limits and filters of `.lf` files."""

SUFFIX = ".lf"
FORMAT = "rt light field"
VERSION = 1

TYPES = ("float16", "float32", "float64")
"""Types of the numbers in a file."""

RAYS_PER_TILE = 16_384

CACHE_BYTES = 16 << 20
"""Size of the cache of tiles, so that reading row by row does not read each again."""

MAX_COMPRESSION = 1_100
"""Greatest compression: deflate reaches 1032 to 1 (zlib's own documentation); and a little for checksums."""

SHUFFLE, DEFLATE, FLETCHER = 2, 1, 3
FILTERS = [SHUFFLE, DEFLATE, FLETCHER]
"""Registered numbers of the filters that tiles may go through, once each and in this order: for others HDF5 looks for
plug-ins, LZF's tiles are not checked while they are unpacked, and deflated twice, a kilobyte is a gigabyte."""

CHECKSUM_BYTES = 4
"""Size of the checksum behind a tile."""

DEFLATE_MARGIN = 64
"""Deflated, a tile grows by less than this part of it, or by less than as many bytes."""

RADIANCE = "radiance"
MICROLENSES = "microlenses"
AXES = ("v", "u", "t", "s", "channel")
NUMBERS = ("pixel", "left", "top", "inverse_focus")
OPTIONAL_NUMBERS = ("aperture", "focal_length")

UNITS = {
    "pixel": "tangent",
    "left": "tangent",
    "top": "tangent",
    "inverse_focus": "1/m",
    "focus_distance": "m",
    "cell": "m",
    "aperture": "m",
    "focal_length": "mm",
    "pose": "m, and unit vectors",
}
