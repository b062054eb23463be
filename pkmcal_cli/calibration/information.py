"""What the rows of a fit say of all parameters of the machine, whatever was selected, held or known besides."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import condensed, evaluate_condensed
from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.instruments import WORTH
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.loading.data_information import DataInformation


def data_information(
    problem: Problem, fit: Fit, budget: ErrorBudget, without: Collection[str] = ()
) -> DataInformation | None:
    """Of a fit that has ended, at its values; None where rows have no prediction. problem: with weights of a loss.

    What was measured once, on the bench, is left out: it is in the machine file, so every calibration has it.
    `without`: parameters that are left where they are.
    """
    scale = dict(zip(budget.every, budget.half_ranges * budget.scales.typical, strict=True))
    model = problem.model
    half_ranges = {p.name: scale.get(p.name, 0.5 * p.range) for p in model.parameters if not p.fixed and p.range > 0}
    left_out = {*without, *problem.eliminated}
    half_ranges = {name: half for name, half in half_ranges.items() if name not in left_out}
    names = tuple(half_ranges)
    if not names or not problem.count:
        return None
    measured = problem.measured.copy()
    measured[:, problem.once] = False
    rows = replace(problem, measured=measured, prior=None)
    last = evaluate_condensed(rows, fit.values, names, fit.last.start, fit.shift)
    if not last.solved:
        return None
    near, half = condensed(rows, last), np.array(list(half_ranges.values()))
    whole = np.column_stack([near.jacobian * half, near.residual]) / _noise(rows, budget)[near.channel, None]
    upper: Array = np.asarray(np.linalg.qr(whole, mode="r"))
    q = len(names)
    root, right = upper[:q, :q], upper[:q, q]
    left = float(upper[q, q] ** 2) if len(upper) > q else 0.0
    if problem.weight is not None:  # a robust fit knows its noise by the scatter of what it kept
        left = float(max(rows.count - q, 0))
    used = {model.channels[k].sigma_is for k in range(len(model.channels)) if measured[:, k].any()}
    drives = {d.sigma_is for a, d in enumerate(model.actuators) if problem.drive_sigma[:, a].any()}
    worth = min(WORTH[kind] for kind in (*used, *drives)) if used else np.inf
    return DataInformation(
        names=names, scale=half, root=root, right=right, left=left, count=rows.count, worth=float(worth)
    )


def _noise(problem: Problem, budget: ErrorBudget) -> Array:
    """By what whitened residuals of channels (C,) are divided: instruments may be off their sigma by different factors.

    One alone keeps its stated sigma: its factor follows from what is left. Not so with a robust loss.
    """
    channels, factors = problem.model.channels, np.sqrt(budget.scales.typical_noise)
    apart = len(budget.instruments) > 1 or problem.weight is not None
    of = dict(zip(budget.instruments, factors, strict=True)) if apart else {}
    return np.array([float(of.get(c.instrument, 1.0)) for c in channels])
