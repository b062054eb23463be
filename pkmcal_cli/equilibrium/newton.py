"""Newton's method for all rows at once, with a contraction test, and path following for rows that fail it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.given import given
from pkmcal_cli.equilibrium.kinematics import State, advance, place_prescribed
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.mechanism.topology import Index

_DIVERGED = 1e3  # a step of so many sizes of the machine, or rad, comes from a matrix without meaning
_ROUNDING = 1e-13  # a step this small, relative to the machine's size or in rad, is rounding


@dataclass(frozen=True)
class NewtonOptions:
    """`contraction`: a step longer than this times the last one means another branch (Deuflhard's test).

    `rebound`: unless it is below this share of the one before. Turning a beam by a tangent step stretches it to second
    order, and taking that back turns it again: of three steps the third may well exceed the second.
    `reach`: a step longer than this, in sizes of the machine or rad, leads elsewhere.
    """

    curved: bool = True  # full tangent with the stress term; False: Gauss-Newton on the strains
    contraction: float = 0.5
    rebound: float = 0.0
    reach: float = _DIVERGED
    iterations: int = 30
    tolerance: float = _ROUNDING  # accepted error after the last step, relative to the machine's size


@dataclass
class Effort:
    """How many elastic steps (assembly and solve of one row) were spent."""

    steps: int = 0
    per_round: list[int] = field(default_factory=list)

    def add(self, rows: int) -> None:
        """Count one step of `rows` rows."""
        self.steps += rows
        self.per_round.append(rows)


Slack = tuple[NDArray[np.bool_], ...]


def solve_rows(matrix: Array, right: Array) -> Array:
    """Solve (N, n, n) x = (N, n, k); NaN in rows whose matrix is singular."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            return np.full(right.shape, np.nan, dtype=right.dtype)
        half = len(matrix) // 2
        return np.concatenate([solve_rows(matrix[:half], right[:half]), solve_rows(matrix[half:], right[half:])])


def slots_of(slots: Array, rows: Index) -> Array:
    """Slots of some rows, of an array (1 or N, S)."""
    return slots if len(slots) == 1 else slots[rows]


def step_size(system: System, step: Array, length: float) -> Array:
    """Largest entry of each row's step, lengths relative to `length`, (N,)."""
    unit = np.where(system.free < len(system.layout.travel_slots), length, 1.0)
    scaled = np.abs(step[:, : system.unknowns]) / unit
    return np.asarray(scaled.max(axis=1, initial=0.0))


def newton(
    system: System, slots: Array, state: State, length: float, options: NewtonOptions, effort: Effort
) -> tuple[State, NDArray[np.int_], Slack]:
    """Solve all rows from `state`; returns the states, a status per row and the slack ropes of each group."""
    run = _Run(system, slots, state, length, options)
    for iteration in range(options.iterations):
        effort.add(len(run.active))
        run.iterate(iteration == 0)
        if not len(run.active):
            break
    return run.finish()


class _Run:
    """One run of Newton's method: results of all N rows, and what the rows that still move need."""

    def __init__(self, system: System, slots: Array, state: State, length: float, options: NewtonOptions) -> None:
        rows = len(state)
        self.system, self.length, self.options = system, length, options
        self.result: State | None = None  # states of rows that have left
        self.status = np.full(rows, RowStatus.NOT_CONVERGED)
        self.slack = tuple(np.zeros((rows, g.group.shape[0]), dtype=bool) for g in system.groups)
        self.tried = tuple(s.copy() for s in self.slack)  # ropes that were slack at some step
        self.ropes = system.loaded and any(g.group.rope.any() for g in system.groups)
        self.active, self.state, self.numbers = np.arange(rows), state, given(system, slots)
        self.scale = typical_stiffness(system, self.numbers)
        self.previous = np.full(rows, np.inf)  # size of the last step
        self.before = np.zeros(rows)  # size of the one before
        self.matrix: Array = np.zeros((rows, system.size**2))

    def iterate(self, first: bool) -> None:
        """One step of all active rows; those that arrive or get lost leave."""
        loose = tuple(s[self.active] for s in self.slack) if self.ropes else None
        now = balance(
            self.system,
            self.numbers,
            self.state,
            self.scale,
            curved=self.options.curved,
            slack=loose,
            matrix=self.matrix[: len(self.active)],
        )
        assert now.tangent is not None
        changed = self._update_slack(now.strains, first)
        step = -solve_rows(now.tangent, now.residual[..., None])[..., 0]
        size = step_size(self.system, step, self.length)
        finite = np.isfinite(size)
        step[~finite] = 0.0
        self.state = advance(self.system, self.state, step, self.scale)
        done = _accepted(size, self.previous, self.options.tolerance) & finite & ~changed
        grows = (size > self.options.contraction * self.previous) & (size > 1e-9) & ~changed
        grows &= size > self.options.rebound * self.before
        lost = (size > self.options.reach) | ~finite | (grows & (not first))
        self.status[self.active[done]] = RowStatus.SOLVED
        self.status[self.active[~finite]] = RowStatus.SINGULAR
        self.before = np.where(np.isfinite(self.previous), self.previous, 0.0)
        self.previous = np.where(changed, np.inf, size)
        self._dismiss(done | lost)

    def _dismiss(self, leaving: NDArray[np.bool_]) -> None:
        """Store the states of rows that leave and go on with the others."""
        if not leaving.any():
            return
        stay = np.nonzero(~leaving)[0]
        if self.result is None:
            self.result = self.state
        else:
            self.result.write(self.active[leaving], self.state.take(np.nonzero(leaving)[0]))
        self.active, self.previous, self.before = self.active[stay], self.previous[stay], self.before[stay]
        if len(stay):
            self.state, self.numbers = self.state.take(stay), self.numbers.take(stay)

    def _update_slack(self, strains: tuple[Array, ...], first: bool) -> NDArray[np.bool_]:
        """Ropes whose strain changed sign; returns the active rows in which the set of slack ropes changed.

        The state before the first step is no equilibrium: signs of its strains may be rounding, and let no rope go.
        """
        changed = np.zeros(len(self.active), dtype=bool)
        if not self.ropes:
            return changed
        for group, slack, tried, e in zip(self.system.groups, self.slack, self.tried, strains, strict=True):
            if group.group.rope.any():
                acting = group.group.rope & (group.elastic[:, 0] > 0)
                now = (e[..., 0] < 0) & acting
                changed |= (now != slack[self.active]).any(axis=1)
                if not first:
                    slack[self.active] = now
                    tried |= slack
        return changed

    def finish(self) -> tuple[State, NDArray[np.int_], Slack]:
        """States, status and slack ropes of all rows."""
        if self.result is None:
            self.result = self.state
        elif len(self.active):
            self.result.write(self.active, self.state)
        failed = self.status != RowStatus.SOLVED
        for ever, loose in zip(self.tried, self.slack, strict=True):
            loose[failed] = ever[failed]  # a row that swings between taut and slack says which ropes
            self.status[loose.any(axis=1) & ~failed] = RowStatus.SLACK
        return self.result, self.status, self.slack


def _accepted(size: Array, previous: Array, tolerance: float) -> NDArray[np.bool_]:
    """Error after a step of Newton: about size^3 / previous^2, as the steps shrink quadratically."""
    small = size <= tolerance
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = size / previous
        predicted = size * ratio**2
    return np.asarray(small | (np.isfinite(previous) & (ratio < 1e-2) & (predicted <= 0.1 * tolerance)))


Start = Array | Callable[[Index], Array]
"""Slots (1 or N, S) at which a path begins, or a function that gives them for some rows."""


def follow(
    system: System,
    start: Start,
    target: Array,
    state: State,
    length: float,
    options: NewtonOptions,
    effort: Effort,
) -> tuple[State, NDArray[np.int_], Slack]:
    """Move solved rows from slots `start` to slots `target`: in one go, and by halved steps where that fails.

    `state` solves the rows at `start`. A row that needs steps below 1/256 of the way keeps its failure.
    """
    placed = place_prescribed(system.layout, target, state, free=system.free)
    final, status, slack = newton(system, target, placed, length, options, effort)
    todo = np.nonzero((status != RowStatus.SOLVED) & (status != RowStatus.SLACK))[0]
    if not len(todo):
        return final, status, slack
    origin = start(todo) if callable(start) else slots_of(start, todo)
    path = _Path(system, origin, slots_of(target, todo), state.take(todo), len(todo))
    for _ in range(64):
        rows, part, now, loose = path.stride_on(length, options, effort)
        arrived = todo[rows]
        final, status[arrived] = final.put(arrived, part), now
        for mine, theirs in zip(slack, loose, strict=True):
            mine[arrived] = theirs
        if not len(path.todo):
            break
    return final, status, slack


class _Path:
    """Rows on their way from slots `origin` to `goal` (1 or K, S), each with a stride of its own."""

    def __init__(self, system: System, origin: Array, goal: Array, state: State, rows: int) -> None:
        self.system, self.origin, self.goal, self.state = system, origin, goal, state
        self.way, self.stride = np.zeros(rows), np.full(rows, 0.5)
        self.todo = np.arange(rows)

    def stride_on(
        self, length: float, options: NewtonOptions, effort: Effort
    ) -> tuple[Index, State, NDArray[np.int_], Slack]:
        """One stride of all rows under way; returns those that arrive, with their state, status and slack ropes."""
        todo, system = self.todo, self.system
        trial = np.minimum(self.way[todo] + self.stride[todo], 1.0)
        origin, goal = slots_of(self.origin, todo), slots_of(self.goal, todo)
        between = origin + trial[:, None] * (goal - origin)
        begin = place_prescribed(system.layout, between, self.state.take(todo), free=system.free)
        moved, now, loose = newton(system, between, begin, length, options, effort)
        good = (now == RowStatus.SOLVED) | (now == RowStatus.SLACK)
        self.state = self.state.put(todo[good], moved.take(np.nonzero(good)[0]))
        self.way[todo[good]] = trial[good]
        self.stride[todo] *= np.where(good, 2.0, 0.5)
        arrived = good & (trial >= 1.0)
        self.todo = todo[~arrived & (self.stride[todo] > 1 / 512)]
        mine = np.nonzero(arrived)[0]
        return todo[arrived], moved.take(mine), now[arrived], tuple(s[arrived] for s in loose)
