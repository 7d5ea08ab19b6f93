"""Paths of single wavelengths, in scenes where something bends light of one colour more than that of another.

A path is traced in red, green and blue until it meets such a thing.  What came so far is put aside, and from there
on it carries light of three wavelengths: a hero and two companions, which lie in strata of their own.  Where their ways
part it goes on with the hero; then the path is traced again from the camera, by the same random numbers, for each of
the companions, and counts from where it parts.  What is gathered is turned to red, green and blue again.

A camera whose lens disperses sends its rays at the hero's wavelength.  Such a path stays in red, green and blue too,
and its hue is given to all that it has gathered; what it meets that disperses it meets at that wavelength.

Where nothing else disperses, companions share the ray on which the hero leaves the lens.  Each is traced back along it
through the lens; if it comes to the same pixel, the ray might have been made with it as the hero, which any of them is
equally often.  So by the balance heuristic a ray counts sum_i f_i / sum_j p_j, of those wavelengths alone: f_i, what it
brings of one, over the density of that wavelength; p_j, the density of such rays for the hero j, one over the area that
is aimed at from its place on the film times cos^4 there.  Where the lens parts colours by more than a pixel the hero is
alone, and nothing is lost but time.

The functions here, called on None, compile to nothing.

References: Wilkie et al. 2014, "Hero Wavelength Spectral Sampling", CGF 33(4), sec. 3.1; Veach 1997, thesis, sec. 9.2.2
(the balance heuristic).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.cameras.interface import WAVELENGTH, Sharing, share_lanes
from raytracer.geometry import Site
from raytracer.jit import generic, kernel
from raytracer.lanes import load, select, store
from raytracer.lenses import packets
from raytracer.lenses.packets import ROWS
from raytracer.sampling import sample_1d
from raytracer.spectra import ALONE, TOGETHER, Hue, Spectra, basis_at, hero, response_at, stratum
from raytracer.vec import Vec3, dot, madd, mul, scale


class Spectrum(NamedTuple):
    """Some materials of a scene disperse.

    spectra, tables by wavelength; how (references,) uint8, by reference of a surface's material: 0, if it does not;
    else TOGETHER or ALONE; camera, Split if the camera's lens disperses too, or None.
    """

    spectra: Spectra
    how: NDArray[np.uint8]
    camera: Any


class LensSpectrum(NamedTuple):
    """Nothing but the camera's lens disperses.

    spectra, tables by wavelength; sharing, how light of companions shares the hero's ray, or None.
    """

    spectra: Spectra
    sharing: Any = None


class Split(NamedTuple):
    """Rays of the camera are of one wavelength each."""


# Columns of Workspace.hues: the hero's random number; how many wavelengths the path carries, 0 while it is traced in
# red, green and blue; its throughput until then; the wavelengths; what each is seen as, and the basis at each.  Of the
# sample: with which of its wavelengths it goes on where they part; whether they did when it was traced for the first
# one; the camera's ray; and what others keep while it is traced once more.
_DRAWN, _CARRIED, _BEFORE, _WAVELENGTHS, _SEEN, _BASIS = 0, 1, 2, 5, 8, 17
_NUMBER, _PARTED, _RAY, KEPT = 26, 27, 28, 34

COLUMNS = 37

# How many wavelengths share a ray of the camera at most; and rows of Workspace.lens: a packet of each, what each counts
# for, and those of others.
SHARED = 3
_SHARES = SHARED * ROWS
PLACES = _SHARES + SHARED

LENS_ROWS = PLACES + 3


@kernel
def _load(work, sample, column):
    return (work.hues[sample, column], work.hues[sample, column + 1], work.hues[sample, column + 2])


@kernel
def _store(work, sample, column, value):
    for axis in range(3):
        work.hues[sample, column + axis] = value[axis]


@generic
def start_hue(spectrum, work, sample, draws, origin, direction):
    """Begin a sample's path in red, green and blue, along a ray."""
    raise NotImplementedError


@start_hue.register(type(None))
def _(spectrum, work, sample, draws, origin, direction):
    return


@start_hue.register(LensSpectrum)
def _(spectrum, work, sample, draws, origin, direction):
    # It never becomes a path of single wavelengths.
    work.hues[sample, _DRAWN] = sample_1d(draws.sampler, draws.key, draws.index, WAVELENGTH)


@start_hue.register(Spectrum)
def _(spectrum, work, sample, draws, origin, direction):
    work.hues[sample, _DRAWN] = sample_1d(draws.sampler, draws.key, draws.index, WAVELENGTH)
    work.hues[sample, _CARRIED] = 0.0
    work.hues[sample, _NUMBER] = 0.0
    work.hues[sample, _PARTED] = 0.0
    _store(work, sample, _RAY, origin)
    _store(work, sample, _RAY + 3, direction)


