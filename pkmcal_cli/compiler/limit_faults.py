"""Faults of limits: drives that stand outside theirs in the reference configuration, or leave their beams within."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.compiler.spans import natural_length
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.limits import limit_excess
from pkmcal_cli.model.model import Model
from pkmcal_cli.units.unit_text import parse_unit


def outside_limits(machine: Machine, model: Model) -> list[Fault]:
    """Drives that are outside their limits in the reference configuration: warnings."""
    faults = []
    for actuator, reading in zip(model.actuators, model.reference_readings, strict=True):
        if limit_excess(reading, actuator.limits) > 0:
            unit = parse_unit(actuator.unit)
            low, high, reference = (unit.format(float(v), 6) for v in (*actuator.limits, reading))
            limits = f"outside its limits ({low} to {high})"
            message = f"`{actuator.name}` reads {reference} in the reference configuration, {limits}"
            hint = "correct the limits, the zero, scale or sign of the actuator, or the reference configuration"
            faults.append(
                machine.source.fault("limits", message, ("actuators", actuator.name, "limits"), hint, warning=True)
            )
    return faults


def beyond_beams(machine: Machine, model: Model) -> list[Fault]:
    """Drives whose limits let a carriage run off its beam: warnings."""
    faults = []
    for drive, actuator in zip(model.topology.drives, model.actuators, strict=True):
        body = machine.bodies.get(machine.actuators[drive.name].moves or "")
        beam = None if body is None or body.guide is None else machine.guides[body.guide].beam
        if beam is None:
            continue
        length, constants = natural_length(model.topology, beam), model.topology.coefficients.constants
        gain, zero = constants[[actuator.gain_coefficient, drive.coefficient]]
        ends = [float(zero + gain * limit) for limit in actuator.limits]
        if (min(ends) < 0 and np.isfinite(min(ends))) or (max(ends) > length and np.isfinite(max(ends))):
            unit = machine.file_units.length
            span = f"{unit.format(min(ends), 6)} to {unit.format(max(ends), 6)}"
            message = f"the limits of `{drive.name}` ({span} along the beam) go beyond the ends of `{beam}`"
            hint = f"the beam is {unit.format(length, 6)} long: correct its length, or the limits or zero of the drive"
            path = ("actuators", drive.name, "limits")
            faults.append(machine.source.fault("limits", message, path, hint, warning=True))
    return faults
