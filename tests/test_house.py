"""The form of the source tree: sizes, names, docstrings and reasons that newcomers can rely on.

python -m tests.test_house [FOLDER]     lists what breaks a rule, of a folder's files
"""

import ast
import functools
import operator
import re
import sys
from itertools import chain

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

_POSSESSIVE = re.compile(rb"\)(?:[*+?]|\{\d*,?\d*\})\+")

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


# ---- No magic epsilon: a small number that decides anything has a name, and a text that says where it comes from

SMALL = 1e-2
"""Below this, in magnitude, a literal may be a tolerance; what is larger is a fraction that says what it is."""

_OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
_OPERATORS[ast.Pow] = operator.pow
_DECIDES = {"min", "max", "minimum", "maximum", "fmin", "fmax", "clip", "clamp", "where", "isclose", "allclose"}
_TOLERANCES = {"atol", "rtol", "abs_tol", "rel_tol", "eps", "epsilon", "tol", "tolerance"}


def value_of(node):
    """The number that an expression of literals is, None for others."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            value = value_of(operand)
            return None if value is None else -value
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            first, second = value_of(left), value_of(right)
            return None if first is None or second is None else float(_OPERATORS[type(op)](first, second))
    return None


def smalls(node):
    """The small numbers in an expression."""
    value = value_of(node) if isinstance(node, ast.expr) else None
    if value is not None and 0.0 < abs(value) < SMALL:
        yield node
        return
    for child in ast.iter_child_nodes(node):
        yield from smalls(child)


def is_told(body, place, lines):
    """Tell if a statement has a docstring after it, or a comment before it."""
    after = body[place + 1] if place + 1 < len(body) else None
    if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str):
        return True
    before = body[place].lineno - 2
    return before >= 0 and lines[before].lstrip().startswith("#")


def constants(body):
    """The names of small numbers of a module, and where in its body they are given."""
    for place, statement in enumerate(body):
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value and any(smalls(statement.value)):
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            for name in chain(*map(ast.walk, targets)):
                if isinstance(name, ast.Name):
                    yield name.id, place


def defaults(function):
    """The arguments of a function and their defaults."""
    places = [*function.args.posonlyargs, *function.args.args]
    yield from zip(places[::-1], function.args.defaults[::-1], strict=False)
    yield from ((a, d) for a, d in zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True) if d)


def locals_of(nodes):
    """The names that functions themselves give to small numbers; defaults that a docstring explains are left out."""
    for function in nodes:
        if not isinstance(function, ast.FunctionDef):
            continue
        text = ast.get_docstring(function) or ""
        for argument, default in defaults(function):
            if f"{argument.arg} :" not in text and default in smalls(default):
                yield argument.arg, default
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and node.value in smalls(node.value):
                yield from ((target.id, node.value) for target in node.targets if isinstance(target, ast.Name))


def deciding(nodes):
    """The parts of expressions in which a number decides: compared, a bound, a tolerance, added to a denominator."""
    for node in nodes:
        if isinstance(node, ast.Compare):
            yield from (node.left, *node.comparators)
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in _DECIDES:
                yield from node.args
            yield from (each.value for each in node.keywords if name in _DECIDES or each.arg in _TOLERANCES)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div | ast.FloorDiv | ast.Mod):
            sums = (found for found in ast.walk(node.right) if isinstance(found, ast.BinOp))
            yield from (found for found in sums if isinstance(found.op, ast.Add | ast.Sub))
        elif isinstance(node, ast.FunctionDef):
            yield from (default for argument, default in defaults(node) if argument.arg in _TOLERANCES)


def unexplained_numbers(name, nodes, source):
    """Find lines in which a small number decides and has no name, or a name without a text."""
    parts, body = list(deciding(nodes)), nodes[0].body
    found = {small.lineno for part in parts for small in smalls(part)}
    named = {each.id for part in parts for each in ast.walk(part) if isinstance(each, ast.Name)}
    found |= {node.lineno for each, node in locals_of(nodes) if each in named}
    found |= {
        body[place].lineno for each, place in constants(body) if each in named and not is_told(body, place, source)
    }
    yield from (f"{name}:{number}: {source[number - 1].strip()}" for number in sorted(found))


def possessive_groups(name, nodes, source):
    """Find patterns that Python before 3.11.5 matches wrongly (gh-106052): `(?>(?:a?b)+)` is the same, and right."""
    for node in nodes:
        text = node.value if isinstance(node, ast.Constant) else None
        if isinstance(text, str | bytes) and _POSSESSIVE.search(text.encode() if isinstance(text, str) else text):
            yield f"{name}:{node.lineno}: a group with a possessive quantifier"


RULES = (
    large_modules, large_functions, many_parameters, nameless_functions, riddles, undescribed, unexplained_numbers,
    possessive_groups,
)  # fmt: skip
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
    odd = 'y = x < 1e-9, r"(?:a?b){3,}+"'
    source = f'def _({parameters}):\n    """Whether it is."""\n{long}    {odd}\n\ndef plain():\n    pass\n'
    assert list(rule("raytracer/analysis/made_up.py", *parsed(source)))


@pytest.mark.parametrize(
    "snippet",
    [
        "if cosine < 1e-6:\n    pass",
        "near = abs(a - b) <= 1e-9 * abs(b)",
        "t_min = max(t, 0.001)",
        "pdf = np.maximum(pdf, 1e-12)",
        "weight = a / (a + b + 1e-8)",
        "inverse = 1.0 / (determinant - 2.0**-40)",
        "x = value if value > -1e-4 else 0.0",
        "same = np.allclose(a, b, rtol=0.0, atol=1e-12)",
        "def near(a, b, eps=1e-9):\n    return abs(a - b) < eps",
        "_EPSILON = 1e-4\n\n\ndef hit(t):\n    return t > _EPSILON",
        "ok = abs(x) < 10.0**-6",
        "def hit(t):\n    near = 1e-3\n    return t > near",
        "def hit(t, nearest=1e-3):\n    return t > nearest",
    ],
)
def test_such_numbers_are_found(snippet):
    assert len(list(unexplained_numbers("", *parsed(snippet)))) == 1


@pytest.mark.parametrize(
    "snippet",
    [
        "if cosine <= 0.0:\n    pass",
        "metres = 1e-3 * millimetres",
        '_ULPS = 4.0 * 2.0**-23\n"""Four ulps: the error of ..."""\n\n\ndef far(t):\n    return t > _ULPS',
        "share = part / (whole + 0.5)",
        "y = max(x, 0.0)",
        "def width(d):\n    pitch = 5e-3\n    return d * pitch",
        'def alike(p, alpha=1e-3):\n    """Whether.\n\n    alpha : the false alarms."""\n    return p > alpha',
    ],
)
def test_other_numbers_are_not(snippet):
    assert not list(unexplained_numbers("", *parsed(snippet)))


if __name__ == "__main__":
    where = ROOT / sys.argv[1] if sys.argv[1:] else PACKAGE
    print(*(line for module in sources(where) for rule in RULES for line in rule(*module)), sep="\n")
