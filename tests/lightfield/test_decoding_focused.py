"""Raw pictures of cameras with focused microlenses, of one kind and of three, against the camera that made them."""

import dataclasses
import re
import tracemalloc
from functools import cache

import numpy as np
import pytest

import raytracer as rt
from raytracer.cli.base.app import main
from raytracer.film.image import Image
from raytracer.film.light_field.lattice import Lattice
from raytracer.lightfield.decoding.focused import FocusedOptics, decode_focused
from raytracer.lightfield.decoding.microlens_grid import Grid
from raytracer.lightfield.memory import memory_limit
from raytracer.plugins.cameras.light_field import LightField
from raytracer.util.errors import InputError

WIDTH, SIDE, PIXELS, FOCUS, FOCAL_LENGTH, F_NUMBER = 220, 4.4, 20, 1.0, 80.0, 4.0
KINDS = (1.38, 1.45, 1.52)


def camera(focal_length=KINDS, **lenses):
    hexagons = {"pixels": PIXELS, "layout": "hexagonal", "arrangement": "focused", "focal_length": focal_length}
    return LightField.model_validate(
        {
            "type": "light_field",
            "sensor": {"width": SIDE, "height": SIDE},
            "focal_length": FOCAL_LENGTH,
            "f_number": F_NUMBER,
            "focus_distance": FOCUS,
            "microlenses": {**hexagons, **lenses},
        }
    )


def optics_of(spec, focal_lengths=None):
    """What the camera's maker would say of it."""
    found = spec.microlenses.focal_lengths if focal_lengths is None else focal_lengths
    distance = 1e3 * spec.arrangement(WIDTH, WIDTH).distance
    return FocusedOptics(1e3 * SIDE / WIDTH, FOCAL_LENGTH, F_NUMBER, FOCUS, distance, tuple(1e3 * own for own in found))


def pattern(x, y):
    """Three colours by tangents right and up, with waves of forty pixels of the sensor."""
    wave = 40.0 * SIDE / WIDTH / FOCAL_LENGTH
    return 0.5 + 0.3 * np.stack([np.sin(2 * np.pi * x / wave), np.cos(2 * np.pi * y / wave), np.sin(x / wave)], -1)


@cache
def layout_of(focal_length=KINDS):
    return camera(focal_length).lenslets(WIDTH, WIDTH)


@cache
def pictures(focal_length=KINDS, distance=FOCUS):
    """The raw and the white picture of a pattern at a distance, each pixel by the ray in its middle."""
    layout, rng = layout_of(focal_length), np.random.default_rng(5)
    middles, away = layout._pixels
    sides = np.array([1.0, -1.0])
    lens = layout.stride * away * sides
    slope = layout.slope * (middles - layout.middle) * sides - layout.inverse_distance * lens
    x, y = np.moveaxis(slope + lens / distance, -1, 0)
    shades = 1.0 + 0.01 * rng.standard_normal((WIDTH, WIDTH, 4))
    # Off the axis it is darker.
    light = layout.lit * np.cos(0.02 * (np.hypot(*(np.mgrid[:WIDTH, :WIDTH] - 0.5 * WIDTH)) / WIDTH)) ** 4
    return (light[..., None] * shades[..., :3] * pattern(x, y)), light * shades[..., 3]


@pytest.mark.parametrize(("focal_length", "keys"), [(KINDS, {}), (1.45, {"rotation": 7}), (1.3, {"layout": "square"})])
def test_the_layout_is_that_of_the_camera(focal_length, keys):
    spec = camera(focal_length, **keys)
    layout = spec.lenslets(WIDTH, WIDTH)
    found = optics_of(spec).lenslets(Grid(layout.lattice, WIDTH, WIDTH))
    for field in dataclasses.fields(layout):
        if field.name not in ("lattice", "pose", "opening"):
            assert getattr(found, field.name) == pytest.approx(getattr(layout, field.name), rel=1e-9), field.name
    assert found.lattice == layout.lattice


def as_seen(lattice, turn, shift):
    """The same microlenses, counted from another of them, and along another of the sides of the hexagons."""
    a, b = np.array(lattice.along), np.array(lattice.across)
    along, across = ((a, b), (b, b - a), (a, b - a))[turn]
    return Lattice(tuple(lattice.place(*shift)), tuple(along), tuple(across))


