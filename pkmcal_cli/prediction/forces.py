"""Forces of drives at a solution, and their derivatives.

A drive's force is the derivative of the Lagrangian with respect to the coefficient of its position (minus that with
respect to a natural length), so the force's derivatives come from a complex step in that coefficient.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.derivative import adjoint_derivative, lagrangian_gradient
from pkmcal_cli.equilibrium.energy import strain_energy
from pkmcal_cli.equilibrium.kinematics import State, place_prescribed
from pkmcal_cli.equilibrium.newton import solve_rows
from pkmcal_cli.equilibrium.readings import forced_energy
from pkmcal_cli.equilibrium.system_numbers import system_numbers
from pkmcal_cli.mechanism.topology import DriveKind
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.solving import Solution

_STEP = 1e-30


def drive_forces(model: Model, solution: Solution) -> tuple[Array, Array]:
    """Drive forces (N, A) and strain energy (N,)."""
    system, coefficients, state, taut = solution.system, solution.coefficients, solution.state, solution.taut
    gradient = lagrangian_gradient(system, solution.numbers, state, taut=taut)
    balanced = balance(system, solution.numbers, state, 1.0, tangent=False, taut=taut)
    energy = strain_energy(system, solution.numbers, balanced, taut=taut)
    forces = np.zeros((len(coefficients), len(model.topology.drives)))
    for a, drive in enumerate(model.topology.drives):
        if drive.force_controlled:
            forces[:, a] = drive.force_sign * coefficients[:, drive.force_coefficient]
            if drive.kind is DriveKind.STRAIN:
                energy += forced_energy(system, coefficients, balanced.strains, drive)
        elif drive.kind is DriveKind.STRAIN:
            index, member, strain = drive.target
            forces[:, a] = drive.force_sign * balanced.stresses[index][:, member, strain]
        else:
            forces[:, a] = gradient[:, drive.coefficient]
    return forces, energy


def least_tensions(model: Model, solution: Solution) -> Array:
    """Tensions (N, R) of the ropes that have to be taut, N."""
    if not model.least_tensions:
        return np.zeros((len(solution.state), 0))
    balanced = balance(solution.system, solution.numbers, solution.state, 1.0, tangent=False, taut=solution.taut)
    every = [(rope.weight, *rope.member) for rope in model.least_tensions]
    return np.stack([weight * balanced.stresses[g][:, e, 0] for weight, g, e in every], axis=1)


def force_coefficient(model: Model, actuator: int) -> tuple[int, float]:
    """The coefficient whose Lagrangian derivative is a drive's force, and its sign; -1 where it is commanded."""
    drive = model.topology.drives[actuator]
    if drive.force_controlled:
        return -1, 0.0
    return drive.coefficient, -drive.force_sign if drive.kind is DriveKind.STRAIN else 1.0


def force_derivative(model: Model, solution: Solution, actuator: int) -> Array:
    """Derivative (N, S) of a drive's force by all coefficients; nan where failed."""
    coefficient, sign = force_coefficient(model, actuator)
    if coefficient >= 0:
        return sign * coefficient_force_derivative(model, solution, coefficient)
    drive = model.topology.drives[actuator]
    out = np.zeros(solution.coefficients.shape)
    out[:, drive.force_coefficient] = drive.force_sign
    return out


def coefficient_force_derivative(model: Model, solution: Solution, coefficient: int) -> Array:
    """Total derivative (N, S) by all coefficients of the Lagrangian's derivative by one; nan where failed."""
    system, state, taut = solution.system, solution.state, solution.taut
    stepped = solution.coefficients.astype(complex)
    stepped[:, coefficient] += 1j * _STEP
    at = State(*(x.astype(complex) for x in (state.travel, state.rotation, state.multiplier)))
    at = place_prescribed(model.topology, stepped, at, free=system.free)
    numbers, scale = system_numbers(system, stepped), typical_stiffness(system, solution.coefficients)
    direct = lagrangian_gradient(system, numbers, at, taut=taut).imag / _STEP
    row = balance(system, numbers, at, scale, tangent=False, taut=taut).residual.imag / _STEP
    tangent = balance(system, solution.numbers, state, scale, taut=taut).tangent
    assert tangent is not None
    adjoint = np.nan_to_num(solve_rows(np.swapaxes(tangent, 1, 2), row[..., None]))
    back = adjoint_derivative(system, solution.numbers, state, np.swapaxes(adjoint, 1, 2), scale, taut=taut)[:, 0]
    out = np.asarray(direct - back)
    out[solution.failed] = np.nan
    return out
