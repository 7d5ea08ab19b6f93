"""Kinds of warnings: found by looking, in order, and complete."""

import string

import pytest

from docs.make_warnings import all_warning_kinds
from raytracer.schema.warning_kind import Sentence, WarningFamily, WarningRecord

KIND = """\
from raytracer.schema.warning_kind import Sentence, WarningKind

class {name}(WarningKind):
    name, section, rank = "{name}s", "Numbers", {rank}
    large = Sentence("{{number:g}} is large: {{remedy}}", when="it is above 10", remedy="take {{least}}")

    def find(self, subject):
        if subject > 10:
            yield self.record(self.large.fill(number=subject, least={rank}), "here")
"""

KINDS = all_warning_kinds()


def test_a_new_file_is_a_new_kind(package):
    (package / "ant.py").write_text(KIND.format(name="Ant", rank=2))
    (package / "zebra.py").write_text(KIND.format(name="Zebra", rank=1))
    (package / "borrower.py").write_text("from things.ant import Ant\n")
    (package / "base").mkdir()
    (package / "base" / "__init__.py").write_text(KIND.format(name="Base", rank=3))
    family = WarningFamily[float]("things")
    assert family.find(5.0) == []
    assert family.find(12.0) == [
        WarningRecord("Zebras", ("here",), "12 is large: take 1"),
        WarningRecord("Ants", ("here",), "12 is large: take 2"),
    ]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: type(kind).__name__)
def test_every_kind_is_complete(kind):
    assert kind.name
    assert kind.section
    assert kind.sentences()
    for sentence in kind.sentences():
        assert sentence.when
        assert sentence.remedy
        # What is not in the sentence is for the manual alone, which has no values.
        if "{remedy}" not in sentence.text:
            assert not _fields(sentence.remedy)


def test_kinds_have_an_order_and_their_sentences_differ():
    places = [(kind.__module__.rpartition(".")[0], kind.rank) for kind in KINDS]
    assert len(set(places)) == len(places)
    texts = [sentence.text for kind in KINDS for sentence in kind.sentences()]
    assert len(set(texts)) == len(texts) > 50


def test_values_may_hold_braces():
    assert Sentence("{name} is odd: {remedy}", "", "leave {name} out").fill(name="{x}") == "{x} is odd: leave {x} out"


def _fields(template):
    return {field for _, field, _, _ in string.Formatter().parse(template) if field is not None}
