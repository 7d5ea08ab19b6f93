"""What bars tell of the time that is left."""

import io
from types import SimpleNamespace

import pytest

from raytracer.rendering.progress import Progress, SampleBar
from raytracer.rendering.tile_scheduler import pass_end
from raytracer.util import progress

# Seconds of a sample of a row of tiles: sky on top, and glass below.
_ROWS = [1.0] * 30 + [10.0] * 10
_SPP = 1024


@pytest.fixture
def clock(monkeypatch):
    """A clock for bars, moved by hand: its `now`."""
    found, textual = SimpleNamespace(now=0.0), progress.tqdm_class()

    class Clocked(textual):
        def __init__(self, **options):
            super().__init__(file=io.StringIO(), **options)
            self._time = lambda: found.now
            self.start_t = self.last_print_t = found.now

    monkeypatch.setattr(progress, "tqdm_class", lambda: Clocked)
    return found


def _passes(begin=0):
    """Yield samples and seconds of the passes of an uneven picture, row by row, as `TileQueue.render_passes` does."""
    while begin < _SPP:
        end = pass_end(begin, _SPP)
        for cost in _ROWS:
            yield end - begin, cost * (end - begin)
        begin = end


def _left(bar):
    """Seconds that a bar says are left."""
    told = bar._bar.format_dict
    rate = told["rate"] or (told["n"] - told["initial"]) / told["elapsed"]
    return float((told["total"] - told["n"]) / rate)


def test_the_end_is_told_within_a_third_after_the_first_eighth_of_an_uneven_picture(clock):
    # By the speed of the last moments it is off by more than the whole.
    whole, wanted = sum(_ROWS) * _SPP, len(_ROWS) * _SPP
    done, worst = 0, 0.0
    with SampleBar(always=True) as bar:
        bar.show(Progress(0, wanted, 0.0))
        for samples, seconds in _passes():
            done, clock.now = done + samples, clock.now + seconds
            bar.show(Progress(done, wanted, clock.now))
            if clock.now > whole / 8.0:
                worst = max(worst, abs(clock.now + _left(bar) - whole) / whole)
    assert clock.now == pytest.approx(whole)
    assert worst < 1.0 / 3.0


def test_samples_that_were_taken_up_are_no_speed(clock):
    # Half of the picture was there; a row of the other half takes as long as it did.
    wanted, before = len(_ROWS) * _SPP, len(_ROWS) * _SPP // 2
    with SampleBar(always=True) as bar:
        bar.show(Progress(before, wanted, 0.0, resumed=before))
        clock.now = 100.0
        bar.show(Progress(before + wanted // 4, wanted, 100.0, resumed=before))
        assert _left(bar) == pytest.approx(100.0)
