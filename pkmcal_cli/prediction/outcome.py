"""Reading stage: what sensors read at a solution, its derivatives, drive forces and energy."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.derivative import adjoint_derivative, lagrangian_gradient
from pkmcal_cli.equilibrium.newton import solve_rows
from pkmcal_cli.equilibrium.readings import Readings, forced_energy, read_channels
from pkmcal_cli.layout import DriveKind
from pkmcal_cli.model import Model
from pkmcal_cli.prediction.effects import Displacements
from pkmcal_cli.prediction.frames import frame_channels, move_frames
from pkmcal_cli.prediction.rows import Prediction, Request, Rows
from pkmcal_cli.prediction.solving import Solution
from pkmcal_cli.prediction.stages import Chain
from pkmcal_cli.rotation import Array


def outcome(
    model: Model, solution: Solution, rows: Rows, request: Request, chain: Chain, moved: Displacements
) -> Prediction:
    """The prediction of solved rows; rows that failed get nan."""
    gains = np.array([a.gain_slot for a in model.actuators], dtype=np.intp)
    system, slots, state, bad = solution.system, solution.slots, solution.state, solution.failed
    read = frame_channels(model, moved)
    numbers = solution.numbers if request.derivatives else None
    readings = read_channels(system, slots, state, read.channels, gains, numbers)
    values, jacobian, by_drive, forces, energy = readings.values, None, None, None, None
    if request.derivatives:
        jacobian, by_drive = chain.apply(rows, slots, _slot_jacobian(solution, readings), moved)
    if moved.frames:
        values, by_drive, jacobian = move_frames(model, moved, read, values, by_drive, jacobian)
    values[bad] = np.nan
    if request.forces:
        forces, energy = drive_forces(model, solution)
        forces[bad], energy[bad] = np.nan, np.nan
    names = _slack_names(solution)
    return Prediction(values, solution.status, state, jacobian, by_drive, forces, energy, names, solution.steps)


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


def drive_forces(model: Model, solution: Solution) -> tuple[Array, Array]:
    """Drive forces (N, A) and strain energy (N,)."""
    system, slots, state, slack = solution.system, solution.slots, solution.state, solution.slack
    gradient = lagrangian_gradient(system, solution.numbers, state, slack)
    now = balance(system, solution.numbers, state, 1.0, tangent=False, slack=slack)
    energy = np.zeros(len(slots))
    for numbers, e in zip(solution.numbers.groups, now.strains, strict=True):
        if numbers.stiffness is not None:
            energy += 0.5 * np.einsum("nek,nekl,nel->n", e, numbers.stiffness, e)
    forces = np.zeros((len(slots), len(model.layout.drives)))
    for a, drive in enumerate(model.layout.drives):
        if drive.force_controlled:
            forces[:, a] = drive.force_sign * slots[:, drive.force_slot]
            if drive.kind is DriveKind.STRAIN:
                energy += forced_energy(system, slots, now.strains, drive)
        elif drive.kind is DriveKind.STRAIN:
            index, member, strain = drive.target
            forces[:, a] = drive.force_sign * now.stresses[index][:, member, strain]
        else:
            forces[:, a] = gradient[:, drive.slot]
    return forces, energy
