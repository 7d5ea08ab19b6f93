"""Every hard case: our error is within its tolerance, and that of the naive way is not."""

import pytest

from raytracer.scene.load import load
from raytracer.scene.pack.scene import pack
from tests.hard_cases.harness import SCENES, HardCase, cases

CASES = cases()
THOROUGH = [case for case in CASES if case.thorough > case.quick]


def _judge(case: HardCase, trials: int) -> None:
    found = case.measure(trials)
    assert found, "nothing was measured"
    for measured in found:
        assert measured.passes, f"{measured.what}: {measured.ours} is above {measured.tolerance}"
        assert measured.tells, f"{measured.what}: the naive way passes too, with {measured.naive}"


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_hard_case(case: HardCase) -> None:
    _judge(case, case.quick)


@pytest.mark.slow
@pytest.mark.parametrize("case", THOROUGH, ids=[case.name for case in THOROUGH])
def test_hard_case_thoroughly(case: HardCase) -> None:
    _judge(case, case.thorough)


def test_every_case_is_there() -> None:
    assert {case.number for case in CASES} == set(range(1, 48))


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.yaml")), ids=lambda path: path.stem)
def test_scenes_are_valid(path):
    assert pack(load(path)).scene.primitives


def test_scenes_are_those_of_the_cases() -> None:
    assert {case.scene for case in CASES if case.scene is not None} == {path.name for path in SCENES.glob("*.yaml")}
