"""Microlenses of three focal lengths before one sensor: their rays, and the distances at which each kind is sharp.

References: as in `film.light_field.lenslet_kinds`.
"""

import math
from typing import Any, NamedTuple

from raytracer.core.sampling import sample_2d
from raytracer.film.light_field.lenslets import Lenslets
from raytracer.plugins.cameras.base import interface
from raytracer.plugins.cameras.base.light_field_camera import MicrolensBlur, sample_cell, sample_microlens

_SHARP = 1.0
"""Largest spot (px of the sensor) that counts as sharp."""


class MicrolensKinds(NamedTuple):
    """Microlenses of three kinds, in place of one.

    blurs (m/px) : as `MicrolensBlur.blur`, of each kind.
    """

    blurs: tuple[float, ...]


@sample_microlens.register(MicrolensKinds)
def sample_microlens_microlens_kinds(spread, grid, middle_x, middle_y, draws):
    lattice = grid.lattice
    u1, u2 = sample_2d(draws.sampler, draws.key, draws.index, draws.dimension + interface.LENS)
    i, j = sample_cell(grid.cell, u1, u2)
    x = i * lattice.along_x + j * lattice.across_x
    y = i * lattice.along_y + j * lattice.across_y
    from_x, from_y = middle_x - lattice.x, middle_y - lattice.y
    column = math.floor(lattice.i_x * from_x + lattice.i_y * from_y + 0.5)
    row = math.floor(lattice.j_x * from_x + lattice.j_y * from_y + 0.5)
    blur = spread.blurs[int(column - row) % len(spread.blurs)]
    return x, y, -blur * x, -blur * y


def pack_spread(lenslets: Lenslets) -> Any:
    """Pack the microlenses of one kind, or of three."""
    return MicrolensKinds(lenslets.kinds) if lenslets.kinds else MicrolensBlur(lenslets.blur)


def describe_sharpness(lenslets: Lenslets, focal_lengths: tuple[float, ...]) -> dict[str, float]:
    """Return where focused microlenses are sharp: distances (m) by name, of each kind and of all together.

    Sharp is what light through one microlens spreads over no more than a pixel of the sensor.

    focal_lengths : of the kinds (mm).
    """
    numbers: dict[str, float] = {}
    ranges = []
    for kind, focal_length in enumerate(focal_lengths):
        ranges.append(_sharp_range(lenslets, lenslets.kinds[kind] if lenslets.kinds else lenslets.blur))
        if len(focal_lengths) > 1:
            sharp = lenslets.bundle(kind).inverse_distance
            numbers |= {
                f"kind_{kind + 1}_focal_length_mm": focal_length,
                f"kind_{kind + 1}_sharp_m": _distance(sharp),
                f"kind_{kind + 1}_near_m": ranges[-1][0],
                f"kind_{kind + 1}_far_m": ranges[-1][1],
            }
    return numbers | {"sharp_near_m": min(near for near, _ in ranges), "sharp_far_m": max(far for _, far in ranges)}


def _sharp_range(lenslets: Lenslets, blur: float) -> tuple[float, float]:
    """Find the nearest and the farthest distance (m) at which a kind's spot is at most a pixel.

    With w one over the distance, from that of the array's image on, the spot is spacing |slope / w - blur| / stride.
    """
    slack = _SHARP * lenslets.stride / lenslets.lattice.pitch
    # Where the sign changes there is no end on that side.
    ends = [
        lenslets.inverse_distance + lenslets.slope / side if side * blur > 0.0 else math.copysign(math.inf, blur)
        for side in (blur - slack, blur + slack)
    ]
    return _distance(max(ends)), _distance(min(ends))


def _distance(inverse: float) -> float:
    return 1.0 / inverse if inverse > 0.0 else math.inf
