"""How large errors of fitted and of held-out rows are by noise and by what ranges leave open, if nothing else is wrong.

In a linear model with readings A x + e, e of covariance 1, and offsets x of covariance P (half ranges, or what an
earlier calibration knows), errors of fitted readings have the covariance 1 - A (A^T A + P^-1)^-1 A^T, and those of a
fold g that the fit has not seen 1 + A_g (A^T A - A_g^T A_g + P^-1)^-1 A_g^T: more than 1 + p / n, since poses of a fold
lie beside the others, and p may be a large share of n.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import is_long
from pkmcal_cli.calibration.errors_before_after import kinds_of
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise, lost_rows
from pkmcal_cli.calibration.session_frames import Bases

_DETERMINED = 1e-6  # share of what a frame does that rows outside a fold must see for the frame to be known by them


def fitted_noise(problem: Problem, fit: Fit) -> dict[str, float]:
    """Mean square by kind of errors of fitted readings over that of their noise; none of a long table: it is 1."""
    if is_long(problem) or not fit.selected:
        return {}
    by_row, whole, bases = _information(problem, fit)
    flat = by_row.reshape(-1, by_row.shape[2])
    taken = (flat * np.linalg.solve(whole, flat.T).T).sum(axis=1).reshape(by_row.shape[:2])
    for rows, basis in bases:
        taken[rows] += (basis**2).sum(axis=1).reshape(len(rows), -1)
    return _of_kinds([problem], [-taken])


def held_out_noise(problem: Problem, fit: Fit, labels: NDArray[np.intp]) -> dict[str, float]:
    """The same of errors of readings that were held out; labels (N,): folds."""
    if is_long(problem) or not fit.selected:
        return {}
    by_row, whole, bases = _information(problem, fit)
    more = np.zeros(by_row.shape[:2])
    for fold in np.unique(labels):
        inside = labels == fold
        flat = by_row[inside].reshape(-1, by_row.shape[2])
        frames, moved = _of_frames(bases, inside, flat)
        spread = np.linalg.solve(whole - flat.T @ moved, moved.T).T
        more[inside] = (frames + (moved * spread).sum(axis=1)).reshape(-1, by_row.shape[1])
    return _of_kinds([problem], [more])


def _of_frames(bases: Bases, inside: NDArray[np.bool_], flat: Array) -> tuple[Array, Array]:
    """What eliminated frames add to the variance (n,) of held-out readings, and to their derivatives (n, p).

    Of what frames do in all rows of a session, U, the held-out rows have U_g: known by the others to
    (1 - U_g^T U_g)^-1. What these do not determine is fitted to the held-out rows, which takes noise from them.
    """
    width = len(flat) // max(int(inside.sum()), 1)
    place = np.cumsum(inside) - 1
    more, moved = np.zeros(len(flat)), flat.copy()
    for rows, basis in bases:
        if not (here := inside[rows]).any():
            continue
        at = (place[rows[here], None] * width + np.arange(width)).ravel()
        u = basis.reshape(len(rows), width, -1)[here].reshape(len(at), -1)  # (m C, r)
        left, way = np.linalg.eigh(np.eye(u.shape[1]) - u.T @ u)
        determined = left > _DETERMINED
        known, unknown = u @ way[:, determined], u @ way[:, ~determined]
        gain = known / left[determined]
        more[at] = (gain * known).sum(axis=1) - (unknown**2).sum(axis=1)
        moved[at] += gain @ (known.T @ flat[at])
    return more, moved


def reported_noise(parts: Sequence[tuple[Problem, Fit, Problem]]) -> dict[str, float]:
    """The same of rows that no fit has seen; parts: fitted rows, their fit, rows that report; of one model."""
    if any(is_long(fitted) or not fit.selected for fitted, fit, _ in parts):
        return {}
    predicted, more = list[Problem](), list[Array]()
    for fitted, fit, report in parts:
        _, whole, _ = _information(fitted, fit)
        there = evaluate(report, fit.values, fit.selected)
        predicted.append(report.without(lost_rows(report, there)))
        near = linearise(predicted[-1], there).jacobian[: report.readings.size]
        flat = near * _half_ranges(fitted, fit)
        more.append((flat * np.linalg.solve(whole, flat.T).T).sum(axis=1).reshape(report.readings.shape))
    return _of_kinds(predicted, more)


def _half_ranges(problem: Problem, fit: Fit) -> Array:
    """Half ranges (p,), SI, of what was fitted."""
    return np.asarray(0.5 * problem.model.ranges[[problem.model.names.index(n) for n in fit.selected]])


def _information(problem: Problem, fit: Fit) -> tuple[Array, Array, Bases]:
    """Whitened derivatives of the readings (N, C, p) by parameters in half ranges; A^T A + P^-1 (p, p); what eliminated
    frames do."""
    near = linearise(problem, fit.last)
    jacobian = near.jacobian * _half_ranges(problem, fit)
    count, width = problem.readings.shape
    whole = jacobian.T @ jacobian  # with what is known besides the readings
    if problem.prior is None:
        whole += np.eye(len(fit.selected))
    bases = () if near.frames is None else near.frames.bases
    return jacobian[: count * width].reshape(count, width, -1), whole, bases


def _of_kinds(problems: Sequence[Problem], more: Sequence[Array]) -> dict[str, float]:
    """1 and what fits add (N, C), of each table, to the variance: on average of the readings of each kind."""
    measured, sigma = (np.concatenate([getattr(p, of) for p in problems]) for of in ("measured", "sigma"))
    weight = np.where(measured, np.nan_to_num(sigma) ** 2, 0.0)
    added, out = weight * np.concatenate(more), {}
    for kind, columns in kinds_of(problems[0].model).items():
        whole = float(weight[:, columns].sum())
        out[kind] = 1.0 + (float(added[:, columns].sum()) / whole if whole > 0 else 0.0)
    return out
