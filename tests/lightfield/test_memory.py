"""Memory that work on light fields takes, measured by Python's own account of it, against what is given."""

import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest

from raytracer.cli.base.app import main
from raytracer.film.light_field import lf
from raytracer.film.light_field.field import LightField
from raytracer.film.light_field.lf import write
from raytracer.film.light_field.posed_views import PosedViews
from raytracer.lightfield.decoding.calibration import find_grid
from raytracer.lightfield.decoding.decoder import decode
from raytracer.lightfield.depth.depth_map import Depth, depth_map
from raytracer.lightfield.memory import memory_limit, require_memory, reserved_memory
from raytracer.lightfield.refocusing.refocus import focal_stack, iterate_focal_stack
from raytracer.lightfield.super_resolution import supersampled
from raytracer.lightfield.views.contact_sheet import montage
from raytracer.lightfield.views.free_camera import free_camera
from raytracer.lightfield.views.unstructured import views_along
from raytracer.util.errors import InputError
from tests.lightfield.analytic import Surface, light_field, views, waves
from tests.lightfield.lenslet_pictures import Camera, lattice

DISTANCES = np.linspace(1.5, 4.0, 24).tolist()


@pytest.fixture(scope="module")
def field():
    """One plane that leans away, seen by 5 x 5 views of 96 x 80 pixels."""
    geometry = views(5, 5, spacing=0.03, width=96, height=80)
    return light_field(geometry, [Surface(2.2, waves(1, 0.05), tilt=(0.6, 0.5))], supersampling=1)


def peak_of(work: Callable[[], object], limit: int = 2 * 10**9) -> int:
    """Measure the most bytes that `work` has at once, with a limit."""
    # What is imported, compiled and cached stays.
    with memory_limit(limit):
        work()
        tracemalloc.start()
        try:
            work()
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()


def test_a_focal_stack_is_made_in_parts_that_fit(field):
    limit = 4_000_000

    def sums() -> list[float]:
        return [float(image.radiance.sum()) for image in iterate_focal_stack(field, DISTANCES)]

    assert peak_of(sums, limit) <= limit < peak_of(sums)
    whole = focal_stack(field, DISTANCES)
    with memory_limit(limit):
        for image, other in zip(iterate_focal_stack(field, DISTANCES), whole, strict=True):
            assert np.array_equal(image.radiance, other.radiance)


def test_depth_compares_as_many_planes_as_fit(field):
    limit = 7_000_000

    def depth():
        return depth_map(field, near=1.2, far=5.0, threads=2)

    assert peak_of(depth, limit) <= limit < peak_of(depth)
    with memory_limit(limit):
        assert np.array_equal(depth().inverse, depth_map(field, near=1.2, far=5.0, threads=1).inverse)


@pytest.mark.parametrize("threads", [1, 8])
def test_depth_and_its_refinement_keep_to_their_estimate(field, threads):
    # The sweep takes what there is, so the least that is accepted is what refinement takes.
    def depth():
        return depth_map(field, near=1.2, far=5.0, threads=threads)

    estimate = next(size for size in range(500_000, 40_000_000, 250_000) if fits(depth, size))
    assert peak_of(depth, estimate) <= estimate


def test_what_cannot_be_done_in_parts_keeps_to_its_own_estimate(field):
    found = depth_map(field, method="slopes", near=1.2, far=5.0, threads=2)
    needed = {"super-resolution 2": lambda: supersampled(field, 2, found, threads=2), "montage": lambda: montage(field)}
    for what, work in needed.items():
        with memory_limit(10_000), pytest.raises(InputError, match=f"memory: .*{what}.* takes .* GB, and 1e-05 GB"):
            work()
        estimate = next(size for size in range(500_000, 40_000_000, 500_000) if fits(work, size))
        assert peak_of(work, estimate) <= estimate


@pytest.mark.parametrize(
    ("kind", "size"), [("file", (8, 6)), ("file", (60, 45)), ("estimate", (8, 6)), ("plane", (60, 45))]
)
def test_pictures_from_anywhere_keep_to_their_estimate(tmp_path, kind, size):
    """Of fewer pixels than views have, and of more; what is left keeps surfaces of views."""
    geometry = views(4, 4, spacing=0.03, width=48, height=40)
    field = light_field(geometry, [Surface(2.2, waves(1, 0.05), tilt=(0.6, 0.5))], supersampling=1)
    write(tmp_path / "field.lf", field)
    plain = LightField(np.asarray(field.radiance), geometry)
    depth = Depth(np.full((40, 48), 1.0 / 2.2), np.ones((40, 48)), 2, 2)
    places = [(0.0, 0.0, 0.0), (0.01, 0.0, 0.0)]
    cameras = [free_camera(place, (0.0, 0.0, -2.2), PosedViews.of(geometry), size=size) for place in places]
    with lf.open(tmp_path / "field.lf") as stored:

        def draw():
            source = stored if kind == "file" else plain
            keys = {"file": {}, "estimate": {"depth": depth}, "plane": {"distance": 2.2}}[kind]
            return list(views_along(source, cameras, **keys))

        with (
            memory_limit(10_000),
            pytest.raises(InputError, match=f"memory: a picture of {size[0]} x {size[1]} pixels"),
        ):
            draw()
        estimate = next(limit for limit in range(100_000, 40_000_000, 50_000) if fits(draw, limit))
        for limit in (estimate, estimate + 400_000):
            assert peak_of(draw, limit) <= limit


