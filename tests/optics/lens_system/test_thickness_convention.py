"""Tables of pbrt's collection, of both kinds: with thickness after each surface, and before it."""

import pytest

from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.importers import Choices, import_lens
from raytracer.optics.lens_system.warnings import lens_warnings
from raytracer.scene.assets.lenses import read_lens, read_prescription
from raytracer.util.errors import SceneError
from tests.optics.lens_system.test_importers import TABLE, written
from tests.repository import SCENES

Rows = list[tuple[float, float, float, float]]

# The double Gauss as pbrt has it, whose glasses have one decimal less than those of the patent.
DGAUSS: Rows = [
    (float(a), float(b), float(c), float(d))
    for a, b, c, d in (line.partition("#")[0].split() for line in TABLE.splitlines()[3:])
]

# Two biconvex lenses that do not touch either way, of focal lengths that differ by a fifth.
PAIR: Rows = [(50, 4, 1.5, 10), (-50, 40, 1, 10), (-60, 5, 1.5, 10), (60, 20, 1, 10)]


def shipped(name):
    """A shipped lens as pbrt's table of it: with an index for each glass, which is 0 at the stop."""
    rows = []
    for surface in read_prescription(SCENES / "lenses" / f"{name}.yaml").surfaces:
        radius = getattr(surface, "radius", 0.0)
        ior = 0.0 if surface.kind == "stop" else float(surface.material.ior())
        rows.append((radius, surface.thickness or 0.0, ior, surface.aperture))
    return rows


def scaled(rows, by):
    return [(by * radius, by * gap, ior, by * aperture) for radius, gap, ior, aperture in rows]


def before(rows, first=0.0):
    """The same lens with each way in the row behind it, and a number in the first."""
    gaps = [first, *(row[1] for row in rows[:-1])]
    return [(row[0], gap, *row[2:]) for row, gap in zip(rows, gaps, strict=True)]


def filmed(rows, film):
    """The same lens with the way to the film in the last row."""
    return [*rows[:-1], (rows[-1][0], film, *rows[-1][2:])]


def table(folder, name, rows, comments=("radius axpos N aperture",)):
    lines = [*(f"# {comment}" for comment in comments), *("\t".join(f"{value:.10g}" for value in row) for row in rows)]
    return written(folder, name, "\n".join(lines) + "\n")


def focal_length(path):
    return cardinal_points(read_lens(path).packed()).focal_length


AXPOS, SEP = ("scaled", "radius axpos N aperture"), ("scaled", "radius sep n aperture")


@pytest.mark.parametrize(
    ("name", "rows", "comments", "expected", "place"),
    [
        ("dgauss.50mm", DGAUSS, AXPOS, 50.358, "after"),
        ("telephoto.250mm", shipped("telephoto-250mm"), ("EFL=254mm, F/5.6",), 249.567, "after"),
        ("fisheye.10mm", shipped("fisheye-10mm"), SEP, 9.991, "after"),
        ("wide.22mm", shipped("wide-22mm"), SEP, 22.0235, "after"),
        ("dgauss", before(scaled(DGAUSS, 2.0)), AXPOS, 100.716, "before"),
        ("telephoto", before(scaled(shipped("telephoto-250mm"), 0.4)), ("EFL=254mm", *AXPOS), 99.827, "before"),
    ],
)
def test_tables_of_pbrt_have_the_focal_lengths_that_they_should(name, rows, comments, expected, place, tmp_path):
    path = table(tmp_path, f"{name}.dat", rows, comments)
    lens = read_lens(path)
    assert cardinal_points(lens.packed()).focal_length == pytest.approx(expected, abs=6e-4)
    assert lens_warnings(lens) == []
    assert f"thickness is read as that {place} each surface" in lens.reading.text
    assert not lens.reading.is_guess
    # What is in neither the first nor the last row tells nothing: the surfaces do, also without a name.
    other = before(read_rows(rows, place), 12.5) if place == "before" else filmed(rows, 36.1)
    guessed = read_lens(table(tmp_path, "lens.dat", other))
    assert guessed.elements[:-1] == lens.elements[:-1]
    assert guessed.reading.is_guess
    (doubt,) = lens_warnings(guessed)
    assert f"is read as that {place} each surface" in doubt
    assert "go through each other" in doubt


