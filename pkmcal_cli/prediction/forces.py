"""Forces of drives, tensions and strain energy at a solution, and their derivatives.

A drive's force is the derivative of the Lagrangian with respect to the coefficient of its position (minus that with
respect to a natural length; Castigliano's first theorem), so the force's derivatives come from a complex step in that
coefficient (Squire and Trapp 1998).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.derivative import adjoint_derivative, lagrangian_gradient
from pkmcal_cli.equilibrium.energy import strain_energy
from pkmcal_cli.equilibrium.kinematics import State, place_prescribed, without_stress
from pkmcal_cli.equilibrium.readings import ObservedQuantity, forced_energy, own_stiffness
from pkmcal_cli.equilibrium.system_numbers import system_numbers
from pkmcal_cli.mechanism.topology import DriveKind
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.solving import Solution
from pkmcal_cli.units.measurands import Measurand

_STEP = 1e-30


def drive_forces(model: Model, solution: Solution) -> tuple[Array, Array]:
    """Compute drive forces (N, A) and strain energy (N,)."""
    system, coefficients, state, taut = solution.system, solution.coefficients, solution.state, solution.taut
    gradient = lagrangian_gradient(system, solution.numbers, state, taut=taut)
    balanced = balance(system, solution.numbers, state, 1.0, tangent=False, taut=taut)
    energy = strain_energy(system, solution.numbers, balanced.strains, state, taut=taut)
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
    """Give the tensions (N, R) of the ropes that have to be taut, N."""
    if not model.least_tensions:
        return np.zeros((len(solution.state), 0))
    balanced = balance(solution.system, solution.numbers, solution.state, 1.0, tangent=False, taut=solution.taut)
    every = [(rope.weight, *rope.member) for rope in model.least_tensions]
    return np.stack([weight * balanced.stresses[g][:, e, 0] for weight, g, e in every], axis=1)


def force_coefficient(model: Model, actuator: int) -> tuple[int, float]:
    """Give the coefficient whose Lagrangian derivative is a drive's force, and its sign; -1 where it is commanded."""
    drive = model.topology.drives[actuator]
    if drive.force_controlled:
        return -1, 0.0
    return drive.coefficient, -drive.force_sign if drive.kind is DriveKind.STRAIN else 1.0


def load_values(model: Model, solution: Solution, quantities: Sequence[ObservedQuantity]) -> Array:
    """Compute forces of drives, tensions of ropes and strain energies (N, K)."""
    forces, energy = drive_forces(model, solution)
    balanced = balance(solution.system, solution.numbers, solution.state, 1.0, tangent=False, taut=solution.taut)
    out = np.empty((len(energy), len(quantities)))
    for k, q in enumerate(quantities):
        if q.measurand is Measurand.FORCE:
            out[:, k] = forces[:, q.index]
        elif q.measurand is Measurand.TENSION:
            out[:, k] = balanced.stresses[q.index][:, q.component, 0]
        else:
            out[:, k] = energy
    return out


def load_derivatives(model: Model, solution: Solution, quantities: Sequence[ObservedQuantity]) -> Array:
    """Differentiate the same by all coefficients, (N, K, S); nan where failed."""
    out = np.zeros((len(solution.coefficients), len(quantities), solution.coefficients.shape[1]))
    along = {k: c for k, q in enumerate(quantities) if (c := _conjugate(model, q))[0] >= 0}
    if along:
        signs = np.array([sign for _, sign in along.values()])
        by = coefficient_force_derivatives(model, solution, [c for c, _ in along.values()])
        out[:, list(along)] = signs[:, None] * by
        for k in along:
            _from_conjugate(model, solution, quantities[k], out[:, k])
    for k, q in enumerate(quantities):
        drive = model.topology.drives[q.index] if q.measurand is Measurand.FORCE else None
        if drive is not None and drive.force_controlled:
            out[:, k, drive.force_coefficient] = drive.force_sign
        elif q.measurand is Measurand.ENERGY:
            out[:, k] = _energy_derivative(model, solution)
    return out


def _conjugate(model: Model, quantity: ObservedQuantity) -> tuple[int, float]:
    """The coefficient whose Lagrangian derivative is a load, and its sign; -1 where there is none."""
    if quantity.measurand is Measurand.TENSION:
        group = model.topology.groups[quantity.index]
        return group.rest.start + quantity.component * len(group.element.strains), -1.0
    return force_coefficient(model, quantity.index) if quantity.measurand is Measurand.FORCE else (-1, 0.0)


