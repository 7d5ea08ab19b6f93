"""`.lf` files: a light field with its geometry, as HDF5.

What is in them is written down in docs/lightfield-format.md.  The radiance is in tiles of each view, so that a part of
it is read without the rest, and each tile has a checksum.

References: The HDF Group, "HDF5 File Format Specification", version 3.0; "HDF5 Dimension Scale Specification".
"""

from raytracer.film.light_field.lf.posed import OpenPosedField, is_posed, open_posed
from raytracer.film.light_field.lf.reader import OpenField, open  # noqa: A004
from raytracer.film.light_field.lf.stored_array import FORMAT, SUFFIX, TYPES, VERSION, StoredArray
from raytracer.film.light_field.lf.writer import Writer, write

__all__ = [
    "FORMAT",
    "SUFFIX",
    "TYPES",
    "VERSION",
    "OpenField",
    "OpenPosedField",
    "StoredArray",
    "Writer",
    "is_posed",
    "open",
    "open_posed",
    "write",
]
