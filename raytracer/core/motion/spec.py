"""Motion of objects and cameras as scenes write it: velocities, spins and keyframes.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], shutter: {open: 0, close: 1}}
    objects:
      - {type: sphere, center: [0, 1, 0], radius: 1, motion: {velocity: [0, 0.5, 0]}}
      - {type: box, min: [-1, 0, -0.1], max: [1, 0.2, 0.1], motion: {spin: {axis: [0, 0, 1], rate: 20 turn/s}}}
      - {type: sphere, center: [0, 0, 0], radius: 1,
         motion: {keyframes: [{time: 0, transform: []}, {time: 1, transform: [{translate: [2, 0, 0]}]}]}}

    camera: {type: pinhole, shutter: 1/8 s, shake: {amplitude: 0.1 deg, bandwidth: 10 Hz}}

A motion acts in world space, after the object's `transform`.  A spin turns counter-clockwise as seen from the tip of
its axis; its centre goes along with the velocity.  Keyframes are taken apart into translation, rotation and scale with
skew, and each is interpolated by itself, the rotation along the shorter arc: a turn by more than 180 degrees between
two keyframes needs keyframes between them, or a spin.  Before the first and after the last keyframe the pose is held.
"""

from itertools import pairwise
from typing import Annotated, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from raytracer.schema.fields import Direction, Point, Quantity, Time, Triple, Vector
from raytracer.schema.rules import never, some_of
from raytracer.schema.spec import Spec, field_error
from raytracer.schema.transform import Matrix, Transform, matrix_of

Velocity: TypeAlias = Annotated[Vector, Triple(Quantity("speed"), "a velocity")]

AngularRate: TypeAlias = Annotated[float, Quantity("rate")]


class Spin(Spec):
    """Rotation at a constant rate."""

    axis: Direction = Field(description="axis; its length does not matter")
    rate: AngularRate = Field(description="rate (deg/s), counter-clockwise as seen from the tip of the axis")
    center: Point = Field(
        default=(0.0, 0.0, 0.0), description="a point of the axis at time 0 (m); it moves with the velocity"
    )


class Keyframe(Spec):
    """A pose at a time."""

    time: Time = Field(description="time of the scene (s)")
    transform: Transform = Field(description="the pose: what happens to the object after its own transform")


class Motion(Spec):
    """Movement of an object or a camera in world space: a velocity, a spin or both, or keyframes."""

    velocity: Velocity | None = Field(default=None, description="velocity (m/s)")
    spin: Spin | None = Field(default=None, description="rotation at a constant rate")
    keyframes: tuple[Keyframe, ...] | None = Field(
        default=None, description="at least two poses in the order of their times; they are held before and after"
    )

    _is_a_motion = some_of("velocity", "spin", "keyframes", message="needs a velocity, a spin or keyframes")
    _is_one_motion = never(
        "keyframes",
        where=lambda motion: motion.velocity is not None or motion.spin is not None,
        message="keyframes are the whole motion: give either them, or a velocity and a spin",
    )

    @model_validator(mode="after")
    def _keyframes_follow_each_other(self) -> "Motion":
        if self.keyframes is None:
            return self
        if len(self.keyframes) < 2:
            field_error("keyframes", "a motion needs at least two keyframes")
        for number, (before, after) in enumerate(pairwise(self.keyframes), start=1):
            if after.time <= before.time:
                field_error(
                    ("keyframes", number, "time"),
                    f"must be later than the keyframe before, {before.time:g} s, got {after.time:g} s",
                )
            if _is_mirrored(matrix_of(before.transform)) != _is_mirrored(matrix_of(after.transform)):
                field_error(
                    ("keyframes", number, "transform"),
                    "is a mirror image of the keyframe before, so the object would be flat somewhere between them",
                )
        return self


def _is_mirrored(matrix: Matrix) -> bool:
    return bool(np.linalg.det(matrix[:3, :3]) < 0.0)