def read_rows(rows, place):
    """The lens of a table with each way in the row before it."""
    if place == "after":
        return rows
    gaps = [*(row[1] for row in rows[1:]), 0.0]
    return [(row[0], gap, *row[2:]) for row, gap in zip(rows, gaps, strict=True)]


def test_the_wrong_reading_is_warned_of(tmp_path):
    path = table(tmp_path, "dgauss.50mm.dat", DGAUSS)
    wrong = import_lens(path, Choices(thickness="before")).lens()
    assert cardinal_points(wrong.packed()).focal_length == pytest.approx(48.571, abs=6e-4)
    assert "surfaces 1 and 2 go through each other within their apertures" in lens_warnings(wrong)


@pytest.mark.parametrize("place", ["after", "before"])
def test_the_name_decides_where_surfaces_do_not(place, tmp_path):
    choices = Choices(thickness="after" if place == "after" else "before")
    expected = cardinal_points(import_lens(table(tmp_path, "a.dat", PAIR), choices).lens().packed()).focal_length
    engraved = f"{1.02 * expected:.1f}"
    heading = "radius axpos N aperture"
    named = [
        table(tmp_path, f"pair.{engraved}mm.dat", PAIR),
        table(tmp_path, "b.dat", PAIR, (f"f = {engraved}, f/4", heading)),
        table(tmp_path, "c.dat", PAIR, ("EFL=254mm", f"Scaled to {engraved} mm from 100 mm", heading)),
    ]
    alone = written(tmp_path, "d.dat", f"{engraved}\n" + named[0].read_text())
    for path in (*named, alone):
        assert focal_length(path) == expected
        assert place in "; ".join(lens_warnings(read_lens(path)))
    assert read_lens(alone).focal_length == float(engraved)


def test_a_table_that_may_be_two_lenses_is_refused_with_both(tmp_path):
    path = table(tmp_path, "pair.dat", PAIR)
    both = [import_lens(path, Choices(thickness=place)).lens() for place in ("after", "before")]
    lengths = [cardinal_points(lens.packed()).focal_length for lens in both]
    assert abs(lengths[1] - lengths[0]) > 0.1 * lengths[0]
    with pytest.raises(SceneError) as caught:
        read_lens(path)
    assert str(caught.value) == (
        f"{path}: may be two lenses, as the first is 4 mm and the last 20 mm: with thickness after each surface it has "
        f"a focal length of {lengths[0]:.6g} mm, with thickness before each a focal length of {lengths[1]:.6g} mm; say "
        "which is meant by rt lens import --thickness after, or before"
    )
    # Another heading is that of pbrt's own words, by which thickness is that behind a surface.
    assert focal_length(table(tmp_path, "pair.dat", PAIR, ("radius thickness n aperture",))) == lengths[0]


def test_a_0_that_surfaces_gainsay_is_no_proof(tmp_path):
    # A stop in the last vertex, before which the way is 0: read as after it, the sides of the glass meet.
    rows: Rows = [(15, 1, 1.5, 16), (-15, 8, 1, 16), (0, 0, 0, 10)]
    with pytest.raises(SceneError, match=r"may be two lenses, .* surfaces 1 and 2 that go through each other, with"):
        read_lens(table(tmp_path, "stop.dat", rows))
    lens = import_lens(table(tmp_path, "stop.dat", rows), Choices(thickness="before")).lens()
    assert [element.thickness for element in lens.elements] == [8.0, 0.0, 0.0]


def test_ways_that_are_all_alike_are_one_lens_either_way(tmp_path):
    # The thick lens of n = 1.5 and R = 50 mm, 4 mm thick: 1/f = (n - 1) (2/R - (n - 1) d / (n R^2)).
    rows: Rows = [(50, 4, 1.5, 10), (-50, 4, 1, 10)]
    lens = read_lens(table(tmp_path, "single.dat", rows))
    assert cardinal_points(lens.packed()).focal_length == pytest.approx(1 / (0.5 * (2 / 50 - 0.5 * 4 / (1.5 * 2500))))
    assert not lens_warnings(lens)
    assert lens.name == "single"
