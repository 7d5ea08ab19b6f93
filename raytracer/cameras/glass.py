"""What cameras with a lens of glass share: the wavelength of a sample, and the way from the lens into the scene."""

from raytracer.cameras.interface import WAVELENGTH
from raytracer.jit import generic, kernel
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
