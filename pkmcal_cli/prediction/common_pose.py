"""The pose that all drives hold together, from several fixed starts: for rows that the substructure leads astray.

Redundancy is built in to remove singularities, so a regular pose may lie beyond singular ones of the non-redundant
substructure. Here no drive is called redundant: the misfit of all of them is made least (`model.freedoms`), first from
the reference configuration, then from poses all over the workspace, nearest first by what the drives read there. The
starts are the same for every row and table, so that a row's result depends on nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.freedoms import ClosedPoses, Freedoms, is_sole, smallest_singular_value
from pkmcal_cli.model.model import Model

_AT_ONCE, _TRIED = 4, 12  # starts of each row that are tried together, and as long as none leads to little misfit
_FEW = 16  # rows for which all starts are tried together
_SAME = 1e-4  # poses nearer than this, in sizes or rad, are one
_UNSURE = 0.2  # so are those nearer than this share of misfit over smallest singular value, where descents may end


@dataclass(frozen=True)
class CommonPose:
    """States (n) of least misfit; misfit (n,) in sizes of the machine; rival (n,): of the next best, or infinite.

    singular (n,): whether all drives together do not hold the platform there.
    """

    state: State
    misfit: Array
    rival: Array
    singular: NDArray[np.bool_]


def common_pose(model: Model, coefficients: Array) -> CommonPose:
    """Find the pose on which all drives agree best, for coefficients (n, S) with their commanded positions."""
    freedoms, starts, rows = model.freedoms, model.starts, len(coefficients)
    best = _descended(freedoms, coefficients, starts, np.zeros(rows, dtype=np.intp))
    rival = np.full(rows, np.inf)
    todo = np.nonzero(_in_doubt(best))[0]
    together = _AT_ONCE if len(todo) > _FEW else _TRIED  # of few rows the calls are the price, not the arithmetic
    for first in range(0, _TRIED, together):
        if not len(todo):
            break
        which = _nearest(freedoms, coefficients[todo], starts)[:, first : first + together]  # (m, k)
        closed = _descended(freedoms, np.repeat(coefficients[todo], which.shape[1], axis=0), starts, which.ravel())
        left = np.arange(len(todo))  # of them, those for which further starts count
        for k in range(which.shape[1]):
            if k % _AT_ONCE == 0:
                left = left[_in_doubt(best.take(todo[left]))]
            best = _better(best, rival, todo[left], closed.take(left * which.shape[1] + k))
        todo = todo[_in_doubt(best.take(todo))]
    return CommonPose(best.state, best.size, rival, best.singular)


def _in_doubt(poses: ClosedPoses) -> NDArray[np.bool_]:
    """Poses (n,) with so much misfit that another assembly may fit better."""
    return ~is_sole(poses.jacobian, poses.size)


def _better(best: ClosedPoses, rival: Array, rows: Index, candidates: ClosedPoses) -> ClosedPoses:
    """The better of the best poses and others found for some rows; `rival` (n,), of the next best, is set."""
    before = best.take(rows)
    least = np.minimum(candidates.size, before.size)
    unsure = _UNSURE * least / np.maximum(smallest_singular_value(before.jacobian), 1e-12)
    apart = np.abs(candidates.poses - before.poses).max(axis=1) > np.maximum(_SAME, unsure)
    better = candidates.size < before.size
    other = np.where(better, before.size, candidates.size)
    rival[rows] = np.where(apart, np.minimum(rival[rows], other), rival[rows])
    won = np.nonzero(better)[0]
    return best.put(rows[won], candidates.take(won))


def _descended(freedoms: Freedoms, coefficients: Array, starts: ClosedPoses, which: Index) -> ClosedPoses:
    """Poses of least misfit (n) from starts (n,) closed with the coefficients of the rows."""
    begin = freedoms.close(coefficients, starts.poses[which], starts.state.take(which))
    return freedoms.descend(coefficients, begin)


def _nearest(freedoms: Freedoms, coefficients: Array, starts: ClosedPoses) -> NDArray[np.intp]:
    """Numbers (n, K) of the starts, those first at which the drives are nearest to their commanded positions."""
    asked = (coefficients[:, freedoms.commanded] - freedoms.reference) / freedoms.size  # (n, D)
    away = starts.misfit - asked[:, None]  # (n, K, D)
    away -= np.where(np.isfinite(freedoms.period), freedoms.period, 0.0) * np.round(away / freedoms.period)
    far = (away**2).sum(axis=2)
    return np.argsort(np.where(starts.closed, far, np.inf), axis=1, kind="stable")