@generic
def share_hues(spectrum, camera, work, x, y, count):
    """Let light of other wavelengths share the rays that the camera has made of `count` samples of pixel (x, y)."""
    raise NotImplementedError


@share_hues.register(type(None))
@share_hues.register(Spectrum)
def _(spectrum, camera, work, x, y, count):
    return


@share_hues.register(LensSpectrum)
def _(spectrum, camera, work, x, y, count):
    _share_rays(spectrum.sharing, spectrum.spectra, camera, work, x, y, count)


@generic
def _share_rays(sharing, spectra, camera, work, x, y, count):
    raise NotImplementedError


@_share_rays.register(type(None))
def _(sharing, spectra, camera, work, x, y, count):
    return


@_share_rays.register(Sharing)
def _(sharing, spectra, camera, work, x, y, count):
    rows = work.lens
    extent = load(rows, packets.EXTENT)
    # By the balance heuristic: any of the wavelengths might have been the hero.
    density = 1.0 + 0.0 * extent
    for number in range(1, SHARED):
        others = rows[ROWS * number : ROWS * (number + 1)]
        for lane in range(count):
            others[packets.WAVELENGTH, lane], _ = hero(spectra, stratum(rows[packets.DRAWN, lane], number, SHARED))
        share_lanes(camera, sharing, rows, others, x, y)
        is_shared = load(others, packets.WEIGHT) > 0.0
        density = density + select(is_shared, extent / load(others, packets.EXTENT), 0.0)
    share = 1.0 / density
    store(rows, _SHARES, share)
    for number in range(1, SHARED):
        store(rows, _SHARES + number, share * load(rows, ROWS * number + packets.WEIGHT))


@generic
def turns(camera):
    """How often a path is traced at most: once for each wavelength that it carries."""
    raise NotImplementedError


@turns.register(type(None))
def _(camera):
    return 3


@turns.register(Split)
def _(camera):
    return 1


@kernel
def goes_again(work, sample):
    """Whether the wavelengths of a sample's path have parted, so that it is traced for each of them."""
    return work.hues[sample, _PARTED] != 0.0


@kernel
def start_again(work, sample, number):
    """Begin a sample's path again, for another of its wavelengths; returns the camera's ray."""
    work.hues[sample, _CARRIED] = 0.0
    work.hues[sample, _NUMBER] = number
    return _load(work, sample, _RAY), _load(work, sample, _RAY + 3)


@kernel
def counts(work, sample):
    """Whether what a path meets is to be gathered, and not what was when it was traced for its first wavelength."""
    return work.hues[sample, _NUMBER] == 0.0 or work.hues[sample, _CARRIED] == 1.0


@kernel
def _part(work, sample, throughput):
    """Let a path go on with one of its wavelengths, as its first; returns the throughput."""
    number = np.int64(work.hues[sample, _NUMBER])
    work.hues[sample, _WAVELENGTHS] = work.hues[sample, _WAVELENGTHS + number]
    _store(work, sample, _SEEN, _load(work, sample, _SEEN + 3 * number))
    _store(work, sample, _BASIS, _load(work, sample, _BASIS + 3 * number))
    work.hues[sample, _CARRIED] = 1.0
    work.hues[sample, _PARTED] = 1.0
    return (throughput[number], 0.0, 0.0)


# ---- From colours to wavelengths


@generic
def meet_hue(spectrum, work, sample, reference, throughput):
    """The throughput with which a path meets a surface of this material, by wavelength if that disperses."""
    raise NotImplementedError


@meet_hue.register(type(None))
@meet_hue.register(LensSpectrum)
def _(spectrum, work, sample, reference, throughput):
    return throughput


@meet_hue.register(Spectrum)
def _(spectrum, work, sample, reference, throughput):
    how = spectrum.how[reference]
    if how == 0:
        return throughput
    if work.hues[sample, _CARRIED] == 0.0:
        _store(work, sample, _BEFORE, throughput)
        throughput = _drawn(spectrum.camera, spectrum.spectra, work, sample)
    if how == ALONE and work.hues[sample, _CARRIED] > 1.0:
        return _part(work, sample, throughput)
    return throughput


@generic
def _drawn(camera, spectra, work, sample):
    """Give a path its wavelengths; returns its throughput by wavelength."""
    raise NotImplementedError


