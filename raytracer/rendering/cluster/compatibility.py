"""Check that machines render the same picture: the same program and versions, and the same instruction set."""

import platform
from functools import cache
from typing import NamedTuple

import raytracer


class Fingerprint(NamedTuple):
    """The versions and the hardware that the bits of a picture depend on, besides the scene.

    Attributes
    ----------
    versions : of rt, Python and the libraries, by name.
    program : `scene.digest.program_hash`.
    processor : with its instruction set, as the compiler names it.
    """

    versions: dict[str, str]
    program: str
    processor: str


@cache
def fingerprint() -> Fingerprint:
    """Return the fingerprint of this process."""
    from raytracer.core.compiler.cache import processor
    from raytracer.scene.digest import libraries, program_hash

    versions = {"rt": raytracer.__version__, "Python": platform.python_version(), **libraries()}
    return Fingerprint(versions, program_hash(), processor())


def find_mismatch(here: Fingerprint, there: Fingerprint) -> str | None:
    """Describe why a machine cannot take part, as the end of a sentence about it; None if it can."""
    for name, own in here.versions.items():
        other = there.versions.get(name, "none")
        if other != own:
            return f"has {name} {other}, and here it is {own}; install the same versions on all machines"
    if there.program != here.program:
        return f"has other sources of rt {here.versions['rt']} than there are here; install the same, and restart it"
    return None
