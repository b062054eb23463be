"""Binding of values as written: dimensions checked, bare numbers given their unit, the term made SI.

A plain number ("bare": only numbers, or a sine of something) has no dimension of its own: in a
sum it takes the file's unit of the other terms, as a result that of the field. What a sine is taken of is in rad.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pkmcal_cli.base.plural import with_article
from pkmcal_cli.expressions.parser import (
    CONSTANTS,
    UNIT_HINT,
    Term,
    fold,
    operator_of,
    source_of,
)
from pkmcal_cli.language.quantities import Quantity, WrittenValue
from pkmcal_cli.units.dimensions import ANGLE, DIMENSIONS, NUMBER, Dimension
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.letters import digits_hint
from pkmcal_cli.units.limits import HINT, beyond
from pkmcal_cli.units.unit_text import UNITS, Unit, UnitError, parse_unit

Typed = tuple[Term, Dimension | None]
"""A term in SI (as far as it has a dimension) and its dimension; None for a bare number."""

TURNING = ("sin", "cos", "tan")
"""Functions of an angle."""

_PARAMETER = re.compile(r"([A-Za-z_]+)[0-9]\w*")  # a name as parameters have, where the part before a digit is no unit
_NO_VALUE = (ValueError, ZeroDivisionError, OverflowError)


class Slip(ValueError):
    """A dimension does not fit, or an expression has no value: what, where in the text, remedy."""

    def __init__(self, message: str, offset: int = 0, hint: str | None = None, code: str = "dimension") -> None:
        super().__init__(message)
        self.message = message
        self.offset = offset
        self.hint = hint
        self.code = code


@dataclass(frozen=True)
class Binder:
    """Binds values as written of a file with these units and these dimensions of its parameters."""

    units: FileUnits
    dimensions: Mapping[str, Dimension]

    def bind(
        self,
        written: WrittenValue,
        expected: Sequence[Dimension] = (),
        bare: Unit | None = None,
        example: Unit | None = None,
    ) -> Quantity:
        """The quantity of a value; `expected`, `bare`: instead of the field's dimensions and the file's unit.

        `example`: the unit that a hint offers, instead of the one of a bare number. Raises `Slip`.
        """
        dimensions = tuple(expected) or written.measure.dimensions
        example = example or bare or self.units.unit(dimensions[0])
        if written.unknown_unit:
            raise unknown_unit(written, dimensions, example)
        if written.tree is None:
            unit = written.unit or bare or self.units.unit(dimensions[0])
            fitting = _fitting(unit.dimension, dimensions)
            if fitting is None and written.unit is not None:
                message = f"`{written.text}` is {article(unit.dimension)}; expected {_a_of(dimensions)}"
                raise Slip(message, 0, _unit_hint(example))
            term: Term = ("number", unit.to_si(written.number))
            return Quantity(written.text, fitting or dimensions[0], (), _sized(term, written))
        term, dimension = self.typed(written.tree, written.text)
        if dimension is None:
            unit = bare or self.units.unit(dimensions[0])
            term, dimension = self._scaled(term, unit, written.tree), dimensions[0]
        fitting = _fitting(dimension, dimensions)
        if fitting is None:
            message = f"`{written.text}` is {article(dimension)}; expected {_a_of(dimensions)}"
            raise Slip(message, written.tree.col_offset)
        return Quantity(written.text, fitting, written.names, _sized(term, written))

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
            message = f"`{source_of(node, text)}` has no finite value"
            hint = "check for a division by zero, a root of a negative number or an overflow"
            raise Slip(message, node.col_offset, hint, "value") from None

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
            message = f"exponent `{source_of(node.right, text)}` is {article(dimension)}"
            raise Slip(message, node.right.col_offset, "use a plain number as the exponent")
        if base is None or base == NUMBER:
            return base
        if term[0] != "number":
            message = f"`{source_of(node.left, text)}` is {article(base)}; its exponent must be a constant number"
            raise Slip(message, node.right.col_offset)
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
                message = (
                    f"cannot combine `{source_of(first, text)}` ({article(common)})"
                    f" with `{source_of(node, text)}` ({article(dimension)})"
                )
                raise Slip(message, node.col_offset)
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
        in_radians = replace(self, units=replace(self.units, angle=UNITS["rad"]))
        term, dimension = (in_radians if name in TURNING else self).typed(node.args[0], text)
        if name == "sqrt":
            return ("call", name, term), None if dimension is None else dimension**0.5
        allowed = (None, NUMBER, ANGLE) if name in TURNING else (None, NUMBER)
        if dimension not in allowed:
            expected = "an angle" if ANGLE in allowed else "a plain number"
            message = f"`{source_of(node.args[0], text)}` is {article(dimension)}; `{name}` expects {expected}"
            raise Slip(message, node.args[0].col_offset)
        return ("call", name, term), ANGLE if name in ("asin", "acos", "atan") else None


def unknown_unit(written: WrittenValue, fitting: tuple[Dimension, ...], example: Unit | None = None) -> Slip:
    """The slip of a value whose unit is none; only units that are `fitting` are suggested, where any is."""
    name = _PARAMETER.fullmatch(written.unknown_unit)
    if name is not None and name[1] not in UNITS:
        product = f"{written.number:g}*{name[0]}"
        return Slip(f"`{name[0]}` is not a unit", 0, f"write a product with `*`: `{product}`", "unit")
    try:
        parse_unit(written.unknown_unit, fitting)
    except UnitError as error:
        inside = re.search(r"\s[-+*]\s|[()]", written.unknown_unit)
        hint = UNIT_HINT if inside else error.hint or (None if example is None else _unit_hint(example))
        return Slip(error.message, 0, digits_hint(written.text) or hint, "unit")
    raise AssertionError(f"`{written.unknown_unit}` is a unit")


def _unit_hint(example: Unit) -> str:
    return "write a plain number" if example.text == "1" else f"use a unit such as `{example.text}`"


def _sized(term: Term, written: WrittenValue) -> Term:
    """The term itself; raises `Slip` for a number beyond what can be computed with."""
    wrong = beyond(term[1], written.tree is None) if term[0] == "number" else None
    if wrong is not None:
        raise Slip(f"`{written.text}` is {wrong}", 0, HINT, "value")
    return term


def _fitting(dimension: Dimension, expected: Sequence[Dimension]) -> Dimension | None:
    """The wanted dimension that a value has: the same one, else the same with rad = 1."""
    if dimension in expected:
        return dimension
    return next((each for each in expected if dimension.fits(each)), None)


def article(dimension: Dimension | None) -> str:
    """ "a length", "an angle"; for a dimension without a name its unit."""
    name = (dimension or NUMBER).name
    if dimension not in (None, *DIMENSIONS.values()):
        return f"a quantity in {name}"
    return with_article(name)


def _a_of(dimensions: Sequence[Dimension]) -> str:
    return " or ".join(article(each) for each in dict.fromkeys(dimensions))
