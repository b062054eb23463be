"""The result of `diagnose`: verdict, table of causes, a sentence for each, what could not be seen; JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal_cli.calibration.errors_before_after import error_figures
from pkmcal_cli.diagnosis.diagnose import Diagnosis, Finding, Invisible
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.effects import catalogue
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.unit_text import Unit, parse_unit
from pkmcal_cli.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.numbers import detectable_size, finite, handy, readable, uncertain
from pkmcal_cli.report.sentences import cause_effect_action, command, grouped, listed, unknown_sentence
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.words import count

_SHOWN = 12
_STDIN = "<stdin>"
_CLEAR, _OVERWHELMING = 3.0, 10.0  # log Bayes factors
_LIKE_NOISE = "no effect is found, but sigma is stated too small, or what is missing looks like noise"
_MANY, _TOO_SMALL = 20, 0.25  # degrees of freedom, and chi-square for each of them: less is no noise of this sigma


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
        found = self.found
        ratio = f"{np.sqrt(found.before.chi2 / max(found.before.dof, 1)):.3g}"
        rms, sigma = self._rms(), self._sigma
        rms_text, sigma_text = (readable(x, self._length_unit, like=max(rms, sigma)) for x in (rms, sigma))
        words = {
            "clean": _LIKE_NOISE if found.scale.doubted else "nothing is left above noise",
            "found": "an effect is missing in the model, and found",
            "ambiguous": "something is missing; several effects explain it alike",
            "unknown": "something is missing that no effect of the catalogue explains",
            "measurement_fault": "the measurement is at fault",
        }
        scale = f"{ratio} times what noise explains (sigma {sigma_text}{self._doubt_of_sigma()})"
        return f"Residual {rms_text} rms after calibration, {scale}: {words[found.verdict]}."

    def _rms(self) -> float:
        """Root mean square error after calibration, bad rows included: of positions where they are measured, SI."""
        problem = self.found.problem
        measured = ~np.isnan(problem.readings) & ~np.isnan(problem.sigma)
        kinds = error_figures(replace(problem, measured=measured), self.found.before.after)
        return kinds["position"].rms if "position" in kinds else next(iter(kinds.values())).rms

    def _doubt_of_sigma(self) -> str:
        """What the residual says of the stated sigma, where they differ much."""
        found = self.found
        if found.scale.doubted:
            return f", noise taken as {np.sqrt(found.scale.variance):.3g} times sigma"
        after = found.search.fit
        return ", which is stated too large" if after.dof >= _MANY and after.chi2_per_dof < _TOO_SMALL else ""

    def _show_table(self, to: Reporter, title: str, findings: Sequence[Finding]) -> None:
        if not findings:
            return
        to.say()
        rows = []
        for finding in findings:
            rivals = [r.hypothesis.name for r in finding.rivals if r.hypothesis != finding.hypothesis]
            held = finding.held_out
            rows.append(
                (
                    finding.hypothesis.effect if to.narrow else self._title(finding.hypothesis),
                    finding.hypothesis.at,
                    self._size(finding),
                    f"{100 * finding.share:.0f} %",
                    f"{self._length(held.without)} -> {self._length(held.with_it)}",
                    _words(finding.evidence),
                    listed(rivals, 2),
                    "provisional" if finding.provisional else "",
                )
            )
        headers = ("effect", "at", "size", "share", "held-out rms", "evidence", "not told from", "")
        folded = ("not told from",) if to.narrow else ("effect", "not told from")
        kept = [k for k, h in enumerate(headers) if not (to.narrow and h in ("share", "evidence"))]
        cells = [tuple(row[k] for k in kept) for row in rows]
        to.table(title, tuple(headers[k] for k in kept), cells, left=2, folded=folded)

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
        gain = f"Explains {100 * finding.share:.0f} % of what is left above noise;"
        gain += f" held-out rms {before} without, {after} with it ({finding.held_out.scheme})."
        if h.effect == RELEASE:
            text = f"Parameter {h.at} is held at nominal, but the data ask for {size}. {gain}"
            text += f" Identify it: --select auto,{h.at}."
        else:
            cause, result, action = cause_effect_action(catalogue()[h.effect], h.at, size)
            text = f"{h.name}: Cause: {cause} Effect: {result} {gain} Action: {action}"
        if finding.ambiguous:
            text = f"{self._alternatives(finding)} {text}{self._to_decide(finding)}"
        return text + self._reservation(finding)

    def _alternatives(self, finding: Finding) -> str:
        """Which effects the data support in its place."""
        names = [f"{r.hypothesis.name} ({100 * r.weight:.0f} %)" for r in finding.rivals]
        lead = "Either of these" if len(names) == 2 else f"Any one of these {len(names)}"
        return f"{lead} explains it: {listed(names, 6)}. They correct the measured region alike."

    def _to_decide(self, finding: Finding) -> str:
        pair = ",".join(r.hypothesis.name for r in finding.rivals[:2])
        return f" To decide, measure the points of: {command('plan', *self._files(), '--separate', pair)}"

    def _files(self) -> tuple[str, str]:
        """Machine and first table, as they are named on a command line."""
        files = self.machine.files[0][0], self.measured.files[0]
        return (files[0] if files[0] != _STDIN else "M.yaml"), (files[1] if files[1] != _STDIN else "MEAS.csv")

    def _reservation(self, finding: Finding) -> str:
        """Why a finding is provisional."""
        if finding.beyond:
            return " Provisional: its size is not plausible; something else may stand behind it."
        if not finding.held_out.confirmed:
            return " Provisional: rows that were held out do not confirm it."
        return " Provisional: something unknown is left, of which it may be a part." if finding.provisional else ""

    def _unknown_sentence(self, unknown: Unknown) -> str:
        size = "" if np.isnan(unknown.rms) else f"{self._length(unknown.rms * self._sigma)} rms "
        warm = any(name == "T" or name.startswith("T.") for name in self.measured.covariates)
        return unknown_sentence(size, unknown.depends_on, unknown.hint, warm)

    def _show_unseen(self, to: Reporter) -> None:
        """What these data could not have shown."""
        if self.found.not_testable:
            to.say()
        for line in grouped(self.found.not_testable):
            to.say(line)
        hidden = self.found.invisible
        if not hidden:
            return
        rows = []
        for i in hidden[:_SHOWN]:
            unit = self._unit(i.parameter)
            size = detectable_size(i.mdb, i.plausible, unit)
            why = f"cannot be seen, absorbed by {', '.join(i.absorbed_by)}" if i.absorbed_by else ""
            rows.append((i.hypothesis.name, size, handy(i.plausible, unit), why))
        to.say()
        to.table("What these data could not have shown", ("effect", "smallest detectable", "plausible", "remark"), rows)
        more = f"and {count(len(hidden) - _SHOWN, 'more effect')} (all in --json); " if len(hidden) > _SHOWN else ""
        to.say(f"{more}which points would show one: {command('plan', *self._files(), '--see', 'EFFECT')}")

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
    return "weak" if evidence < _CLEAR else "clear" if evidence < _OVERWHELMING else "overwhelming"
