"""Files of sweeps, and the texts that stand for many values; how many there are is known before they are made."""

import contextlib
import math
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from raytracer.analysis.sweep.plan import enumerate_points, make_plan
from raytracer.scene.load import build
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError

DICTIONARY = tuple(
    word.encode()
    for word in (
        *(
            "scene: ",
            "sweep:",
            "define:",
            "zip: true",
            "camera.f_number",
            "camera.shutter",
            "1.4..22",
            "1/1000..1/30/3",
        ),
        *(":log", "1:1e9:1e-9", "2:10:5", "1e308:1e-308:9:log", "..", "0..inf", "99999", " mm", "objects.ball.radius"),
        *("[[1,2],{a: b}]", "camera.iso", "../", "/dev/zero", ".inf"),
    )
)

_SCENE = """\
camera: {type: thin_lens, look_from: [0, 0, 4], focal_length: 50 mm, sensor: full_frame, f_number: 2,
          focus_distance: 4, iso: 100, shutter: 1/60 s}
film: {width: 8, height: 6}
objects: [{type: sphere, name: ball, center: [0, 0, 0], radius: 1}]
"""

_KEYS = (
    "camera.f_number",
    "camera.shutter",
    "camera.iso",
    "objects.ball.radius",
    "camera.focus_distance",
    "film.width",
)
_MOST_POINTS = 1000


def seeds() -> Iterator[bytes]:
    yield b"scene: scene.yaml\ndefine: {film.width: 16}\nsweep: {camera.f_number: 1.4..22/2, camera.iso: [100, 200]}\n"
    yield b"scene: scene.yaml\nzip: true\nsweep: {camera.shutter: 1/1000..1/30, camera.focus_distance: '1:4:5,inf'}\n"
    # A zero, a key by its number, and a text of values.
    for number, text in enumerate(("1.4..22/3", "1/8000..30 s", "3200..100", "0.1:1e3:7:log", "1:4:4,inf", "2:10:5")):
        yield bytes((0, number)) + text.encode()


@cache
def _scene() -> SceneSpec:
    return build(_SCENE, "scene.yaml")


def run(data: bytes, folder: Path) -> None:
    if data[:1] == b"\0":
        key, text = _KEYS[data[1] % len(_KEYS)] if data[1:] else _KEYS[0], data[2:].decode("utf-8", errors="replace")
        plan = make_plan(_scene(), {key: text})
    else:
        (folder / "scene.yaml").write_text(_SCENE)
        (folder / "sweep.yaml").write_bytes(data)
        plan = make_plan(folder / "sweep.yaml", {})
    for axis in plan.axes:
        assert len(set(axis.labels)) == len(axis.values) <= 100_000
        assert not any(isinstance(value, float) and math.isnan(value) for value in axis.values if _is_range(value))
    for point in enumerate_points(plan.axes, zipped=plan.zipped, most=_MOST_POINTS)[:3]:
        with contextlib.suppress(InputError):
            plan.spec.replace(point.values)


def _is_range(value: Any) -> bool:
    """Tell if a value may be of a range, whose numbers are finite; `.nan` may stand in a list."""
    return isinstance(value, float) and not math.isnan(value)
