"""Names that others use, and what they are called here."""

from raytracer.scene.spec import SceneSpec
from raytracer.schema import registry
from raytracer.util.other_names import OTHER_NAMES, name_here


def families():
    return [value for value in vars(registry).values() if isinstance(value, registry.Family)]


def keys_of(spec):
    """All keys of a scene, a level down."""
    models = [field.annotation for field in spec.model_fields.values() if hasattr(field.annotation, "model_fields")]
    return set(spec.model_fields).union(*(model.model_fields for model in models))


def test_each_is_called_something_that_there_is():
    kinds = {name: spec for family in families() for name, spec in family.specs().items()}
    known = set(kinds).union(keys_of(SceneSpec), *(keys_of(spec) for spec in kinds.values()))
    for there, names in OTHER_NAMES.items():
        for here in names:
            assert set(here.split(" and ")) <= known, (there, here)


def test_what_is_known_in_a_place_is_meant():
    assert name_here("position", ["center", "radius"]) == "center"
    assert name_here("Position", ["look_from", "center"]) == "look_from"
    assert name_here("resolution", ["width"]) is None
    assert name_here("radius", ["radius"]) is None
