"""Light by wavelength: how a camera of linear Rec. 709 responds to it, and smooth spectra for colours.

All is relative to the light of D65: what reflects or radiates the same at every wavelength is white, (1, 1, 1), and
colours of surfaces and of lights become spectra by one linear function, in which grey is the same at all wavelengths.

Wavelengths are nanometres.

References: CIE 018:2019 and ISO/CIE 11664-1 (the 2 degree observer of 1931), ISO/CIE 11664-2 (D65); Mallett, Yuksel
2019, "Spectral Primary Decomposition for Rendering with sRGB Reflectance", EGSR (the spectra of the primaries); Wilkie
et al. 2014, "Hero Wavelength Spectral Sampling", CGF 33(4).
"""

import csv
import functools
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.jit import kernel
from raytracer.vec import Vec3, dot

FIRST, LAST, STEP = 380.0, 780.0, 5.0
"""The wavelengths of the tables, between which all is linear; there is nothing beyond them."""

_CELLS = 512

# How wide (nm) the band is that stands for one wavelength: a power of two, so that its inverse is exact, that is above
# the spacing of numbers up to 1024 (2^-43) and within which no table changes by more than they do.
_LINE = 2.0**-20

TOGETHER, ALONE = 1, 2
"""How a surface that disperses takes the wavelengths of a path: they part where it refracts, or it takes one only."""


class Spectra(NamedTuple):
    """Tables of float64 by wavelength, from FIRST to LAST by STEP.

    response (n, 3), what a camera records of light of one wavelength by channel (1/nm), so that the integral of
    response times a spectrum is its colour; basis (n, 3), the spectra of red, green and blue, of sum 1 at each
    wavelength; quantiles (cells + 1,), wavelengths between which equally much is drawn.
    """

    response: NDArray[np.float64]
    basis: NDArray[np.float64]
    quantiles: NDArray[np.float64]


@functools.cache
def published() -> NDArray[np.float64]:
    """The published tables, float64 (n, 8): wavelength, colour matching x y z, D65, the spectra of red, green, blue."""
    text = (files("raytracer") / "spectra.csv").read_text("ascii")
    return np.array(list(csv.reader(text.splitlines()))[1:], np.float64)


@functools.cache
def spectra() -> Spectra:
    """The tables that kernels take.

    The response is that linear function of colour matching by which the spectrum of each primary has just its colour;
    the published matrix from XYZ to Rec. 709 does so within the digits of the tables.
    """
    rows = published()
    basis = rows[:, 5:] / rows[:, 5:].sum(axis=1, keepdims=True)
    seen = rows[:, 1:4] * rows[:, 4:5]
    response = seen @ np.linalg.inv(overlap(seen, basis)).T
    return Spectra(np.ascontiguousarray(response), np.ascontiguousarray(basis), _quantiles(response))


@functools.cache
def line(wavelength: float) -> Spectra:
    """Tables for what sees light of one wavelength (nm) alone, and records its radiance in all three channels."""
    flat = np.full_like(spectra().response, 1.0 / _LINE)
    low = min(max(FIRST, wavelength - 0.5 * _LINE), LAST - _LINE)
    return Spectra(flat, spectra().basis, np.array([low, low + _LINE]))


def overlap(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integrals over wavelength (nm) of products of piecewise linear spectra: (n, k), (n, l) -> (k, l)."""
    within = 2.0 * (a[:-1].T @ b[:-1] + a[1:].T @ b[1:]) + a[:-1].T @ b[1:] + a[1:].T @ b[:-1]
    return np.asarray(STEP / 6.0 * within)


def _quantiles(response: NDArray[np.float64]) -> NDArray[np.float64]:
    # For white light the variance, summed over channels, is least where the density follows the response's length.
    wanted = np.linalg.norm(response, axis=1)
    fine = np.arange(FIRST, LAST + 0.005, 0.01)
    height = np.interp(fine, _wavelengths(), wanted)
    below = np.concatenate(([0.0], np.cumsum(0.5 * (height[1:] + height[:-1]))))
    found = np.interp(np.linspace(0.0, below[-1], _CELLS + 1), below, fine)
    found[0], found[-1] = FIRST, LAST
    return np.asarray(found)


def _wavelengths() -> NDArray[np.float64]:
    return np.arange(FIRST, LAST + 0.5 * STEP, STEP)


def response(wavelength: ArrayLike) -> NDArray[np.float64]:
    """What a camera records of light of each wavelength (nm), relative to D65, by channel (1/nm): (..., 3)."""
    return _at(spectra().response, wavelength)


def spectrum_of(rgb: ArrayLike, wavelength: ArrayLike) -> NDArray[np.float64]:
    """The smooth spectrum of a linear Rec. 709 colour (3,) at wavelengths (nm), of their shape."""
    return np.asarray(_at(spectra().basis, wavelength) @ np.asarray(rgb, np.float64))


def _at(table: NDArray[np.float64], wavelength: ArrayLike) -> NDArray[np.float64]:
    columns = [np.interp(np.asarray(wavelength), _wavelengths(), column, left=0.0, right=0.0) for column in table.T]
    return np.stack(columns, axis=-1)


# ---- In kernels


class Hue(NamedTuple):
    """The light that a path carries: of `carried` wavelengths, 1 or 3, or 0 while it is red, green and blue.

    number, the one with which it goes on where they part; wavelengths (nm), the hero first; first, second, third, the
    spectra of red, green and blue at each.
    """

    carried: float
    number: np.int64
    wavelengths: Vec3
    first: Vec3
    second: Vec3
    third: Vec3


@kernel
def tinted_by(hue: Hue, rgb: Vec3) -> Vec3:
    """The spectrum of a colour at the wavelengths of a hue that carries any."""
    return (dot(hue.first, rgb), dot(hue.second, rgb), dot(hue.third, rgb))


@kernel
def hero(spectra: Spectra, u: float) -> tuple[float, float]:
    """A wavelength by the number `u`, uniform in [0, 1), and its density (1/nm)."""
    cells = len(spectra.quantiles) - 1
    place = cells * u
    cell = min(cells - 1, int(place))
    low = spectra.quantiles[cell]
    width = spectra.quantiles[cell + 1] - low
    return low + (place - cell) * width, 1.0 / (cells * width)


@kernel
def stratum(u: float, number: int, count: int) -> float:
    """The number that draws a companion, 1 .. count - 1, of the hero that `u` draws: all are in strata of their own."""
    moved = u + number / count
    return moved - 1.0 if moved >= 1.0 else moved


@kernel
def _row_at(table: NDArray[np.float64], wavelength: float) -> Vec3:
    place = (wavelength - FIRST) / STEP
    index = max(0, min(len(table) - 2, int(place)))
    part = place - index
    rest = 1.0 - part
    return (
        rest * table[index, 0] + part * table[index + 1, 0],
        rest * table[index, 1] + part * table[index + 1, 1],
        rest * table[index, 2] + part * table[index + 1, 2],
    )


@kernel
def response_at(spectra: Spectra, wavelength: float) -> Vec3:
    """What a camera records of light of this wavelength, by channel (1/nm)."""
    return _row_at(spectra.response, wavelength)


@kernel
def basis_at(spectra: Spectra, wavelength: float) -> Vec3:
    """The spectra of red, green and blue at a wavelength: that of a colour is its dot product with them."""
    return _row_at(spectra.basis, wavelength)


@kernel
def tinted_at(spectra: Spectra, wavelength: float, rgb: Vec3) -> float:
    """The spectrum of a colour at a wavelength."""
    return dot(basis_at(spectra, wavelength), rgb)
