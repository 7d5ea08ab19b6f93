"""Interface of filters: the spec's methods for packing, and the generic functions for kernels."""

from typing import Any

from raytracer.core.compiler.dispatch import generic
from raytracer.schema.spec import Spec


class FilterSpec(Spec):
    """Base of the filters."""

    type: str

    def pack(self) -> Any:
        """Pack the filter."""
        raise NotImplementedError

    def support(self) -> float:
        """Return the largest distance from a pixel's centre that it reaches along either axis (px)."""
        raise NotImplementedError

    def box_width(self) -> float | None:
        """Return the edge (px) of a box filter, which weights a square evenly; None for any other filter."""
        return None

    def has_negative_lobes(self) -> bool:
        """Tell whether weights may be negative, and pixels beside bright edges so below zero."""
        return False


@generic
def sample_filter(pixel_filter, u1, u2):
    """Draw an offset (dx, dy) from the pixel's centre (px), and a weight whose mean is 1.

    Offsets are drawn by the filter itself, so each sample belongs to one pixel: pixels stay independent of their
    neighbours, and of how the picture is cut into tiles.

    References: Ernst, Stamminger, Greiner 2006, "Filter Importance Sampling".
    """
