"""Lenses of other programs: tables of pbrt and prescriptions of Zemax, whole, damaged, and of what is not supported."""

import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from raytracer.optics.glass import AIR, CATALOGUE, constant_index_glass
from raytracer.optics.lens_system.first_order import cardinal_points
from raytracer.optics.lens_system.importers import Choices, as_yaml, import_lens, parse_glasses
from raytracer.scene.assets.lenses import read_lens, read_prescription
from raytracer.util.errors import SceneError

TABLE = """\
# Double Gauss f/2
# US patent 2,673,491
# radius  thickness  n  aperture
29.475 3.76 1.67 25.2
84.83 0.12 1 25.2
19.275 4.025 1.67 23   # second meniscus
40.77 3.275 1.699 23
12.75 5.705 1 18
0 4.5 0 17.1
-14.495 1.18 1.603 17
40.77 6.065 1.658 20
-20.385 0.19 1 20
437.065 3.22 1.717 20
-39.73 0 1 20
"""

HEAD = """\
VERS 130404 15 24485
MODE SEQ
NAME A simple triplet
UNIT MM X W X CM MR CPMM
ENPD 1.0E+1
FTYP 0 0 3 3 0 0 0
XFLN 0 0 0 0
YFLN 0 1.4E+1 2.0E+1 0
WAVM 1 4.8E-1 1
"""
# Curvature, distance, glass, and diameter with the mark of who set it.
SURFACES = (
    ("0.0", "INFINITY", "", "0 0"),
    ("4.54264791E-002", "3.25895583", "SK16", "9.5 1"),
    ("-2.2948389E-003", "6.0075511", "", "9.5 1"),
    ("-4.501812E-002", "9.99974567E-1", "F2", "5.0 1"),
    ("4.92806889E-002", "4.75040893", "", "5.0 1"),
    ("1.25496334E-002", "2.95207564", "SK16", "7.5 1"),
    ("-5.4361615611E-002", "4.22077801E+1", "", "7.5 1"),
    ("0.0", "0", "", "1.8E+1 0"),
)


def surface(number, curvature, distance, glass, diameter):
    stop = "  STOP\n" if number == 4 else ""
    glass = f"  GLAS {glass} 0 0 0 0 0 0 0 0 0 0\n" if glass else ""
    return (
        f'SURF {number}\n{stop}  TYPE STANDARD\n  CURV {curvature} 0 0 0 0 ""\n'
        f'  DISZ {distance}\n{glass}  DIAM {diameter} 0 0 1 ""\n'
    )


COOKE = HEAD + "".join(surface(number, *row) for number, row in enumerate(SURFACES))


def written(folder, name, text, encoding="utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def complaint(path):
    with pytest.raises(SceneError) as caught:
        import_lens(path)
    told = str(caught.value)
    assert "\n" not in told
    assert told.startswith(str(path))
    return told.removeprefix(str(path))


def outcome(path):
    try:
        return import_lens(path)
    except SceneError as error:
        return str(error)


def test_a_table_of_pbrt(tmp_path):
    spec = import_lens(written(tmp_path, "dgauss.dat", TABLE)).spec
    assert (spec.name, spec.source) == ("Double Gauss f/2", "US patent 2,673,491")
    lens = spec.lens()
    assert [element.kind for element in lens.elements].index("stop") == 5
    assert [float(element.glass.ior()) for element in lens.elements][:5] == [1.67, 1.0, 1.67, 1.699, 1.0]
    assert [2.0 * element.radius for element in lens.elements][4:7] == [18.0, 17.1, 17.0]
    assert [element.thickness for element in lens.elements][3:6] == [3.275, 5.705, 4.5]
    # What the table is said to have: f = 50 mm, f/2, which its rounded indices meet to a hundredth.
    assert cardinal_points(lens.packed()).focal_length == pytest.approx(50.0, rel=0.01)


def test_a_radius_of_0_between_two_media_is_flat_glass(tmp_path):
    lens = read_lens(written(tmp_path, "flat.dat", "0 5 1.5 25\n-50 1 1 25\n0 2 1 20\n0 3 1.6 20\n40 0 1 20\n"))
    assert [element.kind for element in lens.elements] == ["flat", "spherical", "stop", "flat", "spherical"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ": holds no surfaces: a lens table has lines of radius, thickness"),
        ("# only a comment\n", ": holds no surfaces"),
        ("1 2 3\n", ":1: must hold 4 numbers (radius, thickness, index of refraction, aperture), got 3"),
        ("50 1 1.5 x\n", ":1: the aperture must be a number, got 'x'"),
        ("50 1 nan 5\n", ":1: the index of refraction must be a number, got 'nan'"),
        ("50 1 1.5 20\n\n-5 1 1 20\n", ":3: aperture: must be at most 10 mm"),
        ("50 -1 1.5 20\n-50 0 1 20\n", ":1: thickness: must be at least 0, got -1"),
        ("50 1 1 20\n0 1 1 5\n0 1 1 5\n-50 0 1 20\n", ":3: type: is a second stop"),
        ("50 1 9 20\n-50 0 1 20\n", ":1: material: must be at most 5, got 9"),
        ("50 1 1.5 20\n", ":1: material: must be air"),
    ],
)
def test_what_is_no_table(tmp_path, text, expected):
    assert expected in complaint(written(tmp_path, "broken.dat", text))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
