"""Numbers from every kernel that needs no Embree, to be had compiled or, under NUMBA_DISABLE_JIT=1, interpreted.

Run as `python -m tests.unjitted FILE.npz`, which writes them.
"""

import sys
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytracer.core.compiler.dispatch import entry, kernel
from raytracer.core.fresnel import fresnel_dielectric, refract
from raytracer.core.geometry import Exact, spawn_point
from raytracer.core.primitives.base.interface import hit_any
from raytracer.core.primitives.discs import Discs
from raytracer.core.primitives.parallelograms import Parallelograms
from raytracer.core.primitives.spheres import Spheres
from raytracer.core.primitives.triangles import SmoothTriangles, Triangles
from raytracer.core.sampling import SAMPLERS, pixel_key, sample_1d, sample_2d
from raytracer.core.vec import basis, reflect, to_world
from raytracer.optics.lens_system.lens import Lens
from raytracer.optics.lens_system.ray_tracing import trace_rays
from raytracer.plugins.apertures.base.vignetting import Rim
from raytracer.plugins.apertures.image import pack_mask
from raytracer.plugins.apertures.polygon import PolygonAperture
from raytracer.plugins.cameras.pinhole import Pinhole
from raytracer.plugins.cameras.thin_lens import ThinLens
from raytracer.plugins.environments.gradient import Gradient
from raytracer.plugins.lights.base.interface import power_heuristic
from raytracer.plugins.materials.base.interface import SelectorSpec
from tests.optics.lens_system.kernels import DOUBLE_GAUSS, lens_of
from tests.optics.lens_system.test_aspheres import ASPHERES
from tests.plugins.apertures.kernels import passed, sampled
from tests.plugins.cameras.kernels import camera_rays
from tests.plugins.environments.test_environments import seen
from tests.plugins.materials.kernels import evaluate_many, incoming, scatter_many
from tests.plugins.materials.test_contract import EXAMPLES, FACETS, spec_of
from tests.plugins.shapes.kernels import pdf_of, sample
from tests.plugins.textures.kernels import looked_up, picture, slopes, table_of
from tests.plugins.textures.kernels import spec_of as texture_of
from tests.vectorised import rows, vectorised

_MATERIAL = np.zeros(1, np.int32)
_CORNERS = np.array([[0, 0, 0], [1, 0.2, 0], [0.1, 1, 0.3]])
_NORMALS = np.array([[0, 0, 1], [0, 0.6, 0.8], [0.6, 0, 0.8]], np.float32)
TABLES = (
    Discs(np.array([[0.1, 0.2, 0.3]]), np.array([[0.0, 0.6, 0.8]]), np.array([2.0]), _MATERIAL),
    Parallelograms(_CORNERS[:1] - 1.0, 4.0 * _CORNERS[1:2], 4.0 * _CORNERS[2:], _MATERIAL),
    SmoothTriangles(9.0 * _CORNERS.astype(np.float32) - 3, np.array([[0, 1, 2]], np.uint32), _MATERIAL, None, _NORMALS),
    Spheres(np.array([[0.1, 0.2, 0.3]]), np.array([0.9]), _MATERIAL),
    Triangles(9.0 * _CORNERS.astype(np.float32) - 3, np.array([[0, 1, 2]], np.uint32), _MATERIAL),
)


@entry
def _hits(tables, accuracy, origin, direction, out):
    for table in range(len(tables)):
        hit = hit_any(tables, table, 0, origin, direction, 4.0, None, accuracy)
        start = spawn_point(hit, (-direction[0], -direction[1], -direction[2]))
        for axis in range(3):
            out[table, axis] = hit.point[axis]
            out[table, 3 + axis] = hit.normal[axis]
            out[table, 6 + axis] = hit.shading_normal[axis]
            out[table, 9 + axis] = start[axis]
        out[table, 12] = hit.u
        out[table, 13] = hit.v
        out[table, 14] = hit.offset


@entry
def _optics(direction, normal, out):
    cos_i = -(direction[0] * normal[0] + direction[1] * normal[1] + direction[2] * normal[2])
    s, t = basis(normal)
    reflectance, cos_t = fresnel_dielectric(cos_i, 1.5)
    refracted = refract(direction, normal, cos_i, cos_t, 1.5)
    mirrored = reflect(direction, normal)
    turned = to_world(direction, s, t, normal)
    for axis in range(3):
        out[axis] = refracted[axis]
        out[3 + axis] = mirrored[axis]
        out[6 + axis] = turned[axis]
    out[9] = reflectance
    out[10] = power_heuristic(0.3, 2.0)


