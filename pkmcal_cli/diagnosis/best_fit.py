"""What a displacement without a name hides in the parameters beside it.

Parts of a shape that parameters imitate are not told from them; a fit leaves them near 0, so that the parameters are
those of best fit (Plumlee 2017), and what they may hide is an uncertainty of its own (Brynjarsdottir and O'Hagan 2014).
Which parts these are is judged under a measure that does not depend on where was measured: poses spread evenly over the
box of tool coordinates of the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.even_points import even_points
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.calibration.residual import linearise_at
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

_POSES = 200
_FEWEST = 0.25  # share of the poses that must be reached
_DISTINCT = 1.0  # chi-square over the table by which a unit weight is told from parameters; less is hidden in them
_FREE = 0.01  # chi-square of what parameters imitate of a unit weight, below which it moves nothing


@dataclass(frozen=True)
class BestFit:
    """Directions (d, K) of the weights that parameters could imitate, orthonormal, and what a unit of each would add to
    parameters `names` (p, d), SI."""

    names: tuple[str, ...]
    hidden: Array
    shifts: Array

    @property
    def confounded(self) -> Mapping[str, float]:
        """Standard uncertainty of each parameter, SI, by what the shape may hide in it."""
        return dict(zip(self.names, np.sqrt((self.shifts**2).sum(axis=1)).tolist(), strict=True))


def best_fit(problem: Problem, values: Array, parameters: tuple[str, ...], weights: tuple[str, ...]) -> BestFit:
    """What some parameters could imitate of a shape whose weights these are, at parameter values (P,), SI."""
    near = _evenly(problem, values, parameters, weights) or _linear(problem, values, parameters, weights)
    jacobian, shape = near
    ranges = 0.5 * problem.model.ranges[[problem.model.names.index(n) for n in parameters]]
    twice = np.full(len(parameters), 2.0)
    spectrum = directions(jacobian * ranges, parameters, twice, beside=problem.beside(parameters))
    moved = spectrum.vectors[~spectrum.held].T * ranges[:, None]  # (p, d)
    q, upper = np.linalg.qr(jacobian @ moved)
    imitated = q.T @ shape  # (d, K)
    left = shape - q @ imitated
    eigenvalues, vectors = np.linalg.eigh(left.T @ left)
    hidden = vectors[:, eigenvalues < _DISTINCT]
    hidden = hidden[:, ((imitated @ hidden) ** 2).sum(axis=0) > _FREE]
    return BestFit(parameters, hidden.T, -moved @ np.linalg.solve(upper, imitated @ hidden))


def _evenly(
    problem: Problem, values: Array, parameters: tuple[str, ...], weights: tuple[str, ...]
) -> tuple[Array, Array] | None:
    """Jacobians over poses all over the box of the table's tool coordinates, weighed as all rows of it; None where it
    cannot be filled."""
    model, poses = problem.model, problem.nominal_poses
    if not poses or not set(poses) <= set(DIRECTIONS):
        return None
    box = np.array([(x.min(), x.max()) for x in poses.values()])
    poses_of_box = np.full((_POSES, len(DIRECTIONS)), np.nan)
    share = even_points(_POSES, len(box))
    poses_of_box[:, [DIRECTIONS.index(c) for c in poses]] = box[:, 0] + share * (box[:, 1] - box[:, 0])
    reached = drive_positions(model, poses_of_box, held=tuple(poses)).readings
    reached = reached[np.isfinite(reached).all(axis=1)]
    low, high = np.nanmin(problem.rows.readings, axis=0), np.nanmax(problem.rows.readings, axis=0)
    margin = 0.02 * (high - low)
    reached = reached[((reached >= low - margin) & (reached <= high + margin)).all(axis=1)]
    if len(reached) < _FEWEST * _POSES:
        return None
    rows = Rows.at(reached)
    columns = {name: np.full(len(rows), np.nanmedian(column)) for name, column in problem.rows.columns.items()}
    rows = replace(rows, columns=columns)
    used = problem.measured.any(axis=0)
    there = design_problem(model, rows, np.tile(used, (len(rows), 1)))
    sigma = np.where(problem.measured, problem.sigma, np.nan)
    typical = np.where(used, np.nanmedian(np.where(used, sigma, 1.0), axis=0), np.nan)
    there = replace(there, sigma=np.tile(typical, (len(rows), 1)))
    jacobian, shape = _linear(there, values, parameters, weights)
    weight = np.sqrt(max(problem.count, 1) / max(there.count, 1))
    return jacobian * weight, shape * weight


def _linear(
    problem: Problem, values: Array, parameters: tuple[str, ...], weights: tuple[str, ...]
) -> tuple[Array, Array]:
    """Whitened Jacobians (n, p), (n, K)."""
    bare = replace(problem, prior=None)
    jacobian = linearise_at(bare, values, (*parameters, *weights), None).jacobian
    solved = np.isfinite(jacobian).all(axis=1)
    return jacobian[solved, : len(parameters)], jacobian[solved, len(parameters) :]
