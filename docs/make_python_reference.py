"""Write docs/reference/python, the reference of the Python interface, from signatures and docstrings: `make docs`.

A test compares the pages, so that no public name is lost unseen.
"""

import ast
import inspect
import re
import sys
import textwrap
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import raytracer  # noqa: E402
from docs.documents import link, with_links  # noqa: E402
from docs.scene_tables import FAMILIES, targets  # noqa: E402
from raytracer import lightfield  # noqa: E402
from raytracer.analysis.compare.result import Comparison  # noqa: E402
from raytracer.analysis.cost.notebook import CostStudy  # noqa: E402
from raytracer.analysis.explain.explanation import Explanation  # noqa: E402
from raytracer.analysis.probe import ProbeResult  # noqa: E402
from raytracer.analysis.sweep.results import Sweep  # noqa: E402
from raytracer.rendering.options import RenderOptions  # noqa: E402
from raytracer.scene.json_schema import definition_name  # noqa: E402
from raytracer.scene.python_api import FAMILIES as WORDS  # noqa: E402
from raytracer.scene.python_api import parts  # noqa: E402

OUTPUT = ROOT / "docs" / "reference" / "python"

METHODS = {
    "Cluster": ("close",),
    "Image": ("save", "display"),
    "LightField": ("view", "lit"),
    "Scene": ("replace", "save"),
}
"""Methods of classes that are described."""

RESULTS = (Explanation, Comparison, Sweep, ProbeResult, CostStudy)
"""What functions return, and nobody makes."""

OLD = {"Stock"}
"""Old names of others."""

_PUBLIC = {"SceneSpec": "Scene", "RenderCache": "Cache"}
"""Public names of classes that signatures name by their own."""

_HEADING = re.compile(r"^(Parameters|Attributes|Returns|Raises)\n-+\n", re.MULTILINE)
_ENTRY = re.compile(r"^(\w[\w, ]*?)(?: (\([^)]*\)))?( ?): (.*)", re.DOTALL)
_LINE = 100
_LONGEST_DEFAULT = 30
_OLD_ARGUMENTS = {"stock"}
_TUPLE = re.compile(r"Annotated\[(tuple\[\w+, \.\.\.\])[^\]]*\]")


def public_names() -> list[str]:
    """List the names of `raytracer` that are no words of scene files, sorted as readers look for them."""
    words = {*WORDS, *parts(), "lightfield"} | OLD
    return sorted((name for name in raytracer.__all__ if name not in words), key=str.lower)


# ---- Signatures


def annotations(thing: Any) -> dict[str, str]:
    """Read the annotations of a function's parameters, or of a class's fields, as their source has them."""
    if not inspect.isclass(thing):
        thing = inspect.unwrap(thing)
    tree = ast.parse(textwrap.dedent(inspect.getsource(thing))).body[0]
    if isinstance(tree, ast.ClassDef):
        fields = (node for node in tree.body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name))
        found = {ast.unparse(node.target): ast.unparse(node.annotation) for node in fields}
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name == "__init__":
                found |= _of_arguments(node)
        return found
    assert isinstance(tree, ast.FunctionDef)
    return {**_of_arguments(tree), **({"return": ast.unparse(tree.returns)} if tree.returns else {})}


def _of_arguments(node: ast.FunctionDef) -> dict[str, str]:
    listed = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
    return {argument.arg: ast.unparse(argument.annotation) for argument in listed if argument.annotation}


def _plain(annotation: Any) -> str:
    """Write an annotation without the modules of its names."""
    return re.sub(r"\b(?:[a-z_]\w*\.)+(?=\w)", "", inspect.formatannotation(annotation))


def _parameter(parameter: inspect.Parameter, known: dict[str, str]) -> str:
    # With its stars, if it has any.
    text = str(parameter).partition(":")[0].partition("=")[0].strip()
    if parameter.annotation is not inspect.Parameter.empty:
        text += f": {known.get(parameter.name) or _plain(parameter.annotation)}"
    if parameter.default is inspect.Parameter.empty:
        return text
    shown = repr(parameter.default)
    return f"{text} = {'...' if shown.startswith('<') or len(shown) > _LONGEST_DEFAULT else shown}"


def _options(parameter: inspect.Parameter) -> list[str]:
    """List the keyword options of a parameter `**options: Unpack[...]`, which have their defaults elsewhere."""
    if parameter.kind is not inspect.Parameter.VAR_KEYWORD or not typing.get_args(parameter.annotation):
        return []
    return [f"{name}: {kind} = ..." for name, kind in annotations(typing.get_args(parameter.annotation)[0]).items()]


def signature(name: str, thing: Any) -> str:
    """Write a signature, in one line or with a parameter a line."""
    found, known = inspect.signature(thing), annotations(thing)
    words, is_keyword = [], False
    for parameter in found.parameters.values():
        if parameter.name in {"self", *_OLD_ARGUMENTS}:
            continue
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY and not is_keyword:
            words.append("*")
            is_keyword = True
        words += _options(parameter) or [_parameter(parameter, known)]
    result = f" -> {known['return']}" if "return" in known and known["return"] != "None" else ""
    text = f"{name}({', '.join(words)}){result}"
    if len(text) > _LINE:
        text = f"{name}(\n" + "".join(f"    {word},\n" for word in words) + f"){result}"
    return _TUPLE.sub(r"\1", re.sub(r"'?\b(SceneSpec|RenderCache)\b'?", lambda word: _PUBLIC[word[1]], text))


