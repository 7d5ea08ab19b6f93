"""What every environment kind gives to kernels."""

from raytracer.jit import generic


@generic
def background(environment, direction):  # type: ignore[no-untyped-def]
    """Radiance that arrives along a ray of unit `direction` from far away."""
    raise NotImplementedError


@background.register(type(None))
def _(environment, direction):  # type: ignore[no-untyped-def]
    return (0.0, 0.0, 0.0)
