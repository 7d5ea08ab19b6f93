"""The files of the live view's page: nothing in it comes from elsewhere."""

from collections.abc import Mapping

from raytracer.report import palette
from raytracer.report.page import joined

_PARTS = ("wipe", "bench", "view")


def page_files() -> dict[str, tuple[str, bytes]]:
    """Return the media type and the content of each file, by its name in the page's folder."""
    style = f"{_variables(palette.LIGHT)}\n@media (prefers-color-scheme: dark) {{ {_variables(palette.DARK)} }}\n"
    texts = {
        "index.html": ("text/html", joined(("view",), ".html")),
        "view.css": ("text/css", style + joined(("style", *_PARTS), ".css")),
        "view.js": ("text/javascript", joined(("base", *_PARTS), ".js")),
    }
    return {name: (kind, text.encode()) for name, (kind, text) in texts.items()}


def _variables(colours: Mapping[str, str]) -> str:
    """Write colours as variables of a style sheet."""
    values = " ".join(f"--{name}: {colour};" for name, colour in colours.items())
    return f":root {{ color-scheme: light dark; {values} }}"
