"""The workspace of a machine in numbers, and what is wrong with it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.compiler.coefficient_values import constant_vector, unit
from pkmcal_cli.language.machine import Machine, axis_vector
from pkmcal_cli.language.tool_point import REMEDY, tool_point_of
from pkmcal_cli.language.workspace import Cylinder as CylinderKeys
from pkmcal_cli.model.limits import drive_limits
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import Actuator
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.model.workspace import Cylinder, Workspace
from pkmcal_cli.units.dimensions import ANGLE, LENGTH
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.yaml_source.tree import Path

_ROUNDING = 1e-9  # of the machine's size: what is less is none
_WARNED = "the reference configuration is outside the workspace"


def workspace_of(machine: Machine, actuators: Sequence[Actuator]) -> Workspace | None:
    """The declared workspace at nominal parameters, with the limits of the drives; None where none is declared."""
    if machine.workspace is None:
        return None
    low, high = np.full(len(DIRECTIONS), -math.inf), np.full(len(DIRECTIONS), math.inf)
    drives = drive_limits(actuators)
    names = [a.name for a in actuators]
    for path, ends in _limits(machine):
        if path[1] == "box":
            k = DIRECTIONS.index(str(path[2]))
            low[k], high[k] = ends
        else:
            k = names.index(str(path[2]))
            drives[k] = max(drives[k, 0], ends[0]), min(drives[k, 1], ends[1])
    cylinder = machine.workspace.cylinder
    return Workspace(low, high, None if cylinder is None else _cylinder(machine, cylinder), drives)


def _cylinder(machine: Machine, cylinder: CylinderKeys) -> Cylinder:
    nominal = machine.nominal_values()
    axis = unit(constant_vector(axis_vector(cylinder.axis, 3), nominal))
    height = math.inf if cylinder.height is None else cylinder.height.number(nominal)
    return Cylinder(constant_vector(cylinder.at, nominal), axis, cylinder.radius.number(nominal), height)


def _limits(machine: Machine) -> Iterator[tuple[Path, tuple[float, float]]]:
    """Every pair of limits of the workspace with its place in the file, SI."""
    workspace, nominal = machine.workspace, machine.nominal_values()
    if workspace is None:
        return
    box = {} if workspace.box is None else workspace.box.__dict__
    for section, pairs in (("box", box), ("drives", workspace.drives)):
        for name, pair in pairs.items():
            if pair is not None:
                low, high = (q.number(nominal) for q in pair)
                yield ("workspace", section, name), (low, high)


def workspace_faults(machine: Machine, model: Model) -> list[Fault]:
    """Faults of the workspace: limits that leave nothing, coordinates that the tool point has not; warnings."""
    workspace, source = model.workspace, machine.source
    if workspace is None or machine.workspace is None:
        return []
    inverted = [path for path, (low, high) in _limits(machine) if not low < high]
    message = "the lower limit must be below the upper limit"
    faults = [source.fault("value", message, path, "write `[low, high]`") for path in inverted]
    posed = machine.workspace.box is not None or machine.workspace.cylinder is not None
    if posed and tool_point_of(machine) is None:
        message = "the workspace is in coordinates of the tool point, but the machine has none"
        faults.append(source.fault("tool-point", message, ("workspace",), REMEDY, at_key=True))
    elif posed:
        faults += _lacking(machine, model)
    faults += _empty(machine, model, workspace, {str(path[2]) for path in inverted})
    if not faults and not workspace.holds(model.tool.reference[None], model.reference_readings[None])[0]:
        hint = "correct the limits or their units, the tool point, or the reference configuration"
        message = f"{_WARNED}: the tool point is at {_place(machine, model)}"
        faults = [source.fault("workspace", message, ("workspace",), hint, at_key=True, warning=True)]
    return faults


def _place(machine: Machine, model: Model) -> str:
    """Coordinates of the tool point in the reference configuration that a box or cylinder may limit, in words."""
    names = {str(path[2]) for path, _ in _limits(machine) if path[1] == "box"}
    names |= {"x", "y", "z"} if machine.space == "spatial" else {"x", "y"}
    units, shown = machine.file_units, []
    for name, value in zip(DIRECTIONS, model.tool.reference, strict=True):
        if name in names:
            unit = units.unit(ANGLE if name.startswith("r") else LENGTH)
            near = 0.0 if abs(value) < _ROUNDING * model.length else float(value)
            shown.append(f"{name} = {unit.format(near, 4)}")
    return ", ".join(shown)


def _lacking(machine: Machine, model: Model) -> list[Fault]:
    """Coordinates that the tool point, a node without rotation, does not have."""
    names = {name for g in model.tool.aims for name in model.topology.aims[g].element.strains}
    tool = tool_point_of(machine)
    message = f"tool point `{tool.name if tool is not None else ''}` is a node without rotation: it has no `{{}}`"
    hint = f"use {', '.join(sorted(names))}"
    return [
        machine.source.fault("value", message.format(path[2]), path, hint, at_key=True)
        for path, _ in _limits(machine)
        if path[1] == "box" and path[2] not in names
    ]


def _empty(machine: Machine, model: Model, workspace: Workspace, inverted: set[str]) -> list[Fault]:
    """Limits that together leave nothing, though each by itself is not `inverted`."""
    source, (low, high) = machine.source, workspace.bounds
    ends = zip(DIRECTIONS, low, high, strict=True)
    apart = [name for name, one, other in ends if not one < other and name not in inverted]
    faults = []
    if apart:
        message = f"box and cylinder have nothing in common in {', '.join(f'`{n}`' for n in apart)}"
        faults.append(source.fault("value", message, ("workspace", "box"), "correct one of them", at_key=True))
    for actuator, (one, other) in zip(model.actuators, workspace.drives, strict=True):
        if not one < other and actuator.name not in inverted:
            shown = " to ".join(parse_unit(actuator.unit).format(v, 6) for v in actuator.limits)
            message = f"limits outside the actuator's own, {shown}"
            path: Path = ("workspace", "drives", actuator.name)
            faults.append(source.fault("value", message, path, "give narrower limits, or none"))
    return faults
