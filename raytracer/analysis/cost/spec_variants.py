"""Removals of effects from checked scenes, for the variants of `effect_variants.py`.

A shutter without its ramps is open for as long as with them, so that the picture keeps its brightness.
"""

from typing import Any

import numpy as np

from raytracer.core.shutter.spec import ShutterSpec
from raytracer.plugins.cameras.base.moving import camera_at_time
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import CAMERAS


def with_still_camera(spec: SceneSpec) -> SceneSpec:
    """Hold the camera still."""
    return spec.model_copy(update={"camera": spec.camera.model_copy(update={"shake": None})})


def without_motion(spec: SceneSpec) -> SceneSpec:
    """Freeze the scene in the middle of the time in which the shutter is open."""
    span = spec.camera.shutter_interval()
    time = 0.5 * (span.open + span.close)
    still = camera_at_time(spec.camera, time).model_copy(update={"motion": None, "shake": None})
    return spec.model_copy(
        update={
            "camera": still,
            "objects": tuple(item.at_time(time) for item in spec.objects),
            "groups": {name: tuple(item.at_time(time) for item in items) for name, items in spec.groups.items()},
        }
    )


def _with_shutter(spec: SceneSpec, shutter: ShutterSpec) -> SceneSpec:
    return spec.model_copy(update={"camera": spec.camera.model_copy(update={"shutter": shutter, "time": None})})


def with_instant_shutter(spec: SceneSpec) -> SceneSpec:
    """Let the shutter open and close at once, exposing for as long, about the same mean time."""
    timing, shutter = spec.camera.timing(), spec.camera.shutter
    assert isinstance(shutter, ShutterSpec)
    times, transmissions = np.array(timing.profile).T
    width, (a, b) = np.diff(times), (transmissions[:-1], transmissions[1:])
    # The integral of the linear transmission times time, over that of transmission.
    moment = (width * (a * (2.0 * times[:-1] + times[1:]) + b * (times[:-1] + 2.0 * times[1:])) / 6.0).sum()
    seconds = timing.seconds()
    begin = timing.opens + float(moment) / seconds - 0.5 * seconds
    update = {"open": begin, "close": None, "duration": seconds, "opening": "instant", "ramp": None}
    return _with_shutter(spec, shutter.model_copy(update=update))


def with_global_shutter(spec: SceneSpec) -> SceneSpec:
    """Expose all of the film when its middle was exposed."""
    timing, shutter = spec.camera.timing(), spec.camera.shutter
    assert isinstance(shutter, ShutterSpec)
    later = 0.5 * timing.readout
    close = None if shutter.close is None else shutter.close + later
    update = {"open": timing.opens + later, "close": close, "readout": 0.0}
    return _with_shutter(spec, shutter.model_copy(update=update))


# ---- Lenses of glass


def with_thin_lens(spec: SceneSpec) -> SceneSpec:
    """Replace the camera's lens of glass by its equivalent thin lens."""
    camera: Any = spec.camera
    keys = camera.thin_lens_equivalent(spec.film.width, spec.film.height)
    thin = CAMERAS.specs()[keys["type"]].model_validate(keys)
    return spec.model_copy(update={"camera": thin})


def _with_glass(spec: SceneSpec, **values: Any) -> SceneSpec:
    return spec.model_copy(update={"camera": spec.camera.model_copy(update=values)})


def without_reflections(spec: SceneSpec) -> SceneSpec:
    """Remove reflections within the lens."""
    return _with_glass(spec, flare=False)


def without_dispersion(spec: SceneSpec) -> SceneSpec:
    """Remove dispersion within the lens."""
    return _with_glass(spec, dispersion=False) if hasattr(spec.camera, "dispersion") else spec


def with_round_stop(spec: SceneSpec) -> SceneSpec:
    """Make the stop of the lens round."""
    return _with_glass(spec, aperture_shape=None)
