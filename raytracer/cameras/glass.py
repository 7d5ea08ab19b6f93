"""What cameras with a lens of glass share: the wavelength of a sample, and the way from the lens into the scene."""

from raytracer.cameras.interface import WAVELENGTH
from raytracer.jit import generic, kernel
from raytracer.lanes import load, root, store
from raytracer.lenses import packets
from raytracer.lenses.lens import Lens
from raytracer.lenses.setting import stop_for
from raytracer.sampling import sample_1d
from raytracer.spec import at
from raytracer.spectra import Spectra, hero
from raytracer.units import METRES_PER_MILLIMETRE
from raytracer.vec import add, madd, scale


def stop_for_key(lens: Lens, f_number: float | None) -> float | None:
    """Radius of the stop (mm) for a camera's key `f_number`; None for wide open.

    Raises
    ------
    ValidationError : the lens has no such f-number.
    """
    if f_number is None:
        return None
    try:
        return stop_for(lens, f_number)
    except ValueError as error:
        at("f_number", str(error))


@generic
def draw_wavelength(wavelengths, rows, lane, draws):
    """Give a sample its wavelength (nm)."""
    raise NotImplementedError


@draw_wavelength.register(type(None))
def _(wavelengths, rows, lane, draws):
    return


@draw_wavelength.register(Spectra)
def _(wavelengths, rows, lane, draws):
    drawn = sample_1d(draws.sampler, draws.key, draws.index, draws.dimension + WAVELENGTH)
    rows[packets.DRAWN, lane] = drawn
    rows[packets.WAVELENGTH, lane], _ = hero(wavelengths, drawn)


@kernel
def in_world(frame, pupil, origin, direction):
    """A ray before a lens (mm) whose entrance pupil is at `pupil` on its axis (mm), in the scene (m)."""
    ahead = METRES_PER_MILLIMETRE * (pupil - origin[2])
    side = scale(METRES_PER_MILLIMETRE * origin[0], frame.right)
    side = madd(side, METRES_PER_MILLIMETRE * origin[1], frame.up)
    start = add(frame.origin, madd(side, ahead, frame.forward))
    way = add(scale(direction[0], frame.right), scale(direction[1], frame.up))
    return start, madd(way, -direction[2], frame.forward)


@kernel
def set_out(rows, z, behind):
    """Send a packet's rays out from the film at `z` to where they are aimed at, `behind` before it (mm).

    rows : the packet, with the ways to the side and up in its rows `packets.DIRECTION` and the next (mm).

    Returns
    -------
    The square of the cosines of their angles with the axis.
    """
    x, y = load(rows, packets.DIRECTION), load(rows, packets.DIRECTION + 1)
    inverse = 1.0 / root(x * x + y * y + behind * behind)
    cosine = behind * inverse
    store(rows, packets.ORIGIN + 2, z)
    store(rows, packets.DIRECTION, x * inverse)
    store(rows, packets.DIRECTION + 1, y * inverse)
    store(rows, packets.DIRECTION + 2, -cosine)
    return cosine * cosine


@kernel
def traced_ray(camera, rows, lane):
    """The ray (origin, unit direction, weight) in the scene of a lane that has gone through a camera's lens."""
    origin = rows[packets.ORIGIN, lane], rows[packets.ORIGIN + 1, lane], rows[packets.ORIGIN + 2, lane]
    way = rows[packets.DIRECTION, lane], rows[packets.DIRECTION + 1, lane], rows[packets.DIRECTION + 2, lane]
    start, direction = in_world(camera.frame, camera.pupil, origin, way)
    return start, direction, rows[packets.WEIGHT, lane]
