"""Extreme numbers in every number of a scene: a clear error, or a finite picture."""

import itertools
import json
import math
import random
import shutil
import sys

import numba
import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings

from docs.make_scenes import snippet
from raytracer.rendering.render import render
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.schema.registry import CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES
from raytracer.util.errors import InputError, SceneError
from tests.hard_cases.random_scenes import SEEDS, plain, scenes, write_files
from tests.repository import ROOT

EXTREMES = (0.0, -0.0, -1.0, 1e-300, 1e-30, 1e-12, 1e12, 1e30, 1e300, -1e30, math.inf, -math.inf, math.nan)

FAMILIES = (CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES)

QUICK = 120
"""Places and numbers that are tried in `make test`; all of them in `make test-slow`."""


def numbers_in(value, keys=()):
    """Find the places of a document's numbers."""
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers_in(item, (*keys, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield keys


def with_number(document, keys, number):
    """The document with another number in one place."""
    result = holder = plain(document)
    for key in keys[:-1]:
        holder = holder[key]
    holder[keys[-1]] = number
    return result


def loaded(document, folder):
    """The scene, or None if it is refused in a sentence that says where."""
    text = json.dumps(document)
    # YAML has infinities and NaN by its own names.
    for json_name, yaml_name in (("NaN", ".nan"), ("-Infinity", "-.inf"), ("Infinity", ".inf")):
        text = text.replace(json_name, yaml_name)
    try:
        return build(text, "scene.yaml", base=folder)
    except SceneError as error:
        message = str(error)
    assert message.startswith("scene.yaml:1: "), message
    return None


def _nans(value, where="scene"):
    """Find the places of NaN in a packed scene."""
    if isinstance(value, tuple):
        for name, item in zip(getattr(value, "_fields", itertools.count()), value, strict=False):
            yield from _nans(item, f"{where}.{name}")
    elif isinstance(value, float | np.ndarray) and np.asarray(value).dtype.kind == "f" and np.isnan(value).any():
        yield where


def nans_of(document, folder):
    """Find where a scene's numbers become NaN; nowhere, if it is refused."""
    spec = loaded(document, folder)
    try:
        return set() if spec is None else set(_nans(pack(spec).scene))
    except InputError:
        return set()


# ---- Every kind

BALL = {"type": "sphere", "center": [0, 0, 0], "radius": 1}
VIEW = {"type": "pinhole", "look_from": [0, 1, 5], "look_at": [0, 0, 0], "shutter": {"open": 0, "close": 1}}


def example(family, kind):
    """A scene with the piece of one that a kind's docstring shows."""
    piece = yaml.safe_load(snippet(sys.modules[family.specs()[kind].__module__].__doc__))
    if family is MATERIALS:
        own = {"materials": piece, "objects": [{**BALL, "material": name} for name in piece]}
    elif family is MEDIA:
        own = {"media": piece, "objects": [{**BALL, "medium": name} for name in piece]}
    elif family is TEXTURES:
        grey = {"type": "lambertian"}
        own = {"textures": piece, "objects": [{**BALL, "material": {**grey, "albedo": name}} for name in piece]}
    elif family is SHAPES:
        groups = {item["of"]: [BALL] for item in piece if "of" in item}
        materials = {item["material"]: {"type": "lambertian"} for item in piece if "material" in item}
        own = {"objects": piece, "groups": groups, "materials": materials}
    else:
        own = {"lights": piece} if family is LIGHTS else piece
    film = {"width": 4, "height": 4, **own.get("film", {})}
    environment = {"type": "constant", "radiance": 1}
    document = {"camera": VIEW, "render": {"spp": 4}, "environment": environment, "objects": [BALL], **own}
    return {**document, "film": film}


def _has_files(value):
    """Tell if a document names files, which this test has not."""
    if isinstance(value, dict):
        return "file" in value or isinstance(value.get("placements"), str) or any(map(_has_files, value.values()))
    return isinstance(value, list) and any(map(_has_files, value))


KINDS = {f"{family.noun} {kind}": example(family, kind) for family in FAMILIES for kind in family.specs()}
EXAMPLES = {kind: document for kind, document in KINDS.items() if not _has_files(document)}

# Each number, at each extreme.  A film of 1e12 pixels is refused; that of 268 million is not, and takes its time.
CASES = [
    (kind, keys, number) for kind, document in EXAMPLES.items() for keys in numbers_in(document) for number in EXTREMES
]
SOME = random.Random(1).sample(CASES, QUICK)


@pytest.fixture
def folder(tmp_path):
    """With the lenses that cameras name."""
    shutil.copytree(ROOT / "scenes" / "lenses", tmp_path / "lenses")
    return tmp_path


def test_examples_are_valid(folder):
    assert not [kind for kind, document in EXAMPLES.items() if loaded(document, folder) is None]


def _try(cases, folder):
    wrong = []
    # Some tables say by NaN that there is no such number.
    before = {kind: nans_of(EXAMPLES[kind], folder) for kind in {kind for kind, *_ in cases}}
    for kind, keys, number in cases:
        try:
            found = nans_of(with_number(EXAMPLES[kind], keys, number), folder) - before[kind]
            assert not found, found
        except Exception as error:  # noqa: BLE001  # all are reported, not the first alone
            wrong.append(f"{kind} {'.'.join(map(str, keys))} = {number}: {error!r}")
    assert not wrong, f"{len(wrong)} of {len(cases)}:\n" + "\n".join(wrong)


def test_a_number_is_refused_or_packed(folder):
    _try(SOME, folder)


@pytest.mark.slow
def test_every_number_is_refused_or_packed(folder):
    _try(CASES, folder)


# ---- Pictures


@pytest.mark.slow
def test_many_numbers_are_refused_or_rendered(tmp_path):
    write_files(tmp_path)

    @settings(max_examples=500, suppress_health_check=list(HealthCheck))
    @given(scenes(), SEEDS)
    def holds(document, seed):
        """Render a scene with an extreme number, three times over, unless it is refused."""
        kind = numba.typeof(pack(loaded(document, tmp_path)).scene)
        choice = random.Random(seed)
        places = [keys for keys in numbers_in(document) if keys[0] in ("camera", "objects", "environment")]
        for keys in choice.sample(places, 3):
            spec = loaded(with_number(document, keys, choice.choice(EXTREMES)), tmp_path)
            try:
                # One that has another type by this would be compiled for long.
                if spec is None or numba.typeof(pack(spec).scene) != kind:
                    continue
                result = render(spec, seed=1, threads=2)
            except InputError:
                continue
            assert result.stats.nan_samples == 0, keys
            assert np.isfinite(result.image.radiance).all(), keys

    holds()
