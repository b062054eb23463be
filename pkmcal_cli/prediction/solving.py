"""The state of every row: rigid pose of the substructure, then elastic equilibrium or one linear step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.branch import left_mode
from pkmcal_cli.equilibrium.given import Given, given
from pkmcal_cli.equilibrium.kinematics import State, advance, drawn_state, place_prescribed
from pkmcal_cli.equilibrium.newton import Effort, NewtonOptions, Slack, follow, newton, solve_rows
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.mechanism.topology import DriveKind, Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.rows import Method

_REACH = 0.01  # a rigid pose whose gaps exceed this share of the machine's size does not close
_ROUGH = NewtonOptions(curved=False, tolerance=1e-6)
_RIGID = NewtonOptions(curved=False)
_ELASTIC = NewtonOptions(contraction=0.9, rebound=0.25, reach=0.5)


@dataclass(frozen=True)
class Solution:
    """States of N rows and how they were found; `system`: the one that they solve, or nearly."""

    system: System
    slots: Array  # (N, S)
    state: State
    status: NDArray[np.int_]  # (N,)
    slack: Slack | None
    steps: int

    @cached_property
    def numbers(self) -> Given:
        """What the slots say about the system."""
        return given(self.system, self.slots)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Rows without numbers."""
        return np.asarray(self.status != RowStatus.SOLVED)


def solve(model: Model, slots: Array, method: Method, start: State | None) -> Solution:
    """Solve rows by a method; `start`: states near the solution, for `exact`."""
    effort = Effort()
    if method == "exact":
        state, status, slack = _equilibrium(model, slots, start, effort)
        return Solution(model.exact, slots, state, status, slack, effort.steps)
    state, status = rigid_pose(model, slots, _RIGID, effort)
    if method == "rigid":
        return Solution(model.rigid, slots, state, status, None, effort.steps)
    state = _one_step(model, slots, state, status, effort)
    return Solution(model.exact, slots, state, status, None, effort.steps)


def rigid_pose(model: Model, slots: Array, options: NewtonOptions, effort: Effort) -> tuple[State, NDArray[np.int_]]:
    """Pose of the non-redundant substructure (Ecorchard 2010, fgm of eq. 11), continued from the drawing."""
    system = model.rigid
    begin = model.drawn_slots
    state = drawn_state(model.layout, begin, len(slots), system.constraints)
    state, status, _ = follow(system, begin, slots, state=state, length=model.length, options=options, effort=effort)
    elsewhere = left_mode(system, model.drawn_mode, slots, state, model.length)
    failed = np.nonzero(status != RowStatus.SOLVED)[0]
    status[elsewhere & (status == RowStatus.SOLVED)] = RowStatus.WRONG_MODE
    if len(failed):
        status[failed] = _failure(model, slots[failed])
    _check_reach(model, slots, state, status)
    return state, status


def _check_reach(model: Model, slots: Array, state: State, status: NDArray[np.int_]) -> None:
    """Rows whose rigid pose has a gap of more than a share of the machine's size are out of reach."""
    good = np.nonzero(status == RowStatus.SOLVED)[0]
    if not len(good):
        return
    if len(good) < len(slots):
        slots, state = slots[good], state.take(good)
    strains = balance(model.rigid, slots, state, 1.0, tangent=False).strains
    groups = model.rigid.groups
    gaps = [e * (group.elastic * group.group.element.gaps) for group, e in zip(groups, strains, strict=True)]
    status[good[_largest(gaps, len(good)) > _REACH * model.length]] = RowStatus.OUT_OF_REACH


def _largest(strains: list[Array], rows: int) -> Array:
    """The largest strain of each row, (N,)."""
    out = np.zeros(rows)
    for e in strains:
        out = np.maximum(out, np.abs(e).max(axis=(1, 2), initial=0.0))
    return out


