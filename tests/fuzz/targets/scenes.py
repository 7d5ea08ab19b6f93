"""Scene files: YAML texts, and scenes put together from the schema; what is checked is packed, and is finite then.

Scenes with lenses of glass are left out: each kind of lens is compiled.  `lens` has the files of lenses.

An input that begins with a zero byte is taken for choices of the grammar, any other for a text.
"""

import contextlib
import tempfile
from pathlib import Path

import numpy as np

from raytracer.scene.json_schema import scene_schema
from raytracer.scene.load import build, load
from raytracer.scene.pack.scene import pack
from raytracer.scene.warnings import find_warnings, warning_messages
from raytracer.schema.yaml_parser import parse
from raytracer.util.errors import InputError
from tests.fuzz.harness import target
from tests.fuzz.targets._grammar import Choices, Grammar, written

_PLAIN = """\
camera: {type: thin_lens, look_from: [0, 0, 4], look_at: [0, 0, 0], vfov: 40 deg, aperture: 10 mm, focus_distance: 4}
film: {width: 8, height: 6}
render: {spp: 4}
materials: &a
  red: {type: lambertian, albedo: [0.8, 0.1, 1e-1]}
  both: {type: mixture, materials: [red, {type: dielectric, ior: 1.5}]}
groups: {pair: [{type: sphere, center: [0, 0, 0], radius: 1, material: red}]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: both, name: ball}
  - {type: instance, of: pair, transform: [{translate: [2, 0, 0]}, {rotate: {axis: [0, 1, 0], angle: 30}}]}
lights: [{type: point, position: [0, 4, 0], intensity: 10}]
"""

_OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
_FILES = ("mesh.obj", "grey.npy", "smoke.npy", "places.csv", "missing.ply", "mesh.obj#1", "..", "a\0b")
_WORDS = {
    **dict.fromkeys(("file", "placements", "lens"), _FILES),
    "of": ("one", "two", "ball"),
    "focus_on": ("ball", "one"),
    "name": ("ball", "box", "lamp"),
}
_LIMITS = {"width": 24, "height": 24, "count": 200, "spp": 64, "rows": 4, "columns": 4, "across": 4, "views": 4}

_ABSENT = (".threshold",)
"""Numbers of a packed scene that are NaN where there are none."""

_MOST_INSTANCES = 20_000
"""Of a scene that is packed: more would take time without meeting anything new."""


_BASES = (
    _PLAIN,
    """\
camera: {type: pinhole, look_from: [0, 1, 4], vfov: 40, shutter: {open: 0, duration: 0.5},
         motion: {keyframes: [{time: 0, transform: []}, {time: 1, transform: [{translate: [0, 1, 0]}]}]}}
film: {width: 6, height: 6, filter: {type: gaussian}}
environment: {type: gradient, horizon: [1, 1, 1], zenith: [0.5, 0.7, 1]}
textures: {board: {type: checker, scale: 0.5, even: [1, 1, 1], odd: [0, 0, 0]}, grain: {type: noise, scale: 2}}
materials: {floor: {type: lambertian, albedo: board}, wood: {type: principled, base_color: grain, roughness: 0.4}}
objects:
  - {type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: wood, motion: {velocity: [1, 0, 0]}}
  - {type: quad, corner: [-4, -1, -4], edges: [[8, 0, 0], [0, 0, 8]], material: floor}
  - {type: box, min: [1, 1, 1], max: [2, 2, 2], motion: {spin: {axis: [0, 1, 0], rate: 90}}}
lights:
  - {type: spot, position: [0, 4, 0], look_at: [0, 0, 0], angle: 30, intensity: 10}
  - {type: sun, direction: [0, 1, 1], irradiance: 3}
""",
    """\
camera: {type: fisheye, look_from: [0, 0, 4], look_at: [0, 0, 0], fov: 180}
film: {width: 6, height: 4}
environment: {type: constant, radiance: 1}
objects: [{type: mesh, file: mesh.obj, material: {type: dielectric, ior: N-BK7}, transform: [{scale: [1, 2, -1]}]}]
""",
    """\
camera: {type: thin_lens, look_from: [0, 0, 4], vfov: 30, f_number: 2, iso: 200, shutter: 1/60, focus_on: ball,
         sensor: {format: full_frame, noise: true}, aperture_shape: {type: polygon, blades: 6}}
film: {width: 6, height: 4}
environment: {type: sky, sun_elevation: 30}
media: {fog: {type: homogeneous, extinction: 0.1, albedo: 0.9}, smoke: {type: grid, file: smoke.npy, extinction: 3}}
medium: fog
materials: {shell: {type: cutout, material: steel, opacity: {type: image, file: grey.npy}},
            steel: {type: rough_conductor, metal: gold, roughness: 0.2}, glass: {type: rough_dielectric, ior: 1.5,
            roughness: 0.1}, lamp: {type: emitter, radiance: [4, 4, 4]},
            sides: {type: two_sided, front: steel, back: lamp}}
groups: {tree: [{type: disc, center: [0, 0, 0], normal: [0, 1, 0], radius: 1, material: sides},
                {type: triangle, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], material: lamp}]}
objects:
  - {type: sphere, name: ball, center: [0, 0, 0], radius: 1, material: glass, medium: smoke}
  - {type: scatter, of: tree, count: 20, seed: 1, corner: [-5, 0, -5], edges: [[10, 0, 0], [0, 0, 10]], spacing: 0.5}
  - {type: instance, of: tree, placements: places.csv, material: shell}
""",
    """\
camera: {type: camera_array, look_from: [0, 0, 4], rows: 2, columns: 2, spacing: 0.1, vfov: 40}
film: {width: 6, height: 4}
objects: [{type: sphere, center: [0, 0, 0], radius: 1, material: {type: mixture, weight: 0.3,
          materials: [{type: metal, albedo: 0.8}, {type: thin_dielectric, ior: 1.3}]}}]
lights: [{type: flash, energy: 1}]
""",
    """\
camera: {type: light_field, look_from: [0, 0.2, 1], sensor: {width: 24 mm, height: 18 mm}, focal_length: 80 mm,
         f_number: 4, focus_distance: 1, microlenses: {pixels: 6}}
film: {width: 24, height: 18}
objects: [{type: sphere, center: [0, 0, 0], radius: 0.1}]
""",
)


