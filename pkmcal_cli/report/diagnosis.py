"""The result of `diagnose`: verdict, table of causes, a sentence for each, what could not be seen; JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.errors_before_after import error_figures
from pkmcal_cli.diagnosis.findings import Detectable, Finding
from pkmcal_cli.diagnosis.groups import POSE
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.plan import ALIKE
from pkmcal_cli.diagnosis.stability import STABLE
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.effects import catalogue
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.diagnosis_json import DiagnosisJson
from pkmcal_cli.report.diagnosis_values import DiagnosisValues
from pkmcal_cli.report.numbers import detectable_size, handy, readable, uncertain
from pkmcal_cli.report.sentences import cause_effect_action, command, grouped, listed, unknown_sentence

_SHOWN, _SEPARATED = 12, 4
_MAPPED = 0.05  # share of the variance that a map must explain to be told of
_STDIN = "<stdin>"
_CLEAR, _OVERWHELMING = 3.0, 10.0  # log Bayes factors
_LIKE_NOISE = "no effect is found, but sigma is stated too small, or what is missing looks like noise"
_FOUND = "an effect is missing in the model, and found"
_BEYOND = "an effect explains it, but larger than is plausible: something else may stand behind it"
_MANY, _TOO_SMALL = 20, 0.25  # degrees of freedom, and chi-square for each of them: less is no noise of this sigma


class DiagnosisReport(DiagnosisValues):
    """One diagnosis, ready to be shown."""

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        return DiagnosisJson(self.machine, self.measured, self.found).whole()

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
        self.failed.show(to)
        for noise in self.found.noise:
            slope = uncertain(1e6 * noise.slope, 1e6 * noise.std, "um/m")
            to.say(f"noise of {noise.sensor} grows with distance: {slope} beside sigma; weight far points less")
        if self.found.correlation:
            to.say(f"successive rows are alike (correlation {self.found.correlation:.2f}): tested as made independent")
        for finding in self.found.findings:
            to.say()
            to.say(self._sentence(finding))
        for unknown in self.found.unknown:
            to.say()
            to.say(self._unknown_sentence(unknown))
        if self.found.verdict in ("clean", "sigma_too_small"):
            self._show_seen(to)
        self._show_unseen(to)

    def verdict_line(self) -> str:
        """What the data say, in one sentence."""
        found = self.found
        ratio = f"{np.sqrt(found.before.chi2 / max(found.before.dof, 1)):.3g}"
        rms, sigma = self._rms(), self.sigma
        rms_text, sigma_text = (readable(x, self.length_unit, like=max(rms, sigma)) for x in (rms, sigma))
        words = {
            "clean": "nothing is left above noise",
            "sigma_too_small": _LIKE_NOISE,
            "found": _BEYOND if any(f.beyond for f in found.findings) else _FOUND,
            "ambiguous": "something is missing; several effects explain it alike",
            "unknown": "something is missing that no effect of the catalogue explains",
            "measurement_fault": "the measurement is at fault",
        }
        scale = f"{ratio} times what noise explains (sigma {sigma_text}{self._doubt_of_sigma()}"
        chance = f", p {found.p_global:.1g}" if found.p_global > 1e-12 else ", p < 1e-12"
        return f"Residual {rms_text} rms after calibration, {scale}{chance}): {words[found.verdict]}."

    def _rms(self) -> float:
        """Root mean square error after calibration, bad rows included: of positions where they are measured, SI."""
        problem = self.found.problem
        there = self.found.before.after
        measured = ~np.isnan(problem.readings) & ~np.isnan(problem.sigma) & np.isfinite(there.residual)
        kinds = error_figures(replace(problem, measured=measured), there)
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
                    _share(finding),
                    f"{self.length(held.without)} -> {self.length(held.with_it)}",
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
        unit = self.unit(name)
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
        before, after = self.length(finding.held_out.without), self.length(finding.held_out.with_it)
        gain = f"Without it alone {_share(finding) or 'an unknown part'} of what is explained comes back;"
        gain += f" held-out rms {before} without, {after} with it ({finding.held_out.scheme})."
        if h.effect == RELEASE:
            text = f"Parameter {h.at} is held at nominal, but the data ask for {size}. {gain}"
            text += f" Identify it: --select auto,{h.at}."
        else:
            cause, result, action = cause_effect_action(catalogue()[h.effect], h.at, size)
            text = f"{h.name}: Cause: {cause} Effect: {result} {gain} Action: {action}"
        if finding.ambiguous:
            text = f"{self._alternatives(finding)} {text}"
        text += self._reservation(finding)
        return f"{text}\nTo decide, measure the points of: {self._to_decide(finding)}" if finding.ambiguous else text

    def _alternatives(self, finding: Finding) -> str:
        """Which effects the data support in its place."""
        names = [f"{r.hypothesis.name} ({100 * r.weight:.0f} %)" for r in finding.rivals]
        lead = "Either of these" if len(names) == 2 else f"Any one of these {len(names)}"
        return f"{lead} explains it: {listed(names, 6)}. {self._how_alike(finding)}"

    def _how_alike(self, finding: Finding) -> str:
        """Whether it matters which one is corrected, within the measured region."""
        alike = all(r.cosine > ALIKE for r in finding.rivals)
        return "They correct the measured region alike." if alike else "They do not correct the same: decide first."

    def _to_decide(self, finding: Finding) -> str:
        names = dict.fromkeys([finding.hypothesis.name, *(r.hypothesis.name for r in finding.rivals)])
        return command("plan", *self._files(), "--separate", ",".join(list(names)[:_SEPARATED]))

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
        if finding.stable < STABLE:
            return f" Provisional: only {100 * finding.stable:.0f} % of resamples of the rows name it."
        return " Provisional: something unknown is left, of which it may be a part." if finding.provisional else ""

    def _unknown_sentence(self, unknown: Unknown) -> str:
        size = "" if np.isnan(unknown.rms) else f"{self.length(unknown.rms * self.sigma)} rms "
        warm = any(name == "T" or name.startswith("T.") for name in self.measured.covariates)
        text = unknown_sentence(size, unknown.depends_on, unknown.hint, warm)
        mapped = unknown.depends_on == POSE and (not unknown.hint or unknown.hint.startswith("smooth field"))
        return f"{text} {self._map_sentence()}" if mapped else text

    def _map_sentence(self) -> str:
        """Where the unknown is largest, and how much of it a smooth map explains on cells that it has not seen."""
        field, unit = self.field, self.length_unit
        if field is None or field.explained < _MAPPED:
            return ""
        size = self.length(float(np.linalg.norm(field.vectors[field.largest])))
        place = ", ".join(f"{c} {v / unit.scale:.4g} {unit.text}" for c, v in zip("xyz", field.at[field.largest]))
        share = max(100 * field.explained, 0.0)
        return f"Largest near {place}: {size}; a smooth map explains {share:.0f} % of its variance where left out."

    def _show_seen(self, to: Reporter) -> None:
        """How large effects would have been found, where nothing was: the worst place of every kind."""
        worst: dict[str, Detectable] = {}
        for seen in self.found.detectable:
            kind = seen.hypothesis.effect
            if seen.tested and kind != RELEASE and (kind not in worst or seen.mdb > worst[kind].mdb):
                worst[kind] = seen
        if worst:
            texts = [f"{d.hypothesis.name} {handy(d.mdb, self.unit(d.parameter))}" for d in worst.values()]
            to.say(f"smallest detectable, the worst place of each kind: {listed(texts, len(texts))}")

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
            unit = self.unit(i.parameter)
            size = detectable_size(i.mdb, i.plausible, unit)
            needed = self.rows_needed(i)
            why = f"some {needed} rows like these would show it" if needed is not None else ""
            why = f"absorbed by {', '.join(i.absorbed_by)}" if i.absorbed_by else why
            rows.append((i.hypothesis.name, size, handy(i.plausible, unit), why))
        to.say()
        to.table("What these data could not have shown", ("effect", "smallest detectable", "plausible", "remark"), rows)
        more = f"and {count(len(hidden) - _SHOWN, 'more effect')} (all in --json); " if len(hidden) > _SHOWN else ""
        to.say(f"{more}which points would show one: {command('plan', *self._files(), '--see', 'EFFECT')}")


def _share(finding: Finding) -> str:
    """What comes back without it; "" where no fit is without it."""
    return "" if np.isnan(finding.share) else f"{100 * finding.share:.0f} %"


def _words(evidence: float) -> str:
    return "weak" if evidence < _CLEAR else "clear" if evidence < _OVERWHELMING else "overwhelming"