@kernel
def _drawn(sampler, x, y, index, dimension):
    key = pixel_key(sampler, x, y)
    pair = sample_2d(sampler, key, index, dimension)
    return float(key), sample_1d(sampler, key, index, dimension), pair[0], pair[1]


def random_numbers() -> dict[str, NDArray[np.float64]]:
    """A pixel's key and three numbers, by sampler; a warning is an error."""
    asked = [(0, 0, 0, 0), (70000, 3, 12, 9), (5, 80000, 200000, 2**20), (1, 2, 2**31 - 1, 77)]
    with warnings.catch_warnings(action="error"):
        return {
            name: vectorised(_drawn)(SAMPLERS[name](2**62 + 5, 7), *map(rows, np.transpose(asked)))
            for name in sorted(SAMPLERS)
        }


def numbers() -> dict[str, NDArray[np.float64]]:
    """Arrays by name."""
    out: dict[str, Any] = {}
    for kind, examples in EXAMPLES.items():
        for number, parameters in enumerate(examples):
            spec = spec_of(kind, parameters)
            # Selectors only name other materials; the tables of facets are a matter of minutes for the interpreter.
            if isinstance(spec, SelectorSpec) or kind in FACETS:
                continue
            drawn = scatter_many(spec, incoming(35.0), 20)
            valued = evaluate_many(spec, incoming(35.0), drawn[0])
            for name, array in zip(("outgoing", "weight", "pdf", "value", "density"), (*drawn, *valued), strict=True):
                out[f"{kind} {number} {name}"] = array
    u = np.random.default_rng(1).random((20, 2))
    for table in TABLES:
        points = sample((table,), 0, 0, (1.0, 2.0, 3.0), u)
        out.update({f"{type(table).__name__} {field}": array for field, array in points._asdict().items()})
        out[f"{type(table).__name__} pdf_of"] = pdf_of((table,), 0, 0, (2.0, 1.0, 4.0), points.point, points.normal)
    for accuracy in (Exact(), None):
        # By a switch, and without one.
        for tables in (TABLES, TABLES[:1]):
            hits = np.empty((len(tables), 15))
            _hits(tables, accuracy, (0.2, 0.1, 4.3), (0.0, 0.0, -1.0), hits)
            out[f"hits of {len(tables)} {accuracy}"] = hits
    optics = np.empty(11)
    _optics((0.6, 0.0, -0.8), (0.0, 0.0, 1.0), optics)
    out["optics"] = optics
    for camera in (Pinhole(vfov=40.0), ThinLens(vfov=40.0, focus_distance=3.0, aperture=100.0)):
        packed = camera.pack(40, 30)
        out[f"{camera.type} origins"], out[f"{camera.type} directions"] = camera_rays(packed, u[:, 0] * 40.0, 7.5)
    for curvature in (0.0, 0.5):
        out[f"polygon {curvature}"] = sampled(PolygonAperture(curvature=curvature, anamorphic=2.0).pack({}), u)
    out["mask"] = sampled(pack_mask(np.array([[0.0, 1.0, 0.5], [2.0, 0.0, 0.25]])), u)
    out["rim"] = passed(Rim(1.0, 2.0), out["mask"], 0.3, -0.1)
    starts = np.concatenate([8.0 * u - 4.0, np.full((20, 1), -9.0)], axis=1)
    out["lens weights"], out["lens points"], out["lens directions"] = trace_rays(
        lens_of(DOUBLE_GAUSS), starts, (0, 0, 1)
    )
    for name, element in ASPHERES.items():
        out[f"{name} weights"], out[f"{name} points"], out[f"{name} directions"] = trace_rays(
            Lens(name, (element,)).packed(), 0.1 * element.radius * starts, (0, 0, 1)
        )
    points = 3.0 * np.random.default_rng(2).normal(size=(20, 3))
    for name, parameters in (
        ("checker", {}),
        ("checker", {"space": "uv", "scale": 0.2}),
        ("noise", {"pattern": "marble", "seed": 2**32 - 1}),
        ("image", {"file": "x", "wrap": "mirror", "scale": 3, "rotation": 30}),
    ):
        files = picture(np.arange(60).reshape(4, 5, 3)) if name == "image" else {}
        table = table_of(texture_of(name, **parameters), files=files)
        out[f"{name} {parameters} colours"] = looked_up(table, points=points, uv=u)
        out[f"{name} {parameters} slopes"] = slopes(table, points=points, uv=u)
    out["sky"] = seen(Gradient().pack({}), out["pinhole directions"])
    return out | random_numbers()


if __name__ == "__main__":
    np.savez(sys.argv[1], **numbers())
