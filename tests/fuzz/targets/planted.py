"""Mistakes that the runner's own test has to find; not fuzzed otherwise."""

import mmap
import time

from raytracer.util.errors import InputError
from tests.fuzz.harness import target


@target("planted", seeds=[b"b", b"d", b"m"])
def fail(data, folder):
    if data[:2] == b"bo":
        raise ValueError("planted")
    if data[:2] == b"de":
        fail(data, folder)
    if data[:2] == b"me":
        with mmap.mmap(-1, 2**31):
            pass
    raise InputError("refused")


@target("planted_hang", seeds=[b"h"])
def hang(data, folder):
    while data[:2] == b"ha":
        time.sleep(1.0)
