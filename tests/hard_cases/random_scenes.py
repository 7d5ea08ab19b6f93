"""Random scenes for properties, and what may be done to a scene without changing its picture.

Scenes are made of what all sees itself at a sensible angle: an object as near as a thousandth of the scene's scale and
one a thousand times as far as it may stand side by side in the picture, and the scale goes over twelve decades.  All of
them have one type, so that one kernel renders them: each kind of primitive, material and motion is in each scene, if
need be as a speck behind the camera.
"""

import json
import math
from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st

from raytracer.scene.load import build
from raytracer.schema.transform import Step, Transform, matrix_of

PIXELS = 8
SPP = 64
DEPTH = 8

_TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
_MESH = "tetrahedron.obj"


class Frame(NamedTuple):
    """A camera: where it is, its axes (right, up, along) as rows (3, 3), and the tangent of half its angle of view."""

    eye: Any
    axes: Any
    tangent: float

    def point(self, x, y, depth):
        """Return the point that is seen at x, y from -1 to 1, at a depth along the axis."""
        return self.eye + depth * np.array([x * self.tangent, y * self.tangent, 1.0]) @ self.axes


def plain(document):
    """A copy of a document, with lists in place of arrays."""
    return json.loads(json.dumps(document, default=np.ndarray.tolist))


# ---- Parts

SEEDS = st.integers(0, 2**32 - 1)
"""Of lengths and angles: hypothesis likes equal numbers, which would put surfaces on one another; kinds are its own."""


def direction(random):
    """A unit vector, evenly over the sphere."""
    vector = random.normal(size=3)
    return vector / np.linalg.norm(vector)


def decades(random, low, high):
    """A number from 10^low to 10^high, evenly over the decades."""
    return float(10.0 ** random.uniform(low, high))


def _across(vector, random):
    """A unit vector at right angles to another."""
    other = np.cross(vector, direction(random))
    return other / np.linalg.norm(other)


def _frame(random, size):
    """A camera within a scene's scale from the origin."""
    along = direction(random)
    right = _across(along, random)
    eye = size * random.random() * direction(random)
    return Frame(eye, np.array([right, np.cross(right, along), along]), math.tan(math.radians(random.uniform(5, 60))))


def _material(draw, random, *, lamps):
    """Any material that these scenes have; the limits of its ranges as often as what is between."""
    kind = draw(st.sampled_from(("lambertian", "metal", "dielectric", "rough_conductor") + ("emitter",) * lamps))
    if kind == "dielectric":
        return {"type": kind, "ior": draw(st.sampled_from((1.5, random.uniform(1.01, 3.0))))}
    if kind == "emitter":
        return {"type": kind, "radiance": random.uniform(0.0, 3.0, 3)}
    albedo = draw(st.sampled_from(([1.0] * 3, [0.0] * 3, random.random(3).tolist())))
    if kind == "lambertian":
        return {"type": kind, "albedo": albedo}
    roughness = draw(st.sampled_from((0.0, 1.0, random.random())))
    return {"type": kind, "albedo": albedo, "fuzz" if kind == "metal" else "roughness": roughness}


_SHAPES = ("sphere", "triangle", "quad", "disc", "box", "mesh", "egg")


def _shape(kind, random, middle, size):
    """A shape of about this size and round about this place."""
    axis = direction(random)
    a, b = size * axis, size * decades(random, -1.0, 0.0) * _across(axis, random)
    if kind == "sphere":
        return {"type": "sphere", "center": middle, "radius": size * random.choice((1.0, 1.0, -1.0))}
    if kind == "triangle":
        return {"type": "triangle", "vertices": [middle - a, middle + a, middle + b]}
    if kind == "quad":
        return {"type": "quad", "corner": middle - 0.5 * (a + b), "edges": [a, b]}
    if kind == "disc":
        return {"type": "disc", "center": middle, "normal": axis, "radius": size}
    turn = {"rotate": {"axis": axis, "angle": random.uniform(0.0, 360.0)}}
    move = {"translate": middle}
    half = size * np.array([1.0, decades(random, -1.0, 0.0), decades(random, -1.0, 0.0)])
    if kind == "box":
        return {"type": "box", "min": -half, "max": half, "transform": [turn, move]}
    if kind == "mesh":
        return {"type": "mesh", "file": _MESH, "transform": [{"scale": size}, turn, move]}
    return {"type": "sphere", "center": [0.0] * 3, "radius": size, "transform": [{"scale": half / size}, turn, move]}


