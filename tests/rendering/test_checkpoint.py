"""An interrupted render that is resumed from its checkpoint is bit-identical to an uninterrupted one."""

import errno
import os
import queue
import threading

import numpy as np
import pytest

import raytracer as rt
from raytracer.rendering import adaptive_sampling, checkpoint, resumable_state, tile_scheduler, worker_pool
from raytracer.rendering.checkpoint import CheckpointWriter, checkpoint_path
from raytracer.rendering.render import render
from raytracer.scene.load import load
from raytracer.util import array_snapshot
from raytracer.util.array_snapshot import previous_path
from raytracer.util.errors import InputError, OutputError
from tests.kernel.aovs.test_aovs import RECORDED
from tests.rendering.halves import HALVES, HEIGHT, WIDTH, assert_same, halves
from tests.repository import REFERENCES
from tests.small_scenes import scene_text

# By a lens with a rim, and by Sobol's numbers, as most scenes of the tests of AOVs.
_LENS = "thin_lens, focus_distance: 4, aperture: 20, vignetting: {diameter: 30, distance: 30}"
LAYERED = HALVES.replace("type: pinhole", f"type: {_LENS}")


@pytest.fixture
def path(tmp_path, monkeypatch):
    """Return the path of a checkpoint, and report progress a hundred times as often as usual."""
    monkeypatch.setattr(worker_pool, "_POLL_SECONDS", 1e-3)
    return checkpoint_path(tmp_path / "room.png")


def begin(path, spp, spec=None, **keys):
    """Render with a checkpoint at the end."""
    return render(spec or halves(), spp=spp, checkpoint_writer=CheckpointWriter(path, always=True), **keys)


def resume(path, spec=None, say=print, always=False, **keys):
    writer = CheckpointWriter(path, resume=True, say=say, always=always)
    return render(spec or halves(), checkpoint_writer=writer, **keys)


def until(samples):
    """Interrupt a render after so many samples more than it was resumed from."""

    def tick(progress):
        if progress.done - progress.resumed >= samples:
            raise KeyboardInterrupt

    return tick