@_drawn.register(type(None))
def _(camera, spectra, work, sample):
    for number in range(3):
        wavelength, pdf = hero(spectra, stratum(work.hues[sample, _DRAWN], number, 3))
        work.hues[sample, _WAVELENGTHS + number] = wavelength
        _store(work, sample, _SEEN + 3 * number, scale(1.0 / (3.0 * pdf), response_at(spectra, wavelength)))
        _store(work, sample, _BASIS + 3 * number, basis_at(spectra, wavelength))
    work.hues[sample, _CARRIED] = 3.0
    return (1.0, 1.0, 1.0)


@_drawn.register(Split)
def _(camera, spectra, work, sample):
    # Grey, to which the camera gives the hue in the end.
    wavelength, _ = hero(spectra, work.hues[sample, _DRAWN])
    for number in range(3):
        work.hues[sample, _WAVELENGTHS + number] = wavelength
        _store(work, sample, _SEEN + 3 * number, (1.0, 1.0, 1.0))
        _store(work, sample, _BASIS + 3 * number, basis_at(spectra, wavelength))
    work.hues[sample, _CARRIED] = 1.0
    return (1.0, 0.0, 0.0)


@generic
def with_hue(spectrum, work, sample, site):
    """A Site, with the Hue of the path that shades it where materials ask for that."""
    raise NotImplementedError


@with_hue.register(type(None))
@with_hue.register(LensSpectrum)
def _(spectrum, work, sample, site):
    return site


@with_hue.register(Spectrum)
def _(spectrum, work, sample, site):
    hue = Hue(
        work.hues[sample, _CARRIED],
        np.int64(work.hues[sample, _NUMBER] if work.hues[sample, _CARRIED] > 1.0 else 0.0),
        _load(work, sample, _WAVELENGTHS),
        _load(work, sample, _BASIS),
        _load(work, sample, _BASIS + 3),
        _load(work, sample, _BASIS + 6),
    )
    return Site(site.point, site.u, site.v, site.distance, hue)


@generic
def tinted(spectrum, work, sample, rgb):
    """A colour that light meets on a path, as it counts there: by wavelength, once the path is of single ones."""
    raise NotImplementedError


@tinted.register(type(None))
@tinted.register(LensSpectrum)
def _(spectrum, work, sample, rgb):
    return rgb


@tinted.register(Spectrum)
def _(spectrum, work, sample, rgb):
    if work.hues[sample, _CARRIED] == 0.0:
        return rgb
    return (
        dot(_load(work, sample, _BASIS), rgb),
        dot(_load(work, sample, _BASIS + 3), rgb),
        dot(_load(work, sample, _BASIS + 6), rgb),
    )


@generic
def shaded(spectrum, work, sample, reference, value):
    """As `tinted`, for what a material gives: one that disperses gives it by wavelength itself."""
    raise NotImplementedError


@shaded.register(type(None))
@shaded.register(LensSpectrum)
def _(spectrum, work, sample, reference, value):
    return value


@shaded.register(Spectrum)
def _(spectrum, work, sample, reference, value):
    return tinted(spectrum, work, sample, value) if spectrum.how[reference] == 0 else value


@generic
def part_hues(spectrum, work, sample, reference, normal, outgoing, throughput):
    """The throughput of a path that goes on to `outgoing`, with one wavelength if this material has refracted it."""
    raise NotImplementedError


@part_hues.register(type(None))
@part_hues.register(LensSpectrum)
def _(spectrum, work, sample, reference, normal, outgoing, throughput):
    return throughput


@part_hues.register(Spectrum)
def _(spectrum, work, sample, reference, normal, outgoing, throughput):
    refracted = spectrum.how[reference] == TOGETHER and dot(outgoing, normal) < 0.0
    if refracted and work.hues[sample, _CARRIED] > 1.0:
        return _part(work, sample, throughput)
    return throughput


# ---- Back to colours


@kernel
def seen_as(spectrum: Spectrum, work: Any, sample: int, light: Vec3) -> Vec3:
    """What light that a path brings is to the camera, by channel."""
    if work.hues[sample, _CARRIED] == 0.0:
        return light
    found = scale(light[0], _load(work, sample, _SEEN))
    found = madd(found, light[1], _load(work, sample, _SEEN + 3))
    found = madd(found, light[2], _load(work, sample, _SEEN + 6))
    return mul(_load(work, sample, _BEFORE), found)


@generic
def gain(spectrum, work, sample, throughput):
    """About how much of the light that a path meets comes to the camera, by channel: how far it is worth following."""
    raise NotImplementedError


@gain.register(type(None))
@gain.register(LensSpectrum)
def _(spectrum, work, sample, throughput):
    return throughput


@gain.register(Spectrum)
def _(spectrum, work, sample, throughput):
    if work.hues[sample, _CARRIED] == 0.0:
        return throughput
    total = throughput[0] + throughput[1] + throughput[2]
    return scale(_share(spectrum.camera) * total, _load(work, sample, _BEFORE))


