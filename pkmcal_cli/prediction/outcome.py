"""The reading stage gives what sensors read at a solution, its derivatives, drive forces and energy.

dz/dc = z_c - l^T g_c with K^T l = z_u (see `equilibrium.derivative`): one adjoint solve per channel, whatever the
number of parameters.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.derivative import adjoint_derivative
from pkmcal_cli.equilibrium.energy import slack_ropes
from pkmcal_cli.equilibrium.readings import Readings, read_quantities
from pkmcal_cli.equilibrium.strains import all_strains
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.displacements import Displacements
from pkmcal_cli.prediction.forces import drive_forces, least_tensions, load_derivatives, load_values
from pkmcal_cli.prediction.observation import read_sensors
from pkmcal_cli.prediction.rope_strains import rope_strains
from pkmcal_cli.prediction.rows import Prediction, Request, Rows
from pkmcal_cli.prediction.solving import Solution
from pkmcal_cli.prediction.stages import Chain


def outcome(
    model: Model, solution: Solution, rows: Rows, request: Request, chain: Chain, moved: Displacements
) -> Prediction:
    """Make the prediction of solved rows; rows that failed get nan."""
    gains = np.array([a.gain_coefficient for a in model.actuators], dtype=np.intp)
    coefficients, state, bad = solution.coefficients, solution.state, solution.failed
    jacobian, by_drive, forces, energy, tension = None, None, None, None, None
    observed, by_coefficient = _observed(model, solution, gains, request.derivatives)
    values, slopes = read_sensors(model, observed, coefficients, by_coefficient, rows.measured)
    if slopes is not None:
        jacobian, by_drive = chain.apply(rows, coefficients, slopes, moved)
    values[bad] = np.nan
    if request.forces:
        forces, energy = drive_forces(model, solution)
        tension = least_tensions(model, solution)
        forces[bad], energy[bad], tension[bad] = np.nan, np.nan, np.nan
    names = _slack_names(solution)
    ropes = rope_strains(solution, rows, chain, moved) if request.ropes and solution.system.ropes else None
    return Prediction(
        values=values,
        status=solution.status,
        state=state,
        jacobian=jacobian,
        by_drive=by_drive,
        forces=forces,
        energy=energy,
        tension=tension,
        slack=names,
        misfit=solution.misfit,
        ropes=ropes,
        steps=solution.steps,
        sought=solution.sought,
    )


def _observed(model: Model, solution: Solution, gains: Array, derivatives: bool) -> tuple[Array, Array | None]:
    """All observed (N, V), and their derivatives by coefficients (N, V, S) where these are asked for."""
    system, coefficients = solution.system, solution.coefficients
    loads = [k for k, v in enumerate(model.observed) if v.is_load]
    seen = tuple(v for v in model.observed if not v.is_load)
    readings = read_quantities(
        system, coefficients, solution.state, seen, gains, solution.numbers if derivatives else None
    )
    slopes = _coefficient_jacobian(solution, readings) if derivatives else None
    if not loads:
        return readings.values, slopes
    quantities = [model.observed[k] for k in loads]
    others = [k for k in range(len(model.observed)) if k not in loads]
    values = np.empty((len(coefficients), len(model.observed)))
    values[:, others] = readings.values
    values[:, loads] = load_values(model, solution, quantities)
    if slopes is None:
        return values, None
    full = np.empty((len(coefficients), len(model.observed), coefficients.shape[1]))
    full[:, others] = slopes
    full[:, loads] = load_derivatives(model, solution, quantities)
    return values, full


def _slack_names(solution: Solution) -> dict[int, tuple[str, ...]]:
    """Names of the slack ropes by row."""
    out: dict[int, tuple[str, ...]] = {}
    if solution.taut or not solution.system.ropes:
        return out
    system, numbers, state = solution.system, solution.numbers, solution.state
    every = slack_ropes(system, numbers, all_strains(system, numbers, state), state)
    for group, slack in zip(system.groups, every, strict=True):
        for row in np.nonzero(slack.any(axis=1) & ~solution.failed)[0]:
            names = [group.group.names[k] for k in np.nonzero(slack[row])[0]]
            out[int(row)] = (*out.get(int(row), ()), *names)
    return out


def _coefficient_jacobian(solution: Solution, readings: Readings) -> Array:
    """d readings / d coefficients (N, C, S): direct part minus the adjoint one; nan in unsolved rows."""
    system, state, taut = solution.system, solution.state, solution.taut
    assert readings.unknowns is not None and readings.coefficients is not None
    scale = typical_stiffness(system, solution.numbers)
    balanced = balance(system, solution.numbers, state, scale, taut=taut)
    assert balanced.tangent is not None
    adjoint = balanced.tangent.solve_transposed(np.swapaxes(readings.unknowns, 1, 2))
    adjoint = np.nan_to_num(np.swapaxes(adjoint, 1, 2))
    out = readings.coefficients
    out -= adjoint_derivative(system, solution.numbers, state, adjoint, scale, taut=taut, points=readings.points)
    out[solution.failed] = np.nan
    return out
