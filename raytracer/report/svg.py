"""SVG as plain data: written to files as text, and built by a page's script.

An element is `[name, attributes, *children]`, a child an element or a string: values of JSON.  So a page needs no HTML
in its data, and a picture has but one description.

Ink is `currentColor`, so that a picture reads in the dark as well.

References: W3C 2011, "Scalable Vector Graphics 1.1".
"""

import html
from collections.abc import Mapping
from typing import Any, TypeAlias

Node: TypeAlias = list[Any]

INK = "currentColor"

_STYLE = "text { font-family: system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif; } svg { color: #222222; }"
_BACKGROUND = "#ffffff"


def element(name: str, attributes: Mapping[str, Any] | None = None, *children: "Node | str") -> Node:
    """Make an element; attributes that are None are left out, `_` in their names is `-`."""
    plain = {key.replace("_", "-"): value for key, value in (attributes or {}).items() if value is not None}
    return [name, {key: number(value) for key, value in plain.items()}, *children]


def number(value: Any) -> str:
    """Write an attribute's value: numbers to a thousandth, or to a millionth if they are small."""
    if not isinstance(value, float | int) or isinstance(value, bool):
        return str(value)
    text = f"{value:.3f}" if abs(value) >= 0.1 else f"{value:.6f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text


def render_svg(width: float, height: float, label: str, *children: Node) -> Node:
    """Make an `svg` of a size in pixels, which fills the width of its place; `label` describes it."""
    return element(
        "svg", {"viewBox": f"0 0 {number(width)} {number(height)}", "role": "img", "aria-label": label}, *children
    )


def to_text(node: Node) -> str:
    """Write an element as text, with attributes and strings escaped."""
    name, attributes, *children = node
    written = "".join(f' {key}="{html.escape(value)}"' for key, value in attributes.items())
    inner = "".join(html.escape(child) if isinstance(child, str) else to_text(child) for child in children)
    return f"<{name}{written}>{inner}</{name}>" if inner else f"<{name}{written}/>"


def document(node: Node) -> bytes:
    """Write a picture as a file (UTF-8), on white."""
    name, attributes, *children = node
    _, _, width, height = attributes["viewBox"].split()
    whole = {"xmlns": "http://www.w3.org/2000/svg", "width": width, "height": height} | attributes
    style = element("style", {}, _STYLE)
    paper = element("rect", {"width": width, "height": height, "fill": _BACKGROUND})
    # Titles of elements are tooltips; this one is the file's.
    title = element("title", {}, attributes.get("aria-label", ""))
    body = to_text([name, whole, title, style, paper, *children])
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'.encode()