_MOTIONS = ("none", "none", "none", "velocity", "velocity", "spin", "spin", "keyframes")
"""By how often: it takes long to pack what goes by keyframes."""


def _motion(kind, random, shape, middle, size):
    """Draw the motion of a shape while the shutter is open, from 0 s to 1 s: about its own size."""
    if kind == "keyframes":
        # Two poses of a shape that is at its own origin: it goes and turns and grows.
        turn = {"rotate": {"axis": direction(random), "angle": random.uniform(-170.0, 170.0)}}
        grow = {"scale": random.uniform(0.5, 2.0)}
        last = [turn, grow, {"translate": middle + size * direction(random)}]
        return {"keyframes": [{"time": 0.0, "transform": [{"translate": middle}]}, {"time": 1.0, "transform": last}]}
    way = size * direction(random)
    if kind == "velocity" and shape["type"] == "sphere" and "transform" not in shape:
        return {"velocity": way}
    spin = {"axis": direction(random), "rate": random.uniform(-720.0, 720.0), "center": middle}
    return {"spin": spin, "velocity": way}


def _specks(frame, size):
    """Every kind that there is, too small to be met.

    Two of them share a group and differ by their material, and lie far out in a space of their own: so all scenes have
    the type of those with such instances, and of those that are recentred.
    """
    small = 1e-3 * size
    at = [frame.point(0.0, 0.0, -(90.0 + number) * size) for number in range(8)]
    x, y = small * frame.axes[0], small * frame.axes[1]
    far = np.array([1e6 * size, 0.0, 0.0])
    steps = [[{"scale": [1.0, 2.0, 1.0]}, {"translate": middle - far}] for middle in (at[4], at[5])]
    still, grey = {"type": "sphere", "radius": small}, {"type": "lambertian"}
    disc = {"type": "disc", "center": at[1], "normal": [0.0, 1.0, 0.0], "radius": small}
    spin = {"axis": [0, 1, 0], "rate": 90, "center": at[7]}
    return [
        {**still, "center": at[0], "material": grey},
        {**disc, "material": {"type": "rough_conductor", "albedo": 0.5, "roughness": 0.5}},
        {"type": "quad", "corner": at[2], "edges": [x, y], "material": {"type": "dielectric"}},
        {"type": "triangle", "vertices": [at[3] + by for by in (0, x, y)], "material": {"type": "metal"}},
        {**still, "center": far, "transform": steps[0], "material": {"type": "emitter", "radiance": 1e-30}},
        {**still, "center": far, "transform": steps[1], "material": grey},
        {**still, "center": at[6], "motion": {"velocity": x}, "material": grey},
        {**still, "center": at[7], "motion": {"spin": spin}, "material": grey},
    ]


# ---- Scenes


def _ground(random, frame, size, kind):
    """Draw a ground that reaches as far as can be seen: a planet, or a plane."""
    height, reach = size * decades(random, -1.0, 0.0), size * decades(random, 1.0, 3.0)
    right, up, along = frame.axes
    below = frame.eye - height * up
    if kind == "planet":
        return {"type": "sphere", "center": below - reach * up, "radius": reach}
    corner = below - 0.5 * reach * (right + along)
    return {"type": "quad", "corner": corner, "edges": [reach * along, reach * right]}


