"""What every filter kind gives to packing and to kernels."""

from typing import Any

from raytracer.jit import generic
from raytracer.spec import Spec


class FilterSpec(Spec):
    """Base of the filters."""

    type: str

    def pack(self) -> Any:
        """The packed filter."""
        raise NotImplementedError

    def reach(self) -> float:
        """How far from a pixel's centre it reaches, along either axis (pixels)."""
        raise NotImplementedError

    def edge(self) -> float | None:
        """Edge of the square (pixels) whose places all count the same, and no others; None if it is not so."""
        return None

    def has_negative_lobes(self) -> bool:
        """Tell whether weights may be negative, and pixels beside bright edges so below zero."""
        return False


@generic
def sample_filter(pixel_filter, u1, u2):
    """An offset (dx, dy) from the pixel's centre, in pixels, and a weight whose mean is 1.

    Offsets are drawn by the filter itself, so each sample belongs to one pixel: pixels stay independent of their
    neighbours, and of how the picture is cut into tiles.

    References: Ernst, Stamminger, Greiner 2006, "Filter Importance Sampling".
    """
    raise NotImplementedError
