"""Files of a report on a lens: the format is what the file's suffix says."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from raytracer.errors import InputError

if TYPE_CHECKING:
    from raytracer.lens_report.analysis.study import Study
    from raytracer.lenses.lens import Lens

Writer: TypeAlias = "Callable[[Lens, Study], bytes]"


def writer_of(path: Path) -> Writer:
    """Find what makes a file of the format that its suffix names.

    Raises
    ------
    InputError : there is no such format, or the library that draws it is not installed.
    """
    kind = path.suffix.lower()
    if kind not in _WRITERS:
        raise InputError(f"{path}: {suffix_words(path)} for a report on a lens; known: {', '.join(_WRITERS)}")
    if kind in (".pdf", ".png"):
        from raytracer.lens_report.pdf import require_matplotlib

        require_matplotlib(kind)
    return _WRITERS[kind]


def suffix_words(path: Path) -> str:
    """Say which suffix a file has that is not known."""
    return f"unknown suffix {path.suffix!r}" if path.suffix else "no suffix"


def _html(found: "Lens", studied: "Study") -> bytes:
    from raytracer.lens_report.page import page

    return page(found, studied)


def _pdf(found: "Lens", studied: "Study") -> bytes:
    from raytracer.lens_report.pdf import pdf

    return pdf(found, studied)


def _svg(found: "Lens", studied: "Study") -> bytes:
    from raytracer.lens_report import drawing

    return drawing.document(drawing.sections(found, studied))


def _png(found: "Lens", studied: "Study") -> bytes:
    from raytracer.lens_report.pdf import png

    return png(found, studied)


def _json(found: "Lens", studied: "Study") -> bytes:
    return (json.dumps(studied.as_dict(points=True), indent=2, allow_nan=False, ensure_ascii=False) + "\n").encode()


_WRITERS: dict[str, Writer] = {".html": _html, ".pdf": _pdf, ".svg": _svg, ".png": _png, ".json": _json}
