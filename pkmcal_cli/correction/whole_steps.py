"""Set values of drives that count steps: whole ones, and the error that this leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commands import Correction
from pkmcal_cli.correction.strained_pose import LoadedTool
from pkmcal_cli.model.model import Model
from pkmcal_cli.units.unit_text import Unit, parse_unit


def in_whole_steps(model: Model, values: Array, made: Correction) -> Correction:
    """The correction as a control sends it that knows whole steps; itself where no drive has a unit of its own."""
    readings = whole_steps(model, made.rows.readings)
    if readings is made.rows.readings:
        return made
    rows, tool = replace(made.rows, readings=readings), LoadedTool(model, made.aim.held)
    after = tool.at(values, rows, made.aim.targets, start=made.after.prediction.start)
    lost = np.nonzero(np.isnan(made.after.tool).any(axis=1))[0]
    return replace(made, rows=rows, after=after.without(lost))


def counts_steps(unit: Unit) -> bool:
    """Whether readings in a unit are whole numbers of steps: one that the machine file defines, as `count: 0.5 um`."""
    return "=" in unit.definition


def whole_steps(model: Model, readings: Array) -> Array:
    """Readings (N, A), those of drives with a unit of their own as whole numbers of it; themselves where none has."""
    units = [parse_unit(a.unit) for a in model.actuators]
    stepped = {a: unit.scale for a, unit in enumerate(units) if counts_steps(unit)}
    out = readings.copy() if stepped else readings
    for a, step in stepped.items():
        out[:, a] = np.round(out[:, a] / step) * step
    return out
