"""Ctrl-C, SIGTERM and SIGHUP: how processes end, what they print, and what is on the disk then.

No time is asserted: `python -m tests.reliability.signalling` measures it.
"""

import os
import shlex
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.film import load
from tests.reliability.processes import BALL, FOREVER, Process, asides, run

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no such signals")

STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}

_PROMPT_SECONDS = 0.05

# A picture that takes a while to be written.
LARGE = ("-D", "film.width=800", "-D", "film.height=600")


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ball.yaml").write_text(BALL)
    return tmp_path


def rendering(home, *words, **settings):
    """Start a render without an end, and wait until it has written a checkpoint."""
    command = ["render", "ball.yaml", "-o", "out.npy", *FOREVER, "--checkpoint", "0.1s", *words]
    process = Process(command, home, **settings)
    assert process.until((home / "out.npy.checkpoint").exists), process.end()
    return process, command


def ended_by(process, number):
    process.send(number)
    ended = process.end()
    assert ended.status == STATUS[number]
    return ended


def until_replaced(process, path):
    """Wait until another file has taken the place of one."""
    before = path.stat().st_ino

    def is_replaced():
        try:
            return path.stat().st_ino != before
        except FileNotFoundError:
            return False

    assert process.until(is_replaced), process.end()


def test_a_render_writes_what_is_there_and_says_how_to_go_on(home):
    process, command = rendering(home, "-q")
    err = ended_by(process, signal.SIGINT).err
    again = shlex.join(["rt", *command, "--resume"])
    assert err.startswith("rt: interrupted; out.npy has ")
    assert err.endswith(f" of {FOREVER[1]} samples per pixel; this goes on: {again}\n")
    assert err.count("\n") == 1
    assert np.isfinite(load(home / "out.npy")).all()
    assert not asides(home)

    # It goes on by that command, and the picture's samples become more.
    def samples(err):
        return int(err.split(" has ")[1].split()[0])

    process, kept = Process(shlex.split(again)[1:], home), home / "out.npy.checkpoint"
    is_more = False
    while not is_more:
        until_replaced(process, kept)
        # The first one may be of the samples that there were.
        with np.load(kept) as checkpoint:
            is_more = checkpoint["film/2"].min() > samples(err)
    assert samples(ended_by(process, signal.SIGTERM).err) > samples(err)


def test_a_second_signal_ends_it_at_once_without_a_broken_file(home, capsys):
    (home / "out.exr").write_bytes(b"what was there before")
    process, _ = rendering(home, "-o", "out.exr", *LARGE)
    assert process.until(lambda: not asides(home))
    process.send(signal.SIGINT)
    # The checkpoint is written first, and then the picture.
    assert process.until(lambda: bool(asides(home)))
    while process.is_running:
        # Of two that come at once the system makes one.
        process.send(signal.SIGINT)
        time.sleep(_PROMPT_SECONDS)
    assert process.end() == (130, "", "rt: interrupted\n")
    assert not asides(home)
    assert (home / "out.exr").read_bytes() == b"what was there before"
    # What was kept before is there still, and is gone on from.
    assert main(["render", "ball.yaml", "-o", "out.npy", "--spp", "8", *LARGE, "--resume"]) == 0
    err = capsys.readouterr().err
    assert "samples" in err
    assert "begins anew" not in err


def test_a_signal_that_comes_while_another_ends_it_holds_nobody_up():
    """Python calls a handler within another one, by the same thread."""
    text = """
import os, pathlib, signal, time
from raytracer.util import signals

def removing(path):
    signals._remove = removed
    os.kill(os.getpid(), signal.SIGTERM)
    removed(path)

removed, signals._remove = signals._remove, removing
signals.WATCH.start()
with signals.temporary_path(pathlib.Path("none")):
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(60)
"""
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode in STATUS.values()
    assert done.stderr == "rt: interrupted\n"


