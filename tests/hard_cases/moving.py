"""Time: a shutter that is open for none, and times outside of it."""

from typing import Any

import numpy as np
from pydantic import TypeAdapter

from raytracer.core.embree import Accel
from raytracer.core.motion.resolve import resolve_motion, trajectory_of
from raytracer.core.motion.spec import Motion
from raytracer.core.primitives.base.interface import geometry
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.translated import translate_table
from raytracer.core.shutter.spec import ShutterField, exposure_timing
from raytracer.core.shutter.table import Shutter
from raytracer.core.shutter.timing import pack_shutter
from tests.core.motion.kernels import drawn_times, poses
from tests.hard_cases.harness import Measured, hard_case
from tests.small_scenes import image

_SHUTTER: TypeAdapter[Any] = TypeAdapter(ShutterField)

_STILL = """
camera: {{type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40{}}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1{}, material: {{type: metal, fuzz: 0.5}}}}
"""


@hard_case(29, "pbrt-v4 and rtow divide by the time that the shutter is open", scene="29_moment.yaml")
def shutter_of_no_length(trials: int) -> list[Measured]:
    """A flying ball in a shutter that opens and closes at once, against the ball that rests: the same bits.

    The fraction of the shutter's time that has passed is 0/0.  Ours packs what does not move while the shutter is open
    as what rests, so that there is no time at all.
    """
    moving = ", motion: {velocity: [3, 0, 0], spin: {axis: [0, 0, 1], rate: 90}}"
    still = image(_STILL.format("", ""), spp=8).radiance
    wrong = 0
    for shutter in (", shutter: 0", ", shutter: {open: 0, close: 0}", ", shutter: 0, motion: {velocity: [1, 0, 0]}"):
        found = image(_STILL.format(shutter, moving), spp=8).radiance
        wrong += int((found != still).any(axis=-1).sum())
    opens = closes = 0.0
    with np.errstate(invalid="ignore"):
        naive = (np.random.default_rng(29).uniform(opens, closes, still.shape[:2]) - opens) / np.float64(closes - opens)
    return [Measured("pixels that differ", int(np.isnan(naive).sum()), wrong, 0.0)]


_SHUTTERS: tuple[tuple[Any, float | None], ...] = (
    (1.0 / 125.0, 1e6),
    ({"duration": 0.1, "readout": 0.4, "direction": "up"}, 3.0),
    ({"duration": 0.0, "readout": 1.0}, None),
    ({"opening": ((0.0, 0.0), (1e-3, 1.0), (3e-3, 0.0))}, 1e3),
    ({"duration": 1e-9, "readout": 30.0, "curtain": "focal_plane"}, 7.0),
)


@hard_case(
    31, "Embree 4 API reference, motion blur (times are in [0, 1])", quick=4096, thorough=400_000, scene="31_late.yaml"
)
def times_outside_of_the_shutter(times: int) -> list[Measured]:
    """Where a ball that flies 4 m is at times from -1 to 2 of the shutter, and which times samples have.

    Embree goes on beyond its last time step, by 4 m at the time 2, and rays of no time miss everything.  Ours are
    clamped where they are drawn, to numbers of float32, so that Embree and float64 mean the same; and a pose beyond the
    end is that at the end.  A fraction that is computed as (t - open) / (close - open) leaves [0, 1] for late shutters.
    """
    ball = translate_table(Spheres(np.zeros((1, 3)), np.ones(1), np.zeros(1, np.int32)), np.array([4.0, 0.0, 0.0]))
    accel = Accel([geometry(ball)])
    path = trajectory_of(resolve_motion(Motion(velocity=(4.0, 0.0, 0.0)), np.eye(4), Shutter(0.0, 1.0)))
    off, naive_off = 0.0, 0.0
    for time in (-1.0, -1e-9, 0.5, 1.0 + 1e-9, 1.5, 2.0):
        expected = 4.0 * min(1.0, max(0.0, time))
        off = max(off, abs(float(poses(path, time)[0, 0, 3]) - expected))
        found = accel.cast(np.array([4.0 * time, 0.0, 9.0]), np.array([0.0, 0.0, -1.0]), time=time)
        naive_off = max(naive_off, abs(4.0 * time - expected) if found is not None else 0.0)

    outside = 0
    for given, opens in _SHUTTERS:
        timing = exposure_timing(_SHUTTER.validate_python(given), opens)
        shutter = pack_shutter(timing, 40, 30)
        for row in (0.0, 15.5, 30.0):
            drawn, _ = drawn_times(shutter, times, 20.0, row)
            outside += int((~((drawn >= 0.0) & (drawn <= 1.0)) | (drawn != drawn.astype(np.float32))).sum())
    # The last numbers before 1, at every second of two weeks.
    seconds, u = np.arange(1.0, 1.2e6), np.nextafter(1.0, 0.0)
    naive_outside = int(((seconds + u / 125.0 - seconds) * 125.0 > 1.0).sum())
    return [
        Measured("how far the ball is from its path's end (m)", naive_off, off, 0.0),
        Measured("times outside of [0, 1]", naive_outside, outside, 0.0),
    ]
