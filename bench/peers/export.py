"""Build a Mitsuba 3 scene from one of our scene files, for comparison with an independent renderer.

Reads the YAML with plain PyYAML and imports nothing of `raytracer`, so that neither can hide the other's mistakes.
What Mitsuba cannot show as we define it (motion, solid textures, photographic exposure, ...) is refused, not
approximated.
Call `mitsuba.set_variant` first.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import yaml
from numpy.typing import NDArray

Spec = dict[str, Any]
Matrix = NDArray[np.float64]

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3}
MILLIMETRE = METRES["mm"]


class UnsupportedError(Exception):
    """The scene asks for something that this exporter has no exact Mitsuba equal for."""


def refuse_others(spec: Spec, known: str, what: str) -> None:
    """Raise unless every key of `spec` is one of the space-separated `known` keys."""
    others = sorted(set(spec) - set(known.split()))
    if others:
        raise UnsupportedError(f"{what}: no Mitsuba equal for {', '.join(others)}")


def length(value: float | str, plain: float = 1.0) -> float:
    """Read a length in metres; `plain` is the unit of one without a unit (optics are in millimetres)."""
    match = re.fullmatch(r"\s*(\S+?)\s*(km|cm|mm|m)\s*", value) if isinstance(value, str) else None
    return float(match[1]) * METRES[match[2]] if match else float(value) * plain


def degrees(value: float | str) -> float:
    """Read an angle in degrees, with or without the unit."""
    return float(value.removesuffix("deg")) if isinstance(value, str) else float(value)


def rgb(value: float | list[float]) -> Spec:
    """Write a colour as Mitsuba's `rgb`."""
    return {"type": "rgb", "value": [float(v) for v in np.broadcast_to(np.asarray(value, float), 3)]}


class Textures:
    """The textures of a scene, and colours that may be one."""

    def __init__(self, named: dict[str, Spec], folder: Path, *, upright: bool = False) -> None:
        self.named, self.folder, self.upright = named, folder, upright

    def on(self, item: Spec) -> Textures:
        """The textures as an object has them: Mitsuba's v runs down a picture, but it turns that of meshes it reads."""
        return Textures(self.named, self.folder, upright=item["type"] == "mesh")

    def color(self, value: float | list[float] | str | Spec) -> Spec:
        """Write a colour, a texture's name or an inline texture as Mitsuba's."""
        spec = self.named[value] if isinstance(value, str) else value
        return self.texture(spec) if isinstance(spec, dict) else rgb(spec)

    def texture(self, spec: Spec) -> Spec:
        """Return the Mitsuba texture."""
        kind = spec["type"]
        if kind == "image":
            refuse_others(spec, "type file encoding filter wrap scale", "image texture")
            if spec.get("encoding", "auto") not in ("auto", "linear", "srgb"):
                raise UnsupportedError("image texture: no Mitsuba equal for its encoding")
            across, up = np.broadcast_to(spec.get("scale", 1.0), 2)
            to_uv = mi.ScalarTransform4f()
            if not self.upright:
                to_uv = to_uv.translate([0.0, 1.0, 0.0]).scale([1.0, -1.0, 1.0])
            return {
                "type": "bitmap",
                "filename": str(self.folder / spec["file"]),
                "raw": spec.get("encoding") == "linear",
                "filter_type": spec.get("filter", "bilinear"),
                "wrap_mode": spec.get("wrap", "repeat"),
                "to_uv": to_uv.scale([across, up, 1.0]),
            }
        if kind == "checker" and spec.get("space") == "uv":
            refuse_others(spec, "type space scale even odd", "checker")
            # A period of Mitsuba's checkerboard is two cells.
            cells = 0.5 / float(spec["scale"])
            return {
                "type": "checkerboard",
                "color0": rgb(spec["even"]),
                "color1": rgb(spec["odd"]),
                "to_uv": mi.ScalarTransform4f().scale([cells, cells, 1.0]),
            }
        raise UnsupportedError(f"texture: no Mitsuba equal for {kind}")


# Transforms


