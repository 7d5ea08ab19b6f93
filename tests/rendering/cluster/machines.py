"""A Dask scheduler and workers as processes on this machine."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import IO

_SECONDS_TO_START = 60.0
_SECONDS_TO_END = 10.0


class Machines:
    """A scheduler, and workers that come and go.

    address : of the scheduler, whose port the system has chosen.
    """

    def __init__(self, folder):
        self._folder = folder
        self._processes: list[subprocess.Popen[bytes]] = []
        self._logs: list[IO[bytes]] = []
        self.scheduler = self._start("scheduler", "--port", "0", "--no-show")
        self.address = self._said("scheduler0.log", "Scheduler at:").split()[-1]

    def worker(self, threads=1, **variables):
        """A new one, which need not have said hello yet."""
        name = f"worker{len(self._processes)}"
        return self._start(
            "worker",
            self.address,
            *("--nthreads", str(threads), "--name", name, "--memory-limit", "0"),
            *("--no-nanny", "--local-directory", str(self._folder / name), "--death-timeout", "30"),
            **variables,
        )

    def kill(self, process):
        """Kill one of them, as a power cut would."""
        process.send_signal(signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
        process.wait(_SECONDS_TO_END)

    def close(self):
        """End all that still run; at once, since what they leave lies in the folder."""
        for process in self._processes:
            if process.poll() is None:
                self.kill(process)
        for log in self._logs:
            log.close()

    def _start(self, kind, *options, **variables):
        path = self._folder / f"{kind}{len(self._processes)}.log"
        log = path.open("wb")
        self._logs.append(log)
        command = [sys.executable, "-m", "distributed.cli.dask_" + kind, *options]
        command += ["--host", "127.0.0.1", "--no-dashboard"]
        environment = {**os.environ, **variables}
        process = subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=self._folder)
        self._processes.append(process)
        return process

    def _said(self, log, beginning):
        """The first line of a log that holds these words."""
        path, end = self._folder / log, time.monotonic() + _SECONDS_TO_START
        while time.monotonic() < end:
            lines = [line for line in path.read_text().splitlines() if beginning in line]
            if lines:
                return lines[0]
            time.sleep(0.05)
        raise TimeoutError(path.read_text())


@contextmanager
def machines(folder, workers=3):
    """A scheduler and workers, which end with the `with` block."""
    started = Machines(folder)
    try:
        for _ in range(workers):
            started.worker()
        yield started
    finally:
        started.close()
