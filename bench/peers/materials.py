"""Textures, materials and media of our scene files as Mitsuba has them; call `mitsuba.set_variant` first."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from values import (
    Spec,
    UnsupportedError,
    refuse_others,
    rgb,
)


class Textures:
    """The textures of a scene, and colours that may be one."""

    def __init__(self, named: dict[str, Spec], folder: Path, *, upright: bool = False) -> None:
        self.named, self.folder, self.upright = named, folder, upright

    def on(self, item: Spec) -> Textures:
        """Turn textures as an object needs: Mitsuba's v runs down a picture, but it turns that of meshes it reads."""
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
