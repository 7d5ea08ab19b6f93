"""The settings of a render that are written into the headers of image files."""

from collections.abc import Mapping

from raytracer import __version__
from raytracer.rendering.statistics import Stats
from raytracer.scene.spec import SceneSpec


def image_header(
    spec: SceneSpec, crop: tuple[int, int, int, int] | None, stats: Stats, *, is_adaptive: bool
) -> Mapping[str, str | float | int]:
    """Return the settings of a render and the error of its picture, by name."""
    settings = spec.render
    header: dict[str, str | float | int] = {
        "renderer": f"rt {__version__}",
        "spp": stats.spp["mean"] if is_adaptive else settings.spp,
        "max_depth": settings.max_depth,
        "sampler": settings.sampler,
        "accuracy": settings.accuracy,
        "seed": settings.seed,
        "filter": spec.film.filter.type,
        "camera": spec.camera.type,
    }
    if is_adaptive:
        header |= {"spp_fewest": stats.spp["fewest"], "spp_most": stats.spp["most"]}
    if stats.error:
        names = {"relative": "relative_error", "low": "relative_error_low", "high": "relative_error_high"}
        header |= {name: stats.error[key] for key, name in names.items()}
    if "target" in stats.error:
        header["noise"] = stats.error["target"]
    if stats.clamp:
        header |= {"clamp": stats.clamp["limit"], "clamp_took": stats.clamp["light"]}
    if crop is not None:
        header["crop"] = ",".join(map(str, crop))
    return header
