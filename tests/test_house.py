"""The form of the source tree: sizes, names and docstrings that newcomers can rely on.

python -m tests.test_house [FOLDER]     lists what breaks a rule, of a folder's files
"""

import ast
import functools
import sys

import pytest

from tests.repository import ROOT

PACKAGE = ROOT / "raytracer"
MAX_LINES = 400
MAX_CODE_LINES = 60
MAX_PARAMETERS = 8

# Arguments of kernels are scalars in registers; those of commands are their options.
MANY_PARAMETERS = tuple(f"raytracer/{name}/" for name in ("core", "kernel", "optics/lens_system", "plugins", "cli"))

# First words with which a docstring asks a riddle in place of an answer.
RIDDLES = ("What becomes", "Whether", "Where ", "How ", "That ", "Who ", "Why ")

FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def functions(nodes):
    return (node for node in nodes if isinstance(node, FUNCTIONS))


def large_modules(name, nodes, source):
    """Find a module of too many lines."""
    if len(source) > MAX_LINES:
        yield f"{name}: {len(source)} lines"


def large_functions(name, nodes, source):
    """Find functions of too many lines that hold code: no docstring, no comment, nothing blank."""
    for function in functions(nodes):
        body = function.body[ast.get_docstring(function) is not None :]
        lines = source[body[0].lineno - 1 : body[-1].end_lineno] if body else []
        count = sum(1 for line in lines if line.strip() and not line.strip().startswith("#"))
        if count > MAX_CODE_LINES:
            yield f"{name}:{function.lineno}: {function.name} has {count} lines of code"


def many_parameters(name, nodes, source):
    """Find functions with too many parameters."""
    for function in () if name.startswith(MANY_PARAMETERS) else functions(nodes):
        given = function.args
        count = len(given.posonlyargs + given.args + given.kwonlyargs)
        count -= bool(given.args) and given.args[0].arg in {"self", "cls"}
        if count > MAX_PARAMETERS:
            yield f"{name}:{function.lineno}: {function.name} has {count} parameters"


def nameless_functions(name, nodes, source):
    """Find functions that no traceback and no search can name."""
    yield from (f"{name}:{each.lineno}: a function is called _" for each in functions(nodes) if each.name == "_")


def riddles(name, nodes, source):
    """Find docstrings that open with a question."""
    for node in nodes:
        text = ast.get_docstring(node) if isinstance(node, (*FUNCTIONS, ast.Module, ast.ClassDef)) else None
        if text is not None and text.startswith(RIDDLES):
            yield f"{name}:{getattr(node, 'lineno', 1)}: {text.splitlines()[0]}"


def undescribed(name, nodes, source):
    """Find public functions without a docstring; a case of a generic has that of its generic."""
    for node in () if name.endswith("core/vec.py") else nodes[0].body:
        if not isinstance(node, ast.FunctionDef) or node.name.startswith("_") or ast.get_docstring(node):
            continue
        if not any(ast.unparse(each).split("(")[0].endswith(".register") for each in node.decorator_list):
            yield f"{name}:{node.lineno}: {node.name} has no docstring"


RULES = (large_modules, large_functions, many_parameters, nameless_functions, riddles, undescribed)
EVERY_RULE = pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)


def parsed(text):
    """All nodes of a module, itself first, and its lines."""
    return list(ast.walk(ast.parse(text))), text.splitlines()


@functools.cache
def sources(folder=PACKAGE):
    """Names, nodes and lines of the modules of a folder."""
    return [
        (path.relative_to(ROOT).as_posix(), *parsed(path.read_text(encoding="utf-8")))
        for path in sorted(folder.rglob("*.py"))
    ]


@EVERY_RULE
def test_sources_keep_the_rules(rule):
    assert [each for module in sources() for each in rule(*module)] == []


def test_only_packages_stand_at_the_top():
    assert {path.name for path in PACKAGE.iterdir() if path.is_file()} == {"__init__.py", "py.typed"}


@EVERY_RULE
def test_rules_find_what_breaks_them(rule):
    long = "".join(f"    x = {i}\n" for i in range(MAX_LINES))
    parameters = ", ".join(f"a{i}" for i in range(MAX_PARAMETERS + 1))
    source = f'def _({parameters}):\n    """Whether it is."""\n{long}\n\ndef plain():\n    pass\n'
    assert list(rule("raytracer/analysis/made_up.py", *parsed(source)))


if __name__ == "__main__":
    where = ROOT / sys.argv[1] if sys.argv[1:] else PACKAGE
    print(*(line for module in sources(where) for rule in RULES for line in rule(*module)), sep="\n")
