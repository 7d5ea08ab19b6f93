"""Render the scenes of the repository into docs/gallery, small: `make gallery`."""

from pathlib import Path

from raytracer.rendering import render
from raytracer.scene.load import load

ROOT = Path(__file__).parents[1]
LONGEST_EDGE = 800
SPP = 256
MOST_BYTES = 300_000


def main() -> None:
    """Render every scene."""
    folder = ROOT / "docs" / "gallery"
    folder.mkdir(exist_ok=True)
    for file in sorted((ROOT / "scenes").glob("*.yaml")):
        film = load(file).film
        factor = min(1.0, LONGEST_EDGE / max(film.width, film.height))
        size = {"film.width": round(factor * film.width), "film.height": round(factor * film.height)}
        picture = folder / f"{file.stem}.jpg"
        rendered = render(load(file, size), spp=SPP)
        rendered.image.save(picture)
        print(f"{picture.relative_to(ROOT)}: {rendered.stats.seconds['render']:.1f} s, {picture.stat().st_size} bytes")
        if picture.stat().st_size > MOST_BYTES:
            raise SystemExit(f"{picture}: is larger than {MOST_BYTES} bytes")


if __name__ == "__main__":
    main()
