"""The result of `improve`: steps, errors before and after, the overlay machine, JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.errors_before_after import ErrorFigures
from pkmcal_cli.diagnosis.closed_loop import Step
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.report_rows import Errors, Interval
from pkmcal_cli.diagnosis.search import MOST_EFFECTS
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.figures import figure_unit, figures_json, kind_label, unit_of
from pkmcal_cli.report.improved_files import ImprovedFiles
from pkmcal_cli.report.number_format import finite, readable, to_digits
from pkmcal_cli.report.sentences import listed, no_cause, tested_alone
from pkmcal_cli.report.shape_text import ShapeText
from pkmcal_cli.units.unit_text import Unit

_NOTHING = ("clean", "sigma_too_small")
_EXCEED = "no effect found, although the residuals exceed the stated noise"


class ImprovementReport(ImprovedFiles):
    """One run of the loop, ready to be shown and written."""

    @property
    def verdict(self) -> str:
        """`clean` and `sigma_too_small` as the diagnosis says; else `improved`, or `not_confirmed`."""
        if self.improvement.whole.verdict in _NOTHING:
            return self.improvement.whole.verdict
        return "improved" if self.improvement.confirmed else "not_confirmed"

    # --- JSON ------------------------------------------------------------------------------
    def json(self, machine: str | None, parameters: str | None) -> dict[str, Any]:
        """The JSON result."""
        improvement, unit = self.improvement, self._error_unit
        gain, diagnosis = improvement.rms_gain, self.diagnosis.json()
        return {
            "verdict": self.verdict,
            "diagnosis": improvement.whole.verdict,
            "provisional": bool(improvement.whole.unknown) or any(f.provisional for f in improvement.whole.findings),
            "rotations": improvement.rotations,
            "only": list(self.diagnosis.only or ()),
            "steps": [self._step_json(s) for s in improvement.steps],
            "before": figures_json(self.machine, improvement.before.report),
            "after": figures_json(self.machine, improvement.after.report),
            "channels_before": figures_json(self.machine, improvement.before.channels),
            "channels_after": figures_json(self.machine, improvement.after.channels),
            "chi2_before": finite(improvement.before.chi2),
            "chi2_after": finite(improvement.after.chi2),
            "improvement": {
                "value": finite(gain.value / unit.scale),
                "low": finite(gain.low / unit.scale),
                "high": finite(gain.high / unit.scale),
                "unit": unit.text,
                "kind": improvement.shown.name,
            },
            **{key: diagnosis[key] for key in ("outliers", "bench", "down_weighted")},
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
            "confirmed": step.confirmed,
            "fit": self._rms_json(step.errors.fit),
            "choose": self._rms_json(step.errors.choose),
            "report": self._rms_json(step.errors.report),
        }

    def _rms_json(self, figures: dict[str, ErrorFigures]) -> dict[str, Any]:
        return {
            kind: {"rms": finite(f.rms / figure_unit(self.machine, f).scale), "unit": figure_unit(self.machine, f).text}
            for kind, f in figures.items()
        }

    def files_text(self, machine: str, parameters: str, base: str) -> str:
        """What was written: the machine, an overlay of `base`, and its parameters."""
        if self.improvement.accepted:
            return f"written: {machine} (effects, an overlay of {base}), {parameters} (parameters)"
        unchanged = f"no effect was accepted: the machine in {machine} is that of {base}, unchanged"
        return f"{unchanged}\nwritten: {machine} (refers to {base}), {parameters} (parameters)"

    # --- tables ----------------------------------------------------------------------------
    def show(self, to: Reporter) -> None:
        """What was tried, what it brought, what was not done."""
        improvement = self.improvement
        to.say(self.summary)
        to.say()
        to.say(self.diagnosis.verdict_line())
        self.diagnosis.show_readings(to)
        self.diagnosis.show_rows(to, "used neither for fitting nor for reporting")
        self.diagnosis.show_left_out(to)
        if improvement.steps:
            self._show_steps(to)
            self._show_errors(to)
            to.say()
        for hypothesis in improvement.accepted:
            verb = "released" if hypothesis.effect == RELEASE else "added"
            to.say(f"{verb}: {self._sizes(hypothesis)} (fitted to all rows)")
            if rivals := self.rivals(hypothesis):
                to.say(f"  cannot be separated from {rivals}; `pkmcal diagnose` names the points that separate them")
        for step in improvement.steps:
            if not step.accepted:
                to.say(f"not added: {step.hypothesis.name}: {step.refused}")
            elif not step.confirmed:
                to.say(f"not confirmed: {step.hypothesis.name}: the error on the report rows hardly falls by it")
        for depends_on in dict.fromkeys(unknown.depends_on for unknown in improvement.left):
            to.say(f"not modelled: an unknown effect that depends on {depends_on}; see `pkmcal diagnose`")
        for name, errors in (("before", improvement.before), ("after", improvement.after)):
            if errors.failed:
                to.warn(f"warning: {name} the improvement, {count(errors.failed, 'report row')} cannot be predicted")
        to.say(f"stopped: {self._stop()}")

    def _sizes(self, hypothesis: Hypothesis) -> str:
        """The numbers of an accepted effect; of a curve where it is highest and lowest."""
        for shape in self.improvement.whole.shapes:
            if shape.hypothesis == hypothesis:
                text = ShapeText(self.machine, self.model, shape, self.diagnosis.error_unit)
                return f"{hypothesis.name} {text.size()}"
        return ", ".join(f"{n} {self.estimate_text(n)}" for n in hypothesis.parameters)

    def _show_steps(self, to: Reporter) -> None:
        kind = self.improvement.shown.name
        to.say()
        headers = ("effect", "rms fit", "rms selection", "rms report", "selected", "")
        to.table(f"Steps ({kind})", headers, self._step_rows(kind))

    def _step_rows(self, kind: str) -> Iterator[tuple[str, ...]]:
        """Lines of the table, made as they are shown: errors on the rows that chose take fits."""
        yield ("calibrated", *self._three(self.improvement.before, kind), "", "")
        for step in self.improvement.steps:
            chosen = f"{step.chosen} of {self.improvement.rotations}"
            yield (f"+ {step.hypothesis.name}", *self._three(step.errors, kind), chosen, _added(step))

    def _three(self, errors: Errors, kind: str) -> tuple[str, str, str]:
        fit, choose, report = (self._rms(f.get(kind)) for f in _parts(errors))
        return fit, choose, report

    def _rms(self, figures: ErrorFigures | None) -> str:
        """One error; a dash where the rows have none of its kind."""
        return "-" if figures is None else readable(figures.rms, figure_unit(self.machine, figures))

    @property
    def _error_unit(self) -> Unit:
        """Unit of the errors by which the improvement is told."""
        return unit_of(self.machine, self.model.channels[self.improvement.shown.channels[0]].dimension)

    def _show_errors(self, to: Reporter) -> None:
        before, after = self.improvement.before, self.improvement.after
        kinds = after.report.items()
        rows = [self._compared(kind_label(self.model, kind), before.report[kind], new) for kind, new in kinds]
        if len(after.channels) > 1:
            rows += [self._compared(f"  {name}", before.channels[name], new) for name, new in after.channels.items()]
        rows.append(
            (
                "chi-square per value",
                f"{self.improvement.before.chi2:.3g}",
                f"{self.improvement.after.chi2:.3g}",
                "",
                "",
                "",
                "",
            )
        )
        to.say()
        headers = ("error", "rms before", "rms after", "max before", "max after", "criterion before", "criterion after")
        title = "Errors on rows used neither for fitting nor for selection"
        to.table(title, headers, rows, spare=("criterion before", "criterion after"))

    def _compared(self, name: str, old: ErrorFigures, new: ErrorFigures) -> tuple[str, ...]:
        """A line of the table before and after."""
        unit = figure_unit(self.machine, new)
        numbers = (old.rms, new.rms, old.largest, new.largest)
        squares = (f"{to_digits(f.criterion / unit.scale**2, 4)} {unit.text}^2" for f in (old, new))
        return (name, *(readable(x, unit) for x in numbers), *squares)

    def _stop(self) -> str:
        """Why no further effect was tried."""
        if self.improvement.broken is not None:
            return "the next step failed; the earlier steps are kept"
        if len(self.improvement.whole.search.accepted) >= MOST_EFFECTS:
            return f"limit of {MOST_EFFECTS} effects reached"
        alpha = f"{100 * self.improvement.alpha:g} %"
        only = tested_alone(self.diagnosis.only)
        return f"no further effect is significant{only} (false-alarm rate of the whole diagnosis: {alpha})"

    @property
    def summary(self) -> str:
        """What the loop has come to."""
        improvement = self.improvement
        only = tested_alone(self.diagnosis.only)
        if improvement.whole.verdict in _NOTHING:
            lead = "not improved" if only and improvement.whole.verdict != "clean" else "nothing to improve"
            clean = improvement.whole.verdict == "clean"
            return f"{lead}: {no_cause(improvement.whole.p_global) if clean else _EXCEED}{only}"
        shown = improvement.shown
        kind = "" if shown.alone and shown.name != "position" else f"{shown.name} "
        interval = f"{kind}rms {rms_change(improvement.rms_gain, self._error_unit)}"
        if not improvement.confirmed:
            why = f"\n{interval}" if improvement.accepted else ""
            return f"NOT IMPROVED: no effect is confirmed by rows used neither for fitting nor for selection{only}{why}"
        shapes = {s.hypothesis: f" ({s.named.name})" for s in improvement.whole.shapes if s.named is not None}
        names = ", ".join(f"{h.name}{shapes.get(h, '')}" for h in improvement.accepted)
        return f"improved by {names}{self._doubt()}\n{interval}"

    def _doubt(self) -> str:
        """Why what was added is provisional: something else may be behind it, or its cause is unknown."""
        depends = listed(list(dict.fromkeys(u.depends_on for u in self.improvement.left)), 3)
        if depends:
            return f"; provisional: an unknown effect that depends on {depends} may be the true cause"
        shapes = [s.hypothesis.name for s in self.improvement.whole.shapes if s.named is None]
        return f"; provisional: the cause of {listed(shapes, 3)} is unknown" if shapes else ""


def _parts(errors: Errors) -> tuple[dict[str, ErrorFigures], ...]:
    return errors.fit, errors.choose, errors.report


def _added(step: Step) -> str:
    return "added" if step.accepted else "not added"


def rms_change(gain: Interval, unit: Unit) -> str:
    """Whether an rms falls or rises, by how much, and the interval of that; gain: by what it falls, SI."""
    most = max(abs(gain.low), abs(gain.high))
    falls = gain.value >= 0
    ends = (gain.value, gain.low, gain.high) if falls else (-gain.value, -gain.high, -gain.low)
    value, low, high = (readable(x, unit, like=most) for x in ends)
    return f"{'falls' if falls else 'rises'} by {value}, 95 % interval: {low} to {high}"
