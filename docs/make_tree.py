"""Write the tree of packages into docs/architecture.md, from what each package says of itself.

    python docs/make_tree.py

Replaces what stands between the markers. `make docs` runs it.
"""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "raytracer"
OUTPUT = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- tree -->\n", "<!-- end of tree -->\n"


def layers() -> list[str]:
    """List the top packages from the highest layer to the lowest, as the contract in pyproject.toml has them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    (contract,) = (item for item in settings["tool"]["importlinter"]["contracts"] if item["type"] == "layers")
    return [name.strip() for layer in contract["layers"] for name in layer.split("|")]


def summary(package: Path) -> str:
    """Join the lines of the first paragraph of a package's docstring."""
    text = ast.get_docstring(ast.parse((package / "__init__.py").read_text("utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def packages(folder: Path) -> list[Path]:
    """List the packages in a folder, by name; a family's `base` says nothing that its family does not."""
    return sorted(path.parent for path in folder.glob("*/__init__.py") if path.parent.name != "base")


def tree() -> str:
    """Make the list of packages: layers from the highest to the lowest, and their packages below each."""
    lines = []
    for name in layers():
        lines.append(f"- **`{name}/`** {summary(PACKAGE / name)}\n")
        lines += [f"  - `{path.name}/` {summary(path)}\n" for path in packages(PACKAGE / name)]
    return "".join(lines)


def with_tree(text: str) -> str:
    """Put the tree between the markers of a text."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + tree() + END + rest.split(END)[1]


if __name__ == "__main__":
    OUTPUT.write_text(with_tree(OUTPUT.read_text("utf-8")), "utf-8")
