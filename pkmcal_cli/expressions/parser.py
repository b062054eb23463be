"""Expressions of numbers and names: read through an ast whitelist, compiled to closures.

A checked tree (`ast.expr`) is bound to units and dimensions elsewhere (`binding`), which makes a
`Term`: a nested tuple with SI numbers. `compile_term` turns a term into a fast function.
"""

from __future__ import annotations

import ast
import keyword
import math
import re
from collections.abc import Callable, Mapping
from operator import add, mul, neg, sub
from typing import Any

from pkmcal_cli.base.errors import did_you_mean
from pkmcal_cli.expressions.analytic import ARGUMENTS, FUNCTIONS, divide, power

MAX_LENGTH = 500
MAX_DEPTH = 60
CONSTANTS = {"pi": math.pi}
RESERVED = frozenset({*FUNCTIONS, *CONSTANTS, *keyword.kwlist, "home"})
"""Names that a parameter cannot have."""

Term = tuple[Any, ...]
"""("number", x), ("name", n), ("neg", t), ("add" | "sub" | "mul" | "div" | "pow", a, b),
("call", function, a, ...)."""
Evaluate = Callable[[Mapping[str, complex]], complex]

_CHARACTERS = re.compile(r"[A-Za-z0-9_+\-*/^(),.\s]*")
_GLUED = re.compile(r"(?<![A-Za-z0-9_.])(?>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)[A-Za-z_]\w*")
_NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_IN_A_ROW = re.compile(r"[*/^]\s*[*/^]")
"""Two operators, once `**` is written as `^`."""
OPERATORS = {"+": "sum", "-": "difference, sign", "*": "product", "/": "quotient", "^": "power", "**": "power"}
ALL_OPERATORS = (
    f"operators: {', '.join(f'`{o}`' for o in OPERATORS)} (`^` and `**` are the same); "
    f"functions: {', '.join(FUNCTIONS)}; constants: {', '.join(CONSTANTS)}"
)
"""What an expression may be made of, as a hint."""
_HINTS = {
    **dict.fromkeys("=<>!&|~@", ALL_OPERATORS),
    **dict.fromkeys("\u00b7\u00d7", "write `*` for a product"),
    "÷": "write `/` for a quotient",
    "²": "write `^2` for a square",
    "³": "write `^3` for a cube",
    "\u2212": "write a plain minus sign `-`",
    "{": 'quote the text: "{i}" (braces are for `each`)',
    ":": "write a number, a text with a unit or an expression, not a time or base-60 number",
    "%": f"divide by 100 instead of writing percent; {ALL_OPERATORS}",
    "°": "write an angle as a number in the file's unit, or with its unit: `30 deg`",
}
_MARKS, _MARKED = "\"'\u2032\u2033", "write seconds of arc as `5 arcsec`, minutes as `5 arcmin`, inches as `5 in`"
_OPERATORS: dict[type[ast.operator], str] = {
    ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div", ast.Pow: "pow",
}  # fmt: skip


class ExpressionError(ValueError):
    """A text is no expression: what is wrong, at which offset in the text, and a hint."""

    def __init__(self, message: str, offset: int = 0, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.offset = offset
        self.hint = hint


def parse_expression(text: str) -> ast.expr:
    """The checked tree of an expression; raises `ExpressionError`.

    Allowed are numbers, names, + - * / and ^ or **, parentheses, pi and the table of functions. A power binds as in
    Python: tighter than a sign before it, and from right to left.
    """
    if text.isidentifier() and text.isascii() and not keyword.iskeyword(text):
        if text in FUNCTIONS:
            raise ExpressionError(f"function `{text}` has no argument", 0, f"write `{text}(...)`")
        return ast.Name(text, ast.Load(), lineno=1, col_offset=0, end_col_offset=len(text))
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters; the maximum is {MAX_LENGTH}",
            0,
            "replace parts of it by parameters",
        )
    good = _CHARACTERS.match(text)
    end = good.end() if good else 0
    if end < len(text):
        char = text[end]
        quoted = char in _MARKS and _NUMBER.fullmatch(text[:end].strip().lstrip("+-"))
        hint = _MARKED if quoted else _HINTS.get(char, EXAMPLE)
        raise ExpressionError(f"`{char}` is not allowed in an expression", end, hint)
    glued = _GLUED.search(text)
    if glued is not None:
        message = f"`{glued[0]}` is neither a number nor a name"
        hint = "write `*` between a number and a name"
        if "_" in glued[0]:
            hint = "write digits without grouping: 1000, not 1_000"
        raise ExpressionError(message, glued.start(), hint)
    tree = _parse(text)
    _check(tree, text, 0)
    return tree


def _parse(text: str) -> ast.expr:
    flat = re.sub(r"\s", " ", text)
    start = len(flat) - len(flat.lstrip())
    stripped = flat.strip()
    try:
        tree = ast.parse(stripped.replace("^", "**"), mode="eval").body
    except SyntaxError:
        message = f"`{text}` is not a number, a value with a unit or an expression"
        raise ExpressionError(message, start, _syntax_hint(text)) from None
    except (RecursionError, MemoryError, ValueError):
        raise ExpressionError("the expression is too deeply nested", 0, EXAMPLE) from None
    places = [start + k for k, char in enumerate(stripped) for _ in range(2 if char == "^" else 1)]
    places.append(start + len(stripped))
    for node in ast.walk(tree):
        if isinstance(node, ast.expr):
            node.col_offset, node.end_col_offset = places[node.col_offset], places[node.end_col_offset or 0]
    return tree


UNIT_HINT = "write a unit only after a single number; in an expression use the file's units, or a parameter"
EXAMPLE = "write, for example, `-d1`, `20/255/2`, `r*cos(2*pi/3)` or `12 um`"


