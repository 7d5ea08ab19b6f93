"""Build a Mitsuba 3 scene from one of our scene files, for comparison with an independent renderer.

Reads the YAML with plain PyYAML and imports nothing of `raytracer`, so that neither can hide the other's mistakes.
What Mitsuba cannot show as we define it (motion, solid textures, photographic exposure, ...) is refused, not
approximated.
Call `mitsuba.set_variant` first.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import yaml
from materials import Textures, bsdf, medium, register_fuzzy_metal
from values import (
    MILLIMETRE,
    Matrix,
    Spec,
    UnsupportedError,
    degrees,
    frame,
    length,
    refuse_others,
    rgb,
    transform_matrix,
)

# Shapes


def shape(spec: Spec, folder: Path) -> Spec:
    """Return the Mitsuba shape of one of our objects, without its material."""
    kind = spec["type"]
    known = {
        "sphere": "center radius",
        "quad": "corner edges",
        "disc": "center normal radius",
        "box": "min max",
        "triangle": "vertices",
        "mesh": "file smooth",
    }
    if kind not in known:
        raise UnsupportedError(f"object: no Mitsuba equal for {kind}")
    refuse_others(spec, "type name material medium transform " + known[kind], kind)
    matrix = transform_matrix(spec.get("transform"))
    linear = matrix[:3, :3]

    def point(p: list[float]) -> Matrix:
        return linear @ [length(v) for v in p] + matrix[:3, 3]

    if kind == "sphere":
        gram = linear.T @ linear
        if not np.allclose(gram, gram[0, 0] * np.eye(3), rtol=1e-9):
            raise UnsupportedError("sphere: Mitsuba has no ellipsoid")
        radius = length(spec["radius"]) * math.sqrt(gram[0, 0])
        center = [float(v) for v in point(spec["center"])]
        return {"type": "sphere", "center": center, "radius": abs(radius), "flip_normals": radius < 0}
    if kind == "quad":
        # Mitsuba's rectangle is [-1, 1]^2 with normal +z.
        u, v = (linear @ [length(x) for x in edge] / 2 for edge in spec["edges"])
        normal = np.cross(u, v)
        normal /= np.linalg.norm(normal)
        return {"type": "rectangle", "to_world": frame(u, v, normal, point(spec["corner"]) + u + v)}
    if kind == "disc":
        normal = np.asarray(spec["normal"], float) / np.linalg.norm(spec["normal"])
        u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        u *= length(spec["radius"]) / np.linalg.norm(u)
        local = frame(u, np.cross(normal, u), normal, np.array([length(v) for v in spec["center"]]))
        return {"type": "disk", "to_world": mi.ScalarTransform4f(matrix) @ local}
    if kind == "box":
        # Mitsuba's cube is [-1, 1]^3.
        low, high = (np.array([length(v) for v in spec[key]]) for key in ("min", "max"))
        local = frame(*np.diag((high - low) / 2), (low + high) / 2)
        return {"type": "cube", "to_world": mi.ScalarTransform4f(matrix) @ local}
    if kind == "triangle":
        return {"type": "triangle", "vertices": np.stack([point(p) for p in spec["vertices"]])}
    path = folder / spec["file"]
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such mesh; a comment in the scene file may say how it is made")
    smooth = bool(spec.get("smooth", False))
    mesh = {"type": path.suffix[1:].lower(), "filename": str(path), "face_normals": not smooth}
    return {**mesh, "to_world": mi.ScalarTransform4f(matrix)}


def single_triangle(vertices: Matrix, surface: Spec) -> Any:
    """Return a mesh of one triangle, which Mitsuba has no plugin for."""
    if not dr.is_jit_v(mi.Float):
        raise UnsupportedError("triangle: needs a vectorised variant")
    props = mi.Properties()
    for name, value in surface.items():
        props[name] = mi.load_dict(value)
    mesh = mi.Mesh("triangle", vertex_count=3, face_count=1, props=props)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(vertices.ravel())
    parameters["faces"] = mi.UInt32([0, 1, 2])
    parameters.update()
    return mesh


# Camera, environment, lights


def sensor(camera: Spec, film: Spec) -> Spec:
    """Return the Mitsuba sensor; both programs measure the focus distance along the axis."""
    kind = camera["type"]
    refuse_others(camera, "type look_from look_at up vfov focus_distance defocus_angle aperture", "camera")
    origin, target = ([length(v) for v in camera[key]] for key in ("look_from", "look_at"))
    spec = {
        "to_world": mi.ScalarTransform4f().look_at(origin=origin, target=target, up=camera.get("up", [0, 1, 0])),
        "fov": degrees(camera["vfov"]),
        "fov_axis": "y",
        "near_clip": 1e-2,
        "far_clip": 1e5,
        "film": film,
        "sampler": {"type": "independent"},
    }
    focus = length(camera.get("focus_distance", math.dist(origin, target)))
    half_angle = math.radians(degrees(camera.get("defocus_angle", 0))) / 2
    lens = camera.get("aperture")
    diameter = 2 * focus * math.tan(half_angle) if lens is None else length(lens, MILLIMETRE)
    if kind == "pinhole" or (kind == "thin_lens" and diameter == 0):
        return {"type": "perspective", **spec}
    if kind == "thin_lens" and math.isfinite(focus):
        return {"type": "thinlens", "focus_distance": focus, "aperture_radius": diameter / 2, **spec}
    raise UnsupportedError(f"camera: no Mitsuba equal for {kind}, or not for its focus at infinity")


def gradient(horizon: list[float], zenith: list[float], rows: int = 1025) -> Any:
    """Return a latitude-longitude picture of the book's gradient, (1 - a) horizon + a zenith with a = (y + 1) / 2.

    Mitsuba puts the first and the last row at the poles and interpolates between; at 1025 rows that is off by 1e-6,
    and its float32 lookup by 1e-5.
    """
    a = (np.cos(np.linspace(0, math.pi, rows)) + 1)[:, None] / 2
    column = (1 - a) * np.asarray(horizon, float) + a * np.asarray(zenith, float)
    return mi.Bitmap(np.repeat(column[:, None], 4, axis=1).astype(np.float32))


def latitude_longitude(path: Path, scale: Matrix) -> Any:
    """Return a picture of all directions for Mitsuba, which puts the first and the last row at the poles.

    Ours is linear between the middles of rows, and constant beyond; with the edges of rows put in, twice as many
    rows and one hold it exactly.
    """
    bitmap = mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
    rows = np.asarray(bitmap, float) * scale
    padded = np.concatenate([rows[:1], rows, rows[-1:]])
    result = np.empty((2 * len(rows) + 1, *rows.shape[1:]), np.float32)
    result[0::2] = (padded[:-1] + padded[1:]) / 2
    result[1::2] = rows
    return mi.Bitmap(result)


def environment(spec: Spec | None, folder: Path) -> Spec | None:
    """Return the Mitsuba emitter of the environment, or None where there is none."""
    if spec is None:
        return None
    if spec["type"] == "constant":
        refuse_others(spec, "type radiance", "environment")
        return {"type": "constant", "radiance": rgb(spec["radiance"])} if np.any(spec["radiance"]) else None
    if spec["type"] == "gradient":
        refuse_others(spec, "type horizon zenith", "environment")
        return {"type": "envmap", "bitmap": gradient(spec["horizon"], spec["zenith"])}
    if spec["type"] == "image":
        refuse_others(spec, "type file scale rotation", "environment")
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], degrees(spec.get("rotation", 0.0)))
        picture = latitude_longitude(folder / spec["file"], np.asarray(spec.get("scale", 1.0), float))
        return {"type": "envmap", "bitmap": picture, "to_world": turn}
    raise UnsupportedError(f"environment: no Mitsuba equal for {spec['type']}")


def light(spec: Spec) -> Spec:
    """Return the Mitsuba emitter of one entry of `lights`."""
    if spec["type"] == "point":
        refuse_others(spec, "type position intensity name", "point light")
        return {"type": "point", "position": [length(v) for v in spec["position"]], "intensity": rgb(spec["intensity"])}
    if spec["type"] == "spot":
        refuse_others(spec, "type position direction look_at intensity angle penumbra", "spot light")
        position = [length(v) for v in spec["position"]]
        target = spec.get("look_at") or [p + d for p, d in zip(position, spec["direction"], strict=True)]
        half = degrees(spec["angle"]) / 2
        up = np.eye(3)[np.argmin(np.abs(np.subtract(target, position)))].tolist()
        return {
            "type": "spot",
            "to_world": mi.ScalarTransform4f().look_at(origin=position, target=target, up=up),
            "intensity": rgb(spec["intensity"]),
            "cutoff_angle": half,
            "beam_width": half - degrees(spec.get("penumbra", 0.0)),
        }
    if spec["type"] == "sun" and spec.get("angle") == 0:
        refuse_others(spec, "type direction irradiance angle", "sun")
        return {"type": "directional", "direction": spec["direction"], "irradiance": rgb(spec["irradiance"])}
    raise UnsupportedError(f"light: no Mitsuba equal for {spec['type']}")


# The scene


def scene_dict(
    path: Path,
    *,
    width: int | None = None,
    height: int | None = None,
    max_depth: int | None = None,
    fuzzy_as_rough: bool = False,
) -> Spec:
    """Return the Mitsuba dictionary of the scene file at `path`.

    Our `max_depth` and Mitsuba's count alike: 1 is what the camera ray hits, 2 adds one bounce.
    """
    spec = yaml.load(path.read_text(encoding="utf-8"), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    refuse_others(spec, "camera film render environment materials objects lights textures media medium groups", "scene")
    if not fuzzy_as_rough and dr.is_jit_v(mi.Float):
        register_fuzzy_metal()

    if spec["film"].get("filter", "box") not in ("box", {"type": "box"}):
        raise UnsupportedError("film: only the box filter is compared")
    film = {
        "type": "hdrfilm",
        "width": width or spec["film"]["width"],
        "height": height or spec["film"]["height"],
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
    }
    settings = spec.get("render", {})
    depth = max_depth or settings.get("max_depth", 50)
    out: Spec = {
        "type": "scene",
        "integrator": {
            "type": "volpath" if "media" in spec else "path",
            "max_depth": depth,
            "rr_depth": settings.get("rr_depth", 5),
        },
        "sensor": sensor(spec["camera"], film),
    }
    emitters = [environment(spec.get("environment"), path.parent), *map(light, spec.get("lights", []))]
    out.update({f"emitter_{i}": emitter for i, emitter in enumerate(emitters) if emitter})

    makers = Makers(spec, Textures(spec.get("textures", {}), path.parent), path.parent, fuzzy_as_rough)
    if "medium" in spec:
        out["sensor"]["medium"] = makers.media[spec["medium"]]
    for name, members in spec.get("groups", {}).items():
        inside = {f"member_{i}": makers.item(member) for i, member in enumerate(members)}
        out[f"group_{name}"] = {"type": "shapegroup", **inside}
    for i, item in enumerate(spec["objects"]):
        if item["type"] == "instance":
            refuse_others(item, "type name of transform", "instance")
            to_world = mi.ScalarTransform4f(transform_matrix(item.get("transform")))
            group = {"type": "ref", "id": f"group_{item['of']}"}
            out[f"object_{i:05}"] = {"type": "instance", "to_world": to_world, "group": group}
        else:
            out[f"object_{i:05}"] = makers.item(item)
    return out


class Makers:
    """What the objects of a scene are made with."""

    def __init__(self, spec: Spec, textures: Textures, folder: Path, fuzzy_as_rough: bool) -> None:
        self.spec, self.textures, self.folder, self.fuzzy_as_rough = spec, textures, folder, fuzzy_as_rough
        # One object a medium: Mitsuba tells media apart by identity.
        self.media = {name: mi.load_dict(medium(item)) for name, item in spec.get("media", {}).items()}

    def item(self, item: Spec) -> Any:
        """Return the shape of an object with its material, and the media on its sides."""
        surface: Spec = {}
        material = item.get("material")
        if isinstance(material, str):
            material = self.spec["materials"][material]
        surface["bsdf"] = bsdf(material, self.textures.on(item), self.fuzzy_as_rough) if material else {"type": "null"}
        if "medium" in item:
            surface["interior"] = self.media[item["medium"]]
        if "medium" in self.spec:
            surface["exterior"] = self.media[self.spec["medium"]]
        if material and material["type"] == "emitter":
            surface["emitter"] = {"type": "area", "radiance": self.textures.on(item).color(material["radiance"])}
        geometry = shape(item, self.folder)
        single = geometry["type"] == "triangle"
        return single_triangle(geometry["vertices"], surface) if single else {**geometry, **surface}