def test_frames_that_are_drawn_leave_less_for_the_next(field):
    with memory_limit(1_000_000), reserved_memory(600_000, "frames", "fewer"):
        with pytest.raises(InputError, match=r"0\.0005 GB, and 0\.0004 GB are left, as 0\.001 GB are given"):
            require_memory(500_000, "a picture", "a smaller one")
        require_memory(400_000, "a picture", "a smaller one")
    with memory_limit(1_000_000):
        require_memory(1_000_000, "a picture", "a smaller one")


def fits(work: Callable[[], object], size: int) -> bool:
    """Tell if work is not refused."""
    try:
        with memory_limit(size):
            work()
    except InputError:
        return False
    return True


@pytest.mark.parametrize(
    ("pitch", "colours", "dark", "bayer", "knows_grid"),
    [
        (9.3, False, False, None, False),
        (4.6, True, True, None, False),
        (9.3, False, False, None, True),
        (9.3, True, True, None, True),
        (9.3, False, False, "rggb", True),
        (4.6, False, True, "rggb", True),
    ],
)
def test_decoding_keeps_to_its_own_estimate(tmp_path, pitch, colours, dark, bayer, knows_grid):
    white = Camera(lattice(pitch, 0.7, (5.3, 4.1)), 400, 300).picture(supersampling=1).astype(np.float32)
    grid = find_grid(white) if knows_grid else None
    if colours:
        white = white[..., None] * np.array([0.5, 1.0, 0.7], np.float32)
    names = {name: str(tmp_path / f"{name}.npy") for name in ("raw", "white", "dark")}
    for name, share in (("raw", 0.7), ("white", 1.0), ("dark", 0.01)):
        np.save(names[name], share * white)

    def work() -> None:
        decoded = decode(names["raw"], names["white"], dark=names["dark"] if dark else None, grid=grid, bayer=bayer)
        decoded.write(tmp_path / "out.lf")

    with memory_limit(10_000), pytest.raises(InputError, match=r"memory: decoding .*raw.npy, 400 x 300 pixels, takes"):
        work()
    estimate = next(size for size in range(500_000, 100_000_000, 500_000) if fits(work, size))
    peak = peak_of(work, estimate)
    assert peak <= estimate < 3.0 * peak


def test_commands_keep_to_the_memory_that_they_are_given(field, tmp_path, capsys):
    file = tmp_path / "field.lf"
    write(file, field)

    def refocused(planes: int, memory: str) -> int:
        arguments = ["--distance", f"1.5:4:{planes}", "-o", str(tmp_path / "plane.npy"), "--memory", memory]
        return main(["lightfield", "refocus", str(file), *arguments, "--quiet"])

    few, many = (peak_of(lambda planes=planes: refocused(planes, "4MB")) for planes in (6, 24))
    assert many <= 1.1 * few
    assert len(list(tmp_path.glob("plane_*.npy"))) == 6 + 24
    for command in ("refocus", "depth", "all-in-focus", "move", "views", "view"):
        output = tmp_path / {"move": "a.gif", "view": "a.html"}.get(command, "a.png")
        assert main(["lightfield", command, str(file), "-o", str(output), "--memory", "100kB", "--quiet"]) == 2
        said = capsys.readouterr().err
        assert "memory" in said
        assert "0.0001 GB are given" in said
        assert not output.exists()
    raw, output = tmp_path / "raw.npy", tmp_path / "raw.lf"
    np.save(raw, Camera(lattice(9.3, 0.7, (5.3, 4.1)), 400, 300).picture(supersampling=1).astype(np.float32))
    assert main(["lightfield", "decode", str(raw), "-o", str(output), "--memory", "100kB", "--quiet"]) == 2
    said = capsys.readouterr().err
    assert "raw.npy, 400 x 300 pixels, takes 0.0" in said
    assert "0.0001 GB are given; pictures of which" in said
    assert not output.exists()
    assert main(["lightfield", "depth", str(file), "--memory", "much"]) == 2
    assert "--memory much: must be an amount of memory such as 2GB" in capsys.readouterr().err