# ---- Docstrings


def entries(text: str, *, is_section: bool) -> str | None:
    """Write lines of `name (unit) : meaning` as a list; None if a text is anything else.

    is_section : whether a heading says that it is such a list; then no space is needed before the colon.
    """
    found = [_ENTRY.match(line) for line in re.split(r"\n(?! )", text)]
    if not all(entry and (is_section or entry[3]) for entry in found):
        return None
    listed = []
    for entry in filter(None, found):
        names = ", ".join(f"`{name}`" for name in entry[1].split(", "))
        if entry[1] not in _OLD_ARGUMENTS:
            listed.append(f"- {names}{f' {entry[2]}' if entry[2] else ''}: {' '.join(entry[4].split())}")
    return "\n".join(listed)


def markdown(docstring: str | None) -> str:
    """Write a docstring as Markdown: its sections under bold words, its entries as lists, indented lines as code."""
    text = _HEADING.sub(r"**\1**\n\n", inspect.cleandoc(docstring or ""))
    written: list[str] = []
    for paragraph in text.split("\n\n"):
        is_section = bool(written) and written[-1].startswith("**")
        if paragraph.startswith("    "):
            written.append(f"```python\n{textwrap.dedent(paragraph)}\n```")
        else:
            listed = entries(paragraph, is_section=is_section)
            written.append(" ".join(paragraph.split()) if listed is None else listed)
    return with_links("\n\n".join(written))


def section(name: str, thing: Any) -> Iterator[str]:
    """Write the section of a public name."""
    yield f"## {name}\n"
    if not (inspect.isclass(thing) and (issubclass(thing, Exception) or thing in RESULTS)):
        yield f"```python\n{signature(name, thing)}\n```\n"
    yield markdown(thing.__doc__) + "\n"
    for method in METHODS.get(name.rpartition(".")[2], ()):
        found = inspect.getattr_static(thing, method)
        yield f"### {name}.{method}\n"
        yield f"```python\n{signature(f'.{method}', found)}\n```\n"
        yield markdown(found.__doc__) + "\n"


# ---- Pages

_LIGHT_FIELDS = """\
Each function takes a `LightField` (`open` reads one, `of` gets it from a rendered picture) and returns arrays, `Image`s
or bytes; the [command line](../commands/lightfield.md) calls the same functions.

```python
import raytracer as rt

with rt.lightfield.open("x.lf") as field:
    rt.lightfield.refocus(field, 2.5).save("near.png")
```
"""


def words() -> Iterator[str]:
    """Write the table of the words of scene files."""
    pages = {family: page for page, family in FAMILIES.items()}
    yield "| word | makes |\n|---|---|"
    for word, family in WORDS.items():
        listed = ", ".join(f"[{kind}](../scenes/{pages[family]}/{kind}.md)" for kind in family.specs())
        yield f"| `rt.{word}` | {listed} |"
    listed = (f"[`rt.{word}`](../scenes/{targets()[definition_name(spec)]})" for word, spec in sorted(parts().items()))
    yield f"\nMappings without a type are capitalised: {', '.join(listed)}."


def index() -> str:
    """Write the page of `raytracer` itself."""
    text = ["# Python\n", "`import raytracer as rt`. How these names work together is shown in"]
    text.append(f"{link('scripting.md')}; [light fields](lightfield.md) have a page of their own.\n")
    text += [
        "## Words of scene files\n",
        "Arguments are the keys of scene files: `rt.camera.pinhole(vfov=30)`.\n",
        *words(),
    ]
    for name in public_names():
        text += ["", *section(f"rt.{name}", getattr(raytracer, name))]
    for thing in RESULTS:
        text += ["", *section(thing.__name__, thing)]
    text += ["## Options of a render\n", "What `rt.render`, `rt.sweep` and `rt.probe` take alike:\n"]
    text.append(markdown(RenderOptions.__doc__).partition("\n\n")[2])
    text.append("\n```{toctree}\n:hidden:\nlightfield\n```")
    return re.sub(r"\n{3,}", "\n\n", "\n".join(text)) + "\n"


def light_fields() -> str:
    """Write the page of `raytracer.lightfield`."""
    text = ["# Light fields in Python\n", _LIGHT_FIELDS]
    for name in sorted(lightfield.__all__, key=str.lower):
        text += ["", *section(f"rt.lightfield.{name}", getattr(lightfield, name))]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(text)) + "\n"


def reference() -> dict[str, str]:
    """Make the texts of all pages, by their names."""
    return {"index.md": index(), "lightfield.md": light_fields()}


if __name__ == "__main__":
    OUTPUT.mkdir(parents=True, exist_ok=True)
    for page, text in reference().items():
        (OUTPUT / page).write_text(text, encoding="utf-8")
