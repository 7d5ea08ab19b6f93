"""Settings for all tests.

Compiled kernels go to the user's cache as in any other run, so only the first run after a change compiles.  They are
signed by a key of the tests' own, so that none can harm the user's.
"""

import contextlib
import gc
import os
import signal

from hypothesis import settings

from raytracer.core.compiler.signing_key import NoKeyError, key_folder
from tests.browser import chromium, open_page

__all__ = ["chromium", "open_page"]

pytest_plugins = ["tests.compilations"]

# The library for matrices, which reads this when NumPy is loaded, has a thread for each processor, and they wait for
# work by spinning: of the smallest matrices' too, and each process of a test run has them.  A quadrature rule of 400
# points took 4.8 s of processor time so, and takes 0.015 s.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

with contextlib.suppress(NoKeyError):
    os.environ.setdefault("RAYTRACER_KEY_DIR", str(key_folder().with_name("raytracer-tests")))

# What commands print is compared as it is without colours, in the processes that tests start, too.
for name in ("FORCE_COLOR", "CLICOLOR_FORCE"):
    os.environ.pop(name, None)

# Compiling makes millions of objects that stay, and by its own measure Python looks for garbage among them every 700:
# an eighth of the processor time of these tests.
gc.set_threshold(10_000, 10, 10)

# A shell starts what it runs in the background with Ctrl-C ignored, which tests send to themselves.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples in every run, and no limit on their time: the first one may compile.
# `--hypothesis-profile=explore` tries others.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("same")


def pytest_collection_finish() -> None:
    """Leave the tests and what they import out of all searches for garbage."""
    gc.collect()
    gc.freeze()
