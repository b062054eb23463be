"""The result of `calibrate`: JSON, tables, parameter file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.errors_before_after import ErrorFigures, error_figures
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.fitted import Fitted
from pkmcal_cli.calibration.holdout import HeldOut
from pkmcal_cli.calibration.identifiability import Combination, combinations
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.replicates import replicate_noise
from pkmcal_cli.calibration.residual import lost_rows
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.loading.parameter_file import Correlations, ParameterEntry, dump_parameters
from pkmcal_cli.loading.poses import Place
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.audit import Audit
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.failed_rows import FailedRows
from pkmcal_cli.report.figures import figure_unit, figures_json
from pkmcal_cli.report.numbers import finite, readable, uncertain
from pkmcal_cli.report.parameters import (
    ParameterRow,
    combination_json,
    combination_text,
    parameter_rows,
    parameter_unit,
)
from pkmcal_cli.report.replicates import show_replicates

_WEAK, _MEMBERS = 3, 8  # weak combinations that are told one by one, if they have so few members
_FAR = 5.0  # ranges off nominal from which on a value is worth a word


class CalibrationReport:
    """One calibration, ready to be shown."""

    def __init__(
        self,
        machine: Machine,
        problem: Problem,
        found: Fitted,
        held_out: HeldOut | str,
        place: Callable[[int], Place],
    ) -> None:
        fit, intervals = found.robust.fit, found.intervals
        self.found = found
        self.machine, self.model, self.fit, self.held_out = machine, problem.model, fit, held_out
        self.audit, self.intervals = Audit(problem.model, found.robust, place), intervals
        self.rows = parameter_rows(self.model, fit, intervals)
        problem = problem.without(fit.failed)
        self.failed = FailedRows(fit.failed, place, len(problem))
        self.slipped = lost_rows(problem, fit.after)  # predicted only with errors of the drives: no error is told
        told = problem.without(self.slipped)
        self.before, self.after = error_figures(told, fit.before), error_figures(told, fit.after)
        self.started = len(lost_rows(told, fit.before))
        self.n_rows, self.replicates = len(problem), replicate_noise(problem, fit)

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        found = self.fit.found
        return {
            "status": self.fit.status,
            "n_rows": self.n_rows,
            **self.failed.json(),
            "iterations": self.fit.iterations,
            "parameters": [r.json() for r in self.rows if r.name in self.fit.selected],
            "before": figures_json(self.machine, self.before),
            "after": figures_json(self.machine, self.after),
            "chi2": finite(self.fit.chi2),
            "degrees_of_freedom": self.fit.dof,
            "chi2_per_dof": finite(self.fit.chi2_per_dof),
            "uncertainty": {
                "method": self.intervals.method,
                "widened": float(np.sqrt(self.fit.found.spread)),
                "remark": self.intervals.remark or None,
            },
            "outliers": self.audit.json(),
            "datum": None if self.found.datum is None else list(self.found.datum.held),
            "gauge": [] if self.found.datum is None else list(self.found.datum.gauge.motions),
            "starts": None if self.found.agreement is None else asdict(self.found.agreement),
            "replicates": [noise.json() for noise in self.replicates],
            "heldout": self._heldout_json(),
            "condition_number": finite(found.condition_number),
            "rank": found.rank,
            "undetermined": [each for c in combinations(found) for each in combination_json(self.model, c, self.fit)],
        }

    def _heldout_json(self) -> dict[str, Any]:
        held = self.held_out
        keys = ("rms_before", "rms_after", "unit", "kind", "scheme", "failed_folds", "before", "after", "reason")
        out: dict[str, Any] = dict.fromkeys(keys)
        if isinstance(held, str) or not held.after:
            return out | {"reason": held if isinstance(held, str) else "nothing was measured there"}
        kind = next(iter(held.after))
        unit = figure_unit(self.machine, held.after[kind])
        return out | {
            "rms_before": finite(held.before[kind].rms / unit.scale),
            "rms_after": finite(held.after[kind].rms / unit.scale),
            "unit": unit.text,
            "kind": kind,
            "scheme": held.scheme,
            "failed_folds": held.failed,
            "before": figures_json(self.machine, held.before),
            "after": figures_json(self.machine, held.after),
        }

    def show(self, to: Reporter) -> None:
        """Tables for people."""
        selected = [r for r in self.rows if r.name in self.fit.selected]
        to.table(
            "Parameters",
            ("name", "nominal", "identified", *self._interval_head, "range", "remark"),
            [self._row(r) for r in selected],
        )
        found = combinations(self.fit.found)
        for c in found:
            if c.kind == "null":
                to.say("not determined: " + combination_text(self.model, c, self.fit))
        self._show_weak(to, [c for c in found if c.kind == "weak"])
        if far := [f"{r.name} ({abs(r.value - r.nominal) / r.range:.1f})" for r in selected if _far(r)]:
            hint = "a wrong unit, a missing effect, or the wrong one of several minima (`--starts 10` looks for others)"
            to.warn(f"warning: many ranges off nominal: {', '.join(far)}: {hint}")
        to.say()
        self._show_errors(to)
        self.failed.show(to)
        self.audit.show(to)
        show_replicates(to, self.replicates)
        to.say(self.verdict())

    def _show_weak(self, to: Reporter, weak: list[Combination]) -> None:
        """What is held about nominal."""
        short = [c for c in weak if len(c.names) <= _MEMBERS][:_WEAK]
        for c in short:
            to.say(f"weak: {combination_text(self.model, c, self.fit)}")
        if weak:
            held = f"{count(len(weak), 'weak combination')} held about nominal"
            more = " (see `pkmcal observability`)" if len(weak) > len(short) else ""
            to.say(f"{held}; the ranges are in the uncertainties{more}")

    def _row(self, r: ParameterRow) -> tuple[str, ...]:
        value = uncertain(r.value, r.std, r.unit)
        return r.name, f"{r.nominal:.8g}", value, *self._ends(r), r.spread, r.reason or ""

    @property
    def _interval_head(self) -> tuple[str, ...]:
        """A column for intervals where they are more than 1.96 standard uncertainties."""
        return () if self.intervals.method == "linear" else (f"95 % ({self.intervals.method})",)

    def _ends(self, row: ParameterRow) -> tuple[str, ...]:
        if self.intervals.method == "linear":
            return ()
        if row.interval is None or row.std is None:
            return ("-",)
        digits = max(0, 1 - math.floor(math.log10(max(row.std, 1e-300))))
        return (f"{row.interval[0]:.{digits}f} to {row.interval[1]:.{digits}f}",)

    def _show_errors(self, to: Reporter) -> None:
        rows = []
        for kind, after in self.after.items():
            unit, before = figure_unit(self.machine, after), self.before[kind]
            held: tuple[str, ...] = ("", "")
            if not isinstance(self.held_out, str) and kind in self.held_out.after:
                figures = self.held_out.after[kind]
                held = (readable(figures.rms, unit), readable(figures.largest, unit))
            pairs = (before.rms, after.rms, before.largest, after.largest)
            criteria = (_criterion(f, unit.scale, unit.text) for f in (before, after))
            rows.append((kind, *(readable(x, unit) for x in pairs), *held, *criteria))
        headers = (
            "error", "rms before", "rms after", "max before", "max after", "held-out rms", "held-out max",
            "criterion before", "after",
        )  # fmt: skip
        to.table("Error", headers, rows)
        if self.started:
            to.say(f"no error before: {self.started} of {self.n_rows} rows cannot be predicted at the start")
        if len(self.slipped):
            to.say(f"without {count(len(self.slipped), 'row')} that only errors of the drives make predictable")
        if isinstance(self.held_out, str):
            to.say(f"no held-out error: {self.held_out}")
        else:
            to.say(f"held-out: {self.held_out.scheme}")
            if self.held_out.failed:
                to.warn(f"warning: {self.held_out.failed} of {self.held_out.folds} folds have not converged")

    def verdict(self) -> str:
        """How the fit ended, in words."""
        words = {
            "converged": "converged",
            "not_converged": "NOT CONVERGED: do not use these parameters",
            "nothing_identifiable": "NOTHING IDENTIFIABLE: these data determine none of the selected parameters",
        }
        chi2 = self.fit.chi2_per_dof
        tail = f", chi-square per degree of freedom {chi2:.3f} ({self.fit.dof} of them)" if self.fit.dof > 0 else ""
        hint = ""
        factor = float(np.sqrt(self.fit.found.spread))
        if self.fit.excess > 1 and self.audit.loss == "squares":
            hint = "\nmore is left than sigma explains: an effect is missing in the model, or sigma is too small; "
            hint += f"uncertainties are widened {factor:.3g} times"
        elif self.audit.loss != "squares":
            hint = f"\nrobust ({self.audit.loss}): uncertainties by the scatter of what is not off"
        if self.intervals.remark:
            hint += f"\n{self.intervals.remark}"
        return f"{words[self.fit.status]} in {self.fit.iterations} steps{tail}{hint}"

    def parameter_file(self, provenance: dict[str, Any]) -> str:
        """Text of the parameter file."""
        entries = [ParameterEntry(r.name, r.value, r.std, r.unit, r.identified, r.note) for r in self.rows]
        return dump_parameters(entries, _correlations(self.model, self.fit), provenance, self.model.fingerprint)


def _far(row: ParameterRow) -> bool:
    """Whether a value is further off than anybody believed."""
    return abs(row.value - row.nominal) > _FAR * row.range


def _criterion(figures: ErrorFigures, scale: float, unit: str) -> str:
    return "-" if np.isnan(figures.criterion) else f"{figures.criterion / scale**2:.4g} {unit}^2"


def _correlations(model: Model, fit: Fit) -> Correlations | None:
    """Of the selected parameters, what is held by its prior."""
    if not fit.selected:
        return None
    covariance = fit.found.determined_covariance()
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    scale = np.array([parameter_unit(model, n).scale for n in fit.selected])
    return Correlations(fit.selected, [float(v) for v in std / scale], (covariance / np.outer(std, std)).tolist())
