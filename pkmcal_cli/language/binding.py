"""Binding of drafts: dimensions checked, bare numbers given their unit, the term made SI.

A plain number ("bare": only numbers, or a sine of something) has no dimension of its own: in a
sum it takes the file's unit of the other terms, as a result that of the field.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pkmcal_cli.expressions.parse import (
    CONSTANTS,
    Term,
    fold,
    operator_of,
    source_of,
)
from pkmcal_cli.language.quantities import Draft, Quantity
from pkmcal_cli.units.dimensions import ANGLE, DIMENSIONS, NUMBER, Dimension
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.limits import HINT, beyond
from pkmcal_cli.units.unit_text import Unit

Typed = tuple[Term, Dimension | None]
"""A term in SI (as far as it has a dimension) and its dimension; None for a bare number."""

_NO_VALUE = (ValueError, ZeroDivisionError, OverflowError)


class Slip(ValueError):
    """A dimension does not fit, or an expression has no value: what, where in the text, remedy."""

    def __init__(self, what: str, offset: int = 0, hint: str | None = None, code: str = "dimension") -> None:
        super().__init__(what)
        self.what = what
        self.offset = offset
        self.hint = hint
        self.code = code


@dataclass(frozen=True)
class Binder:
    """Binds drafts of a file with these units and these dimensions of its parameters."""

    units: FileUnits
    dimensions: Mapping[str, Dimension]

    def bind(self, draft: Draft, wanted: Sequence[Dimension] = (), bare: Unit | None = None) -> Quantity:
        """The quantity of a draft; `wanted` instead of the field's dimensions, `bare` instead of
        the file's unit. Raises `Slip`."""
        dimensions = tuple(wanted) or draft.measure.dimensions
        if draft.tree is None:
            unit = draft.unit or bare or self.units.unit(dimensions[0])
            fitting = _fitting(unit.dimension, dimensions)
            if fitting is None and draft.unit is not None:
                what = f"`{draft.text}` is {article(unit.dimension)}, {_a_of(dimensions)} is wanted here"
                raise Slip(what, 0, self._unit_hint(dimensions[0]))
            term: Term = ("number", unit.to_si(draft.number))
            return Quantity(draft.text, fitting or dimensions[0], (), _sized(term, draft))
        term, dimension = self.typed(draft.tree, draft.text)
        if dimension is None:
            unit = bare or self.units.unit(dimensions[0])
            term, dimension = self._scaled(term, unit, draft.tree), dimensions[0]
        fitting = _fitting(dimension, dimensions)
        if fitting is None:
            what = f"`{draft.text}` is {article(dimension)}, {_a_of(dimensions)} is wanted here"
            raise Slip(what, draft.tree.col_offset)
        return Quantity(draft.text, fitting, draft.names, _sized(term, draft))

    def _unit_hint(self, dimension: Dimension) -> str:
        return f"give it in {self.units.unit(dimension).text}, for example"

    def _scaled(self, term: Term, unit: Unit, node: ast.expr) -> Term:
        """A bare term in a unit."""
        if term[0] == "number":
            return ("number", unit.to_si(term[1]))
        scale = unit.scale
        return term if scale == 1.0 else ("mul", ("number", scale), term)

    def typed(self, node: ast.expr, text: str) -> Typed:
        """The term and dimension of a tree; raises `Slip`."""
        try:
            term, dimension = self._typed(node, text)
            return fold(term), dimension
        except _NO_VALUE as error:
            if isinstance(error, Slip):
                raise
            what = f"`{source_of(node, text)}` has no finite value"
            hint = "check for a division by zero, a root of a negative number, an overflow"
            raise Slip(what, node.col_offset, hint, "value") from None

    def _typed(self, node: ast.expr, text: str) -> Typed:
        if isinstance(node, ast.Constant):
            assert isinstance(node.value, int | float)
            return ("number", float(node.value)), None
        if isinstance(node, ast.Name):
            if node.id in CONSTANTS:
                return ("number", CONSTANTS[node.id]), None
            return ("name", node.id), self.dimensions[node.id]
        if isinstance(node, ast.UnaryOp):
            term, dimension = self.typed(node.operand, text)
            return (term if isinstance(node.op, ast.UAdd) else ("neg", term)), dimension
        if isinstance(node, ast.BinOp):
            return self._binary(node, text)
        assert isinstance(node, ast.Call)
        return self._call(node, text)

    def _binary(self, node: ast.BinOp, text: str) -> Typed:
        kind = operator_of(node)
        if kind in ("add", "sub"):
            terms, dimension = self._alike([node.left, node.right], text)
            return (kind, *terms), dimension
        (left, a), (right, b) = self.typed(node.left, text), self.typed(node.right, text)
        if kind == "pow":
            return (kind, left, right), self._power(node, a, (right, b), text)
        if a is None and b is None:
            return (kind, left, right), None
        a, b = a or NUMBER, b or NUMBER
        return (kind, left, right), a * b if kind == "mul" else a / b

    def _power(self, node: ast.BinOp, base: Dimension | None, exponent: Typed, text: str) -> Dimension | None:
        term, dimension = exponent
        if dimension not in (None, NUMBER):
            what = f"exponent `{source_of(node.right, text)}` is {article(dimension)}"
            raise Slip(what, node.right.col_offset, "an exponent is a plain number")
        if base is None or base == NUMBER:
            return base
        if term[0] != "number":
            what = f"`{source_of(node.left, text)}` is {article(base)}: its exponent must be a number"
            raise Slip(what, node.right.col_offset)
        return base ** float(term[1])

    def _alike(self, nodes: list[ast.expr], text: str) -> tuple[list[Term], Dimension | None]:
        """Terms of a sum (or of min, max, hypot): of one dimension, bare ones in its unit."""
        typed = [self.typed(node, text) for node in nodes]
        common, first = None, nodes[0]
        for node, (_, dimension) in zip(nodes, typed, strict=True):
            if dimension is None:
                continue
            if common is None:
                common, first = dimension, node
            elif not dimension.fits(common):
                what = (
                    f"`{source_of(first, text)}` is {article(common)},"
                    f" `{source_of(node, text)}` is {article(dimension)}: they cannot be joined"
                )
                raise Slip(what, node.col_offset)
        if common is None:
            return [term for term, _ in typed], None
        unit = self.units.unit(common).difference
        pairs = zip(nodes, typed, strict=True)
        scaled = [self._scaled(t, unit, n) if d is None else t for n, (t, d) in pairs]
        return scaled, common

    def _call(self, node: ast.Call, text: str) -> Typed:
        assert isinstance(node.func, ast.Name)
        name = node.func.id
        if name in ("hypot", "min", "max", "atan2", "abs"):
            terms, dimension = self._alike(node.args, text)
            return ("call", name, *terms), ANGLE if name == "atan2" else dimension
        term, dimension = self.typed(node.args[0], text)
        if name == "sqrt":
            return ("call", name, term), None if dimension is None else dimension**0.5
        allowed = (None, NUMBER, ANGLE) if name in ("sin", "cos", "tan") else (None, NUMBER)
        if dimension not in allowed:
            wanted = "an angle" if ANGLE in allowed else "a plain number"
            what = f"`{source_of(node.args[0], text)}` is {article(dimension)}, `{name}` wants {wanted}"
            raise Slip(what, node.args[0].col_offset)
        return ("call", name, term), ANGLE if name in ("asin", "acos", "atan") else None


def _sized(term: Term, draft: Draft) -> Term:
    """The term itself; raises `Slip` for a number beyond what can be computed with."""
    wrong = beyond(term[1], draft.tree is None) if term[0] == "number" else None
    if wrong is not None:
        raise Slip(f"`{draft.text}` is {wrong}", 0, HINT, "value")
    return term


def _fitting(dimension: Dimension, wanted: Sequence[Dimension]) -> Dimension | None:
    """The wanted dimension that a value has: the same one, else the same with rad = 1."""
    if dimension in wanted:
        return dimension
    return next((each for each in wanted if dimension.fits(each)), None)


def article(dimension: Dimension | None) -> str:
    """ "a length", "an angle"; for a dimension without a name its unit."""
    name = (dimension or NUMBER).name
    if dimension not in (None, *DIMENSIONS.values()):
        return f"a quantity in {name}"
    return f"an {name}" if name[0] in "aeiou" else f"a {name}"


def _a_of(dimensions: Sequence[Dimension]) -> str:
    return " or ".join(article(each) for each in dict.fromkeys(dimensions))
