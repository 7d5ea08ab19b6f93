"""Compiles scenes in a process of its own, and prints as JSON what went into each kernel.

Run as `python -m tests.probe NAME ...` with an empty kernel cache: a part that a scene shares with one before it is
compiled no more, and not seen.
"""

import json
import re
import sys
from collections import Counter
from typing import Any

import numpy as np

from raytracer.core.compiler import build_entry, parts
from raytracer.core.compiler.build_entry import link_entry
from raytracer.core.compiler.passes import lower_part
from raytracer.kernel.aovs.base.interface import AovRecorder
from raytracer.kernel.path_state import workspace
from raytracer.kernel.path_tracer import render_tile
from raytracer.kernel.pixel_accumulator import FilmView
from raytracer.scene.pack.scene import pack, scene_ids
from tests.repository import ROOT, script
from tests.small_scenes import scene

PINHOLE = "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0]}\n"
EXPOSED = "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], shutter: 1}\n"
DOLLY = EXPOSED.replace("shutter: 1", "shutter: 1, motion: {velocity: [1, 0, 0]}")
LENS = "camera: {type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], aperture: 100}\n"
IRIS = LENS.replace("}", ", aperture_shape: {type: polygon}, vignetting: {diameter: 90, distance: 50}}")
OFF = PINHOLE.replace(
    "pinhole,",
    "pinhole, sensor: {format: full_frame, noise: false, read_noise: 9}, diameter: 0, "
    "shutter: {duration: 1/125 s, opening: trapezoid, ramp: 1/1000 s, readout: 1/30 s}, shake: {amplitude: 0},",
)
CONSTANT = "environment: {type: constant, radiance: 1}\n"
MATTE = "objects:\n  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian}}\n"
HELD = MATTE.replace("radius: 1", "radius: 1, motion: {velocity: [0, 0, 0]}")
FLYING = MATTE.replace("radius: 1", "radius: 1, motion: {velocity: [1, 0, 0]}")
EGG = MATTE.replace("radius: 1", "radius: 1, transform: [{scale: [1, 2, 1]}]")
GLASS = "  - {type: sphere, center: [2, 0, 0], radius: 1, material: {type: dielectric}}\n"
LAMP = "  - {type: sphere, center: [-2, 0, 0], radius: 1, material: {type: emitter, radiance: 1}}\n"
GAUZE = "  - {type: sphere, center: [2, 0, 0], radius: 1, material: {type: cutout, material: {type: lambertian}}}\n"

CHECKED = MATTE.replace("{type: lambertian}", "{type: lambertian, albedo: {type: checker}}")
BUMPY = CHECKED.replace("{type: checker}}", "{type: checker}, bump: {type: checker}}")
MANY = (
    IRIS.replace("look_at: [0, 0, 0]", "look_at: [0, 0, 0], shutter: 1")
    + CONSTANT
    + "media: {fog: {type: homogeneous, absorption: 1}}\nmedium: fog\n"
    + CHECKED.replace("radius: 1", "radius: 1, motion: {velocity: [1, 0, 0]}")
    + LAMP
    + GLASS
    + GAUZE
)

SCENES = {
    "plain": PINHOLE + MATTE,
    "off": OFF + HELD,
    "sky": PINHOLE + CONSTANT + MATTE,
    "lens": LENS + MATTE,
    "iris": IRIS + MATTE,
    "fisheye": "camera: {type: fisheye, look_from: [0, 0, 4], look_at: [0, 0, 0]}\n" + MATTE,
    "glass": PINHOLE + MATTE + GLASS,
    "lamp": PINHOLE + MATTE + LAMP,
    "fog": PINHOLE + "media: {fog: {type: homogeneous, absorption: 1}}\nmedium: fog\n" + MATTE,
    "sun": PINHOLE + "lights: [{type: sun, direction: [0, -1, 0], irradiance: 1}]\n" + MATTE,
    "daylight": PINHOLE + "environment: {type: sky}\n" + MATTE,
    "egg": PINHOLE + EGG,
    "flight": EXPOSED + FLYING,
    "dolly": DOLLY + MATTE,
    "checked": PINHOLE + CHECKED,
    "bumpy": PINHOLE + BUMPY,
    "gauze": PINHOLE + MATTE + LAMP + GAUZE,
    "many": MANY,
}


class _Compiled:
    """The modules of the functions that are compiled, and the LLVM code of the whole."""

    def __init__(self):
        self.modules: Counter[str] = Counter()
        self.code = ""
        self.linked: Any = None

    def lower_part(self, function, *arguments, **options):
        self.modules[function.__module__] += 1
        return lower_part(function, *arguments, **options)

    def link_entry(self, *arguments):
        module = link_entry(*arguments)
        self.code = str(module)
        self.linked = module
        return module


def _instructions(linked):
    """Count the instructions of a linked kernel, as bench/kernels.py does; 0 of one that was in the cache."""
    if linked is None:
        return 0
    sys.path.append(str(ROOT / "bench"))
    counted_in = script("bench/kernels.py").counted_in
    return counted_in(str(build_entry._target_machine().emit_assembly(linked))).total()


def compiled(name):
    """Compile the kernel of a scene without a pixel to render, and look into it; "plain+depth" records an AOV."""
    base, _, aov = name.partition("+")
    spec = scene(SCENES[base], filled=False)
    found = pack(spec)
    packed = found.scene
    size = (1, 1)
    aovs = AovRecorder([aov] if aov else [], 1, 1, scene_ids(spec, found)).view
    film = FilmView(
        np.zeros((*size, 3)), np.zeros((*size, 3)), np.zeros(size, np.int64), np.zeros(size, np.int64), 0, 0, aovs
    )
    listener = _Compiled()
    # Parts that are loaded would hide what they call.
    vars(parts).update(load_part=lambda *_: None, lower_part=listener.lower_part)
    vars(build_entry).update(link_entry=listener.link_entry)
    before = render_tile.counts.copy()
    render_tile(packed, film, workspace(packed), 0, 0, 0, 0, 0, 0)
    code = listener.code
    return {
        "modules": sorted(module for module in listener.modules if module.startswith("raytracer.")),
        "compiled": listener.modules.total(),
        "cache_hits": render_tile.counts["loaded"] - before["loaded"],
        "cache_misses": render_tile.counts["compiled"] - before["compiled"],
        "llvm_size": len(code),
        "instructions": _instructions(listener.linked),
        "calls": {
            symbol: len(re.findall(rf'call [^\n]*@"?{symbol}"?\(', code))
            for symbol in ("rtcIntersect8", "rtcOccluded8")
        },
        "reference_counts": code.count("NRT_incref") + code.count("NRT_decref"),
    }


if __name__ == "__main__":
    print(json.dumps({name: compiled(name) for name in sys.argv[1:]}))
