"""Defaults from rt.toml and from variables."""

import json
from pathlib import Path

import pytest

from raytracer.cli.base.defaults import KEYS, default_map, defaults_file, read_defaults, variable
from tests.cli.test_render_words import SCENE


@pytest.fixture
def file(here, monkeypatch):
    (here / "a.yaml").write_text(SCENE)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(here / "config"))
    (here / "config").mkdir()
    return here / "config" / "rt.toml"


def test_the_command_line_comes_before_a_variable_and_that_before_the_file(file, rt, monkeypatch):
    def spp(words=""):
        stats = json.loads(rt(f"render a.yaml -q --json {words}").out)
        return stats["spp"]["most"], stats["threads"]

    file.write_text("spp = 2\nthreads = 1\n")
    assert spp() == (2, 1)
    monkeypatch.setenv("RT_SPP", "3")
    assert spp() == (3, 1)
    assert spp("--spp 5 --threads 2") == (5, 2)
    # What is for pictures is not for tests of pictures.
    assert default_map(("check", "refs"), {"RT_SPP": "3", "RT_THREADS": "2"}) == {
        "check": {"threads": 2, "refs": {"threads": 2}}
    }
    assert default_map(("--help",), {"RT_SPP": "none"}) == {}


def test_each_value_is_shown_with_where_it_comes_from(file, rt, monkeypatch):
    monkeypatch.setenv("RT_NOISE", "2%")
    monkeypatch.setenv("RT_ALLOW_FILES", "/textures")
    assert rt("config").out.splitlines()[0] == f"{file} (not there)"
    file.write_text('max_memory = "4GB"\nnoise = 0.5\ndenoise = true\n')
    out = rt("config").out
    rows = {line.split()[0]: line.split()[1:] for line in out.splitlines()[1:]}
    assert out.splitlines()[0] == str(file)
    assert rows["noise"] == ["2%", "RT_NOISE"]
    assert rows["max-memory"] == ["4GB", str(file)]
    assert rows["denoise"] == ["true", str(file)]
    assert rows["spp"] == ["-", "not", "set;", "RT_SPP", "would"]
    assert rows["RT_ALLOW_FILES"] == ["/textures", "this", "variable"]
    told = json.loads(rt("config --json").out)
    assert told["defaults"]["noise"] == {"value": "2%", "source": "RT_NOISE"}
    assert set(told["defaults"]) == set(KEYS)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("spq = 4", "unknown key 'spq'; did you mean 'spp'?"),
        ("spp = 0", "spp: must be an integer from 1 to 2147483647, got 0"),
        ("threads = 'all'", "threads: must be an integer from 1 to 1024, got 'all'"),
        ("noise = 2", "noise: must be greater than 0 and less than 100%; did you mean 2%?"),
        ("denoise = 'perhaps'", "denoise: must be true or false, got 'perhaps'"),
        ("progress = 'dots'", "progress: must be bar, json, off, got 'dots'"),
        ("checkpoint = 'never'", "checkpoint: must be a"),
        ("[render]\nspp = 4", "unknown key 'render'"),
        ("spp = [1]", "spp: must be a single value, got a list of 1"),
        ("spp =", "is not valid TOML"),
    ],
)
def test_a_wrong_file_is_told_in_a_sentence(text, sentence, file, refused):
    file.write_text(text)
    assert refused("render a.yaml").startswith(f"rt: {file}: {sentence}")


def test_a_wrong_variable_is_told_too_and_help_needs_none(file, refused, rt, monkeypatch):
    monkeypatch.setenv("RT_TIME_LIMIT", "soon")
    assert refused("render a.yaml").startswith("rt: RT_TIME_LIMIT: ")
    assert "Usage" in rt("--help").out


def test_who_has_no_home_or_may_not_look_into_it_has_no_defaults(monkeypatch, tmp_path):
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    assert defaults_file({}) == Path("/.config/rt.toml")

    def denied(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_text", denied)
    assert read_defaults({"XDG_CONFIG_HOME": str(tmp_path)}) == {}


def test_every_key_is_an_option_of_render(rt):
    text = rt("render --help").out
    assert all(f"--{key}" in text for key in KEYS)
    values = {"denoise": "yes", "strict": "0", "noise": "1%", "progress": "off", "checkpoint": "5min"}
    values |= {"time-limit": "30s", "max-memory": "2GB", "cluster": "tcp://head:8786"}
    found = read_defaults({variable(key): values.get(key, "7") for key in KEYS})
    assert (found["denoise"].value, found["strict"].value, found["spp"].value) == (True, False, 7)
