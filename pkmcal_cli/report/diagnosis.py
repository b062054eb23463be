"""The result of `diagnose`: verdict, table of causes, a sentence for each, what could not be seen; JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.diagnosis.confirm import HeldOutGain
from pkmcal_cli.diagnosis.experiment_design import ALIKE
from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.groups import POSE
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.off_nominal import run_off
from pkmcal_cli.diagnosis.shape_findings import ShapeFinding
from pkmcal_cli.diagnosis.stability import STABLE
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.diagnosis.warming import TOGETHER, of_warming, warming
from pkmcal_cli.effects import catalogue
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.diagnosis_json import DiagnosisJson
from pkmcal_cli.report.effect_signs import sign_text
from pkmcal_cli.report.mistaken_scale import mistaken_scale
from pkmcal_cli.report.noise_text import growth_text
from pkmcal_cli.report.number_format import handy
from pkmcal_cli.report.residual_text import ResidualText
from pkmcal_cli.report.sentences import cause_effect_action, command, listed, no_cause, tested_alone, unknown_sentence
from pkmcal_cli.report.shape_text import ShapeText
from pkmcal_cli.report.visibility import VisibilityReport

_SEPARATED = 4  # effects at most that one measurement is planned for
_MAPPED = 0.05  # share of the variance that a map must explain to be told of
_CLEAR, OVERWHELMING = 3.0, 10.0  # log Bayes factors
_LIKE_NOISE = "no effect found; sigma is too small, or the missing effect looks like noise"
_FAR = " Its size is far beyond the plausible range."
_NOT_AMONG = "no effect found among those tested; sigma is too small, or another effect is missing"
_BEYOND = "an effect explains the residuals, but its size is implausible; the true cause may be another"


class DiagnosisReport(VisibilityReport):
    """One diagnosis, ready to be shown."""

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        return DiagnosisJson(self.machine, self.measured, self.diagnosis).whole()

    # --- tables ----------------------------------------------------------------------------
    def show(self, to: Reporter) -> None:
        """Conclusion first, then proof."""
        to.say(self.verdict_line())
        for reason in self.diagnosis.implausible:
            to.say(f"because: {reason}")
        self.show_causes(to)
        self.show_left_out(to)
        if untried := self.diagnosis.search.untried:
            to.say(f"not tried as far off (too many, or no time): {listed(list(untried), 6)}")
        for noise in self.diagnosis.noise:
            to.say(growth_text(noise))
        if self.diagnosis.correlation:
            to.say(f"successive rows are correlated ({self.diagnosis.correlation:.2f}); tested after decorrelation")
        for finding in self.diagnosis.findings:
            to.say()
            to.say(self.sentence(finding))
        for shape in self.diagnosis.shapes:
            to.say()
            to.say(ShapeText(self.machine, self.shaped_model, shape, self.error_unit).sentence())
        for unknown in self.diagnosis.unmodelled:
            to.say()
            to.say(self.unknown_text(unknown))
        self.numbers.show(to)
        if self.diagnosis.verdict in ("clean", "sigma_too_small"):
            self.show_seen(to)
        self.show_unseen(to)

    def show_causes(self, to: Reporter) -> None:
        """Tables of what was found, in the machine and in the measurement; rows that are wrong."""
        machine = [f for f in self.diagnosis.findings if not f.hypothesis.measurement]
        instrument = [f for f in self.diagnosis.findings if f.hypothesis.measurement]
        shapes = [self._shape_row(s, s.named) for s in self.diagnosis.shapes if s.named is not None]
        self._show_table(to, "Causes", [*map(self._row, machine), *shapes])
        self._show_table(to, "Check the measurement first", [*map(self._row, instrument)])
        self.show_readings(to)
        self.show_rows(to, "not used; repeat this pose")

    def verdict_line(self) -> str:
        """What the data say; in a second line, by which figures."""
        diagnosis = self.diagnosis
        named = len(diagnosis.findings) + len(diagnosis.named_shapes)
        depends = ", ".join(dict.fromkeys(u.depends_on for u in diagnosis.unknown))
        words = {
            "clean": no_cause(diagnosis.p_global),
            "sigma_too_small": _LIKE_NOISE if self.only is None else _NOT_AMONG,
            "found": _BEYOND
            if any(f.beyond for f in diagnosis.findings)
            else f"found {count(named, 'effect')} that the model lacks{self._far_off()}",
            "ambiguous": "the model lacks an effect; several effects explain the residuals equally well",
            "unknown": f"unknown; depends on {depends}, and matches no effect {_of(self.only)}{self._nameless()}",
            "measurement_fault": "the measurement is at fault",
            "implausible": "no cause was found, but the calibration is implausible: do not use its parameters",
        }
        residuals = ResidualText(diagnosis, self.sigma, self.error_unit).text
        verdict = f"{words[diagnosis.verdict]}{self._mistakes()}{tested_alone(self.only)}{self._run_off()}"
        return f"diagnosis: {self._provisional()}{verdict}{self.numbers.suspicion()}\n{residuals}"

    def _mistakes(self) -> str:
        """What of the table was put right, without the evidence."""
        texts = [text.partition(": ")[0] for text in self.diagnosis.mistakes]
        if not texts:
            return ""
        return f"{': ' if self.diagnosis.verdict == 'measurement_fault' else '; besides, '}{listed(texts, 3)}"

    def _run_off(self) -> str:
        """Declared parameters that take up what no machine has."""
        search = self.diagnosis.search
        off = run_off(search) if search.fit.status == "converged" else {}
        texts = [f"{name} is {times:.3g} ranges off nominal" for name, times in off.items()]
        return f"; but {listed(texts, 3)}" if texts else ""

    @property
    def only(self) -> tuple[str, ...] | None:
        """What alone was tested; None where all was."""
        return self.diagnosis.search.candidates.only

    def _nameless(self) -> str:
        """Displacements without a name, and steps in time, that stand for what is unknown."""
        names = [shape.hypothesis.name for shape in self.diagnosis.shapes if shape.named is None]
        names += [f"a {u.hint}" for u in self.diagnosis.unknown if u.row is not None]
        return f"; {listed(names, 3)} describes it" if names else ""

    def _far_off(self) -> str:
        """Which effects are far larger than what is usual."""
        far = [f.hypothesis.name for f in self.diagnosis.findings if self.far(f)]
        return f"; far beyond the plausible range: {listed(far, 3)}" if far else ""

    def _provisional(self) -> str:
        """That something found is provisional, first of all; what is unknown says so by itself."""
        known = self.diagnosis.verdict != "unknown"
        return "provisional: " if known and any(f.provisional for f in self.diagnosis.findings) else ""

    def _row(self, finding: Finding) -> tuple[str, ...]:
        rivals = [r.hypothesis.name for r in finding.rivals if r.hypothesis != finding.hypothesis]
        return (
            self.title(finding.hypothesis),
            finding.hypothesis.at,
            self.size(finding),
            _share(finding),
            self._held_out(finding.held_out),
            _words(finding.evidence),
            listed(rivals, 2),
            "provisional" if finding.provisional else "",
        )

    def _shape_row(self, shape: ShapeFinding, named: Hypothesis) -> tuple[str, ...]:
        """The row of an effect with a shape of its own."""
        size = ShapeText(self.machine, self.shaped_model, shape, self.error_unit).height()
        others = [at for at, _ in shape.places[1:]]
        held, words = self._held_out(shape.held_out), _words(shape.evidence)
        return (f"{self.title(named)}, shape of its own", named.at, size, "", held, words, listed(others, 2), "")

    def _held_out(self, held: HeldOutGain) -> str:
        return f"{self.error(held.without)} -> {self.error(held.with_it)}"

    def _show_table(self, to: Reporter, title: str, rows: Sequence[tuple[str, ...]]) -> None:
        if not rows:
            return
        to.say()
        shown = self.diagnosis.shown
        held_out = "held-out rms" if shown.alone else f"held-out rms, {shown.name}"
        headers = ("effect", "at", "size", "share", held_out, "evidence", "alternatives", "")
        to.table(title, headers, rows, left=2, folded=("effect", "alternatives"), spare=("share", "evidence"))

    def title(self, hypothesis: Hypothesis) -> str:
        if hypothesis.effect == RELEASE:
            return "parameter held fixed"
        effect = catalogue()[hypothesis.effect]
        often = effect.repeats(hypothesis.parameters)
        return effect.title + (f" ({effect.symbol})" if effect.symbol else "") + (f", {often}" if often else "")

    def sentence(self, finding: Finding) -> str:
        """Cause, effect and action; the alternatives where there are some."""
        h, size = finding.hypothesis, self.size(finding)
        if h.members:
            size = ", ".join(self.estimate(finding, k) for k in range(len(h.parameters)))
        before, after = self.error(finding.held_out.without), self.error(finding.held_out.with_it)
        gain = f"Share of the explained residuals: {_share(finding) or 'unknown'};"
        gain += f" held-out rms: {before} without it, {after} with it ({finding.held_out.scheme})."
        if h.effect == RELEASE:
            text = f"Parameter {h.at} is held fixed at {self.held_at(h.at)}, but the data indicate {size}. {gain}"
            text += f" Action: Identify it, `--select auto,{h.at}`."
        else:
            cause, result, action = cause_effect_action(catalogue()[h.effect], h.at, size, h.parameters)
            signs = (sign_text(self.model, *x) for x in zip(h.parameters, finding.estimate, finding.std, strict=True))
            cause = " ".join(filter(None, signs)) or cause
            text = f"{h.name}: Cause: {cause} Effect: {result} {gain} Action: {action}"
        if finding.ambiguous:
            text = f"{self._alternatives(finding)} {text}"
        text += self._selection(finding) + self._reservation(finding)
        return "\n".join([text, *self.to_separate(finding)])

    def _selection(self, finding: Finding) -> str:
        """Between which sizes it may be, where noise that made it larger may be why it was found.

        The median of these sizes is no better estimate: near what is detectable it is further off than the fit's.
        """
        chosen = finding.selected
        if chosen is None:
            return ""
        k = self.leading(finding)
        name = finding.hypothesis.parameters[k]
        size, unit = finding.estimate[k] - self.null(name), self.unit(name)
        low, high = sorted((chosen.low, chosen.high), key=lambda x: size * x)
        ends = f"{handy(size * low, unit)} to {handy(size * high, unit)}"
        return f" Found near the limit of detection, where what noise enlarges is found first: 95 % interval {ends}."

    def _alternatives(self, finding: Finding) -> str:
        """Which effects the data support in its place."""
        names = [f"{r.hypothesis.name} ({100 * r.weight:.0f} %)" for r in finding.rivals]
        lead = "Either of these effects" if len(names) == 2 else f"Any one of these {len(names)} effects"
        return f"{lead} explains the residuals: {listed(names, 6)}. {self._how_alike(finding)}"

    def _how_alike(self, finding: Finding) -> str:
        """Whether it matters which one is corrected, within the measured region."""
        together = warming(self.diagnosis.problem)
        if together > TOGETHER and sum(of_warming(r.hypothesis) for r in finding.rivals) > 1:
            return f"Time and temperature go together ({together:.2f}): a cooling phase would decide."
        if all(r.cosine > ALIKE for r in finding.rivals):
            return "Their corrections agree in the measured region."
        return "Their corrections differ: separate them first."

    def to_separate(self, finding: Finding) -> list[str]:
        """What separates a finding from its rivals: points where these can, else another measurement."""
        apart, alike = finding.separable.apart[:_SEPARATED], finding.separable.alike
        out = []
        if apart:
            points = command("plan", *self.files(), "--aim", f"separate:{','.join(apart)}")
            out.append(f"To separate {listed(apart, _SEPARATED)}, measure the points of: {points}")
        if alike:
            which = f"{listed(alike, _SEPARATED)} from the others" if apart else listed(alike, _SEPARATED)
            known = {h.name: h for h in (finding.hypothesis, *(r.hypothesis for r in finding.rivals))}
            actions = " ".join(f"{name}: {self.action(known[name])}" for name in alike[:_SEPARATED])
            lead = f"Points like those that were measured do not separate {which}, which act alike there."
            out.append(f"{lead} Another measurement may: {actions}")
        return out

    def action(self, hypothesis: Hypothesis) -> str:
        """What is to be done about a cause, its size aside."""
        if hypothesis.effect == RELEASE:
            return f"Identify it: --select auto,{hypothesis.at}"
        return cause_effect_action(catalogue()[hypothesis.effect], hypothesis.at, "it")[2]

    def _reservation(self, finding: Finding) -> str:
        """How far off an effect is, or why it is provisional."""
        if finding.run_away is not None:
            slip = mistaken_scale(self.model, finding.hypothesis, finding.estimate[0])
            return f"{_FAR if self.far(finding) else ''}{slip}{self.run_away(finding)}"
        if finding.beyond:
            return " Provisional: its size is beyond the plausible range; the true cause may be another."
        if not finding.held_out.confirmed:
            return " Provisional: held-out rows do not confirm it."
        if finding.stable.share < STABLE:
            others = listed([f"{100 * share:.0f} % {h.name}" for h, share in finding.stable.others], 3)
            more = f"; of the others {others}" if others else ""
            return f" Provisional: only {100 * finding.stable.share:.0f} % of the resamples find it{more}."
        return " Provisional: an unknown effect remains; this may be part of it." if finding.provisional else ""

    def unknown_text(self, unknown: Unknown) -> str:
        size = "" if np.isnan(unknown.rms) else f"{self.error(unknown.rms * self.sigma)} rms "
        warm = any(name == "T" or name.startswith("T.") for name in self.measured.covariates)
        text = unknown_sentence(size, unknown.depends_on, unknown.hint, warm, unknown.row is not None)
        mapped = unknown.depends_on == POSE and (not unknown.hint or unknown.hint.startswith("smooth field"))
        return f"{text} {self._map_sentence()}" if mapped else text

    def _map_sentence(self) -> str:
        """Where the unknown is largest, and how much of it a smooth map explains on cells that it has not seen."""
        field, unit = self.field, self.length_unit
        if field is None or field.explained < _MAPPED:
            return ""
        size = self.length(float(np.linalg.norm(field.vectors[field.largest])))
        at = ", ".join(f"{c} {v / unit.scale:.4g} {unit.text}" for c, v in zip("xyz", field.at[field.largest]))
        share = max(100 * field.explained, 0.0)
        return f"Largest near {at}: {size}. A smooth map explains {share:.0f} % of its variance on held-out cells."


def _of(only: Sequence[str] | None) -> str:
    return "of the catalogue" if only is None else "that was tested"


def _share(finding: Finding) -> str:
    """What comes back without it; "" where no fit is without it."""
    return "" if np.isnan(finding.share) else f"{100 * finding.share:.0f} %"


def _words(evidence: float) -> str:
    return "weak" if evidence < _CLEAR else "clear" if evidence < OVERWHELMING else "overwhelming"