@pytest.mark.parametrize(("turn", "shift"), [(0, (1, 0)), (1, (0, 1)), (2, (0, 0)), (2, (0, 1))])
def test_kinds_are_told_by_the_white_picture(turn, shift):
    spec, layout = camera(), layout_of()
    raw, white = pictures()
    grid = Grid(as_seen(layout.lattice, turn, shift), WIDTH, WIDTH)
    # In whatever order they are given.
    decoded = decode_focused(raw, white, optics_of(spec, KINDS[::-1]), grid=grid)
    blur = np.choose(decoded.lenslets.pixel_kinds, decoded.lenslets.kinds)
    inside = np.hypot(*np.moveaxis(layout._pixels[1], -1, 0)) < 9.0
    np.testing.assert_allclose(blur[inside], np.choose(layout.pixel_kinds, layout.kinds)[inside], rtol=1e-6)


@pytest.mark.parametrize(("focal_length", "distance"), [(KINDS, 0.9), (KINDS, 1.0), (1.45, 1.2)])
def test_a_decoded_picture_is_refocused_as_what_was_seen(focal_length, distance, tmp_path):
    decoded = decode_focused(*pictures(focal_length, distance), optics_of(camera(focal_length)))
    decoded.write(tmp_path / "field.lf")
    with rt.lightfield.open(tmp_path / "field.lf") as field:
        seen = np.asarray(rt.lightfield.refocus(field, distance, method="rays").radiance)
        plane, views = field.views.plane, field.views
        x = plane.left + plane.pixel * (np.arange(views.width) + 0.5)
        y = plane.top - plane.pixel * (np.arange(views.height) + 0.5)
    truth = pattern(*np.meshgrid(x, y))
    part = slice(8, -8)
    # A pixel is the mean of the rays that come to it, whose waves of 13 pixels are moved by up to half of one.
    assert np.sqrt(((seen - truth)[part, part] ** 2).mean()) < 0.025


def test_views_are_those_of_the_camera():
    raw, white = pictures()
    made = layout_of().light_field(Image(raw))
    field = decode_focused(raw, white, optics_of(camera())).light_field()
    assert field.radiance.shape == made.radiance.shape
    assert field.views.position == pytest.approx(made.views.position)
    part = np.s_[1:-1, 1:-1, 8:-8, 8:-8]
    assert np.sqrt(np.mean((field.radiance[part] - made.radiance[part]) ** 2)) < 0.02


def test_a_glint_is_no_defect():
    raw, white = (picture.copy() for picture in pictures())
    place = WIDTH // 2, WIDTH // 2
    raw[place] *= 5.0
    decoded = decode_focused(raw, white, optics_of(camera()))
    assert decoded.weight[place] > 0.9
    white[place] = 0.0
    assert decode_focused(raw, white, optics_of(camera())).weight[place] == 0.0


def change(optics, **values):
    return dataclasses.replace(optics, **values)


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (lambda optics: change(optics, microlens_focal_lengths=(1e3, 2e3)), "one focal length or 3, not 2"),
        (lambda optics: change(optics, focus_distance=0.05), "0.05 m, must be more than the focal length, 0.08 m"),
        (lambda optics: change(optics, microlens_distance=1.45e3), "show infinity by a focal length of as much"),
        (lambda optics: change(optics, microlens_distance=1.4500001e3), "microlenses in a row would see one place"),
        (lambda optics: change(optics, f_number=0.0), "f number: must be greater than 0 and finite, got 0"),
        (lambda optics: change(optics, microlens_focal_lengths=(1e3, 1e3, np.inf)), "focal length 3: must be greater"),
        (
            lambda optics: change(optics, microlens_distance=1440.0, microlens_focal_lengths=(1450.0,)),
            "before the main",
        ),
        (lambda optics: change(optics, microlens_focal_lengths=(1450.0,) * 3), "does not tell which microlenses"),
        # Far too short ones let no light through, or make views that are far too large.
        (
            lambda optics: change(optics, microlens_focal_lengths=(280.0, 300.0, 320.0)),
            "does not tell which microlenses",
        ),
        (
            lambda optics: change(optics, microlens_focal_lengths=(1.38, 1.45, 1.52)),
            r"rays of raw into views, \d+ pixels, takes",
        ),
    ],
)
def test_what_cannot_be_decoded_is_told(made, told):
    grid = Grid(layout_of().lattice, WIDTH, WIDTH)
    with pytest.raises(InputError, match=told):
        decode_focused(*pictures(), made(optics_of(camera())), grid=grid)


