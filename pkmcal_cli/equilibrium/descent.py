"""Descent of the potential to a stable equilibrium, for machines whose ropes go slack on the way.

A rope's energy is 1/2 k max(0, e)^2: convex, but its stiffness jumps where the rope goes slack, and Newton's method may
swing between two sets of carrying ropes for ever. Here a step counts only if it lowers the potential, and is damped
(Levenberg 1944) until it does; rigid constraints weigh in by their sum times a bound of their forces, so that a step of
Newton lowers the whole (Han 1977). It ends near the equilibrium: Newton's method goes on from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import Balance, balance, typical_stiffness
from pkmcal_cli.equilibrium.energy import potential_energy
from pkmcal_cli.equilibrium.kinematics import State, advance
from pkmcal_cli.equilibrium.newton import Effort, unit_sizes
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers, system_numbers
from pkmcal_cli.equilibrium.tangent import solve_rows

_ITERATIONS = 100
_LONGEST = 0.15  # step, in sizes of the machine or rad
_NEAR = 1e-7  # a step this small is the last: Newton's method does the rest
_LEAST, _MOST = 1e-10, 1e3  # damping, against the machine's stiffness
_ROUNDING = 1e-14  # of the potential


@dataclass
class _Point:
    """Rows where a descent stands: their state, balance, potential (N,) and the sum of their constraints' gaps (N,)."""

    state: State
    balanced: Balance
    potential: Array
    gaps: Array

    @classmethod
    def at(cls, system: System, numbers: SystemNumbers, state: State, scale: float) -> _Point:
        """The point at states."""
        balanced = balance(system, numbers, state, scale)
        gaps = np.abs(balanced.residual[:, system.unknowns :]).sum(axis=1)
        return cls(state, balanced, potential_energy(system, numbers, balanced.strains, state), gaps)


def descend(system: System, coefficients: Array, state: State, length: float, effort: Effort) -> State:
    """Go from `state` to states near the stable equilibria to which the potential falls."""
    numbers = system_numbers(system, coefficients)
    scale = typical_stiffness(system, numbers)
    unit = unit_sizes(system, length)
    damping = np.full(len(state), _LEAST)
    force = np.zeros(len(state))  # bound of the constraints' scaled forces
    active = np.arange(len(state))
    for _ in range(_ITERATIONS):
        if not len(active):
            break
        effort.add(len(active))
        some = numbers.take(active)
        point = _Point.at(system, some, state.take(active), scale)
        step = _damped(system, point.balanced, damping[active] * scale, unit)
        trial = advance(system, point.state, step, scale)
        force[active] = np.maximum(force[active], 2 * np.abs(trial.multiplier / scale).max(axis=1, initial=0.0))
        then = _Point.at(system, some, trial, scale)
        lower = _change(system, some, step, point, then, force[active]) < 0
        won = np.nonzero(lower)[0]
        state = state.put(active[won], trial.take(won))
        damping[active] = np.clip(damping[active] * np.where(lower, 0.1, 10.0), _LEAST, 10 * _MOST)
        size = np.abs(step[:, : system.unknowns] / unit).max(axis=1, initial=0.0)
        active = active[(size > _NEAR) & (damping[active] < _MOST)]
    return state


def _damped(system: System, balanced: Balance, damping: Array, unit: Array) -> Array:
    """Steps (N, n + c) of Newton, damped by a stiffness (N,) and bounded."""
    assert balanced.tangent is not None
    tangent, n = balanced.tangent.dense().copy(), system.unknowns
    tangent[:, np.arange(n), np.arange(n)] += damping[:, None] * (unit.max() / unit) ** 2
    step = np.nan_to_num(-solve_rows(tangent, balanced.residual[..., None])[..., 0])
    size = np.abs(step[:, :n] / unit).max(axis=1, initial=1e-300)
    return np.asarray(step * np.minimum(1.0, _LONGEST / size)[:, None])


def _change(system: System, numbers: SystemNumbers, step: Array, point: _Point, then: _Point, force: Array) -> Array:
    """Change (N,) of potential and weighted gaps; negative where the step lowers them by more than rounding."""
    where = system.unknown_of[system.topology.force_dofs]
    held = np.nonzero(where >= 0)[0]
    work = (numbers.forces[:, held] * step[:, where[held]]).sum(axis=1) if len(held) else 0.0
    change = then.potential - point.potential - work + force * (then.gaps - point.gaps)
    change += _ROUNDING * np.abs(point.potential)
    return np.where(np.isfinite(change), change, np.inf)
