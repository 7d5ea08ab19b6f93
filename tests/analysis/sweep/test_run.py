"""Sweeps: what is rendered, kept, and told; most of it with pictures that nobody rendered."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import raytracer as rt
from raytracer.analysis.sweep import output_layout, prepare_points, run
from raytracer.analysis.sweep.output_layout import stale_images
from raytracer.analysis.sweep.run import sweep
from raytracer.film import image_file
from raytracer.film.image import Image
from raytracer.rendering import worker_pool
from raytracer.rendering.progress import Progress
from raytracer.rendering.session import Rendered
from raytracer.rendering.statistics import Stats
from raytracer.scene.cache import RenderCache
from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from raytracer.util import atomic_write
from raytracer.util.errors import InputError, OutputError, SceneWarning, StrictError
from tests.analysis.sweep.test_plan import SCENE

VALUES = {"camera.f_number": "1.4,2,2.8", "camera.focus_distance": "2,5"}
TWO = {"camera.f_number": "1.4,2", "camera.focus_distance": 2}


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "out"


@pytest.fixture
def swept(scene, folder, bench):
    """Sweep into the folder, with pictures that nobody rendered; those of earlier calls are forgotten."""

    def swept(values=VALUES, **settings):
        bench.rendered.clear()
        return sweep(scene, values, **{"folder": folder, **settings})

    return swept


class Bench:
    """Make scenes ready whose pictures are of one colour, by their cameras' numbers, and count what is rendered.

    `before` is called with each scene that is made ready, `behave` with each camera that is rendered.
    """

    def __init__(self):
        self.rendered, self.settings = [], []
        self.before, self.behave = lambda spec, **settings: None, None

    def ready(self, spec, options, **settings):
        self.settings.append({**vars(options), **settings})
        self.before(spec, **settings)
        packed = pack(spec)
        return SimpleNamespace(packed=packed, render=lambda **keys: self.render(packed.spec.camera, **keys))

    def render(self, camera, *, progress, checkpoint_writer=None):
        progress(Progress(1, 2, 0.0))
        interrupted = False
        try:
            if self.behave is not None:
                self.behave(camera)
            self.rendered.append((camera.f_number, camera.focus_distance))
        except KeyboardInterrupt:
            interrupted = True
        stats = Stats(seconds={"render": 0.5, "total": 0.75}, rays=7, samples=48)
        stats.spp = {"fewest": 16, "mean": 16.0, "most": 16}
        stats.error = {"relative": 0.25, "low": 0.2, "high": 0.3, "exponent": 1.0}
        image = Image(np.full((6, 8, 3), camera.f_number * 0.1 + camera.focus_distance * 0.01), samples=16)
        return Rendered(image, stats, not interrupted, interrupted, 16, None)


@pytest.fixture
def bench(monkeypatch):
    made = Bench()
    monkeypatch.setattr(prepare_points, "prepare_scene", made.ready)
    monkeypatch.setattr(run, "render_prepared", lambda prepared, **keys: prepared.render(**keys))
    return made


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def pictures(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.png")}


def statuses(result):
    return [taken.status for taken in result.results]


# ---- What there is afterwards


def test_a_folder_holds_pictures_numbers_sheet_and_page(swept, folder):
    result = swept(formats=["exr", "png"], animate=["gif"])
    names = {f"f_number={n}_focus_distance={d}" for n in ("1.4", "2", "2.8") for d in (2, 5)}
    images = {f"{name}.{suffix}" for name in names for suffix in ("png", "exr")}
    others = {"manifest.csv", "manifest.json", "contact_sheet.png", "index.html", "sweep.gif", "points"}
    assert {path.name for path in folder.iterdir()} == images | others
    assert result.results[0].files == ("f_number=1.4_focus_distance=2.png", "f_number=1.4_focus_distance=2.exr")
    assert stale_images(result) == []
    assert image_file.load(folder / "f_number=2_focus_distance=5.exr") == pytest.approx(0.25)
    with pytest.raises(InputError, match="files in"):
        _ = result.images


def test_the_manifest_tells_values_and_numbers(swept, folder):
    """Of a 50 mm lens at f/2 the pupil is 25 mm wide."""
    swept(VALUES | {"camera.focus_distance": "5,inf"})
    rows = list(csv.DictReader((folder / "manifest.csv").read_text().splitlines()))
    told = json.loads((folder / "manifest.json").read_text())
    assert [row["name"] for row in rows] == [point["name"] for point in told["points"]]
    row, point = rows[3], told["points"][3]
    assert (row["camera.f_number"], row["camera.focus_distance"]) == ("2", "inf")
    assert point["values"] == {"camera.f_number": 2, "camera.focus_distance": "inf"}
    assert point["index"] == [1, 1]
    assert float(row["entrance_pupil_mm"]) == pytest.approx(25.0)
    assert point["camera"]["far_limit_m"] == row["far_limit_m"] == "inf"
    assert (row["seconds"], row["render_seconds"], row["samples"]) == ("0.75", "0.5", "16.0")
    assert (row["relative_error"], row["relative_error_low"], row["relative_error_high"]) == ("0.25", "0.2", "0.3")
    assert told["axes"][0] == {"key": "camera.f_number", "values": [1.4, 2, 2.8], "labels": ["1.4", "2", "2.8"]}
    assert (told["points"][0]["status"], told["interrupted"], told["zipped"]) == ("done", False, False)


def test_in_memory_images_are_in_the_order_of_the_axes(scene, bench):
    values = {"camera.f_number": [1.4, 2.0, 2.8], "camera.focus_distance": np.array([2.0, 5.0])}
    result = sweep(load(scene), values)
    assert result.images.shape == result.shape == (3, 2)
    assert result.images[2, 1].radiance == pytest.approx(0.28 + 0.05)
    assert (result.folder, stale_images(result)) == (None, [])
    pairs = sweep(scene, {"camera.f_number": [1.4, 2.0], "camera.focus_distance": [2.0, 5.0]}, zipped=True)
    assert pairs.images.shape == (2,)
    assert bench.rendered[6:] == [(1.4, 2.0), (2.0, 5.0)]


def test_settings_reach_every_point(swept, bench):
    given = {"seed": 7, "noise": 0.02, "time_limit": 3.0, "crop": (0, 0, 2, 2), "threads": 2, "spp": 64}
    given |= {"strict": True, "denoise": True, "cluster": object()}
    swept(**given, preview=True, aovs=["depth"], folder=None)
    assert len(bench.settings) == 6
    for settings in bench.settings:
        assert (given | {"aovs": ("depth",)}).items() <= settings.items()
    assert len({id(settings["cache"]) for settings in bench.settings}) == 1
    bench.settings.clear()
    swept(VALUES | {"film.width": 960, "film.height": 480}, preview=True, folder=None)
    assert {settings["spp"] for settings in bench.settings} == {16}


# ---- Going on


def test_run_again_it_renders_nothing_and_changes_nothing(swept, folder, bench):
    swept(animate=["webp"])
    before = contents(folder)
    assert swept(animate=["webp"]).reused == 6
    assert bench.rendered == []
    assert contents(folder) == before


def test_only_what_is_missing_is_rendered(swept, folder, bench):
    """A point is done if its input is the same and its files hold what they did."""
    swept()
    (folder / "f_number=2_focus_distance=2.png").unlink()
    (folder / "f_number=1.4_focus_distance=5.png").write_bytes(b"something else")
    (folder / "points" / "f_number=2.8_focus_distance=5.json").write_text("{")
    swept(VALUES | {"camera.focus_distance": "2,5,7"})
    assert bench.rendered == [(1.4, 5.0), (1.4, 7.0), (2.0, 2.0), (2.0, 7.0), (2.8, 5.0), (2.8, 7.0)]


@pytest.mark.parametrize(
    "change",
    [
        {"spp": 3},
        {"seed": 1},
        {"noise": 0.1},
        {"time_limit": 60.0},
        {"crop": (0, 0, 1, 1)},
        {"aovs": ("albedo",)},
        {"denoise": True},
        {"preview": True},
        {"formats": ["exr"]},
    ],
)
def test_other_settings_are_other_pictures(swept, change):
    swept(TWO)
    assert swept(TWO, **change).reused == 0
    assert swept(TWO).reused == (2 if "formats" in change else 0)


def test_a_changed_scene_is_rendered_again_and_a_comment_is_no_change(swept, scene):
    swept()
    scene.write_text("# A comment.\n" + SCENE.replace("radius: 1,", "radius: 1.0,"))
    assert swept().reused == 6
    scene.write_text(SCENE.replace("radius: 1,", "radius: 2,"))
    assert swept().reused == 0


def test_a_file_that_changes_during_a_sweep_and_back_is_rendered_again(swept, scene, folder, bench):
    """Records are of what was read, not of what was there at the beginning; what changes while it is read has none."""
    sky = scene.with_name("sky.npy")
    before, after = np.full((2, 4, 3), 1.0), np.full((2, 4, 3), 2.0)
    np.save(sky, before)
    scene.write_text(SCENE.replace("{type: constant, radiance: 1}", "{type: image, file: sky.npy}"))
    values = {"camera.f_number": "1.4,2,2.8,4", "camera.focus_distance": 2}
    swept(values)
    for path in (folder / "points").iterdir():
        path.unlink()

    def change(spec, **settings):
        if spec.camera.f_number in (2.0, 4.0):
            np.save(sky, after if spec.camera.f_number == 2.0 else before)

    bench.before = change
    told = []
    assert statuses(swept(values, warn=told.append)) == ["done"] * 4
    assert [sentence.partition(":")[0] for sentence in told] == ["f_number=2", "f_number=4"]
    bench.before = lambda spec, **settings: None
    assert swept(values).reused == 1
    assert [f_number for f_number, _ in bench.rendered] == [2.0, 2.8, 4.0]


def test_the_manifest_is_not_written_after_every_point(swept, monkeypatch):
    """It tells of all points: after 1, 2, 4, 8 of them, and at the end."""
    told, write = [], run.write_manifest

    def counted(result, folder):
        told.append(statuses(result).count("done"))
        write(result, folder)

    for module in (run, output_layout):
        monkeypatch.setattr(module, "write_manifest", counted)
    swept(TWO | {"camera.f_number": "1:9:9"})
    assert told == [1, 2, 4, 8, 9]


class _Killed(BaseException):
    """As if the process had been killed."""


def test_killed_at_any_write_it_ends_in_the_same_files(swept, tmp_path, bench, monkeypatch):
    swept(TWO, folder=tmp_path / "whole")
    whole, replace = pictures(tmp_path / "whole"), os.replace
    names = {path.name for path in (tmp_path / "whole").rglob("*")}
    for last in range(100):
        folder = tmp_path / f"killed_{last}"
        left = iter(range(last))

        def dying(source, target, left=left):
            if next(left, None) is None:
                raise _Killed
            replace(source, target)

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", dying)
            patch.setattr(Path, "unlink", lambda path, missing_ok=False: None)
            try:
                swept(TWO, folder=folder)
            except _Killed:
                pass
            else:
                break
        monkeypatch.setattr(atomic_write, "_swept", set())
        done = len(list((folder / "points").glob("*.json")))
        swept(TWO, folder=folder)
        assert len(bench.rendered) == 2 - done
        assert pictures(folder) == whole
        assert {path.name for path in folder.rglob("*")} == names
    # Images, records, manifests after each point, and all again at the end with the sheet and the page.
    assert last == 2 * (1 + 1 + 2) + 2 + 2


# ---- What goes wrong


def test_a_failed_point_is_told_and_does_not_end_the_others(swept, folder):
    told = []
    result = swept(TWO | {"camera.f_number": "-1,2,4"}, report=told.append)
    assert statuses(result) == ["failed", "done", "done"]
    assert told == list(result.results)
    row = next(csv.DictReader((folder / "manifest.csv").read_text().splitlines()))
    assert (row["status"], row["file"]) == ("failed", "")
    assert "camera.f_number: must be greater than 0" in row["reason"]


def test_a_failed_render_is_tried_again(swept, bench):
    def fail(camera):
        if camera.f_number == 2.0 and camera.focus_distance == 5.0:
            raise RuntimeError("no\nluck")

    bench.behave = fail
    (failed,) = (taken for taken in swept().results if taken.status == "failed")
    assert failed.reason == "internal error, RuntimeError: no luck"
    assert failed.camera["f_number"] == 2.0
    bench.behave = None
    assert swept().reused == 5
    assert bench.rendered == [(2.0, 5.0)]


def test_what_cannot_be_saved_has_failed(swept, monkeypatch):
    save = Image.save

    def full(image, path):
        if "f_number=2_" in str(path):
            raise OutputError(f"{path}: cannot be written: No space left on device")
        save(image, path)

    monkeypatch.setattr(Image, "save", full)
    assert statuses(swept()) == ["done", "done", "failed", "failed", "done", "done"]


def test_where_every_point_fails_there_is_one_error_and_no_folder(swept, folder):
    told = []
    with pytest.raises(InputError, match=r"unknown key 'f_numbr' .* did you mean 'f_number'"):
        swept({"camera.f_numbr": "2,4"}, report=told.append)
    assert told == []
    assert not folder.exists()


def test_an_interrupt_keeps_what_is_done(swept, folder, bench):
    def interrupt(camera):
        if camera.f_number == 2.0:
            raise KeyboardInterrupt

    bench.behave = interrupt
    result = swept()
    assert result.interrupted
    assert statuses(result) == ["done", "done", *["missing"] * 4]
    assert json.loads((folder / "manifest.json").read_text())["interrupted"] is True
    assert len(pictures(folder)) == 3
    bench.behave = None
    assert not swept().interrupted
    assert len(bench.rendered) == 4
    assert json.loads((folder / "manifest.json").read_text())["interrupted"] is False
    # Before there is anything, nothing is left.
    bench.behave = interrupt
    result = swept(VALUES | {"camera.f_number": 2}, folder=folder / "new")
    assert (result.interrupted, stale_images(result)) == (True, [])
    assert not (folder / "new").exists()


def test_a_lost_cluster_ends_the_sweep(swept, folder, bench, monkeypatch):
    render = bench.render

    def lose(camera, **keys):
        rendered = render(camera, **keys)
        return rendered._replace(failure="the scheduler has gone") if camera.f_number == 2.0 else rendered

    monkeypatch.setattr(bench, "render", lose)
    with pytest.raises(OutputError, match="the scheduler has gone"):
        swept()
    told = json.loads((folder / "manifest.json").read_text())
    assert [point["status"] for point in told["points"]] == ["done", "done", *["missing"] * 4]


def test_pictures_of_another_sweep_are_left_and_told(swept, folder):
    swept()
    result = swept(VALUES | {"camera.f_number": "1.4,2"})
    assert result.reused == 4
    assert stale_images(result) == ["f_number=2.8_focus_distance=2.png", "f_number=2.8_focus_distance=5.png"]
    assert len(list(csv.DictReader((folder / "manifest.csv").read_text().splitlines()))) == 4


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"animate": ["gif"], "fps": 0.0}, "--fps"),
        ({"values": {"render.spp": "1,2"}, "spp": 3}, "--spp stands in place of render.spp"),
        ({"values": {"render.seed": "1,2"}, "seed": 3}, "--seed stands in place of render.seed"),
    ],
)
def test_wrong_settings_are_told_before_anything(swept, bench, settings, says):
    with pytest.raises(InputError, match=says):
        swept(**settings)
    assert bench.settings == []


@pytest.mark.parametrize("name", ["index.html", "contact_sheet.png", "manifest.csv", "sweep.gif", "points"])
def test_what_stands_in_the_way_is_told_before_anything(swept, folder, bench, name):
    folder.mkdir()
    if name == "points":
        (folder / name).write_text("no folder")
    else:
        (folder / name).mkdir()
    with pytest.raises(InputError, match=name):
        swept(animate=["gif"])
    assert bench.settings == []


def test_a_picture_that_was_taken_away_meanwhile_is_not_shown(swept, folder, bench):
    first = folder / "f_number=1.4_focus_distance=2.png"
    bench.behave = lambda camera: first.unlink(missing_ok=True) if camera.f_number == 2.8 else None
    swept(animate=["gif"])
    assert not first.exists()
    assert {"index.html", "contact_sheet.png", "sweep.gif"} <= {path.name for path in folder.iterdir()}


def test_strict_ends_a_sweep_with_its_doubts(swept, bench):
    def doubt(spec, **settings):
        raise StrictError(["a doubt"])

    bench.before = doubt
    with pytest.raises(StrictError, match="a doubt"):
        swept(strict=True)


# ---- While it is at work


@pytest.mark.parametrize("packs_anew", [True, False])
def test_points_that_are_packed_anew_are_made_ready_beside_a_render(swept, bench, packs_anew):
    """What the first point packs tells nothing, what the second packs does: the third is begun while it renders."""
    stops = [1.4, 2.0, 2.8, 4.0]
    begun = {stop: threading.Event() for stop in stops}
    beside = []

    def before(spec, cache, **settings):
        begun[spec.camera.f_number].set()
        world = spec.camera.f_number if packs_anew else 0.0
        cache.get_or_create((world,), lambda: world, lambda _: True)

    def behave(camera):
        following = stops.index(camera.f_number) + 1
        if following < len(stops):
            is_expected = packs_anew and following > 1
            beside.append(begun[stops[following]].wait(60.0 if is_expected else 0.1))

    bench.before, bench.behave = before, behave
    swept({"camera.f_number": stops, "camera.focus_distance": 2}, folder=None)
    assert beside == [False, packs_anew, packs_anew]


def test_progress_rises_to_the_end_and_counts_by_work(swept):
    """Points of 1, 2 and 5 samples are 1/8, 2/8 and 5/8 of the work; half of each is told."""
    told = []
    fixed = {"camera.f_number": 2, "camera.focus_distance": 2}
    swept(fixed | {"render.spp": "1,2,5"}, progress=told.append)
    assert [done.share for done in told] == pytest.approx([0.5 / 8, 2 / 8, 5.5 / 8])
    assert [done.of for done in told] == [3, 3, 3]
    # A film of infinite width is no infinite part of the work.
    told.clear()
    assert statuses(swept(fixed | {"film.width": [math.inf, 8]}, progress=told.append)) == ["failed", "done"]
    assert [0.0 <= done.share <= 1.0 for done in told] == [True]


def test_a_doubt_is_told_once(scene, bench):
    bench.before = lambda spec, warn, **settings: warn("there is a doubt")
    with pytest.warns(SceneWarning) as found:
        result = sweep(scene, VALUES)
    assert [str(warning.message) for warning in found] == ["there is a doubt"]
    assert found[0].filename == __file__
    assert all(taken.warnings == ("there is a doubt",) for taken in result.results)


# ---- Rendered


# The same kernels as in tests/cli/test_render.py.
BALL = """\
camera: {type: pinhole, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40}
film: {width: 24, height: 16}
render: {spp: 4, max_depth: 5}
environment: {type: constant, radiance: 0.5}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: 0.8}}
"""


@pytest.fixture
def ball(tmp_path):
    path = tmp_path / "ball.yaml"
    path.write_text(BALL)
    return path


def test_a_sweep_has_the_bits_of_single_renders(ball):
    """And the world is packed once for each place of the camera, and its structure built once for all."""
    cache = RenderCache()
    values = {"camera.vfov": [30, 40], "camera.look_from": [[0, 0, 4], [0, 1, 4]]}
    result = sweep(ball, values, cache=cache, threads=2)
    alone = rt.render(rt.load(ball, {"camera.vfov": 40, "camera.look_from": [0, 0, 4]}), threads=2)
    assert np.array_equal(result.images[1, 0].radiance, alone.radiance)
    assert len({image.radiance.tobytes() for image in result.images.flat}) == 4
    assert (cache.counts.worlds_packed, cache.counts.structures_built) == (2, 1)
    assert all(math.isfinite(taken.seconds["total"]) for taken in result.results)


@pytest.mark.parametrize("damaged", [False, True])
def test_a_point_that_was_broken_off_is_gone_on_with(ball, folder, monkeypatch, damaged):
    """Its samples lie beside the records until it is done; where they are of no use it begins anew."""
    monkeypatch.setattr(worker_pool, "_POLL_SECONDS", 1e-3)
    values, settings, seen, sentences = {"camera.vfov": "30,40"}, {"spp": 2000, "formats": ["npy"]}, [], []
    whole = sweep(ball, values, spp=2000).images

    def interrupt(done):
        if done.share > 0.6:
            raise KeyboardInterrupt

    assert sweep(ball, values, folder=folder, progress=interrupt, **settings).interrupted
    (kept,) = (folder / "points").glob("*.checkpoint")
    assert kept.name.startswith("vfov=40")
    if damaged:
        kept.write_bytes(kept.read_bytes()[:-1])
    render_prepared = run.render_prepared

    def noted(*args, **keys):
        result = render_prepared(*args, **keys)
        seen.append(result.stats)
        return result

    monkeypatch.setattr(run, "render_prepared", noted)
    result = sweep(ball, values, folder=folder, warn=sentences.append, **settings)
    assert not result.interrupted
    (stats,) = seen
    if damaged:
        (sentence,) = (text for text in sentences if "checkpoint" in text)
        assert sentence.startswith(f"{kept}: is damaged: ")
        assert sentence.endswith("; there is no other to go on from; vfov=40 begins anew")
    else:
        assert 0 < stats.resumed["samples"] < stats.samples
    for number, taken in enumerate(result.results):
        (file,) = (name for name in taken.files if name.endswith(".npy"))
        np.testing.assert_array_equal(np.load(folder / file), whole[number].radiance)
    assert not kept.exists()


# What a process does that is told to sweep in its arguments.
_COMMAND = "import sys; from raytracer.cli.base.app import main; sys.exit(main(sys.argv[1:]))"


@pytest.mark.slow
def test_killed_at_random_moments_it_ends_in_the_same_files(ball, tmp_path):
    """A process that is killed without a word, again and again, while it is at work."""

    def start(folder):
        words = ["sweep", str(ball), "-D", "camera.vfov=20:60:12", "--spp", "20000"]
        words += ["-o", str(tmp_path / folder), "--threads", "2", "--quiet"]
        return subprocess.Popen([sys.executable, "-c", _COMMAND, *words])

    def done():
        return len(list((tmp_path / "killed" / "points").glob("*.json")))

    assert start("whole").wait() == 0
    random = np.random.default_rng(7)
    for target in (1, 3, 3, 6):
        process = start("killed")
        while process.poll() is None and done() < target:
            time.sleep(0.01)
        time.sleep(random.uniform(0.0, 0.2))
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert 6 <= done() <= 12
    assert start("killed").wait() == 0
    assert pictures(tmp_path / "killed") == pictures(tmp_path / "whole")
    names = [{path.name for path in (tmp_path / folder).rglob("*")} for folder in ("killed", "whole")]
    assert names[0] == names[1]
