"""Families find their kinds by looking; the contract's kinds are there."""

import sys

import pytest
from pydantic import TypeAdapter, ValidationError

from raytracer.schema.registry import (
    APERTURES,
    CAMERAS,
    ENVIRONMENTS,
    FILTERS,
    LIGHTS,
    MATERIALS,
    MEDIA,
    SHAPES,
    TEXTURES,
    Family,
)
from raytracer.schema.validation_errors import error_sentence

KIND = """
from typing import Literal
from raytracer.schema.fields import Number
from raytracer.schema.spec import Spec

class {name}(Spec):
    type: Literal["{type}"] = "{type}"
    value: Number = 0.0
"""


def complaint(family, value):
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(family.union()).validate_python(value)
    return error_sentence(caught.value.errors()[0])


def test_a_new_file_is_a_new_kind(package):
    (package / "zebra.py").write_text(KIND.format(name="Zebra", type="zebra"))
    (package / "ant.py").write_text(KIND.format(name="Ant", type="ant"))
    (package / "borrower.py").write_text("from things.ant import Ant\n")
    family = Family("thing", "things")
    assert list(family.specs()) == ["ant", "zebra"]
    thing = TypeAdapter(family.union()).validate_python({"type": "zebra", "value": 3})
    assert type(thing).__name__ == "Zebra"
    assert thing.value == 3.0


def test_two_kinds_of_one_name_are_refused(package):
    (package / "one.py").write_text(KIND.format(name="One", type="same"))
    (package / "two.py").write_text(KIND.format(name="Two", type="same"))
    with pytest.raises(TypeError, match="two kinds are called 'same'"):
        Family("thing", "things").specs()


def test_a_wrong_type_is_told_however_many_kinds_there_are(package):
    assert "there are no types" in complaint(Family("thing", "things"), {"type": "sphere"})
    for name in ("sphere", "box"):
        (package / f"{name}.py").write_text(KIND.format(name=name.title(), type=name))
        family = Family("thing", "things")
        assert "unknown type of thing 'sphree'; did you mean 'sphere'?" in complaint(family, {"type": "sphree"})
        assert "needs a type, one of" in complaint(family, {"value": 3})
        assert "got a list of 0" in complaint(family, [])


def test_a_kind_is_imported_when_it_is_named(package):
    for name in ("ant", "zebra"):
        (package / f"{name}.py").write_text(KIND.format(name=name.title(), type=name))
    (package / "many.py").write_text(KIND.format(name="Gnu", type="gnu"))
    family = Family("thing", "things")
    thing = TypeAdapter(family.union()).validate_python({"type": "zebra"})
    assert "things.ant" not in sys.modules
    assert family.spec("zebra") is type(thing)
    # A kind whose module has another name is found by looking into all.
    assert family.spec("gnu").__name__ == "Gnu"
    with pytest.raises(KeyError):
        family.spec("yak")


FAMILIES = (APERTURES, CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.noun)
def test_every_kind_documents_itself_and_its_keys(family):
    assert len(family.specs()) >= 2
    if family in (CAMERAS, MATERIALS, MEDIA, SHAPES, TEXTURES):
        assert family.modules == {name: spec.__module__ for name, spec in family.specs().items()}
    for name, spec in family.specs().items():
        assert spec.__doc__, f"{name} has no description"
        for key, field in spec.model_fields.items():
            assert key == "type" or field.description, f"{name}.{key} has no description"
