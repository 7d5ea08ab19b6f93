"""Time: a shutter that is open for none, times outside of it, and what turns fast."""

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
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from tests.core.motion.kernels import drawn_times, poses
from tests.hard_cases.harness import ROUNDING, SCENES, hard_case
from tests.hard_cases.spheres import ORIGIN, spheres
from tests.small_scenes import image

_STILL = """
camera: {{type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40{}}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1{}, material: {{type: metal, fuzz: 0.5}}}}
"""


@hard_case(29, "pbrt-v4 and rtow divide by the time that the shutter is open", "moment")
def shutter_of_no_length(_):
    """A flying ball in a shutter that opens and closes at once, against the ball that rests: the same bits.

    The fraction of the shutter's time that has passed is 0/0.  Ours packs what does not move while the shutter is open
    as what rests, so that there is no time at all.
    """
    moving = ", motion: {velocity: [3, 0, 0], spin: {axis: [0, 0, 1], rate: 90}}"
    still = image(_STILL.format("", ""), lit=True, spp=8).radiance
    opens = closes = 0.0
    naive = (np.random.default_rng(29).uniform(opens, closes, still.shape[:2]) - opens) / np.float64(closes - opens)
    yield "pixels that differ", np.isnan(naive), 0
    for shutter in (", shutter: 0", ", shutter: {open: 0, close: 0}", ", shutter: 0, motion: {velocity: [1, 0, 0]}"):
        found = image(_STILL.format(shutter, moving), lit=True, spp=8).radiance
        yield "pixels that differ", 0, (found != still).any(axis=-1)


_SHUTTERS = (
    (1.0 / 125.0, 1e6),
    ({"duration": 0.1, "readout": 0.4, "direction": "up"}, 3.0),
    ({"duration": 0.0, "readout": 1.0}, None),
    ({"opening": ((0.0, 0.0), (1e-3, 1.0), (3e-3, 0.0))}, 1e3),
    ({"duration": 1e-9, "readout": 30.0, "curtain": "focal_plane"}, 7.0),
)


@hard_case(31, "Embree 4 API reference, motion blur (times are in [0, 1])", "late", quick=4096, thorough=400_000)
def times_outside_of_the_shutter(times):
    """Where a ball that flies 4 m is at times from -1 to 2 of the shutter, and which times samples have.

    Embree goes on beyond its last time step, by 4 m at the time 2, and rays of no time miss everything.  Ours are
    clamped where they are drawn, to numbers of float32, so that Embree and float64 mean the same; and a pose beyond the
    end is that at the end.  A fraction that is computed as (t - open) / (close - open) leaves [0, 1] for late shutters.
    """
    accel = Accel([geometry(translate_table(spheres(ORIGIN, 1.0), np.array([4.0, 0.0, 0.0])))])
    path = trajectory_of(resolve_motion(Motion(velocity=(4.0, 0.0, 0.0)), np.eye(4), Shutter(0.0, 1.0)))
    for time in (-1.0, -1e-9, 0.5, 1.0 + 1e-9, 1.5, 2.0):
        expected = 4.0 * min(1.0, max(0.0, time))
        met = accel.cast(np.array([4.0 * time, 0.0, 9.0]), np.array([0.0, 0.0, -1.0]), time=time)
        naive = 4.0 * time - expected if met is not None else 0.0
        yield "how far the ball is from its path's end (m)", naive, poses(path, time)[0, 0, 3] - expected

    # The last numbers before 1, at every second of two weeks.
    seconds, u = np.arange(1.0, 1.2e6), np.nextafter(1.0, 0.0)
    yield "times outside of [0, 1]", (seconds + u / 125.0 - seconds) * 125.0 > 1.0, 0
    for given, opens in _SHUTTERS:
        shutter = pack_shutter(exposure_timing(TypeAdapter(ShutterField).validate_python(given), opens), 40, 30)
        for row in (0.0, 15.5, 30.0):
            drawn, _ = drawn_times(shutter, times, 20.0, row)
            inside = (drawn >= 0.0) & (drawn <= 1.0) & (drawn == drawn.astype(np.float32))
            yield "times outside of [0, 1]", 0, ~inside


def _linear(time, segments):
    """Compute places (n, 2) of a point at (1, 0, 0) that goes round once in straight parts."""
    step = np.minimum(np.floor(time * segments), segments - 1)
    ends = [2.0 * np.pi * (step + k) / segments for k in (0, 1)]
    start, end = (np.column_stack([np.cos(angle), np.sin(angle)]) for angle in ends)
    return start + (time * segments - step)[:, None] * (end - start)


@hard_case(30, "Embree 4 API reference, RTCQuaternionDecomposition; Shoemake 1985", "spin", 2000, 200_000)
def spin(times):
    """A lamp that goes round by 360 degrees while the shutter is open, on a circle of 1 m.

    Vertices that go straight from step to step draw it in by 1 - cos(180 deg / N): 29.3 % for a quarter turn in one
    step, 1.92 % for a turn in 16, 0.03 % in the 128 that there may be.  A trajectory of quaternions stays on the
    circle: between two steps a quaternion has the length 1 but for six roundings, its matrix, of products of two,
    doubles them twice, and applying it adds eight.  Embree's angles are good to 4e-6, so it meets all but the edge of
    the lamp.
    """
    packed = pack(load(SCENES / "30_spin.yaml"))
    time = np.random.default_rng(30).random(times).astype(np.float32).astype(np.float64)
    pose = poses(packed.scene.instances.trajectories, time)
    off = np.linalg.norm(pose[:, :, 0] + pose[:, :, 3], axis=1) - 1.0
    straight = 1.0 - np.linalg.norm(_linear(np.array([0.125]), 4))
    finest = 1.0 - np.linalg.norm(_linear(time, 128), axis=1)
    yield "drawn in: a quarter turn, by one straight step", straight, off, 32.0 * ROUNDING
    yield "drawn in: a turn, by 128 straight steps", finest.max(), off, 32.0 * ROUNDING

    # Rays down on the lamp, 99 % of its radius out from its middle and in.
    accel = packed.build()
    lamp = next(number for number, table in enumerate(packed.scene.primitives) if isinstance(table, Spheres))
    round_ = np.column_stack([np.cos(2.0 * np.pi * time), np.sin(2.0 * np.pi * time)])
    for out in (0.901, 1.099):
        naive = np.hypot(*(out * round_ - _linear(time, 16)).T) > 0.1
        met = [accel.cast([*place, 4.0], [0.0, 0.0, -1.0], time=t) for t, place in zip(time, out * round_, strict=True)]
        yield "rays that miss the lamp; by 16 straight steps", naive, [m is None or m.geometry != lamp for m in met]
