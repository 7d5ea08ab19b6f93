"""Settings for all tests.

Compiled kernels go to the user's cache as in any other run, so only the first run after a change compiles.
"""

import signal

from hypothesis import settings

from tests.browser import chromium, open_page

__all__ = ["chromium", "open_page"]

# A shell starts what it runs in the background with Ctrl-C ignored, which tests send to themselves.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples in every run, and no limit on their time: the first one may compile.
# `--hypothesis-profile=explore` tries others.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("same")
