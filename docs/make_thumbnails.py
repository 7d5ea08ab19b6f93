"""Render the example scene of each kind, small, for the pages of the reference: `make gallery`.

    python docs/make_thumbnails.py [FAMILY/KIND ...]    those alone: materials/metal, cameras/lens, ...

The scenes are those of scenes/kinds; a picture of a few pixels is enlarged, so that they can be counted.
"""

import sys
from pathlib import Path

from PIL import Image

from raytracer.rendering.render import render
from raytracer.scene.load import load

ROOT = Path(__file__).parents[1]
KINDS = ROOT / "scenes" / "kinds"
THUMBNAILS = ROOT / "docs" / "gallery" / "kinds"
WIDTH = 240
QUALITY = 88
MOST_BYTES = 30_000


def thumbnail(scene: Path) -> Image.Image:
    """Render a scene as it is, and enlarge it by a whole number if it is smaller than a thumbnail."""
    picture = Image.fromarray(render(load(scene)).image.display())
    factor = WIDTH // picture.width
    return picture.resize((factor * picture.width, factor * picture.height), Image.Resampling.NEAREST)


def main(names: list[str]) -> None:
    """Render the scenes that are named, or all."""
    scenes = [KINDS / f"{name}.yaml" for name in names] or sorted(KINDS.glob("*/*.yaml"))
    for scene in scenes:
        target = THUMBNAILS / scene.parent.name / f"{scene.stem}.jpg"
        target.parent.mkdir(parents=True, exist_ok=True)
        thumbnail(scene).save(target, quality=QUALITY)
        size = target.stat().st_size
        print(f"{target.relative_to(ROOT)}: {size} bytes", flush=True)
        if size > MOST_BYTES:
            raise SystemExit(f"{target}: is larger than {MOST_BYTES} bytes")


if __name__ == "__main__":
    main(sys.argv[1:])
