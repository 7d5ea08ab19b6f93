"""The times of paths and rays within the exposure, where something moves."""

from raytracer.core.compiler.dispatch import optional
from raytracer.core.embree import TIME as EMBREE_TIME
from raytracer.core.embree import store_float
from raytracer.core.sampling import sample_1d
from raytracer.core.shutter.sampling import sample_shutter_time
from raytracer.core.shutter.table import Shutter
from raytracer.plugins.cameras.base.interface import TIME


@optional
def sample_time(shutter, x, y, draws):
    """Sample the time at which film position (x, y) is exposed: a fraction of the exposure or None, and a weight.

    The weight is of mean 1, and the constant 1 where no light has a time of its own.
    """
    return None, 1.0


@sample_time.register(Shutter)
def sample_time_shutter(shutter, x, y, draws):
    return sample_shutter_time(shutter.pulses, shutter, x, y, sample_1d(draws.sampler, draws.key, draws.index, TIME))


@optional
def set_ray_time(shutter, rays, lane, time):
    """Write a ray's time into a lane."""


@set_ray_time.register(Shutter)
def set_ray_time_shutter(shutter, rays, lane, time):
    store_float(rays, lane, EMBREE_TIME, time)
