"""Flashes: their energy, the moment at which they shine, and what a shutter lets through of them."""

import math

import numpy as np
import pytest

from raytracer.analysis.explain import explain
from raytracer.core.shutter.timing import Timing
from raytracer.plugins.lights.base.interface import Lights
from raytracer.plugins.lights.flash import Flashes
from raytracer.rendering.render import render
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import LIGHTS
from raytracer.util.errors import SceneError
from tests.plugins.lights.kernels import aim
from tests.small_scenes import scene

FLASH = LIGHTS.specs()["flash"]
PLACE = (1.0, 2.0, 3.0)
RAMPED = Timing(2.0, 2.7, ((0.0, 0.0), (0.2, 1.0), (0.5, 1.0), (0.7, 0.0)))


def flash(**keys):
    return FLASH.model_validate({"type": "flash", "energy": [3.0, 2.0, 0.0], **keys})


def table(timing, timed, **keys):
    result = FLASH.pack([flash(**keys).at_exposure(timing, PLACE, timed)])
    assert isinstance(result, Flashes)
    return result


# ---- When


@pytest.mark.parametrize(
    ("timing", "keys", "begin", "end"),
    [
        (Timing(2.0, 2.5), {"duration": "1 ms"}, 2.0, 2.001),
        (Timing(2.0, 2.5), {"duration": "1 ms", "curtain": "second"}, 2.499, 2.5),
        (RAMPED, {"duration": "1 ms"}, 2.2, 2.201),
        (RAMPED, {"duration": "1 ms", "curtain": "second"}, 2.499, 2.5),
        # The whole frame is open from the last line's opening to the first line's closing.
        (Timing(2.0, 2.5, None, 0.1), {"duration": "1 ms"}, 2.1, 2.101),
        (Timing(2.0, 2.5, None, 0.1), {"duration": "1 ms", "curtain": "second"}, 2.499, 2.5),
        (RAMPED._replace(readout=0.1), {"duration": "1 ms", "offset": "-5 ms"}, 2.295, 2.296),
    ],
)
def test_a_flash_shines_when_its_curtain_says(timing, keys, begin, end):
    assert flash(**keys).pulse(timing) == pytest.approx((begin, end), rel=1e-14)
    packed = table(timing, True, **keys).pulse
    span = timing.span()
    assert packed.begin[0] * (span.close - span.open) + span.open == pytest.approx(begin, abs=1e-7)
    assert packed.end[0] * (span.close - span.open) + span.open == pytest.approx(end, abs=2e-7)


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("duration", ["1/10000 s", "1/20000 s", "0.1 s"])
def test_energy_is_intensity_by_time(timed, duration):
    # Over its pulse, or as a mean over the exposure of 0.5 s.
    for timing in (Timing(2.0, 2.5), RAMPED):
        result = table(timing, timed, duration=duration)
        seconds = 0.5
        if timed:
            seconds = float(result.pulse.end[0] - result.pulse.begin[0]) * (timing.closes - timing.opens)
        # A time of 2 s has 4e-16, of which 1/20000 s has 1e-11.
        np.testing.assert_allclose(result.intensity * seconds, [[3.0, 2.0, 0.0]], rtol=1e-11)


def test_the_shutter_cuts_off_what_shines_while_it_is_not_fully_open():
    # From 0.1 s before the ramp's end on, for 0.1 s: transmission 0.5 to 1, so three quarters.
    result = table(RAMPED, False, duration="0.1 s", offset="-0.1 s")
    np.testing.assert_allclose(result.intensity * 0.5, [[2.25, 1.5, 0.0]], rtol=1e-12)
    # A flash that outlasts a shutter of 0.5 s by as much again.
    result = table(Timing(0.0, 0.5), False, duration="1 s")
    np.testing.assert_allclose(result.intensity * 0.5, [[1.5, 1.0, 0.0]], rtol=1e-12)


