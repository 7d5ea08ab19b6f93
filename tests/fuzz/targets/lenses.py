"""Lens files: of ours, YAML texts, and lenses put together from the schema; tables of pbrt; prescriptions of Zemax."""

import contextlib
import math
import random

import numpy as np
from pydantic import ValidationError

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.prescription import LensSpec
from raytracer.scene.assets import read_lens
from raytracer.scene.json_schema import lens_schema
from raytracer.schema.validation_errors import first_error
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import InputError
from tests.fuzz.harness import target
from tests.fuzz.targets._grammar import Choices, Grammar, written
from tests.repository import SCENES


def check(lens):
    """Raise where a lens holds what is no finite number, or says what cannot be of one."""
    for element in lens.elements:
        numbers = (element.curvature, element.thickness, element.radius, element.conic, *element.coefficients)
        assert all(map(math.isfinite, numbers)), element
        assert element.radius > 0.0, element
        assert np.isfinite(element.glass.ior(np.array([400.0, 587.0, 700.0]))).all(), element
    surfaces = lens.packed()
    # What has no power is a lens all the same, and whoever looks for its image is told.
    with contextlib.suppress(ValueError):
        cardinal_points(surfaces)


# ---- Ours: an input that begins with a zero byte is taken for choices of the grammar, any other for a text

_SHIPPED = ("achromat-100mm", "anamorphic-75mm", "double-gauss-50mm-coated", "hyperbolic-100mm", "phone-3.7mm")
_BASES = [(SCENES / "lenses" / f"{name}.yaml").read_text(encoding="utf-8") for name in _SHIPPED]
# Made now, and not while an input is timed.
_GRAMMAR = Grammar(lens_schema(), {"material": ("N-BK7", "F2", "air", "N-BK8")}, {})
_PLAIN = [parse(text, "base").plain() for text in _BASES]


def _chosen(data):
    """The lens that choices stand for."""
    choices = Choices(data)
    if choices.byte() % 8 == 0:
        text = written(_GRAMMAR.value(choices))
    else:
        text = written(_GRAMMAR.changed(choices.one_of(_PLAIN), choices, 1 + choices.byte() % 3))
    root = parse(text, "lens.yaml")
    try:
        return LensSpec.model_validate(None if root is None else root.plain()).lens()
    except ValidationError as error:
        raise first_error(error, root, "lens.yaml") from None


def _seeds():
    for text in _BASES:
        yield text.encode()
    chance = random.Random(1)
    for length in (20, 50, 100, 200) * 4:
        data = chance.randbytes(length)
        with contextlib.suppress(InputError):
            check(_chosen(data))
            yield b"\0" + data


_WORDS = "name:~surfaces:~type: ~radius:~thickness:~aperture:~material:~.inf~.nan"


@target("lens", seeds=_seeds, words=_WORDS)
def load_lens(data, folder):
    if data[:1] == b"\0":
        check(_chosen(data[1:]))
        return
    (folder / "lens.yaml").write_bytes(data)
    check(read_lens(folder / "lens.yaml"))


# ---- Of other programs

_TABLE = """\
# double Gauss
# from nowhere
# radius\tthickness\tindex\taperture
58.950\t7.520\t1.670\t50.4
169.660\t0.240\t1\t50.4
0\t9\t0\t34.2
-34.07\t6.5\t1.8\t40
-40.1\t61\t1\t40
"""
_TABLES = (_TABLE, _TABLE.replace("thickness", "axpos"), _TABLE.replace("\n", "\r\n"))
_DAT = [*(text.encode() for text in _TABLES), _TABLE.encode("utf-16")]

_ZEMAX = """\
VERS 140124 258 36214;MODE SEQ;NAME singlet;UNIT MM X W X CM MR CPMM;ENPD 2.0E+1;FNUM 5.0 0;FTYP 0 0 3 1 0 0 0
YFLN 0 7 10;SURF 0;  TYPE STANDARD;  CURV 0.0;  DISZ INFINITY
SURF 1;  TYPE EVENASPH;  CURV 0.02 0 0 0 0 "";  CONI -0.5;  PARM 2 1e-7;  DISZ 5.0;  GLAS N-BK7 0 0 1.5168 64.17
  DIAM 12 1 0 0 1 "";SURF 2;  STOP;  TYPE STANDARD;  CURV -0.02;  DISZ 2.0;  DIAM 12
SURF 3;  TYPE STANDARD;  GLAS ___BLANK 1 0 1.62 36.4;  DISZ 3;  DIAM 10
SURF 4;  TYPE STANDARD;  DISZ 90;  CLAP 0 10 0;SURF 5;  TYPE STANDARD;  DISZ 0
""".replace(";", "\n")
_ZMX = [_ZEMAX.encode(kind) for kind in ("utf-8", "utf-16", "utf-16-be")]
_ZMX.append(_ZEMAX.replace("singlet", "Zwölf").encode("latin-1"))
_ZMX_WORDS = (
    "SURF 1\n~  TYPE EVENASPH\n~  TYPE STANDARD\n~  CURV ~  CONI ~  PARM 2 ~  DISZ INFINITY\n~  GLAS N-BK7\n~  DIAM ~"
    "  GLAS ___BLANK 1 0 1.5 60\n~  CLAP 0 5 0\n~  STOP\n~UNIT IN\n~FNUM 4 0\n~ENPD 10\n~FTYP 0 0\n~YFLN 0 10 20\n~"
    "MODE SEQ\n~1e308~-INF~NAN"
)


@target("lens_dat", seeds=_DAT, file="lens.dat", words="# ~radius~axpos~1e308~nan~inf~-0~1_0")
@target("lens_zmx", seeds=_ZMX, file="lens.zmx", words=_ZMX_WORDS)
def load_foreign(path):
    check(read_lens(path))
