"""Numbers of a table that look like those of another unit than its header says: days for seconds, K for degC."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.base.plural import count
from pkmcal_cli.csv_files.cell_values import FaultLog, FloatArray
from pkmcal_cli.csv_files.dialect import Flaw
from pkmcal_cli.csv_files.reader import TableReader
from pkmcal_cli.tables.column_binding import Binding
from pkmcal_cli.tables.column_needs import Bound
from pkmcal_cli.tables.serial_days import Span, Times
from pkmcal_cli.units.dimensions import TEMPERATURE
from pkmcal_cli.units.unit_text import UNITS

_ZERO = 273.15  # K, 0 degC
_WORKSHOP = (-20.0, 150.0)  # degC, a cold hall to hot parts
_COLD = 60.0  # K: nothing is calibrated colder
_FROST = 5.0  # degC: among rows warmer than that, those at exactly zero are most likely no readings
_HEAVY = 1000.0  # kg: a payload of so many is more often one in g
_AIR, _FAHRENHEIT = "T", (50.0, 110.0)  # of no part; degF, 10 to 43 degC: air as warm as so many degC is in no workshop


@dataclass
class ColumnDoubts:
    """The times, temperatures and payloads of a file so far."""

    times: Times = field(default_factory=Times)
    temperatures: dict[str, tuple[float, float]] = field(default_factory=dict)  # K, smallest and largest
    zeros: dict[str, int] = field(default_factory=dict)  # how many are exactly 0 degC, which take no part in these
    payloads: tuple[float, float] = (np.inf, -np.inf)  # kg, smallest and largest

    def add(self, covariates: Mapping[str, FloatArray], binding: Binding) -> None:
        """Take those of some rows, SI."""
        self.times.add(covariates.get("time"))
        for bound in binding.of("covariate"):
            name = bound.column.name
            values = covariates[name][np.isfinite(covariates[name])]
            if name == "payload":
                low, high = self.payloads
                self.payloads = min(low, values.min(initial=np.inf)), max(high, values.max(initial=-np.inf))
            if bound.unit.dimension != TEMPERATURE:
                continue
            known = values[values != _ZERO]
            self.zeros[name] = self.zeros.get(name, 0) + len(values) - len(known)
            if len(known):
                low, high = self.temperatures.get(name, (np.inf, -np.inf))
                self.temperatures[name] = min(low, float(known.min())), max(high, float(known.max()))

    def dates(self, binding: Binding, origin: float | None) -> Span | None:
        """When the rows were measured; None where their times are no dates. origin: of such, s since 1970."""
        bound = binding.named("time")
        if bound is None:
            return None
        if binding.column_rules.kinds[bound.index] == "time":
            return None if origin is None else self.times.since(origin)
        return self.times.days if bound.unit.text == "s" else None

    def warnings(self, binding: Binding, reader: TableReader) -> tuple[Fault, ...]:
        """What is to be said of the columns."""
        log = FaultLog(reader.name, reader.format.separator)
        line = reader.format.header_line
        bound = binding.named("time")
        if bound is not None and binding.column_rules.kinds[bound.index] == "number" and bound.unit.text == "s":
            self._add(log, self.times.flaw(line, bound.index), reader)
        for name in self.temperatures:
            temperature = binding.named(name)
            self._add(log, self._temperature(temperature, line) if temperature else None, reader)
            self._add(log, self._zeros(temperature, line) if temperature else None, reader)
        payload = binding.named("payload")
        self._add(log, self._payload(payload, line) if payload else None, reader)
        return tuple(replace(fault, severity="warning") for fault in log.faults)

    def _add(self, log: FaultLog, flaw: Flaw | None, reader: TableReader) -> None:
        if flaw is not None:
            log.add(flaw, reader.header_source())

    def _zeros(self, bound: Bound, line: int) -> Flaw | None:
        """Of a column that reads 0 where a logger failed."""
        (low, _), name = self.temperatures[bound.column.name], bound.column.header
        rows = self.zeros[bound.column.name]
        if not rows or low - _ZERO < _FROST:
            return None
        low -= _ZERO
        message = f"column `{name}` is exactly 0 degC in {count(rows, 'row')}, and {low:g} degC or more in the others"
        return Flaw("csv-value", message, "leave cells empty where nothing was read", line, bound.index)

    def _payload(self, bound: Bound, line: int) -> Flaw | None:
        """Of a column with masses that nothing has, or that are more likely grams."""
        (low, high), name = self.payloads, bound.column.header
        if low < 0:
            message, hint = f"column `{name}` is below zero: {low:g} kg", "write masses as positive numbers"
        elif high >= _HEAVY and bound.unit.text == "kg":
            message, hint = f"column `{name}` is read in kg, up to {high:g}", "if these are grams, write `payload [g]`"
        else:
            return None
        return Flaw("csv-value", message, hint, line, bound.index)

    def _temperature(self, bound: Bound, line: int) -> Flaw | None:
        """Of a column whose numbers are those of a workshop in the other unit."""
        low, high = self.temperatures[bound.column.name]
        name, unit = bound.column.header, bound.unit.text
        low, high = bound.unit.from_si(low), bound.unit.from_si(high)
        if unit == "degC" and _WORKSHOP[0] <= low - _ZERO <= high - _ZERO <= _WORKSHOP[1] < low:
            meant = "K"
        elif unit == "K" and _WORKSHOP[0] <= low <= high < _COLD:
            meant = "degC"
        elif unit == "degC" and bound.column.name == _AIR and _FAHRENHEIT[0] <= low <= high <= _FAHRENHEIT[1]:
            meant = "degrees Fahrenheit"
        else:
            return None
        message = f"column `{name}` is read in {unit}, but {low:g} to {high:g} looks like {meant}"
        hint = f"write `{name} [{meant}]` in the header" if meant in UNITS else "convert it: (F - 32)/1.8"
        return Flaw("csv-unit", message, hint, line, bound.index)
