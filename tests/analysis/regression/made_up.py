"""Renders that are made up: a picture that is known, with noise that is known, in no time."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from raytracer.analysis.regression import check, render_reference
from raytracer.analysis.regression.reference_file import save_reference
from raytracer.film.image import Image

WIDTH, HEIGHT = 48, 32

SCENE = f"""\
camera: {{type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}}
film: {{width: {WIDTH}, height: {HEIGHT}}}
environment: {{type: constant, radiance: 1}}
objects:
  - {{type: sphere, center: [0, 0, 0], radius: 1, material: {{type: lambertian, albedo: 0.5}}}}
"""


def truth(width=WIDTH, height=HEIGHT):
    y, x = np.mgrid[:height, :width]
    grey = (0.5 + 0.3 * np.sin(x / 5) * np.cos(y / 7)) * (1 + 0.3 * np.sign(np.sin(2.1 * x) * np.sin(1.7 * y)))
    return np.asarray(grey[..., None] * [1.0, 0.7, 0.4])


class MadeUp:
    """In place of `rendering.render`: the picture of the scene's size, with noise of `sigma` times it in each sample.

    change : what has happened to the picture; settings : of the image; nan_samples, of the render;
    interrupted : whether the user ends it; calls : what it was asked for.
    """

    def __init__(self, sigma=0.3):
        self.sigma = sigma
        self.change: Any = lambda picture: picture
        self.settings: dict[str, Any] = {}
        self.nan_samples, self.interrupted = 0, False
        self.calls: list[dict[str, Any]] = []

    def __call__(self, spec, *, spp, seed, **others):
        self.calls.append({"spec": spec, "spp": spp, "seed": seed, **others})
        picture = self.change(truth(spec.film.width, spec.film.height))
        rng = np.random.default_rng([seed, spp])
        variance = (self.sigma * picture) ** 2 / spp
        chi2 = rng.chisquare(spp - 1, picture.shape) / (spp - 1)
        noisy = picture + np.sqrt(variance) * rng.standard_normal(picture.shape)
        image = Image(noisy, variance * chi2, spp, self.settings)
        return SimpleNamespace(
            image=image, stats=SimpleNamespace(nan_samples=self.nan_samples), interrupted=self.interrupted
        )

    def install(self, monkeypatch):
        for module in (render_reference, check):
            monkeypatch.setattr(module, "render", self)
        return self


def keep(path, found, **settings):
    """Render a reference into a file."""
    save_reference(path, *render_reference.render_reference(found, **settings))
    return path


def reference(folder, name="ball", spp=4096, width=None):
    scene = folder / f"{name}.yaml"
    scene.write_text(SCENE, encoding="utf-8")
    found = render_reference.prepare_reference_scene(scene, folder / "references", {}, width)
    return keep(folder / "references" / f"{name}.npz", found, spp=spp)
