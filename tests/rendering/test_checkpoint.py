"""An interrupted render that is resumed from its checkpoint is bit-identical to an uninterrupted one."""

import errno
import os
import queue
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raytracer as rt
from raytracer.film.image import Image
from raytracer.rendering import (
    adaptive_sampling,
    checkpoint,
    resumable_state,
    tile_scheduler,
    worker_pool,
)
from raytracer.rendering.checkpoint import CheckpointWriter, checkpoint_path
from raytracer.rendering.progress import Progress
from raytracer.rendering.render import render
from raytracer.rendering.session import Rendered
from raytracer.scene.load import load
from raytracer.scene.spec import SceneSpec
from raytracer.util import array_snapshot
from raytracer.util.array_snapshot import previous_path
from raytracer.util.errors import InputError, OutputError
from tests.repository import SCENES

WIDTH, HEIGHT = 44, 36


def scene(**keys: Any) -> SceneSpec:
    """The cover, small, cut by tiles into unequal ones; keys with `__` for dots."""
    overrides = {"film.width": WIDTH, "film.height": HEIGHT, "render.sampler": "independent"}
    return load(SCENES / "cover.yaml", overrides | {key.replace("__", "."): value for key, value in keys.items()})


def assert_same(a: Rendered, b: Rendered) -> None:
    """Check that pictures are bit-identical, and their settings and statistics equal."""
    np.testing.assert_array_equal(a.image.radiance, b.image.radiance)
    np.testing.assert_array_equal(a.image.variance, b.image.variance)  # type: ignore[arg-type]
    assert a.image.layers.keys() == b.image.layers.keys()
    for name, layer in a.image.layers.items():
        np.testing.assert_array_equal(layer, b.image.layers[name])
    assert a.image.settings == b.image.settings
    assert a.stats.rays == b.stats.rays
    assert a.stats.samples == b.stats.samples
    assert a.stats.pilot_samples == b.stats.pilot_samples
    assert a.stats.error == b.stats.error


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the path of a checkpoint, and report progress a hundred times as often as usual."""
    monkeypatch.setattr(worker_pool, "_POLL_SECONDS", 1e-3)
    return checkpoint_path(tmp_path / "cover.png")


def until(samples: int) -> Callable[[Progress], None]:
    """Interrupt a render after so many samples more than it was resumed from."""

    def tick(progress: Progress) -> None:
        if progress.done - progress.resumed >= samples:
            raise KeyboardInterrupt

    return tick


def in_parts(path: Path, spec: SceneSpec, parts: int, whole: Rendered, **keys: Any) -> Rendered:
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
    "keys",
    [
        pytest.param({"spp": 600}, id="independent"),
        pytest.param({"spp": 1003, "crop": (5, 3, 40, 30)}, id="part of a packet"),
        pytest.param({"spp": 700, "sampler": "sobol"}, id="sobol"),
        pytest.param({"spp": 700, "sampler": "stratified"}, id="stratified"),
        pytest.param({"noise": 0.02}, id="noise"),
        pytest.param({"noise": 0.01, "spp": 1500}, id="noise, and at most"),
        pytest.param({"spp": 150, "aovs": ("depth", "object_id", "rays", "direct")}, id="AOVs"),
    ],
)
def test_interrupted_and_resumed_it_is_the_same_picture(path: Path, keys: dict[str, Any]) -> None:
    spec = scene(render__sampler=keys.pop("sampler", "independent"))
    whole = render(spec, **keys)
    result = in_parts(path, spec, 4, whole, **keys)
    assert_same(result, whole)
    assert result.complete == whole.complete
    assert result.stats.resumed["samples"] > 0


@pytest.mark.parametrize(("first", "then"), [(64, 256), (100, 101), (100, 333), (4, 30), (1024, 1024)])
def test_more_samples_are_those_that_are_missing(path: Path, first: int, then: int) -> None:
    spec = scene()
    render(spec, spp=first, checkpoint_writer=CheckpointWriter(path, always=True))
    sentences: list[str] = []
    writer = CheckpointWriter(path, resume=True, say=sentences.append)
    more, whole = render(spec, spp=then, checkpoint_writer=writer), render(spec, spp=then)
    assert_same(more, whole)

    # Whole packets of the first are not taken again.
    assert writer.resumed == first - first % 8
    if first >= 8:
        pixels = WIDTH * HEIGHT
        assert more.stats.resumed["samples"] == pixels * writer.resumed
        assert more.stats.resumed["rays"] == render(spec, spp=writer.resumed).stats.rays
        assert sentences == []
    else:
        assert sentences == [f"there is no {path} to go on from: the render begins anew"]


def test_seconds_of_all_runs_add_up(path: Path) -> None:
    spec = scene()
    seconds = []
    for spp, resume in ((1024, False), (1032, True), (1040, True)):
        result = render(spec, spp=spp, checkpoint_writer=CheckpointWriter(path, resume=resume, always=True))
        seconds.append(result.stats.resumed.get("seconds", 0.0))
    # The second run takes a hundredth of the first, and comes on top of it.
    assert 0.0 == seconds[0] < seconds[1] < seconds[2]


def test_rays_of_a_longer_render_have_room(path: Path) -> None:
    spec = scene()
    render(spec, spp=16, aovs=("rays",), checkpoint_writer=CheckpointWriter(path, always=True))
    more = render(spec, spp=40, aovs=("rays",), checkpoint_writer=CheckpointWriter(path, resume=True))
    assert_same(more, render(spec, spp=40, aovs=("rays",)))
    assert more.stats.resumed["samples"] == WIDTH * HEIGHT * 16


def test_a_stratified_picture_cannot_be_continued(path: Path) -> None:
    spec = scene(render__sampler="stratified")
    render(spec, spp=16, checkpoint_writer=CheckpointWriter(path, always=True))
    with pytest.raises(InputError, match=r"of other settings: stratified sampler\.spp was 16 and is 32"):
        render(spec, spp=32, checkpoint_writer=CheckpointWriter(path, resume=True))


@pytest.fixture
def kept(path: Path, tmp_path: Path) -> Path:
    """Write a checkpoint of a small scene that names a file."""
    _textured(tmp_path, 200)
    render(load(tmp_path / "scene.yaml"), spp=16, checkpoint_writer=CheckpointWriter(path, always=True))
    return path


def _textured(folder: Path, brightness: int) -> None:
    import PIL.Image

    PIL.Image.new("RGB", (2, 2), (brightness,) * 3).save(folder / "wall.png")
    (folder / "scene.yaml").write_text("""
