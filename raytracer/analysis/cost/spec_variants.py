"""Checked scenes in which something does not happen, for the variants that `arms.py` makes of them.

A shutter without its ramps is open for as long as with them, so that the picture keeps its brightness.
"""

from typing import Any

import numpy as np

from raytracer.cameras.moving import camera_at
from raytracer.kinds import CAMERAS
from raytracer.scene.spec import SceneSpec
from raytracer.shutter import ShutterSpec


def held(spec: SceneSpec) -> SceneSpec:
    """The scene whose camera is held still."""
    return spec.model_copy(update={"camera": spec.camera.model_copy(update={"shake": None})})


def frozen(spec: SceneSpec) -> SceneSpec:
    """The scene as it is in the middle of the time in which the shutter is open, and for all of that time."""
    span = spec.camera.opening()
    time = 0.5 * (span.open + span.close)
    still = camera_at(spec.camera, time).model_copy(update={"motion": None, "shake": None})
    return spec.model_copy(
        update={
            "camera": still,
            "objects": tuple(item.at_rest(time) for item in spec.objects),
            "groups": {name: tuple(item.at_rest(time) for item in items) for name, items in spec.groups.items()},
        }
    )


def _with_shutter(spec: SceneSpec, shutter: ShutterSpec) -> SceneSpec:
    return spec.model_copy(update={"camera": spec.camera.model_copy(update={"shutter": shutter, "time": None})})


def opened_at_once(spec: SceneSpec) -> SceneSpec:
    """The scene with a shutter that opens and closes at once, exposing for as long, about the same mean time."""
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


def exposed_at_once(spec: SceneSpec) -> SceneSpec:
    """The scene with all of the film exposed when its middle was."""
    timing, shutter = spec.camera.timing(), spec.camera.shutter
    assert isinstance(shutter, ShutterSpec)
    later = 0.5 * timing.readout
    close = None if shutter.close is None else shutter.close + later
    update = {"open": timing.opens + later, "close": close, "readout": 0.0}
    return _with_shutter(spec, shutter.model_copy(update=update))


# ---- Lenses of glass


def ideal(spec: SceneSpec) -> SceneSpec:
    """The scene as the thin lens sees it that is equivalent to the glass of its camera."""
    camera: Any = spec.camera
    keys = camera.equivalent(spec.film.width, spec.film.height)
    thin = CAMERAS.specs()[keys["type"]].model_validate(keys)
    return spec.model_copy(update={"camera": thin})


def _with_glass(spec: SceneSpec, **values: Any) -> SceneSpec:
    return spec.model_copy(update={"camera": spec.camera.model_copy(update=values)})


def dark_glass(spec: SceneSpec) -> SceneSpec:
    """The scene seen through glass that reflects nothing."""
    return _with_glass(spec, flare=False)


def of_one_wavelength(spec: SceneSpec) -> SceneSpec:
    """The scene seen through glass that bends all colours alike."""
    return _with_glass(spec, dispersion=False) if hasattr(spec.camera, "dispersion") else spec


def round_stop(spec: SceneSpec) -> SceneSpec:
    """The scene seen through a round opening in the glass."""
    return _with_glass(spec, aperture_shape=None)
