"""Dimensions of parameters, inferred from the fields in which they are used."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from dataclasses import dataclass, field

from pkmcal_cli.expressions.parser import CONSTANTS, operator_of
from pkmcal_cli.units.dimensions import ANGLE, NUMBER, Dimension

_BARE = "bare"
_UNKNOWN = "unknown"
_SAME = ("abs", "min", "max", "hypot")


@dataclass
class Inference:
    """Finds the dimensions of names; `known` grows, `origin` tells from which use (its index).

    First a name that stands alone, with a sign, in a sum or times a bare number takes the
    field's dimension; names left over take what products, quotients and functions leave.
    """

    known: dict[str, Dimension]
    origin: dict[str, int] = field(default_factory=dict)
    _use: int = 0
    _wide: bool = False

    def run(self, uses: Iterable[tuple[ast.expr, Dimension]]) -> None:
        """Infer from all uses: the tree of a field's expression and the field's dimension."""
        listed = list(uses)
        progress = True
        while progress:
            progress = False
            for self._wide in (False, True):
                before = len(self.known)
                for self._use, (tree, dimension) in enumerate(listed):
                    self._spread(tree, dimension)
                if len(self.known) > before:
                    progress = True
                    break

    def _learn(self, name: str, dimension: Dimension) -> None:
        if name not in self.known and name not in CONSTANTS:
            self.known[name] = dimension
            self.origin[name] = self._use

    def _spread(self, node: ast.expr, dimension: Dimension | None) -> None:
        """The node has this dimension (None: not known): what follows for the names in it."""
        if isinstance(node, ast.Name):
            if dimension is not None:
                self._learn(node.id, dimension)
        elif isinstance(node, ast.UnaryOp):
            self._spread(node.operand, dimension)
        elif isinstance(node, ast.BinOp):
            self._binary(node, dimension)
        elif isinstance(node, ast.Call):
            self._call(node, dimension)

    def _binary(self, node: ast.BinOp, dimension: Dimension | None) -> None:
        kind = operator_of(node)
        if kind in ("add", "sub"):
            shared = dimension if self._wide is False else self._common([node.left, node.right])
            shared = shared or dimension
            self._spread(node.left, shared)
            self._spread(node.right, shared)
            return
        left, right = self._of(node.left), self._of(node.right)
        if kind == "pow":
            self._spread(node.right, NUMBER)
            self._spread(node.left, self._root(node, dimension))
            return
        self._spread(node.left, self._factor(dimension, right, kind == "div"))
        if kind == "mul":
            self._spread(node.right, self._factor(dimension, left, False))
        else:
            self._spread(node.right, self._divisor(dimension, left))

    def _factor(self, whole: Dimension | None, other: Dimension | str, divided: bool) -> Dimension | None:
        """What a factor is when the whole and the other factor (or the divisor) are known."""
        if whole is None or other == _BARE:
            return whole
        if not self._wide or not isinstance(other, Dimension):
            return None
        return whole * other if divided else whole / other

    def _divisor(self, whole: Dimension | None, left: Dimension | str) -> Dimension | None:
        if whole is None or not self._wide or left == _UNKNOWN:
            return None
        return (left if isinstance(left, Dimension) else NUMBER) / whole

    def _root(self, node: ast.BinOp, dimension: Dimension | None) -> Dimension | None:
        exponent = node.right
        if dimension is None or not self._wide or not isinstance(exponent, ast.Constant):
            return None
        power = exponent.value
        if isinstance(power, int | float) and power:
            return dimension ** (1 / power)
        return None

    def _call(self, node: ast.Call, dimension: Dimension | None) -> None:
        assert isinstance(node.func, ast.Name)
        name = node.func.id
        inner: Dimension | None = NUMBER
        if name in _SAME:
            inner = dimension
        elif name == "sqrt":
            inner = None if dimension is None else dimension**2
        elif name in ("sin", "cos", "tan"):
            inner = ANGLE
        elif name == "atan2":
            inner = self._common(node.args)
        for argument in node.args:
            self._spread(argument, inner)

    def _common(self, nodes: Iterable[ast.expr]) -> Dimension | None:
        """The dimension of the first node that has one."""
        return next((d for d in map(self._of, nodes) if isinstance(d, Dimension)), None)

    def _of(self, node: ast.expr) -> Dimension | str:
        """The dimension of a node, bare, or unknown."""
        if isinstance(node, ast.Constant):
            return _BARE
        if isinstance(node, ast.Name):
            return _BARE if node.id in CONSTANTS else self.known.get(node.id, _UNKNOWN)
        if isinstance(node, ast.UnaryOp):
            return self._of(node.operand)
        if isinstance(node, ast.BinOp):
            return self._of_binary(node)
        assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        return self._of_call(node.func.id, node.args)

    def _of_binary(self, node: ast.BinOp) -> Dimension | str:
        kind = operator_of(node)
        left, right = self._of(node.left), self._of(node.right)
        if kind in ("add", "sub"):
            return self._either([left, right])
        if kind == "pow":
            if isinstance(left, Dimension) and isinstance(node.right, ast.Constant):
                return left ** float(str(node.right.value))
            return left if left == _BARE else _UNKNOWN
        if _UNKNOWN in (left, right):
            return _UNKNOWN
        if left == _BARE and right == _BARE:
            return _BARE
        a = left if isinstance(left, Dimension) else NUMBER
        b = right if isinstance(right, Dimension) else NUMBER
        return a * b if kind == "mul" else a / b

    def _of_call(self, name: str, arguments: list[ast.expr]) -> Dimension | str:
        if name in _SAME:
            return self._either([self._of(a) for a in arguments])
        if name == "sqrt":
            inner = self._of(arguments[0])
            return inner**0.5 if isinstance(inner, Dimension) else inner
        return ANGLE if name in ("asin", "acos", "atan", "atan2") else _BARE

    @staticmethod
    def _either(dimensions: list[Dimension | str]) -> Dimension | str:
        known = next((d for d in dimensions if isinstance(d, Dimension)), None)
        if known is not None:
            return known
        return _UNKNOWN if _UNKNOWN in dimensions else _BARE
