"""Effects of the camera: its lens, its shutter, its motion, and the film."""

import math
from collections.abc import Sequence

from raytracer.kernel.hero_wavelength import DispersiveLens, DispersiveMaterials
from raytracer.kernel.packed_scene import Scene
from raytracer.optics.lens_system.surfaces import LensSurfaces
from raytracer.plugins.cameras.base.interface import CameraParts, Defocus, camera_defocus, camera_parts
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.report.wording import count
from raytracer.scene.effects.effect import Effect
from raytracer.scene.spec import SceneSpec


def camera_effects(spec: SceneSpec, scene: Scene, made_of: Sequence[MaterialSpec]) -> dict[str, Effect]:
    """List the effects of the camera; `made_of`: the materials of all objects, and the parts of these."""
    parts: CameraParts = camera_parts(scene.camera)
    thin: Defocus | None = camera_defocus(scene.camera)
    lens, glass = parts.lens, parts.glass
    return {
        "defocus": Effect(
            lens is not None or glass is not None, _why_defocus(spec, None if lens is None else thin, glass)
        ),
        "real_lens": Effect(glass is not None, _why_real_lens(spec, glass)),
        "dispersion": _dispersion(made_of, scene, has_glass=glass is not None),
        "flare": Effect(parts.has_flare, _why_flare(parts)),
        **_photograph(spec),
        **_opening(spec, parts),
        "projection": _projection(spec, thin is not None and glass is None, glass is not None),
        "light_field": _light_field(spec),
        "motion_blur": Effect(_moves(spec, scene), _why_motion_blur(spec, scene)),
        **_shutter(spec, scene),
    }


def _why_defocus(spec: SceneSpec, lens: Defocus | None, glass: LensSurfaces | None) -> str:
    if glass is not None:
        numbers = spec.camera.describe(spec.film.width, spec.film.height)
        distance = numbers["focus_distance_m"]
        focus = f"{distance:.4g} m" if distance < math.inf else "infinity"
        return f"the stop is open to f/{numbers['f_number']:.4g}, and the lens focused at {focus}"
    if lens is None:
        return f"the {spec.camera.type} camera has no aperture, so everything is sharp"
    width = f"{1e3 * lens.diameter:.4g} mm wide"
    if lens.inverse_focus < 0.0:
        return f"the hole is {width}, and bends no light"
    focus = f"{1.0 / lens.inverse_focus:.4g} m" if lens.inverse_focus > 0.0 else "infinity"
    return f"the lens is {width} and focused at {focus}"


def _why_real_lens(spec: SceneSpec, glass: LensSurfaces | None) -> str:
    if glass is None:
        return f"the {spec.camera.type} camera has no glass, and so none of its aberrations"
    number = len(glass.curvature)
    return f"rays are traced through {count(number, 'surface')} of a lens, with all its aberrations"


def _dispersion(made_of: Sequence[MaterialSpec], scene: Scene, *, has_glass: bool) -> Effect:
    """Tell if anything bends light of each wavelength by another angle."""
    dispersive = sum(part.dispersion_mode() != 0 for part in made_of)
    whose = [count(dispersive, "material") + " in use"] if isinstance(scene.spectrum, DispersiveMaterials) else []
    drawn = isinstance(scene.spectrum, DispersiveLens) or (
        isinstance(scene.spectrum, DispersiveMaterials) and scene.spectrum.camera is not None
    )
    whose += ["the camera's lens"] if drawn and has_glass else []
    # A camera without glass draws from a single wavelength.
    single = drawn and not has_glass
    if not whose:
        light = "is of the one wavelength that the camera sees" if single else "stays red, green and blue"
        return Effect(False, f"no index of refraction depends on the wavelength, so light {light}")
    verb = "bend" if len(whose) > 1 or dispersive > 1 else "bends"
    light = "the camera sees one of them" if single else "wavelengths are drawn by chance"
    return Effect(True, f"{' and '.join(whose)} {verb} light of each wavelength by another angle; {light}")


def _why_flare(parts: CameraParts) -> str:
    if parts.glass is None:
        return "there is no glass in the camera that could reflect"
    if not parts.has_flare:
        return "flare is not asked for, so the glass of the lens reflects nothing, and loses no light"
    return "light that two surfaces of the lens reflect reaches the film, and what one reflects is lost"


def _opening(spec: SceneSpec, parts: CameraParts) -> dict[str, Effect]:
    """List the effects of the lens's opening besides its size."""
    (shape, rim), lens, glass = spec.camera.opening(), parts.lens, parts.glass
    if glass is not None:
        shaped = glass.diaphragm is not None
        return {
            "aperture_shape": Effect(
                shaped, f"the stop has the shape {shape.type}" if shape and shaped else "the stop is round"
            ),
            "vignetting": Effect(True, "the rims of the glass keep light out that comes in from the side"),
        }
    shaped, vignetted = (False, False) if lens is None else (lens.shape is not None, lens.rim is not None)
    none = "the camera's opening is a point, or missing"
    shapeless = none if lens is None else "the opening is round"
    rimless = none if lens is None else "nothing but the opening itself keeps light out"
    return {
        "aperture_shape": Effect(shaped, f"the opening has the shape {shape.type}" if shape and shaped else shapeless),
        "vignetting": Effect(
            vignetted, f"a rim {rim.distance:.4g} mm before the lens is in the way" if rim and vignetted else rimless
        ),
    }


