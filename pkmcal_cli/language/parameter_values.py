"""Parameters resolved: dimension, display unit, and nominal, range and bounds in SI."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from dataclasses import dataclass

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.binding import Binder, Slip, unknown_unit
from pkmcal_cli.language.checks.validation import Quarantine
from pkmcal_cli.language.parts import Parameter, Ranges, WrittenParameter
from pkmcal_cli.language.quantities import Quantity, WrittenNumber, WrittenValue
from pkmcal_cli.language.walk import with_values, written_values
from pkmcal_cli.units.dimensions import DIMENSIONS, NUMBER, Dimension
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.limits import SMALLEST
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap


def stated_dimension(parameter: WrittenParameter) -> Dimension | None:
    """From the parameter's unit, else from a unit in its nominal, range or bounds."""
    if parameter.unit:
        return parse_unit(parameter.unit).dimension
    for _, value in _values(parameter):
        if value.unit is not None:
            return value.unit.dimension
    return None


def unknown_units(parameter: WrittenParameter) -> Iterator[tuple[Path, Slip]]:
    """What is wrong with the values whose unit is none, of a parameter of unknown dimension, and under which key."""
    return ((key, unknown_unit(value, ())) for key, value in _values(parameter) if value.unknown_unit)


def _values(parameter: WrittenParameter) -> Iterator[tuple[Path, WrittenValue]]:
    """A parameter's values as written, by key."""
    return written_values({"nominal": parameter.nominal, "range": parameter.range, "bounds": parameter.bounds})


@dataclass(frozen=True)
class ParameterResolver:
    """Resolves parameters against the file's units and default ranges; `names`: of all of them."""

    units: FileUnits
    ranges: Ranges
    source: SourceMap
    faults: FaultList
    quarantined: Quarantine
    names: frozenset[str] = frozenset()

    def resolve(self, name: str, parameter: WrittenParameter, dimension: Dimension) -> Parameter:
        """The parameter with SI floats; faults are added at their places."""
        parameter_unit = parse_unit(parameter.unit) if parameter.unit else None
        bare = parameter_unit or self.units.unit(dimension)
        if parameter_unit is not None and parameter_unit.dimension != dimension:
            bare = self.units.unit(dimension)
        path: Path = ("parameters", name)
        nominal = self._number(parameter.nominal, dimension, bare, (*path, "nominal"))
        spread = self._range(parameter, dimension, bare, path, name)
        bounds = self._bounds(parameter, dimension, bare, path)
        if nominal is not None and bounds is not None:
            self._check_inside(nominal, bounds, path, bare)
        made: Parameter = with_values(
            parameter,
            {
                "nominal": math.nan if nominal is None else nominal,
                "range": spread,
                "bounds": bounds,
                "unit": self._display(parameter, bare),
            },
        )
        made._dimension = dimension
        return made

    def _display(self, parameter: WrittenParameter, bare: Unit) -> str:
        if parameter.unit:
            return parameter.unit
        nominal = parameter.nominal
        unit = nominal.unit if isinstance(nominal, WrittenValue) and nominal.unit else bare
        return "" if unit.text == "1" else unit.text

    def _number(self, written: WrittenNumber, dimension: Dimension, bare: Unit, path: Path) -> float | None:
        """The SI value of a value as written of numbers only, or None after a fault."""
        if not isinstance(written, WrittenValue):
            return float(written)
        if written.names:
            message = f"the value of a parameter must be a number, not an expression of `{written.names[0]}`"
            hint = "write the expression where the parameter is used"
            if isinstance(written.tree, ast.Name) and written.text not in self.names:
                message = f"the value of a parameter must be a number, found `{written.text}`"
                hint = "write a number, in the units of the file or with its unit: `300`, `300 mm`"
            self.faults.add(self.source.fault("parameter", message, path, hint))
            return None
        try:
            made = Binder(self.units, {}).bind(written, (dimension,), bare)
        except Slip as slip:
            fault = self.source.fault(slip.code, slip.message, path, slip.hint, slip.offset)
            self.faults.add(fault)
            return None
        return made.number({})

    def _range(self, parameter: WrittenParameter, dimension: Dimension, bare: Unit, path: Path, name: str) -> float:
        if "range" in parameter.model_fields_set:
            where = (*path, "range")
            value = self._number(parameter.range, dimension, bare.difference, where)
            if value is not None and not value >= SMALLEST:
                message = f"the range of `{name}` must be positive"
                hint = "give the half-width about nominal (2 standard deviations); to hold it fixed, "
                hint += "write `identify: false`; if it is exact, `fixed: true`"
                self.faults.add(self.source.fault("range", message, where, hint))
            return math.nan if value is None else value
        if self.quarantined.touches((*path, "range")) or self.quarantined.touches(("ranges",)):
            return math.nan
        for key, named in DIMENSIONS.items():
            default = getattr(self.ranges, key, None)
            if named == dimension and isinstance(default, Quantity):
                return default.number({})
        if parameter.fixed:
            return 0.0
        key = next((key for key, named in DIMENSIONS.items() if named == dimension), "")
        hint = "add `range:` here"
        if key in Ranges.model_fields:
            hint += f", or `{key}:` in `ranges:` for every {dimension.name}"
        message = f"parameter `{name}` ({_kind(dimension)}) has no range"
        self.faults.add(self.source.fault("range", message, path, hint, at_key=True))
        return math.nan

    def _bounds(
        self, parameter: WrittenParameter, dimension: Dimension, bare: Unit, path: Path
    ) -> tuple[float, float] | None:
        if parameter.bounds is None:
            return None
        where = (*path, "bounds")
        low = self._number(parameter.bounds[0], dimension, bare, (*where, 0))
        high = self._number(parameter.bounds[1], dimension, bare, (*where, 1))
        if low is None or high is None:
            return None
        if not low < high:
            message = "the lower bound must be below the upper bound"
            self.faults.add(self.source.fault("range", message, where, "write `bounds: [min, max]`"))
            return None
        return low, high

    def _check_inside(self, nominal: float, bounds: tuple[float, float], path: Path, unit: Unit) -> None:
        if not bounds[0] <= nominal <= bounds[1]:
            message = f"the nominal value {unit.format(nominal)} is outside its bounds"
            hint = f"correct the value or the bounds ({unit.format(bounds[0])} to {unit.format(bounds[1])})"
            self.faults.add(self.source.fault("range", message, (*path, "nominal"), hint))


def _kind(dimension: Dimension) -> str:
    return "a plain number" if dimension == NUMBER else dimension.name
