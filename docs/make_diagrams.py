"""Draw the diagrams of the lecture into docs/lecture/diagrams: `python docs/make_diagrams.py [NAME ...]`."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs.diagrams import lens, light_field, shutter, view  # noqa: E402
from raytracer.report.figure import ON_PAPER, style, to_svg  # noqa: E402

DIAGRAMS = {**view.DIAGRAMS, **shutter.DIAGRAMS, **lens.DIAGRAMS, **light_field.DIAGRAMS}


def main(names: list[str]) -> None:
    """Draw the named diagrams, or all."""
    folder = ROOT / "docs" / "lecture" / "diagrams"
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or DIAGRAMS:
        with style(ON_PAPER):
            (folder / f"{name}.svg").write_bytes(to_svg(DIAGRAMS[name]().figure, title=name.replace("_", " ")))


if __name__ == "__main__":
    main(sys.argv[1:])