def _projection(spec: SceneSpec, in_perspective: bool, has_glass: bool) -> Effect:
    """Tell if the picture is other than in perspective."""
    if in_perspective:
        return Effect(False, f"the {spec.camera.type} camera shows the scene in perspective")
    if has_glass:
        return Effect(True, "the glass of the lens distorts the perspective")
    return Effect(True, f"the {spec.camera.type} camera shows the scene otherwise than in perspective")


def _light_field(spec: SceneSpec) -> Effect:
    """Tell if the picture holds more than one view."""
    layout = spec.camera.layout(spec.film.width, spec.film.height)
    if layout is None or layout.views.rows * layout.views.columns == 1:
        return Effect(False, f"the {spec.camera.type} camera sees from one place, or does not tell places apart")
    views = layout.views
    size = f"{views.width} x {views.height}"
    return Effect(True, f"the picture holds {views.columns} x {views.rows} views of {size} pixels")


def _photograph(spec: SceneSpec) -> dict[str, Effect]:
    """List the effects on the light that the film has gathered."""
    exposure = spec.camera.exposure_settings(spec.film.width, spec.film.height)
    sensor, balance, tone = spec.camera.simulated_sensor(), spec.film.white_balance, spec.film.tone_curve.type
    exposed = "neither iso nor exposure is given, so pixels are plain radiance"
    if exposure is not None:
        speed = "the ISO speed that metering chooses" if exposure.iso is None else f"ISO {exposure.iso:.4g}"
        known = exposure.radiometric and exposure.seconds is not None
        exposed = f"{speed}, the aperture and the shutter set" if known else "metering sets"
        exposed += " how bright the picture is"
    return {
        "exposure": Effect(exposure is not None, exposed),
        "sensor_noise": Effect(
            sensor is not None,
            f"photons are counted in wells of {sensor.full_well:g} electrons"
            if sensor is not None
            else "no sensor with `noise: true` is given, so the only noise is that of sampling",
        ),
        "white_balance": Effect(
            balance is not None,
            "red, green and blue are multiplied so that grey looks grey" if balance else "colours stay as they are",
        ),
        "tone_curve": Effect(
            tone != "linear",
            "display files are clipped at 1" if tone == "linear" else f"display files are shown by a {tone} curve",
        ),
    }


def _count_with_motion(spec: SceneSpec) -> int:
    return sum(bool(item.motion or getattr(item, "frames", None)) for _, item in spec.all_objects())


def _camera_moves(scene: Scene) -> bool:
    parts: CameraParts = camera_parts(scene.camera)
    return parts.moves


def _moves(spec: SceneSpec, scene: Scene) -> bool:
    """Tell if something may move while the shutter is open; paths may have a time for the sake of a flash alone."""
    return scene.shutter is not None and (_camera_moves(scene) or _count_with_motion(spec) > 0)


def _why_motion_blur(spec: SceneSpec, scene: Scene) -> str:
    shutter = spec.camera.shutter_interval()
    if _moves(spec, scene):
        able = _count_with_motion(spec)
        moving = [count(able, "object")] if able else []
        moving += ["the camera"] if _camera_moves(scene) else []
        return f"the shutter is open for {shutter.close - shutter.open:.4g} s, in which {' and '.join(moving)} may move"
    if shutter.close == shutter.open:
        return f"the shutter is open for no time, at {shutter.open:g} s"
    return f"nothing moves while the shutter is open, for {shutter.close - shutter.open:.4g} s"


def _shutter(spec: SceneSpec, scene: Scene) -> dict[str, Effect]:
    """List the effects of the shutter, besides its duration, and of the hand that holds the camera."""
    timing, shake = spec.camera.timing(), spec.camera.shake
    still = "nothing changes while the shutter is open"
    curve = "the shutter opens and closes at once" if timing.profile is None else still
    rolling = still if timing.readout else "all of the film is exposed at the same time"
    hand = "it has no time to shake" if shake is not None and shake.amplitude else "the camera is held still"
    if is_curved := scene.shutter is not None and scene.shutter.curve is not None:
        curve = f"its transmission changes while it is open; in all it counts as {timing.seconds():.4g} s"
    if is_rolling := scene.shutter is not None and scene.shutter.scan is not None:
        rolling = f"lines are exposed one after another, {timing.direction}, over {timing.readout:.4g} s"
    is_shaking = shake is not None and shake.amplitude > 0.0 and _camera_moves(scene)
    if shake is not None and is_shaking:
        hand = f"it turns by {shake.amplitude:.4g} deg (rms) about each axis, up to {shake.bandwidth:.4g} Hz"
    return {
        "shutter_curve": Effect(is_curved, curve),
        "rolling_shutter": Effect(is_rolling, rolling),
        "camera_shake": Effect(is_shaking, hand),
    }
