"""Whether the machine stays where it is drawn: whether the equilibrium there is a minimum of the energy, not a saddle.

Rows are solved from the drawn configuration on, so what balances there and does not stay is seen at once. Ropes may
hide it, since their energy is followed to another equilibrium; where that is next to the drawing the machine stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.energy import slack_ropes
from pkmcal_cli.equilibrium.kinematics import State, place_prescribed, reference_state
from pkmcal_cli.equilibrium.newton import Effort, NewtonOptions, newton, unit_sizes
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.system_numbers import system_numbers
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.pipeline import predict
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.prediction.stages import BaseCoefficients, commanded_coefficients

_NEXT = 0.01  # sizes of the machine, or rad
_FROM_DRAWING = NewtonOptions(contraction=0.9, rebound=0.25, reach=0.5, taut=True)


@dataclass(frozen=True)
class Motion:
    """Coordinates (k,) of the topology and how much each moves (k,), in sizes of the machine or rad; largest first.

    slack: whether ropes hang loose there, which drives can tension.
    """

    coordinates: Index
    amounts: Array
    slack: bool


def unstable_motion(model: Model) -> Motion | None:
    """The motion in which the machine leaves its drawn configuration, at nominal parameters; None where it stays.

    None too where nothing balances near the drawing.
    """
    system, rows = model.exact, Rows.at(model.reference_readings[None])
    if not system.unknowns:
        return None
    coefficients = commanded_coefficients(model, BaseCoefficients.of(model, model.nominal, rows), rows)
    begin = reference_state(model.topology, coefficients, 1, system.constraints)
    begin = place_prescribed(model.topology, coefficients, begin, free=system.free)
    with np.errstate(invalid="ignore", divide="ignore"):
        state, status = newton(system, coefficients, begin, model.length, _FROM_DRAWING, Effort())
    if status[0] != RowStatus.UNSTABLE:
        return None
    there = predict(model, model.nominal, rows)
    if there.solved[0] and _apart(model, begin, there.state) < _NEXT:
        return None
    return _weakest(model, coefficients, state)


def _apart(model: Model, one: State, other: State) -> float:
    """How far two states (1 row) are apart, in sizes of the machine or rad."""
    moved = np.abs(one.translation - other.translation).max(initial=0.0) / model.length
    turned = np.abs(log(np.swapaxes(one.rotation, -1, -2) @ other.rotation)).max(initial=0.0)
    return max(float(moved), float(turned))


def _weakest(model: Model, coefficients: Array, state: State) -> Motion:
    """The motion of least stiffness that rigid constraints leave free."""
    system, numbers = model.exact, system_numbers(model.exact, coefficients)
    balanced = balance(system, numbers, state, typical_stiffness(system, numbers))
    assert balanced.tangent is not None
    unit, n = unit_sizes(system, model.length), system.unknowns
    matrix = balanced.tangent.dense()[0]
    stiffness, gradients = matrix[:n, :n] * np.outer(unit, unit), matrix[n:, :n] * unit
    _, sizes, right = np.linalg.svd(gradients, full_matrices=True)
    free = right[int((sizes > 1e-9 * sizes.max(initial=0.0)).sum()) :].T
    motion = free @ np.linalg.eigh(free.T @ (stiffness + stiffness.T) @ free)[1][:, 0]
    order = np.argsort(-np.abs(motion), kind="stable")
    hanging = any(slack.any() for slack in slack_ropes(system, numbers, balanced.strains, state))
    return Motion(system.free[order], motion[order], hanging and bool(model.redundant_drives))
