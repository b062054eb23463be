"""Values at nominal: finite, of the right sign, and of a magnitude that is usual for the field."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import Fault, FaultList
from pkmcal_cli.language.parts import Parameter
from pkmcal_cli.language.quantities import Draft, Quantity
from pkmcal_cli.units.dimensions import (
    ANGLE,
    AREA,
    DENSITY,
    FORCE,
    LENGTH,
    MASS,
    MODULUS,
    STIFFNESS,
    Dimension,
)
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.limits import HINT, beyond
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap

MAX_WARNINGS = 10
_SLIP = 1e3 * (1 - 1e-9)

_CANDIDATES: dict[Dimension, tuple[str, ...]] = {
    LENGTH: ("nm", "um", "mm", "m"),
    FORCE: ("mN", "N", "kN", "MN"),
    MASS: ("g", "kg", "t"),
    MODULUS: ("Pa", "kPa", "MPa", "GPa"),
    STIFFNESS: ("N/m", "N/mm", "N/um", "kN/mm"),
    DENSITY: ("kg/m^3", "g/cm^3", "kg/mm^3"),
    AREA: ("mm^2", "cm^2", "m^2"),
}


@dataclass(kw_only=True)
class MagnitudeCheck:
    """Checks bound quantities at the nominal values; faults and warnings are added."""

    parameters: Mapping[str, Parameter]
    written: Mapping[str, Parameter]
    units: FileUnits
    source: SourceMap
    faults: FaultList
    values: dict[str, float] = field(init=False)
    _told: set[Path] = field(default_factory=set)
    _warned: int = 0

    def __post_init__(self) -> None:
        self.values = {name: p.nominal for name, p in self.parameters.items()}

    def check(self, path: Path, draft: Draft, quantity: Quantity) -> None:
        """One quantity with the draft it was bound from."""
        values = self.values
        value = quantity.number(values)
        if not math.isfinite(value):
            if not any(math.isnan(values[name]) for name in quantity.names):
                what = f"`{draft.text}` has no finite value at the nominal parameters"
                hint = "check the nominal values and the expression"
                self.faults.add(self.source.fault("value", what, path, hint))
            return
        unit = self.units.unit(quantity.dimension)
        shown = "" if draft.tree is None else f" (it is {unit.format(value)})"
        if (wrong := beyond(value, draft.measure.sign != "")) is not None:
            self.faults.add(self.source.fault("value", f"`{draft.text}` is {wrong}{shown}", path, HINT))
        elif (broken := _broken(draft.measure.sign, value)) is not None:
            must, hint = broken
            self.faults.add(self.source.fault("value", f"`{draft.text}` must {must} here{shown}", path, hint))
        else:
            self._check_usual(path, draft, quantity, abs(value))

    def _check_usual(self, path: Path, draft: Draft, quantity: Quantity, value: float) -> None:
        usual = draft.measure.usual
        if usual is None or value == 0 or usual[0] <= value <= usual[1]:
            return
        label = next(str(part) for part in reversed(path) if isinstance(part, str))
        if isinstance(draft.tree, ast.Name) and draft.tree.id in self.written:
            label = draft.tree.id
            path = ("parameters", label, "nominal")
            nominal = self.written[label].nominal
            own = self.written[label].unit
            if isinstance(nominal, Draft):
                draft = nominal
        else:
            own = ""
        if path in self._told:
            return
        self._told.add(path)
        unit = draft.unit or (parse_unit(own) if own else self.units.unit(quantity.dimension))
        self._warn(path, label, value, unit, usual, quantity.dimension)

    def _warn(
        self, path: Path, label: str, value: float, unit: Unit, usual: tuple[float, float],
        dimension: Dimension,
    ) -> None:  # fmt: skip
        number = value / unit.scale
        guess = _guess(number, unit, usual, dimension)
        far = value > usual[1] * _SLIP or value < usual[0] / _SLIP
        if guess is None and not far:
            return
        what = f"{label} = {number:g} {unit.text}"
        what += f": did you mean {number:g} {guess}?" if guess else " is far from what is usual"
        shown = self.units.unit(dimension)
        hint = f"usual is {shown.format(usual[0], 3)} to {shown.format(usual[1], 3)}"
        if usual[0] == 0:
            hint = f"usual is up to {shown.format(usual[1], 3)}"
        self._warned += 1
        if self._warned <= MAX_WARNINGS:
            made: Fault = self.source.fault("magnitude", what, path, hint, warning=True)
            self.faults.add(made)


def _broken(sign: str, value: float) -> tuple[str, str] | None:
    """What a field asks of its value that this one is not, and a remedy; None where all is well."""
    if sign == "+" and value <= 0:
        return "be positive", "check the sign" if value < 0 else "check the sign, or delete the key"
    if sign == "0+" and value < 0:
        return "be positive or zero", "check the sign"
    if sign == "+-" and value == 0:
        return "not be 0", "what is multiplied by 0 tells and moves nothing; without the key it is 1"
    return None


def _guess(number: float, unit: Unit, usual: tuple[float, float], dimension: Dimension) -> str | None:
    """The unit with which the same number would be usual; None if there is none."""
    best: tuple[float, str] | None = None
    for text in _CANDIDATES.get(dimension, ()):
        candidate = parse_unit(text)
        value = number * candidate.scale
        ratio = candidate.scale / unit.scale
        if not usual[0] <= value <= usual[1] or max(ratio, 1 / ratio) < _SLIP:
            continue
        if usual[0] > 0:
            distance = abs(math.log(value / math.sqrt(usual[0] * usual[1])))
        else:
            distance = -value
        if best is None or distance < best[0]:
            best = (distance, text)
    return best[1] if best else None


def radian_warning(path: Path, draft: Draft, units: FileUnits, source: SourceMap) -> Fault | None:
    """A warning where pi and a file in degrees meet: `pi/2` as an angle, `cos(30)`."""
    if draft.tree is None or units.angle.scale == 1.0:
        return None
    nodes = list(ast.walk(draft.tree))
    uses_pi = any(isinstance(n, ast.Name) and n.id == "pi" for n in nodes)
    called = any(isinstance(n, ast.Call) for n in nodes)
    if uses_pi and not called and not draft.names and ANGLE in draft.measure.dimensions:
        what = f"`{draft.text}` is taken in {units.angle.text}, the file's unit of angles"
        hint = f"write the angle in {units.angle.text}, or in rad as a text `1.5708 rad`"
        return source.fault("magnitude", what, path, hint, warning=True)
    for node in nodes:
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
            continue
        argument = node.args[0]
        if not isinstance(argument, ast.Constant) or not isinstance(argument.value, int | float):
            continue
        number = argument.value
        if node.func.id in ("sin", "cos", "tan") and number > 2 * math.pi:
            what = f"`{ast.unparse(node)}` is of {number} rad: numbers in functions are in rad"
            hint = f"write {node.func.id}({number}*pi/180) for degrees"
            return source.fault("magnitude", what, path, hint, argument.col_offset, warning=True)
    return None
