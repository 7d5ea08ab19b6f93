"""The state of paths: what a scene does not call for is not there, and what is stored is loaded again."""

import math

import numpy as np
import pytest

from raytracer.core.compiler.dispatch import entry
from raytracer.core.embree import PACKET
from raytracer.kernel.hero_wavelength import LENS_ROW, WAVELENGTH_ROW
from raytracer.kernel.path_state import Path, load_path, push, store_path, take_all, workspace
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from tests.repository import SCENES

MOTION, MEDIA, TRANSPARENCY, SOLIDS = {"time"}, {"medium"}, {"vertex", "passthroughs"}, {"inside_counts"}


def work_of(name):
    return workspace(pack(load(SCENES / f"{name}.yaml")).scene)


@pytest.mark.parametrize(
    ("name", "fields", "wavelengths"),
    [
        ("cover", set(), None),
        ("bouncing", MOTION, None),
        ("smoke", MEDIA | TRANSPARENCY, None),
        ("nested", TRANSPARENCY | SOLIDS, None),
        ("prism", set(), WAVELENGTH_ROW),
        ("optics/chromatic_fringes", set(), LENS_ROW),
    ],
)
def test_paths_carry_what_the_scene_calls_for(name, fields, wavelengths):
    work = work_of(name)
    assert {key for key, rows in work.paths._asdict().items() if rows is not None} == fields | {"draws", "ray"}
    assert (work.shadows.target is not None) == (fields >= TRANSPARENCY)
    assert (work.shadows.medium is not None) == (fields >= MEDIA)
    assert (work.shadows.inside_counts is not None) == (fields >= SOLIDS)
    assert (work.wavelengths is None) if wavelengths is None else work.wavelengths.dtype == wavelengths


@entry
def _store_and_load(work, path, lane, rounds):
    store_path(work, path)
    return load_path(work, lane, rounds)


@entry
def _push_all(queue, samples):
    for sample in samples:
        push(queue, sample)
    return take_all(queue)


@pytest.mark.parametrize(
    ("name", "extra"),
    [
        ("cover", (None, None, None, None)),
        ("bouncing", (0.25, None, None, None)),
        ("smoke", (None, 3, (7.0, 8.0, 9.0), 2)),
    ],
)
def test_a_stored_path_is_loaded_again(name, extra):
    work = work_of(name)
    path = Path(5, 1, (1.0, 2.0, 3.0), (0.0, 0.6, -0.8), (0.5, 0.25, 0.125), math.inf, *extra)
    loaded = _store_and_load(work, path, 0, 4)
    # The rounds of the packet are counted, but those in which the path went straight through a surface.
    assert loaded == path._replace(depth=5 - (extra[3] or 0))
    assert (int(work.queue.size[0]), int(work.queue.samples[0])) == (1, 5)


def test_a_queue_is_read_after_it_was_emptied():
    queue = workspace().queue
    samples = np.array([3, 1, 7])
    assert _push_all(queue, samples) == 3
    assert queue.size[0] == 0
    np.testing.assert_array_equal(queue.samples[:3], samples)
    assert _push_all(queue, np.arange(PACKET)) == PACKET
