"""Whether a fit that has converged can be believed: values, and what it leaves, against what anybody would expect."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_check import RangeCheck

USABLE = ("converged", "incomplete")
"""How a fit ends whose parameters can be used."""
_FAR = 10.0  # effective ranges off nominal
_WIDER = 3.0  # times the range of the machine file: no kind is wider effectively, as one cause may throw all far off,
_BUILT = 5e-5  # but where that is less than this, of the machine's size or rad: machines are built no better
_LEFT, _LARGE = 1 / 3, 1e-2  # share of the rms before, and of the machine's size, that a fit of good data goes below
_LOST = 1 / 4  # share of rows without prediction that a fit of good data does not leave
_WEIGHTY = 0.1  # weight below which a reading is left out
_LISTED = 4


def implausible_fit(problem: Problem, fit: Fit, checked: RangeCheck) -> tuple[str, ...]:
    """Why a fit that has converged is not to be believed; `problem` with the weights of the fit."""
    return (*implausible_values(problem, checked), *implausible_residuals(problem, fit), *implausible_rows(fit))


def implausible_values(problem: Problem, checked: RangeCheck) -> tuple[str, ...]:
    """Parameters that are further off nominal than any machine is built."""
    model, far = problem.model, []
    for name, offset in checked.offsets.items():
        parameter = model.parameters[model.names.index(name)]
        factor = checked.factors.get(parameter.kind or parameter.dimension, 1.0)
        built = _BUILT * {"length": model.length, "angle": 1.0}.get(parameter.dimension, 0.0) / parameter.range
        factor = checked.width(name) * float(np.clip(factor, 1.0, max(_WIDER, built)))
        if abs(offset) / 2 > _FAR * factor and not _of_effect(problem, name):
            far.append((abs(offset) / 2, name))
    if not far:
        return ()
    listed = ", ".join(f"{name} ({ranges:.0f})" for ranges, name in sorted(far, reverse=True)[:_LISTED])
    more = f" and {len(far) - _LISTED} more" if len(far) > _LISTED else ""
    return (f"values many ranges off nominal: {listed}{more}",)


def _of_effect(problem: Problem, name: str) -> bool:
    """Whether a number of a declared effect, which has a scale of its own."""
    return any(name in e.parameters for e in problem.model.effects)


def implausible_residuals(problem: Problem, fit: Fit) -> tuple[str, ...]:
    """Lengths that stay nearly as far off as they were before the fit, but for those that a robust loss leaves out."""
    before, after = (_rms(problem, e.residual) for e in (fit.before, fit.after))
    size = problem.model.length
    if not after > _LARGE * size or (np.isfinite(before) and not after > _LEFT * before):
        return ()
    return (f"the fit leaves {after * 1e3:.3g} mm rms, {after / size:.1%} of the machine's size",)


def implausible_rows(fit: Fit) -> tuple[str, ...]:
    """So many rows that cannot be predicted that those which can be prove nothing: the fit has chosen them."""
    lost, rows = len(fit.failed), len(fit.after.residual)
    if lost <= _LOST * rows:
        return ()
    return (f"{lost} of {rows} rows, in which the machine was measured, cannot be predicted",)


def _rms(problem: Problem, residual: Array) -> float:
    """Of all readings that are lengths, are predicted, and have weight, m; nan where there is none."""
    lengths = [k for k, c in enumerate(problem.model.channels) if c.dimension == "length"]
    on = problem.measured[:, lengths] & np.isfinite(residual[:, lengths])
    if problem.weight is not None:
        on &= problem.weight[:, lengths] > _WEIGHTY
    if not on.any():
        return float("nan")
    return float(np.sqrt((residual[:, lengths][on] ** 2).mean()))
