"""No magic epsilon: a small number that decides anything has a name, and a text that says where it comes from."""

import ast
import operator
from itertools import chain

import pytest

from tests.test_house import parsed, sources

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


def strays(nodes, lines):
    """The lines of a module in which a small number decides and has no name, or a name without a text."""
    parts, body = list(deciding(nodes)), nodes[0].body
    found = {small.lineno for part in parts for small in smalls(part)}
    named = {name.id for part in parts for name in ast.walk(part) if isinstance(name, ast.Name)}
    found |= {node.lineno for name, node in locals_of(nodes) if name in named}
    for name, place in constants(body):
        if name in named and not is_told(body, place, lines):
            found.add(body[place].lineno)
    return [f"{number}: {lines[number - 1].strip()}" for number in sorted(found)]


def test_no_small_number_decides_without_a_reason():
    assert {name: found for name, *module in sources() if (found := strays(*module))} == {}


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
    assert len(strays(*parsed(snippet))) == 1


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
    assert strays(*parsed(snippet)) == []
