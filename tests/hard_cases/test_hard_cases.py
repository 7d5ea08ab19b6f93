"""Every hard case: our error is within its tolerance, and that of the naive way is not; and the page that tells so."""

import math
import re

import pytest

from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from tests.hard_cases.__main__ import BEGIN, END, PAGE, Cost, figure, markdown, measured, rows_of, write
from tests.hard_cases.harness import SCENES, HardCase, cases

CASES = {case.name: case for case in cases()}
THOROUGH = [name for name, case in CASES.items() if case.thorough > case.quick]


def _judge(found):
    assert found, "nothing was measured"
    for row in found:
        assert row.passes, f"{row.what}: {row.ours} is above {row.tolerance}"
        assert row.tells, f"{row.what}: the naive way passes too, with {row.naive}"


@pytest.mark.parametrize("name", CASES)
def test_hard_case(name):
    _judge(CASES[name].measure(CASES[name].quick))


@pytest.mark.slow
@pytest.mark.parametrize("name", THOROUGH)
def test_hard_case_thoroughly(name):
    _judge(CASES[name].measure(CASES[name].thorough))


def test_every_case_and_scene_is_there_and_on_the_page():
    assert {case.number for case in CASES.values()} == set(range(1, 48))
    assert {case.scene for case in CASES.values() if case.scene is not None} == {p.name for p in SCENES.glob("*.yaml")}
    text = PAGE.read_text(encoding="utf-8")
    missing = [name for name, case in CASES.items() if f"| {case.number}. {case.title} |" not in text]
    assert not missing, "run `make hard-cases`"
    assert "FAILS" not in text


def test_what_is_explained_is_in_the_table():
    table = PAGE.read_text(encoding="utf-8")
    text = PAGE.with_name("hard-cases.md").read_text(encoding="utf-8")
    told = re.findall(r"^> \*(.*)\*: naive (\S+), ours (\S+) \(case (\d+)\)$", text, re.MULTILINE)
    assert len(told) == text.count("\n> ") == 12
    for what, naive, ours, number in told:
        (rows,) = re.findall(rf"((?:^\| {number}\. .*\n(?:^\|  \|.*\n)*)+)", table, re.MULTILINE)
        assert f"| {what} | {naive} | {ours} |" in rows, what
    counts = (
        f"{len({case.number for case in CASES.values()})} cases with {table.count(' | passes | ')} such measurements"
    )
    assert counts in " ".join(text.split())
    for scene, words in (("cover", "the cover takes {} times"), ("million", "triangles {} times")):
        (cost,) = re.findall(rf"^\| `scenes/{scene}\.yaml` \| (\S+) ", table, re.MULTILINE)
        assert words.format(cost) in " ".join(text.split())


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.yaml")), ids=lambda path: path.stem)
def test_scenes_are_valid(path):
    assert pack(load(path)).scene.primitives


# ---- The table


def _case(*rows):
    def made_up(trials):
        """A made-up case.

        More words.
        """
        yield from rows

    return HardCase(3, "03_made_up", "a book", made_up, 1, 1, "03_ground.yaml")


RIGHT = ("misses", 0.5, 0.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-0.0, "0"), (123456.0, "123,456"), (0.00012345, "0.00012"), (math.inf, "inf"), (math.nan, "NaN")],
)
def test_figures_are_short(value, text):
    assert figure(value) == text


@pytest.mark.parametrize(
    ("row", "word"),
    [
        (RIGHT, "passes"),
        (("error", 1.0, 2e-5, 1e-5), "FAILS"),
        (("tells nothing", 0.0, 0.0), "FAILS: the naive way passes"),
        (("no number", math.nan, math.nan, 1.0), "FAILS"),
    ],
)
def test_a_row_tells_whether_it_passes(row, word):
    finding = measured(_case(("first", 1, 0), row), quick=True)
    assert [line[5] for line in rows_of(finding)] == ["passes", word]
    assert finding.passes == (word == "passes")


def test_errors_of_one_name_are_one():
    counts = ("misses", [True, True, False], 1), ("misses", 3, [False, True])
    errors = ("off (m)", [0.5, -2.0], 0.1, 0.3), ("off (m)", 1.0, -0.2, 0.2), ("off", 0.0, [1.0, math.nan])
    found = _case(*counts, *errors).measure(1)
    assert found[:2] == [("misses", 5, 2, 0.0), ("off (m)", 2.0, 0.2, 0.3)]
    assert math.isnan(found[2].ours)


def test_a_case_that_raises_is_told_and_fails():
    finding = measured(_case(RIGHT, ("too few", 1.0)), quick=True)
    assert not finding.passes
    assert rows_of(finding)[0][1].startswith("ValueError: not enough values")


def test_what_was_measured_takes_its_place_in_the_page(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}old\n{END}after\n")
    finding = measured(_case(RIGHT, ("z of |x|", 1.0, 0.0)), quick=True)._replace(cost=Cost(1.25, 1.2, 1.3))
    write(page, markdown([finding], {"cover": Cost(1.1, 1.0, 1.2)}, "a machine"))
    text = page.read_text()
    assert text.startswith(f"before\n{BEGIN}")
    assert text.endswith(f"{END}after\n")
    assert "old" not in text
    # A case is named once, with its cost.
    assert "\n| 3. A made-up case | misses | 0.5 | 0 | 0 | passes | 1.25 (1.20 .. 1.30) |\n" in text
    assert "\n|  | z of \\|x\\| | 1 | 0 | 0 | passes |  |\n" in text
    page.write_text("no place")
    with pytest.raises(ValueError, match="no place for a table"):
        write(page, "text")
