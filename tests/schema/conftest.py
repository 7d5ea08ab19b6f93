"""What tests of kinds share."""

import sys

import pytest


@pytest.fixture
def package(tmp_path, monkeypatch):
    """An empty package `things` that can be imported."""
    folder = tmp_path / "things"
    folder.mkdir()
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    for module in [name for name in sys.modules if name.split(".")[0] == "things"]:
        del sys.modules[module]
