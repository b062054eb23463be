"""The state of every row: rigid pose of the substructure, then elastic equilibrium or one linear step.

`linear` is the paper's model, X = fgm(q_nr, xi) + dX_e with K dX_e = F (Ecorchard 2010, eq. 7, 10, 11, 19): one step
from the rigid pose, which depends to second order on the chosen substructure. `exact` is the stable equilibrium of
least strain energy, which does not; it starts where released drives have gone, nearly free of stress, so that Newton's
method converges. Which ropes carry follows from the equilibrium.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.descent import descend
from pkmcal_cli.equilibrium.energy import slack_ropes, strain_energy
from pkmcal_cli.equilibrium.kinematics import State, advance, place_prescribed, without_stress
from pkmcal_cli.equilibrium.newton import Effort, NewtonOptions, follow, newton
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.strains import all_strains
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers, beyond_beams, system_numbers
from pkmcal_cli.mechanism.topology import Drive, Index
from pkmcal_cli.model.freedoms import LEAST_MISFIT, NO_MISFIT
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.singular_drives import substructure_holds
from pkmcal_cli.prediction.common_pose import common_pose
from pkmcal_cli.prediction.other_assemblies import largest_gap, no_other_near, still_compared, turned_over
from pkmcal_cli.prediction.rigid_pose import relaxed_coefficients, rigid_pose, substructure_pose
from pkmcal_cli.prediction.rows import Method, Sought, WarmStart

_ROUGH = NewtonOptions(curved=False, tolerance=1e-3)  # of its last step: the error, about the square, is far less
_ELASTIC = NewtonOptions(contraction=0.9, rebound=0.25, reach=0.5)
_TAUT = replace(_ELASTIC, taut=True)
_TORN = 0.1  # of the size of the machine: drives that disagree by more agree on nothing
_ALIKE, _NONE = 2.0, 2e-6  # misfits of two assemblies within this factor tell neither; what descents may leave of none
_GROWN = 2.0  # a misfit that has grown less than so since the pose was compared with others needs no comparison


@dataclass(frozen=True, kw_only=True)
class Solution:
    """States of N rows and how they were found.

    system: the one that they solve, or nearly; misfit (N,): up to which the pose was compared with others; taut: ropes
    push too; sought: see `WarmStart`.
    """

    system: System
    coefficients: Array  # (N, S)
    state: State
    status: NDArray[np.int_]  # (N,)
    misfit: Array
    taut: bool
    steps: int
    numbers: SystemNumbers  # what the coefficients say about the system
    sought: Sought | None = None

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Rows without numbers."""
        return np.asarray(self.status != RowStatus.SOLVED)


def solve(
    model: Model, coefficients: Array, method: Method, start: WarmStart | None, compare: bool, *, sparing: bool = False
) -> Solution:
    """Solve rows by a method; `start`: states near the solution, for `exact`; `compare`: see `Request`.

    sparing: rows of which one is lost are of no use; others may fail then, where none is compared.
    """
    effort = Effort(sparing=sparing and not compare)
    beyond = beyond_beams(model.exact, coefficients)
    if beyond.any():
        coefficients = coefficients.copy(order="K")
        coefficients[beyond] = model.reference_coefficients
    solution = _solve(model, coefficients, method, start, compare, effort)
    if not beyond.any():
        return solution
    return replace(solution, status=np.where(beyond, RowStatus.OUT_OF_REACH, solution.status))


def _solve(
    model: Model, coefficients: Array, method: Method, start: WarmStart | None, compare: bool, effort: Effort
) -> Solution:
    if method == "exact":
        numbers = system_numbers(model.exact, coefficients)
        asked = Sought.at(model.mark, coefficients)
        known = start is not None and start.sought is not None and start.sought.answers(asked)
        rows = start if start is not None and known else _equilibrium(
            model, coefficients, numbers, start, compare, effort
        )
        return Solution(
            system=model.exact, coefficients=coefficients, state=rows.state, status=rows.status, misfit=rows.misfit,
            taut=False, steps=effort.steps, numbers=numbers, sought=asked if compare or known else None,
        )  # fmt: skip
    state, status = substructure_pose(model, coefficients, effort)
    if method == "linear":
        state = _one_step(model, coefficients, state, status, effort)
    system = model.rigid if method == "rigid" else model.exact
    return Solution(
        system=system, coefficients=coefficients, state=state, status=status, misfit=np.zeros(len(status)), taut=True,
        steps=effort.steps, numbers=system_numbers(system, coefficients),
    )  # fmt: skip


