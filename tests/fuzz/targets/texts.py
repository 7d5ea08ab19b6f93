"""Texts of the command line and of sweeps: options, values with units, glasses, and ranges of values."""

import contextlib
import math
import typing
from functools import partial

import numpy as np

from raytracer.analysis.explain import parse_circle
from raytracer.analysis.sweep.plan import enumerate_points, make_plan
from raytracer.cli.base.options import parse_value
from raytracer.optics.glass import MAX_INDEX, parse_glass
from raytracer.rendering.options import parse_crop
from raytracer.scene.load import build, load
from raytracer.scene.overrides import apply_overrides, parse_overrides
from raytracer.schema.fields import MAX_MAGNITUDE, Quantity
from raytracer.schema.units import Dimension, parse_bytes, parse_duration, parse_percentage, parse_quantity
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import InputError
from tests.fuzz.harness import target

_SCENE = """\
camera: {type: thin_lens, look_from: [0, 0, 4], focal_length: 50 mm, sensor: full_frame, f_number: 2,
          focus_distance: 4, iso: 100, shutter: 1/60 s}
film: {width: 8, height: 6}
materials: {red: {type: lambertian, albedo: [0.8, 0.1, 0.1]}}
objects: [{type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: red}]
"""
_SPEC = build(_SCENE, "scene.yaml")

# ---- Options: -D, --crop, --time-limit, --noise and amounts of memory; and what they do to a scene

_OPTIONS = (
    partial(parse_value, "--crop", parse=parse_crop),
    partial(parse_value, "--time-limit", parse=parse_duration),
    partial(parse_value, "--noise", parse=parse_percentage),
    partial(parse_value, "--memory", parse=parse_bytes),
    parse_circle,
)
_OVERRIDES = [
    b"Dcamera.f_number=4",
    b"Dcamera.focal_length=20 mm",
    b"Dobjects[0].radius=2",
    b"Dobjects.ball.material={type: metal, albedo: 0.5}",
    b"Dobjects=[{type: box, min: [0, 0, 0], max: [1, 1, 1]}]\nmaterials.red.albedo=0.5\nrender.spp=8",
    *(bytes([number]) + text for number, text in enumerate((b"0,0,4,4", b"30 s", b"2%", b"1.5 GiB", b"0.03mm"))),
]
_WORDS = (
    "camera.vfov=~objects[0].radius=~objects.ball.~materials.red={type: metal}~film={width: 8}~=.inf~1e400~0,0,8,8~1%~"
    "[9999999999999999999]~a.a.a.a.a.a.a.~5 min~2GB~\x1b[2J~...~[0]["
)


@target("override", seeds=_OVERRIDES, words=_WORDS)
def override(data, folder):
    text = data[1:].decode("utf-8", errors="surrogateescape")
    if data[:1] != b"D":
        number = _OPTIONS[data[0] % len(_OPTIONS) if data else 0](text)
        assert not isinstance(number, float) or math.isfinite(number)
        return
    overrides = parse_overrides(text.split("\n"))
    apply_overrides(_SPEC, overrides)
    (folder / "scene.yaml").write_text(_SCENE)
    load(folder / "scene.yaml", overrides)


# ---- Sweeps: their files, and the texts that stand for many values; how many there are is known before they are made.
# After a zero come a key by its number, and a text of values.

_KEYS = (
    "camera.f_number",
    "camera.shutter",
    "camera.iso",
    "objects.ball.radius",
    "camera.focus_distance",
    "film.width",
)
_RANGES = (b"1.4..22/3", b"1/8000..30 s", b"3200..100", b"0.1:1e3:7:log", b"1:4:4,inf", b"2:10:5")
_SWEEPS = [
    b"scene: scene.yaml\ndefine: {film.width: 16}\nsweep: {camera.f_number: 1.4..22/2, camera.iso: [100, 200]}\n",
    b"scene: scene.yaml\nzip: true\nsweep: {camera.shutter: 1/1000..1/30, camera.focus_distance: '1:4:5,inf'}\n",
    *(bytes((0, number)) + text for number, text in enumerate(_RANGES)),
]
_WORDS = (
    "scene: ~sweep:~define:~zip: true~camera.f_number~camera.shutter~1.4..22~1/1000..1/30/3~:log~1:1e9:1e-9~2:10:5~..~"
    "1e308:1e-308:9:log~0..inf~99999~ mm~objects.ball.radius~[[1,2],{a: b}]~camera.iso~../~/dev/zero~.inf"
)
_MOST_POINTS = 1000


@target("sweep", seeds=_SWEEPS, words=_WORDS)
def plan_sweep(data, folder):
    if data[:1] == b"\0":
        key, text = _KEYS[data[1] % len(_KEYS)] if data[1:] else _KEYS[0], data[2:].decode("utf-8", errors="replace")
        plan = make_plan(_SPEC, {key: text})
    else:
        (folder / "scene.yaml").write_text(_SCENE)
        (folder / "sweep.yaml").write_bytes(data)
        plan = make_plan(folder / "sweep.yaml", {})
    for axis in plan.axes:
        assert len(set(axis.labels)) == len(axis.values) <= 100_000
    for point in enumerate_points(plan.axes, zipped=plan.zipped, most=_MOST_POINTS)[:3]:
        with contextlib.suppress(InputError):
            plan.spec.replace(point.values)


# ---- Numbers with units, by the first byte, and indices of refraction with the names of glasses

_DIMENSIONS = typing.get_args(Dimension)
_NUMBERS = ("2 ft", "1/3 cm", "550 nm", "0.3 rad", "1/125 s", "30 km/h", "300 rpm", "10 Hz", "1 K", "1/3")
_GLASSES = ("N-BK7", "1.5", "{index: 1.5, abbe: 60}", "{cauchy: [1.5, 0.004]}", "{sellmeier: {b: [1.1], c: [0.01]}}")
_UNITS = [
    *(bytes([number]) + text.encode() for number, text in enumerate(_NUMBERS)),
    *(b"\xff" + text.encode() for text in _GLASSES),
]
_WORDS = (
    "1/125 s~50 mm~deg/s~µm~°~inf~.inf~1e400~-0~/0~N-BK7~{index: 1.5, abbe: 60}~{cauchy: [1.5, 0.004]}~"
    "{sellmeier: {b: [1], c: [0.01]}}~turn/s~rpm~mph~٣"
)


@target("units", seeds=_UNITS, words=_WORDS)
def parse_number(data, folder):
    text = data[1:].decode("utf-8", errors="replace")
    try:
        if data[:1] == b"\xff":
            root = parse(text, "glass")
            ior = parse_glass(None if root is None else root.plain()).ior(np.arange(360.0, 831.0))
            assert np.isfinite(ior).all()
            assert ((ior > 0.0) & (ior <= MAX_INDEX)).all()
        else:
            dimension = _DIMENSIONS[(data[0] if data else 0) % len(_DIMENSIONS)]
            assert not math.isnan(parse_quantity(text, dimension))
            number = Quantity(dimension)(text)
            assert number == 0.0 or 1.0 / MAX_MAGNITUDE <= abs(number) <= MAX_MAGNITUDE
    except ValueError as error:
        raise InputError(str(error)) from None
