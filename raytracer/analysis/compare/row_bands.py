"""Parallel work on large images, by bands of rows."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")

# Rows of 4K images whose intermediate results stay in the processor's caches.
ROWS = 64


def map_row_bands(work: Callable[[int, int], T], height: int, rows: int = ROWS) -> list[T]:
    """Call `work(top, bottom)` for all bands of `rows` rows; the bands are the same for any number of threads."""
    tops = range(0, height, rows)
    if len(tops) == 1:
        return [work(0, height)]
    with ThreadPoolExecutor(min(len(tops), os.cpu_count() or 1)) as threads:
        return list(threads.map(lambda top: work(top, min(top + rows, height)), tops))
