"""The form of the source tree: sizes, names and docstrings that newcomers can rely on.

python -m tests.test_house [FOLDER]     lists what breaks a rule, of a folder's files
"""

import ast
import sys
from collections.abc import Callable, Iterator

import pytest

from tests.repository import ROOT

PACKAGE = ROOT / "raytracer"
MAX_LINES = 400
MAX_CODE_LINES = 60
MAX_PARAMETERS = 8

# Arguments of kernels are scalars in registers; those of commands are their options.
MANY_PARAMETERS = (
    "raytracer/core/",
    "raytracer/kernel/",
    "raytracer/optics/lens_system/",
    "raytracer/plugins/",
    "raytracer/cli/",
)

# First words with which a docstring asks a riddle in place of an answer.
RIDDLES = ("What becomes", "Whether", "Where ", "How ", "That ", "Who ", "Why ")

Function = ast.FunctionDef | ast.AsyncFunctionDef


def _functions(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def _code_lines(function, source):
    """Count the lines of a function's body that hold code: no docstring, no comment, nothing blank."""
    body = function.body
    if ast.get_docstring(function) is not None:
        body = body[1:]
    if not body:
        return 0
    lines = source[body[0].lineno - 1 : body[-1].end_lineno]
    return sum(1 for line in lines if line.strip() and not line.strip().startswith("#"))


def _decorators(function):
    return {ast.unparse(node).split("(")[0].split(".")[-1] for node in function.decorator_list}


def large_modules(name, tree, source):
    """Find a module of too many lines."""
    if len(source) > MAX_LINES:
        yield f"{name}: {len(source)} lines"


def large_functions(name, tree, source):
    """Find functions of too many lines of code."""
    for function in _functions(tree):
        lines = _code_lines(function, source)
        if lines > MAX_CODE_LINES:
            yield f"{name}:{function.lineno}: {function.name} has {lines} lines of code"


def many_parameters(name, tree, source):
    """Find functions with too many parameters."""
    if name.startswith(MANY_PARAMETERS):
        return
    for function in _functions(tree):
        arguments = function.args
        count = len(arguments.posonlyargs + arguments.args + arguments.kwonlyargs)
        count -= bool(arguments.args) and arguments.args[0].arg in {"self", "cls"}
        if count > MAX_PARAMETERS:
            yield f"{name}:{function.lineno}: {function.name} has {count} parameters"


def nameless_functions(name, tree, source):
    """Find functions that no traceback and no search can name."""
    for function in _functions(tree):
        if function.name == "_":
            yield f"{name}:{function.lineno}: a function is called _"


def riddles(name, tree, source):
    """Find docstrings that open with a question."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node)
            if text is not None and text.startswith(RIDDLES):
                line = getattr(node, "lineno", 1)
                yield f"{name}:{line}: {text.splitlines()[0]}"


def undescribed(name, tree, source):
    """Find public functions without a docstring; a case of a generic has that of its generic."""
    if name.endswith("core/vec.py"):
        return
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef) or node.name.startswith("_") or "register" in _decorators(node):
            continue
        if ast.get_docstring(node) is None:
            yield f"{name}:{node.lineno}: {node.name} has no docstring"


RULES: tuple[Callable[[str, ast.Module, list[str]], Iterator[str]], ...] = (
    large_modules,
    large_functions,
    many_parameters,
    nameless_functions,
    riddles,
    undescribed,
)


def broken(rule, folder=PACKAGE):
    """List what breaks a rule in the sources of a folder."""
    found = []
    for path in sorted(folder.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        found += rule(path.relative_to(ROOT).as_posix(), ast.parse(text), text.splitlines())
    return found


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_sources_keep_the_rules(rule):
    assert broken(rule) == []


def test_only_packages_stand_at_the_top():
    assert {path.name for path in PACKAGE.iterdir() if path.is_file()} == {"__init__.py", "py.typed"}


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_rules_find_what_breaks_them(rule):
    long = "".join(f"    x = {i}\n" for i in range(MAX_LINES))
    parameters = ", ".join(f"a{i}" for i in range(MAX_PARAMETERS + 1))
    source = f'def _({parameters}):\n    """Whether it is."""\n{long}\n\ndef plain():\n    pass\n'
    assert list(rule("raytracer/analysis/made_up.py", ast.parse(source), source.splitlines()))


if __name__ == "__main__":
    print(*(line for rule in RULES for line in broken(rule, ROOT / sys.argv[1] if sys.argv[1:] else PACKAGE)), sep="\n")