camera: {type: pinhole, look_from: [0, 0, 3], look_at: [0, 0, 0], vfov: 40}
film: {width: 20, height: 17}
render: {spp: 16, max_depth: 3, sampler: independent}
environment: {type: constant, radiance: 1}
textures: {wall: {type: image, file: wall.png}}
materials: {wall: {type: lambertian, albedo: wall}}
objects: [{type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: wall}]
""")


@pytest.mark.parametrize(
    ("overrides", "keys", "said"),
    [
        ({"camera.vfov": 41}, {}, r"of another scene: camera\.vfov was 40 and is 41"),
        ({"objects.ball.radius": 2}, {}, r"of another scene: objects\[0\]\.radius was 1 and is 2"),
        ({"film.filter": "gaussian"}, {}, r"of another scene: film\.filter was not given"),
        ({}, {"seed": 5}, r"of another scene: render\.seed was not given and is 5"),
        ({"render.sampler": "sobol"}, {}, r"of another scene: render\.sampler was 'independent' and is 'sobol'"),
        ({}, {"crop": (0, 0, 16, 16)}, r"of other settings: pixels\[2\] was 20 and is 16"),
        ({}, {"aovs": ("depth",)}, r"of other settings: aovs\.depth was not given and is true"),
        ({}, {"noise": 0.5}, r"of other settings: adaptive was false and is true"),
        ({}, {"spp": 8}, r"has up to 16 samples per pixel already, more than the 8 wanted"),
    ],
)
def test_another_picture_is_refused_by_name(
    kept: Path, tmp_path: Path, overrides: dict[str, Any], keys: dict[str, Any], said: str
) -> None:
    before = kept.read_bytes()
    with pytest.raises(InputError, match=said) as caught:
        render(load(tmp_path / "scene.yaml", overrides), checkpoint_writer=CheckpointWriter(kept, resume=True), **keys)
    assert str(caught.value).startswith(f"{kept}: ")
    assert kept.read_bytes() == before


def test_another_program_is_refused_by_name(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused() -> str:
        with pytest.raises(InputError) as caught:
            render(load(tmp_path / "scene.yaml"), checkpoint_writer=CheckpointWriter(kept, resume=True))
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


def test_a_changed_file_is_refused_by_name(kept: Path, tmp_path: Path) -> None:
    _textured(tmp_path, 201)
    with pytest.raises(InputError, match=r"of other files: textures\.wall\.file was '.*' and is '.*'"):
        render(load(tmp_path / "scene.yaml"), checkpoint_writer=CheckpointWriter(kept, resume=True))


def test_a_file_that_changes_meanwhile_is_not_taken_for_what_it_was(path: Path, tmp_path: Path) -> None:
    """The samples are of what the file held when it was read, and its hash would be of what it holds now."""
    _textured(tmp_path, 200)
    sentences: list[str] = []

    def change(progress: Progress) -> None:
        _textured(tmp_path, 90)
        raise KeyboardInterrupt

    writer = CheckpointWriter(path, say=sentences.append)
    render(load(tmp_path / "scene.yaml"), spp=100_000, checkpoint_writer=writer, progress=change)
    assert writer.info is None
    assert not path.exists()
    (sentence,) = sentences
    assert sentence.startswith(f"{tmp_path / 'wall.png'}: has changed since it was read; the render goes on in memory")


def test_the_first_samples_are_kept_before_all_pixels_have_some(path: Path) -> None:
    """Those of a slow scene take longer than the time between two checkpoints."""
    # Large enough for its first samples to take a hundred times as long as the time between two reports.
    spec = scene(film__width=6 * WIDTH, film__height=6 * HEIGHT)
    first = render(spec, spp=24, threads=1, checkpoint_writer=CheckpointWriter(path), progress=until(1))
    assert (first.stats.spp["fewest"], first.stats.spp["most"]) == (0, 8)
    more, whole = render(spec, spp=24, checkpoint_writer=CheckpointWriter(path, resume=True)), render(spec, spp=24)
    assert_same(more, whole)
    assert more.stats.resumed["samples"] == first.stats.samples


def test_what_is_out_of_time_soon_leaves_nothing(path: Path) -> None:
    result = render(scene(), spp=10**9, time_limit=0.3, checkpoint_writer=CheckpointWriter(path))
    assert not result.complete
    assert not path.exists()


def test_a_damaged_checkpoint_gives_way_to_the_one_before(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec, sentences = scene(), list[str]()
    render(spec, spp=16, checkpoint_writer=CheckpointWriter(path, always=True))
    os.replace(path, previous_path(path))
    render(spec, spp=32, checkpoint_writer=CheckpointWriter(path, always=True, every=1e9))
    assert not previous_path(path).exists()
    render(spec, spp=16, checkpoint_writer=CheckpointWriter(previous_path(path), always=True))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    kept: list[bool] = []
    written = array_snapshot.write

    def noted(*args: Any, keep: bool) -> int:
        kept.append(keep)
        return written(*args, keep=keep)

    monkeypatch.setattr(array_snapshot, "write", noted)
    writer = CheckpointWriter(path, resume=True, say=sentences.append)
    result = render(spec, spp=48, checkpoint_writer=writer)
    assert writer.resumed == 16
    assert_same(result, render(spec, spp=48))
    (sentence,) = sentences
    assert sentence.startswith(f"{path}: is damaged: ")
    assert sentence.endswith(f"; {previous_path(path).name} is used in its place")

    # What is damaged never takes the place of what is not.
    assert kept == [False]

    # What is written now is whole, and alone.
    assert CheckpointWriter(path).info is None
    assert not previous_path(path).exists()
    more = render(spec, spp=48, checkpoint_writer=CheckpointWriter(path, resume=True))
    assert more.stats.resumed["samples"] == WIDTH * HEIGHT * 48


def test_where_all_are_damaged_it_says_so(path: Path) -> None:
    render(scene(), spp=8, checkpoint_writer=CheckpointWriter(path, always=True))
    path.write_bytes(path.read_bytes()[:-1])
    previous_path(path).write_bytes(b"")
    with pytest.raises(InputError, match=r"cover\.png\.checkpoint: is damaged: .*; there is no other to go on from"):
        render(scene(), spp=8, checkpoint_writer=CheckpointWriter(path, resume=True))


def test_a_disk_that_is_full_is_told_of_once_and_tried_again(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written, sentences, tries = array_snapshot.write, list[str](), [0]

    def failing(*args: Any, **keys: Any) -> int:
        tries[0] += 1
        if tries[0] < 4:
            raise OutputError(f"{path}: cannot be written: {os.strerror(errno.ENOSPC)}")
        return written(*args, **keys)

    monkeypatch.setattr(array_snapshot, "write", failing)
    writer = CheckpointWriter(path, every=0.01, always=True, say=sentences.append)

    def tick(progress: Progress) -> None:
        if writer.info is not None:
            raise KeyboardInterrupt

    result = render(scene(), spp=100_000, checkpoint_writer=writer, progress=tick)
    assert result.interrupted
    first, second = sentences
    assert first.startswith(f"{path}: cannot be written: No space left on device; the render goes on in memory, and ")
    assert second == f"{path}: is written again"
    assert writer.info is not None
    assert writer.info.path == path
    assert writer.info.bytes == path.stat().st_size


def test_checkpoints_take_half_of_the_time_at_most(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However often they are asked for, and however slow the disk is, the render goes on."""
    clock, waits = [0.0], list[float]()

    class Requests:
        def get(self, timeout: float) -> str:
            waits.append(timeout)
            if len(waits) > 3:
                return "end"
            clock[0] += timeout
            raise queue.Empty

    def write(*args: Any, **keys: Any) -> None:
        clock[0] += 5.0

    writer = CheckpointWriter(path, every=1e-9)
    monkeypatch.setattr(checkpoint, "now", lambda: clock[0])
    monkeypatch.setattr(writer, "_write", write)
    monkeypatch.setattr(writer, "_requests", Requests())
    writer._watch(None, [])  # type: ignore[arg-type]
    assert waits == pytest.approx([1e-9, 5.0, 5.0, 5.0])