def rotation(axis: list[float], angle: float) -> Matrix:
    """Return the right-handed rotation by `angle` degrees about `axis` (Rodrigues)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(math.radians(angle)) * k + (1 - math.cos(math.radians(angle))) * k @ k
    return matrix


def transform_matrix(transform: list[Spec] | Spec | None) -> Matrix:
    """Return the product of a `transform`'s steps, the first of which is applied first."""
    if isinstance(transform, dict):
        return np.asarray(transform["matrix"], float).reshape(4, 4)
    matrix = np.eye(4)
    for step in transform or []:
        ((kind, value),) = step.items()
        if kind == "translate":
            one = np.eye(4)
            one[:3, 3] = [length(v) for v in value]
        elif kind == "scale":
            one = np.diag([*np.broadcast_to(np.asarray(value, float), 3), 1.0])
        elif kind == "rotate":
            one = rotation(value["axis"], degrees(value["angle"]))
        elif kind == "matrix":
            one = np.asarray(value, float).reshape(4, 4)
        else:
            raise UnsupportedError(f"transform: no Mitsuba equal for {kind}")
        matrix = one @ matrix
    return matrix


def frame(first: Matrix, second: Matrix, third: Matrix, origin: Matrix) -> Any:
    """Return the Mitsuba transform whose columns are three axes and an origin."""
    matrix = np.eye(4)
    matrix[:3] = np.stack([first, second, third, origin], axis=1)
    return mi.ScalarTransform4f(matrix)


# Materials


def register_fuzzy_metal() -> None:
    """Register `fuzzy_metal`, the book's metal, as a BSDF of the current variant."""

    class FuzzyMetal(mi.BSDF):  # type: ignore[misc]
        """Scatter along the mirrored direction plus `fuzz` times a random unit vector; absorb what goes below.

        Density: let c, s be the cosine and sine of a direction's angle to the mirrored one. The direction meets the
        sphere of radius f about the mirrored one's tip at distances t = c +- q, q^2 = f^2 - s^2. A point of that sphere
        has density 1/(4 pi f^2) an area, which is t^2 f/q times as much a solid angle. The two points together give
        (c^2 + q^2)/(2 pi f q), which at f = 1 is c/pi.
        """

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            self.albedo, self.fuzz = mi.Color3f(props["albedo"]), mi.Float(props["fuzz"])
            # Opaque values keep all metals of a scene one compiled function.
            dr.make_opaque(self.albedo, self.fuzz)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [flags]
            self.m_flags = flags

        def density(self, wi: Any, wo: Any, active: Any) -> Any:
            mirrored = mi.Vector3f(-wi.x, -wi.y, wi.z)
            c = dr.dot(mirrored, wo)
            q2 = dr.square(self.fuzz) - dr.squared_norm(dr.cross(mirrored, wo))
            inside = active & (c > 0) & (q2 > 0) & (wi.z * wo.z > 0)
            return dr.select(inside, self.density_of_exits(c, dr.sqrt(dr.maximum(q2, 0))), 0)

        def density_of_exits(self, c: Any, q: Any) -> Any:
            # At the rim of the cone q is 0 and the density infinite, though integrable; the floor keeps it finite.
            return (dr.square(c) + dr.square(q)) / (2 * dr.pi * self.fuzz * dr.maximum(q, 1e-6 * self.fuzz))

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            del ctx, sample1
            mirrored = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
            unit = mi.warp.square_to_uniform_sphere(sample2)
            bs = mi.BSDFSample3f()
            bs.wo = dr.normalize(mirrored + self.fuzz * unit)
            # q from the drawn vector, not from s^2, whose rounding would drop a few percent of the rim at small fuzz.
            bs.pdf = self.density_of_exits(dr.dot(mirrored, bs.wo), self.fuzz * dr.abs(dr.dot(unit, bs.wo)))
            bs.eta = 1.0
            bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            bs.sampled_component = mi.UInt32(0)
            active = active & (si.wi.z * bs.wo.z > 0)
            bs.pdf = dr.select(active, bs.pdf, 0)
            return bs, dr.select(active, self.albedo, mi.Color3f(0))

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            del ctx
            return self.density(si.wi, wo, active)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            del ctx
            pdf = self.density(si.wi, wo, active)
            return self.albedo * pdf, pdf

        def to_string(self) -> str:
            return f"FuzzyMetal[fuzz={self.fuzz}]"

    mi.register_bsdf("fuzzy_metal", FuzzyMetal)


