"""Hand shake: small rotations of a camera about its own position, as seeded noise.

In a scene:

    camera: {type: pinhole, look_from: [0, 1, 4], shutter: 1/8 s, shake: {amplitude: 0.1 deg, bandwidth: 10 Hz}}
"""

import math
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from raytracer.core.motion.trajectory import Rows, rotation_trajectory
from raytracer.core.shutter.table import Shutter
from raytracer.schema.fields import Count, Quantity, Vector
from raytracer.schema.spec import Spec
from raytracer.schema.transform import Matrix

# Sinusoids of a shake about an axis, and segments of its trajectory in a period of the fastest, of which 0.5 % is lost.
_SINUSOIDS = 128
_SEGMENTS_PER_PERIOD = 32
_MAX_SEGMENTS = 2**17


class Shake(Spec):
    """Small irregular rotations of a hand-held camera about its own position.

    Each of the angles about the camera's axes is noise with an even spectrum up to a frequency: a sum of sinusoids
    whose frequencies and phases are random, which is Gaussian in the limit of many.

    References: Rice 1944, "Mathematical Analysis of Random Noise", Bell System Technical Journal 23(3), sec. 2.8 (the
    sum of sinusoids).
    """

    amplitude: Annotated[float, Quantity("angle", low=0.0, high=180.0)] = Field(
        description="root mean square (deg) of the angle about each axis of the camera: yaw, pitch and roll"
    )
    bandwidth: Annotated[float, Quantity("frequency", low=0.0, low_open=True)] = Field(
        default=10.0, description="highest frequency (Hz) in the shake"
    )
    seed: Annotated[int, Count(0, 2**32 - 1)] = Field(default=0, description="seed: another one shakes otherwise")

    def segments(self, shutter: Shutter) -> int:
        """Count the straight segments that approximate the shake while the shutter is open.

        Raises
        ------
        ValueError : more than there can be.
        """
        periods = self.bandwidth * (shutter.close - shutter.open)
        if periods * _SEGMENTS_PER_PERIOD > _MAX_SEGMENTS:
            raise ValueError(
                f"shakes {periods:.4g} times while the shutter is open, and at most "
                f"{_MAX_SEGMENTS // _SEGMENTS_PER_PERIOD} times can be followed: lower the bandwidth, or "
                "shorten the shutter"
            )
        return max(1, math.ceil(_SEGMENTS_PER_PERIOD * periods))

    def angles(self, times: ArrayLike) -> NDArray[np.float64]:
        """Compute pitch, yaw and roll (rad) at times of the scene (s) (n,): float64 (n, 3).

        Over long times each has a mean square of exactly the amplitude's.
        """
        moments = np.asarray(times, np.float64)
        rng = np.random.default_rng(self.seed)
        # One frequency in each part of the spectrum, anywhere in it, so that nothing repeats.
        frequencies = self.bandwidth * (np.arange(_SINUSOIDS) + rng.random((3, _SINUSOIDS))) / _SINUSOIDS
        phases = 2.0 * np.pi * rng.random((3, _SINUSOIDS))
        result = np.zeros((len(moments), 3))
        for axis in range(3):
            for frequency, phase in zip(frequencies[axis], phases[axis], strict=True):
                result[:, axis] += np.cos(2.0 * np.pi * frequency * moments + phase)
        return math.radians(self.amplitude) * math.sqrt(2.0 / _SINUSOIDS) * result


def shake_trajectory(shake: Shake, center: Vector, axes: Matrix, shutter: Shutter, segments: int = 1) -> Rows:
    """Make the trajectory (steps, 16) of a hand-held camera: rotations about its position `center` (m).

    Parameters
    ----------
    axes : (3, 3), rows are the axes of pitch, yaw and roll: unit vectors to the right, up and forward.
    segments : the steps are those of this many segments, divided further.

    Raises
    ------
    ValueError : see `Shake.segments`.
    """
    segments *= math.ceil(shake.segments(shutter) / segments)
    vectors = shake.angles(np.linspace(shutter.open, shutter.close, segments + 1)) @ axes
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    # sin(a / 2) / a, which is 1/2 where there is no angle.
    share = 0.5 * np.sinc(angle / (2.0 * np.pi))
    quaternions = np.concatenate([np.cos(0.5 * angle), share * vectors], axis=1)
    return rotation_trajectory(center, quaternions)
