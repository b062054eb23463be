"""Errors after repeated calibrations: verdict, tables, JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from pkmcal_cli.base.plural import listed
from pkmcal_cli.calibration.study import Study
from pkmcal_cli.calibration.study_figures import CaseFigures, Difference, Mean
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import finite, small_unit, uncertain
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.units.unit_text import Unit, parse_unit

_SMALL = {"length": "um", "angle": "urad"}


@dataclass(frozen=True)
class StudyReport:
    """What repetitions of a study left, of every machine and number of points."""

    study: Study
    noise: str
    repeat: int
    cases: tuple[CaseFigures, ...]
    differences: tuple[Difference, ...]

    @property
    def verdict(self) -> str:
        """Whether calibrations failed."""
        failed = sum(c.failed for c in self.cases)
        if not failed:
            return "complete"
        return "some_failed" if any(c.count for c in self.cases) else "none_calibrated"

    @cached_property
    def units(self) -> dict[str, Unit]:
        """Units of mean errors, by the dimension of parameters."""
        out: dict[str, Unit] = {}
        for machine in self.study.machines:
            for name in machine.selected:
                file_unit = parameter_unit(machine.model, name)
                kind = file_unit.dimension.name
                out.setdefault(kind, small_unit(file_unit) if kind in _SMALL else file_unit.difference)
        return out

    @property
    def tool_unit(self) -> Unit:
        """Of the tool point's errors."""
        kind = "angle" if self.study.turns else "length"
        return self.units.get(kind, parse_unit(_SMALL[kind]))

    def show(self, to: Reporter) -> None:
        """What is reached first, then the tables."""
        for machine in self.study.machines:
            to.say(self._reached([c for c in self.cases if c.machine == machine.name]))
        for text in self._compared():
            to.say(text)
        for machine in (m for m in self.study.machines if m.unidentified):
            unknown = f"{listed(list(machine.unidentified), 4)} {'is' if len(machine.unidentified) == 1 else 'are'}"
            to.say(f"note: {machine.name}: {unknown} not identified, but off nominal as the ranges say (`--held`)")
        to.say()
        kinds = [kind for kind in self.units if any(kind in c.kinds for c in self.cases)]
        heads = ["machine", "points", *(f"{kind} parameters" for kind in kinds)]
        common = [kind for kind in kinds if any(kind in c.common for c in self.cases)]
        heads += [f"{kind}, common" for kind in common]
        rows = [
            [
                c.machine,
                str(c.points),
                *(self._text(c.kinds.get(k), k) for k in kinds),
                *(self._text(c.common.get(k), k) for k in common),
                _shown(c.tool, self.tool_unit),
                str(c.failed),
            ]
            for c in self.cases
        ]
        title = f"Mean errors of {self.repeat} calibrations each, noise {self.noise}"
        to.table(title, [*heads, "tool point", "failed"], rows, spare=[f"{kind}, common" for kind in common])

    def _reached(self, cases: list[CaseFigures]) -> str:
        """The tool point's error of a machine, with the fewest and the most points."""
        ends = cases[:1] if len(cases) == 1 else [cases[0], cases[-1]]
        errors = [f"{_shown(c.tool, self.tool_unit)} with {c.points} points" for c in ends]
        return f"{cases[0].machine}: mean error of the tool point {', '.join(errors)}"

    def _compared(self) -> list[str]:
        """Differences with the most points."""
        out = []
        for d in (d for d in self.differences if d.points == self.study.counts[-1]):
            parts = [f"{self._text(mean, kind)} (common {kind} parameters)" for kind, mean in d.kinds.items()]
            parts.append(f"{_shown(d.tool, self.tool_unit)} (tool point)")
            out.append(f"{d.machine} less {self.study.machines[0].name}, {d.points} points: {', '.join(parts)}")
        return out

    def _text(self, mean: Mean | None, kind: str) -> str:
        return "" if mean is None else _shown(mean, self.units[kind])

    def json(self) -> dict[str, Any]:
        """The same for programs."""
        region = self.study.region
        return {
            "noise": self.noise,
            "n_repeat": self.repeat,
            "held": [{"machine": m.name, "drawn": list(m.unidentified)} for m in self.study.machines],
            "n_validation": self.study.validation,
            "region": {"names": list(region.names), "low": region.low.tolist(), "high": region.high.tolist()},
            "cases": [self._case_json(c) for c in self.cases],
            "differences": [
                {
                    "machine": d.machine,
                    "points": d.points,
                    "kinds": [{"kind": k, **_json(mean, self.units[k])} for k, mean in d.kinds.items()],
                    "tool": _json(d.tool, self.tool_unit),
                }
                for d in self.differences
            ],
        }

    def _case_json(self, c: CaseFigures) -> dict[str, Any]:
        model = next(m.model for m in self.study.machines if m.name == c.machine)
        return {
            "machine": c.machine,
            "points": c.points,
            "n_calibrations": c.count,
            "n_failed": c.failed,
            "kinds": [
                {"kind": k, **_json(mean, self.units[k]), **_common_json(c.common, k, self.units[k])}
                for k, mean in c.kinds.items()
            ],
            "parameters": [
                {"name": n, **_json(mean, parameter_unit(model, n).difference)} for n, mean in c.parameters.items()
            ],
            "tool": _json(c.tool, self.tool_unit),
        }


def _json(mean: Mean, unit: Unit) -> dict[str, Any]:
    return {"mean": finite(mean.value / unit.scale), "std": finite(mean.std / unit.scale), "unit": unit.text}


def _common_json(common: Mapping[str, Mean], kind: str, unit: Unit) -> dict[str, Any]:
    if kind not in common:
        return {}
    entry = _json(common[kind], unit)
    del entry["unit"]
    return {"common": entry}


def _shown(mean: Mean, unit: Unit) -> str:
    if finite(mean.value) is None:
        return "-"
    return uncertain(mean.value / unit.scale, mean.std / unit.scale, unit.text)