def test_three_kinds_stand_on_hexagons_and_need_a_white_picture():
    raw, white = pictures()
    squares = Grid(Lattice((10.0, 10.0), (20.0, 0.0), (0.0, 20.0)), WIDTH, WIDTH)
    with pytest.raises(InputError, match="stand on hexagons, and those of the grid on squares"):
        decode_focused(raw, white, optics_of(camera()), grid=squares)
    with pytest.raises(InputError, match="are found by a white picture, and none is given"):
        decode_focused(raw, None, optics_of(camera()))


@pytest.mark.parametrize("focal_length", [KINDS, 1.45])
def test_memory_is_kept(focal_length):
    grid, optics = Grid(layout_of(focal_length).lattice, WIDTH, WIDTH), optics_of(camera(focal_length))
    raw, white = (picture.astype(np.float32) for picture in pictures(focal_length))
    tracemalloc.start()
    field = decode_focused(raw, white, optics, grid=grid).light_field()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # As much as is said, which is more than half of it used.
    needed = 350 * max(WIDTH**2, field.radiance[..., 0].size)
    assert 0.5 * needed < peak < needed
    with (
        memory_limit(needed - 1),
        pytest.raises(InputError, match=r"sorting the rays of raw into views, \d+ pixels, takes"),
    ):
        decode_focused(raw, white, optics, grid=grid)


LENGTHS = {
    "--pixel-pitch": f"{1e3 * SIDE / WIDTH}um",
    "--focal-length": "80mm",
    "--f-number": "4",
    "--focus-distance": "1m",
    "--microlens-distance": "1.8672mm",
    "--microlens-focal-length": "1.38mm,1.45mm,1.52mm",
}


def words_of(lengths):
    return [word for option in lengths.items() for word in option]


def test_the_command_writes_rays(tmp_path, capsys):
    raw, white, path = tmp_path / "raw.npy", tmp_path / "white.npy", tmp_path / "shot.lf"
    for file, picture in zip((raw, white), pictures(), strict=True):
        np.save(file, picture)
    files = ["lightfield", "decode", str(raw), "--white", str(white), "-o", str(path)]
    lengths = {**LENGTHS, "--microlens-distance": f"{camera().arrangement(WIDTH, WIDTH).distance!r}mm"}
    assert main([*files, *words_of(lengths)]) == 0
    assert re.search(r"microlenses  hexagonal, (19\.99|20\.00)\d* pixels apart", capsys.readouterr().out)
    expected = decode_focused(*pictures(), optics_of(camera())).light_field()
    with rt.lightfield.open(path) as field:
        assert field.settings["decoded"] == str(raw)
        np.testing.assert_allclose(field.rays.bundle[:], expected.rays.bundle, rtol=1e-5)
        np.testing.assert_allclose(field.rays.place[:], expected.rays.place, rtol=1e-5, atol=1e-9)

    for missing in lengths.keys() - {"--microlens-focal-length"}:
        given = {option: value for option, value in lengths.items() if option != missing}
        assert main([*files, *words_of(given)]) == 2
        assert f"--microlens-focal-length: needs {missing}, too" in capsys.readouterr().err
    assert main([*files, *words_of(lengths), "--views", "5"]) == 2
    assert "--microlens-focal-length and --views exclude each other" in capsys.readouterr().err
    assert main([*files, *words_of({**lengths, "--microlens-focal-length": "1.4mm,x"})]) == 2
    assert "--microlens-focal-length x" in capsys.readouterr().err
    photo = tmp_path / "photo.lfp"
    photo.write_bytes(b"\x89LFP\r\n\x1a\n" + bytes(8))
    assert main(["lightfield", "decode", str(photo), *words_of(lengths)]) == 2
    assert "photo.lfp is a photograph of a Lytro, whose microlenses are not focused" in capsys.readouterr().err
