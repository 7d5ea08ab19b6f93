"""Which machines render the same picture: the same program in the same versions, and the same instruction set."""

import platform
from functools import cache
from typing import NamedTuple

import raytracer


class Fingerprint(NamedTuple):
    """What the bits of a picture depend on but the scene.

    versions, by what they are of; program, `scene.inputs.program`; processor, and its instruction set, as the compiler
    has it.
    """

    versions: dict[str, str]
    program: str
    processor: str


@cache
def fingerprint() -> Fingerprint:
    """This process's."""
    from raytracer.jit import processor
    from raytracer.scene.inputs import libraries, program

    versions = {"rt": raytracer.__version__, "Python": platform.python_version(), **libraries()}
    return Fingerprint(versions, program(), processor())


def obstacle(here: Fingerprint, there: Fingerprint) -> str | None:
    """Why a machine cannot take part, as the end of a sentence about it; None if it can."""
    for name, own in here.versions.items():
        other = there.versions.get(name, "none")
        if other != own:
            return f"has {name} {other}, and here it is {own}; install the same versions on all machines"
    if there.program != here.program:
        return f"has other sources of rt {here.versions['rt']} than there are here; install the same, and restart it"
    return None
