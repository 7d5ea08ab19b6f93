"""`rt view`: it prints the address of its page, and ends with Ctrl-C."""

import signal
import subprocess
import sys
import urllib.request

import pytest

from tests.live.conftest import SCENE

MAIN = "from raytracer.cli.main import main; raise SystemExit(main())"


def viewed(folder, *words):
    """`rt view` of the small scene in a process of its own."""
    (folder / "scene.yaml").write_text(SCENE, encoding="utf-8")
    command = [sys.executable, "-c", MAIN, "view", "scene.yaml", "--no-open", *words]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("words", [(), ("-D", "camera.iso=0")])
def test_it_prints_its_address_and_ends_with_ctrl_c(tmp_path, words):
    with viewed(tmp_path, *words) as process:
        address = process.stdout.readline().strip()
        with urllib.request.urlopen(address) as answer:
            assert b"<title>rt view</title>" in answer.read()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30.0)
    assert out == ""
    assert err == ("rt: -D camera.iso=0: camera.iso: must be at least 0.001, got 0\n" if words else "")
    assert process.returncode == 130
    assert [path.name for path in tmp_path.iterdir()] == ["scene.yaml"]


def test_what_cannot_be_viewed_is_refused_in_a_sentence(here, refused, monkeypatch):
    assert refused("view missing.yaml --no-open") == "rt: missing.yaml: no such file\n"
    (here / "scene.yaml").write_text(SCENE, encoding="utf-8")
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    monkeypatch.delitem(sys.modules, "raytracer.live.server", raising=False)
    sentence = refused("view scene.yaml --no-open")
    assert sentence == "rt: rt view needs aiohttp: pip install 'raytracer[view]'\n"
