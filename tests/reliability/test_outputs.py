"""Files that cannot be written at the end of a render, or not at once: they are tried again, and nothing is lost."""

import errno
import os
import re
import shutil
import signal
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.film import load
from raytracer.film.image import Image
from raytracer.rendering.checkpoint import CheckpointWriter
from raytracer.rendering.progress import SampleBar
from raytracer.util import atomic_write
from tests.reliability.processes import BALL, Process, asides, run

_RENDER = ["render", "ball.yaml", "--spp", "8", "-q"]


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(atomic_write, "_RETRY_SECONDS", (0.01, 0.02))
    (tmp_path / "ball.yaml").write_text(BALL)
    return tmp_path


@pytest.fixture
def elsewhere(home, monkeypatch):
    """A folder for temporary files of its own."""
    (home / "elsewhere").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(home / "elsewhere"))
    return home / "elsewhere"


@pytest.fixture
def refuse(monkeypatch):
    """Refuse files of a name for want of space, so often; return the list of all attempts."""
    replace = os.replace

    def refusing(name, times):
        tried = []

        def replaced(source, target):
            if Path(target).name == name:
                tried.append(target)
                if len(tried) <= times:
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            replace(source, target)

        monkeypatch.setattr(atomic_write.os, "replace", replaced)
        return tried

    return refusing


def instead(capsys):
    """Return the last sentence, and the file that it says is there instead."""
    sentence = capsys.readouterr().err.splitlines()[-1]
    return sentence, Path(sentence.partition("; instead, there is ")[2])


def test_outputs_are_written_side_by_side(home, monkeypatch):
    """Neither of the two is written before the other one is begun."""
    both, save = threading.Barrier(2), Image.save

    def saved(image, path):
        both.wait(60)
        save(image, path)

    monkeypatch.setattr(Image, "save", saved)
    assert main([*_RENDER, "-o", "a.npy", "-o", "b.npy"]) == 0
    assert (home / "a.npy").read_bytes() == (home / "b.npy").read_bytes()


def test_what_cannot_be_written_is_tried_again(home, refuse, capsys):
    tried = refuse("b.npy", 2)
    assert main([*_RENDER, "-o", "a.npy", "-o", "b.npy", "-o", "c.npy"]) == 0
    assert len(tried) == 3
    # It is said once.
    assert capsys.readouterr().err == (
        "rt: warning: b.npy: cannot be written: No space left on device; it is tried again for 0.03 s\n"
    )
    assert np.array_equal(np.load("a.npy"), np.load("b.npy"))
    assert np.array_equal(np.load("a.npy"), np.load("c.npy"))


def test_what_stays_impossible_keeps_no_other_from_being_written(home, refuse, capsys):
    Path("b.npy").write_bytes(b"what was there before")
    refuse("b.npy", 100)
    words = [*_RENDER, "-o", "a.npy", "-o", "b.npy", "--stats", "stats.json", "--checkpoint", "1min"]
    assert main(words) == 1
    *warnings, sentence = capsys.readouterr().err.splitlines()
    assert len(warnings) == 1
    again = " ".join(["rt", *words, "--resume"])
    assert sentence == (
        "rt: b.npy: cannot be written: No space left on device; a.npy.checkpoint has the samples, "
        f"and this writes the rest: {again}"
    )
    assert Path("b.npy").read_bytes() == b"what was there before"
    assert Path("stats.json").exists()
    assert not asides(home)


def test_the_picture_comes_from_the_checkpoint_alone(home, refuse, monkeypatch):
    words = [*_RENDER, "-o", "a.npy", "--checkpoint", "1min"]
    with monkeypatch.context() as patch:
        patch.setattr(atomic_write, "_RETRY_SECONDS", ())
        tried = refuse("a.npy", 1)
        assert main(words) == 1
        assert len(tried) == 1
    assert not Path("a.npy").exists()
    assert main([*words, "--resume", "--stats", "stats.json"]) == 0
    assert main([*_RENDER, "-o", "b.npy"]) == 0
    assert np.array_equal(np.load("a.npy"), np.load("b.npy"))
    # Nothing was rendered for it.
    stats = Path("stats.json").read_text()
    assert re.search(r'"resumed": \{[^}]*"samples": 24576', stats)


def test_without_a_checkpoint_the_picture_goes_elsewhere(refuse, elsewhere, capsys):
    refuse("a.npy", 3)
    assert main([*_RENDER, "-o", "a.npy"]) == 1
    _, found = instead(capsys)
    assert found.parent.parent == elsewhere
    assert np.isfinite(load(found)).all()


