"""Newton's method K du = -g for all rows at once, with a contraction test, and path following for rows that fail it.

A step that is longer than a share of the one before (Deuflhard 2004, theta < 1/2) may lead to another branch of the
equilibrium; such rows go from solved coefficients to their own by halved steps, so that they stay on the branch that
the machine is on.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.kinematics import State, advance, place_prescribed
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.strains import turned_over_rows
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers, system_numbers
from pkmcal_cli.equilibrium.tangent import Tangent
from pkmcal_cli.mechanism.topology import Index

_ALWAYS_SMALL = 1e-9  # steps below this size lead nowhere else
_DIVERGED = 1e3  # a step of so many sizes of the machine, or rad, comes from a matrix without meaning
_LUCKY = 3e-4  # a step that is shorter than this share of the last one says nothing of the next
_UNDER_WAY = 1e-2  # accepted of a state from which another is begun, relative to the machine's size or in rad
_STRIDES = 128  # of a row on its way, at most
_TURNING = 0.01  # sizes of the machine, or rad: steps below turn nothing over
_ROUNDING = 1e-13  # a step this small, relative to the machine's size or in rad, is rounding


@dataclass(frozen=True, kw_only=True)
class NewtonOptions:
    """`contraction`: a step longer than this times the last one means another branch (Deuflhard's test).

    `rebound`: unless it is below this share of the one before. Turning a beam by a tangent step stretches it to second
    order, and taking that back turns it again: of three steps the third may well exceed the second.
    `reach`: a step longer than this, in sizes of the machine or rad, leads elsewhere.
    `taut`: ropes push too in the first step: where a start is no equilibrium, signs of stresses may be rounding.
    """

    curved: bool = True  # full tangent with the stress term; False: Gauss-Newton on the strains
    contraction: float = 0.5
    rebound: float = 0.0
    reach: float = _DIVERGED
    taut: bool = False
    iterations: int = 30
    tolerance: float = _ROUNDING  # accepted error after the last step, relative to the machine's size


@dataclass
class Effort:
    """How many elastic steps (assembly and solve of one row) were spent.

    sparing: rows of which one is lost are of no use, so that none is spent on the others.
    """

    steps: int = 0
    per_round: list[int] = field(default_factory=list)
    sparing: bool = False

    def add(self, rows: int) -> None:
        """Count one step of `rows` rows."""
        self.steps += rows
        self.per_round.append(rows)


def coefficients_of(coefficients: Array, rows: Index) -> Array:
    """Take the coefficients of some rows from an array (1 or N, S)."""
    return coefficients if len(coefficients) == 1 else coefficients[rows]


def unit_sizes(system: System, length: float) -> Array:
    """Give the size of each unknown (n,): `length` for translations, 1 rad for rotations."""
    return np.where(system.free < len(system.topology.translation_coefficients), length, 1.0)


def newton(
    system: System,
    coefficients: Array | SystemNumbers,
    state: State,
    length: float,
    options: NewtonOptions,
    effort: Effort,
) -> tuple[State, NDArray[np.int_]]:
    """Solve all rows from `state`; returns the states and a status per row."""
    run = _Run(system, coefficients, state, length, options)
    with np.errstate(divide="ignore", invalid="ignore"):
        for iteration in range(options.iterations):
            effort.add(len(run.active))
            run.iterate(iteration == 0)
            if not len(run.active):
                break
    return run.finish()


class _Run:
    """One run of Newton's method: results of all N rows, and what the rows that still move need."""

    def __init__(
        self,
        system: System,
        coefficients: Array | SystemNumbers,
        state: State,
        length: float,
        options: NewtonOptions,
    ) -> None:
        rows = len(state)
        self.system, self.length, self.options = system, length, options
        self.result: State | None = None  # states of rows that have left
        self.status = np.full(rows, RowStatus.NOT_CONVERGED)
        self.ropes = [k for k, group in enumerate(system.groups) if group.ropes is not None]
        self.carrying = np.ones((rows, sum(system.groups[k].group.shape[0] for k in self.ropes)), dtype=bool)
        self.active, self.state, self.numbers = np.arange(rows), state, system_numbers(system, coefficients)
        self.scale = typical_stiffness(system, self.numbers)
        self.per_unit = 1.0 / unit_sizes(system, length)
        self.previous = np.full(rows, np.inf)  # size of the last step
        self.before = np.zeros(rows)  # size of the one before
        self.longest = np.zeros(rows)  # of all steps
        self.entries: Array = np.zeros((rows, system.maps.width))

    def iterate(self, first: bool) -> None:
        """One step of all active rows; those that arrive or get lost leave."""
        balanced = balance(
            self.system,
            self.numbers,
            self.state,
            self.scale,
            curved=self.options.curved,
            taut=self.options.taut and first,
            entries=self.entries[: len(self.active)],
        )
        assert balanced.tangent is not None
        step = -balanced.tangent.solve(balanced.residual[..., None])[..., 0]
        size = (np.abs(step[:, : self.system.unknowns]) * self.per_unit).max(axis=1, initial=0.0)
        lost = size > self.options.reach
        if not math.isfinite(size.max(initial=0.0)):
            without = ~np.isfinite(size)
            step[without], lost = 0.0, lost | without
            self.status[self.active[without]] = RowStatus.SINGULAR
        self.state = advance(self.system, self.state, step, self.scale)
        self.longest = np.maximum(self.longest, size)
        ratio = size / self.previous
        done, grows = _accepted(size, ratio, self.options.tolerance), self._grows(size, ratio)
        self.previous = size
        if self.ropes:
            changed = self._ropes_change(balanced.stresses)
            done &= ~changed
            grows &= ~changed
            self.previous = np.where(changed, np.inf, size)
        self._arrive(done, balanced.tangent)
        self._dismiss(done | lost if first else done | lost | grows)

    def _grows(self, size: Array, ratio: Array) -> NDArray[np.bool_]:
        """Rows (n,) whose steps shrink too slowly, by their ratio to those before."""
        grows = (ratio > self.options.contraction) & (size > _ALWAYS_SMALL)
        if self.options.rebound > 0:
            grows &= size > self.options.rebound * self.before
            self.before = np.where(np.isfinite(self.previous), self.previous, 0.0)
        return np.asarray(grows)

    def _arrive(self, done: NDArray[np.bool_], tangent: Tangent) -> None:
        """Note which rows have arrived, and whether at a saddle."""
        rows = done.nonzero()[0]
        if len(rows):
            self.status[self.active[rows]] = RowStatus.SOLVED
            if self.options.curved:
                saddle = rows[~tangent.stable(rows)]
                self.status[self.active[saddle]] = RowStatus.UNSTABLE
            far = rows[self.longest[rows] > _TURNING]
            if len(far):
                over = turned_over_rows(self.system, self.numbers.take(far), self.state.take(far))
                self.status[self.active[far[over]]] = RowStatus.NOT_CONVERGED

    def _dismiss(self, leaving: NDArray[np.bool_]) -> None:
        """Store the states of rows that leave and go on with the others."""
        gone = leaving.nonzero()[0]
        if not len(gone):
            return
        if self.result is None:
            self.result = self.state
        else:
            self.result.write(self.active[gone], self.state if len(gone) == len(leaving) else self.state.take(gone))
        stay = (~leaving).nonzero()[0]
        self.active = self.active[stay]
        if len(stay):
            self.previous, self.before = self.previous[stay], self.before[stay]
            self.longest = self.longest[stay]
            self.state, self.numbers = self.state.take(stay), self.numbers.take(stay)

    def _ropes_change(self, stresses: tuple[Array, ...]) -> NDArray[np.bool_]:
        """Active rows (n,) in which other ropes carry than at the step before."""
        carrying = np.concatenate([stresses[k][..., 0] > 0 for k in self.ropes], axis=1)
        changed = (carrying != self.carrying[self.active]).any(axis=1)
        self.carrying[self.active] = carrying
        return np.asarray(changed)

    def finish(self) -> tuple[State, NDArray[np.int_]]:
        """States and status of all rows."""
        if self.result is None:
            self.result = self.state
        elif len(self.active):
            self.result.write(self.active, self.state)
        return self.result, self.status


def _accepted(size: Array, ratio: Array, tolerance: float) -> NDArray[np.bool_]:
    """Error after a step of Newton: about size * ratio^2, as steps shrink quadratically (by luck, more).

    ratio (n,): of the step's size to that before; 0 where there was none.
    """
    accepted = (size * np.maximum(ratio, _LUCKY) ** 2 <= 0.1 * tolerance) & (ratio < 1e-2) & (ratio > 0)
    return np.asarray(accepted | (size <= tolerance))


Start = Array | Callable[[Index], Array]
"""Coefficients (1 or N, S) at which a path begins, or a function that gives them for some rows."""


def follow(
    system: System,
    start: Start,
    target: Array,
    state: State,
    length: float,
    options: NewtonOptions,
    effort: Effort,
    numbers: SystemNumbers | None = None,
) -> tuple[State, NDArray[np.int_]]:
    """Move solved rows from coefficients `start` to `target`: in one go, and by halved steps where that fails.

    `state` solves the rows at `start`; numbers: what `target` says, where that is known. A row that needs steps below
    1/256 of the way, or more than 128 of them, keeps its failure; with a sparing effort so do those under way then.
    """
    placed = place_prescribed(system.topology, target, state, free=system.free)
    final, status = newton(system, target if numbers is None else numbers, placed, length, options, effort)
    todo = np.nonzero(status != RowStatus.SOLVED)[0]
    if not len(todo):
        return final, status
    origin = start(todo) if callable(start) else coefficients_of(start, todo)
    path = _Path(system, origin, coefficients_of(target, todo), state.take(todo), len(todo))
    while len(path.todo) and not (effort.sparing and path.lost):
        rows, part = path.stride_on(length, options, effort)
        arrived = todo[rows]
        final, status[arrived] = final.put(arrived, part), RowStatus.SOLVED
    return final, status


class _Path:
    """Rows on their way from coefficients `origin` to `goal` (1 or K, S), each with a stride of its own."""

    def __init__(self, system: System, origin: Array, goal: Array, state: State, rows: int) -> None:
        self.system, self.origin, self.goal, self.state = system, origin, goal, state
        self.way, self.stride, self.strides = np.zeros(rows), np.full(rows, 0.5), np.zeros(rows, dtype=int)
        self.open, self.todo = np.ones(rows, dtype=bool), np.arange(rows)  # rows under way, and their numbers
        self.lost = False  # whether a row was given up

    def stride_on(self, length: float, options: NewtonOptions, effort: Effort) -> tuple[Index, State]:
        """One stride; returns the rows that arrive, with their state.

        Rows take their last stride together, when no other is under way: until then they need not be as accurate, but
        where the state tells whether they are stable.
        """
        todo, system = self.todo, self.system
        trial = np.minimum(self.way[todo] + self.stride[todo], 1.0)
        under_way = (trial < 1.0).nonzero()[0]
        if len(under_way):
            todo, trial = todo[under_way], trial[under_way]
            options = options if options.curved else replace(options, tolerance=max(options.tolerance, _UNDER_WAY))
        origin, goal = coefficients_of(self.origin, todo), coefficients_of(self.goal, todo)
        between = origin + trial[:, None] * (goal - origin)
        begin = place_prescribed(system.topology, between, self.state.take(todo), free=system.free)
        moved, status = newton(system, between, begin, length, options, effort)
        good = status == RowStatus.SOLVED
        self.state = self.state.put(todo[good], moved.take(np.nonzero(good)[0]))
        self.way[todo[good]] = trial[good]
        self.stride[todo] *= np.where(good, 2.0, 0.5)
        self.strides[todo] += 1
        arrived = good & (trial >= 1.0)
        abandoned = (self.stride[todo] <= 1 / 512) | (self.strides[todo] >= _STRIDES)  # others wait for it
        self.open[todo[arrived | abandoned]] = False
        self.todo, self.lost = self.open.nonzero()[0], self.lost or bool((abandoned & ~arrived).any())
        return todo[arrived], moved.take(np.nonzero(arrived)[0])
