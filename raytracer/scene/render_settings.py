"""The film and render settings of a scene: its keys `film` and `render`."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from raytracer.film.tone import ToneCurveField, ToneCurveSpec
from raytracer.film.white_balance import WhiteBalanceField
from raytracer.scene.kind_unions import Filter
from raytracer.schema.fields import Count, PositiveNumber
from raytracer.schema.registry import FILTERS
from raytracer.schema.spec import Spec

MAX_PIXELS = 2**28
_INT32_MAX = 2**31 - 1
_UINT32_MAX = 2**32 - 1


class Film(Spec):
    """The image: its size, how samples become pixels, and how these are shown."""

    width: Annotated[int, Count(1, MAX_PIXELS)] = Field(description="Pixels across")
    height: Annotated[int, Count(1, MAX_PIXELS)] = Field(description="Pixels down")
    filter: Filter = Field(
        default_factory=FILTERS.spec("box"),
        description="Reconstruction filter: a name, or a mapping with its parameters",
    )
    white_balance: WhiteBalanceField | None = Field(
        default=None,
        description="Light that is to look white: a colour temperature from 2000 to 25000 K, `auto`, which makes the "
        "mean of the picture grey, or gains of red, green and blue; by default colours stay as they are",
    )
    tone_curve: ToneCurveField = Field(
        default=ToneCurveSpec(),
        description="How .png and .jpg files show linear values: `linear`, clipped at 1, `filmic`, or "
        "{type: filmic, white: 4}; linear files are left as they are",
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
    """Samples, path lengths and sampling of the image."""

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
    light_sampling: Literal["mis", "lights", "paths"] = Field(
        default="mis",
        description="How light is found: `mis` by next-event estimation and by paths, weighted against each other, "
        "`lights` by paths only where no light can be sampled, `paths` by paths alone",
    )
    seed: Annotated[int, Count(0, _UINT32_MAX)] = Field(
        default=0, description="Seed: the same scene, seed and spp give the same image"
    )
    rr_depth: Annotated[int, Count(0, _INT32_MAX)] = Field(
        default=5, description="Path segments before Russian roulette may end a path"
    )
    clamp: PositiveNumber | None = Field(
        default=None,
        description="Largest radiance that a sample may have in any channel: brighter ones are made as dark as that, "
        "which takes away fireflies, and light; off by default",
    )
