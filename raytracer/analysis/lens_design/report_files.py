"""Files of a report on a lens: the suffix names the format."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from raytracer.analysis.lens_design.page import page
from raytracer.analysis.lens_design.paper import pdf, png, svg
from raytracer.analysis.lens_design.performance.lens_study import LensStudy
from raytracer.optics.lens_system.lens import Lens
from raytracer.util.safe_open import check_suffix

Writer: TypeAlias = Callable[[Lens, LensStudy], bytes]


def _json(lens: Lens, study: LensStudy) -> bytes:
    return (json.dumps(study.as_dict(points=True), indent=2, allow_nan=False, ensure_ascii=False) + "\n").encode()


_WRITERS: Mapping[str, Writer] = {".html": page, ".pdf": pdf, ".svg": svg, ".png": png, ".json": _json}


def find_writer(path: Path) -> Writer:
    """Find the function that writes a file of the format that its suffix names.

    Raises
    ------
    InputError : there is no such format.
    """
    check_suffix(path, _WRITERS, "a report on a lens")
    return _WRITERS[path.suffix.lower()]
