"""The command `rt`, before anything is imported that takes a while."""

import signal


def main() -> int:
    """Run `rt` with the arguments of the process; its exit status, as `cli.base.app.main` gives it."""
    # There is nothing to keep yet, and nothing to say: until it is watched for, Ctrl-C just ends the process.
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from raytracer.cli.base.app import main as run

    return run()
