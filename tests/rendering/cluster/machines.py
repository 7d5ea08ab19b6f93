"""A Dask scheduler and workers as processes on this machine."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager

_SECONDS_TO_START = 60.0
_SECONDS_TO_END = 10.0


class Machines:
    """A scheduler, and workers that come and go.

    address : of the scheduler, whose port the system has chosen.
    """

    def __init__(self, folder):
        self._folder, self._processes, self._logs = folder, [], []
        self.scheduler = self._start("scheduler", "--port", "0", "--no-show")
        self.address = self._said(folder / "scheduler0.log", "Scheduler at:").split()[-1]

    def worker(self, threads=1):
        """A new one, which need not have said hello yet."""
        name = f"worker{len(self._processes)}"
        options = f"--nthreads {threads} --name {name} --memory-limit 0 --no-nanny --death-timeout 30"
        return self._start("worker", self.address, *options.split(), "--local-directory", str(self._folder / name))

    def kill(self, process):
        """Kill one of them, as a power cut would."""
        process.kill()
        process.wait(_SECONDS_TO_END)

    def close(self):
        """End all that still run; at once, since what they leave lies in the folder."""
        for process, log in zip(self._processes, self._logs, strict=True):
            if process.poll() is None:
                self.kill(process)
            log.close()

    def _start(self, kind, *options):
        log = (self._folder / f"{kind}{len(self._processes)}.log").open("wb")
        self._logs.append(log)
        command = [sys.executable, "-m", "distributed.cli.dask_" + kind, *options]
        command += ["--host", "127.0.0.1", "--no-dashboard"]
        process = subprocess.Popen(command, stdout=log, stderr=log, env=os.environ, cwd=self._folder)
        self._processes.append(process)
        return process

    def _said(self, path, beginning):
        """The first line of a log that holds these words."""
        end = time.monotonic() + _SECONDS_TO_START
        while time.monotonic() < end:
            for line in path.read_text().splitlines():
                if beginning in line:
                    return line
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