def test_a_prescription_of_zemax(tmp_path, encoding):
    text = COOKE.replace("A simple", "A naïve") if encoding == "latin-1" else COOKE
    spec = import_lens(written(tmp_path, "cooke.zmx", text.replace("\n", "\r\n"), encoding)).spec
    assert spec.name == ("A naïve triplet" if encoding == "latin-1" else "A simple triplet")
    lens = spec.lens()
    assert len(lens.elements) == 6
    glasses = [CATALOGUE["N-SK16"], AIR, CATALOGUE["F2"], AIR, CATALOGUE["N-SK16"], AIR]
    assert [element.glass for element in lens.elements] == glasses
    assert [element.is_stop for element in lens.elements] == [False, False, False, True, False, False]
    assert [element.radius for element in lens.elements] == [9.5, 9.5, 5.0, 5.0, 7.5, 7.5]
    # As it is published: 50 mm, a pupil of 10 mm, 20 degrees.
    assert cardinal_points(lens.packed()).focal_length == pytest.approx(50.0, rel=1e-3)
    assert lens.f_number == pytest.approx(5.0, rel=1e-3)
    assert lens.image_circle == pytest.approx(36.4, rel=1e-3)


def changed(folder, old, new, count=1):
    assert old in COOKE
    return written(folder, "lens.zmx", COOKE.replace(old, new, count))


def test_inches_are_made_millimetres(tmp_path):
    lens = import_lens(changed(tmp_path, "UNIT MM", "UNIT IN")).lens()
    assert cardinal_points(lens.packed()).focal_length == pytest.approx(25.4 * 50.0, rel=1e-3)
    assert lens.elements[0].radius == pytest.approx(25.4 * 9.5)


def test_a_model_glass_and_one_that_an_option_names(tmp_path):
    path = changed(tmp_path, "GLAS F2 0 0 0 0", "GLAS ___BLANK 1 0 1.62 36.4")
    assert import_lens(path).lens().elements[2].glass.source_values == (1.62, 36.4)
    path = changed(tmp_path, "GLAS F2", "GLAS E-F2")
    given_glasses = parse_glasses(["E-F2=1.62/36.3", "SK16=N-SK5", "OTHER=1.7"])
    lens = import_lens(path, Choices(given_glasses)).lens()
    assert lens.elements[2].glass.source_values == (1.62, 36.3)
    assert lens.elements[0].glass is CATALOGUE["N-SK5"]
    assert given_glasses["OTHER"] == "1.7"


def test_conics_and_even_aspheres(tmp_path):
    conic = import_lens(changed(tmp_path, "  CURV -2.29", "  CONI -1.5\n  CURV -2.29")).lens().elements[1]
    assert (conic.kind, conic.conic) == ("conic", -1.5)
    told = complaint(changed(tmp_path, "  CURV -2.29", "  CONI 1e40\n  CURV -2.29"))
    assert told.startswith(":21: conic: must be 0, or of a magnitude")
    terms = "  TYPE EVENASPH\n  PARM 1 0\n  PARM 2 1E-5\n  PARM 3 -2E-8\n  PARM 4 0\n  CURV -2.29"
    path = changed(tmp_path, "  TYPE STANDARD\n  CURV -2.29", terms)
    asphere = import_lens(path).lens().elements[1]
    assert (asphere.kind, asphere.coefficients) == ("asphere", (1e-5, -2e-8))
    # In inches a coefficient of the fourth power is 1 / inch^3.
    path.write_text(path.read_text().replace("UNIT MM", "UNIT IN"))
    assert import_lens(path).lens().elements[1].coefficients[0] == pytest.approx(1e-5 / 25.4**3, rel=1e-9)


