"""Spectral data: the response of a linear Rec. 709 camera by wavelength, and smooth spectra for colours.

All is relative to the light of D65: a flat spectrum is white, (1, 1, 1), and
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

from raytracer.core.compiler.dispatch import kernel
from raytracer.core.vec import Vec3, dot

FIRST, LAST, STEP = 380.0, 780.0, 5.0
"""The wavelengths (nm) of the tables, which are linear between these, and zero beyond them."""

_CELLS = 512

# Width (nm) of the band that stands for one wavelength: a power of two, so that its inverse is exact, that is above
# the spacing of numbers up to 1024 (2^-43) and within which no table changes by more than they do.
_LINE = 2.0**-20

TERMINATE_ON_REFRACTION, TERMINATE_ON_HIT = 1, 2
"""Modes of dispersive surfaces: secondary wavelengths of a path are terminated if it is refracted, or at any hit."""


class Spectra(NamedTuple):
    """Tables of float64 by wavelength, from FIRST to LAST by STEP.

    Attributes
    ----------
    response : (n, 3), the camera's response by channel (1/nm): the integral of response times a spectrum is its colour.
    basis : (n, 3), the spectra of red, green and blue, of sum 1 at each wavelength.
    quantiles : (cells + 1,), wavelengths (nm) of equal probability between neighbours.
    """

    response: NDArray[np.float64]
    basis: NDArray[np.float64]
    quantiles: NDArray[np.float64]


@functools.cache
def published_tables() -> NDArray[np.float64]:
    """Load the published tables, float64 (n, 8): wavelength, colour matching x y z, D65, spectra of the primaries."""
    text = (files("raytracer.core") / "spectra.csv").read_text("ascii")
    return np.array(list(csv.reader(text.splitlines()))[1:], np.float64)


@functools.cache
def spectra() -> Spectra:
    """Make the tables that kernels take.

    The response is that linear function of colour matching by which the spectrum of each primary has just its colour;
    the published matrix from XYZ to Rec. 709 does so within the digits of the tables.
    """
    rows = published_tables()
    basis = rows[:, 5:] / rows[:, 5:].sum(axis=1, keepdims=True)
    seen = rows[:, 1:4] * rows[:, 4:5]
    response = seen @ np.linalg.inv(spectrum_products(seen, basis)).T
    return Spectra(np.ascontiguousarray(response), np.ascontiguousarray(basis), _quantiles(response))


@functools.cache
def monochromatic_spectra(wavelength: float) -> Spectra:
    """Make tables for a camera that sees one wavelength (nm), and records its radiance in all three channels."""
    flat = np.full_like(spectra().response, 1.0 / _LINE)
    low = min(max(FIRST, wavelength - 0.5 * _LINE), LAST - _LINE)
    return Spectra(flat, spectra().basis, np.array([low, low + _LINE]))


def spectrum_products(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integrate products of piecewise linear spectra over wavelength (nm): (n, k), (n, l) -> (k, l)."""
    within = 2.0 * (a[:-1].T @ b[:-1] + a[1:].T @ b[1:]) + a[:-1].T @ b[1:] + a[1:].T @ b[:-1]
    return np.asarray(STEP / 6.0 * within)


def _quantiles(response: NDArray[np.float64]) -> NDArray[np.float64]:
    # For white light the variance, summed over channels, is least where the density follows the response's length.
    wanted = np.linalg.norm(response, axis=1)
    fine = np.arange(FIRST, LAST + 0.005, 0.01)
    height = np.interp(fine, _wavelengths(), wanted)
    below = np.concatenate(([0.0], np.cumsum(0.5 * (height[1:] + height[:-1]))))
    quantiles = np.interp(np.linspace(0.0, below[-1], _CELLS + 1), below, fine)
    quantiles[0], quantiles[-1] = FIRST, LAST
    return np.asarray(quantiles)


def _wavelengths() -> NDArray[np.float64]:
    return np.arange(FIRST, LAST + 0.5 * STEP, STEP)


def response(wavelength: ArrayLike) -> NDArray[np.float64]:
    """Compute the camera's response to each wavelength (nm), relative to D65, by channel (1/nm): (..., 3)."""
    return _interpolate(spectra().response, wavelength)


def spectrum_of(rgb: ArrayLike, wavelength: ArrayLike) -> NDArray[np.float64]:
    """Compute the smooth spectrum of a linear Rec. 709 colour (3,) at wavelengths (nm), of their shape."""
    return np.asarray(_interpolate(spectra().basis, wavelength) @ np.asarray(rgb, np.float64))


def _interpolate(table: NDArray[np.float64], wavelength: ArrayLike) -> NDArray[np.float64]:
    columns = [np.interp(np.asarray(wavelength), _wavelengths(), column, left=0.0, right=0.0) for column in table.T]
    return np.stack(columns, axis=-1)


# ---- In kernels


class PathWavelengths(NamedTuple):
    """The wavelengths that a path carries.

    Attributes
    ----------
    wavelength_count : 1 or 3, or 0 while the path is traced in red, green and blue.
    number : the index of the wavelength that goes on where the others are terminated.
    wavelengths : three (nm), the hero first.
    first, second, third : the spectra of red, green and blue at each.
    """

    wavelength_count: float
    number: np.int64
    wavelengths: Vec3
    first: Vec3
    second: Vec3
    third: Vec3


@kernel
def upsample_at_wavelengths(path: PathWavelengths, rgb: Vec3) -> Vec3:
    """Compute the spectrum of a colour at the path's wavelengths, if it carries any."""
    return (dot(path.first, rgb), dot(path.second, rgb), dot(path.third, rgb))


@kernel
def sample_hero_wavelength(spectra: Spectra, u: float) -> tuple[float, float]:
    """Sample a wavelength (nm) by the number `u`, uniform in [0, 1); returns it and its density (1/nm)."""
    cells = len(spectra.quantiles) - 1
    place = cells * u
    cell = min(cells - 1, int(place))
    low = spectra.quantiles[cell]
    width = spectra.quantiles[cell + 1] - low
    return low + (place - cell) * width, 1.0 / (cells * width)


@kernel
def companion_number(u: float, number: int, count: int) -> float:
    """Return the number that draws companion `number`, 1 .. count - 1, of the hero of `u`: each has its own stratum."""
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
    """Return the camera's response to a wavelength, by channel (1/nm)."""
    return _row_at(spectra.response, wavelength)


@kernel
def basis_at(spectra: Spectra, wavelength: float) -> Vec3:
    """Return the spectra of red, green and blue at a wavelength: that of a colour is its dot product with them."""
    return _row_at(spectra.basis, wavelength)
