"""Quantities: the numeric leaves of a machine.

In the file a quantity is a number, a text "number unit", a parameter's name or an expression.
`Measure` marks a field as a quantity of a dimension; reading makes a `WrittenValue` (checked, but not
yet bound to units), and binding makes the `Quantity` that the engine evaluates.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema
from typing_extensions import TypeVar

from pkmcal_cli.expressions.parser import (
    EXAMPLE,
    Evaluate,
    ExpressionError,
    Term,
    compile_term,
    names_of,
    parse_expression,
)
from pkmcal_cli.units.dimensions import NUMBER, Dimension
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_unit, split_value
from pkmcal_cli.yaml_source.tree import Pasted

_FAILURES = (ValueError, ZeroDivisionError, OverflowError)


@dataclass(frozen=True)
class Quantity:
    """A numeric leaf of a machine, resolved: SI in, SI out.

    `text` as written, `dimension` of the field, `names` of the parameters that it uses (empty
    for a constant), `term` the expression with SI numbers.
    """

    text: str
    dimension: Dimension
    names: tuple[str, ...] = ()
    term: Term = ("number", 0.0)
    _function: Evaluate = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_function", compile_term(self.term))

    def __reduce__(self) -> tuple[Any, ...]:
        return Quantity, (self.text, self.dimension, self.names, self.term)

    @classmethod
    def constant(cls, si_value: float, dimension: Dimension = NUMBER) -> Quantity:
        """A constant of the given SI value."""
        return cls(f"{si_value:g}", dimension, (), ("number", float(si_value)))

    def value(self, values: Mapping[str, complex]) -> complex:
        """The value (SI) at the parameters' values (SI).

        A float for floats; complex values pass analytically (derivative by complex step).
        Where an expression has no value (sqrt of a negative number) the result is nan.
        Raises KeyError when a name of `names` is missing in `values`.
        """
        try:
            return self._function(values)
        except _FAILURES:
            return math.nan

    def number(self, values: Mapping[str, float]) -> float:
        """`value` for floats, typed as float."""
        return self.value(values).real

    @property
    def is_constant(self) -> bool:
        """True when no parameter is used."""
        return not self.names


@dataclass(frozen=True)
class WrittenValue:
    """A quantity as read: its tree or its number with unit, not yet bound to the file's units.

    `unknown_unit`: the text after the number where it is no unit; binding tells so, since it knows which would fit.
    """

    text: str
    measure: Measure
    tree: ast.expr | None
    number: float = 0.0
    unit: Unit | None = None
    unknown_unit: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """The names that it uses."""
        return names_of(self.tree) if self.tree is not None else ()


Written: TypeAlias = WrittenValue | Quantity
WrittenNumber: TypeAlias = WrittenValue | float
"""Values of entries and of parameters before they have units: those of the file, and the defaults."""
V = TypeVar("V", default=Quantity)
F = TypeVar("F", default=float)
"""Values of entries and of parameters: `Written` and `WrittenNumber`, then `Quantity` and float (SI)."""


@dataclass(frozen=True)
class Measure:
    """Marks a field as a quantity.

    `dimension` of the field; `others` that a field may have besides (a bare number takes the
    first); `plausible` the range of magnitudes (SI) outside of which a guess is made; `words` that
    may stand instead of a quantity; `sign` "+" for positive, "0+" for not negative, "+-" for not zero.
    """

    dimension: Dimension
    others: tuple[Dimension, ...] = ()
    plausible: tuple[float, float] | None = None
    words: tuple[str, ...] = ()
    sign: str = ""

    @property
    def dimensions(self) -> tuple[Dimension, ...]:
        """All dimensions that the field may have."""
        return (self.dimension, *self.others)

    def read(self, raw: object) -> WrittenValue | Quantity | str:
        """The raw value of a file, checked; raises PydanticCustomError."""
        if isinstance(raw, WrittenValue | Quantity):
            return raw
        if isinstance(raw, str) and raw in self.words:
            return raw
        if isinstance(raw, bool) or not isinstance(raw, int | float | str):
            raise fault("type", f"expected a number or text, found {kind_of(raw)}", hint_of(raw))
        if not isinstance(raw, str):
            if not math.isfinite(raw):
                raise fault("value", "expected a finite number")
            return WrittenValue(f"{raw!r}", self, None, float(raw))
        return self._read_text(raw)

    def _read_text(self, raw: str) -> WrittenValue:
        if not raw.strip():
            raise fault("value", "expected a number or text, found an empty text")
        parts = split_value(raw)
        if parts is not None:
            if not math.isfinite(parts[0]):
                raise fault("value", f"the number `{raw}` is too large")
            try:
                return WrittenValue(raw, self, None, parts[0], parse_unit(parts[1]) if parts[1] else None)
            except UnitError:
                return WrittenValue(raw, self, None, parts[0], None, parts[1] or "")
        raw = raw.expression if isinstance(raw, Pasted) else raw
        try:
            return WrittenValue(raw, self, parse_expression(raw))
        except ExpressionError as error:
            raise fault("expression", error.message, error.hint, error.offset) from None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": ["number", "string"]}


def fault(code: str, message: str, hint: str | None = None, offset: int = 0) -> PydanticCustomError:
    """An error inside pydantic's validation that becomes a `Fault` of this code."""
    context = {"message": message, "hint": hint or "", "offset": offset, "code": code}
    return PydanticCustomError("pkmcal", "{message}", context)


def kind_of(raw: object) -> str:
    """What a raw value is, in words."""
    if raw is None:
        return "nothing"
    if isinstance(raw, bool):
        return f"`{str(raw).lower()}`"
    if isinstance(raw, dict):
        return "a map"
    if isinstance(raw, list | tuple):
        return "a list"
    return f"`{raw}`"


def hint_of(raw: object) -> str | None:
    """A remedy for frequent slips of the raw value's kind."""
    if isinstance(raw, dict) and len(raw) == 1 and list(raw.values()) == [None]:
        return f'quote a name in braces: "{{{next(iter(raw))}}}"'
    if raw is None or isinstance(raw, bool):
        return EXAMPLE
    return None
