"""Newton's method for all rows at once, with a contraction test, and path following for rows that fail it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..layout import Index
from ..rotation import Array
from .assembly import balance, typical_stiffness
from .given import given
from .kinematics import State, advance, place_prescribed
from .status import RowStatus
from .system import System

_DIVERGED = 1e3  # a step of so many sizes of the machine, or rad, comes from a matrix without meaning
_ROUNDING = 1e-13  # a step this small, relative to the machine's size or in rad, is rounding


@dataclass(frozen=True)
class NewtonOptions:
    """`contraction`: a step longer than this times the last one means another branch (Deuflhard's test)."""

    curved: bool = True  # full tangent with the stress term; False: Gauss-Newton on the strains
    contraction: float = 0.5
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
    scaled = np.abs(step[:, : system.unknowns])
    scaled[:, system.free < len(system.layout.travel_slots)] /= length
    return np.asarray(scaled.max(axis=1, initial=0.0))


def newton(
    system: System, slots: Array, state: State, length: float, options: NewtonOptions, effort: Effort
) -> tuple[State, NDArray[np.int_], Slack]:
    """Solve all rows from `state`; returns the states, a status per row and the slack ropes of each group."""
    rows = len(state)
    status = np.full(rows, RowStatus.NOT_CONVERGED)
    scale = typical_stiffness(system, slots)
    slack = tuple(np.zeros((rows, g.group.shape[0]), dtype=bool) for g in system.groups)
    tried = tuple(s.copy() for s in slack)  # ropes that were slack at some step
    previous = np.full(rows, np.inf)
    active, numbers = np.arange(rows), given(system, slots)
    for iteration in range(options.iterations):
        part = state.take(active) if len(active) < rows else state
        loose = tuple(s[active] for s in slack)
        mine = numbers.take(active) if len(active) < rows else numbers
        now = balance(system, mine, part, scale, curved=options.curved, slack=loose)
        assert now.tangent is not None
        changed = _update_slack(system, slack, active, now.strains)
        for ever, loose_now in zip(tried, slack, strict=True):
            ever |= loose_now
        step = -solve_rows(now.tangent, now.residual[..., None])[..., 0]
        effort.add(len(active))
        size = step_size(system, step, length)
        finite = np.isfinite(size)
        step[~finite] = 0.0
        moved = advance(system, part, step, scale)
        state = moved if len(active) == rows else state.put(active, moved)
        done = _accepted(size, previous[active], options.tolerance) & finite & ~changed
        lost = (
            (size > _DIVERGED)
            | ~finite
            | ((size > options.contraction * previous[active]) & (size > 1e-9) & ~changed & (iteration > 0))
        )
        status[active[done]] = RowStatus.SOLVED
        status[active[~finite]] = RowStatus.SINGULAR
        previous[active] = np.where(changed, np.inf, size)
        active = active[~done & ~lost]
        if not len(active):
            break
    failed = status != RowStatus.SOLVED
    for ever, loose_now in zip(tried, slack, strict=True):
        loose_now[failed] = ever[failed]  # a row that swings between taut and slack says which ropes
        status[loose_now.any(axis=1) & ~failed] = RowStatus.SLACK
    return state, status, slack


def _accepted(size: Array, previous: Array, tolerance: float) -> NDArray[np.bool_]:
    """Error after a step of Newton: about size^3 / previous^2, as the steps shrink quadratically."""
    small = size <= tolerance
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = size / previous
        predicted = size * ratio**2
    return np.asarray(small | (np.isfinite(previous) & (ratio < 1e-2) & (predicted <= 0.1 * tolerance)))


def _update_slack(system: System, slack: Slack, active: Index, strains: tuple[Array, ...]) -> NDArray[np.bool_]:
    """Ropes whose strain changed sign; returns the rows in which the active set changed."""
    changed = np.zeros(len(active), dtype=bool)
    for index, group in enumerate(system.groups):
        if system.loaded and group.group.rope.any():
            acting = group.group.rope & (group.elastic[:, 0] > 0)
            now = (strains[index][..., 0] < 0) & acting
            changed |= (now != slack[index][active]).any(axis=1)
            slack[index][active] = now
    return changed


def follow(
    system: System,
    start: Array,
    target: Array,
    state: State,
    length: float,
    options: NewtonOptions,
    effort: Effort,
) -> tuple[State, NDArray[np.int_], Slack]:
    """Move solved rows from slots `start` to slots `target`: in one go, and by halved steps where that fails.

    `state` solves the rows at `start`. A row that needs steps below 1/256 of the way keeps its failure.
    """
    rows = len(state)
    first, status, slack = newton(
        system,
        target,
        place_prescribed(system.layout, target, state, free=system.free),
        length,
        options,
        effort,
    )
    todo = np.nonzero((status != RowStatus.SOLVED) & (status != RowStatus.SLACK))[0]
    if not len(todo):
        return first, status, slack
    way, stride, best = np.zeros(rows), np.full(rows, 0.5), state
    final = first
    for _ in range(64):
        trial = np.minimum(way[todo] + stride[todo], 1.0)
        origin, end = slots_of(start, todo), slots_of(target, todo)
        between = origin + trial[:, None] * (end - origin)
        begin = place_prescribed(system.layout, between, best.take(todo), free=system.free)
        moved, now, loose = newton(system, between, begin, length, options, effort)
        good = (now == RowStatus.SOLVED) | (now == RowStatus.SLACK)
        best = best.put(todo[good], moved.take(np.nonzero(good)[0]))
        way[todo[good]] = trial[good]
        stride[todo] = np.where(good, 2 * stride[todo], 0.5 * stride[todo])
        arrived = good & (trial >= 1.0)
        final = final.put(todo[arrived], moved.take(np.nonzero(arrived)[0]))
        status[todo[arrived]] = now[arrived]
        for mine, theirs in zip(slack, loose, strict=True):
            mine[todo[arrived]] = theirs[arrived]
        todo = todo[~arrived & (stride[todo] > 1 / 512)]
        if not len(todo):
            break
    return final, status, slack
