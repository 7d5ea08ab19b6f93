"""Ray of a thin lens: from a point of its pupil to the plane of focus; or through a pinhole of a real size."""

from typing import Any, NamedTuple

from raytracer.core.sampling import sample_2d
from raytracer.core.vec import add, dot, madd, normalize, scale
from raytracer.plugins.apertures.base.interface import rim_visibility, sample_aperture
from raytracer.plugins.cameras.base.interface import LENS
from raytracer.plugins.cameras.base.perspective_camera import irradiance_weight, lens_ray


class ThinLensPupil(NamedTuple):
    """Packed thin lens; a mere hole, which bends no ray, has its plane of focus as far behind it as the film.

    radius (m) : of the round opening of the same area.
    inverse_focus (1/m) : one over the distance of the plane of focus, 0 for infinity.
    shape : a packed aperture; None for a round one.
    rim : a Rim in front of the lens, which vignettes; None without one.
    """

    radius: float
    inverse_focus: float
    shape: Any = None
    rim: Any = None


@lens_ray.register(ThinLensPupil)
def lens_ray_thin_lens_pupil(lens, frame, irradiance, direction, draws):
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + LENS)
    unit_x, unit_y = sample_aperture(lens.shape, u1, u2)
    x, y = lens.radius * unit_x, lens.radius * unit_y
    shift = add(scale(x, frame.right), scale(y, frame.up))
    towards = madd(direction, -lens.inverse_focus, shift)
    passes = rim_visibility(lens.rim, x, y, dot(towards, frame.right), dot(towards, frame.up))
    weight = passes * irradiance_weight(irradiance, direction, shift, towards)
    return add(frame.origin, shift), normalize(towards), weight