def test_a_flash_is_at_the_camera_unless_placed():
    np.testing.assert_array_equal(table(RAMPED, False).position, [PLACE])
    np.testing.assert_array_equal(table(RAMPED, False, position=[4, 5, 6]).position, [[4, 5, 6]])
    text = """
camera: {look_from: [0, 0, 5], type: pinhole, shutter: 1, motion: {velocity: [2, 0, 0]}}
lights: [{type: flash, energy: 1, curtain: second, duration: 0.25}]
objects: [{type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian}}]
"""
    (result,) = pack(scene(text, filled=False)).scene.lights.tables
    np.testing.assert_allclose(result.position, [[1.5, 0, 5]], rtol=1e-15)


def test_of_many_flashes_those_are_chosen_that_shine():
    """A stroboscope of ten, each for a tenth of the time but the last, which overlaps the first: no sample is lost."""
    strobe = [flash(position=[0, 2, 0], energy=4.0 * (n + 1), duration="0.1 s", offset=n / 10) for n in range(10)]
    strobe.append(flash(position=[0, 2, 0], energy=[0.0, 400.0, 0.0], duration="0.1 s"))
    result = FLASH.pack([light.at_exposure(Timing(0.0, 1.25), PLACE, True) for light in strobe])
    times = np.random.default_rng(0).uniform(0, 1.25, 200_000)
    weight = aim(Lights((result,), None), None, (0.0, 0.0, 0.0), len(times), times=times).weight
    number = np.floor(12.5 * times).astype(int)
    for n in range(1, 10):
        # Energy over time and distance squared, without noise.
        np.testing.assert_allclose(weight[number == n], 4.0 * (n + 1) / 0.1 / 4.0, rtol=1e-5)
    assert not weight[number > 10].any()
    np.testing.assert_allclose(weight[number == 0].mean(axis=0), [10.0, 1010.0, 10.0], rtol=0.2)
    np.testing.assert_allclose(weight[number == 0][:, 1].mean(), 1010.0, rtol=5e-3)


# ---- What is compiled

CAMERA = "camera: {type: orthographic, look_from: [0, 0, 5], look_at: [0, 0, 0], height: 4, SHUTTER}\n"
PLATE = "  - {type: quad, corner: [-1.5, -1.5, 0], edges: [[3, 0, 0], [0, 3, 0]], material: MATERIALMOTION}\n"


def text_of(shutter, lights, motion="", material="{type: lambertian, albedo: 1}"):
    plate = PLATE.replace("MATERIAL", material).replace("MOTION", f", motion: {motion}" if motion else "")
    return f"{CAMERA.replace('SHUTTER', shutter)}lights: [{lights}]\nobjects:\n{plate}"


ON = "{type: flash, energy: 1, duration: 1 ms}"


@pytest.mark.parametrize(
    ("shutter", "lights", "motion", "timed"),
    [
        ("shutter: 1", ON, "", False),
        ("shutter: {duration: 1, opening: trapezoid, ramp: 0.1}", ON, "", False),
        ("shutter: {duration: 1, readout: 0.1}", ON, "", True),
        ("shutter: {duration: 1, readout: 0.1}", ON.replace("energy: 1", "energy: 0"), "", False),
        ("shutter: {duration: 1, readout: 0.1}", ON.replace("1 ms", "1 ms, offset: 2"), "", False),
        ("shutter: 1", ON, "{velocity: [1, 0, 0]}", True),
        ("shutter: 1", ON, "{velocity: [0, 0, 0]}", False),
    ],
)
def test_paths_have_a_time_only_where_the_flash_needs_it(shutter, lights, motion, timed):
    result = pack(scene(text_of(shutter, lights, motion), filled=False)).scene
    assert (result.shutter is not None) == timed
    if timed:
        assert result.shutter.pulses is not None
        assert result.lights.tables[0].pulse is not None
    else:
        assert result.lights is None or result.lights.tables[0].pulse is None


def test_a_flash_needs_an_exposure():
    with pytest.raises(SceneError, match=r"lights\[0\]: a flash needs a shutter that is open for some time"):
        pack(scene(text_of("time: 1", ON), filled=False))


def test_what_no_surface_is_lit_by_is_left_out():
    mirror = text_of("shutter: 1", ON, "{velocity: [1, 0, 0]}", "{type: metal, fuzz: 0}")
    result = pack(scene(mirror, filled=False)).scene
    assert result.lights is None
    assert result.shutter.pulses is None


