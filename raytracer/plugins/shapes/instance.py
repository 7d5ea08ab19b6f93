"""Instance: a group, or an object that has a name, placed again; it takes no memory of its own but for its transform.

In a scene:

    - {type: instance, of: tree, transform: [{rotate: {axis: [0, 1, 0], angle: 40}}, {translate: [2, 0, 0]}]}
    - {type: instance, of: tree, placements: forest.csv, material: autumn}
"""

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from raytracer.plugins.shapes.base.interface import Assets, PlacementSpec
from raytracer.schema.transform import Transform, matrix_of

_Placements: TypeAlias = tuple[Transform, ...] | str


class Instance(PlacementSpec):
    """A group or an object of that name, placed once, or many times by `placements`."""

    type: Literal["instance"] = "instance"
    placements: _Placements | None = Field(
        default=None,
        description="many transforms, each of which happens before `transform`: a list; or a file, .npy (n, 4, 4) or "
        "(n, 3, 4), or .csv with columns x, y, z and optionally scale (or scale_x, scale_y, scale_z), angle (deg) and "
        "axis_x, axis_y, axis_z (default: the y axis)",
    )

    @field_validator("placements", mode="before")
    @classmethod
    def _list_or_file(cls, value: object) -> object:
        if isinstance(value, str) and not value:
            raise ValueError("must not be empty")
        if isinstance(value, list | tuple) and not value:
            raise ValueError("must hold at least one transform")
        return value

    def files(self) -> dict[tuple[str | int, ...], tuple[str, str]]:
        return {("placements",): (self.placements, "placements")} if isinstance(self.placements, str) else {}

    def poses(self, assets: Assets) -> NDArray[np.float64]:
        if isinstance(self.placements, str):
            placed = assets["placements"]
        elif self.placements is None:
            placed = np.eye(4)[None]
        else:
            placed = np.stack([matrix_of(transform) for transform in self.placements])
        return np.asarray(matrix_of(self.transform) @ placed)
