"""A number that the machine file states, and no parameter changes, may be wrong instead of all that a search came to.

It is no effect of the catalogue, and no parameter if nobody thought that it could be wrong. Each is freed by itself,
with declared parameters as their ranges say; those that linearly explain most of what the nominal machine leaves are
fitted. One is told where nothing that was found, and no parameters far off, explain the table better.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.linear import linear_problem
from pkmcal_cli.diagnosis.scoring import Search
from pkmcal_cli.model.fixed_numbers import FixedNumber, fixed_numbers
from pkmcal_cli.model.model import Model

_MUCH = 2.0  # times what ranges and noise explain, from which on the nominal machine is wrong somewhere
_EXPLAINED = 0.5  # share of that which a number explains linearly, to be fitted
_FITTED, _SHOWN, _STEPS = 5, 3, 30  # numbers, and steps of a fit
_FREE = 1e6  # ranges: of what is placed anywhere, as a frame, nothing is known
_SEEN = 1e-6  # share of a number's own column that parameters leave of it
_TIE, _LOSES = 1.0, 5.0  # log evidence that a number may have less than a search, and than the best one


@dataclass(frozen=True)
class WrongNumber:
    """A number that would explain the table: its value with its standard uncertainty, m or rad, and what it leaves."""

    number: FixedNumber
    value: float
    std: float
    chi2_per_dof: float


def wrong_numbers(search: Search, problem: Problem, before: Fit) -> tuple[WrongNumber, ...]:
    """Numbers that explain a table at least as well as a search does, each by itself; the most evident first.

    before: the fit of the problem, as it is without effects. None where the search was for some effects alone.
    """
    at = before.values if before.status == "converged" else replace(search.candidates, model=problem.model).begin()
    begin = np.where([p.stated for p in problem.model.parameters], problem.model.nominal, at)
    screened = _screened(problem, before, at) if search.candidates.only is None else []
    fits = {n: fit for n, size in screened if (fit := _fitted(problem, n, before, begin, size))}
    if not fits:
        return ()
    variance = max(min(fit.chi2_per_dof for fit in fits.values()), 1.0)
    cost = {n: _cost(problem, fit, 1, variance) for n, fit in fits.items()}
    without = _cost(problem, before, 0, variance)
    named = _cost(problem, search.fit, len(search.selected) - len(search.declared), variance)
    most = min(without + _TIE, named + _TIE, min(cost.values()) + _LOSES)
    good = sorted((n for n in fits if cost[n] <= most), key=lambda n: cost[n])
    return tuple(_wrong(n, fits[n]) for n in good[:_SHOWN])


def _wrong(number: FixedNumber, fit: Fit) -> WrongNumber:
    k = fit.selected.index(number.name)
    variance = fit.directions.determined_covariance()[k, k]  # by ranges where they alone tell it
    std = float(np.sqrt(fit.excess * variance))
    return WrongNumber(number, number.value + float(fit.values[-1]), std, fit.chi2_per_dof)


def _cost(problem: Problem, fit: Fit, count: int, variance: float) -> float:
    """Less log evidence (BIC) of a fit with so many further numbers: what it leaves, and how improbable it is."""
    improbable = float((_off_nominal(problem.model, fit.selected, fit.values) ** 2).sum())
    return 0.5 * (fit.chi2 / variance + improbable + count * float(np.log(max(fit.dof, 2))))


def _off_nominal(model: Model, names: tuple[str, ...], values: Array) -> Array:
    """How far parameters (p,) are off nominal at values (P,), in half ranges; 0 where nobody stated any."""
    index = [model.names.index(n) for n in names if n in model.names]
    stated = np.array([model.parameters[k].stated for k in index], dtype=bool)
    return np.where(stated, 2.0 * (values[index] - model.nominal[index]) / model.ranges[index], 0.0)


def _screened(problem: Problem, fit: Fit, at: Array) -> list[tuple[FixedNumber, float]]:
    """Numbers that explain most of what the nominal machine leaves, with their shifts, SI; the best first.

    Linear from values (P,), SI.
    """
    numbers, model = fixed_numbers(problem.model), problem.model
    for number in numbers:
        model = number.freed(model)
    every, states = np.append(at, np.zeros(len(numbers))), fit.after.start if at is fit.values else None
    try:
        linear = linear_problem(replace(problem, model=model), every, fit.selected, [n.name for n in numbers], states)
    except (RowsFailed, np.linalg.LinAlgError):
        return []
    stated = np.array([p.stated for p in problem.model.parameters if p.name in fit.selected])
    known = linear.of(fit.selected)  # (n, p), in half ranges
    nominal = linear.residual + known @ _off_nominal(problem.model, fit.selected, at)
    scaled = known * np.where(stated, 1.0, _FREE)
    normal = np.eye(scaled.shape[1]) + scaled.T @ scaled

    def free(x: Array) -> Array:
        return np.asarray(x - scaled @ np.linalg.solve(normal, scaled.T @ x))

    left, out = free(nominal), list[tuple[float, FixedNumber, float]]()
    cost = float(nominal @ left)
    for number in numbers if cost > _MUCH * linear.used else ():
        column = linear.of([number.name])[:, 0]
        information = float(column @ free(column))
        if information > _SEEN * float(column @ column):
            size = float(column @ left) / information
            out.append((size**2 * information / cost, number, size * float(linear.scale_of([number.name])[0])))
    best = sorted((each for each in out if each[0] > _EXPLAINED), key=lambda each: -each[0])
    return [(number, size) for _, number, size in best[:_FITTED]]


def _fitted(problem: Problem, number: FixedNumber, before: Fit, begin: Array, size: float) -> Fit | None:
    """The fit in which it has any value, from a shift, SI; None where it fails."""
    freed, names = replace(problem, model=number.freed(problem.model)), (*before.selected, number.name)
    try:
        fit = identify(freed, names, np.append(begin, size), _STEPS)
    except (RowsFailed, np.linalg.LinAlgError):
        return None
    return fit if fit.status == "converged" and len(fit.failed) <= len(before.failed) else None
