"""Prescriptions of Zemax, in UTF-8 and UTF-16."""

from collections.abc import Iterator
from pathlib import Path

from raytracer.scene.assets import read_lens
from tests.fuzz.targets.lens import check

DICTIONARY = tuple(
    word.encode()
    for word in (
        *("SURF 1\n", "  TYPE EVENASPH\n", "  TYPE STANDARD\n", "  CURV ", "  CONI ", "  PARM 2 ", "  DISZ INFINITY\n"),
        *("  GLAS N-BK7\n", "  GLAS ___BLANK 1 0 1.5 60\n", "  DIAM ", "  CLAP 0 5 0\n", "  STOP\n", "UNIT IN\n"),
        *("FNUM 4 0\n", "ENPD 10\n", "FTYP 0 0\n", "YFLN 0 10 20\n", "MODE SEQ\n", "1e308", "-INF", "NAN"),
    )
)

_FILE = """\
VERS 140124 258 36214
MODE SEQ
NAME singlet
UNIT MM X W X CM MR CPMM
ENPD 2.0E+1
FNUM 5.0 0
FTYP 0 0 3 1 0 0 0
YFLN 0 7 10
SURF 0
  TYPE STANDARD
  CURV 0.0
  DISZ INFINITY
SURF 1
  TYPE EVENASPH
  CURV 0.02 0 0 0 0 ""
  CONI -0.5
  PARM 2 1e-7
  DISZ 5.0
  GLAS N-BK7 0 0 1.5168 64.17
  DIAM 12 1 0 0 1 ""
SURF 2
  STOP
  TYPE STANDARD
  CURV -0.02
  DISZ 2.0
  DIAM 12
SURF 3
  TYPE STANDARD
  GLAS ___BLANK 1 0 1.62 36.4
  DISZ 3
  DIAM 10
SURF 4
  TYPE STANDARD
  DISZ 90
  CLAP 0 10 0
SURF 5
  TYPE STANDARD
  DISZ 0
"""


def seeds() -> Iterator[bytes]:
    yield _FILE.encode()
    yield _FILE.encode("utf-16")
    yield _FILE.encode("utf-16-be")
    yield _FILE.replace("singlet", "Zwölf").encode("latin-1")


def run(data: bytes, folder: Path) -> None:
    path = folder / "lens.zmx"
    path.write_bytes(data)
    check(read_lens(path))