def test_short_renders_leave_nothing(path: Path) -> None:
    writer = CheckpointWriter(path)
    render(scene(), spp=8, checkpoint_writer=writer)
    assert writer.info is None
    assert list(path.parent.iterdir()) == []
    render(scene(), spp=8, checkpoint_writer=(writer := CheckpointWriter(path, always=True)))
    assert writer.info is not None
    assert writer.info[1:] == (8, path.stat().st_size)
    writer.delete()
    assert list(path.parent.iterdir()) == []


def test_the_picture_so_far_can_be_had(path: Path) -> None:
    shown: list[Image] = []
    there = threading.Event()

    def show(image: Image) -> None:
        shown.append(image)
        there.set()

    writer = CheckpointWriter(path, show=show)

    def tick(progress: Progress) -> None:
        if not shown and progress.done > 0:
            writer.request_preview()
            there.wait(60)
        elif shown and progress.done > 2 * shown[0].samples * pixels:
            raise KeyboardInterrupt

    spec = scene()
    pixels = spec.film.width * spec.film.height
    result = render(spec, spp=100_000, checkpoint_writer=writer, progress=tick)
    assert result.interrupted
    early = shown[0]
    assert early.radiance.shape == result.image.radiance.shape
    assert 0 < early.samples < result.image.samples

    # It was that picture's, at fewer samples: the difference is the noise of these.
    assert early.variance is not None
    deviation = np.sqrt(early.variance) + 1e-9
    assert np.median(np.abs(early.radiance - result.image.radiance) / deviation) < 2.0