def microfacets(material: Spec) -> Spec:
    """Return the BSDF of a rough material: GGX, of which Mitsuba leaves out what meets several facets."""
    kind = material["type"]
    if material.get("multiple_scattering", True):
        raise UnsupportedError(f"{kind}: Mitsuba has no scattering between facets: set multiple_scattering to false")
    rough = {"distribution": "ggx", "alpha": float(material["roughness"]) ** 2}
    if kind == "rough_dielectric":
        refuse_others(material, "type ior outside_ior roughness multiple_scattering", kind)
        inside, outside = float(material.get("ior", 1.5)), float(material.get("outside_ior", 1.0))
        return {"type": "roughdielectric", "int_ior": inside, "ext_ior": outside, **rough}
    refuse_others(material, "type eta k roughness multiple_scattering", kind)
    index = {key: rgb(material[key]) for key in ("eta", "k")}
    return {"type": "twosided", "bsdf": {"type": "roughconductor", **index, **rough}}


def phase(medium: Spec) -> Spec:
    """Return the Mitsuba phase function of a medium; both programs give forward scattering a positive g."""
    return {"type": "hg", "g": float(medium.get("g", 0.0))}


def medium(spec: Spec) -> Spec:
    """Return the Mitsuba medium of a homogeneous one given by its absorption and scattering."""
    if spec["type"] != "homogeneous":
        raise UnsupportedError(f"medium: no Mitsuba equal for {spec['type']}")
    refuse_others(spec, "type absorption scattering g", "medium")
    parts = [np.broadcast_to(np.asarray(spec.get(key, 0.0), float), 3) for key in ("absorption", "scattering")]
    extinction = parts[0] + parts[1]
    albedo = np.divide(parts[1], extinction, out=np.zeros(3), where=extinction > 0)
    # Mitsuba takes colours up to 1, and a factor.
    size = float(extinction.max()) or 1.0
    return {
        "type": "homogeneous",
        "albedo": rgb(list(albedo)),
        "sigma_t": rgb(list(extinction / size)),
        "scale": size,
        "phase": phase(spec),
    }


def bsdf(material: Spec, textures: Textures, fuzzy_as_rough: bool) -> Spec:
    """Return the BSDF of one of our materials; an emitter's reflects nothing."""
    kind = material["type"]
    if kind == "lambertian":
        refuse_others(material, "type albedo", "lambertian")
        reflectance = textures.color(material.get("albedo", 0.5))
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    if kind == "metal":
        refuse_others(material, "type albedo fuzz", "metal")
        albedo, fuzz = rgb(material["albedo"]), min(float(material.get("fuzz", 0)), 1.0)
        if fuzz == 0:
            mirror = {"type": "conductor", "material": "none", "specular_reflectance": albedo}
            return {"type": "twosided", "bsdf": mirror}
        if fuzzy_as_rough:
            # Beckmann of the same spread: normals turn half as far, f / (2 sqrt 3) an axis; alpha is sqrt 2 of it.
            rough = {"type": "roughconductor", "material": "none", "specular_reflectance": albedo}
            return {"type": "twosided", "bsdf": {**rough, "alpha": fuzz / math.sqrt(6)}}
        if not dr.is_jit_v(mi.Float):
            raise UnsupportedError("metal: fuzz needs a vectorised variant, or the rough stand-in")
        return {"type": "fuzzy_metal", "albedo": albedo, "fuzz": fuzz}
    if kind == "dielectric":
        refuse_others(material, "type ior outside_ior", "dielectric")
        inside, outside = float(material["ior"]), float(material.get("outside_ior", 1.0))
        return {"type": "dielectric", "int_ior": inside, "ext_ior": outside}
    if kind in ("rough_conductor", "rough_dielectric"):
        return microfacets(material)
    if kind == "emitter":
        refuse_others(material, "type radiance", "emitter")
        return {"type": "diffuse", "reflectance": rgb(0)}
    raise UnsupportedError(f"material: no Mitsuba equal for {kind}")


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
