"""The opening through which a perspective camera sees: what thin lenses and pinholes of a real size share."""

from typing import Any, NamedTuple

from raytracer.apertures.interface import sample_aperture, unvignetted
from raytracer.cameras.interface import LENS
from raytracer.cameras.perspective import gathered, lens_ray
from raytracer.sampling import sample_2d
from raytracer.vec import add, dot, madd, normalize, scale


class Lens(NamedTuple):
    """Packed: radius (m) and 1 / focus distance (1/m), which is 0 for focus at infinity.

    A mere hole, which bends no ray, is a lens whose plane of focus is as far behind it as the film.  shape, a packed
    aperture, None if it is round; rim, what vignettes, None if nothing does.
    """

    radius: float
    inverse_focus: float
    shape: Any = None
    rim: Any = None


@lens_ray.register(Lens)
def _(lens, frame, irradiance, direction, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LENS)
    unit_x, unit_y = sample_aperture(lens.shape, u1, u2)
    x, y = lens.radius * unit_x, lens.radius * unit_y
    shift = add(scale(x, frame.right), scale(y, frame.up))
    towards = madd(direction, -lens.inverse_focus, shift)
    passes = unvignetted(lens.rim, x, y, dot(towards, frame.right), dot(towards, frame.up))
    return add(frame.origin, shift), normalize(towards), passes * gathered(irradiance, direction, shift, towards)
