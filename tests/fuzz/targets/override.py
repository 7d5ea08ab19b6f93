"""Options of the command line: -D, --crop, --time-limit, --noise and amounts of memory; and what they do to a scene."""

import math
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

from raytracer.analysis.explain import parse_circle
from raytracer.cli.base import options
from raytracer.rendering.options import parse_crop
from raytracer.scene.load import build, load
from raytracer.scene.overrides import apply_overrides, parse_overrides
from raytracer.scene.spec import SceneSpec
from raytracer.schema.units import parse_bytes, parse_duration, parse_percentage

DICTIONARY = tuple(
    word.encode()
    for word in (
        *(
            "camera.vfov=",
            "objects[0].radius=",
            "objects.ball.",
            "materials.red={type: metal}",
            "film={width: 8}",
            "=.inf",
        ),
        *(
            "[9999999999999999999]",
            "a.a.a.a.a.a.a.",
            "1e400",
            "0,0,8,8",
            "5 min",
            "1%",
            "2GB",
            "\x1b[2J",
            "...",
            "[0][",
        ),
    )
)

_SCENE = """\
camera: {type: pinhole, look_from: [0, 0, 4], vfov: 40}
film: {width: 8, height: 6}
materials: {red: {type: lambertian, albedo: [0.8, 0.1, 0.1]}}
objects: [{type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: red}]
"""

_OPTIONS: tuple[Callable[[str], Any], ...] = (
    partial(options.parse_value, "--crop", parse=parse_crop),
    partial(options.parse_value, "--time-limit", parse=parse_duration),
    partial(options.parse_value, "--noise", parse=parse_percentage),
    partial(options.parse_value, "--memory", parse=parse_bytes),
    parse_circle,
)


def seeds() -> Iterator[bytes]:
    for text in ("camera.vfov=20 deg", "objects[0].radius=2", "objects.ball.material={type: metal, albedo: 0.5}"):
        yield b"D" + text.encode()
    yield b"Dobjects=[{type: box, min: [0, 0, 0], max: [1, 1, 1]}]\nmaterials.red.albedo=0.5\nrender.spp=8"
    for number, text in enumerate(("0,0,4,4", "30 s", "2%", "1.5 GiB", "0.03mm")):
        yield bytes((number,)) + text.encode()


@cache
def _scene() -> SceneSpec:
    return build(_SCENE, "scene.yaml")


def run(data: bytes, folder: Path) -> None:
    text = data[1:].decode("utf-8", errors="surrogateescape")
    if data[:1] != b"D":
        number = _OPTIONS[data[0] % len(_OPTIONS) if data else 0](text)
        assert not isinstance(number, float) or math.isfinite(number)
        return
    overrides = parse_overrides(text.split("\n"))
    apply_overrides(_scene(), overrides)
    (folder / "scene.yaml").write_text(_SCENE)
    load(folder / "scene.yaml", overrides)
