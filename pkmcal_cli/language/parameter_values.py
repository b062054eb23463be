"""Parameters resolved: dimension, display unit, and nominal, range and bounds in SI."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.binding import Binder, Slip
from pkmcal_cli.language.checks.validation import Aside
from pkmcal_cli.language.parts import Parameter, Ranges
from pkmcal_cli.language.quantities import Draft, Quantity
from pkmcal_cli.units.dimensions import DIMENSIONS, NUMBER, Dimension
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.limits import SMALLEST
from pkmcal_cli.units.unit_text import Unit, parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap


def stated_dimension(parameter: Parameter) -> Dimension | None:
    """From the parameter's unit, else from a unit in its nominal, range or bounds."""
    if parameter.unit:
        return parse_unit(parameter.unit).dimension
    for value in (parameter.nominal, parameter.range, *(parameter.bounds or ())):
        if isinstance(value, Draft) and value.unit is not None:
            return value.unit.dimension
    return None


@dataclass(frozen=True)
class ParameterResolver:
    """Resolves parameters against the file's units and default ranges."""

    units: FileUnits
    ranges: Ranges
    source: SourceMap
    faults: FaultList
    aside: Aside

    def resolve(self, name: str, parameter: Parameter, dimension: Dimension) -> Parameter:
        """The parameter with SI floats; faults are added at their places."""
        own = parse_unit(parameter.unit) if parameter.unit else None
        bare = own or self.units.unit(dimension)
        if own is not None and own.dimension != dimension:
            bare = self.units.unit(dimension)
        path: Path = ("parameters", name)
        nominal = self._number(parameter.nominal, dimension, bare, (*path, "nominal"))
        spread = self._range(parameter, dimension, bare, path, name)
        bounds = self._bounds(parameter, dimension, bare, path)
        if nominal is not None and bounds is not None:
            self._check_inside(nominal, bounds, path, bare)
        made = parameter.model_copy(
            update={
                "nominal": math.nan if nominal is None else nominal,
                "range": spread,
                "bounds": bounds,
                "unit": self._display(parameter, bare),
            }
        )
        made._dimension = dimension
        return made

    def _display(self, parameter: Parameter, bare: Unit) -> str:
        if parameter.unit:
            return parameter.unit
        nominal = parameter.nominal
        unit = nominal.unit if isinstance(nominal, Draft) and nominal.unit else bare
        return "" if unit.text == "1" else unit.text

    def _number(self, draft: Draft | float | str, dimension: Dimension, bare: Unit, path: Path) -> float | None:
        """The SI value of a draft of numbers only, or None after a fault."""
        if not isinstance(draft, Draft):
            return float(draft)
        if draft.names:
            what = f"a parameter's value is a number, not an expression of `{draft.names[0]}`"
            hint = "write the expression where the parameter is used"
            self.faults.add(self.source.fault("parameter", what, path, hint))
            return None
        try:
            made = Binder(self.units, {}).bind(draft, (dimension,), bare)
        except Slip as slip:
            found = self.source.fault(slip.code, slip.what, path, slip.hint, slip.offset)
            self.faults.add(found)
            return None
        return made.number({})

    def _range(self, parameter: Parameter, dimension: Dimension, bare: Unit, path: Path, name: str) -> float:
        if "range" in parameter.model_fields_set:
            where = (*path, "range")
            value = self._number(parameter.range, dimension, bare.difference, where)
            if value is not None and not value >= SMALLEST:
                what = f"the range of `{name}` must be positive"
                hint = "the half-width about nominal, 2 standard deviations; to hold it fixed "
                hint += "write `identify: false`"
                self.faults.add(self.source.fault("range", what, where, hint))
            return math.nan if value is None else value
        if self.aside.touches((*path, "range")) or self.aside.touches(("ranges",)):
            return math.nan
        for key, named in DIMENSIONS.items():
            default = getattr(self.ranges, key, None)
            if named == dimension and isinstance(default, Quantity):
                return default.number({})
        key = next((key for key, named in DIMENSIONS.items() if named == dimension), "")
        hint = "give `range:` here"
        if key in Ranges.model_fields:
            hint += f", or `{key}:` in `ranges:` for every {dimension.name}"
        what = f"parameter `{name}` ({_kind(dimension)}) has no range"
        self.faults.add(self.source.fault("range", what, path, hint, at_key=True))
        return math.nan

    def _bounds(self, parameter: Parameter, dimension: Dimension, bare: Unit, path: Path) -> tuple[float, float] | None:
        if parameter.bounds is None:
            return None
        where = (*path, "bounds")
        low = self._number(parameter.bounds[0], dimension, bare, (*where, 0))
        high = self._number(parameter.bounds[1], dimension, bare, (*where, 1))
        if low is None or high is None:
            return None
        if not low < high:
            what = "the lower bound must be below the upper one"
            self.faults.add(self.source.fault("range", what, where, "bounds: [min, max]"))
            return None
        return low, high

    def _check_inside(self, nominal: float, bounds: tuple[float, float], path: Path, unit: Unit) -> None:
        if not bounds[0] <= nominal <= bounds[1]:
            what = f"nominal {unit.format(nominal)} is outside its bounds"
            hint = f"bounds: {unit.format(bounds[0])} to {unit.format(bounds[1])}"
            self.faults.add(self.source.fault("range", what, (*path, "nominal"), hint))


def _kind(dimension: Dimension) -> str:
    return "a plain number" if dimension == NUMBER else dimension.name
