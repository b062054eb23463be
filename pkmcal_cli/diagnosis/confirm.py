"""Blocked cross-validation of accepted effects, linearised at the solution: do they help rows they have not seen?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import point_squares
from pkmcal_cli.calibration.holdout import replicate_groups
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise, predicted_part
from pkmcal_cli.diagnosis.groups import pose_axes
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.scoring import Search, nulled
from pkmcal_cli.diagnosis.shown_kind import shown_kind
from pkmcal_cli.effects import catalogue

FOLDS = 6
_CELLS = 4
_CHANCE, _WORSE = 2.0, 1.1  # standard errors; times the error without an effect
_FEW = 40  # rows below which each pose is held out by itself
_EDGE = 1e-6  # of a cell: a pose on the edge of two is in the upper one, whatever its rounding


@dataclass(frozen=True)
class HeldOutGain:
    """Root mean square (m or rad, of the shown kind's points or readings) on rows held out by blocks, with all effects
    and without one.

    `gain` and its standard error over blocks: mean squares, whitened; `scheme` in words.
    """

    with_it: float
    without: float
    gain: float
    error: float
    scheme: str

    @property
    def confirmed(self) -> bool:
        """Whether the gain is more than its standard error."""
        return self.gain > self.error

    @property
    def contradicts(self) -> bool:
        """Whether rows that were not used to fit are predicted worse: then the effect is no cause."""
        return not self.gain > 0.0

    @property
    def harms(self) -> bool:
        """Whether they are predicted worse by more than chance: where parameters can stand for the effect."""
        return self.gain < -_CHANCE * self.error or self.with_it > _WORSE * self.without


def held_out_gain(search: Search, hypothesis: Hypothesis) -> HeldOutGain:
    """What one accepted effect gains on rows that were not used to fit.

    Without it the problem is linearised where it is null: what acts through it, as a stiffness through a load, is then
    no substitute.
    """
    of = (search.problem, search.fit, search.candidates, search.accepted, search.shapes)
    return search.known.once(of, ("held out", hypothesis), lambda: _held_out_gain(search, hypothesis))


def _held_out_gain(search: Search, hypothesis: Hypothesis) -> HeldOutGain:
    labels, scheme = blocks(search.problem, hypothesis)
    raw_with, white_with, on = _held_out(search, search.fit.values, search.selected, labels)
    raw_without, white_without, there = _held_out(search, *_without(search, hypothesis), labels)
    folds, on = np.unique(labels), on & there
    squares = np.where(on, white_without**2 - white_with**2, 0.0)
    gains = np.array([squares[labels == f].sum() / max(on[labels == f].sum(), 1) for f in folds])
    kind = (search.shown or shown_kind(search.problem, search.fit)).channels
    before, after = (point_squares(search.problem.model, kind, raw, on).mean() for raw in (raw_without, raw_with))
    return HeldOutGain(
        float(np.sqrt(after)),
        float(np.sqrt(before)),
        float(gains.mean()),
        float(gains.std(ddof=1) / np.sqrt(len(folds))) if len(folds) > 1 else float("inf"),
        scheme,
    )


def _without(search: Search, hypothesis: Hypothesis) -> tuple[Array, tuple[str, ...]]:
    """Values (P,), SI, without an effect, and what is identified then: where parameters take it up, these do."""
    far_off = search.far_off.get(hypothesis.name)
    if far_off is None or far_off.absorbed is None:
        return nulled(search, [hypothesis])
    return far_off.absorbed.values, far_off.absorbed.selected


def _held_out(
    search: Search, values: Array, selected: tuple[str, ...], labels: NDArray[np.intp]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Residuals (N, C) of rows held out by blocks, SI and whitened, linear at parameter values (P,); what takes part.

    That is what was measured and is predicted; what was measured once, on a bench, is never held out.
    """
    model = search.problem.model
    key = ("evaluated", values.tobytes(), selected)
    start = search.fit.after.start
    there = search.known.once(
        (search.problem, search.fit), key, lambda: evaluate(search.problem, values, selected, start)
    )
    problem, evaluation = predicted_part(search.problem, there)
    near = linearise(problem, evaluation)
    ranges = 0.5 * search.unheld.model.ranges[[model.names.index(n) for n in selected]]
    shape = problem.readings.shape
    (white, slopes), (errors, known), raw = near.values, near.besides, evaluation.residual
    white, columns = white.reshape(shape), (slopes * ranges).reshape(*shape, -1)
    assert evaluation.prediction.jacobian is not None
    by_step = np.where(problem.measured[..., None], evaluation.prediction.jacobian, 0.0) * ranges
    twice, known = np.full(len(selected), 2.0), known * ranges
    spectrum = directions(near.jacobian * ranges, selected, twice, beside=search.unheld.beside(selected))
    prior = spectrum.duals.T @ np.diag(np.where(spectrum.held, 1.0, 1e-6)) @ spectrum.duals  # held ones stay near
    prior += known.T @ known
    out_raw, out_white = raw.copy(), white.copy()
    fold_of = value_folds(problem, labels)
    for fold in np.unique(labels):
        train, test = fold_of != fold, labels == fold
        a = columns[train]
        step = np.linalg.solve(a.T @ a + prior, a.T @ white[train] + known.T @ errors)
        out_raw[test] = raw[test] - by_step[test] @ step
        out_white[test] = white[test] - columns[test] @ step
    return out_raw, out_white, problem.measured & (fold_of >= 0)


def value_folds(problem: Problem, labels: NDArray[np.intp]) -> NDArray[np.intp]:
    """Fold (N, C) of each value by that of its row (N,); -1: in none, what was measured once."""
    out = np.tile(labels[:, None], (1, problem.readings.shape[1]))
    out[:, problem.once] = -1
    return out


def blocks(problem: Problem, hypothesis: Hypothesis) -> tuple[NDArray[np.intp], str]:
    """Fold (N,) of each row, repeated poses together: each pose by itself in small tables, else by the effect.

    That is: stretches of time for what depends on time, mixed poses for directions, else cells of the workspace.
    """
    effect = catalogue().get(hypothesis.effect)
    needs = effect.needs if effect is not None else ()
    time = problem.rows.columns.get("time")
    if len(problem) < _FEW:
        return single_poses(problem), "each pose in turn"
    if time is not None and {"time", "temperature"} & set(needs):
        rank = np.argsort(np.argsort(time, kind="stable"))
        return np.asarray(rank * FOLDS * 2 // len(rank) % FOLDS, dtype=np.intp), "blocks of time"
    if hypothesis.session or {"direction", "session", "payload", "spindle"} & set(needs):
        poses = single_poses(problem)
        return np.random.default_rng(0).permutation(int(poses.max()) + 1)[poses] % FOLDS, "random poses"
    return cells(problem), "workspace cells"


def single_poses(problem: Problem) -> NDArray[np.intp]:
    """A number (N,) for each distinct pose, rows that hang together counted as one; by rows where all are one."""
    poses = problem.clusters.together(replicate_groups(problem))
    return poses if poses.any() else np.arange(len(problem))


def cells(problem: Problem, folds: int = FOLDS) -> NDArray[np.intp]:
    """Fold (N,) by cells of the workspace, neighbours in different folds; by rows where all lie in one cell.

    Repeated poses lie in the cell of the first of them.
    """
    code = np.zeros(len(problem), dtype=np.intp)
    for u in pose_axes(problem):
        code = code * _CELLS + np.minimum(((u + 1) / 2 * _CELLS + _EDGE).astype(np.intp), _CELLS - 1)
    _, first, same = np.unique(replicate_groups(problem), return_index=True, return_inverse=True)
    _, inverse = np.unique(code[first][same.ravel()], return_inverse=True)
    if not inverse.any():
        inverse = np.arange(len(problem))
    order = np.random.default_rng(0).permutation(int(inverse.max()) + 1)
    return np.asarray(order[inverse.ravel()] % folds, dtype=np.intp)
