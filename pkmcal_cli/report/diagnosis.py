"""The result of `diagnose`: verdict, table of causes, a sentence for each, what could not be seen; JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pkmcal_cli.diagnosis.diagnose import Diagnosis, Finding, Invisible
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.effects import catalogue
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.unit_text import Unit, parse_unit
from pkmcal_cli.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.numbers import finite, readable, uncertain
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.words import count

_SHOWN = 12
_CLEAR, _OVERWHELMING = 3.0, 10.0  # log Bayes factors


class DiagnosisReport:
    """One diagnosis, ready to be shown. `measured`: the table, for the places of its rows."""

    def __init__(self, machine: Machine, measured: Measurements, found: Diagnosis) -> None:
        self.machine, self.measured, self.found = machine, measured, found
        self.model: Model = found.problem.model

    # --- JSON ------------------------------------------------------------------------------
    def json(self) -> dict[str, Any]:
        """The JSON result."""
        found = self.found
        return {
            "verdict": found.verdict,
            "sigma": "estimated" if found.scale.variance > 1.0 else "stated",
            "sigma_factor": float(np.sqrt(found.scale.variance)),
            "chi2_per_dof_before": finite(found.before.chi2_per_dof),
            "chi2_per_dof_after": finite(found.search.fit.chi2_per_dof),
            "p_value": finite(found.p_global),
            "effects": [self._finding_json(f) for f in found.findings],
            "outliers": [self._row_json(row) for row in found.bad_rows],
            "unknown": [self._unknown_json(u) for u in found.unknown],
            "not_testable": [{"effect": name, "needs": needs} for name, needs in found.not_testable],
            "invisible": [self._invisible_json(i) for i in found.invisible],
            "same_as": [
                {"effect": name, "parameter": other.removeprefix(f"{RELEASE} ")} for name, other in found.same.items()
            ],
            "effective_tests": finite(found.search.tests),
            "seed": found.seed,
        }

    def _finding_json(self, finding: Finding) -> dict[str, Any]:
        h, unit = finding.hypothesis, self._length_unit
        return {
            "effect": h.effect,
            "at": h.at,
            "parameters": [self._parameter_json(finding, k) for k in range(len(h.parameters))],
            "evidence": finite(finding.evidence),
            "p_value": finite(finding.p_value),
            "share": finite(finding.share),
            "credible_set": [
                {"effect": r.hypothesis.effect, "at": r.hypothesis.at, "weight": r.weight, "cosine": r.cosine}
                for r in finding.rivals
            ],
            "heldout_rms": finite(finding.held_out.with_it / unit.scale),
            "heldout_rms_without": finite(finding.held_out.without / unit.scale),
            "unit": unit.text,
            "confirmed": finding.held_out.confirmed,
            "provisional": finding.provisional,
        }

    def _parameter_json(self, finding: Finding, k: int) -> dict[str, Any]:
        name = finding.hypothesis.parameters[k]
        unit = self._unit(name)
        scale = unit.scale
        value = unit.from_si(finding.estimate[k])
        return {"name": name, "value": finite(value), "std": finite(finding.std[k] / scale), "unit": unit.text}

    def _row_json(self, row: int) -> dict[str, Any]:
        m = self.measured
        return {"file": m.files[m.file_index[row]], "line": int(m.line[row]), "id": m.ids[row] or None}

    def _unknown_json(self, unknown: Unknown) -> dict[str, Any]:
        unit = self._length_unit
        size = unknown.rms * self._sigma / unit.scale
        return {
            "depends_on": unknown.depends_on,
            "rms": finite(size),
            "unit": unit.text,
            "p_value": finite(unknown.p_value),
            "hint": unknown.hint or None,
        }

    def _invisible_json(self, hidden: Invisible) -> dict[str, Any]:
        unit = self._unit(hidden.parameter)
        return {
            "effect": hidden.hypothesis.effect,
            "at": hidden.hypothesis.at,
            "parameter": hidden.parameter,
            "mdb": finite(hidden.mdb / unit.scale),
            "plausible": finite(hidden.plausible / unit.scale),
            "unit": unit.text,
            "absorbed_by": list(hidden.absorbed_by),
        }

    # --- tables ----------------------------------------------------------------------------
    def show(self, to: Reporter) -> None:
        """Conclusion first, then proof."""
        to.say(self.verdict_line())
        machine = [f for f in self.found.findings if not f.hypothesis.measurement]
        instrument = [f for f in self.found.findings if f.hypothesis.measurement]
        self._show_table(to, "Causes", machine)
        self._show_table(to, "Check the measurement first", instrument)
        for row in self.found.bad_rows:
            to.say(f"bad row: {self.measured.place(row)}: repeat this pose; it was not used")
        for finding in self.found.findings:
            to.say()
            to.say(self._sentence(finding))
        for unknown in self.found.unknown:
            to.say()
            to.say(self._unknown_sentence(unknown))
        self._show_unseen(to)

    def verdict_line(self) -> str:
        """What the data say, in one sentence."""
        found, sigma = self.found, self._length(self._sigma)
        rms = self._length(self._sigma * float(np.sqrt(found.before.chi2 / max(found.before.dof, 1))))
        words = {
            "clean": "nothing is left above noise",
            "found": "an effect is missing in the model, and found",
            "ambiguous": "something is missing; several effects explain it alike",
            "unknown": "something is missing that no effect of the catalogue explains",
            "measurement_fault": "the measurement is at fault",
        }
        estimated = (
            "" if found.scale.variance == 1.0 else f"; sigma {np.sqrt(found.scale.variance):.2f} times as stated"
        )
        return f"Residual {rms} rms after calibration, sigma {sigma}{estimated}: {words[found.verdict]}."

    def _show_table(self, to: Reporter, title: str, findings: Sequence[Finding]) -> None:
        if not findings:
            return
        to.say()
        rows = []
        for finding in findings:
            rivals = [r.hypothesis.name for r in finding.rivals if r.hypothesis != finding.hypothesis]
            rows.append(
                (
                    self._title(finding.hypothesis),
                    finding.hypothesis.at,
                    self._size(finding),
                    f"{100 * finding.share:.0f} %",
                    self._length(finding.held_out.without),
                    self._length(finding.held_out.with_it),
                    _words(finding.evidence),
                    ", ".join(rivals[:3]) + (f" and {len(rivals) - 3} more" if len(rivals) > 3 else ""),
                    "provisional" if finding.provisional else "",
                )
            )
        headers = (
            "effect", "at", "size", "share", "held-out rms without", "with it", "evidence", "remark", "",
        )  # fmt: skip
        to.table(title, tuple("not told from" if h == "remark" else h for h in headers), rows, left=2)

    def _title(self, hypothesis: Hypothesis) -> str:
        if hypothesis.effect == RELEASE:
            return "parameter held at nominal"
        effect = catalogue()[hypothesis.effect]
        return f"{effect.title}{f' ({effect.symbol})' if effect.symbol else ''}"

    def _size(self, finding: Finding) -> str:
        """The parameter that stands out most, as deviation from null."""
        k = self._leading(finding)
        name = finding.hypothesis.parameters[k]
        unit = self._unit(name)
        label = "" if len(finding.hypothesis.parameters) == 1 else f"{name.rpartition('.')[2]} "
        return label + uncertain(unit.from_si(finding.estimate[k]), finding.std[k] / unit.scale, unit.text)

    def _leading(self, finding: Finding) -> int:
        names = self.model.names
        nominal = self.model.nominal[[names.index(n) for n in finding.hypothesis.parameters]]
        ratio = np.abs(np.array(finding.estimate) - nominal) / np.array(finding.std)
        return int(np.nanargmax(ratio)) if np.isfinite(ratio).any() else 0

    def _sentence(self, finding: Finding) -> str:
        """Cause, effect and action; the alternatives where there are some."""
        h, size = finding.hypothesis, self._size(finding)
        before, after = self._length(finding.held_out.without), self._length(finding.held_out.with_it)
        gain = f"Explains {100 * finding.share:.0f} % of what is left; held-out rms {before} without, {after} with it"
        gain += f" ({finding.held_out.scheme})."
        if h.effect == RELEASE:
            text = f"Parameter {h.at} is held at nominal, but the data ask for {size}. {gain}"
            text += f" Identify it: --select auto,{h.at}."
        else:
            effect = catalogue()[h.effect]
            parts = (effect.cause, effect.result, effect.action)
            cause, result, action = (p.format(at=h.at, size=size) for p in parts)
            text = f"Cause: {cause} Effect: {result} {gain} Action: {action}"
        if finding.ambiguous:
            others = ", ".join(f"{r.hypothesis.name} ({100 * r.weight:.0f} %)" for r in finding.rivals[:6])
            text = f"Either of these explains it: {others}. They correct the measured region alike. {text}"
            pair = ",".join(r.hypothesis.name for r in finding.rivals[:2])
            text += f" To decide: pkmcal plan --separate {pair}."
        if finding.beyond:
            text += " Its size is not plausible: something else may stand behind it."
        return text

    def _unknown_sentence(self, unknown: Unknown) -> str:
        size = "" if np.isnan(unknown.rms) else f"{self._length(unknown.rms * self._sigma)} rms "
        hint = f" ({unknown.hint})" if unknown.hint else ""
        advice = {
            "time": "Log temperatures and repeat a datum pose.",
            "temperature": "Log temperatures of the parts.",
            "direction": "Measure every pose from both sides.",
            "load": "Measure with several payloads.",
        }.get(unknown.depends_on, "Do not compensate outside the measured region.")
        return (
            f"Unknown: {size}that depend on {unknown.depends_on} but match no effect of the catalogue{hint}. {advice}"
        )

    def _show_unseen(self, to: Reporter) -> None:
        """What these data could not have shown."""
        if self.found.not_testable:
            to.say()
            for name, needs in self.found.not_testable:
                to.say(f"not testable: {name}: needs {needs}")
        hidden = self.found.invisible
        if not hidden:
            return
        rows = []
        for i in hidden[:_SHOWN]:
            unit = self._unit(i.parameter)
            size = f"{i.mdb / unit.scale:.3g} {unit.text}" if np.isfinite(i.mdb) else "never"
            why = f"cannot be seen, absorbed by {', '.join(i.absorbed_by)}" if i.absorbed_by else ""
            rows.append((i.hypothesis.name, size, f"{i.plausible / unit.scale:.3g} {unit.text}", why))
        to.say()
        to.table("What these data could not have shown", ("effect", "smallest detectable", "plausible", "remark"), rows)
        if len(hidden) > _SHOWN:
            to.say(f"and {count(len(hidden) - _SHOWN, 'more effect')} (all in --json)")

    # --- units -----------------------------------------------------------------------------
    def _unit(self, parameter: str) -> Unit:
        found = self.model.parameters[self.model.names.index(parameter)]
        return parse_unit(found.unit or "1")

    @property
    def _length_unit(self) -> Unit:
        return self.machine.file_units.length

    def _length(self, value: float) -> str:
        return readable(value, self._length_unit)

    @property
    def _sigma(self) -> float:
        """Root mean square sigma of the measured positions, m."""
        problem = self.found.problem
        positions = [k for k, c in enumerate(self.model.channels) if c.quantity == "position"]
        some = positions or list(range(len(self.model.channels)))
        sigma = problem.sigma[:, some][problem.measured[:, some]]
        return float(np.sqrt((sigma**2).mean())) if len(sigma) else float("nan")


def _words(evidence: float) -> str:
    strength = "weak" if evidence < _CLEAR else "clear" if evidence < _OVERWHELMING else "overwhelming"
    return f"{strength} ({evidence:.1f})"