def test_sighup_writes_the_picture_so_far_and_the_render_goes_on(home):
    # Shells start what they run in the background with Ctrl-C ignored: so it stays.
    process, _ = rendering(home, "-o", "out.png", preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    process.send(signal.SIGINT)
    pictures = []
    for _ in range(2):
        assert not (home / "out.png").exists()
        process.send(signal.SIGHUP)
        assert process.until((home / "out.png").exists)
        pictures.append(load(home / "out.npy"))
        (home / "out.png").unlink()
        assert process.is_running
    assert np.isfinite(pictures[0]).all()
    assert not np.array_equal(*pictures)
    ended = ended_by(process, signal.SIGTERM)
    said = [line for line in ended.err.splitlines() if "so far" in line]
    assert len(said) == 2
    assert all(line.startswith("rt: out.npy, out.png has the picture so far, of ") for line in said)
    assert all(line.endswith(" samples per pixel; the render goes on") for line in said)


def test_sighup_works_without_checkpoints_and_under_nohup(home):
    command = ["render", "ball.yaml", "-o", "out.png", *FOREVER, "--checkpoint", "off"]
    process = Process(command, home, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    while process.is_running and not (home / "out.png").exists():
        process.send(signal.SIGHUP)
        time.sleep(_PROMPT_SECONDS)
    ended = ended_by(process, signal.SIGINT)
    assert "so far" in ended.err
    assert "--resume" not in ended.err
    assert sorted(path.name for path in home.iterdir()) == ["ball.yaml", "out.png"]


def test_a_terminal_that_is_closed_ends_no_render(home):
    import fcntl
    import termios

    leader, follower = os.openpty()
    settings = {"start_new_session": True, "stderr": follower, "stdout": follower}
    settings["preexec_fn"] = lambda: fcntl.ioctl(follower, termios.TIOCSCTTY, 0)
    process, _ = rendering(home, **settings)
    os.close(follower)
    os.close(leader)
    # The system sends SIGHUP then, and refuses whatever is written there.
    assert process.until((home / "out.npy").exists)
    assert process.is_running
    process.send(signal.SIGTERM)
    assert process.popen.wait(60) == 143
    assert np.isfinite(load(home / "out.npy")).all()


@pytest.mark.parametrize("number", STATUS)
def test_before_the_first_sample_there_is_nothing_to_wait_for(home, number):
    # Not even for the compiler, which is at work here, since its cache is empty.
    cache = home / "cache"
    process = Process(["render", "ball.yaml"], home, env={**os.environ, "RAYTRACER_CACHE_DIR": str(cache)})
    assert process.until(lambda: any(cache.rglob("*.lock")))
    assert ended_by(process, number)[1:] == ("", "rt: interrupted\n")
    # Nothing of what was compiled is there, be it half or whole.
    assert not [path for path in cache.rglob("*") if path.suffix in (".nbc", ".tmp")]
    assert not (home / "outputs").exists()


@pytest.mark.slow
def test_what_an_interrupt_leaves_of_the_cache_is_of_use(home):
    settings = {"env": {**os.environ, "RAYTRACER_CACHE_DIR": str(home / "cache")}}
    for _ in range(3):
        for left in (home / "cache").rglob("*.lock"):
            left.unlink()
        process = Process(["render", "ball.yaml"], home, **settings)
        process.until(lambda: any((home / "cache").rglob("*.lock")))
        ended_by(process, signal.SIGINT)
    assert run(["render", "ball.yaml"], home, **settings).status == 0


def test_a_sweep_keeps_what_is_done_and_goes_on_by_the_same_command(home):
    command = ["sweep", "ball.yaml", "-D", "camera.vfov=20:60:5", "-o", "out", "--spp", "600", "-q"]
    process = Process(command, home)
    records = home / "out" / "points"
    assert process.until(lambda: records.is_dir() and any(records.glob("*.json")))
    err = ended_by(process, signal.SIGTERM).err
    assert err.startswith("rt: interrupted; ")
    assert err.endswith(" of 5 points done; the same command goes on\n")
    done = int(err.split("; ")[1].split()[0])
    assert 1 <= done < 5
    assert not asides(home / "out")
    assert len(list(records.glob("*.json"))) == done
    assert main(command) == 0
    assert len(list(records.glob("*.json"))) == 5


def test_a_light_field_keeps_what_is_done_and_goes_on(home):
    array = "{type: camera_array, rows: 2, columns: 2, spacing: 10 cm, look_from: [0, 0, 4], look_at: [0, 0, 0]}"
    words = [f"camera={array}", "camera.vfov=40", "camera.focus_distance=4"]
    command = ["lightfield", "render", "ball.yaml", *(word for text in words for word in ("-D", text))]
    command += ["-o", "out.lf", "--memory", "1.5MB", *FOREVER, "--checkpoint", "0.1s", "-q"]
    kept = home / "out.lf.1.checkpoint"
    process = Process(command, home)
    assert process.until(kept.exists), process.end()
    again = shlex.join(["rt", *command, "--resume"])
    said = f"rt: interrupted; out.lf is not written; this goes on: {again}\n"
    assert ended_by(process, signal.SIGTERM).err == said
    assert not (home / "out.lf").exists()
    assert not asides(home)
    process = Process(shlex.split(again)[1:], home)
    until_replaced(process, kept)
    assert ended_by(process, signal.SIGINT).err.endswith(f"{again}\n")


@pytest.mark.parametrize(
    "words",
    ["cost --budget 10min", "probe --at 0,0,4 --toward 0,0,0 --spp 1000000000", "reference --spp 100000000"],
    ids=lambda words: words.split()[0],
)
def test_other_commands_say_one_word(home, words):
    process = Process([*words.split(), "ball.yaml", "-q"], home)
    # As soon as it reads the kernel, or later: nothing that it does then may turn it into something else.
    process.until(lambda: process.busy_seconds > 0.4)
    ended = ended_by(process, signal.SIGINT)
    assert ended.sentences[-1] == "rt: interrupted"
    assert "Traceback" not in ended.err
    assert sorted(path.name for path in home.iterdir()) == ["ball.yaml"]
