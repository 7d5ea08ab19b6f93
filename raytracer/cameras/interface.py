"""What every camera kind gives to kernels."""

from raytracer.jit import generic

# Slots of random numbers of a camera sample, each a dimension of its own; a slot not drawn costs nothing.
FILTER, LENS, SLOTS = 0, 1, 8


@generic
def camera_ray(camera, x, y, draws):  # type: ignore[no-untyped-def]
    """The ray (origin, unit direction) of film position (x, y), in pixels from the top left corner."""
    raise NotImplementedError
