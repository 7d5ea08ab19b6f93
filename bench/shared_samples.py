"""Measure what refocused pictures would gain if views shared their samples: a path that counts in several views.

    python bench/shared_samples.py [--rounds 6] [--spp 16]

A path through one point of the lens meets a surface; as seen from another point of the lens, the same place of the
surface has another pixel, and, if it is matte, the same radiance (Lehtinen, Aila, Chen, Laine, Durand 2011, "Temporal
Light Field Reconstruction for Rendering Distribution Effects").  Here each recorded ray of a thin-lens photograph is
copied to so many others of the lens, where no other surface is in the way.  A place that only the part V of the lens
sees has few copies, so each weighs 1 / V, and V is estimated by those that were tried.

Everything is to the advantage of sharing: all surfaces are matte, what a ray meets is known without a search, and a
copy costs one ray of visibility, in units of the rays of a path, and nothing else.  Prints the squared error of
pictures refocused from shared samples over that from independent ones, for as many paths and for as many rays.
"""

import argparse
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from raytracer.film.light_field.field import Rays
from raytracer.film.light_field.layout import extract_light_field
from raytracer.film.light_field.views import Views
from raytracer.rendering.render import render
from raytracer.scene.load import load

Array = NDArray[np.float64]

WIDTH, HEIGHT, BORDER = 96, 72, 8
REFERENCE_SPP = 2048
COPIES = (1, 4, 16)
FOCUS = 1.6
PLANES = {"0.7 m": 0.7, "1 m": 1.0, "1.6 m": 1.6, "2.6 m": 2.6}


class Card(NamedTuple):
    """A matte card across the axis: its distance (m), and how far it reaches to the left, right and each side up."""

    distance: float
    left: float
    right: float
    up: float


CARDS = (Card(1.0, -0.3, -0.05, 0.35), Card(1.6, -0.15, 0.2, 0.35), Card(2.6, -9.0, 9.0, 9.0))
"""From near to far; the last fills the picture."""


class Recorded(NamedTuple):
    """The rays of a photograph, and how many rays each of its paths took."""

    views: Views
    rays: Rays
    rays_a_path: float


def scene() -> dict[str, Any]:
    """Describe three cards between a matte floor and a matte ceiling, under a small lamp."""
    matte = {
        "type": "lambertian",
        "albedo": {"type": "noise", "scale": 12, "octaves": 3, "low": [0.2, 0.2, 0.2], "high": [0.9, 0.8, 0.7]},
    }
    level = [
        {"type": "quad", "corner": [-2, y, -2.5], "edges": [[4, 0, 0], [0, 0, 4]], "material": "plain"} for y in (-1, 2)
    ]
    cards = [
        {
            "type": "quad",
            "corner": [card.left, -card.up, -card.distance],
            "edges": [[card.right - card.left, 0, 0], [0, 2 * card.up, 0]],
            "material": "matte",
        }
        for card in CARDS
    ]
    return {
        "camera": {
            "type": "thin_lens",
            "look_from": [0, 0, 0],
            "look_at": [0, 0, -1],
            "vfov": 30,
            "aperture": 120,
            "focus_distance": FOCUS,
        },
        "film": {"width": WIDTH, "height": HEIGHT},
        "render": {"max_depth": 6, "sampler": "independent"},
        "environment": {"type": "constant", "radiance": [0.0, 0.0, 0.0]},
        "materials": {
            "matte": matte,
            "plain": {"type": "lambertian", "albedo": [0.7, 0.7, 0.7]},
            "lamp": {"type": "emitter", "radiance": [20, 20, 20]},
        },
        "objects": [
            *cards,
            *level,
            {"type": "sphere", "center": [0.6, 1.5, -0.5], "radius": 0.15, "material": "lamp"},
        ],
    }


def record(file: Path, spp: int, seed: int) -> Recorded:
    """Render the scene, and keep every ray."""
    rendered = render(load(file, {"render.seed": seed}), spp=spp, aovs=("rays",))
    field = extract_light_field(rendered.image)
    if field.rays is None:
        raise AssertionError("a picture with the AOV rays has rays")
    return Recorded(field.views, field.rays, rendered.stats.rays / rendered.stats.samples)


