"""Errors on rows that were held out, for programs."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.calibration.holdout import HeldOut
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.report.figures import figure_unit, figures_json
from pkmcal_cli.report.number_format import finite

_KEYS = ("rms_before", "rms_after", "unit", "kind", "scheme", "failed_folds", "before", "after", "reason")


def heldout_json(machine: Machine, held: HeldOut | str) -> dict[str, Any]:
    """Of the first kind that was measured, and of all; or why there are none."""
    out: dict[str, Any] = dict.fromkeys(_KEYS)
    if isinstance(held, str) or not held.after:
        return out | {"reason": held if isinstance(held, str) else "the held-out rows have no measured values"}
    kind = next(iter(held.after))
    unit = figure_unit(machine, held.after[kind])
    return out | {
        "rms_before": finite(held.before[kind].rms / unit.scale),
        "rms_after": finite(held.after[kind].rms / unit.scale),
        "unit": unit.text,
        "kind": kind,
        "scheme": held.scheme,
        "failed_folds": held.failed,
        "before": figures_json(machine, held.before),
        "after": figures_json(machine, held.after),
    }
