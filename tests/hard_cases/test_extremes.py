"""Extreme numbers in every number of a scene: a clear error, or a finite picture."""

import copy
import itertools
import json
import math
import random
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numba
import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings

from docs.make_scenes import snippet
from raytracer.rendering.render import render
from raytracer.scene.load import build
from raytracer.scene.pack.scene import pack
from raytracer.scene.spec import SceneSpec
from raytracer.schema.registry import CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES, Family
from raytracer.util.errors import InputError, SceneError
from tests.hard_cases.random_scenes import SEEDS, Document, scenes, write_files
from tests.repository import ROOT

Keys: TypeAlias = tuple[str | int, ...]

EXTREMES = (0.0, -0.0, -1.0, 1e-300, 1e-30, 1e-12, 1e12, 1e30, 1e300, -1e30, math.inf, -math.inf, math.nan)

FAMILIES = (CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, MEDIA, SHAPES, TEXTURES)

QUICK = 120
"""Places and numbers that are tried in `make test`; all of them in `make test-slow`."""


def numbers_in(value: Any, keys: Keys = ()) -> Iterator[Keys]:
    """Find the places of a document's numbers."""
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers_in(item, (*keys, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield keys


def with_number(document: Document, keys: Keys, number: float) -> Document:
    """The document with another number in one place."""
    result = copy.deepcopy(document)
    holder: Any = result
    for key in keys[:-1]:
        holder = holder[key]
    holder[keys[-1]] = number
    return result


def text_of(document: Document) -> str:
    """As YAML, which has infinities and NaN by its own names."""
    text = json.dumps(document)
    for json_name, yaml_name in (("NaN", ".nan"), ("-Infinity", "-.inf"), ("Infinity", ".inf")):
        text = text.replace(json_name, yaml_name)
    return text


def loaded(document: Document, folder: Path) -> SceneSpec | None:
    """The scene, or None if it is refused in a sentence that says where."""
    try:
        return build(text_of(document), "scene.yaml", base=folder)
    except SceneError as error:
        message = str(error)
    assert message.startswith("scene.yaml:1: "), message
    return None


def _nans(value: Any, where: str = "scene") -> Iterator[str]:
    """Find the places of NaN in a packed scene."""
    if isinstance(value, tuple):
        for name, item in zip(getattr(value, "_fields", itertools.count()), value, strict=False):
            yield from _nans(item, f"{where}.{name}")
    elif isinstance(value, float | np.ndarray) and np.asarray(value).dtype.kind == "f" and np.isnan(value).any():
        yield where


def nans_of(document: Document, folder: Path) -> set[str]:
    """Find where a scene's numbers become NaN; nowhere, if it is refused."""
    spec = loaded(document, folder)
    try:
        return set() if spec is None else set(_nans(pack(spec).scene))
    except InputError:
        return set()


# ---- Every kind


def example(family: Family, kind: str) -> Document:
    """A scene with the piece of one that a kind's docstring shows."""
    piece = yaml.safe_load(snippet(sys.modules[family.specs()[kind].__module__].__doc__))
    ball: Document = {"type": "sphere", "center": [0, 0, 0], "radius": 1}
    document: Document = {
        "camera": {"type": "pinhole", "look_from": [0, 1, 5], "look_at": [0, 0, 0], "shutter": {"open": 0, "close": 1}},
        "film": {"width": 4, "height": 4},
        "render": {"spp": 4},
        "environment": {"type": "constant", "radiance": 1},
        "objects": [ball],
    }
    if family is MATERIALS:
        document["materials"] = piece
        document["objects"] = [{**ball, "material": name} for name in piece]
    elif family is MEDIA:
        document["media"] = piece
        document["objects"] = [{**ball, "medium": name} for name in piece]
    elif family is TEXTURES:
        document["textures"] = piece
        document["objects"] = [{**ball, "material": {"type": "lambertian", "albedo": name}} for name in piece]
    elif family is SHAPES:
        document["objects"] = piece
        document["groups"] = {item["of"]: [ball] for item in piece if "of" in item}
        document["materials"] = {item["material"]: {"type": "lambertian"} for item in piece if "material" in item}
    elif family is LIGHTS:
        document["lights"] = piece
    else:
        document.update(piece)
        document["film"] = {"width": 4, "height": 4, **document.get("film", {})}
    return document


def _has_files(value: Any) -> bool:
    """Tell if a document names files, which this test has not."""
    if isinstance(value, dict):
        return "file" in value or isinstance(value.get("placements"), str) or any(map(_has_files, value.values()))
    return isinstance(value, list) and any(map(_has_files, value))


def _cases() -> list[tuple[str, Document, Keys, float]]:
    """Every number of every kind that names no file, at every extreme."""
    result = []
    for family in FAMILIES:
        for kind in family.specs():
            document = example(family, kind)
            if _has_files(document):
                continue
            for keys in numbers_in(document):
                # A film of 1e12 pixels is refused; that of 268 million is not, and takes its time.
                result += [(f"{family.noun} {kind}", document, keys, number) for number in EXTREMES]
    return result


CASES = _cases()
SOME = random.Random(1).sample(CASES, QUICK)


def _try(cases: list[tuple[str, Document, Keys, float]], folder: Path) -> None:
    wrong = []
    # Some tables say by NaN that there is no such number.
    before = {id(document): nans_of(document, folder) for document in {id(case[1]): case[1] for case in cases}.values()}
    for kind, document, keys, number in cases:
        try:
            found = nans_of(with_number(document, keys, number), folder) - before[id(document)]
            assert not found, found
        except Exception as error:  # noqa: BLE001  # all are reported, not the first alone
            wrong.append(f"{kind} {'.'.join(map(str, keys))} = {number}: {error!r}")
    assert not wrong, f"{len(wrong)} of {len(cases)}:\n" + "\n".join(wrong)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With the lenses that cameras name."""
    shutil.copytree(ROOT / "scenes" / "lenses", tmp_path / "lenses")
    return tmp_path


def test_examples_are_valid(folder: Path) -> None:
    kinds = {id(document): (kind, document) for kind, document, *_ in CASES}
    refused = [kind for kind, document in kinds.values() if loaded(document, folder) is None]
    assert not refused


def test_a_number_is_refused_or_packed(folder: Path) -> None:
    _try(SOME, folder)


@pytest.mark.slow
def test_every_number_is_refused_or_packed(folder: Path) -> None:
    _try(CASES, folder)


# ---- Pictures


def _rendered_or_refused(document: Document, seed: int, folder: Path) -> None:
    """Render a scene with an extreme number, three times over, unless it is refused."""
    kind = numba.typeof(pack(build(text_of(document), "scene.yaml", base=folder)).scene)
    choice = random.Random(seed)
    places = [keys for keys in numbers_in(document) if keys[0] in ("camera", "objects", "environment")]
    for keys in choice.sample(places, 3):
        changed = with_number(document, keys, choice.choice(EXTREMES))
        spec = loaded(changed, folder)
        try:
            # One that has another type by this would be compiled for long.
            if spec is None or numba.typeof(pack(spec).scene) != kind:
                continue
            result = render(spec, seed=1, threads=2)
        except InputError:
            continue
        assert result.stats.nan_samples == 0, keys
        assert np.isfinite(result.image.radiance).all(), keys


@pytest.mark.slow
def test_many_numbers_are_refused_or_rendered(tmp_path: Path) -> None:
    write_files(tmp_path)

    @settings(max_examples=500, suppress_health_check=list(HealthCheck))
    @given(scenes(), SEEDS)
    def holds(document: Document, seed: int) -> None:
        _rendered_or_refused(document, seed, tmp_path)

    holds()
