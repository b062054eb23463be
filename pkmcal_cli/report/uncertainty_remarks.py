"""What is to be said of uncertainties: of parameters that are not identified, of ranges that do not fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import chdtrc, chdtri

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.fit import SIGNIFICANT, Fit
from pkmcal_cli.calibration.intervals import Intervals
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_check import RangeCheck
from pkmcal_cli.calibration.replicates import ReplicateNoise
from pkmcal_cli.report.number_format import finite

HELD = "held adds"
_LISTED = 4
_LITTLE = 0.7  # factor on a sigma, or on the ranges of a kind, that is worth a word
_EXPLAINED = 0.5  # share of chi-square from which on what explains it is worth a word


def held_text(budget: ErrorBudget) -> str:
    """What is not identified, and what that means."""
    held = count(len(budget.held), "parameter")
    return (
        f"{held} not identified, and known only to within their ranges: identified values compensate for their errors "
        f"(`{HELD}`, standard uncertainty). At the tool most of that cancels: "
        "`pkmcal simulate -p PARAMS.yaml --uncertainty` shows what is left."
    )


def ranges_text(checked: RangeCheck) -> str:
    """By how much ranges are too small or too large, and which parameters tell it."""
    parts = [f"{kind} {float(f'{checked.factors[kind]:.2g}'):.6g}" for kind in sorted(checked.kinds)]
    named = [f"{name} ({abs(z) / 2:.1f})" for name, z in list(checked.far.items())[:_LISTED]]
    most = f"; furthest, in ranges: {', '.join(named)}" if named else ""
    chance = "< 1e-12" if checked.p_value < 1e-12 else f"= {checked.p_value:.1g}"
    if named and all(_LITTLE < checked.factors[kind] < 1 / _LITTLE for kind in checked.kinds):
        few = f"A few parameters are further off nominal than their ranges say (p {chance}): {', '.join(named)} ranges"
        return f"{few}. The ranges of the others count as stated"
    return (
        f"The ranges do not fit how far parameters are off nominal (p {chance}). "
        f"Uncertainties are computed with ranges times: {', '.join(parts)}{most}"
    )


def noise_text(budget: ErrorBudget) -> str:
    """By what stated sigmas are multiplied, where that is worth a word; "" where it is not."""
    factors = dict(zip(budget.instruments, np.sqrt(budget.scales.typical_noise).tolist(), strict=True))
    odd = sorted(
        (n for n, f in factors.items() if not _LITTLE < f < 1 / _LITTLE), key=lambda n: -abs(np.log(factors[n]))
    )
    if not odd:
        return ""
    more = f" and {len(odd) - _LISTED} more" if len(odd) > _LISTED else ""
    listed = ", ".join(f"{name} {factors[name]:.2g} times sigma" for name in odd[:_LISTED])
    return f"Uncertainties are computed with noise of {listed}{more}."


def held_that_explain(fit: Fit, budget: ErrorBudget) -> tuple[str, ...]:
    """Parameters that are not identified, but explain within their ranges most of what is more than noise; () if none.

    Those few that explain the most of it together.
    """
    if fit.excess <= 1.0 or budget.share.left_of_all() > _EXPLAINED * fit.chi2:
        return ()
    return budget.share.named()


def residuals_text(
    fit: Fit, budget: ErrorBudget, problem: Problem, replicates: Sequence[ReplicateNoise]
) -> list[str]:
    """Why the residuals of a fit by least squares are larger than noise, in sentences; [] where they are not.

    replicates: of the problem's channels, where poses were repeated.
    """
    if fit.excess <= 1.0:
        return []
    lines = [f"The residuals are {np.sqrt(fit.chi2_per_dof):.3g} times larger than the stated noise."]
    repeated = repeats_confirm(fit, problem, replicates)
    causes = ["The model lacks an effect", *([] if repeated else ["or sigma is too small"])]
    if not budget.share.within:
        causes.append("or parameters that are not identified are further off than their ranges")
    lacking = f"{', '.join(causes)}{': readings of the same poses scatter as stated' if repeated else ''}."
    if not (names := ",".join(held_that_explain(fit, budget))):
        return [*lines, lacking]
    remedy = f"(`--select auto,{names}`)"
    lines.append(f"Parameters that are not identified explain most of this within their ranges {remedy}.")
    left = max(budget.share.left_of_all(), 0.0)
    if chdtrc(fit.dof, left) <= SIGNIFICANT:
        rest = f"Even so the residuals are {np.sqrt(left / fit.dof):.3g} times larger than the stated noise."
        lines += [rest, lacking]
    return lines


def repeats_confirm(fit: Fit, problem: Problem, replicates: Sequence[ReplicateNoise]) -> bool:
    """Whether repeated poses show that no noise makes residuals as large: of every channel that was measured."""
    measured = {c.name for k, c in enumerate(problem.model.channels) if problem.measured[:, k].any()}
    confirmed = set()
    for each in replicates:
        most = each.std * np.sqrt(each.degrees_of_freedom / chdtri(each.degrees_of_freedom, 1.0 - SIGNIFICANT))
        if not each.doubtful and most < np.sqrt(fit.chi2_per_dof) * each.sigma:
            confirmed.add(each.channel)
    return measured == confirmed


def uncertainty_json(fit: Fit, budget: ErrorBudget, checked: RangeCheck, intervals: Intervals) -> dict[str, Any]:
    """What uncertainties are made of, for programs."""
    noise = np.sqrt(budget.scales.typical_noise).tolist()  # by what the sigma of each instrument is multiplied
    return {
        "method": intervals.method,
        "noise": dict(zip(budget.instruments, noise, strict=True)),
        "ranges": {"p_value": finite(checked.p_value), "factors": dict(checked.factors)},
        "held": list(budget.held),
        "held_explain": list(held_that_explain(fit, budget)),
        "remark": intervals.remark or None,
    }
