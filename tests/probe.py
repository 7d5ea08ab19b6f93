"""Compiles scenes one after another in a process of its own, and prints as JSON what went into each kernel.

Run as `python -m tests.probe NAME ...` with an empty kernel cache: a part that a scene shares with one before it is
compiled no more, so only what appears for the first time can be seen, and scenes go from the simplest on.
"""

import json
import re
import sys
from collections import Counter
from typing import Any

import numba
import numpy as np
from numba.core import event

from raytracer.integrator import FilmView, render_tile, workspace
from raytracer.scene.pack import pack
from tests.rendering import scene

PINHOLE = "camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0]}\n"
LENS = "camera: {type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], aperture: 100}\n"
CONSTANT = "environment: {type: constant, radiance: 1}\n"
MATTE = "objects:\n  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian}}\n"
GLASS = "  - {type: sphere, center: [2, 0, 0], radius: 1, material: {type: dielectric}}\n"
LAMP = "  - {type: sphere, center: [-2, 0, 0], radius: 1, material: {type: emitter, radiance: 1}}\n"

SCENES = {
    "plain": PINHOLE + MATTE,
    "sky": PINHOLE + CONSTANT + MATTE,
    "lens": LENS + MATTE,
    "glass": PINHOLE + MATTE + GLASS,
    "lamp": PINHOLE + MATTE + LAMP,
}


class _Compiled(event.Listener):
    """The modules of the functions that Numba compiles."""

    def __init__(self) -> None:
        self.modules: Counter[str] = Counter()

    def on_start(self, event: Any) -> None:
        self.modules[event.data["dispatcher"].py_func.__module__] += 1

    def on_end(self, event: Any) -> None:
        pass


def compiled(name: str) -> dict[str, Any]:
    """Compile the kernel of a scene without a pixel to render, and look into it."""
    packed = pack(scene(SCENES[name], filled=False)).scene
    size = (1, 1)
    film = FilmView(
        np.zeros((*size, 3)), np.zeros((*size, 3)), np.zeros(size, np.int64), np.zeros(size, np.int64), 0, 0, None
    )
    listener = _Compiled()
    with event.install_listener("numba:compile", listener):
        render_tile(packed, film, workspace(), 0, 0, 0, 0, 0, 0)
    signature = next(s for s in render_tile.signatures if s[0] == numba.typeof(packed))
    cached = sum(render_tile.stats.cache_hits.values())
    code = "" if cached else render_tile.inspect_llvm(signature)
    return {
        "modules": sorted(module for module in listener.modules if module.startswith("raytracer.")),
        "compiled": listener.modules.total(),
        "cache_hits": cached,
        "cache_misses": sum(render_tile.stats.cache_misses.values()),
        "llvm_size": len(code),
        "calls": {
            symbol: len(re.findall(rf'call [^\n]*@"?{symbol}"?\(', code))
            for symbol in ("rtcIntersect8", "rtcOccluded8")
        },
        "reference_counts": code.count("NRT_incref") + code.count("NRT_decref"),
    }


if __name__ == "__main__":
    print(json.dumps({name: compiled(name) for name in sys.argv[1:]}))
