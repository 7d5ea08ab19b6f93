"""A bench whose pictures have a noise, and whose times have lengths, that tests know.

Its scenes are real ones that are packed, but never compiled, and no clock is read.
"""

import math
from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from raytracer.analysis.cost.bench import Bench
from raytracer.core.error_estimate.metric import FLOOR
from raytracer.rendering.tile_renderer import RenderedTiles
from raytracer.rendering.tile_scheduler import TILE_SIZE
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack

SCENE = """\
camera: {{type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40, defocus_angle: 1}}
film: {{width: {width}, height: {height}}}
render: {{spp: 4, max_depth: 8}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {{type: metal, albedo: [0.8, 0.6, 0.4]}}}}
  - {{type: sphere, center: [0, -9, 0], radius: 8, material: {{type: lambertian, albedo: 0.5}}}}
"""


Prepared = namedtuple("Prepared", "spec packed accel scene seconds")


def scene_of(folder, width=160, height=112):
    path = folder / "scene.yaml"
    path.write_text(SCENE.format(width=width, height=height))
    return load(path)


@lru_cache(maxsize=8)
def noise(seed, spp, tiles):
    """The same for the same seed, whatever the scene, as with common random numbers."""
    return np.random.default_rng((seed, spp)).standard_normal((tiles, TILE_SIZE, TILE_SIZE, 3))


@dataclass
class World:
    """How pictures and times come about.

    linear, steep : MSE of a run of N samples, linear / N + steep / N^1.5, relative, on average over the picture.
    brightness : of the picture's mean.
    per_sample : seconds of a thread for a sample in a pixel.
    slower, noisier, brighter : factors of time, MSE and brightness by scene.
    jitter : spread of times, as the deviation of a logarithm.
    uneven : whether tiles differ in noise and time.
    bad : samples of every patch that are not finite.
    interrupt_after : calls after which Ctrl-C is pressed; None for never.
    """

    linear: float = 0.13
    steep: float = 0.09
    brightness: float = 2e-5
    per_sample: float = 1e-6
    slower: Callable = lambda prepared: 1.0
    noisier: Callable = lambda prepared: 1.0
    brighter: Callable = lambda prepared: 1.0
    jitter: float = 0.02
    uneven: bool = True
    bad: int = 0
    interrupt_after: int | None = None
    calls: list[tuple[int, int, int]] = field(default_factory=list)

    def bench(self):
        return Bench(self.prepare, self.render, lambda prepared, picture: 0.25)

    def prepare(self, spec, packed):
        packed = packed or pack(spec)
        accel = packed.built or object()
        seconds = {"pack": 0.0, "build": 0.5, "compile": 8.0}
        return Prepared(packed.spec, packed, accel, packed.scene, seconds)

    def unevenness(self, windows):
        """Factors of noise and time by tile, with a mean of about 1, the right half of the picture being worse."""
        if not self.uneven:
            return np.ones(len(windows))
        return np.array([0.5 + 1.0 * ((w.left // TILE_SIZE + 3 * (w.top // TILE_SIZE)) % 11) / 10.0 for w in windows])

    def mse(self, spp):
        return self.linear / spp + self.steep / spp**1.5

    def render(self, prepared, windows, spp, seed, threads, keep=()):
        """Even grey with normal noise: its relative MSE is that of the pixels' weight, 1 / (b^2 (1 + FLOOR^2))."""
        self.calls.append((len(windows), spp, seed))
        if self.interrupt_after is not None and len(self.calls) > self.interrupt_after:
            raise KeyboardInterrupt
        value = self.brightness * self.brighter(prepared)
        factors = self.unevenness(windows)

        def picture(n):
            mse = self.mse(n) * self.noisier(prepared) * factors
            deviation = self.brightness * math.sqrt(1.0 + FLOOR**2) * np.sqrt(mse)
            return value + deviation[:, None, None, None] * noise(seed, n, len(windows))

        pixels = np.array([(w.right - w.left) * (w.bottom - w.top) for w in windows])
        shaken = np.exp(self.jitter * np.random.default_rng(len(self.calls)).standard_normal())
        busy = self.per_sample * spp * pixels * factors * self.slower(prepared) * shaken
        count = np.full((len(windows), TILE_SIZE, TILE_SIZE), spp)
        pictures = {n: picture(n) for n in {spp, *keep}}
        return RenderedTiles(
            mean=pictures[spp],
            count=count,
            rays=3 * spp * pixels,
            busy=busy,
            seconds=float(busy.sum()) / threads,
            nan_samples=self.bad,
            levels={n: pictures[n] for n in keep},
        )
