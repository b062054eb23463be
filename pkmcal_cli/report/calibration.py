"""The result of `calibrate`: JSON, tables, parameter file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

from pkmcal_cli.base.plural import count, listed
from pkmcal_cli.calibration.complete_fit import Calibration
from pkmcal_cli.calibration.errors_before_after import error_figures
from pkmcal_cli.calibration.holdout import HeldOut
from pkmcal_cli.calibration.identifiability import Combination, combinations
from pkmcal_cli.calibration.plausible import USABLE, implausible_fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_check import range_check
from pkmcal_cli.calibration.replicates import replicate_noise
from pkmcal_cli.calibration.residual import lost_rows
from pkmcal_cli.calibration.unexplained import unexplained
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.loading.parameter_text import ParameterEntry, dump_parameters
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.report.audit import Audit
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.effect_signs import sign_text
from pkmcal_cli.report.evidence import evidence_of
from pkmcal_cli.report.failed_rows import FailedRows
from pkmcal_cli.report.figures import criterion_text, error_lines, figure_unit, figures_json, kind_label
from pkmcal_cli.report.heldout_json import heldout_json
from pkmcal_cli.report.joint_uncertainty import correlations, data_lines
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.number_format import finite, nominal_number, readable, uncertain, unknown
from pkmcal_cli.report.odd_readings import OddReadings
from pkmcal_cli.report.parameters import (
    NO_EFFECT,
    ParameterRow,
    combination_json,
    combination_text,
    parameter_rows,
)
from pkmcal_cli.report.repeatability import show_replicates
from pkmcal_cli.report.sentences import ending_text
from pkmcal_cli.report.session_frames import show_session_frames
from pkmcal_cli.report.uncertainty_remarks import (
    HELD,
    held_text,
    noise_text,
    ranges_text,
    residuals_text,
    uncertainty_json,
)

_WEAK, _MEMBERS = 3, 8  # weak combinations that are told one by one, if they have so few members
_SILENT = 3  # parameters without effect that are told one by one
_WORTH = 0.3  # share of the uncertainty by data from which on what is held has a column


class CalibrationReport:
    """One calibration, ready to be shown."""

    def __init__(
        self,
        machine: Machine,
        problem: Problem,
        calibration: Calibration,
        held_out: HeldOut | str,
        row_origin: Callable[[int], RowOrigin],
        odd: OddReadings,
        *,
        mistakes: tuple[str, ...] = (),
        accepted: bool = False,
    ) -> None:
        fit, intervals = calibration.robust.fit, calibration.intervals
        self.calibration, self.odd = calibration, odd
        self.machine, self.model, self.fit, self.held_out = machine, problem.model, fit, held_out
        self.audit, self.intervals = Audit(problem.model, calibration.robust, row_origin), intervals
        problem = problem.without(fit.failed)
        self.budget, self.ranges = calibration.budget, range_check(problem, fit, calibration.budget)
        self.problem = problem
        self.weighed = replace(problem, weight=calibration.robust.problem.weight)
        implausible = (*mistakes, *implausible_fit(self.weighed, fit, self.ranges))
        self.implausible = implausible if fit.status == "converged" else ()
        more = unexplained(fit, self.budget, calibration.robust)
        beyond = odd.texts if calibration.robust.loss == "squares" else ()  # a robust loss does without them
        reasons = (*(each.text for each in more), *beyond)
        self.incomplete = reasons if fit.status == "converged" and not self.implausible else ()
        self.word = "accepted" if accepted and self.implausible else self.status
        self.rows = parameter_rows(self.model, fit, intervals, self.budget, self.ranges.far, calibration.frames)
        self.failed = FailedRows(fit.failed, row_origin, len(problem))
        self.slipped = lost_rows(problem, fit.after)  # predicted only with errors of the drives: no error is told
        without_slips = problem.without(self.slipped)
        self.before, self.after = error_figures(without_slips, fit.before), error_figures(without_slips, fit.after)
        self.started = len(lost_rows(without_slips, fit.before))
        self.loads = Loads.of_fit(problem, fit, row_origin)
        self.n_rows, self.replicates = len(problem), replicate_noise(problem, fit)

    @property
    def status(self) -> str:
        """How the fit ended; "implausible" where it should not be believed all the same, "incomplete" where it leaves
        more than noise."""
        return "implausible" if self.implausible else "incomplete" if self.incomplete else self.fit.status

    @property
    def usable(self) -> bool:
        """Whether the parameters can be used."""
        return self.status in USABLE

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        directions = self.fit.directions
        return {
            "status": self.status,
            "implausible": list(self.implausible),
            "incomplete": list(self.incomplete),
            "n_rows": self.n_rows,
            **self.failed.json(),
            "loads": self.loads.json(),
            "iterations": self.fit.iterations,
            "stopped": self.fit.stopped,
            "parameters": [r.json() for r in self.rows if r.selected],
            "before": figures_json(self.machine, self.before),
            "after": figures_json(self.machine, self.after),
            "chi2": finite(self.fit.chi2),
            "degrees_of_freedom": self.fit.dof,
            "chi2_per_dof": finite(self.fit.chi2_per_dof),
            "uncertainty": uncertainty_json(self.fit, self.budget, self.ranges, self.intervals)
            | {"overstated": dict(self.odd.overstated)},
            **({"outliers": self.audit.json()} | self.odd.json()),
            "datum": None if self.calibration.datum is None else list(self.calibration.datum.held),
            "gauge": [] if self.calibration.datum is None else list(self.calibration.datum.gauge.motions),
            "starts": None if self.calibration.agreement is None else asdict(self.calibration.agreement),
            "replicates": [noise.json() for noise in self.replicates],
            "heldout": heldout_json(self.machine, self.held_out),
            "condition_number": finite(self.ranges.declared.condition_number),
            "rank": self.ranges.declared.rank,
            "undetermined": [
                each
                for c in combinations(directions)
                for each in combination_json(self.model, c, self.fit, self.budget.covariance)
            ],
        }

    def show(self, to: Reporter) -> None:
        """Tables for people."""
        to.say(self.verdict())
        to.say()
        if not self.fit.abandoned:
            self._show_identified(to)
        self._show_errors(to)
        self.failed.show(to)
        self.loads.show(to)
        if self.fit.kinked:
            rows = f"{len(self.fit.kinked)} of {count(self.n_rows, 'row')}"
            to.warn(f"warning: in {rows} a rope is taut or slack (within 2 std): the intervals do not hold")
        self.audit.show(to, named=len(self.odd.rows))
        show_replicates(to, self.replicates)

    def _show_identified(self, to: Reporter) -> None:
        """Parameters, what of them the data do not determine, how far they are from nominal; then an empty line."""
        selected = [r for r in self.rows if r.selected]
        self._show_parameters(to, selected)
        std = dict(zip(self.fit.selected, self.budget.std.tolist(), strict=True))
        for name, value in zip(self.model.names, self.fit.values, strict=True):
            if text := sign_text(self.model, name, float(value), std.get(name)):
                to.notes([text])
        every = combinations(self.fit.directions)
        self._show_null(to, [c for c in every if c.kind == "null"])
        self._show_weak(to, [c for c in every if c.kind == "weak"])
        if self._held_head:
            to.say(held_text(self.budget))
        if self.ranges.doubtful:
            to.say(ranges_text(self.ranges))
        if far := [r for r in selected if r.far]:
            hint = "check for a wrong unit, a missing effect or a local minimum (`--starts 10` tries other starts)"
            where = self.machine.source.fault("", "", ("parameters", far[0].name), at_key=True).where
            to.warn(f"warning: far from nominal (in ranges): {', '.join(r.in_ranges for r in far)}; {hint}", where)
        to.say()

    def _show_parameters(self, to: Reporter, selected: list[ParameterRow]) -> None:
        """Parameters of the machine; apart from them where its instruments stand, for which no drawing has a value."""
        frames, many = tuple(f"frame@{name}." for name in self.model.fitted_frames), self.calibration.frames
        machine_rows = [r for r in selected if not r.name.startswith(frames)]
        stand = [r for r in selected if r.name.startswith(frames) and r.name not in many]
        stand = [r for r in stand if r.reason != NO_EFFECT] or stand  # in sessions that it did not read
        more = (*self._held_head, *self._interval_head)
        if machine_rows or not stand:
            heads = ("name", "nominal", "identified", *more, "range", "remark")
            to.table("Parameters", heads, [self._row(r) for r in machine_rows])
        if stand:
            cells = [self._row(r) for r in stand]
            to.table("Fitted frames", ("name", "fitted", *more, "remark"), [(c[0], *c[2:-2], c[-1]) for c in cells])
        show_session_frames(to, self.model, [r for r in selected if r.name in many])

    def _show_null(self, to: Reporter, null: list[Combination]) -> None:
        """What the data do not determine; of many that have no effect, one line."""
        silent = [c.names[0] for c in null if len(c.names) == 1]
        if len(silent) > _SILENT:
            to.say(f"undetermined: {listed(silent, _SILENT)} have no effect on these readings")
            null = [c for c in null if len(c.names) > 1]
        for c in null:
            to.say("undetermined: " + combination_text(self.model, c, self.fit, self.budget.covariance))

    def _show_weak(self, to: Reporter, weak: list[Combination]) -> None:
        """What is held about nominal."""
        short = [c for c in weak if len(c.names) <= _MEMBERS][:_WEAK]
        for c in short:
            to.say(f"weak: {combination_text(self.model, c)}")
        if weak:
            more = " (see `pkmcal observability`)" if len(weak) > len(short) else ""
            held = count(len(weak), "weak combination")
            to.say(f"{held} held near nominal; the uncertainties include the ranges{more}")

    def _row(self, r: ParameterRow) -> tuple[str, ...]:
        known = r.by_data is not None
        value = uncertain(r.value, r.by_data, r.unit) if known else unknown(r.value, r.range, r.unit)
        nominal = nominal_number(r.nominal, r.range)
        return r.name, nominal, value, *self._held(r), *self._ends(r), r.spread, r.reason or ""

    @property
    def _held_head(self) -> tuple[str, ...]:
        """A column for what parameters that are not identified add, where it is worth one."""
        split = [r for r in self.rows if r.by_data is not None and r.by_held is not None]
        return (HELD,) if any(r.by_held > _WORTH * r.by_data for r in split) else ()  # type: ignore[operator]

    def _held(self, row: ParameterRow) -> tuple[str, ...]:
        if not self._held_head:
            return ()
        unit = "" if row.unit == "1" else f" {row.unit}"
        return ("-" if row.by_held is None else f"{float(f'{row.by_held:.2g}'):.6g}{unit}",)

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
            criteria = (criterion_text(f, unit) for f in (before, after))
            label = kind_label(self.model, kind)
            rows.append((label, *(readable(x, unit) for x in pairs), *held, *criteria))
        headers = (
            "error", "rms before", "rms after", "max before", "max after", "held-out rms", "held-out max",
            "criterion before", "criterion after",
        )  # fmt: skip
        to.table("Error", headers, rows, spare=("criterion before", "criterion after"))
        if self.started:
            lost = f"{self.started} of {self.n_rows} rows"
            to.say(f"error before: not available; {lost} cannot be predicted at the start")
        if len(self.slipped):
            to.say(f"errors without {count(len(self.slipped), 'row')} that can be predicted only with drive errors")
        if isinstance(self.held_out, str):
            to.say(f"held-out error: not available ({self.held_out})")
        else:
            to.say(f"held-out error: {self.held_out.scheme}")
            if self.held_out.failed:
                to.warn(f"warning: {self.held_out.failed} of {self.held_out.folds} folds did not converge")

    def verdict(self) -> str:
        """How the fit ended, in words; then the reasons, one in a line."""
        lines = [ending_text(self.word, self.fit.stopped, self.fit.iterations)]
        if self.fit.abandoned:
            return lines[0]
        several = len(self.budget.instruments) > 1
        lines += [f"because: {reason}" for reason in (*self.implausible, *(self.incomplete if several else ()))]
        if self.fit.dof > 0:
            freedom = count(self.fit.dof, "degree")
            lines.append(f"chi-square per degree of freedom: {self.fit.chi2_per_dof:.3f} ({freedom} of freedom)")
        if self.audit.loss == "squares":
            lines += residuals_text(self.fit, self.budget, self.problem, self.replicates)
            lines += [noise] if (noise := noise_text(self.budget)) else []
        else:
            lines.append(f"robust fit ({self.audit.loss}): uncertainties from the scatter without outliers")
        return "\n".join([*lines, self.intervals.remark] if self.intervals.remark else lines)

    def parameter_file(self, provenance: dict[str, Any]) -> str:
        """Text of the parameter file."""
        entries = [ParameterEntry(r.name, r.value, r.std, r.unit, r.identified, r.note) for r in self.rows]
        apart = None if isinstance(self.held_out, str) else self.held_out
        errors, noise = (self.after, None) if apart is None else (apart.after, apart.noise)
        seen = evidence_of(self.problem, self.fit, errors, apart is None, noise)
        rest = error_lines(self.machine, self.after, None if apart is None else errors, self.fit.chi2_per_dof)
        rest += data_lines(self.model, self.weighed, self.fit, self.budget, entries)
        joint = correlations(self.model, self.budget)
        return dump_parameters(entries, joint, provenance, self.model.fingerprint, seen, rest)