@pytest.mark.parametrize("error", [OutputError("the disk is full"), MemoryError(), ValueError("of the caller")])
def test_a_picture_so_far_that_fails_costs_no_samples(path: Path, error: Exception) -> None:
    sentences: list[str] = []
    failed: list[float] = []

    def show(image: Image) -> None:
        failed.append(tile_scheduler.now())
        raise error

    writer = CheckpointWriter(path, every=0.02, show=show, say=sentences.append)
    writer.request_preview()

    def tick(progress: Progress) -> None:
        if failed and writer.info is not None and progress.done > 16 * WIDTH * HEIGHT:
            raise KeyboardInterrupt

    if isinstance(error, ValueError):
        with pytest.raises(ValueError, match="of the caller"):
            render(scene(), spp=100_000, checkpoint_writer=writer, progress=tick)
    else:
        assert render(scene(), spp=100_000, checkpoint_writer=writer, progress=tick).interrupted
        assert sentences == [f"{str(error) or 'out of memory'}; the render goes on"]
    assert writer.info is not None
    assert path.exists()


def test_no_pass_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """However slow a scene is, an interrupt and a checkpoint are at most a pass away."""
    monkeypatch.setattr(tile_scheduler, "_MAX_PASS_SECONDS", 1e-3)
    ends: list[int] = []
    called = tile_scheduler.render_tile

    def noted(*args: Any) -> int:
        ends.append(args[-1] - args[-2])
        return int(called(*args))

    whole = render(scene(), spp=300)
    monkeypatch.setattr(tile_scheduler, "render_tile", noted)
    assert_same(render(scene(), spp=300), whole)
    assert max(ends) < 256
    assert min(ends) >= 4