@generic
def _share(camera):
    """What one of the wavelengths of a path counts for, on the average."""
    raise NotImplementedError


@_share.register(type(None))
def _(camera):
    return 1.0 / 3.0


@_share.register(Split)
def _(camera):
    return 1.0


@generic
def mattering(spectrum, work, sample, throughput):
    """How much each channel of the colours that a path meets next matters to it."""
    raise NotImplementedError


@mattering.register(type(None))
@mattering.register(LensSpectrum)
def _(spectrum, work, sample, throughput):
    return throughput


@mattering.register(Spectrum)
def _(spectrum, work, sample, throughput):
    if work.hues[sample, _CARRIED] == 0.0:
        return throughput
    # The spectrum of each primary reaches over all wavelengths, so none of the three is 0.
    found = scale(throughput[0], _load(work, sample, _BASIS))
    found = madd(found, throughput[1], _load(work, sample, _BASIS + 3))
    return madd(found, throughput[2], _load(work, sample, _BASIS + 6))


@generic
def finished(spectrum, work, sample, radiance):
    """The radiance that a path has gathered, with the hue that the camera's lens gave to its ray."""
    raise NotImplementedError


@finished.register(type(None))
def _(spectrum, work, sample, radiance):
    return radiance


@finished.register(LensSpectrum)
def _(spectrum, work, sample, radiance):
    return _shared(spectrum.sharing, spectrum.spectra, work, sample, radiance)


@generic
def _shared(sharing, spectra, work, sample, radiance):
    raise NotImplementedError


@_shared.register(type(None))
def _(sharing, spectra, work, sample, radiance):
    return _hued(spectra, work.hues[sample, _DRAWN], radiance)


@_shared.register(Sharing)
def _(sharing, spectra, work, sample, radiance):
    drawn = work.hues[sample, _DRAWN]
    value = scale(work.lens[_SHARES, sample], _hued(spectra, drawn, radiance))
    for number in range(1, SHARED):
        share = work.lens[_SHARES + number, sample]
        if share > 0.0:
            value = madd(value, share, _hued(spectra, stratum(drawn, number, SHARED), radiance))
    return value


@finished.register(Spectrum)
def _(spectrum, work, sample, radiance):
    return _finished(spectrum.camera, spectrum.spectra, work, sample, radiance)


@generic
def _finished(camera, spectra, work, sample, radiance):
    raise NotImplementedError


@_finished.register(type(None))
def _(camera, spectra, work, sample, radiance):
    return radiance


@_finished.register(Split)
def _(camera, spectra, work, sample, radiance):
    return _hued(spectra, work.hues[sample, _DRAWN], radiance)


@kernel
def _hued(spectra: Spectra, drawn: float, radiance: Vec3) -> Vec3:
    wavelength, pdf = hero(spectra, drawn)
    return scale(dot(basis_at(spectra, wavelength), radiance) / pdf, response_at(spectra, wavelength))


# ---- For who looks on


@generic
def wavelengths_of(spectrum, work, sample):
    """The wavelengths (nm) that a path carries, NaN in place of those that it does not: three numbers."""
    raise NotImplementedError


@wavelengths_of.register(type(None))
@wavelengths_of.register(LensSpectrum)
def _(spectrum, work, sample):
    return (math.nan, math.nan, math.nan)


@wavelengths_of.register(Spectrum)
def _(spectrum, work, sample):
    carried = work.hues[sample, _CARRIED]
    first, second, third = _load(work, sample, _WAVELENGTHS)
    return (
        first if carried > 0.0 else math.nan,
        second if carried > 1.0 else math.nan,
        third if carried > 1.0 else math.nan,
    )


@generic
def ray_wavelength(spectrum, work, sample):
    """The wavelength (nm) of a sample's camera ray, NaN where the camera sends all in one."""
    raise NotImplementedError


@ray_wavelength.register(type(None))
def _(spectrum, work, sample):
    return math.nan


@ray_wavelength.register(LensSpectrum)
def _(spectrum, work, sample):
    return hero(spectrum.spectra, work.hues[sample, _DRAWN])[0]


@ray_wavelength.register(Spectrum)
def _(spectrum, work, sample):
    return _ray_wavelength(spectrum.camera, spectrum.spectra, work, sample)


@generic
def _ray_wavelength(camera, spectra, work, sample):
    raise NotImplementedError


@_ray_wavelength.register(type(None))
def _(camera, spectra, work, sample):
    return math.nan


@_ray_wavelength.register(Split)
def _(camera, spectra, work, sample):
    return hero(spectra, work.hues[sample, _DRAWN])[0]
