"""Mistakes that the runner's own test has to find; not fuzzed otherwise."""

import mmap
from collections.abc import Iterator
from pathlib import Path

from raytracer.util.errors import InputError


def seeds() -> Iterator[bytes]:
    yield from (b"b", b"d", b"m")


def run(data: bytes, folder: Path) -> None:
    if data[:2] == b"bo":
        raise ValueError("planted")
    if data[:2] == b"de":
        run(data, folder)
    if data[:2] == b"me":
        with mmap.mmap(-1, 2**31):
            pass
    raise InputError("refused")
