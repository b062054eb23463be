"""Blocked cross-validation of accepted effects, linearised at the solution: do they help rows they have not seen?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise, predicted_part
from pkmcal_cli.diagnosis.groups import pose_axes
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.search import Search
from pkmcal_cli.effects import catalogue

FOLDS = 6
_CELLS = 4
_EDGE = 1e-6  # of a cell: a pose on the edge of two is in the upper one, whatever its rounding


@dataclass(frozen=True)
class HeldOutGain:
    """Root mean square (m or rad, of `kind` channels) on rows held out by blocks, with all effects and without one.

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


def held_out_gain(now: Search, hypothesis: Hypothesis) -> HeldOutGain:
    """What one accepted effect gains on rows that were not used to fit."""
    labels, scheme = blocks(now.problem, hypothesis)
    selected = now.selected
    rest = tuple(n for n in selected if n not in hypothesis.parameters)
    raw_with, white_with, on = _held_out(now, selected, (), labels)
    raw_without, white_without, _ = _held_out(now, rest, hypothesis.parameters, labels)
    folds = np.unique(labels)
    gains = np.array([(white_without[labels == f] ** 2 - white_with[labels == f] ** 2).mean() for f in folds])
    kind = shown_channels(now.problem)
    measured = on[:, kind]
    return HeldOutGain(
        float(np.sqrt((raw_with[:, kind][measured] ** 2).mean())),
        float(np.sqrt((raw_without[:, kind][measured] ** 2).mean())),
        float(gains.mean()),
        float(gains.std(ddof=1) / np.sqrt(len(folds))) if len(folds) > 1 else float("inf"),
        scheme,
    )


def shown_channels(problem: Problem) -> list[int]:
    """Channels of which errors are told as one figure: measured positions, else all measured ones of one dimension."""
    used = [k for k in range(len(problem.model.channels)) if problem.measured[:, k].any()]
    channels = problem.model.channels
    positions = [k for k in used if channels[k].quantity == "position"]
    return positions or [k for k in used if channels[k].dimension == channels[used[0]].dimension]


def _held_out(
    now: Search, selected: tuple[str, ...], nulled: tuple[str, ...], labels: NDArray[np.intp]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Residuals (N, C) of rows held out by blocks, SI and whitened, with `nulled` parameters at null; what takes part.

    That is what was measured and is predicted.
    """
    model, names = now.problem.model, (*selected, *nulled)
    there = evaluate(now.problem, now.fit.values, names, now.fit.after.state)
    problem, evaluation = predicted_part(now.problem, there)
    near = linearise(problem, evaluation)
    index = [model.names.index(n) for n in names]
    ranges = 0.5 * model.ranges[index]
    moved = np.zeros(len(names))
    moved[len(selected) :] = -(now.fit.values - model.nominal)[index][len(selected) :] / ranges[len(selected) :]
    shape = problem.readings.shape
    white = (near.residual - near.jacobian @ (ranges * moved)).reshape(shape)
    assert evaluation.prediction.jacobian is not None
    by_step = np.where(problem.measured[..., None], evaluation.prediction.jacobian, 0.0) * ranges
    raw = evaluation.residual - by_step @ moved
    scaled_columns = (near.jacobian * ranges)[:, : len(selected)]
    found = directions(scaled_columns, selected, np.full(len(selected), 2.0))
    columns = scaled_columns.reshape(*shape, -1)
    prior = found.vectors.T @ np.diag(np.where(found.held, 1.0, 1e-6)) @ found.vectors  # held ones stay near
    out_raw, out_white = raw.copy(), white.copy()
    for fold in np.unique(labels):
        train, test = labels != fold, labels == fold
        a = columns[train].reshape(-1, len(selected))
        step = np.linalg.solve(a.T @ a + prior, a.T @ white[train].ravel())
        out_raw[test] = raw[test] - by_step[test][..., : len(selected)] @ step
        out_white[test] = white[test] - columns[test] @ step
    return out_raw, out_white, problem.measured


def blocks(problem: Problem, hypothesis: Hypothesis) -> tuple[NDArray[np.intp], str]:
    """Fold (N,) of each row: stretches of time for what depends on time, mixed rows for directions, else cells."""
    effect = catalogue().get(hypothesis.effect)
    needs = effect.needs if effect is not None else ()
    time = problem.rows.columns.get("time")
    if time is not None and {"time", "temperature"} & set(needs):
        rank = np.argsort(np.argsort(time, kind="stable"))
        return np.asarray(rank * FOLDS * 2 // len(rank) % FOLDS, dtype=np.intp), "stretches of time"
    if {"direction", "session", "payload", "spindle"} & set(needs):
        return np.random.default_rng(0).permutation(len(problem)) % FOLDS, "rows at random"
    return cells(problem), "cells of the workspace"


def cells(problem: Problem, folds: int = FOLDS) -> NDArray[np.intp]:
    """Fold (N,) by cells of the workspace, neighbouring cells in different folds."""
    code = np.zeros(len(problem), dtype=np.intp)
    for u in pose_axes(problem):
        code = code * _CELLS + np.minimum(((u + 1) / 2 * _CELLS + _EDGE).astype(np.intp), _CELLS - 1)
    _, inverse = np.unique(code, return_inverse=True)
    order = np.random.default_rng(0).permutation(int(inverse.max()) + 1)
    return np.asarray(order[inverse.ravel()] % folds, dtype=np.intp)
