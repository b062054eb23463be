"""What is to be said of uncertainties: of parameters that are not identified, of ranges that do not fit."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.range_check import RangeCheck

HELD = "held adds"
_LISTED = 4
_LITTLE = 0.7  # factor on a sigma that is worth a word


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
    parts = [f"{kind} {checked.factors[kind]:.2g}" for kind in sorted(checked.kinds)]
    named = [f"{name} ({abs(z) / 2:.1f})" for name, z in list(checked.far.items())[:_LISTED]]
    most = f"; furthest, in ranges: {', '.join(named)}" if named else ""
    chance = "< 1e-12" if checked.p_value < 1e-12 else f"= {checked.p_value:.1g}"
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
