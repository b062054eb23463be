"""Weighted nonlinear least squares with exact derivatives; what is not seen is not moved.

Each step is the minimum-norm Gauss-Newton step within the directions that the data determine (Ecorchard 2010, eq. 24,
with weights and errors in the drive readings). Rows that cannot be predicted where it leads are left out, and named.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import condensed, evaluate_condensed
from pkmcal_cli.calibration.fit import ABANDONED, Ended, Fit
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.misfit import residuals
from pkmcal_cli.calibration.patience import EXACT, Patience
from pkmcal_cli.calibration.predictable import led, nearest, states_at
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, chi_square, evaluate, reasons
from pkmcal_cli.calibration.step import Scaled, advance, creeps
from pkmcal_cli.calibration.trust_region import Region
from pkmcal_cli.prediction import WarmStart

_SPOILT = 100.0  # times chi-square per degree of freedom by which rows out of reach at the start may spoil a fit
_NEARLY = 1e4  # the same of a reading that a fit without it nearly explains: it may lie where that extrapolates far
_LAST, _LITTLE = 4, 1e-3  # values of chi-square, and the share by which they may differ, at which it has settled
NOTHING = "nothing_identifiable"
_STATUS = {
    **dict.fromkeys(("gradient", "step", "rounding", "enough", "noise"), "converged"),
    **dict.fromkeys(("no_descent", "budget", ABANDONED), "not_converged"),
}
STEPS = 60  # that a fit may take
_SWITCHED, _ROUNDED = 1e-3, 1e-10  # in sigma, and m or rad: by which a reading in another assembly differs at least
_BIND = 1e-9  # a parameter this near to its bound, in ranges, is on it


class RowsFailed(Exception):
    """Most rows cannot be predicted at the starting values, nor where fits of the others lead."""

    def __init__(self, evaluation: Evaluation) -> None:
        super().__init__("rows cannot be predicted")
        self.evaluation = evaluation


def identify(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array | None = None,
    iterations: int = STEPS,
    progress: Callable[[int, float], None] | None = None,
    shift: Array | None = None,
    states: WarmStart | None = None,
    patience: Patience = EXACT,
) -> Fit:
    """Identify the selected parameters, from nominal values or `start` (P,). Raises RowsFailed.

    Rows that cannot be predicted wherever fits of the others lead are left out: `Fit.failed`, less than half of all.
    So are those that can be predicted only where nothing is explained any more. Rows that failed on the way come back
    where the fit ends near them.
    `shift`: drive errors (N, A) of an earlier fit, to begin with; `states`: of these rows, near those at the start;
    `patience`: when it is given up.
    """
    fit = _identified(problem, selected, start, iterations, progress, shift=shift, states=states, patience=patience)
    doubt = reasons(problem, fit.before) if fit.chi2_per_dof > _SPOILT else {}
    if doubt and not doubt.keys() <= fit.failed.keys():
        fit = _unspoilt(problem, doubt, fit, start, iterations, progress, patience=patience)
    return _with_rows_back(problem, fit, iterations, progress) if fit.failed and fit.status == "converged" else fit


def _unspoilt(
    problem: Problem,
    doubt: Mapping[int, str],
    fit: Fit,
    start: Array | None,
    iterations: int,
    progress: Callable[[int, float], None] | None,
    patience: Patience,
) -> Fit:
    """The fit without rows in doubt, where these spoil it."""
    try:
        without = _identified(problem.without(doubt), fit.selected, start, iterations, progress, patience=patience)
    except RowsFailed:
        return fit
    spoilt = without.status == "converged" and fit.chi2_per_dof > _SPOILT * max(without.chi2_per_dof, 1.0)
    return replace(without, before=fit.before, failed={**doubt, **without.failed}) if spoilt else fit


def _with_rows_back(problem: Problem, fit: Fit, iterations: int, progress: Callable[[int, float], None] | None) -> Fit:
    """The fit with those rows that failed on the way, but are nearly explained where it ended, unless they spoil it."""
    again = evaluate_condensed(problem, fit.values, fit.selected, states_at(fit.last))
    end = nearest(problem, Scaled.of(problem, fit.selected), again)
    noise = np.where(problem.measured, problem.sigma, 1.0)
    most = max(fit.chi2_per_dof, 1.0)
    far = ~((end.residual / noise) ** 2 <= _NEARLY * most)  # (N, C), and where there is no prediction
    left_out = {r: why for r, why in fit.failed.items() if np.any(far[r])}
    if len(left_out) == len(fit.failed):
        return fit
    try:
        part = problem.without(left_out)
        whole = _identified(part, fit.selected, fit.values, iterations, progress)
    except RowsFailed:
        return fit
    whole = replace(whole, before=fit.before, failed={**left_out, **whole.failed})
    good = whole.status == "converged" and whole.chi2_per_dof <= _SPOILT * most and len(whole.failed) < len(fit.failed)
    return whole if good else fit


def _identified(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array | None,
    iterations: int,
    progress: Callable[[int, float], None] | None,
    shift: Array | None = None,
    states: WarmStart | None = None,
    patience: Patience = EXACT,
) -> Fit:
    """The fit of all rows that can be predicted where it leads. Raises RowsFailed."""
    first = evaluate_condensed(problem, problem.model.nominal if start is None else start, selected, states, shift)
    scale = Scaled.of(problem, selected)
    fixed = problem.count == 0 or not (selected or problem.frames or problem.reading_sigma.any())
    led_before = shift is not None or (states is not None and patience.enough > 0.0)
    as_it_is = fixed or patience.short or (led_before and first.solved)
    lead = first if as_it_is else led(problem, scale, first, patience)
    failed = reasons(problem, lead)
    kept, evaluation = _kept(problem, first, lead, failed)
    if fixed:
        return _finished(kept, selected, first, last=evaluation, status=NOTHING, count=0, failed=failed)
    task = _Task(problem=problem, scale=scale, first=first, iterations=iterations, progress=progress, patience=patience)
    near = problem.method == "exact"  # then only the end of the way is compared with other assemblies
    way = _descent(task, kept, evaluation, failed, compare=not near)
    if patience.choosy and 2 * way.astray > len(way.kept):
        raise RowsFailed(first)
    ropes = near and bool(problem.model.exact.ropes)  # those that are slack at the start may hold a fit back
    if way.astray and not patience.retraces:
        way = replace(way, stopped="no_descent")
    elif way.astray or (ropes and chi_square(way.kept, way.end) > _SPOILT * way.kept.count):
        way = _descent(task, kept, evaluation, failed, compare=True)
    stopped, steps, lost, end = way.stopped or "budget", len(way.chi2), way.failed, way.end
    if stopped == ABANDONED:
        selected, end = (), evaluate_condensed(way.kept, first.values, (), first.start)
    fit = _finished(way.kept, selected, first, last=end, status=_STATUS[stopped], count=steps, failed=lost)
    stopped = "nothing" if fit.status == NOTHING else stopped
    return replace(fit, stopped=stopped, flat=_flat([*way.chi2, fit.chi2]))


@dataclass(frozen=True, kw_only=True)
class _Task:
    """A fit: the whole problem, its selected parameters, the evaluation at the start, how long it may take."""

    problem: Problem
    scale: Scaled
    first: Evaluation
    iterations: int
    progress: Callable[[int, float], None] | None
    patience: Patience


@dataclass(frozen=True, kw_only=True)
class _Descent:
    """Where steps lead: the rows that are kept, those that failed, chi-square on the way, and why it stopped.

    astray: rows in which the end is no equilibrium of least energy.
    """

    kept: Problem
    end: Evaluation
    failed: Mapping[int, str]
    chi2: tuple[float, ...]
    stopped: str
    astray: int


def _descent(task: _Task, kept: Problem, begin: Evaluation, failed: Mapping[int, str], *, compare: bool) -> _Descent:
    """Steps from one evaluation on until they stop; compare: whether each of them is compared with other assemblies.

    Else only the end is: where rows are in others there, or have no prediction, it does not hold.
    """
    region, stopped, astray, chi2, end = Region(), "", 0, list[float](), begin
    while len(chi2) < task.iterations and not stopped:
        near = condensed(kept, end)
        chi2.append(near.chi2)
        if task.patience.ends(chi2):
            stopped = ABANDONED
            break
        end, region, stopped = advance(kept, task.scale, end, near, region, task.patience, compare=compare)
        stopped = stopped or creeps(kept, task.scale, near, chi2)
        ended = stopped or (len(chi2) == task.iterations and not compare)
        if stopped == "no_descent" and near.chi2 > task.patience.chi2:
            stopped = ABANDONED if task.patience.short else stopped
        elif ended:
            again = evaluate(kept, end.values, None, end.start, end.shift)
            astray = _astray(kept, again, end)
            if not astray:
                end = replace(end, prediction=replace(end.prediction, misfit=again.prediction.misfit))
            elif compare:
                failed, stopped = {**failed, **reasons(kept, again)}, ""
                retried = evaluate_condensed(task.problem, end.values, task.scale.names, again.start, end.shift)
                kept, end = _kept(task.problem, task.first, retried, failed)
        if task.progress is not None:
            task.progress(len(chi2), near.chi2)
    return _Descent(kept=kept, end=end, failed=failed, chi2=tuple(chi2), stopped=stopped, astray=astray)


def _astray(problem: Problem, again: Evaluation, end: Evaluation) -> int:
    """In how many rows the end of a fit is not predicted again: a state that does not hold, or one of more energy."""
    with np.errstate(invalid="ignore"):
        holds = np.abs(again.residual - end.residual) <= np.maximum(_SWITCHED * problem.sigma, _ROUNDED)  # (N, C)
    rows = int((problem.measured & ~holds).any(axis=1).sum())
    return rows or int(not again.solved)


def _flat(chi2: Sequence[float]) -> bool:
    """Whether chi-square has hardly changed in the last steps."""
    last = chi2[-_LAST:]
    return len(last) == _LAST and max(last) - min(last) < _LITTLE * min(last)


def _kept(
    problem: Problem, first: Evaluation, evaluation: Evaluation, failed: Collection[int]
) -> tuple[Problem, Evaluation]:
    """The problem without rows that failed, and the evaluation as it is for that.

    Raises RowsFailed with the start's evaluation, `first`, where half of the rows failed, or too few values are left.
    """
    if not failed:
        return problem, evaluation
    kept, shift = problem.without(failed), evaluation.shift.copy()
    half = 2 * len(failed) >= int(problem.measured.any(axis=1).sum())
    if half or kept.count < len(evaluation.parameters) <= problem.count:
        raise RowsFailed(first)
    shift[list(failed)] = 0.0
    return kept, replace(evaluation, shift=shift, residual=residuals(kept, evaluation.prediction.values))


def _finished(
    problem: Problem,
    selected: tuple[str, ...],
    first: Evaluation,
    last: Evaluation,
    status: str,
    count: int,
    failed: Mapping[int, str],
) -> Fit:
    """What is told of a fit of what is left without rows that failed."""
    near = condensed(problem, last)
    scale = Scaled.of(problem, selected)
    values = last.values[scale.index]
    on_bound = (values - scale.low < _BIND * scale.ranges) | (scale.high - values < _BIND * scale.ranges)
    spectrum = directions(near.jacobian, selected, scale.ranges, problem.unseen, scale.beside)
    if status != _STATUS[ABANDONED] and near.frames is None and spectrum.held.all():  # or nothing selected
        status = NOTHING
    moved = int((~spectrum.held).sum()) - int(on_bound.sum()) + (0 if near.frames is None else near.frames.rank)
    names = tuple(n for n, b in zip(selected, on_bound, strict=True) if b)
    return Fit(
        values=last.values,
        selected=selected,
        directions=spectrum,
        before=first,
        ended=Ended(problem, last),
        chi2=near.chi2,
        dof=problem.count + near.known - max(moved, 0),
        status=status,
        iterations=count,
        at_bound=names,
        failed=failed,
    )
