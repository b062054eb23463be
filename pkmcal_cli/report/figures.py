"""Error figures before and after, in the file's units."""

from __future__ import annotations

from pkmcal_cli.calibration.errors_before_after import ErrorFigures
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.report.numbers import finite
from pkmcal_cli.units.file_units import TORQUE, UNITS, Unit


def figure_unit(machine: Machine, figures: ErrorFigures) -> Unit:
    """Unit of a kind's figures."""
    units = machine.file_units
    known = {"length": units.length, "angle": units.angle, "force": units.force, "torque": units.unit(TORQUE)}
    return known.get(figures.dimension, UNITS["1"])


def figures_json(machine: Machine, kinds: dict[str, ErrorFigures]) -> dict[str, object]:
    """By kind of channel: rms, max, criterion, unit."""
    out: dict[str, object] = {}
    for kind, f in kinds.items():
        unit = figure_unit(machine, f)
        out[kind] = {
            "rms": finite(f.rms / unit.scale),
            "max": finite(f.largest / unit.scale),
            "criterion": finite(f.criterion / unit.scale**2),
            "unit": unit.text,
            "count": f.count,
        }
    return out
