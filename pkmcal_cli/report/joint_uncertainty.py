"""The joint uncertainty of all parameters, as parameter files hold it."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.information import data_information
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.loading.parameter_text import Correlations, ParameterEntry
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.parameters import parameter_unit


def correlations(model: Model, budget: ErrorBudget) -> Correlations | None:
    """Of all that are uncertain: identified parameters, and the others with their ranges."""
    names = (*budget.names, *budget.held)
    if not budget.names:
        return None
    covariance = budget.joint_covariance
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    scale = np.array([parameter_unit(model, n).scale for n in names])
    return Correlations(names, [float(v) for v in std / scale], (covariance / np.outer(std, std)).tolist())


def data_lines(
    model: Model,
    problem: Problem,
    fit: Fit,
    budget: ErrorBudget,
    entries: Sequence[ParameterEntry],
    without: Collection[str] = (),
) -> list[str]:
    """What the rows alone say of all parameters, as a section of a parameter file; none where a fit has failed."""
    data = data_information(problem, fit, budget, without) if fit.usable else None
    if data is None:
        return []
    values = {e.name: (e.value, e.unit or "1") for e in entries}
    return data.lines([parameter_unit(model, n).scale for n in data.names], values)