@st.composite
def scenes(draw):
    """Scenes, as documents."""
    random = np.random.default_rng(draw(SEEDS))
    size = decades(random, -6.0, 6.0)
    frame = _frame(random, size)
    lens = {"focus_distance": size * decades(random, -3.0, 3.0), "defocus_angle": decades(random, -2.0, 1.0)}
    radiance = random.uniform(0.1, 1.0, 3)
    objects = []
    for number in range(draw(st.integers(1, 6))):
        own = np.random.default_rng([number, draw(SEEDS)])
        depth = size * decades(own, -3.0, 3.0)
        middle = frame.point(own.uniform(-1.0, 1.0), own.uniform(-1.0, 1.0), depth)
        extent = depth * frame.tangent * decades(own, -1.0, 0.0)
        motion = draw(st.sampled_from(_MOTIONS))
        shape = _shape(draw(st.sampled_from(_SHAPES)), own, np.zeros(3) if motion == "keyframes" else middle, extent)
        if motion != "none":
            shape["motion"] = _motion(motion, own, shape, middle, 0.5 * extent)
        objects.append({**shape, "name": f"object {number}", "material": _material(draw, own, lamps=True)})
    kind = draw(st.sampled_from(("none", "planet", "plane")))
    if kind != "none":
        made = _material(draw, random, lamps=False)
        objects.append({**_ground(random, frame, size, kind), "name": "ground", "material": made})
    camera = {
        "type": "thin_lens",
        "look_from": frame.eye,
        "look_at": frame.point(0.0, 0.0, size),
        "up": frame.axes[1],
        "vfov": 2.0 * math.degrees(math.atan(frame.tangent)),
        **lens,
        "shutter": {"open": 0.0, "close": 1.0},
    }
    result = {
        "camera": camera,
        "film": {"width": PIXELS, "height": PIXELS},
        "render": {"spp": SPP, "max_depth": DEPTH, "rr_depth": 1000, "sampler": "independent"},
        "environment": {"type": "constant", "radiance": radiance},
        "objects": objects + _specks(frame, size),
    }
    return plain(result)


def write_files(folder):
    """Write what scenes name into a folder."""
    (folder / _MESH).write_text(_TETRAHEDRON)


def spec_of(document, folder):
    """The checked scene."""
    return build(json.dumps(document), "scene.yaml", base=folder)


def in_a_furnace(document):
    """The scene in light from all around alike, of the radiance 1, and with white things in place of lamps."""
    result = plain(document)
    result["environment"]["radiance"] = [1.0] * 3
    for item in result["objects"]:
        if "name" in item and item["material"]["type"] == "emitter":
            item["material"] = {"type": "lambertian", "albedo": 1.0}
    return result


def middles(document):
    """About where the objects are that are no specks (n, 3), those that their own transform puts there included."""
    result = []
    for item in document["objects"]:
        if "name" not in item:
            continue
        point = np.array(item.get("center") or item.get("corner") or item.get("vertices", [[0.0] * 3])[0])
        holder = item.get("motion", {}).get("keyframes", [item])[0]
        for step in holder.get("transform", ()):
            point = matrix_of(Transform((Step(**step),)))[:3] @ np.append(point, 1.0)
        result.append(point)
    return np.array(result)


# ---- What changes no picture


def _changed(document, step, point, vector, length=1.0):
    """The scene after a step of a transform.

    Parameters
    ----------
    point, vector : functions of (3,), what the step does to points, and to differences of them.
    length : by how much it makes things longer.
    """
    result = plain(document)

    def change(holder, function, *keys):
        for key in keys:
            if key in holder:
                holder[key] = function(np.array(holder[key]))

    camera = result["camera"]
    change(camera, point, "look_from", "look_at")
    change(camera, vector, "up")
    camera["focus_distance"] *= length
    for item in result["objects"]:
        motion = item.get("motion", {})
        # What happens last is the pose of a keyframe.
        for holder in motion.get("keyframes", [item]):
            holder["transform"] = [*holder.get("transform", ()), step]
        change(motion, vector, "velocity")
        change(motion.get("spin", {}), vector, "axis")
        change(motion.get("spin", {}), point, "center")
    return plain(result)


def translated(document, shift):
    """The scene moved by a vector (m)."""
    return _changed(document, {"translate": shift}, lambda p: p + shift, lambda v: v)


def rotated(document, axis, degrees):
    """The scene turned about an axis through the origin."""
    step = {"rotate": {"axis": list(axis), "angle": degrees}}
    matrix = Step(**step).matrix()[:3, :3]
    return _changed(document, step, lambda p: matrix @ p, lambda v: matrix @ v)


def scaled(document, factor):
    """The scene made larger, as seen from the origin."""
    return _changed(document, {"scale": factor}, lambda p: factor * p, lambda v: factor * v, factor)


def relabelled(document, order):
    """The scene with its objects in another order, and with other names."""
    result = plain(document)
    result["objects"] = [{**result["objects"][number], "name": f"number {number}"} for number in order]
    return result
