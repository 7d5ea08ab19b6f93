"""Kernels that apply affine maps, three rows of (linear | translation), to points, vectors and normals."""

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import dot, normalize


@kernel
def apply_point(affine, p):
    """Transform a point by an affine map (three rows of four)."""
    a, b, c = affine
    return dot(a, p) + a[3], dot(b, p) + b[3], dot(c, p) + c[3]


@kernel
def apply_vector(affine, v):
    """Transform a vector, a difference of points, by an affine map."""
    a, b, c = affine
    return dot(a, v), dot(b, v), dot(c, v)


@kernel
def apply_transpose(affine, v):
    """Transform a vector by the transpose of an affine map's linear part."""
    a, b, c = affine
    return (
        a[0] * v[0] + b[0] * v[1] + c[0] * v[2],
        a[1] * v[0] + b[1] * v[1] + c[1] * v[2],
        a[2] * v[0] + b[2] * v[1] + c[2] * v[2],
    )


@kernel
def apply_normal(inverse, n):
    """Transform a unit normal by the map whose inverse is given: by the inverse transpose.

    References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 3.10.3.
    """
    return normalize(apply_transpose(inverse, n))


@kernel
def invert(affine):
    """Compute the inverse of an affine map, by cofactors."""
    a, b, c = affine
    xx, xy, xz = b[1] * c[2] - b[2] * c[1], a[2] * c[1] - a[1] * c[2], a[1] * b[2] - a[2] * b[1]
    yx, yy, yz = b[2] * c[0] - b[0] * c[2], a[0] * c[2] - a[2] * c[0], a[2] * b[0] - a[0] * b[2]
    zx, zy, zz = b[0] * c[1] - b[1] * c[0], a[1] * c[0] - a[0] * c[1], a[0] * b[1] - a[1] * b[0]
    scale = 1.0 / (a[0] * xx + a[1] * yx + a[2] * zx)
    shift = (a[3], b[3], c[3])
    x, y, z = (
        (scale * xx, scale * xy, scale * xz),
        (scale * yx, scale * yy, scale * yz),
        (scale * zx, scale * zy, scale * zz),
    )
    return (*x, -dot(x, shift)), (*y, -dot(y, shift)), (*z, -dot(z, shift))
