"""Reading stage: what sensors read at a solution, its derivatives, drive forces and energy."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.derivative import adjoint_derivative
from pkmcal_cli.equilibrium.newton import solve_rows
from pkmcal_cli.equilibrium.readings import Readings, read_channels
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.effects import Displacements
from pkmcal_cli.prediction.forces import drive_forces, force_derivative
from pkmcal_cli.prediction.laws import read_sensors
from pkmcal_cli.prediction.rows import Prediction, Request, Rows
from pkmcal_cli.prediction.solving import Solution
from pkmcal_cli.prediction.stages import Chain


def outcome(
    model: Model, solution: Solution, rows: Rows, request: Request, chain: Chain, moved: Displacements
) -> Prediction:
    """The prediction of solved rows; rows that failed get nan."""
    gains = np.array([a.gain_slot for a in model.actuators], dtype=np.intp)
    slots, state, bad = solution.slots, solution.state, solution.failed
    jacobian, by_drive, forces, energy = None, None, None, None
    views, by_slot = _views(model, solution, gains, request.derivatives)
    values, slopes = read_sensors(model, views, slots, by_slot)
    if slopes is not None:
        jacobian, by_drive = chain.apply(rows, slots, slopes, moved)
    values[bad] = np.nan
    if request.forces:
        forces, energy = drive_forces(model, solution)
        forces[bad], energy[bad] = np.nan, np.nan
    names = _slack_names(solution)
    return Prediction(
        values=values,
        status=solution.status,
        state=state,
        jacobian=jacobian,
        by_drive=by_drive,
        forces=forces,
        energy=energy,
        slack=names,
        steps=solution.steps,
    )


def _views(model: Model, solution: Solution, gains: Array, derivatives: bool) -> tuple[Array, Array | None]:
    """All views (N, V), and their derivatives by slots (N, V, S) where these are asked for."""
    system, slots = solution.system, solution.slots
    pulls = [k for k, v in enumerate(model.views) if v.quantity == "force"]
    seen = tuple(v for v in model.views if v.quantity != "force")
    readings = read_channels(system, slots, solution.state, seen, gains, solution.numbers if derivatives else None)
    slopes = _slot_jacobian(solution, readings) if derivatives else None
    if not pulls:
        return readings.values, slopes
    drives = [model.views[k].index for k in pulls]
    others = [k for k in range(len(model.views)) if k not in pulls]
    values = np.empty((len(slots), len(model.views)))
    values[:, others] = readings.values
    values[:, pulls] = drive_forces(model, solution)[0][:, drives]
    if slopes is None:
        return values, None
    full = np.empty((len(slots), len(model.views), slots.shape[1]))
    full[:, others] = slopes
    for k, drive in zip(pulls, drives, strict=True):
        full[:, k] = force_derivative(model, solution, drive)
    return values, full


def _slack_names(solution: Solution) -> dict[int, str]:
    """Names of the slack ropes by row."""
    out: dict[int, str] = {}
    for group, loose in zip(solution.system.groups, solution.slack or (), strict=False):
        for row in np.nonzero(loose.any(axis=1))[0]:
            names = [group.group.names[k] for k in np.nonzero(loose[row])[0]]
            out[int(row)] = ", ".join(filter(None, [out.get(int(row)), *names]))
    return out


def _slot_jacobian(solution: Solution, readings: Readings) -> Array:
    """d readings / d slots (N, C, S): direct part minus the adjoint one; nan in unsolved rows."""
    system, state, slack = solution.system, solution.state, solution.slack
    assert readings.unknowns is not None and readings.slots is not None
    scale = typical_stiffness(system, solution.numbers)
    now = balance(system, solution.numbers, state, scale, slack=slack)
    assert now.tangent is not None
    adjoint = solve_rows(np.swapaxes(now.tangent, 1, 2), np.swapaxes(readings.unknowns, 1, 2))
    adjoint = np.nan_to_num(np.swapaxes(adjoint, 1, 2))
    out = readings.slots - adjoint_derivative(system, solution.numbers, state, slack, adjoint, scale)
    out[solution.failed] = np.nan
    return np.asarray(out)
