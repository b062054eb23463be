"""What `improve` writes: an overlay of the machine with what was accepted, and a parameter file."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.expected_noise import reported_noise
from pkmcal_cli.calibration.intervals import linear_intervals
from pkmcal_cli.diagnosis.closed_loop import Improvement
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.known_shapes import FitOfKnownShapes, fit_of_known_shapes
from pkmcal_cli.effects import effect_at
from pkmcal_cli.effects.unexplained import UNEXPLAINED
from pkmcal_cli.language.fingerprint import Fingerprint
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.loading.parameter_text import ParameterEntry, dump_parameters, scalar
from pkmcal_cli.report.diagnosis import DiagnosisReport
from pkmcal_cli.report.evidence import evidence_of
from pkmcal_cli.report.figures import error_lines
from pkmcal_cli.report.improved_machine import effect_key, null_lines, option_lines, validity
from pkmcal_cli.report.joint_uncertainty import correlations, data_lines
from pkmcal_cli.report.number_format import handy, uncertain, unit_of_size
from pkmcal_cli.report.parameters import is_weak, reasons_against
from pkmcal_cli.report.sentences import listed
from pkmcal_cli.report.shape_text import shape_lines
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.unit_text import Unit, parse_unit

_INSEPARABLE, _NONE = "the data cannot separate it from other parameters", "no effect was accepted."


class ImprovedFiles:
    """One run of the loop, ready to be written."""

    def __init__(self, machine: Machine, measured: Measurements, improvement: Improvement) -> None:
        self.machine, self.measured, self.improvement = machine, measured, improvement
        self.model = improvement.problem.model
        self.diagnosis = DiagnosisReport(machine, measured, improvement.whole)

    def overlay(self, base: str) -> str:
        """The text of the improved machine."""
        released = [h.at for h in self.improvement.accepted if h.effect == RELEASE]
        summary = "effects found in measurements. Review them before use." if self.improvement.accepted else _NONE
        lines = [f"# Written by `pkmcal improve`: {summary}"]
        if self.improvement.accepted and not self.improvement.confirmed:
            lines.append("# NOT CONFIRMED: rows used neither for fitting nor for selection are not predicted better.")
        lines.append(f"extends: {scalar(base)}")
        if released:
            lines.append("parameters:")
            lines += [f"  {name}: {{identify: true}}" for name in released]
        placed = [h for h in self.improvement.accepted if h.effect != RELEASE]
        if placed:
            lines.append("effects:")
            for h in placed:
                lines += [line for part in h.placed for line in self._effect_lines(h, part)]
        return "\n".join(lines) + "\n"

    def _effect_lines(self, hypothesis: Hypothesis, part: Hypothesis) -> list[str]:
        """An entry for one place of an accepted effect."""
        improvement = self.improvement
        step = next(s for s in improvement.steps if s.hypothesis == hypothesis)
        shapes = {s.hypothesis.name: s.evidence for s in improvement.whole.search.shapes}
        evidence = (improvement.whole.search.evidence | shapes)[hypothesis.name]
        named = {s.hypothesis.name: s.named for s in improvement.whole.shapes}
        cause = named.get(hypothesis.name)
        doubt = "PROVISIONAL, its cause is unknown; " if hypothesis.name in named and cause is None else ""
        doubt = "PROVISIONAL, an unknown effect remains; " if improvement.left else doubt
        remark = f"{doubt}log evidence {evidence:.1f}, selected in {step.chosen} of {improvement.rotations} rotations"
        if rivals := self.rivals(hypothesis):
            remark += f"; cannot be separated from {rivals}"
        title = _title(cause or hypothesis)
        lines = [
            f"  # {title}: {remark}{validity(self.model, improvement.problem.rows)}",
            f"  {effect_key(part)}:",
        ]
        if hypothesis.effect == UNEXPLAINED:
            shape = next(s for s in improvement.whole.search.shapes if s.hypothesis == hypothesis)
            return lines + shape_lines(self.machine, self.model, shape, improvement.fit, improvement.budget)
        for name in part.parameters:
            value, std = self.estimate(name)
            unit = self._unit(name)
            text = "" if unit.text == "1" else f" {unit.text}"
            more = "" if std is None else f", std: {std / unit.scale:.3g}{text}"
            if name not in (*improvement.fit.selected, *dict(hypothesis.known)):
                more += f", identify: false, note: {_INSEPARABLE}"
            lines.append(f"    {name.rpartition('.')[2]}: {{value: {unit.from_si(value):.8g}{text}{more}}}")
        return lines + null_lines(self.model, part) + option_lines(self.model, improvement.problem.rows, part)

    @cached_property
    def _std(self) -> Array:
        """Standard uncertainties (p,), SI, by noise, ranges and held parameters; nan where undetermined."""
        fit, names = self.improvement.fit, self.model.names
        return linear_intervals(fit, self.improvement.budget, np.array([names.index(n) for n in fit.selected])).std

    def estimate(self, name: str) -> tuple[float, float | None]:
        """Value and standard uncertainty, SI, of a parameter; None where it is not identified or determined."""
        fit = self.improvement.fit
        value = float(fit.values[self.model.names.index(name)])
        if name not in fit.selected:
            return value, None
        std = float(self._std[fit.selected.index(name)])
        stds = [s for f in self.improvement.whole.findings for n, s in zip(f.hypothesis.parameters, f.std) if n == name]
        std = max([std, *(s for s in stds if np.isfinite(s))])  # with what the effect's own discrepancy adds
        return value, std if np.isfinite(std) else None

    @cached_property
    def _written_fit(self) -> FitOfKnownShapes:
        """The fit with shapes as the machine file gives them: parameters are of that machine."""
        made = self.improvement
        return fit_of_known_shapes(made.problem, made.fit, made.budget)

    def parameter_file(self, provenance: dict[str, Any], fingerprint: Fingerprint) -> str:
        """Text of the parameter file of the improved machine: declared parameters and those of accepted effects."""
        made, last = self.improvement, self._written_fit
        fit, budget = last.fit, last.budget
        shapes = {n for shape in made.whole.search.shapes for n in shape.placed.parameters}
        effects = {n for e in self.model.effects for n in e.parameters} - set(fit.selected)
        entries, reasons = [], reasons_against(made.fit)
        for p in self.model.parameters:
            if p.name in effects:
                continue
            value, std = self._weight(p.name) if p.name in shapes else self.estimate(p.name)
            unit, reason = parse_unit(p.unit or "1"), reasons.get(p.name, "")
            shown, known = None if std is None else std / unit.scale, std is not None and not is_weak(reason)
            entries.append(ParameterEntry(p.name, unit.from_si(value), shown, p.unit, known, reason))
        noise = reported_noise([(fold.train, fold.fit, fold.report) for fold in made.after.folds])
        seen = evidence_of(made.problem, made.fit, made.after.report, fitted=False, noise=noise)
        rest = error_lines(self.machine, made.after.fit, made.after.report, made.fit.chi2_per_dof)
        rest += data_lines(self.model, last.problem, fit, budget, entries, effects)
        return dump_parameters(entries, correlations(self.model, budget), provenance, fingerprint, seen, rest)

    def _weight(self, name: str) -> tuple[float, float]:
        """A weight of a shape, and its standard uncertainty."""
        fit, budget = self._written_fit.fit, self._written_fit.budget
        return float(fit.values[self.model.names.index(name)]), float(budget.std[budget.names.index(name)])

    def _unit(self, parameter: str) -> Unit:
        return parse_unit(self.model.parameters[self.model.names.index(parameter)].unit or "1")

    def estimate_text(self, name: str) -> str:
        """An estimate with its uncertainty."""
        value, std = self.estimate(name)
        unit = unit_of_size(value, self._unit(name), self.diagnosis.file_units)
        if name not in self.improvement.fit.selected:
            known = {n for h in self.improvement.accepted for n, _ in h.known}
            return handy(value, unit) if name in known else f"held at {handy(value, unit)} ({_INSEPARABLE})"
        return uncertain(unit.from_si(value), None if std is None else std / unit.scale, unit.text)

    def rivals(self, hypothesis: Hypothesis) -> str:
        """Effects that explain all rows as well, with their weights."""
        finding = next((f for f in self.improvement.whole.findings if f.hypothesis == hypothesis), None)
        others = [] if finding is None else [r for r in finding.rivals if r.hypothesis != hypothesis]
        return listed([f"{r.hypothesis.name} ({100 * r.weight:.0f} %)" for r in others], 4)


def _title(hypothesis: Hypothesis) -> str:
    """What an effect is called."""
    effect = effect_at(hypothesis.effect, hypothesis.at)
    return hypothesis.effect if effect is None else effect.title
