"""What is switched off is not there: the same bits, the same rays, and the same machine code as if never named.

A scene's type is what gets compiled (docs/architecture.md), so one type, one kernel; that nothing is compiled for the
second of two such scenes, tests/kernel/test_specialisation.py asks a process of its own.
"""

import numba
import numpy as np
import pytest

from raytracer.rendering.render import render
from raytracer.scene.pack.scene import pack
from tests.small_scenes import scene

LOOK = "look_from: [0, 1, 4], look_at: [0, 0, 0]"
STILL = """
environment: {type: constant, radiance: [0.2, 0.5, 1]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.7}}
  - {type: quad, corner: [-4, -1, -4], edges: [[8, 0, 0], [0, 0, 8]], material: {type: lambertian}}
"""
HELD = STILL.replace("radius: 1,", "radius: 1, motion: {velocity: [0, 0, 0]},")
FLYING = STILL.replace("radius: 1,", "radius: 1, motion: {velocity: [3, 0, 0], spin: {axis: [0, 1, 0], rate: 90}},")

ANGLE = "type: pinhole, vfov: 40"
FIFTY = "sensor: full_frame, focal_length: 50"
LENS = f"type: thin_lens, {FIFTY}, focus_distance: 2"
RIM = "vignetting: {diameter: 999, distance: 9}"
OPEN = f"{LENS}, f_number: 2, {RIM}"
"""Of the type of most scenes of the tests of AOVs."""

OFF = {
    # An opening of no size.
    "f_number inf": (f"type: thin_lens, {FIFTY}, focus_distance: .inf, f_number: .inf", f"type: pinhole, {FIFTY}"),
    "f_number inf, focused": (f"{LENS}, f_number: .inf", LENS),
    "f_number inf of a pinhole": (f"type: pinhole, {FIFTY}, f_number: .inf", f"type: pinhole, {FIFTY}"),
    "f_number inf and an angle": ("type: thin_lens, sensor: aps_c, vfov: 40, f_number: .inf", ANGLE),
    "diameter 0": (f"type: pinhole, {FIFTY}, diameter: 0", f"type: pinhole, {FIFTY}"),
    "aperture 0": ("type: thin_lens, vfov: 40, aperture: 0", ANGLE),
    "defocus_angle 0": ("type: thin_lens, vfov: 40, defocus_angle: 0", ANGLE),
    "a shape of no opening": (f"{LENS}, f_number: .inf, aperture_shape: {{type: polygon}}", LENS),
    "a rim of no opening": (f"{LENS}, f_number: .inf, vignetting: {{diameter: 9, distance: 9}}", LENS),
    "round": (f"{OPEN}, aperture_shape: {{type: round}}", OPEN),
    # No exposure: with all that it takes but `iso`, and with an aperture that nothing but `iso` would make use of.
    "no iso": (f"type: pinhole, {FIFTY}, shutter: 1/125 s", f"type: pinhole, {FIFTY}"),
    "no iso, with a pinhole's f_number": (f"type: pinhole, {FIFTY}, f_number: 8", f"type: pinhole, {FIFTY}"),
    "no iso, through a lens": (f"{OPEN}, shutter: 1/125 s", f"{LENS}, aperture: 25, {RIM}"),
    "no noise": (
        OPEN.replace("full_frame", "{format: full_frame, noise: false, read_noise: 9, full_well: 5000}"),
        OPEN,
    ),
    # No time, or nothing that moves in it.
    "shutter": (f"{ANGLE}, shutter: 1/125 s", ANGLE),
    "trapezoid": (f"{ANGLE}, shutter: {{duration: 1/125 s, opening: trapezoid, ramp: 1/1000 s}}", ANGLE),
    "curve": (f"{ANGLE}, shutter: {{opening: [[0, 0], [1 ms, 1], [3 ms, 0]]}}", ANGLE),
    "rolling": (f"{ANGLE}, shutter: {{duration: 1/125 s, readout: 1/30 s, direction: left}}", ANGLE),
    "slit": (f"{ANGLE}, shutter: {{duration: 1/125 s, readout: 1/250 s, curtain: focal_plane}}", ANGLE),
    "no shake": (f"{ANGLE}, shutter: 1/4 s, shake: {{amplitude: 0, bandwidth: 5}}", ANGLE),
    "shake in no time": (f"{ANGLE}, shake: {{amplitude: 1 deg}}", ANGLE),
    "time": (f"{ANGLE}, time: 7", ANGLE),
}

