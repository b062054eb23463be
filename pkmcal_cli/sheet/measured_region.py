"""Between which values was measured: for these, and no others, the figures of a sheet hold."""

from __future__ import annotations

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import UNITS, Unit

_HOUR = 3600.0
_LOGGED = {"T": "degC", "payload": "kg"}


def measured_region(problem: Problem, units: FileUnits) -> str:
    """Rows, coordinates of poses, temperatures, payloads and the time that they took; "" without any row."""
    used = problem.measured.any(axis=1)
    if not used.any():
        return ""
    parts = []
    for measurand, unit_of in ((Measurand.POSITION, units.length), (Measurand.ORIENTATION, units.angle)):
        for k in problem.model.measuring(measurand):
            on = problem.measured[:, k]
            if on.any():
                parts.append(_between(problem.model.channels[k].name, problem.readings[on, k], unit_of))
    for name, column in problem.rows.columns.items():
        unit = _LOGGED.get(name.partition(".")[0])
        if unit is not None:
            parts.append(_between(name, column[used], UNITS[unit]))
    if "time" in problem.rows.columns:
        time = problem.rows.columns["time"][used]
        parts.append(f"within {(time.max() - time.min()) / _HOUR:.3g} h")
    region = f", {', '.join(parts)}. The figures of this sheet hold there." if parts else "."
    return f"Measured: {int(used.sum())} rows{region}"


def _between(name: str, values: Array, unit: Unit) -> str:
    """Values (N,), SI."""
    low, high = (f"{unit.from_si(float(v)):.4g}" for v in (values.min(), values.max()))
    return f"{name} {low if low == high else f'{low} to {high}'} {unit.text}"
