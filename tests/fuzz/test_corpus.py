"""What fuzzing has found stays found: each input is refused, or loads, and none hangs."""

import faulthandler

import pytest

from raytracer.util.errors import InputError, OutputError
from tests.fuzz.harness import CORPUS, execute, load_target, strict, target_names

INPUTS = sorted(CORPUS.glob("*/*"))

_REFUSED = 0.5
"""Share of a target's seeds that may be refused: files that are so late, for a reason that nobody finds by chance."""

_HANGS = 60.0
"""Seconds after which a loader hangs even on a machine that is busy, and has all modules to import first."""

LARGEST = 4096
"""Bytes of an input that is kept, if a file of its kind can be so small."""


@pytest.fixture(autouse=True)
def limited(tmp_path, monkeypatch):
    """End the process with its stack if a loader hangs: one that is in native code cannot be ended otherwise."""
    monkeypatch.chdir(tmp_path)
    faulthandler.dump_traceback_later(_HANGS, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_what_was_found_is_refused_or_loads(path, tmp_path):
    target = load_target(path.parent.name)
    data = path.read_bytes()
    assert len(data) <= max(LARGEST, target.max_length)
    with strict():
        execute(target, data, tmp_path)


@pytest.mark.parametrize("name", target_names())
def test_seeds_are_files_that_load(name, tmp_path):
    target = load_target(name)
    seeds = list(target.seeds())
    assert seeds
    refused = 0
    for number, seed in enumerate(seeds):
        folder = tmp_path / str(number)
        folder.mkdir()
        try:
            with strict():
                target.run(seed, folder)
        except (InputError, OutputError):
            refused += 1
    assert refused <= _REFUSED * len(seeds)


def test_every_folder_of_the_corpus_is_of_a_target():
    assert {path.parent.name for path in INPUTS} <= set(target_names())