IN_NO_TIME = {
    "moving, without a shutter": (ANGLE, FLYING),
    "moving, in a shutter of length 0": (f"{ANGLE}, shutter: 0", FLYING),
    "moving, in one that closes when it opens": (f"{ANGLE}, shutter: {{open: 0, close: 0}}", FLYING),
    "moving, in a trapezoid of length 0": (f"{ANGLE}, shutter: {{duration: 0, opening: trapezoid, ramp: 0}}", FLYING),
    "held, in a shutter": (f"{ANGLE}, shutter: 1", HELD),
    "a camera that is held": (f"{ANGLE}, shutter: 1, motion: {{velocity: [0, 0, 0]}}", STILL),
    "a camera that moves in no time": (f"{ANGLE}, shutter: 0, motion: {{velocity: [1, 0, 0]}}", STILL),
}

PAIRS = {name: (off, STILL, plain) for name, (off, plain) in OFF.items()} | {
    name: (off, rest, ANGLE) for name, (off, rest) in IN_NO_TIME.items()
}


def spec_of(camera, rest=STILL):
    settings = {"width": 24, "height": 16, "spp": 8, "max_depth": 4, "sampler": "sobol", "lit": True}
    return scene(f"camera: {{{LOOK}, {camera}}}\n{rest}", **settings)


def packed(camera, rest=STILL):
    return pack(spec_of(camera, rest)).scene


@pytest.fixture(scope="module")
def plain():
    """Pictures of the cameras without what is switched off."""
    return {camera: render(spec_of(camera), threads=2) for camera in {never for *_, never in PAIRS.values()}}


@pytest.mark.parametrize("name", PAIRS)
def test_what_is_switched_off_leaves_bits_rays_and_type_as_they_are(name, plain):
    off, rest, never = PAIRS[name]
    assert numba.typeof(packed(off, rest)) == numba.typeof(packed(never))
    found, expected = render(spec_of(off, rest), threads=2), plain[never]
    np.testing.assert_array_equal(found.image.radiance, expected.image.radiance)
    np.testing.assert_array_equal(found.image.variance, expected.image.variance)
    assert found.stats.rays == expected.stats.rays > 24 * 16 * 8


@pytest.mark.parametrize(
    ("on", "rest"),
    [
        (f"{LENS}, f_number: 22", STILL),
        (f"{LENS}, f_number: 22, shutter: 1/125 s, iso: 100", STILL),
        (f"type: pinhole, {FIFTY}, diameter: 0.1", STILL),
        (f"{ANGLE}, shutter: 1/4 s, shake: {{amplitude: 1 deg}}", STILL),
        (f"{ANGLE}, shutter: 1/4 s, motion: {{velocity: [1, 0, 0]}}", STILL),
        (f"{ANGLE}, shutter: 1/125 s", FLYING),
        (f"{ANGLE}, shutter: {{duration: 0, readout: 1/30 s}}", FLYING),
    ],
)
def test_what_is_switched_on_is_there(on, rest):
    """So that the equalities above are not for want of what they would miss."""
    assert numba.typeof(packed(on, rest)) != numba.typeof(packed(ANGLE))


def test_exposure_without_noise_and_with_it_is_one_kernel():
    # What the sensor does to light is done to the picture, not to rays.
    lens = f"{LENS}, f_number: 2, shutter: 1/125 s"
    noisy = lens.replace("sensor: full_frame", "sensor: {format: full_frame, noise: true, bit_depth: 12}")
    types = {
        numba.typeof(packed(keys))
        for keys in (
            f"{lens}, iso: 100",
            f"{lens}, iso: 6400, exposure_compensation: -2",
            f"{lens}, exposure: auto",
            f"{noisy}, iso: 800",
        )
    }
    assert len(types) == 1
    # Nor does metering, where there is no aperture whose light could be weighed.
    assert numba.typeof(packed(f"{ANGLE}, exposure: auto")) == numba.typeof(packed(ANGLE))