def _syntax_hint(text: str) -> str:
    if re.match(r"\s*[+-]?\d+,\d", text):
        return "write a decimal point, not a comma"
    if re.search(r"(?<![A-Za-z0-9_])[\d.]+\s+[A-Za-z]", text):
        return UNIT_HINT
    return ALL_OPERATORS if _IN_A_ROW.search(text.replace("**", "^")) else EXAMPLE


def _check(node: ast.expr, text: str, depth: int) -> None:
    """Refuse everything outside the whitelist."""
    if depth > MAX_DEPTH:
        raise ExpressionError("the expression is too deeply nested", node.col_offset)
    if isinstance(node, ast.Constant):
        _check_number(node, text)
    elif isinstance(node, ast.Name):
        if node.id in FUNCTIONS:
            message = f"function `{node.id}` has no argument"
            raise ExpressionError(message, node.col_offset, f"write `{node.id}(...)`")
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
        _check(node.operand, text, depth + 1)
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        _check(node.left, text, depth + 1)
        _check(node.right, text, depth + 1)
    elif isinstance(node, ast.Call):
        _check_call(node, text, depth)
    else:
        message = f"`{source_of(node, text)}` is not allowed in an expression"
        wrong_operator = isinstance(node, ast.BinOp | ast.BoolOp | ast.Compare | ast.UnaryOp | ast.IfExp)
        raise ExpressionError(message, node.col_offset, ALL_OPERATORS if wrong_operator else _syntax_hint(text))


def _check_number(node: ast.Constant, text: str) -> None:
    written = source_of(node, text)
    if type(node.value) not in (int, float) or not _NUMBER.fullmatch(written):
        raise ExpressionError(f"`{written}` is not a number", node.col_offset, EXAMPLE)
    if not math.isfinite(float(written)):
        raise ExpressionError(f"the number `{written[:20]}` is too large", node.col_offset)


def _check_call(node: ast.Call, text: str, depth: int) -> None:
    if not isinstance(node.func, ast.Name):
        raise ExpressionError(
            f"`{source_of(node.func, text)}` cannot be called", node.col_offset, "write `*` for a product"
        )
    name = node.func.id
    if name not in FUNCTIONS:
        hint = did_you_mean(name, FUNCTIONS, "use one of " + ", ".join(FUNCTIONS))
        raise ExpressionError(f"unknown function `{name}`", node.func.col_offset, hint)
    least, most = ARGUMENTS.get(name, (1, 1))
    if node.keywords or not least <= len(node.args) <= most:
        count = str(least) if least == most else f"{least} to {most}"
        plural = "argument" if count == "1" else "arguments"
        raise ExpressionError(f"`{name}` takes {count} {plural}", node.col_offset, EXAMPLE)
    for argument in node.args:
        _check(argument, text, depth + 1)


def source_of(node: ast.expr, text: str) -> str:
    """The part of the text that a node was read from."""
    return text[node.col_offset : node.end_col_offset]


def operator_of(node: ast.BinOp) -> str:
    """The term's word for a binary operator: add, sub, mul, div, pow."""
    return _OPERATORS[type(node.op)]


def names_of(tree: ast.expr) -> tuple[str, ...]:
    """The names that an expression uses, in order of appearance."""
    if isinstance(tree, ast.Name):
        return () if tree.id in CONSTANTS else (tree.id,)
    called = {id(n.func) for n in ast.walk(tree) if isinstance(n, ast.Call)}
    names = [n for n in ast.walk(tree) if isinstance(n, ast.Name) and id(n) not in called]
    names.sort(key=lambda n: n.col_offset)
    return tuple(dict.fromkeys(n.id for n in names if n.id not in CONSTANTS))


_BINARY: dict[str, Callable[[complex, complex], complex]] = {
    "add": add, "sub": sub, "mul": mul, "div": divide, "pow": power,
}  # fmt: skip


def fold(term: Term) -> Term:
    """The term as a number when all its parts are numbers.

    Raises ValueError, ZeroDivisionError or OverflowError where it has no finite value.
    """
    parts = term[2:] if term[0] == "call" else term[1:]
    if term[0] in ("number", "name") or any(part[0] != "number" for part in parts):
        return term
    value = compile_term(term)({}).real
    if not math.isfinite(value):
        raise OverflowError
    return ("number", value)


def compile_term(term: Term) -> Evaluate:
    """A function of the parameters' values (SI); exceptions as in `analytic`."""
    kind = term[0]
    if kind == "number":
        number: float = term[1]
        return lambda values: number
    if kind == "name":
        name: str = term[1]
        return lambda values: values[name]
    if kind == "neg":
        inner = compile_term(term[1])
        return lambda values: neg(inner(values))
    if kind == "call":
        return _compile_call(term)
    return _compile_binary(_BINARY[kind], term[1], term[2])


def _compile_call(term: Term) -> Evaluate:
    function = FUNCTIONS[term[1]]
    arguments = tuple(compile_term(t) for t in term[2:])
    if len(arguments) == 1:
        only = arguments[0]
        return lambda values: function(only(values))
    return lambda values: function(*(a(values) for a in arguments))


def _compile_binary(operate: Callable[[complex, complex], complex], left: Term, right: Term) -> Evaluate:
    """Leaves that are names or numbers are read without a further call."""
    if left[0] == "name" and right[0] == "name":
        a_name, b_name = left[1], right[1]
        return lambda values: operate(values[a_name], values[b_name])
    if left[0] == "number":
        a_number, b = left[1], compile_term(right)
        return lambda values: operate(a_number, b(values))
    if right[0] == "number":
        a, b_number = compile_term(left), right[1]
        return lambda values: operate(a(values), b_number)
    a, b = compile_term(left), compile_term(right)
    return lambda values: operate(a(values), b(values))
