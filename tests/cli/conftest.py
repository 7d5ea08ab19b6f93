"""What tests of commands share."""

import pytest

from raytracer.rendering.progress import CompileBar


@pytest.fixture(autouse=True)
def _silent_compiler(monkeypatch):
    """Keep what a test sees from depending on what has been compiled; test_warm.py asks in its own processes."""
    monkeypatch.setattr(CompileBar, "show", lambda *_: None)