def in_parts(path, spec, parts, whole, **keys):
    """Render a scene in about so many runs, each with other threads, from checkpoint to checkpoint."""
    step = max(1, whole.stats.samples // parts)
    for go in range(10 * parts):
        writer = CheckpointWriter(path, every=0.02, resume=go > 0, always=True)
        result = render(spec, threads=(2, 1, 5)[go % 3], checkpoint_writer=writer, progress=until(step), **keys)
        if not result.interrupted:
            assert go > 1
            return result
        assert not result.complete
    raise AssertionError("never done")


@pytest.mark.parametrize(
    ("sampler", "keys"),
    [
        ("independent", {"spp": 603, "crop": (5, 3, 40, 30)}),
        ("sobol", {"spp": 350}),
        ("stratified", {"spp": 350}),
        ("independent", {"noise": 0.03}),
        ("independent", {"noise": 0.015, "spp": 600}),
        ("sobol", {"spp": 100, "aovs": RECORDED}),
    ],
    ids=["part of a packet", "sobol", "stratified", "noise", "noise, and at most", "AOVs"],
)
def test_interrupted_and_resumed_it_is_the_same_picture(path, sampler, keys):
    spec = halves(LAYERED if "aovs" in keys else HALVES, sampler=sampler)
    whole = render(spec, **keys)
    result = in_parts(path, spec, 8, whole, **keys)
    assert_same(result, whole)
    assert result.stats.resumed["samples"] > 0


@pytest.mark.parametrize(
    ("first", "then", "aovs"), [(64, 128, ()), (100, 101, ()), (36, 133, ()), (128, 128, ()), (16, 40, RECORDED)]
)
def test_more_samples_are_those_that_are_missing(path, first, then, aovs):
    spec = halves(LAYERED, sampler="sobol") if aovs else halves()
    begin(path, first, spec, aovs=aovs)
    more = resume(path, spec, say=pytest.fail, spp=then, aovs=aovs)
    assert_same(more, render(spec, spp=then, aovs=aovs))
    # Whole packets of the first are not taken again.
    kept = first - first % 8
    assert more.stats.resumed["samples"] == WIDTH * HEIGHT * kept
    assert more.stats.resumed["rays"] == render(spec, spp=kept, aovs=aovs).stats.rays


def test_seconds_of_all_runs_add_up(path):
    first = begin(path, 512).stats
    # The second run takes a sixtieth of the first, and comes on top of it.
    second, third = (resume(path, spp=spp, always=True).stats.resumed["seconds"] for spp in (520, 528))
    assert not first.resumed.get("seconds")
    assert 0.0 < second < third


def test_what_is_not_there_is_told_and_begun_anew(path):
    # Of less than a packet nothing is kept.
    begin(path, 4)
    sentences = []
    assert_same(resume(path, say=sentences.append, spp=30), render(halves(), spp=30))
    assert sentences == [f"there is no {path} to go on from: the render begins anew"]


def write_scene(folder, comment=""):
    """Write a scene that names a file, and the file."""
    (folder / "solid.obj").write_text((REFERENCES / "octahedron.obj").read_text() + comment)
    mesh = "  - {type: mesh, name: solid, file: solid.obj, transform: [{scale: 0.4}], material: {type: lambertian}}\n"
    text = scene_text(HALVES + mesh, lit=True, width=20, height=17, spp=16, max_depth=3)
    (folder / "scene.yaml").write_text(text)


@pytest.fixture
def kept(path, tmp_path, monkeypatch):
    """Write a checkpoint of a small scene that names a file; what comes then is refused before it is compiled."""
    write_scene(tmp_path)
    begin(path, 16, load(tmp_path / "scene.yaml"))
    monkeypatch.setattr("raytracer.rendering.render.compile_kernel", lambda *given: 0)
    return path


@pytest.mark.parametrize(
    ("overrides", "keys", "said"),
    [
        ({"camera.vfov": 41}, {}, "of another scene: camera.vfov was 40 and is 41"),
        ({"objects.ball.radius": 2}, {}, "of another scene: objects[5].radius was 0.3 and is 2"),
        ({"film.filter": "gaussian"}, {}, "of another scene: film.filter was not given"),
        ({}, {"seed": 5}, "of another scene: render.seed was not given and is 5"),
        ({"render.sampler": "sobol"}, {}, "of another scene: render.sampler was 'independent' and is 'sobol'"),
        ({}, {"crop": (0, 0, 16, 16)}, "of other settings: pixels[2] was 20 and is 16"),
        ({}, {"aovs": ("depth",)}, "of other settings: aovs.depth was not given and is true"),
        ({}, {"noise": 0.5}, "of other settings: adaptive was false and is true"),
        ({}, {"spp": 8}, "has up to 16 samples per pixel already, more than the 8 wanted"),
    ],
    ids=str,
)
def test_another_picture_is_refused_by_name(kept, tmp_path, overrides, keys, said):
    before = kept.read_bytes()
    with pytest.raises(InputError) as caught:
        resume(kept, load(tmp_path / "scene.yaml", overrides), **keys)
    assert str(caught.value).startswith(f"{kept}: ")
    assert said in str(caught.value)
    assert kept.read_bytes() == before


def test_a_stratified_picture_cannot_be_continued(path):
    begin(path, 16, halves(sampler="stratified"))
    with pytest.raises(InputError, match=r"of other settings: stratified sampler\.spp was 16 and is 32"):
        resume(path, halves(sampler="stratified"), spp=32)


def test_another_program_is_refused_by_name(kept, tmp_path, monkeypatch):
    def refused():
        with pytest.raises(InputError) as caught:
            resume(kept, load(tmp_path / "scene.yaml"))
        return str(caught.value).removeprefix(f"{kept}: ")

    anew = "; without --resume the render begins anew"
    monkeypatch.setattr(resumable_state, "program_hash", lambda: "0" * 64)
    assert refused().startswith("is of another state of rt's sources: was '")
    monkeypatch.setattr(resumable_state, "processor", lambda: "wood abacus +beads")
    assert refused().endswith(f" and is 'wood'{anew}")
    monkeypatch.setattr(resumable_state, "libraries", lambda: {"numba": "99.0"})
    assert " and is '99.0'" in refused() or "is not given" in refused()
    monkeypatch.setattr(resumable_state, "__version__", "9.9.9")
    assert refused() == f"is of another version of rt: was '{rt.__version__}' and is '9.9.9'{anew}"


def test_a_changed_file_is_refused_by_name(kept, tmp_path):
    write_scene(tmp_path, "# changed\n")
    with pytest.raises(InputError, match=r"of other files: objects\[6\]\.file was '.*' and is '.*'"):
        resume(kept, load(tmp_path / "scene.yaml"))


def test_a_file_that_changes_meanwhile_is_not_taken_for_what_it_was(path, tmp_path):
    # The samples are of what the file held when it was read, and its hash would be of what it holds now.
    write_scene(tmp_path)

    def change(progress):
        # Before the first sample there is nothing to keep, and nothing is said.
        if progress.done > 0:
            write_scene(tmp_path, "# changed\n")
            raise KeyboardInterrupt

    sentences = []
    writer = CheckpointWriter(path, say=sentences.append)
    render(load(tmp_path / "scene.yaml"), spp=100_000, checkpoint_writer=writer, progress=change)
    assert writer.info is None
    assert not path.exists()
    (sentence,) = sentences
    assert sentence.startswith(f"{tmp_path / 'solid.obj'}: has changed since it was read; the render goes on in memory")


def test_the_first_samples_are_kept_before_all_pixels_have_some(path):
    # Large enough for its first samples to take a hundred times as long as the time between two reports.
    spec = halves(width=6 * WIDTH, height=6 * HEIGHT)
    first = render(spec, spp=16, threads=1, checkpoint_writer=CheckpointWriter(path), progress=until(1))
    assert (first.stats.spp["fewest"], first.stats.spp["most"]) == (0, 8)
    more = resume(path, spec, spp=16)
    assert_same(more, render(spec, spp=16))
    assert more.stats.resumed["samples"] == first.stats.samples


def test_a_damaged_checkpoint_gives_way_to_the_one_before(path, monkeypatch):
    begin(path, 16)
    os.replace(path, previous_path(path))
    begin(path, 32)
    assert not previous_path(path).exists()
    begin(previous_path(path), 16)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    kept, sentences, written = [], [], array_snapshot.write

    def noted(*args, keep):
        kept.append(keep)
        return written(*args, keep=keep)

    monkeypatch.setattr(array_snapshot, "write", noted)
    result = resume(path, say=sentences.append, spp=48)
    assert result.stats.resumed["samples"] == WIDTH * HEIGHT * 16
    assert_same(result, render(halves(), spp=48))
    (sentence,) = sentences
    assert sentence.startswith(f"{path}: is damaged: ")
    assert sentence.endswith(f"; {previous_path(path).name} is used in its place")

    # What is damaged never takes the place of what is not; and what is written now is whole, and alone.
    assert kept == [False]
    assert not previous_path(path).exists()
    assert resume(path, spp=48).stats.resumed["samples"] == WIDTH * HEIGHT * 48
    path.write_bytes(path.read_bytes()[:-1])
    previous_path(path).write_bytes(b"")
    with pytest.raises(InputError, match=r"room\.png\.checkpoint: is damaged: .*; there is no other to go on from"):
        resume(path, spp=64)


def test_a_disk_that_is_full_is_told_of_once_and_tried_again(path, monkeypatch):
    written, sentences, tries = array_snapshot.write, [], []

    def failing(*args, **keys):
        tries.append(args)
        if len(tries) < 4:
            raise OutputError(f"{path}: cannot be written: {os.strerror(errno.ENOSPC)}")
        return written(*args, **keys)

    monkeypatch.setattr(array_snapshot, "write", failing)
    writer = CheckpointWriter(path, every=0.01, always=True, say=sentences.append)

    def tick(progress):
        if writer.info is not None:
            raise KeyboardInterrupt

    assert render(halves(), spp=100_000, checkpoint_writer=writer, progress=tick).interrupted
    first, second = sentences
    assert first.startswith(f"{path}: cannot be written: No space left on device; the render goes on in memory, and ")
    assert second == f"{path}: is written again"
    assert (writer.info.path, writer.info.bytes) == (path, path.stat().st_size)


def test_checkpoints_take_half_of_the_time_at_most(path, monkeypatch):
    # However often they are asked for, and however slow the disk is, the render goes on.
    clock, waits = [0.0], []

    class Requests:
        def get(self, timeout):
            waits.append(timeout)
            if len(waits) > 3:
                return "end"
            clock[0] += timeout
            raise queue.Empty

    def write(*args, **keys):
        clock[0] += 5.0

    writer = CheckpointWriter(path, every=1e-9)
    monkeypatch.setattr(checkpoint, "now", lambda: clock[0])
    monkeypatch.setattr(writer, "_write", write)
    monkeypatch.setattr(writer, "_requests", Requests())
    writer._watch(None, [])
    assert waits == pytest.approx([1e-9, 5.0, 5.0, 5.0])


def test_short_renders_leave_nothing(path):
    writer = CheckpointWriter(path)
    render(halves(), spp=8, checkpoint_writer=writer)
    assert not render(halves(), spp=10**9, time_limit=0.1, checkpoint_writer=CheckpointWriter(path)).complete
    assert writer.info is None
    assert list(path.parent.iterdir()) == []
    render(halves(), spp=8, checkpoint_writer=(writer := CheckpointWriter(path, always=True)))
    assert writer.info[1:] == (8, path.stat().st_size)
    writer.delete()
    assert list(path.parent.iterdir()) == []


def test_the_picture_so_far_can_be_had(path):
    shown, there = [], threading.Event()

    def show(image):
        shown.append(image)
        there.set()

    writer = CheckpointWriter(path, show=show)

    def tick(progress):
        if not shown and progress.done > 0:
            writer.request_preview()
            there.wait(60)
        elif shown and progress.done > 2 * shown[0].samples * WIDTH * HEIGHT:
            raise KeyboardInterrupt

    result = render(halves(), spp=100_000, checkpoint_writer=writer, progress=tick)
    assert result.interrupted
    early = shown[0]
    assert early.radiance.shape == result.image.radiance.shape
    assert 0 < early.samples < result.image.samples

    # It was that picture's, at fewer samples: the difference is the noise of these.
    deviation = np.sqrt(early.variance) + 1e-9
    assert np.median(np.abs(early.radiance - result.image.radiance) / deviation) < 2.0


@pytest.mark.parametrize("error", [OutputError("the disk is full"), MemoryError(), ValueError("of the caller")])
def test_a_picture_so_far_that_fails_costs_no_samples(path, error):
    sentences, failed = [], []

    def show(image):
        failed.append(image)
        raise error

    writer = CheckpointWriter(path, every=0.02, show=show, say=sentences.append)
    writer.request_preview()

    def tick(progress):
        if failed and writer.info is not None and progress.done > 16 * WIDTH * HEIGHT:
            raise KeyboardInterrupt

    if isinstance(error, ValueError):
        with pytest.raises(ValueError, match="of the caller"):
            render(halves(), spp=100_000, checkpoint_writer=writer, progress=tick)
    else:
        assert render(halves(), spp=100_000, checkpoint_writer=writer, progress=tick).interrupted
        assert sentences == [f"{str(error) or 'out of memory'}; the render goes on"]
    assert writer.info is not None
    assert path.exists()


def note_samples(monkeypatch, module):
    """Return a list that gets the number of samples of each call of the kernel."""
    counts, called = [], module.render_tile

    def noted(*args):
        counts.append(args[-1] - args[-2])
        return called(*args)

    monkeypatch.setattr(module, "render_tile", noted)
    return counts


def test_no_pass_takes_long(monkeypatch):
    # However slow a scene is, an interrupt and a checkpoint are at most a pass away.
    whole = render(halves(), spp=300)
    monkeypatch.setattr(tile_scheduler, "_MAX_PASS_SECONDS", 1e-3)
    counts = note_samples(monkeypatch, tile_scheduler)
    assert_same(render(halves(), spp=300), whole)
    assert 4 <= min(counts) <= max(counts) < 256


def test_no_pilot_takes_long(monkeypatch):
    # As of the picture's own samples; pilots have thousands of them where a picture has many.
    for name, value in {"_PILOT_FRACTION": 8.0, "_SMALLEST_PILOT": 256}.items():
        monkeypatch.setattr(adaptive_sampling, name, value)
    whole = render(halves(), noise=0.1)
    assert whole.stats.pilot_samples >= 256 * WIDTH * HEIGHT
    counts = note_samples(monkeypatch, adaptive_sampling)
    monkeypatch.setattr(tile_scheduler, "_MAX_PASS_SECONDS", 1e-9)
    assert_same(render(halves(), noise=0.1), whole)
    assert set(counts) == {8}


@pytest.mark.filterwarnings("ignore::raytracer.util.errors.SceneWarning")
def test_python_has_it_too(tmp_path):
    spec, file = halves(), tmp_path / "a.checkpoint"
    rt.render(spec, spp=16, checkpoint=file)
    more = rt.render(spec, spp=24, checkpoint=str(file), resume=True)
    np.testing.assert_array_equal(more.radiance, rt.render(spec, spp=24).radiance)
    with pytest.raises(InputError, match="resume needs checkpoint"):
        rt.render(spec, resume=True)
    with pytest.warns(RuntimeWarning, match="there is no .* to go on from"):
        rt.render(spec, spp=8, checkpoint=tmp_path / "other", resume=True)
