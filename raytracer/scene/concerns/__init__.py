"""What to warn of before a scene is rendered: what is probably not meant, and what float32 cannot hold."""

from collections.abc import Callable

from raytracer.errors import StrictError
from raytracer.scene.concerns.contacts import contacts
from raytracer.scene.concerns.interface import Concern, told
from raytracer.scene.concerns.lamps import lamps
from raytracer.scene.concerns.nesting import nesting
from raytracer.scene.concerns.picture import picture
from raytracer.scene.concerns.sizes import sizes
from raytracer.scene.concerns.survey import Survey
from raytracer.scene.concerns.viewpoint import viewpoint
from raytracer.scene.pack import Packed

__all__ = ["Concern", "concerns", "heed", "told"]


def concerns(packed: Packed) -> list[Concern]:
    """What there is to warn of in a packed scene, one a matter; see docs/warnings.md."""
    survey = Survey(packed)
    return [*sizes(survey), *contacts(survey), *nesting(survey), *lamps(survey), *viewpoint(survey), *picture(survey)]


def heed(packed: Packed, warn: Callable[[str], object] | None, *, strict: bool = False) -> None:
    """Say what there is to warn of, a sentence each, if anyone wants to hear it.

    Raises
    ------
    StrictError : there is something, and it is to count as an error.
    """
    sentences = told(concerns(packed)) if strict or warn is not None else []
    if sentences and strict:
        raise StrictError(sentences)
    for sentence in sentences:
        assert warn is not None
        warn(sentence)
