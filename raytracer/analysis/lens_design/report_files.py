"""Files of a report on a lens: the suffix names the format."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from raytracer.util.safe_open import check_suffix

if TYPE_CHECKING:
    from raytracer.analysis.lens_design.performance.lens_study import LensStudy
    from raytracer.optics.lens_system.lens import Lens

Writer: TypeAlias = "Callable[[Lens, LensStudy], bytes]"


def find_writer(path: Path) -> Writer:
    """Find the function that writes a file of the format that its suffix names.

    Raises
    ------
    InputError : there is no such format.
    """
    kind = path.suffix.lower()
    check_suffix(path, _WRITERS, "a report on a lens")
    return _WRITERS[kind]


def _html(lens: "Lens", study: "LensStudy") -> bytes:
    from raytracer.analysis.lens_design.page import page

    return page(lens, study)


def _pdf(lens: "Lens", study: "LensStudy") -> bytes:
    from raytracer.analysis.lens_design.paper import pdf

    return pdf(lens, study)


def _svg(lens: "Lens", study: "LensStudy") -> bytes:
    from raytracer.analysis.lens_design.paper import svg

    return svg(lens, study)


def _png(lens: "Lens", study: "LensStudy") -> bytes:
    from raytracer.analysis.lens_design.paper import png

    return png(lens, study)


def _json(lens: "Lens", study: "LensStudy") -> bytes:
    return (json.dumps(study.as_dict(points=True), indent=2, allow_nan=False, ensure_ascii=False) + "\n").encode()


_WRITERS: dict[str, Writer] = {".html": _html, ".pdf": _pdf, ".svg": _svg, ".png": _png, ".json": _json}