def test_a_surface_in_air_that_does_nothing_is_left_out(tmp_path):
    dummy = "SURF 9\n  TYPE STANDARD\n  CURV 0\n  DISZ -2\n  DIAM 3\nSURF 3\n"
    lens = import_lens(changed(tmp_path, "SURF 3\n", dummy)).lens()
    assert len(lens.elements) == 6
    assert lens.elements[1].thickness == pytest.approx(4.0075511)
    stop = "SURF 9\n  STOP\n  TYPE STANDARD\n  CURV 0\n  DISZ 2\n  DIAM 3\nSURF 3\n"
    path = written(tmp_path, "stop.zmx", COOKE.replace("  STOP\n", "").replace("SURF 3\n", stop))
    assert [element.kind for element in import_lens(path).lens().elements][2] == "stop"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("MODE SEQ", "MODE NSC", ":2: is a non-sequential system: only sequential lenses are read"),
        ("UNIT MM", "UNIT FURLONG", ":4: has lengths in the unknown unit 'FURLONG'; known units: MM, CM"),
        ("  TYPE STANDARD\n  CURV -2.29", "  TYPE COORDBRK\n  CURV -2.29", ":22: has a coordinate break"),
        ("  TYPE STANDARD\n  CURV -2.29", "  TYPE ZERNSAG\n  CURV -2.29", ":22: has a surface of the type 'ZERNSAG'"),
        ("GLAS F2", "GLAS MIRROR", ":30: has a mirror: only lenses, which light goes through, are read"),
        ("GLAS F2", "GLAS BAK6", "names the glass 'BAK6', which is not in the catalogue; the nearest name is 'N-BAK"),
        ("GLAS F2", "GLAS QQQQQ", ":30: names the glass 'QQQQQ', which is not in the catalogue: give its index"),
        ("DIAM 5.0 1", "DIAM 0 1", ":26: has no diameter (DIAM)"),
        ("DISZ 6.0075511", "DISZ INFINITY", ":21: has no finite thickness (DISZ)"),
        ("DISZ 6.0075511", "DISZ -6", ":21: goes back by 6 mm to the next surface, which must be behind it"),
        ("DISZ 6.0075511", "DISZ", ":24: DISZ must have a number, got ''"),
        ("CURV -2.2948389E-003", "CURV curved", ":23: CURV must have a number, got 'curved'"),
        ("CURV -2.2948389E-003", "CURV INFINITY", ":23: CURV must be finite"),
        ("CURV -2.2948389E-003", "CURV 1", ":21: aperture: must be at most 2 mm, as wide as its surface is, got 19"),
        ("  CURV 4.92", "  TYPE EVENASPH\n  PARM 1 0.01\n  CURV 4.92", "term in the square of the height (PARM 1)"),
        ("SURF 5\n", "SURF 5\n  STOP\n", ":38: stop: is a second stop; the first is surface 4"),
        ("GLAS F2 0 0 0 0", "GLAS ___BLANK 1 0 0.5 36", ":26: material"),
    ],
)  # fmt: skip
def test_what_is_not_supported(tmp_path, old, new, expected):
    assert expected in complaint(changed(tmp_path, old, new))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ": holds 0 surfaces: a lens needs one between the object and the image"),
        ("SURF 0\nSURF 1\n", ": holds 2 surfaces"),
        ("SURF 0\n  DISZ INFINITY\nSURF 1\n  DISZ 3\nSURF 2\n", ": holds no glass"),
    ],
)
def test_what_is_no_prescription(tmp_path, text, expected):
    assert expected in complaint(written(tmp_path, "lens.zmx", text))


@pytest.mark.parametrize("definition", ["", "SK16", "=1.5", "SK16=", "SK16=1.6/", "SK16=a/b", "SK16=1.6/1", "SK16=NN"])
def test_what_is_no_glass_option(definition):
    with pytest.raises(ValueError, match=r"^[^\n]+$"):
        parse_glasses([definition])


def test_files_that_cannot_be_read(tmp_path):
    assert "no such file" in complaint(tmp_path / "none.zmx")
    (tmp_path / "folder.dat").mkdir()
    assert "is a folder, not a lens file" in complaint(tmp_path / "folder.dat")
    assert "files that end in .dat or .zmx are" in complaint(written(tmp_path, "lens.seq", COOKE))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names are POSIX's")
@pytest.mark.parametrize("name", ["pipe.zmx", "pipe.dat"])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    assert "is no regular file" in complaint(tmp_path / name)


def test_any_number_of_lines_of_fields_is_read_in_its_time(tmp_path):
    # Each line once copied all fields before it: these took a quarter of an hour.
    text = COOKE.replace("YFLN", "XFLN 1\n" * 100_000 + "YFLN")
    assert import_lens(written(tmp_path, "fields.zmx", text)) == import_lens(written(tmp_path, "cooke.zmx", COOKE))


@pytest.mark.parametrize(("name", "text"), [("dgauss.dat", TABLE), ("cooke.zmx", COOKE)])
def test_what_is_imported_is_written_and_read_as_the_same_lens(tmp_path, name, text):
    path = written(tmp_path, name, text)
    spec = import_lens(path).spec
    again = written(tmp_path, "again.yaml", as_yaml(spec))
    assert read_prescription(again) == spec == read_prescription(path)
    assert read_lens(again) == read_lens(path) == spec.lens()


@pytest.mark.parametrize(("name", "text"), [("damaged.dat", TABLE), ("damaged.zmx", COOKE)])
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_damage_anywhere_is_a_sentence_at_worst(name, text, data, tmp_path_factory):
    broken = text.encode()
    for _ in range(data.draw(st.integers(1, 3))):
        place, cut = data.draw(st.integers(0, len(broken))), data.draw(st.integers(0, 12))
        broken = broken[:place] + data.draw(st.binary(max_size=4)) + broken[place + cut :]
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(broken)
    found = outcome(path)
    if isinstance(found, str):
        assert "\n" not in found
    else:
        assert constant_index_glass(1.0) == found.lens().elements[-1].glass