def test_flashes_are_explained():
    effects = explain(scene(text_of("shutter: {duration: 1, readout: 0.1}", ON), filled=False)).effects
    active = {name: effects[name].active for name in ("light.flash", "rolling_shutter", "motion_blur")}
    assert active == {"light.flash": True, "rolling_shutter": True, "motion_blur": False}
    assert effects["light_sampling"].why == "next-event estimation samples 1 flash light"


# ---- Pictures

FAR = "position: [0, 0, 40]"
# Radiance of a white plate under a flash of 3 J/sr at 40 m, times the exposure time.
WHITE = 3.0 / 40.0**2 / math.pi


def picture(text, *, spp=64):
    spec = scene(text, filled=False, width=32, height=32, spp=spp, max_depth=2, sampler="sobol")
    return np.asarray(render(spec, threads=2).image.radiance)


def test_flashes_freeze_what_moves_at_either_end():
    """A plate that goes 1.5 m, 12 pixels, in 2 s: red by the first curtain, green by the second, each 1/10000 s."""
    lights = ", ".join(
        f"{{type: flash, {FAR}, energy: {energy}, duration: 1/10000 s, curtain: {curtain}}}"
        for energy, curtain in (("[3, 0, 0]", "first"), ("[0, 3, 0]", "second"))
    )
    result = picture(text_of("shutter: 2", lights, "{velocity: [0.75, 0, 0]}"), spp=256)
    for channel, left in ((0, 4), (1, 16)):
        columns = result[4:28, :, channel].mean(axis=0)
        right = min(32, left + 24)
        assert not columns[: left - 1].any()
        assert not columns[right + 1 :].any()
        # Sharp, and as bright as by the formula, by samples of which half are of either flash.
        np.testing.assert_allclose(columns[left + 1 : right - 1], WHITE / 2.0, rtol=0.05)
        assert columns[left + 1 : right - 1].mean() == pytest.approx(WHITE / 2.0, rel=5e-3)
        assert columns[left - 1] < 0.01 * WHITE
    assert not result[..., 2].any()


@pytest.mark.slow
def test_a_flash_alone_lights_what_rests_as_a_lamp_of_the_same_energy():
    """In all shutters; the same kernel, in which nothing has a time."""
    for shutter in ("shutter: 0.5", "shutter: {duration: 0.5, opening: trapezoid, ramp: 0.25}"):
        result = picture(text_of(shutter, f"{{type: flash, {FAR}, energy: 3}}"), spp=16)
        assert result[8:24, 8:24].mean() == pytest.approx(WHITE / 0.5, rel=1e-3)


@pytest.mark.slow
def test_a_slit_that_is_narrower_than_the_film_shows_the_flash_as_a_band():
    """1/20 s of a readout of 1/5 s, a flash at 1/10 s: the quarter of lines that opened in the 1/20 s before."""
    shutter = "shutter: {duration: 0.05, readout: 0.2, curtain: focal_plane, direction: DIRECTION}"
    for direction, rows in (("down", slice(8, 16)), ("up", slice(16, 24))):
        lights = f"{{type: flash, {FAR}, energy: 3, duration: 1 us, offset: -0.1}}"
        result = picture(text_of(shutter.replace("DIRECTION", direction), lights))[:, 4:28].mean(axis=(1, 2))
        expected = np.zeros(32)
        expected[rows] = WHITE / 0.05
        np.testing.assert_allclose(result, expected, rtol=5e-3, atol=0.01 * WHITE / 0.05)
    # Where the whole frame is open at once, all of it sees the flash.
    lights = f"{{type: flash, {FAR}, energy: 3, duration: 1 us}}"
    result = picture(text_of("shutter: {duration: 0.25, readout: 0.2}", lights))
    np.testing.assert_allclose(result[8:24, 8:24], WHITE / 0.25, rtol=2e-2)


def test_a_flash_outlasts_the_shortest_of_shutters():
    # It shines all the time that the shutter is open, with its energy over its own duration; in float32 fractions of
    # the shutter's time it would end beyond all numbers.
    result = table(Timing(0.0, 1e-300), True, energy=2.0, duration=1e-4)
    np.testing.assert_allclose(result.intensity, 2e4, rtol=1e-12)
    assert result.pulse.begin[0] == 0.0
    assert result.pulse.end[0] > 1.0