def _equilibrium(
    model: Model,
    coefficients: Array,
    numbers: SystemNumbers,
    start: WarmStart | None,
    compare: bool,
    effort: Effort,
) -> WarmStart:
    """The stable equilibrium of least strain energy: as found; where that is in doubt, from the common pose too."""
    if start is None:
        rows = _from_reference(model, coefficients, numbers, effort)
    else:
        rows = _from_earlier(model, coefficients, numbers, start, compare, effort)
    if not (compare and model.overdetermined):
        return rows
    apart = largest_gap(model, numbers, rows.state)
    solved = rows.status == RowStatus.SOLVED
    fits = solved & (apart <= _GROWN * rows.misfit)
    sole = no_other_near(model, numbers, rows.state, np.where(solved & ~fits, apart, np.inf))
    rows, fits = replace(rows, misfit=np.where(sole & (apart > NO_MISFIT), apart, rows.misfit)), fits | sole
    if (solved & ~fits).any() and substructure_holds(model):
        fits |= solved & (apart < model.expected_misfit)  # no other assembly is near
    doubtful = np.nonzero(~fits & ~_still_out_of_reach(rows))[0]
    if not len(doubtful):
        return rows
    return rows.put(doubtful, _compared(model, coefficients[doubtful], rows.take(doubtful), effort))


def _still_out_of_reach(rows: WarmStart) -> NDArray[np.bool_]:
    """Rows (N,) whose drives were compared with all poses and agree on none."""
    return np.asarray((rows.status == RowStatus.OUT_OF_REACH) & (rows.misfit > 0))


def _compared(model: Model, coefficients: Array, rows: WarmStart, effort: Effort) -> WarmStart:
    """Rows with the equilibrium next to the common pose where its energy is less, and true reasons where none holds."""
    pose, numbers = common_pose(model, coefficients), system_numbers(model.exact, coefficients)
    state, status = _relaxed_equilibrium(model, coefficients, numbers, pose.state, model.held_drives, effort)
    before = np.where(rows.status == RowStatus.SOLVED, _energy(model, numbers, rows.state), np.inf)
    after = np.where(status == RowStatus.SOLVED, _energy(model, numbers, state), np.inf)
    stays = (rows.status == RowStatus.SOLVED) & turned_over(model, state, rows.state)
    won = np.nonzero((after < before) & ~stays)[0]
    rows = rows.put(won, WarmStart(state, status, rows.misfit).take(won))
    status, apart = rows.status.copy(), largest_gap(model, numbers, rows.state)
    status[(status != RowStatus.SOLVED) & pose.singular] = RowStatus.SINGULAR
    slack = _any_slack(model, numbers, rows.state)  # a slack rope is longer than the pose needs: no misfit
    alike = (pose.rival < LEAST_MISFIT) & (pose.rival < _ALIKE * np.maximum(pose.misfit, _NONE))
    status[alike & ~slack] = RowStatus.AMBIGUOUS
    misfit = np.where(slack, apart, pose.misfit)
    far = np.nonzero(misfit > max(_TORN, model.expected_misfit))[0]
    status[far] = RowStatus.OUT_OF_REACH
    state = rows.state.put(far, without_stress(pose.state, model.exact).take(far))
    apart[far] = misfit[far]
    return WarmStart(state, status, apart)


def _any_slack(model: Model, numbers: SystemNumbers, state: State) -> NDArray[np.bool_]:
    """Rows (N,) with a slack rope."""
    every = slack_ropes(model.exact, numbers, all_strains(model.exact, numbers, state), state)
    return np.asarray(np.concatenate(every, axis=1).any(axis=1))


def _energy(model: Model, numbers: SystemNumbers, state: State) -> Array:
    """Strain energy (N,), J."""
    return strain_energy(model.exact, numbers, all_strains(model.exact, numbers, state), state)


def _from_earlier(
    model: Model, coefficients: Array, numbers: SystemNumbers, start: WarmStart, compare: bool, effort: Effort
) -> WarmStart:
    """Elastic equilibrium from an earlier state; from the rigid pose where there is none or it does not lead there.

    Without `compare` states of ropes that do not lead there are not looked for elsewhere: descents are dear. Rows whose
    drives agreed on no pose stay as they are: only a prediction without a start looks for one again.
    """
    system, rows = model.exact, start
    near = np.nonzero(start.status == RowStatus.SOLVED)[0]
    if len(near):
        every = len(near) == len(start.status)
        some, some_numbers, before = coefficients, numbers, start.state
        if not every:
            some, some_numbers, before = coefficients[near], numbers.take(near), before.take(near)
        placed = place_prescribed(model.topology, some, before, free=system.free)
        slack = np.zeros(len(near), dtype=bool) if start.slack is None else start.slack[near]
        state, status = _from_near(model, some_numbers, placed, slack, effort)
        misfit = np.where(status == RowStatus.SOLVED, start.misfit[near], 0.0)
        solved = WarmStart(state, status, still_compared(model, misfit, before, state))
        rows = solved if every else rows.put(near, solved)
    lost = (rows.status != RowStatus.SOLVED) & ~_still_out_of_reach(rows)
    todo = np.nonzero(lost & (compare | (not system.ropes) | (start.status != RowStatus.SOLVED)))[0]
    if not len(todo):
        return rows
    return rows.put(todo, _from_reference(model, coefficients[todo], numbers.take(todo), effort))


