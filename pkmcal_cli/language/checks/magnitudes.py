"""Values at nominal: finite, of the right sign, and of a magnitude that is plausible for the field."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from pkmcal_cli.base.errors import Fault, FaultList, Location
from pkmcal_cli.base.plural import count
from pkmcal_cli.language.parts import Parameter
from pkmcal_cli.language.quantities import Quantity, WrittenNumber, WrittenValue
from pkmcal_cli.units.dimensions import (
    ANGLE,
    AREA,
    DENSITY,
    FORCE,
    LENGTH,
    MASS,
    MODULUS,
    NUMBER,
    ROTATIONAL_STIFFNESS,
    SECOND_MOMENT,
    STIFFNESS,
    Dimension,
)
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.limits import HINT, beyond
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap

MAX_WARNINGS = 10
_SLIP = 1e3 * (1 - 1e-9)
_SLIPS = {AREA: 100 * (1 - 1e-9)}  # mm^2 for cm^2

_CANDIDATES: dict[Dimension, tuple[str, ...]] = {
    LENGTH: ("nm", "um", "mm", "m"),
    FORCE: ("mN", "N", "kN", "MN"),
    MASS: ("g", "kg", "t"),
    ANGLE: ("urad", "arcsec", "mrad", "deg", "rad"),
    MODULUS: ("Pa", "kPa", "MPa", "GPa"),
    STIFFNESS: ("N/m", "N/mm", "N/um", "kN/mm"),
    DENSITY: ("kg/m^3", "g/cm^3", "kg/mm^3"),
    AREA: ("mm^2", "cm^2", "m^2"),
    SECOND_MOMENT: ("mm^4", "cm^4", "m^4"),
    ROTATIONAL_STIFFNESS: ("Nmm/rad", "Nm/rad", "kNm/rad"),
    NUMBER: ("mm/m",),
}


@dataclass(kw_only=True)
class MagnitudeCheck:
    """Checks bound quantities at the nominal values; faults and warnings are added.

    length_declared: whether the file says which unit lengths have.
    """

    parameters: Mapping[str, Parameter]
    declared: Mapping[str, Parameter[WrittenNumber]]
    units: FileUnits
    source: SourceMap
    faults: FaultList
    length_declared: bool = True
    values: dict[str, float] = field(init=False)
    _reported: set[Path] = field(default_factory=set)
    _warned: int = 0
    _undeclared: list[tuple[str, Fault]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.values = {name: p.nominal for name, p in self.parameters.items()}

    def check(self, path: Path, written: WrittenValue, quantity: Quantity) -> None:
        """One quantity with the value as written it was bound from."""
        values = self.values
        value = quantity.number(values)
        if not math.isfinite(value):
            if not any(math.isnan(values[name]) for name in quantity.names):
                message = f"`{written.text}` has no finite value at the nominal parameters"
                hint = "check the nominal values and the expression"
                self.faults.add(self.source.fault("value", message, path, hint))
            return
        unit = self.units.unit(quantity.dimension)
        shown = "" if written.tree is None else f" (value: {unit.format(value)})"
        if (wrong := beyond(value, written.measure.sign != "")) is not None:
            self.faults.add(self.source.fault("value", f"`{written.text}` is {wrong}{shown}", path, HINT))
        elif (broken := _broken(written.measure.sign, value)) is not None:
            must, hint = broken
            self.faults.add(self.source.fault("value", f"`{written.text}` must {must}{shown}", path, hint))
        else:
            self._check_plausible(path, written, quantity, abs(value))

    def _check_plausible(self, path: Path, written: WrittenValue, quantity: Quantity, value: float) -> None:
        plausible = written.measure.plausible
        if plausible is None or value == 0 or plausible[0] <= value <= plausible[1]:
            return
        label = next(str(part) for part in reversed(path) if isinstance(part, str))
        if isinstance(written.tree, ast.Name) and written.tree.id in self.declared:
            label = written.tree.id
            path = ("parameters", label, "nominal")
            nominal = self.declared[label].nominal
            unit_text = self.declared[label].unit
            if isinstance(nominal, WrittenValue):
                written = nominal
        else:
            unit_text = ""
        if path in self._reported:
            return
        self._reported.add(path)
        unit = written.unit or (parse_unit(unit_text) if unit_text else self.units.unit(quantity.dimension))
        self._warn(path, label, value, unit, plausible, quantity.dimension)

    def _warn(
        self, path: Path, label: str, value: float, unit: Unit, plausible: tuple[float, float],
        dimension: Dimension,
    ) -> None:  # fmt: skip
        number = value / unit.scale
        guess = unit_meant(number, unit, plausible, dimension)
        far = value > plausible[1] * _SLIP or value < plausible[0] / _SLIP
        if guess is None and not far:
            return
        message = f"{label} = {number:g} {unit.text}"
        message += f": did you mean {number:g} {guess}?" if guess else " is far outside the usual range"
        shown = self.units.unit(dimension)
        hint = f"check the unit; usual range: {shown.format(plausible[0], 3)} to {shown.format(plausible[1], 3)}"
        if plausible[0] == 0:
            hint = f"check the unit; usual range: up to {shown.format(plausible[1], 3)}"
        made: Fault = self.source.fault("magnitude", message, path, hint, warning=True)
        if guess and unit is self.units.length and not self.length_declared:
            self._undeclared.append((guess, made))
        else:
            self._add(made)

    def _add(self, warning: Fault) -> None:
        self._warned += 1
        if self._warned <= MAX_WARNINGS:
            self.faults.add(warning)

    def finish(self) -> None:
        """Warnings of lengths in a file that declares no unit of length: one, where there are several."""
        if len(self._undeclared) > 1:
            guess, first = min(self._undeclared, key=lambda each: each[1].where or Location("", 0))
            others = count(len(self._undeclared) - 1, "other length")
            message = f"{first.what.partition(': ')[0]} and {others}: did you mean {guess}?"
            hint = f"lengths are in m, since `units` names no other unit: add `units: {{length: {guess}}}`"
            self._add(replace(first, what=message, hint=hint))
        else:
            for _, warning in self._undeclared:
                self._add(warning)


def _broken(sign: str, value: float) -> tuple[str, str] | None:
    """What a field asks of its value that this one is not, and a remedy; None where all is well."""
    if sign == "+" and value <= 0:
        return "be positive", "check the sign" if value < 0 else "check the sign, or delete the key"
    if sign == "0+" and value < 0:
        return "be positive or zero", "check the sign"
    if sign == "+-" and value == 0:
        return "not be 0", "give a value other than 0, or delete the key (default: 1)"
    return None


def unit_meant(number: float, unit: Unit, plausible: tuple[float, float], dimension: Dimension) -> str | None:
    """The unit with which the same number would be plausible; None if there is none."""
    best: tuple[float, str] | None = None
    for text in _CANDIDATES.get(dimension, ()):
        candidate = parse_unit(text)
        value = number * candidate.scale
        ratio = candidate.scale / unit.scale
        if not plausible[0] <= value <= plausible[1] or max(ratio, 1 / ratio) < _SLIPS.get(dimension, _SLIP):
            continue
        if plausible[0] > 0:
            distance = abs(math.log(value / math.sqrt(plausible[0] * plausible[1])))
        else:
            distance = -value
        if best is None or distance < best[0]:
            best = (distance, text)
    return best[1] if best else None


def radian_warning(path: Path, written: WrittenValue, units: FileUnits, source: SourceMap) -> Fault | None:
    """A warning where pi and a file in degrees meet: `pi/2` as an angle, `cos(30)`."""
    if written.tree is None or units.angle.scale == 1.0:
        return None
    nodes = list(ast.walk(written.tree))
    uses_pi = any(isinstance(n, ast.Name) and n.id == "pi" for n in nodes)
    called = any(isinstance(n, ast.Call) for n in nodes)
    if uses_pi and not called and not written.names and ANGLE in written.measure.dimensions:
        message = f"`{written.text}` is read in {units.angle.text}, the angle unit of this file"
        hint = f"write the angle in {units.angle.text}, or with its unit: `1.5708 rad`"
        return source.fault("magnitude", message, path, hint, warning=True)
    for node in nodes:
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
            continue
        for number, column in _bare_terms(node.args[0]) if node.func.id in ("sin", "cos", "tan") else ():
            if number > 2 * math.pi:
                whole, inside = ast.unparse(node), ast.unparse(node.args[0])
                message = f"`{whole}` is evaluated at {inside} rad: function arguments are in rad"
                hint = f"for degrees, write `{number:g}*pi/180`"
                return source.fault("magnitude", message, path, hint, column, warning=True)
    return None


def _bare_terms(node: ast.expr) -> Iterator[tuple[float, int]]:
    """Numbers that are a sum, or terms of it, with their columns."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
        yield from _bare_terms(node.left)
        yield from _bare_terms(node.right)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield float(node.value), node.col_offset
