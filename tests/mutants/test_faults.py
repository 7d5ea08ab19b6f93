"""The list of seeded faults stays true to the package, wherever code moves."""

import ast

import pytest

from tests.mutants.__main__ import Fault, find_module, read_faults, read_sources, seed_fault
from tests.repository import ROOT

FAULTS = read_faults()
SOURCES = read_sources()


def test_there_are_many_faults_of_different_names() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 130


@pytest.mark.parametrize("area", dict.fromkeys(fault.area for fault in FAULTS))
def test_faults_can_be_seeded_and_their_tests_exist(area: str) -> None:
    for fault in FAULTS:
        if fault.area == area:
            assert fault.new != fault.old, fault.name
            ast.parse(seed_fault(fault, SOURCES[find_module(fault, SOURCES)]))
            assert fault.tests, fault.name
            assert not [test for test in fault.tests if not (ROOT / test).exists()], fault.name


def test_text_that_occurs_twice_or_never_is_no_fault():
    path = find_module(FAULTS[0], SOURCES)
    for sources in ({}, {path: 2 * SOURCES[path]}):
        with pytest.raises(ValueError, match="has to occur once"):
            find_module(FAULTS[0], sources)


def test_a_fault_is_chosen_by_its_name_or_area():
    fault = Fault("warps", "disc: too small", "a", "b", ("tests",))
    assert [fault.matches(pattern) for pattern in ("disc*", "warps", "cone*")] == [True, True, False]