def _folder():
    """Files that scenes may name."""
    folder = Path(tempfile.mkdtemp(prefix="rt-fuzz-scene-"))
    (folder / "mesh.obj").write_text(_OBJ)
    (folder / "places.csv").write_text("x,y,z,scale\n0,0,0,1\n2,0,0,0.5\n")
    np.save(folder / "grey.npy", np.full((2, 3, 3), 0.5, np.float32))
    np.save(folder / "smoke.npy", np.ones((2, 2, 2), np.float32))
    return folder


# Made now, and not while an input is timed.
FOLDER = _folder()
_GRAMMAR = Grammar(scene_schema(), _WORDS, _LIMITS)
_VALUES = [build(text, "base.yaml", base=FOLDER) and parse(text, "base.yaml").plain() for text in _BASES]


def _chosen(data):
    """The scene that an input stands for, as YAML: one of the schema, or a valid one with a few changes."""
    choices = Choices(data)
    if choices.byte() % 16 == 0:
        return written(_GRAMMAR.value(choices))
    return written(_GRAMMAR.changed(choices.one_of(_VALUES), choices, 1 + choices.byte() % 4))


def _seeds():
    yield _PLAIN.encode()
    yield _PLAIN.replace("\n", "\r\n").encode("utf-8-sig")
    # Choices of which the first is no whole scene, the second a valid one, and the others change nothing that matters.
    for number in range(len(_BASES)):
        for change in (b"", b"\x00\x02\x01\x01\x01\x01\x02\x03"):
            seed = bytes((0, 1, number)) + change
            with contextlib.suppress(InputError):
                load_scene(seed, FOLDER)
                yield seed


_DICTIONARY = (
    "camera:~film:~objects:~materials:~groups:~type: ~<<: *a~&a ~*a~!!python/name:~|-~.inf~.nan~1e308~0x~? ~- ~[[[[~"
    "{a: ~\r\n~\ufeff~---\n~%YAML 1.1\n~\\x1b"
)


@target("scene", seeds=_seeds, words=_DICTIONARY)
def load_scene(data, folder):
    if data[:1] == b"\0":
        scene = build(_chosen(data[1:]), "scene.yaml", base=FOLDER)
    else:
        (folder / "scene.yaml").write_bytes(data)
        scene = load(folder / "scene.yaml")
    copies = sum(getattr(item, "count", None) or 1 for item in scene.objects)
    if scene.film.width * scene.film.height > 2**20 or copies > _MOST_INSTANCES:
        return
    packed = pack(scene)
    for name, value in _leaves(packed.scene, "scene"):
        assert name.endswith(_ABSENT) or not np.isnan(value).any(), f"{name} holds what is no number"
    for number, geometry in packed.objects.geometries.items():
        assert all(np.isfinite(vertices).all() for vertices in geometry.vertices), f"geometry {number}"
    assert all(np.isfinite(poses).all() for placed in packed.objects.placements for poses in placed.poses)
    for sentence in warning_messages(find_warnings(packed)):
        assert sentence.isprintable(), sentence


def _leaves(value, name):
    """Numbers and arrays of them in named tuples, tuples and mappings."""
    if isinstance(value, float | np.ndarray) and np.asarray(value).dtype.kind == "f":
        yield name, value
    elif isinstance(value, dict | tuple):
        keys = getattr(value, "_fields", value if isinstance(value, dict) else range(len(value)))
        for key, item in zip(keys, value.values() if isinstance(value, dict) else value, strict=True):
            yield from _leaves(item, f"{name}.{key}")
