"""Write ``scenes/bouncing.yaml``, the motion blur picture of *Ray Tracing: The Next Week*.

It is the scene of ``cover.py`` with its small matte spheres moving upwards; a second run writes the same bytes:

    python scenes/generate/bouncing.py [OUT.yaml]
"""

from __future__ import annotations

import argparse
import random
from pathlib import Path

from cover import cover, number

SEED = 2

HEADER = """\
# The motion blur picture of "Ray Tracing: The Next Week" (Shirley, Black, Hollasch), sec. 2: the spheres of the cover
# of "One Weekend", the small matte ones moving upwards by up to 0.5 m while the shutter is open, for one second.
# Made by `python scenes/generate/bouncing.py`, which reproduces this file byte for byte; change that script instead.
# Look at: matte spheres drawn out upwards, while small metal and glass ones beside them are sharp; both sides of the
# blur, the end of the way as clear as the start; moving spheres in the mirrors.
camera:
  type: thin_lens
  look_from: [13, 2, 3]
  look_at: [0, 0, 0]
  up: [0, 1, 0]
  vfov: 20
  focus_distance: 10
  defocus_angle: 0.6
  shutter: {open: 0, close: 1}
"""


def moving(line: str, rng: random.Random) -> str:
    """Give a small matte sphere a velocity (m/s), and leave every other line as it is."""
    if "radius: 0.2" not in line or "lambertian" not in line:
        return line
    velocity = number(rng.uniform(0, 0.5))
    return line.removesuffix("}\n") + f", motion: {{velocity: [0, {velocity}, 0]}}}}\n"


def bouncing() -> str:
    """Return the text of the whole scene file."""
    _, film, rest = cover().partition("film:")
    rng = random.Random(SEED)
    return HEADER + "".join(moving(line, rng) for line in (film + rest).splitlines(keepends=True))


def main() -> None:
    """Write the scene to the path given, or beside the other scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent.parent / "bouncing.yaml"
    parser.add_argument("out", nargs="?", type=Path, default=default, help="default: scenes/bouncing.yaml")
    arguments = parser.parse_args()
    arguments.out.write_text(bouncing(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