def _from_near(
    model: Model, numbers: SystemNumbers, placed: State, slack: NDArray[np.bool_], effort: Effort
) -> tuple[State, NDArray[np.int_]]:
    """Elastic equilibrium from states of rows (n,) nearby; `slack` (n,): in which a rope was slack there.

    In the others small tensions may be less than what the start lacks, so that ropes seem slack that carry.
    """
    system = model.exact
    if not system.ropes:
        return newton(system, numbers, placed, model.length, _ELASTIC, effort)
    state, status = placed, np.full(len(slack), RowStatus.NOT_CONVERGED)
    for options, rows in ((_TAUT, ~slack), (_ELASTIC, slack), (_ELASTIC, ~slack), (_TAUT, slack)):
        todo = np.nonzero(rows & (status != RowStatus.SOLVED))[0]
        if len(todo) == len(rows):
            state, status = newton(system, numbers, placed, model.length, options, effort)
        elif len(todo):
            begin = numbers.take(todo), placed.take(todo)
            moved, status[todo] = newton(system, *begin, model.length, options, effort)
            state = state.put(todo, moved)
    return state, status


def _from_reference(model: Model, coefficients: Array, numbers: SystemNumbers, effort: Effort) -> WarmStart:
    """Elastic equilibrium from the rigid pose, which is continued from the reference configuration."""
    state, status = rigid_pose(model, coefficients, _ROUGH, effort)
    rows = WarmStart(without_stress(state, model.exact), status, np.zeros(len(status)))
    good = np.nonzero(status == RowStatus.SOLVED)[0]
    if not len(good):
        return rows
    every = len(good) == len(status)
    if not every:
        coefficients, numbers, state = coefficients[good], numbers.take(good), state.take(good)
    relaxed = _relaxed_equilibrium(model, coefficients, numbers, state, model.redundant_drives, effort)
    solved = WarmStart(*relaxed, rows.misfit[good])
    return solved if every else rows.put(good, solved)


def _relaxed_equilibrium(
    model: Model, coefficients: Array, numbers: SystemNumbers, pose: State, drives: Sequence[Drive], effort: Effort
) -> tuple[State, NDArray[np.int_]]:
    """Elastic equilibrium from a closed pose, at which some drives are elsewhere than commanded."""
    system, begin = model.exact, without_stress(pose, model.exact)
    if system.ropes:
        return _taut_equilibrium(model, coefficients, numbers, begin, effort)

    def relaxed(some: Index) -> Array:
        return relaxed_coefficients(model, coefficients[some], begin.take(some), drives)

    return follow(
        system, relaxed, coefficients, state=begin, length=model.length, options=_ELASTIC, effort=effort,
        numbers=numbers,
    )  # fmt: skip


def _taut_equilibrium(
    model: Model, coefficients: Array, numbers: SystemNumbers, begin: State, effort: Effort
) -> tuple[State, NDArray[np.int_]]:
    """Elastic equilibrium of a machine with ropes: where Newton's method fails, the potential falls from the pose."""
    system = model.exact
    placed = place_prescribed(model.topology, coefficients, begin, free=system.free)
    state, status = newton(system, numbers, placed, model.length, _TAUT, effort)
    todo = np.nonzero(status != RowStatus.SOLVED)[0]
    if len(todo):
        some = coefficients[todo]
        near = descend(system, some, placed.take(todo), model.length, effort)
        again, status[todo] = newton(system, some, near, model.length, _ELASTIC, effort)
        state = state.put(todo, again)
    return state, status


def _one_step(model: Model, coefficients: Array, state: State, status: NDArray[np.int_], effort: Effort) -> State:
    """The paper's elastic displacement: one linear step of the whole structure from the rigid pose (eq. 7, 10, 19)."""
    system = model.exact
    placed = place_prescribed(model.topology, coefficients, without_stress(state, system), free=system.free)
    numbers = system_numbers(system, coefficients)
    scale = typical_stiffness(system, numbers)
    balanced = balance(system, numbers, placed, scale, curved=False, taut=True)
    assert balanced.tangent is not None
    step = -balanced.tangent.solve(balanced.residual[..., None])[..., 0]
    effort.add(len(coefficients))
    lost = ~np.isfinite(step).all(axis=1)
    status[lost & (status == RowStatus.SOLVED)] = RowStatus.SINGULAR
    step[lost] = 0.0
    return advance(system, placed, step, scale)
