"""An input that never ends, which the runner's own test has to find; not fuzzed otherwise."""

import time
from collections.abc import Iterator
from pathlib import Path


def seeds() -> Iterator[bytes]:
    yield b"h"


def run(data: bytes, folder: Path) -> None:
    while data[:2] == b"ha":
        time.sleep(1.0)
