"""What a scene file may hold, and the checks across its parts."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, PrivateAttr, TypeAdapter, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from raytracer.errors import SceneError, suggestion
from raytracer.kinds import CAMERAS, ENVIRONMENTS, FILTERS, LIGHTS, MATERIALS, SHAPES
from raytracer.scene.document import Node, locate, path_text
from raytracer.spec import Count, Name, Spec, at

MAX_PIXELS = 2**28
_INT32_MAX = 2**31 - 1
_UINT32_MAX = 2**32 - 1

_Keys: TypeAlias = tuple[str | int, ...]


class _ByName:
    """Annotation of a family's union: a kind's bare name stands for a mapping of that type."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(
            lambda value: {"type": value} if isinstance(value, str) else value, handler(source)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"enum": list(FILTERS.specs())}, handler(schema)]}


if TYPE_CHECKING:
    from raytracer.cameras.interface import CameraSpec
    from raytracer.environments.interface import EnvironmentSpec
    from raytracer.filters.interface import FilterSpec
    from raytracer.materials.interface import MaterialSpec
    from raytracer.shapes.interface import ShapeSpec

    Camera: TypeAlias = CameraSpec
    Environment: TypeAlias = EnvironmentSpec
    Filter: TypeAlias = FilterSpec
    Light: TypeAlias = Spec
    Material: TypeAlias = MaterialSpec
    Shape: TypeAlias = ShapeSpec
else:
    Camera = CAMERAS.union()
    Environment = ENVIRONMENTS.union()
    Filter = Annotated[FILTERS.union(), _ByName()]
    Light = LIGHTS.union()
    Material = MATERIALS.union()
    Shape = SHAPES.union()


class Film(Spec):
    """The image: its size and how samples become pixels."""

    width: Annotated[int, Count(1, MAX_PIXELS)] = Field(description="Pixels across")
    height: Annotated[int, Count(1, MAX_PIXELS)] = Field(description="Pixels down")
    filter: Filter = Field(
        default_factory=FILTERS.specs()["box"],
        description="Reconstruction filter: a name, or a mapping with its parameters",
    )

    @model_validator(mode="after")
    def _not_too_large(self) -> "Film":
        pixels = self.width * self.height
        if pixels > MAX_PIXELS:
            raise ValueError(
                f"is too large: {self.width} x {self.height} is {pixels:,} pixels, at most {MAX_PIXELS:,} are possible"
            )
        return self


class Render(Spec):
    """How much work goes into the image, and how it is sampled."""

    spp: Annotated[int, Count(1, _INT32_MAX)] = Field(default=64, description="Samples per pixel")
    max_depth: Annotated[int, Count(1, _INT32_MAX)] = Field(
        default=50, description="Path segments: 1 is what the camera ray hits, 2 adds one bounce"
    )
    sampler: Literal["sobol", "independent", "stratified"] = Field(
        default="sobol",
        description="Where the random numbers come from: Owen-scrambled Sobol points, a generator, or jittered strata",
    )
    accuracy: Literal["exact", "robust", "fast"] = Field(
        default="exact",
        description="`exact` solves each hit again in float64, `robust` has Embree watertight, "
        "`fast` takes its hits as they are",
    )
    seed: Annotated[int, Count(0, _UINT32_MAX)] = Field(
        default=0, description="Seed: the same scene, seed and spp give the same image"
    )
    rr_depth: Annotated[int, Count(0, _INT32_MAX)] = Field(
        default=5, description="Path segments before Russian roulette may end a path"
    )


class SceneSpec(Spec):
    """A scene file."""

    camera: Camera = Field(description="The camera")
    film: Film = Field(description="The image: its size and filter")
    render: Render = Field(default=Render(), description="How much work goes into the image, and how it is sampled")
    environment: Environment | None = Field(
        default=None, description="What rays that hit nothing see; black where it is not given"
    )
    materials: dict[Name, Material] = Field(
        default_factory=dict, description="Materials by the names that objects call them by"
    )
    objects: tuple[Shape, ...] = Field(default=(), description="The objects")
    lights: tuple[Light, ...] = Field(default=(), description="Lights besides emitting objects")

    _base: Path = PrivateAttr(default=Path())
    _file: str | None = PrivateAttr(default=None)
    _root: Node | None = PrivateAttr(default=None)

    @property
    def base(self) -> Path:
        """The folder that file names in the scene are relative to."""
        return self._base

    def error(self, message: str, *keys: str | int) -> SceneError:
        """An error about what the scene holds at a path, such as `"objects", 3, "file"`: it names file and line."""
        return error_at(message, keys, self._root, self._file)

    @model_validator(mode="after")
    def _names_agree(self) -> "SceneSpec":
        seen: dict[str, int] = {}
        for i, item in enumerate(self.objects):
            # Every material that an object calls for exists.
            material = item.material
            if isinstance(material, str) and material not in self.materials:
                at(
                    ("objects", i, "material"),
                    f"unknown material {material!r}; {suggestion(material, self.materials, 'materials')}",
                )

            # A name means one object.
            if item.name is not None:
                if item.name in seen:
                    at(("objects", i, "name"), f"{item.name!r} is already the name of objects[{seen[item.name]}]")
                seen[item.name] = i
        return self


_MATERIAL: TypeAdapter[Spec] = TypeAdapter(Material)


def check_material(value: Mapping[str, Any]) -> Spec:
    """The material that an object holds inline, checked as those under `materials` are."""
    return _MATERIAL.validate_python(value)


def error_at(message: str, keys: _Keys, root: Node | None, file: str | None) -> SceneError:
    """`message` about the value at `keys` of the document `root`, with its line or the option that it came from."""
    if root is None:
        return SceneError(message, file=file, key=path_text(keys))
    place, path = locate(root, keys)
    return SceneError(message, file=file, line=place.line, key=path_text(path), source=place.option)