def test_no_pilot_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of the picture's own samples; pilots have thousands of them where a picture has many."""
    for name, value in {"_PILOT_FRACTION": 8.0, "_SMALLEST_PILOT": 256}.items():
        monkeypatch.setattr(adaptive_sampling, name, value)
    whole = render(scene(), noise=0.05)
    assert whole.stats.pilot_samples >= 256 * WIDTH * HEIGHT
    ends: list[int] = []
    called = adaptive_sampling.render_tile

    def noted(*args: Any) -> int:
        ends.append(args[-1] - args[-2])
        return int(called(*args))

    monkeypatch.setattr(adaptive_sampling, "render_tile", noted)
    monkeypatch.setattr(tile_scheduler, "_MAX_PASS_SECONDS", 1e-9)
    assert_same(render(scene(), noise=0.05), whole)
    assert set(ends) == {8}


def test_python_has_it_too(tmp_path: Path) -> None:
    spec, file = scene(), tmp_path / "a.checkpoint"
    rt.render(spec, spp=16, checkpoint=file)
    more = rt.render(spec, spp=24, checkpoint=str(file), resume=True)
    np.testing.assert_array_equal(more.radiance, rt.render(spec, spp=24).radiance)
    with pytest.raises(InputError, match="resume needs checkpoint"):
        rt.render(spec, resume=True)
    with pytest.warns(RuntimeWarning, match="there is no .* to go on from"):
        rt.render(spec, spp=8, checkpoint=tmp_path / "other", resume=True)