def _from_conjugate(model: Model, solution: Solution, quantity: ObservedQuantity, out: Array) -> None:
    """From the derivatives (N, S) of what is conjugate to a natural length L to those of the tension T, in place.

    With stiffness ES / L they differ: the Lagrangian falls with L by T + (T - T0)^2 / (2 ES), T0 the prestress.
    """
    sign, target = 1.0, (quantity.index, quantity.component, 0)
    if quantity.measurand is Measurand.FORCE:
        drive = model.topology.drives[quantity.index]
        if drive.kind is not DriveKind.STRAIN:
            return
        sign, target = drive.force_sign, (drive.target[0], drive.target[1], drive.target[2])
    g, e, m = target
    group = model.topology.groups[g]
    if not group.element.per_length or group.rigid[e, m]:
        return
    stiffness, prestress = own_stiffness(group, e, m), group.prestress.start + e * group.shape[1] + m
    balanced = balance(solution.system, solution.numbers, solution.state, 1.0, tangent=False, taut=solution.taut)
    strain = balanced.stresses[g][:, e, m] - solution.coefficients[:, prestress] * solution.system.loaded
    strain = strain / solution.coefficients[:, stiffness]
    out[:, stiffness] += sign * strain**2 / 2
    out[:, prestress] += sign * strain
    out /= (1.0 + strain)[:, None]


def coefficient_force_derivatives(model: Model, solution: Solution, along: Sequence[int]) -> Array:
    """Differentiate the Lagrangian's derivatives by some coefficients, totally, by all: (N, K, S); nan where failed."""
    system, state, taut = solution.system, solution.state, solution.taut
    scale = typical_stiffness(system, solution.coefficients)
    direct, rows = [], []
    for coefficient in along:
        stepped = solution.coefficients.astype(complex)
        stepped[:, coefficient] += 1j * _STEP
        at = State(*(x.astype(complex) for x in (state.translation, state.rotation, state.multiplier)))
        at = place_prescribed(model.topology, stepped, at, free=system.free)
        numbers = system_numbers(system, stepped)
        direct.append(lagrangian_gradient(system, numbers, at, taut=taut).imag / _STEP)
        rows.append(balance(system, numbers, at, scale, tangent=False, taut=taut).residual.imag / _STEP)
    out = np.stack(direct, axis=1) - _carried(solution, np.stack(rows, axis=1), scale)
    out[solution.failed] = np.nan
    return np.asarray(out)


def _energy_derivative(model: Model, solution: Solution) -> Array:
    """Total derivative (N, S) of the strain energy of what drives in force control do not strain; nan where failed."""
    system, topology = solution.system, model.topology
    numbers = replace(
        solution.numbers,
        groups=tuple(replace(g, prestress=None) for g in solution.numbers.groups),
        forces=np.zeros_like(solution.numbers.forces),
    )
    free = without_stress(solution.state, system)
    direct = lagrangian_gradient(system, numbers, free, taut=solution.taut)
    for group in topology.groups:
        direct[:, group.prestress] = 0.0
    scale = typical_stiffness(system, solution.coefficients)
    by_unknowns = balance(system, numbers, free, scale, tangent=False, taut=solution.taut).residual
    by_unknowns[:, system.unknowns :] = 0.0
    out = direct - _carried(solution, by_unknowns[:, None], scale)[:, 0]
    out[solution.failed] = np.nan
    return np.asarray(out)


def _carried(solution: Solution, by_unknowns: Array, scale: float) -> Array:
    """What gradients by unknowns (N, K, n + c) hand on to coefficients: l^T g_c (N, K, S) with K^T l = z_u."""
    system, state, taut = solution.system, solution.state, solution.taut
    tangent = balance(system, solution.numbers, state, scale, taut=taut).tangent
    assert tangent is not None
    adjoint = tangent.solve_transposed(np.swapaxes(by_unknowns, 1, 2))
    adjoint = np.nan_to_num(np.swapaxes(adjoint, 1, 2))
    return adjoint_derivative(system, solution.numbers, state, adjoint, scale, taut=taut)