def _failure(model: Model, slots: Array) -> NDArray[np.int_]:
    """Why rows have no rigid pose: the mechanism closes elsewhere, not at all, or is singular there."""
    system = model.rigid
    state = drawn_state(model.layout, model.drawn_slots, len(slots), system.constraints)
    free = NewtonOptions(curved=False, contraction=np.inf, iterations=60, tolerance=1e-8)
    placed = place_prescribed(model.layout, slots, state, free=system.free)
    state, status, _ = newton(system, slots, placed, model.length, free, Effort())
    _check_reach(model, slots, state, status)
    out = np.full(len(slots), RowStatus.OUT_OF_REACH)
    out[status == RowStatus.SOLVED] = RowStatus.WRONG_MODE
    strains = balance(system, slots, state, typical_stiffness(system, slots), tangent=False).strains
    strain = _largest(list(strains), len(slots))
    closed = np.isfinite(strain) & (strain < 1e-6 * model.length) & (status != RowStatus.SOLVED)
    out[closed] = RowStatus.SINGULAR
    return out


def _equilibrium(
    model: Model, slots: Array, start: State | None, effort: Effort
) -> tuple[State, NDArray[np.int_], Slack]:
    """Elastic equilibrium, from an earlier state; from the rigid pose where there is none or it does not lead there."""
    if start is None:
        return _from_drawing(model, slots, effort)
    system = model.exact
    placed = place_prescribed(model.layout, slots, start, free=system.free)
    state, status, slack = newton(system, slots, placed, model.length, _ELASTIC, effort)
    todo = np.nonzero(status != RowStatus.SOLVED)[0]
    if len(todo):
        again, status[todo], loose = _from_drawing(model, slots[todo], effort)
        state = state.put(todo, again)
        for mine, theirs in zip(slack, loose, strict=True):
            mine[todo] = theirs
    return state, status, slack


def _from_drawing(model: Model, slots: Array, effort: Effort) -> tuple[State, NDArray[np.int_], Slack]:
    """Elastic equilibrium from the rigid pose, which is continued from the drawing."""
    system, rows = model.exact, len(slots)
    state, status = rigid_pose(model, slots, _ROUGH, effort)
    state = without_stress(state, system)
    good = np.nonzero(status == RowStatus.SOLVED)[0]
    slack = tuple(np.zeros((rows, g.group.shape[0]), dtype=bool) for g in system.groups)
    if not len(good):
        return state, status, slack
    every = len(good) == rows
    mine, part = (slots, state) if every else (slots[good], state.take(good))

    def relaxed(some: Index) -> Array:
        return _relaxed_slots(model, mine[some], part.take(some))

    part_solved, now, loose = follow(
        system, relaxed, mine, state=part, length=model.length, options=_ELASTIC, effort=effort
    )
    for all_rows, theirs in zip(slack, loose, strict=True):
        all_rows[good] = theirs
        now[theirs.any(axis=1)] = RowStatus.SLACK
    status[good] = now
    return part_solved if every else state.put(good, part_solved), status, slack


def without_stress(state: State, system: System) -> State:
    """The same pose as a state of another system, its constraints without force."""
    return State(state.travel, state.rotation, np.zeros((len(state), system.constraints), order="F"))


def _relaxed_slots(model: Model, slots: Array, state: State) -> Array:
    """Slots at which the rigid pose is (nearly) stress-free: no loads, released drives where they have gone."""
    out, layout, system = slots.copy(order="K"), model.layout, model.released
    for group in layout.groups:
        out[:, group.prestress] = 0.0
    out[:, layout.force_slots] = 0.0
    strains = balance(system, slots, without_stress(state, system), 1.0, tangent=False).strains
    for drive in layout.drives:
        if drive.redundant and not drive.force_controlled:
            if drive.kind is DriveKind.TRAVEL:
                out[:, drive.slot] = state.travel[:, drive.target[0]]
            elif drive.kind is DriveKind.STRAIN:
                index, e, m = drive.target
                out[:, drive.slot] += strains[index][:, e, m]
    return out


def _one_step(model: Model, slots: Array, state: State, status: NDArray[np.int_], effort: Effort) -> State:
    """The paper's elastic displacement: one linear step of the whole structure from the rigid pose (eq. 7, 10, 19)."""
    system = model.exact
    placed = place_prescribed(model.layout, slots, without_stress(state, system), free=system.free)
    scale = typical_stiffness(system, slots)
    now = balance(system, slots, placed, scale, curved=False)
    assert now.tangent is not None
    step = -solve_rows(now.tangent, now.residual[..., None])[..., 0]
    effort.add(len(slots))
    lost = ~np.isfinite(step).all(axis=1)
    status[lost & (status == RowStatus.SOLVED)] = RowStatus.SINGULAR
    step[lost] = 0.0
    return advance(system, placed, step, scale)
