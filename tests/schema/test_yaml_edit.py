"""Values are changed in the text of a file, and each byte that is not of the value stays."""

import pytest

from raytracer.schema.yaml_edit import edit_values
from raytracer.util.errors import InputError, SceneError

BLOCK = """\
# above
camera:   # of the scene
  type: thin_lens
  f_number: 2.8   # fast
  focus_on: ball  # the ball

  "sensor": {width: 36 mm,
             height: 24 mm}  # small
film: {width: 3}
"""


def changed(text, **values):
    return edit_values(text, {("camera", key): value for key, value in values.items()}, "scene.yaml")


@pytest.mark.parametrize(
    ("values", "before", "after"),
    [
        ({"f_number": 4.0}, "f_number: 2.8 ", "f_number: 4 "),
        ({"focus_on": "the far ball"}, "focus_on: ball ", "focus_on: the far ball "),
        ({"focus_on": "yes: no"}, "focus_on: ball ", "focus_on: 'yes: no' "),
        ({"focus_on": "1e3"}, "focus_on: ball ", "focus_on: '1e3' "),
        ({"focus_on": "12"}, "focus_on: ball ", "focus_on: '12' "),
        ({"focus_on": None, "focus_distance": float("inf")}, "focus_on: ball ", "focus_distance: inf "),
        ({"iso": 400.0}, "  type: thin", "  iso: 400\n  type: thin"),
        ({"iso": 0.0000125}, "  type: thin", "  iso: 1.25e-05\n  type: thin"),
        ({"focus_on": None}, "focus_on: ball  # the ball\n\n  ", ""),
        ({"sensor": "full_frame"}, "{width: 36 mm,\n             height: 24 mm} ", "full_frame "),
    ],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_a_value_in_a_block_is_changed_where_it_stands(values, before, after, newline):
    text = BLOCK.replace("\n", newline)
    expected = BLOCK.replace(before, after).replace("\n", newline)
    assert expected != text
    assert changed(text, **values) == expected


@pytest.mark.parametrize(
    ("values", "after"),
    [
        ({"f_number": 4.0}, "camera: {type: thin_lens,  f_number: 4,\n  focus_on: b }  # é"),
        ({"iso": 400.0}, "camera: {iso: 400, type: thin_lens,  f_number: 1/2,\n  focus_on: b }  # é"),
        ({"focus_on": None}, "camera: {type: thin_lens,  f_number: 1/2 }  # é"),
        (
            {"focus_on": None, "focus_distance": 2.5},
            "camera: {type: thin_lens,  f_number: 1/2,\n  focus_distance: 2.5 }  # é",
        ),
    ],
)
def test_a_value_between_braces_is_changed_where_it_stands(values, after):
    text = "camera: {type: thin_lens,  f_number: 1/2,\n  focus_on: b }  # é"
    assert changed(text, **values) == after


def test_what_an_alias_says_is_left_alone():
    with pytest.raises(InputError, match=r"scene\.yaml: camera\.f_number is said by an alias; change it by hand"):
        changed("a: &lens {f_number: 2}\ncamera: *lens\nother: *lens\n", f_number=4.0)
    assert changed("a: &lens {f_number: 2}\ncamera: {<<: *lens}\n", f_number=4.0) == (
        "a: &lens {f_number: 2}\ncamera: {f_number: 4, <<: *lens}\n"
    )


def test_what_is_no_mapping_or_no_yaml_is_refused():
    with pytest.raises(InputError, match="camera is no mapping to write to"):
        changed("camera: pinhole\n", f_number=4.0)
    with pytest.raises(SceneError, match=r"scene\.yaml:1: not valid YAML"):
        changed("camera: {a: [}\n", f_number=4.0)
