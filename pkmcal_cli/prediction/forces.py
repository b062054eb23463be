"""Forces of drives at a solution, and their derivatives.

A drive's force is the derivative of the Lagrangian with respect to the slot of its position (minus that with respect to
a natural length), so the force's derivatives come from a complex step in that slot.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.derivative import adjoint_derivative, lagrangian_gradient
from pkmcal_cli.equilibrium.given import given
from pkmcal_cli.equilibrium.kinematics import State, place_prescribed
from pkmcal_cli.equilibrium.newton import solve_rows
from pkmcal_cli.equilibrium.readings import forced_energy
from pkmcal_cli.mechanism.topology import DriveKind
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.solving import Solution

_STEP = 1e-30


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


def force_slot(model: Model, actuator: int) -> tuple[int, float]:
    """The slot whose derivative of the Lagrangian is a drive's force, and its sign; -1 where the force is commanded."""
    drive = model.layout.drives[actuator]
    if drive.force_controlled:
        return -1, 0.0
    return drive.slot, -drive.force_sign if drive.kind is DriveKind.STRAIN else 1.0


def force_derivative(model: Model, solution: Solution, actuator: int) -> Array:
    """Derivative (N, S) of a drive's force by all slots; nan where failed."""
    slot, sign = force_slot(model, actuator)
    if slot >= 0:
        return sign * slot_force_derivative(model, solution, slot)
    drive = model.layout.drives[actuator]
    out = np.zeros(solution.slots.shape)
    out[:, drive.force_slot] = drive.force_sign
    return out


def slot_force_derivative(model: Model, solution: Solution, slot: int) -> Array:
    """Total derivative (N, S) by all slots of the Lagrangian's derivative by one slot; nan where failed."""
    system, state = solution.system, solution.state
    stepped = solution.slots.astype(complex)
    stepped[:, slot] += 1j * _STEP
    at = State(*(x.astype(complex) for x in (state.travel, state.rotation, state.multiplier)))
    at = place_prescribed(model.layout, stepped, at, free=system.free)
    numbers, scale = given(system, stepped), typical_stiffness(system, solution.slots)
    direct = lagrangian_gradient(system, numbers, at, solution.slack).imag / _STEP
    row = balance(system, numbers, at, scale, tangent=False, slack=solution.slack).residual.imag / _STEP
    tangent = balance(system, solution.numbers, state, scale, slack=solution.slack).tangent
    assert tangent is not None
    adjoint = np.nan_to_num(solve_rows(np.swapaxes(tangent, 1, 2), row[..., None]))
    back = adjoint_derivative(system, solution.numbers, state, solution.slack, np.swapaxes(adjoint, 1, 2), scale)[:, 0]
    out = np.asarray(direct - back)
    out[solution.failed] = np.nan
    return out
