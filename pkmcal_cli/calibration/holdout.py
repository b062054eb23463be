"""Error on rows that a fit has not seen, by blocks: folds, sessions, workspace cells or another file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.plural import listed
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Observer, Stage, unobserved
from pkmcal_cli.calibration.errors_before_after import ErrorFigures, error_figures, pooled
from pkmcal_cli.calibration.expected_noise import held_out_noise
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate, lost_rows, predicted_part
from pkmcal_cli.calibration.same_poses import loads_of, poses_alike
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import WarmStart
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.measurands import Measurand

Refit = Callable[[Problem, tuple[str, ...], Array, WarmStart | None], Fit]
"""A fit of some parameters from values (P,), and states near those there. Raises RowsFailed."""

_SAME = 1e-3  # share of a drive's spread that readings of one pose may differ by
_WORSE = 2.0  # times chi-square per degree of freedom of all rows, at which some are in another minimum
_NAMED = 12  # numbers of sessions that are told one by one
_CELLS = 4  # cells along each axis of the workspace
VALUES_PER_PARAMETER = 3  # below this the hold-out is left out by default


@dataclass(frozen=True)
class HeldOut:
    """Figures before and after on held-out rows only, by kind; `scheme` in words; `folds` counted.

    noise: mean square of errors that noise makes there over that of noise, by kind; none where it is not known.
    """

    before: dict[str, ErrorFigures]
    after: dict[str, ErrorFigures]
    scheme: str
    folds: int
    failed: int  # folds whose fit did not converge
    noise: Mapping[str, float] = field(default_factory=dict)


def fold_labels(scheme: str, problem: Problem, measurements: Measurements) -> tuple[NDArray[np.intp], str]:
    """Fold number of every row (N,) for `K`, `session` or `cells`, and the scheme in words. Raises ValueError."""
    if scheme == "session":
        labels = np.asarray(measurements.session, dtype=np.intp)
        if len(np.unique(labels)) < 2:
            raise ValueError("there is only one session")
        return labels, f"by session, {len(np.unique(labels))} sessions"
    if scheme == "cells":
        labels = _cells(problem)
        if len(np.unique(labels)) < 2:
            raise ValueError("all rows lie in one cell")
        return labels, f"by workspace cell, {len(np.unique(labels))} cells"
    groups = problem.clusters.together(replicate_groups(problem))
    folds = int(scheme)
    poses = int(groups.max(initial=-1)) + 1
    if folds < 2 or folds > poses:
        raise ValueError(f"{folds} folds are not possible with {poses} distinct poses; ask for 2 to {poses}, or none")
    return groups % folds, f"{folds} folds, repeated poses kept together"


def replicate_groups(problem: Problem) -> NDArray[np.intp]:
    """A number for each distinct set of drive readings (N,), in order of first appearance; of loads without drives.

    Readings within one thousandth of their spread are the same pose, but in a scan as fine as that.
    """
    readings = problem.rows.readings
    readings = readings[:, ~np.isnan(readings).any(axis=0)]
    return poses_alike(readings if readings.size else np.column_stack(loads_of(problem.rows)), _SAME)


def _cells(problem: Problem) -> NDArray[np.intp]:
    """Cells of a regular partition of the measured (else commanded) space, (N,)."""
    columns = problem.model.measuring(Measurand.POSITION)
    coordinates = problem.readings[:, columns]
    if not columns or np.isnan(coordinates).any():
        coordinates = problem.rows.readings[:, ~np.isnan(problem.rows.readings).any(axis=0)]
    low, spread = coordinates.min(axis=0), np.ptp(coordinates, axis=0)
    bins = np.minimum((coordinates - low) / np.where(spread > 0, spread, 1.0) * _CELLS, _CELLS - 1).astype(np.int64)
    return np.unique(bins, axis=0, return_inverse=True)[1].ravel().astype(np.intp)


def cross_validate(
    problem: Problem,
    fit: Fit,
    labels: NDArray[np.intp],
    scheme: str,
    again: Refit | None = None,
    observe: Observer = unobserved,
    weight: Array | None = None,
) -> HeldOut:
    """Refit without each fold, from where the fit began (what a fold does not determine must not come from the
    held-out rows), predict it, and gather all held-out residuals. `again`: how, by default by least squares; weight
    (N, C): with which that begins.
    """
    before, after, failed, lost = [], [], 0, 0
    fitted_too: dict[str, None] = {}
    folds = np.unique(labels)
    for k, fold in enumerate(folds):
        observe(Stage("held-out fold", k, len(folds)))
        trained = None  # the fold before: states of a long table are large
        inside, outside = np.nonzero(labels == fold)[0], np.nonzero(labels != fold)[0]
        trained = _refitted(replace(problem, weight=weight).take(outside), fit, outside, again or _by_least_squares)
        failed += trained is None or trained.status != "converged"
        part = _without_bench(problem.take(inside))
        if trained is None:
            lost += len(part)
            continue
        refitted = _unknown_to(problem.take(outside), part)
        fitted_too |= dict.fromkeys(refitted)
        predicted = _predicted(part, trained.values, refitted, _states(fit.after, inside))
        gone = lost_rows(part, predicted)
        lost += len(gone)
        part = part.without(gone)
        after.append(error_figures(part, predicted_part(part, predicted)[1]))
        before.append(error_figures(part, evaluate(part, fit.before.values, None, _states(fit.before, inside))))
    words = [scheme] + ([f"{listed(tuple(fitted_too), _NAMED)} fitted to the held-out rows"] if fitted_too else [])
    words += _lost_words(lost, len(problem))
    noise = held_out_noise(problem, fit, labels)
    return HeldOut(pooled(before), pooled(after), "; ".join(words), len(folds), failed, noise)


def _lost_words(lost: int, rows: int) -> list[str]:
    return [f"{lost} of {rows} rows could not be predicted"] if lost else []


def _states(evaluation: Evaluation, rows: NDArray[np.intp]) -> WarmStart:
    """States of some rows; those that were not predicted are looked for again."""
    return evaluation.start.take(rows).renewed()


def _by_least_squares(problem: Problem, selected: tuple[str, ...], start: Array, states: WarmStart | None) -> Fit:
    return identify(problem, selected, start, states=states)


def _refitted(problem: Problem, fit: Fit, rows: NDArray[np.intp], again: Refit) -> Fit | None:
    """The fit of some rows, from where it began; where that leads nowhere, or to a worse end, from where it ended."""
    ends: list[Fit] = []
    for begin in (fit.before, fit.after):
        try:
            ends.append(again(problem, fit.selected, begin.values, _states(begin, rows)))
        except RowsFailed:
            continue
        worse = ends[-1].chi2_per_dof > _WORSE * max(fit.chi2_per_dof, 1.0)
        if ends[-1].status != "not_converged" and not worse:
            break
    return min(ends, key=lambda e: (e.status == "not_converged", e.chi2), default=None)


def _predicted(part: Problem, values: Array, refitted: tuple[str, ...], states: WarmStart | None) -> Evaluation:
    """Held-out rows, predicted; what their sessions have for themselves is fitted to them."""
    try:
        values = identify(part, refitted, values, states=states).values if refitted else values
        return evaluate(part, values, None, states)
    except RowsFailed as failure:
        return failure.evaluation


def _without_bench(part: Problem) -> Problem:
    """What was measured once is part of every fit, so it is not held out."""
    measured = part.measured.copy()
    measured[:, part.once] = False
    return replace(part, measured=measured) if part.once else part


def _unknown_to(trained: Problem, part: Problem) -> tuple[str, ...]:
    """What sessions of held-out rows have for themselves, when no row of these sessions was fitted."""
    names = part.model.sessions
    if not names:
        return ()
    there = {names[k] for k in np.unique(part.rows.session_numbers(names))}
    fitted = {names[k] for k in np.unique(trained.rows.session_numbers(names))}
    return tuple(p.name for p in part.model.parameters if p.session in there - fitted)


def validate(problem: Problem, model: Model, fit: Fit, scheme: str) -> HeldOut:
    """Figures on another file's rows; what its sessions have for themselves is fitted to them. Raises RowsFailed.

    model: that of the fit, whose sessions may be others.
    """
    parameters = problem.model.parameters
    per_part = tuple(p.name for p in parameters if p.per_session or (p.session and p.session not in model.sessions))

    def known(values: Array) -> Array:
        there = dict(zip(model.names, values, strict=True))
        return np.array([there.get(n, v) for n, v in zip(problem.model.names, problem.model.nominal, strict=True)])

    after = identify(problem, per_part, known(fit.values))
    part = problem.without(after.failed)  # these rows count neither before nor after
    start = known(fit.before.values)
    before = identify(part, per_part, start).values if per_part else start
    figures = [error_figures(_without_bench(part), evaluate(part, values)) for values in (before, after.values)]
    words = [scheme, *([f"{', '.join(per_part)} fitted to these rows"] if per_part else [])]
    return HeldOut(figures[0], figures[1], "; ".join([*words, *_lost_words(len(after.failed), len(problem))]), 1, 0)


def enough_values(problem: Problem, selected: tuple[str, ...]) -> bool:
    """Whether there are at least three measured values a parameter."""
    return problem.count >= VALUES_PER_PARAMETER * problem.unknowns(selected)


__all__ = ["Array", "HeldOut", "cross_validate", "enough_values", "fold_labels", "replicate_groups", "validate"]