@pytest.mark.parametrize("is_gone", [True, False])
def test_what_a_checkpoint_lacks_goes_elsewhere(refuse, elsewhere, monkeypatch, capsys, is_gone):
    # The last one could not be written, or has gone with its folder.
    finish = CheckpointWriter.finish

    def finished(writer, render):
        finish(writer, render)
        if is_gone:
            writer.info.path.unlink()
        else:
            writer.info = writer.info._replace(samples=writer.info.samples - 8)

    monkeypatch.setattr(CheckpointWriter, "finish", finished)
    refuse("a.npy", 3)
    assert main(["render", "ball.yaml", "--spp", "20", "-q", "-o", "a.npy", "--checkpoint", "1min"]) == 1
    sentence, found = instead(capsys)
    assert ("a.npy.checkpoint has 8 samples per pixel, and this writes the rest: " in sentence) == (not is_gone)
    assert ("--resume" in sentence) == (not is_gone)
    assert np.isfinite(load(found)).all()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_what_a_device_does_not_take_goes_elsewhere(elsewhere, capsys):
    assert main([*_RENDER, "-o", "/dev/full"]) == 1
    _, found = instead(capsys)
    assert found.name == "full.png"
    assert load(found).any()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows removes no folder that is looked into")
def test_a_folder_that_is_removed_is_made_again(home, monkeypatch):
    Path("out").mkdir()
    show, removed = SampleBar.show, []

    def remove(bar, progress):
        shutil.rmtree("out", ignore_errors=True)
        removed.append(progress)
        show(bar, progress)  # type: ignore[arg-type]

    monkeypatch.setattr(SampleBar, "show", remove)
    assert main(["render", "ball.yaml", "--spp", "2000", "-q", "-o", "out/a.npy"]) == 0
    assert removed
    assert np.isfinite(load("out/a.npy")).all()


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="nothing is read-only to the administrator")
def test_a_read_only_folder_is_told_before_the_work(home, capsys):
    Path("out").mkdir(mode=0o500)
    assert main([*_RENDER, "-o", "out/a.npy"]) == 2
    assert "no permission to write in the folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--resume", "--checkpoint", "off"], "--resume goes on from a checkpoint, and with --checkpoint off there is"),
        (["--checkpoint", "soon"], "--checkpoint soon: must be a time"),
        (["--checkpoint", "0s"], "--checkpoint 0s: must be a time greater than 0"),
        (["--resume", "--debug", "--pixel", "1,1"], "--resume is for pictures, and --debug makes none"),
        (["--checkpoint", "9s", "--debug", "--pixel", "1,1"], "--checkpoint is for pictures, and --debug makes none"),
    ],
)
def test_options_that_make_no_sense_are_refused(home, words, sentence, capsys):
    assert main([*_RENDER, "-o", "a.npy", *words]) == 2
    assert capsys.readouterr().err.startswith(f"rt: {sentence}")
    assert sorted(path.name for path in home.iterdir()) == ["ball.yaml"]


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="needs a device")
def test_a_checkpoint_lies_beside_the_first_file(home, capsys):
    for word in (["--resume"], ["--checkpoint", "9s"]):
        assert main([*_RENDER, "-o", "/dev/null", *word]) == 2
        assert capsys.readouterr().err.startswith("rt: a checkpoint lies beside the picture, and /dev/null is no file")
    assert main([*_RENDER, "-o", "/dev/null"]) == 0
    assert main([*_RENDER, "-o", "/dev/null", "-o", "a.npy", "-o", "b.npy", "--checkpoint", "9s"]) == 0
    assert sorted(path.name for path in home.iterdir()) == ["a.npy", "a.npy.checkpoint", "b.npy", "ball.yaml"]


def test_the_summary_says_what_is_kept(home, capsys):
    words = ["render", "ball.yaml", "-o", "a.npy", "--checkpoint", "9s"]
    assert main([*words, "--spp", "16"]) == 0
    assert re.search(
        r"\na\.npy\.checkpoint: all samples \([\d.]+ MB\), to which --resume --spp N adds\n$", capsys.readouterr().err
    )
    assert main([*words, "--spp", "64", "--resume"]) == 0
    assert "64 spp, 16 of them before, in " in capsys.readouterr().err
    # Who forgets to resume is told that it is possible.
    assert main([*words, "--spp", "64"]) == 0
    assert capsys.readouterr().err.startswith("rt: a.npy.checkpoint has the samples of an earlier render, from which ")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_log_on_a_full_disk_ends_no_render(home):
    with open("/dev/full", "w") as full:
        assert run(["render", "ball.yaml", "-o", "a.npy", "--spp", "8"], home, stderr=full).status == 0
        assert np.isfinite(load("a.npy")).all()
        # The exit status is all that is left to say.
        assert run(["render", "missing.yaml"], home, stderr=full).status == 2


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits no files")
def test_a_limit_for_the_size_of_files_is_told_and_leaves_none_half_written(home):
    import resource

    def limit():
        # A .png of the ball takes 1 kB, an .npy file 74 kB, a checkpoint more.
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    words = [*_RENDER, "-o", "a.png", "-o", "a.npy", "--checkpoint", "0.1s"]
    process = Process(words, home, preexec_fn=limit)
    assert process.until((home / "a.png").exists)
    # Ctrl-C ends the trying; what came of it is told all the same.
    process.send(signal.SIGINT)
    ended = process.end()
    assert ended.status == 1
    assert ended.sentences == ["rt: a.npy: cannot be written: File too large"]
    assert np.isfinite(load("a.png")).all()
    assert not asides(home)
    assert sorted(path.name for path in home.iterdir()) == ["a.png", "ball.yaml"]
