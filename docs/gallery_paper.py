"""The paper that pictures of docs/gallery are shown on: several in a sheet, with captions, and small files of them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).parents[1]
SCENES = ROOT / "scenes"
GALLERY = ROOT / "docs" / "gallery"
LONGEST_EDGE = 800
SPP = 256
MOST_BYTES = 300_000

GAP = 6
CAPTION = 24
FONT_SIZE = 15
PAPER = (255, 255, 255)
INK = (40, 40, 40)
QUALITIES = (92, 88, 84, 80, 75)


def sheet(pictures: Sequence[NDArray[np.uint8]], captions: Sequence[str], columns: int) -> Image.Image:
    """Pictures of one size (height, width, 3) in rows, each with its caption below."""
    height, width, _ = pictures[0].shape
    rows = -(-len(pictures) // columns)
    paper = Image.new("RGB", (columns * (width + GAP) - GAP, rows * (height + CAPTION + GAP) - GAP), PAPER)
    draw, font = ImageDraw.Draw(paper), ImageFont.load_default(FONT_SIZE)
    for number, (picture, caption) in enumerate(zip(pictures, captions, strict=True)):
        left, top = number % columns * (width + GAP), number // columns * (height + CAPTION + GAP)
        paper.paste(Image.fromarray(picture), (left, top))
        draw.text((left + width // 2, top + height + CAPTION // 2), caption, INK, font, anchor="mm")
    return paper


def save_small(paper: Image.Image, target: Path) -> None:
    """Save a picture as finely compressed as the size allows."""
    for quality in QUALITIES:
        paper.save(target, quality=quality)
        if target.stat().st_size <= MOST_BYTES:
            break
