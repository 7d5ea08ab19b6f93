"""Tests of distributions: chi-square against a density.

References: Subr, Arvo 2007, "Statistical Hypothesis Testing for Assessing Monte Carlo Estimators: Applications to Image
Synthesis"; Sidak 1967, "Rectangular Confidence Regions for the Means of Multivariate Normal Distributions".
"""

import math

import numpy as np

FEWEST_EXPECTED = 5.0
"""Cells that expect fewer samples are pooled: Pearson's statistic has its distribution only in the limit of many."""


def sidak(significance, tests):
    """Level of each of `tests` independent tests, such that all pass by chance with odds of `significance` against."""
    return -math.expm1(math.log1p(-significance) / tests)


def cell_integrals(pdf, bounds, cells, order=8):
    """Integrals of `pdf`, a function of coordinates (n, d) that gives (n,), over a grid: float64, shape `cells`.

    Each cell by Gauss and Legendre's quadrature with `order` points an axis; edges of cells should lie where the
    density jumps.  `bounds` holds (low, high) of each axis.
    """
    nodes, weights = np.polynomial.legendre.leggauss(order)
    axes, axis_weights = [], []
    for (low, high), count in zip(bounds, cells, strict=True):
        width = (high - low) / count
        starts = low + width * np.arange(count)
        axes.append((starts[:, None] + 0.5 * width * (nodes + 1.0)).ravel())
        axis_weights.append(np.tile(0.5 * width * weights, count))
    points = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
    products = np.prod(np.meshgrid(*axis_weights, indexing="ij"), axis=0).ravel()
    mass = (np.asarray(pdf(points), np.float64) * products).reshape([size for n in cells for size in (n, order)])
    return mass.sum(axis=tuple(range(1, 2 * len(cells), 2)))


def pearson(observed, expected):
    """Pearson's statistic of counts against what a distribution expects, and its degrees of freedom.

    observed, expected : counts of the same shape and the same sum.  Where nothing is expected, nothing may be observed.
    """
    observed, expected = np.ravel(observed).astype(np.float64), np.ravel(expected).astype(np.float64)
    assert math.isclose(observed.sum(), expected.sum()), "counts with different sums"
    impossible = observed[expected <= 0.0].sum()
    assert impossible == 0.0, f"{impossible:.0f} samples where the density is zero"

    # Pool the least likely cells until each cell expects enough.
    observed, expected = observed[expected > 0.0], expected[expected > 0.0]
    order = np.argsort(expected)
    observed, expected = observed[order], expected[order]
    pooled = int(np.searchsorted(expected, FEWEST_EXPECTED))
    while 0 < pooled < len(expected) and expected[:pooled].sum() < FEWEST_EXPECTED:
        pooled += 1
    if pooled:
        observed = np.append(observed[pooled:], observed[:pooled].sum())
        expected = np.append(expected[pooled:], expected[:pooled].sum())
    assert len(expected) > 1, "too few samples for a test"
    return float(((observed - expected) ** 2 / expected).sum()), len(expected) - 1


def chi2_counts(observed, expected, significance=1e-3, tests=1):
    """Assert that counts are what a distribution expects, where `tests` such tests pass together.

    observed, expected : see `pearson`.  Returns the p-value.
    """
    from scipy.stats import chi2

    statistic, freedom = pearson(observed, expected)
    p_value = float(chi2.sf(statistic, freedom))
    assert p_value > sidak(significance, tests), (
        f"chi-square {statistic:.1f} with {freedom} degrees of freedom: p = {p_value:.2g}"
    )
    return p_value


def chi2_excess(observed, expected, significance=1e-3, tests=1):
    """Pearson's statistic over the most that `chi2_counts` would let pass: above 1, counts are not as expected."""
    from scipy.stats import chi2

    statistic, freedom = pearson(observed, expected)
    return statistic / float(chi2.isf(sidak(significance, tests), freedom))


def chi2_test(samples, pdf, bounds, cells, *, order=8, significance=1e-3, tests=1):
    """Assert that samples follow a density.

    samples : float64 (n, d).  pdf : a function of coordinates (m, d) that gives densities (m,).  bounds : (low, high)
    of each axis.  cells : number of each axis' cells.  order : see `cell_integrals`.  tests : how many such tests are
    to pass together.

    The density must hold all the samples: its integral over the bounds is asserted to be 1 within 1e-3, and no sample
    may be outside.  Returns the p-value.
    """
    samples = np.asarray(samples, np.float64)
    low, high = np.array(bounds).T
    assert ((samples >= low) & (samples <= high)).all(), "samples out of bounds"
    mass = cell_integrals(pdf, bounds, cells, order)
    assert abs(mass.sum() - 1.0) < 1e-3, f"the density integrates to {mass.sum()}"
    observed, _ = np.histogramdd(samples, bins=cells, range=bounds)
    return chi2_counts(observed, len(samples) * mass / mass.sum(), significance, tests)


CYLINDER = ((-1.0, 1.0), (-math.pi, math.pi))
"""Bounds of directions as (cos theta, phi), in which a density is the one in solid angle."""


def cylinder(directions):
    """(cos theta, phi) of unit vectors (n, 3): float64 (n, 2)."""
    directions = np.asarray(directions)
    return np.stack([np.clip(directions[:, 2], -1.0, 1.0), np.arctan2(directions[:, 1], directions[:, 0])], axis=1)


def directions(coordinates):
    """Unit vectors of (cos theta, phi), (n, 2): float64 (n, 3)."""
    cosine, phi = np.asarray(coordinates).T
    sine = np.sqrt(1.0 - cosine * cosine)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)
