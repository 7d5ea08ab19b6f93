"""The packed scene, whose type is the list of its effects."""

from typing import Any, NamedTuple


class Scene(NamedTuple):
    """A packed scene.  Its type is the list of its effects; sizes, depth and seed are values.

    All but the tuples, camera, filter, sampler and numbers may be None.

    Attributes
    ----------
    accel : address of the built Embree scene.
    accuracy : geometry.Exact, by which hits are solved again in float64, or None.
    primitives : a tuple of one table a kind.
    instances : placements of groups of primitives.
    materials : a tuple of one table a kind.
    selectors : materials that choose others.
    transparency : TransparentShadows, if light goes straight through surfaces.
    normal_mapping : bump and normal maps, and normals of vertices.
    textures : the tables of textures.
    lights : the emitters that light sampling chooses from.
    environment : the light from infinity.
    media : the volumes.
    camera : a camera's table.
    shutter : the exposure, if anything moves.
    filter : the reconstruction filter.
    sampler : the sequence of random numbers.
    depth : the largest number of path segments.
    roulette : the number of segments before Russian roulette starts.
    clamp : the largest radiance of a sample.
    origin : world_origin.Origin of a scene that was packed about another origin than it was written.
    nested_dielectrics : solids that have priorities.
    spectrum : DispersiveMaterials or DispersiveLens, if anything disperses.
    """

    accel: int
    accuracy: Any
    primitives: tuple[Any, ...]
    instances: Any
    materials: tuple[Any, ...]
    selectors: Any
    transparency: Any
    normal_mapping: Any
    textures: Any
    lights: Any
    environment: Any
    media: Any
    camera: Any
    shutter: Any
    filter: Any
    sampler: Any
    depth: int
    roulette: int
    clamp: Any = None
    origin: Any = None
    nested_dielectrics: Any = None
    spectrum: Any = None
