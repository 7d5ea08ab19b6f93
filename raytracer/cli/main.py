"""The command `rt`, before anything is imported that takes a while."""

import os
import signal

# Settings of libraries, unless the user has set them: NumPy starts a thread for each processor, which takes 50 ms and
# serves matrices of three rows, and pydantic looks for plugins in all packages that are installed, 20 ms.
_SETTINGS = {"OPENBLAS_NUM_THREADS": "1", "PYDANTIC_DISABLE_PLUGINS": "__all__"}


def main() -> int:
    """Run `rt` with the arguments of the process; its exit status, as `cli.base.app.main` gives it."""
    # There is nothing to keep yet, and nothing to say: until it is watched for, Ctrl-C just ends the process.
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    for name, value in _SETTINGS.items():
        os.environ.setdefault(name, value)
    from raytracer.cli.base.app import main as run

    return run()
