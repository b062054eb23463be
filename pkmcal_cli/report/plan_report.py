"""The result of `plan`: what it can detect and tell apart, which points to add; JSON."""

from __future__ import annotations

import math
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.bench_measurements import BenchProposal
from pkmcal_cli.diagnosis.experiment_design import ALIKE, Aim, Plan, Visibility
from pkmcal_cli.diagnosis.power import Rates
from pkmcal_cli.effects import catalogue
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.report.added_points import Added
from pkmcal_cli.report.analysis_report import UNSTRAINED
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.detectable_sizes import sizes_json, sizes_text, worst_text
from pkmcal_cli.report.number_format import NEVER, detectable_size, finite, to_digits
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.report.power_report import rates_json, show_rates
from pkmcal_cli.report.sentences import cause_effect_action, grouped, listed
from pkmcal_cli.units.unit_text import Unit, parse_unit

_HEADERS = (
    "effect",
    "smallest detectable",
    "detected in 80 %",
    "smallest separable",
    "plausible",
    "most similar",
    "cosine",
    "remark",
)
_WIDE = ("smallest detectable", "smallest separable", "cosine")  # columns that a narrow terminal does without
_GAINS = 5  # parameters of which a measurement on the bench is told
_ORDER = ("detectable", "weak", "invisible")


class PlanReport:
    """A plan, ready to be shown."""

    def __init__(
        self,
        machine: Machine,
        plan: Plan,
        *,
        unstrained: bool,
        added: Added | None,
        bench: tuple[BenchProposal, ...],
        rates: tuple[Rates, ...],
    ) -> None:
        self.machine, self.plan, self.unstrained = machine, plan, unstrained
        self.added, self.bench = added, bench
        self.model, self.rates = plan.problem.model, rates

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        return {
            "n_rows": len(self.plan.problem),
            "effects": [self._json(v) for v in self.plan.visibilities],
            "groups": [list(g) for g in self.plan.groups],
            "not_testable": [{"effect": k, "needs": why} for k, why in self.plan.candidates.not_testable],
            "aim": None if self.added is None else self.added.json(self.model),
            "points": [] if self.added is None else self.added.cells(self.model),
            "bench": [self._bench_json(p) for p in self.bench],
            "power": [rates_json(self.model, r) for r in self.rates],
        }

    def _bench_json(self, p: BenchProposal) -> dict[str, Any]:
        unit = parameter_unit(self.model, p.name)
        gains = []
        for name, before, after in p.gains:
            file_unit = parameter_unit(self.model, name)
            gains.append(
                {
                    "name": name,
                    "before": finite(before / file_unit.scale),
                    "after": finite(after / file_unit.scale),
                    "unit": file_unit.text,
                }
            )
        return {"name": p.name, "sigma": p.sigma / unit.scale, "unit": unit.text, "std": gains}

    def _show_bench(self, to: Reporter) -> None:
        """Lengths that are worth a measurement by themselves."""
        for p in self.bench:
            unit = parameter_unit(self.model, p.name)
            gains = ", ".join(self._gain(*gain) for gain in p.gains[:_GAINS])
            to.say(f"measure {p.name} on the bench to {to_digits(p.sigma / unit.scale, 2)} {unit.text}: {gains}")

    def _gain(self, name: str, before: float, after: float) -> str:
        unit = parameter_unit(self.model, name)
        first, last = (
            f"{float(f'{x / unit.scale:.2g}'):g} {unit.text}" if math.isfinite(x) else "undetermined"
            for x in (before, after)
        )
        return f"{name} {first} -> {last}"

    def _json(self, v: Visibility) -> dict[str, Any]:
        scale = self._unit(v).scale
        return sizes_json(self.model, v) | {
            "status": v.status,
            "msb": finite(v.msb / scale),
            "plausible": finite(v.plausible / scale),
            "rival": v.rival or None,
            "cosine": v.cosine,
            "absorbed_by": list(v.absorbed_by),
        }

    def show(self, to: Reporter) -> None:
        """Tables for people."""
        counts = {s: sum(v.status == s for v in self.plan.visibilities) for s in _ORDER}
        rows = count(len(self.plan.problem), "pose")
        to.say(
            f"{rows}: " + ", ".join(f"{n} {s}" for s, n in counts.items()) + f" of {len(self.plan.scores)} hypotheses"
        )
        for status in _ORDER:
            self._show(to, status)
        for group in self.plan.groups:
            to.say(f"not separable: {listed(group, 8)}")
        for line in grouped(self.plan.candidates.not_testable):
            to.say(line)
        if self.unstrained and any(self._by_force(v) for v in self.plan.visibilities):
            to.say(UNSTRAINED)
        self._show_bench(to)
        show_rates(to, self.model, self.rates)
        self._show_added(to)

    def _by_force(self, v: Visibility) -> bool:
        """Whether an effect acts by forces and has no influence."""
        effect = catalogue().get(v.hypothesis.effect)
        by_force = effect is not None and (effect.reactive or effect.enters == "stiffness")
        return by_force and not v.absorbed_by and not v.mdb < v.plausible

    def _show(self, to: Reporter, status: str) -> None:
        rows = [self._cells(v) for v in self.plan.visibilities if v.status == status]
        if rows:
            to.say()
            to.table(status.capitalize(), _HEADERS, rows, folded=("most similar", "remark"), spare=_WIDE)

    def _cells(self, v: Visibility) -> tuple[str, ...]:
        unit = self._unit(v)
        sizes = (*sizes_text(self.model, v), *(detectable_size(x, v.plausible, unit) for x in (v.msb, v.plausible)))
        why = f"absorbed by {', '.join(v.absorbed_by)}" if v.absorbed_by else worst_text(self.model, v)
        if not v.mdb < NEVER * v.plausible and not why:
            why = "no effect on these readings"
        elif v.cosine > ALIKE and not v.absorbed_by and not v.detected < NEVER * v.plausible:
            why = f"taken for {v.rival}" + (f"; {why}" if why else "")
        return v.hypothesis.name, *sizes, v.rival, f"{v.cosine:.2f}" if v.rival else "", why

    def _show_added(self, to: Reporter) -> None:
        if self.added is None:
            return
        self.added.show(to, self.model)
        if self.added.aim.kind == "separate" and self.added.short:
            self._show_without_points(to, self.added.aim)
        if self.added.aim.kind == "see" and self.added.short:
            to.say("These points cannot show it at a plausible size. Add more points, or measure in another way.")

    def _show_without_points(self, to: Reporter, aim: Aim) -> None:
        """What tells effects apart where no pose does."""
        to.say("These points cannot separate them at plausible sizes. Add more points, or another measurement:")
        known = catalogue()
        for h in self.plan.candidates.single:
            if h.parameters in aim.parameters and h.effect in known:
                action = cause_effect_action(known[h.effect], h.at, "")[2]
                to.say(f"  {h.name}: {action}")

    def _unit(self, v: Visibility) -> Unit:
        return parse_unit(self.model.parameters[self.model.names.index(v.parameter)].unit or "1")
