"""The result of `improve`: steps, errors before and after, the overlay machine, JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.errors_before_after import ErrorFigures
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.improve import Improvement, Step
from pkmcal_cli.diagnosis.report_rows import Errors
from pkmcal_cli.diagnosis.search import MOST_EFFECTS
from pkmcal_cli.effects import catalogue
from pkmcal_cli.language.fingerprint import Fingerprint
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.loading.parameter_file import ParameterEntry, dump_parameters, scalar
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.diagnosis import DiagnosisReport
from pkmcal_cli.report.figures import figure_unit, figures_json
from pkmcal_cli.report.numbers import finite, handy, readable, uncertain
from pkmcal_cli.report.parameters import is_weak, reasons_against
from pkmcal_cli.report.sentences import listed
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.unit_text import Unit, parse_unit

_NOT_TOLD = "these data do not tell it from other parameters"
_NOTHING = {
    "clean": "nothing is left above noise",
    "sigma_too_small": "no effect is found, though more is left than the stated sigma explains",
}


class ImprovementReport:
    """One run of the loop, ready to be shown and written."""

    def __init__(self, machine: Machine, measured: Measurements, found: Improvement) -> None:
        self.machine, self.measured, self.found = machine, measured, found
        self.model = found.problem.model
        self.diagnosis = DiagnosisReport(machine, measured, found.whole)

    @property
    def verdict(self) -> str:
        """`clean` and `sigma_too_small` as the diagnosis says; else `improved`, or `not_confirmed`."""
        if self.found.whole.verdict in _NOTHING:
            return self.found.whole.verdict
        return "improved" if self.found.confirmed else "not_confirmed"

    # --- JSON ------------------------------------------------------------------------------
    def json(self, machine: str | None, parameters: str | None) -> dict[str, Any]:
        """The JSON result."""
        found, unit = self.found, self._length
        gain = found.rms_gain
        return {
            "verdict": self.verdict,
            "diagnosis": found.whole.verdict,
            "provisional": bool(found.whole.unknown),
            "rotations": found.rotations,
            "steps": [self._step_json(s) for s in found.steps],
            "before": figures_json(self.machine, found.before.report),
            "after": figures_json(self.machine, found.after.report),
            "channels_before": figures_json(self.machine, found.before.channels),
            "channels_after": figures_json(self.machine, found.after.channels),
            "chi2_before": finite(found.before.chi2),
            "chi2_after": finite(found.after.chi2),
            "improvement": {
                "value": finite(gain.value / unit.scale),
                "low": finite(gain.low / unit.scale),
                "high": finite(gain.high / unit.scale),
                "unit": unit.text,
            },
            "outliers": self.diagnosis.json()["outliers"],
            **self.diagnosis.failed.json(),
            "machine": machine,
            "parameters": parameters,
        }

    def _step_json(self, step: Step) -> dict[str, Any]:
        return {
            "effect": step.hypothesis.effect,
            "at": step.hypothesis.at,
            "accepted": step.accepted,
            "reason": step.refused or None,
            "chosen": step.chosen,
            "fit": self._rms_json(step.errors.fit),
            "choose": self._rms_json(step.errors.choose),
            "report": self._rms_json(step.errors.report),
        }

    def _rms_json(self, figures: dict[str, ErrorFigures]) -> dict[str, Any]:
        return {
            kind: {"rms": finite(f.rms / figure_unit(self.machine, f).scale), "unit": figure_unit(self.machine, f).text}
            for kind, f in figures.items()
        }

    # --- tables ----------------------------------------------------------------------------
    def show(self, to: Reporter) -> None:
        """What was tried, what it brought, what was not done."""
        found = self.found
        to.say(self.diagnosis.verdict_line())
        for row in found.whole.bad_rows:
            to.say(f"bad row: {self.measured.place(row)}: not used, neither to fit nor to report")
        self.diagnosis.failed.show(to)
        if found.steps:
            self._show_steps(to)
            self._show_errors(to)
            to.say()
        for hypothesis in found.accepted:
            sizes = ", ".join(f"{n} {self.estimate_text(n)}" for n in hypothesis.parameters)
            to.say(f"{'released' if hypothesis.effect == RELEASE else 'added'}: {sizes} (fitted to all rows)")
            if rivals := self._rivals(hypothesis):
                to.say(f"  these rows do not tell it from {rivals}; `pkmcal diagnose` says what would")
        for step in found.steps:
            if not step.accepted:
                to.say(f"not added: {step.hypothesis.name}: {step.refused}")
        for depends_on in dict.fromkeys(unknown.depends_on for unknown in found.whole.unknown):
            to.say(f"left as it is: something unknown that depends on {depends_on}; see `pkmcal diagnose`")
        for name, errors in (("before", found.before), ("after", found.after)):
            if errors.failed:
                to.warn(f"warning: {count(errors.failed, 'row')} that should report cannot be predicted {name}")
        to.say(f"stopped: {self._stop()}")
        to.say(self._summary())

    def _show_steps(self, to: Reporter) -> None:
        kinds = list(self.found.before.report)
        kind = "length" if "length" in kinds else kinds[0]
        rows = [("calibrated", *self._three(self.found.before, kind), "", "")]
        for step in self.found.steps:
            chosen = f"{step.chosen} of {self.found.rotations}"
            rows.append((f"+ {step.hypothesis.name}", *self._three(step.errors, kind), chosen, _added(step)))
        to.say()
        headers = ("effect", "rms fit", "rms choose", "rms report", "chosen", "")
        to.table(f"Steps ({kind})", headers, rows)

    def _three(self, errors: Errors, kind: str) -> tuple[str, str, str]:
        fit, choose, report = (readable(f[kind].rms, figure_unit(self.machine, f[kind])) for f in _parts(errors))
        return fit, choose, report

    def _show_errors(self, to: Reporter) -> None:
        before, after = self.found.before, self.found.after
        rows = [self._compared(kind, before.report[kind], new) for kind, new in after.report.items()]
        if len(after.channels) > 1:
            rows += [self._compared(f"  {name}", before.channels[name], new) for name, new in after.channels.items()]
        rows.append(
            ("chi-square per value", f"{self.found.before.chi2:.3g}", f"{self.found.after.chi2:.3g}", "", "", "", "")
        )
        to.say()
        headers = ("error", "rms before", "rms after", "max before", "max after", "criterion before", "criterion after")
        to.table("On rows that neither fitted nor chose", headers, rows)

    def _rivals(self, hypothesis: Hypothesis) -> str:
        """Effects that explain all rows as well, with their weights."""
        found = next((f for f in self.found.whole.findings if f.hypothesis == hypothesis), None)
        others = [] if found is None else [r for r in found.rivals if r.hypothesis != hypothesis]
        return listed([f"{r.hypothesis.name} ({100 * r.weight:.0f} %)" for r in others], 4)

    def _compared(self, name: str, old: ErrorFigures, new: ErrorFigures) -> tuple[str, ...]:
        """A line of the table before and after."""
        unit = figure_unit(self.machine, new)
        numbers = (old.rms, new.rms, old.largest, new.largest)
        squares = (f"{f.criterion / unit.scale**2:.4g} {unit.text}^2" for f in (old, new))
        return (name, *(readable(x, unit) for x in numbers), *squares)

    def _stop(self) -> str:
        """Why no further effect was tried."""
        if self.found.broken is not None:
            return "the next step broke off; what was done before it stands"
        if len(self.found.whole.search.accepted) >= MOST_EFFECTS:
            return f"{MOST_EFFECTS} effects; more of them would be a list, not a cause"
        alpha = f"{100 * self.found.alpha:g} %"
        return f"no further effect is significant at a false-alarm rate of {alpha} of the whole diagnosis"

    def _summary(self) -> str:
        found = self.found
        if found.whole.verdict in _NOTHING:
            return f"nothing to improve: {_NOTHING[found.whole.verdict]}"
        gain = found.rms_gain
        most = max(abs(gain.low), abs(gain.high))
        value, low, high = (readable(x, self._length, like=most) for x in (gain.value, gain.low, gain.high))
        interval = f"position rms falls by {value}, 95 % interval {low} to {high}"
        if not found.confirmed:
            why = f" ({interval})" if found.accepted else ""
            return f"NOT IMPROVED: no effect is confirmed by rows that neither fitted nor chose{why}"
        names = ", ".join(h.name for h in found.accepted)
        doubt = "; provisional: something unknown is left, which they may stand in for" if found.whole.unknown else ""
        return f"improved by {names}: {interval}{doubt}"

    # --- files -----------------------------------------------------------------------------
    def overlay(self, base: str) -> str:
        """The text of the improved machine."""
        released = [h.at for h in self.found.accepted if h.effect == RELEASE]
        lines = ["# Written by `pkmcal improve`: effects found in measurements, to be reviewed."]
        lines.append(f"extends: {scalar(base)}")
        if released:
            lines.append("parameters:")
            lines += [f"  {name}: {{identify: true}}" for name in released]
        placed = [h for h in self.found.accepted if h.effect != RELEASE]
        if placed:
            lines.append("effects:")
            for h in placed:
                lines += self._effect_lines(h)
        return "\n".join(lines) + "\n"

    def _effect_lines(self, hypothesis: Hypothesis) -> list[str]:
        step = next(s for s in self.found.steps if s.hypothesis == hypothesis)
        evidence = self.found.whole.search.evidence.get(hypothesis.name, float("nan"))
        doubt = "PROVISIONAL, something unknown is left; " if self.found.whole.unknown else ""
        remark = f"{doubt}log evidence {evidence:.1f}, chosen in {step.chosen} of {self.found.rotations} rotations"
        if rivals := self._rivals(hypothesis):
            remark += f"; not told from {rivals}"
        lines = [f"  # {catalogue()[hypothesis.effect].title}: {remark}{self._validity()}", f"  {hypothesis.name}:"]
        for name in hypothesis.parameters:
            value, std = self._estimate(name)
            unit = self._unit(name)
            text = "" if unit.text == "1" else f" {unit.text}"
            more = "" if std is None else f", std: {std / unit.scale:.3g}{text}"
            more += "" if name in self.found.fit.selected else f", identify: false, note: {_NOT_TOLD}"
            lines.append(f"    {name.rpartition('.')[2]}: {{value: {unit.from_si(value):.8g}{text}{more}}}")
        return lines + self._option_lines(hypothesis)

    def _option_lines(self, hypothesis: Hypothesis) -> list[str]:
        """Constants that the table decided, so that other tables see the same effect."""
        from pkmcal_cli.prediction import settled_options

        placed = next(e for e in self.model.effects if e.name == hypothesis.name)
        out = []
        for name, (values, unit) in settled_options(self.model, placed, self.found.problem.rows).items():
            shown = ", ".join(f"{parse_unit(unit).from_si(v):.8g} {unit}" for v in values)
            out.append(f"    {name}: " + (f"[{shown}]" if len(values) > 1 else shown))
        return out

    def _validity(self) -> str:
        """Range of the table: travel of the drives, temperatures that were logged."""
        rows, out = self.found.problem.rows, []
        for a, actuator in enumerate(self.model.actuators):
            unit, travel = parse_unit(actuator.unit), rows.readings[:, a]
            if np.isfinite(travel).all():
                low, high = unit.from_si(float(travel.min())), unit.from_si(float(travel.max()))
                out.append(f"{actuator.name} {low:.6g} to {high:.6g} {unit.text}")
        for name, warm in rows.columns.items():
            if (name == "T" or name.startswith("T.")) and np.isfinite(warm).all():
                out.append(f"{name} {warm.min() - 273.15:.1f} to {warm.max() - 273.15:.1f} degC")
        return f"; valid for {', '.join(out)}" if out else ""

    def _estimate(self, name: str) -> tuple[float, float | None]:
        fit = self.found.fit
        value = float(fit.values[self.model.names.index(name)])
        if name not in fit.selected:
            return value, None
        std = float(fit.std[fit.selected.index(name)]) * float(np.sqrt(self.found.whole.scale.variance))
        told = [s for f in self.found.whole.findings for n, s in zip(f.hypothesis.parameters, f.std) if n == name]
        std = max([std, *(s for s in told if np.isfinite(s))])  # with what the effect's own shape adds
        return value, std if np.isfinite(std) else None

    def parameter_file(self, provenance: dict[str, Any], fingerprint: Fingerprint) -> str:
        """Text of the parameter file of the improved machine: declared parameters and those of accepted effects."""
        fit = self.found.fit
        effects = {n for e in self.model.effects for n in e.parameters} - set(fit.selected)
        entries, reasons = [], reasons_against(fit)
        for p in self.model.parameters:
            if p.name in effects:
                continue
            value, std = self._estimate(p.name)
            unit, reason = parse_unit(p.unit or "1"), reasons.get(p.name, "")
            shown = None if std is None else std / unit.scale
            identified = std is not None and not is_weak(reason)
            entries.append(ParameterEntry(p.name, unit.from_si(value), shown, p.unit, identified, reason))
        return dump_parameters(entries, None, provenance, fingerprint)

    @property
    def _length(self) -> Unit:
        return self.machine.file_units.length

    def _unit(self, parameter: str) -> Unit:
        return parse_unit(self.model.parameters[self.model.names.index(parameter)].unit or "1")

    def estimate_text(self, name: str) -> str:
        """An estimate with its uncertainty."""
        value, std = self._estimate(name)
        unit = self._unit(name)
        if name not in self.found.fit.selected:
            return f"held at {handy(value, unit)} ({_NOT_TOLD})"
        return uncertain(unit.from_si(value), None if std is None else std / unit.scale, unit.text)


def _parts(errors: Errors) -> tuple[dict[str, ErrorFigures], ...]:
    return errors.fit, errors.choose, errors.report


def _added(step: Step) -> str:
    return "added" if step.accepted else "not added"
