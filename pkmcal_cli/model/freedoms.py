"""The mechanism with its drives released: where all drives are at a pose, and the pose on which they agree best.

The pose that drives ask for is min over p of sum ((q_k(p) - r_k) / size)^2: q(p) are the positions of all drives where
the TCP has the coordinates p, r the commanded ones. The path to it runs in p, so that the mechanism closes at every
step and redundant drives never fight each other on the way (Levenberg-Marquardt, steps bounded in sizes of the
machine).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.even_points import even_points
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import State, place_prescribed, without_stress
from pkmcal_cli.equilibrium.newton import Effort, NewtonOptions, newton
from pkmcal_cli.equilibrium.released_drives import released_readings
from pkmcal_cli.equilibrium.stability import definite
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers, system_numbers
from pkmcal_cli.equilibrium.tangent import solve_rows
from pkmcal_cli.mechanism.topology import Index

_STEP = 0.15  # largest step, in sizes of the machine or rad
_ITERATIONS = 40
_STANDSTILL = 1e-6  # a step this small is the last: Newton's method begins at these poses, nothing ends there
_GAINED = 1e-3  # so is one that lowers the misfit by less than this share
_CLOSE = 1e-6  # a misfit this small is none, in sizes of the machine
_DAMPING, _GIVE_UP = 1e-3, 1e2
_SPREAD = (0.25, 0.5)  # of starts about the reference configuration: sizes of the machine, rad
_STARTS = 32
_PATH = 8  # steps from the reference configuration to a start
_FOLD = 0.1  # misfit over s^2: 0.7 and more where the worse of two assemblies was found, at curvatures of about 1
_CLOSING = NewtonOptions(curved=False, tolerance=1e-9)


REGULAR = 1e-2  # smallest singular value of the drives' Jacobian, lengths in sizes of the machine
LEAST_MISFIT = 1e-3  # in sizes of the machine: less is no doubt at a pose far from singular ones,
NO_MISFIT = _FOLD * REGULAR**2  # and less than this at no regular pose


@dataclass(frozen=True)
class ClosedPoses:
    """Poses p (n, f) at which the mechanism is closed, in sizes and rad; n rows.

    misfit (n, D): position less commanded position of each drive, in sizes or rad; jacobian (n, D, f): its derivative;
    closed (n,): whether the mechanism closes there.
    """

    poses: Array
    state: State
    misfit: Array
    jacobian: Array
    closed: NDArray[np.bool_]

    @property
    def size(self) -> Array:
        """Misfit of all drives together (n,); infinite where the mechanism does not close."""
        return np.where(self.closed, np.sqrt((self.misfit**2).sum(axis=1)), np.inf)

    @property
    def singular(self) -> NDArray[np.bool_]:
        """Poses (n,) at which all drives together do not hold the platform."""
        return smallest_singular_value(self.jacobian) < REGULAR

    def take(self, rows: Index) -> ClosedPoses:
        """Some rows."""
        parts = (self.misfit, self.jacobian, self.closed)
        return ClosedPoses(self.poses[rows], self.state.take(rows), *(x[rows] for x in parts))

    def put(self, rows: Index, other: ClosedPoses) -> ClosedPoses:
        """These with some rows taken from `other`."""
        out = []
        for x, y in zip(self._arrays(), other._arrays(), strict=True):
            x = x.copy()
            x[rows] = y
            out.append(x)
        return ClosedPoses(out[0], self.state.put(rows, other.state), *out[1:])

    def _arrays(self) -> tuple[Array, ...]:
        return self.poses, self.misfit, self.jacobian, self.closed


@dataclass(frozen=True, kw_only=True)
class Freedoms:
    """A mechanism whose drives are released and whose TCP is held at its f independent coordinates.

    Drives of what the TCP does not show hold their commanded positions, and are not among the D.
    """

    system: System
    length: float  # size of the machine, m
    held: Index  # (f,) coefficients of the TCP's coordinates
    unit: Array  # (f,) size of the machine, or 1 rad
    drives: Index  # (D,) those that hold a position
    coordinates: tuple[str, ...]  # (f,)
    gains: Index  # (D,) coefficients of their gains
    size: Array  # (D,) size of the machine, or 1 rad
    period: Array  # (D,) 2 pi where a whole turn changes nothing, else infinite
    home: Array  # (f,) the TCP's coordinates in the reference configuration, in sizes or rad
    commanded: Index  # (D,) coefficients of the drives' commanded positions
    reference: Array  # (D,) these in the reference configuration

    def close(self, coefficients: Array, poses: Array, state: State) -> ClosedPoses:
        """The mechanism at poses (n, f), from states nearby; coefficients (n, S)."""
        c, moved, closed = self._closed(coefficients, poses, state)
        misfit, slopes = self._misfit(c, moved, system_numbers(self.system, c))
        closed &= np.isfinite(misfit).all(axis=1)
        return ClosedPoses(poses, moved, misfit, slopes[:, :, self.held] * self.unit, closed)

    def _closed(self, coefficients: Array, poses: Array, state: State) -> tuple[Array, State, NDArray[np.bool_]]:
        """Coefficients (n, S) and states of the mechanism at poses (n, f), and where it closes."""
        c = coefficients.copy()
        c[:, self.held] = poses * self.unit
        state = without_stress(state, self.system)
        begin = place_prescribed(self.system.topology, c, state, free=self.system.free)
        moved, status = newton(self.system, c, begin, self.length, _CLOSING, Effort())
        return c, moved, np.asarray(status == RowStatus.SOLVED)

    def _misfit(self, coefficients: Array, state: State, numbers: SystemNumbers) -> tuple[Array, Array]:
        """Misfit (n, D) of closed states, and its derivative by all coefficients (n, D, S)."""
        values, slopes = released_readings(self.system, coefficients, state, numbers, self.drives, self.gains)
        per_size = coefficients[:, self.gains] / self.size  # commanded positions are the zeros of these readings
        misfit = values * per_size
        misfit -= np.where(np.isfinite(self.period), self.period, 0.0) * np.round(misfit / self.period)
        return misfit, slopes * per_size[:, :, None]

    def expected_misfit(self, coefficients: Array, state: State, by_parameter: Array, sigma: Array) -> float:
        """What ranges and noise explain of the misfit, two standard uncertainties, in sizes of the machine.

        At one closed state; by_parameter (S, P): coefficients by parameters, times the ranges; sigma (D,): standard
        uncertainty of the drives' positions, in sizes or rad. Only what no pose takes up is misfit.
        """
        _, slopes = self._misfit(coefficients, state, system_numbers(self.system, coefficients))
        jacobian = slopes[0][:, self.held] * self.unit
        moved = np.concatenate([slopes[0] @ by_parameter, np.diag(2 * sigma)], axis=1)  # (D, P + D)
        left = moved - jacobian @ np.linalg.lstsq(jacobian, moved, rcond=None)[0]
        return float(np.sqrt((left**2).sum()))

    def descend(self, coefficients: Array, begin: ClosedPoses) -> ClosedPoses:
        """Poses of least misfit, from poses at which the mechanism closes."""
        best, damping = begin, np.full(len(begin.poses), _DAMPING)
        active = np.nonzero(best.closed)[0]
        for _ in range(_ITERATIONS):
            if not len(active):
                break
            step = _step(best.take(active), damping[active])
            trial = self.close(coefficients[active], best.poses[active] + step, best.state.take(active))
            better = trial.size < best.size[active]
            won, before = np.nonzero(better)[0], best.size[active]
            best = best.put(active[won], trial.take(won))
            damping[active] *= np.where(better, 0.1, 10.0)
            gained = better & (trial.size > (1 - _GAINED) * before)
            still = (
                gained
                | (best.size[active] < _CLOSE)
                | (np.abs(step).max(axis=1) < _STANDSTILL)
                | (damping[active] > _GIVE_UP)
            )
            active = active[~still]
        return best

    def spread(self, coefficients: Array, state: State) -> ClosedPoses:
        """Poses about the reference configuration (the first one), reached from it (1 row each)."""
        width = len(self.home)
        way = np.where(self.unit == self.length, *_SPREAD)
        return self.reached(coefficients, state, self.home + (2 * even_points(_STARTS, width) - 1) * way)

    def reached(self, coefficients: Array, state: State, poses: Array) -> ClosedPoses:
        """The reference configuration and poses (n, f), reached in small steps from it (1 row each)."""
        ends = np.concatenate([self.home[None], poses])
        c, state = np.repeat(coefficients, len(ends), axis=0), state.take(np.zeros(len(ends), dtype=np.intp))
        closed = np.ones(len(ends), dtype=bool)
        for share in np.arange(1, _PATH) / _PATH:
            _, state, there = self._closed(c, self.home + share * (ends - self.home), state)
            closed &= there
        last = self.close(c, ends, state)
        return replace(last, closed=last.closed & closed)


def smallest_singular_value(jacobian: Array) -> Array:
    """Of each Jacobian (n, D, f), (n,)."""
    slopes = np.nan_to_num(jacobian)
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(np.swapaxes(slopes, 1, 2) @ slopes)[:, 0], 0.0)))


def is_sole(jacobian: Array, misfit: Array) -> NDArray[np.bool_]:
    """Tell where (n,) no other assembly is near a pose with this misfit (n,), in sizes, and Jacobian (n, D, f).

    Two assemblies lie on either side of a singular pose, about s apart (s: smallest singular value), and the worse one
    keeps a misfit of the order of s^2: the less regular a pose is, the less misfit tells it from the right one. s^2 is
    more than a bound where J^T J less the bound is positive definite, which is seen for less than s itself.
    """
    out = np.asarray(misfit <= NO_MISFIT)
    todo = np.nonzero(~out & (misfit <= LEAST_MISFIT))[0]
    if not len(todo):
        return out
    slopes = jacobian[todo]
    normal = np.swapaxes(slopes, 1, 2) @ slopes
    squares = np.einsum("nkk->nk", normal)  # a view: of the columns; not finite where the Jacobian is not
    squares -= misfit[todo, None] / _FOLD
    known = np.nonzero(np.isfinite(squares).all(axis=1))[0]
    out[todo[known]] = definite(normal[known], np.empty((len(known), 0, normal.shape[1])))
    return out


def _step(closed: ClosedPoses, damping: Array) -> Array:
    """Bounded steps (n, f) of Levenberg and Marquardt."""
    normal = np.einsum("nak,nal->nkl", closed.jacobian, closed.jacobian)
    gradient = np.einsum("nak,na->nk", closed.jacobian, closed.misfit)
    largest = np.einsum("nkk->nk", normal).max(axis=1)
    damped = normal + (damping * largest)[:, None, None] * np.eye(normal.shape[1])
    step = -solve_rows(damped, gradient[..., None])[..., 0]
    step = np.nan_to_num(step)
    return np.asarray(step * np.minimum(1.0, _STEP / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None])