def card_met(place: Array, views: Views) -> NDArray[np.intp]:
    """Find the card (n,) that each ray (n, 4) meets first."""
    lens, slope = place[:, :2], place[:, 2:] - views.inverse_focus * place[:, :2]
    met = np.full(len(place), len(CARDS) - 1)
    for number, card in reversed(list(enumerate(CARDS[:-1]))):
        x, y = (lens + card.distance * slope).T
        met[(x > card.left) & (x < card.right) & (np.abs(y) < card.up)] = number
    return met


def share(recorded: Recorded, copies: int, rng: np.random.Generator) -> Rays:
    """Copy each ray to `copies` other points of the lens, where they see the same place."""
    views, rays = recorded.views, recorded.rays
    met = card_met(rays.place, views)
    distance = np.array([card.distance for card in CARDS])[met][:, None]
    lens = rays.place[:, :2]
    point = lens + (rays.place[:, 2:] - views.inverse_focus * lens) * distance
    places, seen = [rays.place], [np.ones(len(met), bool)]
    for _ in range(copies):
        other = lens[rng.permutation(len(lens))]
        places.append(np.concatenate([other, (point - other) / distance + views.inverse_focus * other], axis=1))
        seen.append(card_met(places[-1], views) == met)
    weight = np.array(seen) / np.mean(seen, axis=0)
    return Rays(np.concatenate(places), np.tile(rays.value, (copies + 1, 1)), weight.ravel())


def refocus(rays: Rays, views: Views, distance: float) -> Array:
    """Integrate rays in the pixel where each lands with the focus at `distance`, without the picture's border."""
    place = rays.place[:, 2:] + rays.place[:, :2] * (1.0 / distance - views.inverse_focus)
    column = np.floor((place[:, 0] - views.plane.left) / views.plane.pixel).astype(int)
    row = np.floor((views.plane.top - place[:, 1]) / views.plane.pixel).astype(int)
    inside = (row >= 0) & (row < HEIGHT) & (column >= 0) & (column < WIDTH)
    pixel, weight = row[inside] * WIDTH + column[inside], rays.weight[inside]
    totals = [np.bincount(pixel, weight * rays.value[inside, channel], WIDTH * HEIGHT) for channel in range(3)]
    sums = np.stack([*totals, np.bincount(pixel, weight, WIDTH * HEIGHT)], axis=-1).reshape(HEIGHT, WIDTH, 4)
    sums = sums[BORDER:-BORDER, BORDER:-BORDER]
    return np.asarray(sums[..., :3] / sums[..., 3:])


def squared_error(rays: Rays, views: Views, references: dict[str, Array]) -> list[float]:
    """Compute the mean squared error of the picture focused on each plane."""
    return [
        float(np.mean((refocus(rays, views, distance) - references[name]) ** 2)) for name, distance in PLANES.items()
    ]


def main() -> None:
    """Measure, and print Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--spp", type=int, default=16)
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "cards.yaml"
        file.write_text(yaml.safe_dump(scene()), encoding="utf-8")
        best = record(file, REFERENCE_SPP, seed=0)
        references = {name: refocus(best.rays, best.views, distance) for name, distance in PLANES.items()}
        errors: dict[int, list[list[float]]] = {copies: [] for copies in (0, *COPIES)}
        for seed in range(1, given.rounds + 1):
            recorded = record(file, given.spp, seed)
            for copies, rows in errors.items():
                rays = share(recorded, copies, rng)
                rows.append(squared_error(rays, recorded.views, references))
    alone = np.mean(errors[0], axis=0)
    print(f"{best.rays_a_path:.2f} rays a path, {given.spp} paths a pixel; squared error over that of independent ones")
    print("\n| copies | " + " | ".join(f"at {name}, paths / rays" for name in PLANES) + " |")
    print("|---|" + "---|" * len(PLANES))
    for copies in COPIES:
        ratios = np.mean(errors[copies], axis=0) / alone
        cost = 1.0 + copies / best.rays_a_path
        print(f"| {copies} | " + " | ".join(f"{ratio:.2f} / {ratio * cost:.2f}" for ratio in ratios) + " |")


if __name__ == "__main__":
    main()
