"""What `compare` shows of parameter files: one test, changes of parameters and effects, of the tool point, a trend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.change_course import Course
from pkmcal_cli.calibration.comparison import Alone, Changes, Estimate, Omnibus, Single, changed, likely_changes
from pkmcal_cli.calibration.data_sets import Common
from pkmcal_cli.loading.known_parameters import KnownParameters
from pkmcal_cli.report.compared_dates import date_notes, date_text
from pkmcal_cli.report.compared_effects import Effect, effects_of, letter
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import finite, readable, uncertain
from pkmcal_cli.units.unit_text import Unit, parse_unit

_LISTED = 12  # names told one by one
_UNSEEN = "; u contains changes of half a range that no data see"


@dataclass(frozen=True, kw_only=True)
class Compared:
    """Tests of what data sets have in common; apart: what is not compared, with the files that have it.

    changes, alone: over the whole course. free: parameters that all fits were to identify, determined or not.
    """

    common: Common
    test: Omnibus
    changes: Changes
    alone: Alone | None
    apart: Mapping[str, tuple[int, ...]]
    course: Course
    free: tuple[str, ...]

    def named(self, alpha: float) -> tuple[str, ...]:
        """What has changed: parameters by their own tests, or by which one alone explains everything."""
        return changed(self.changes, self.alone, self.test, alpha)

    def likely(self, alpha: float) -> Estimate:
        """What the machine has most likely changed by, ranges of parameters being knowledge of their changes too.

        One parameter alone where it explains everything, and no other does: elsewhere these differ where nothing was
        measured.
        """
        equals = self.alone.equals(self.named(alpha)) if self.test.p_value < alpha and self.alone is not None else ()
        if len(equals) == 1 and equals[0].explains:
            return equals[0].estimate
        return likely_changes(self.common, self.free, self.course.times)


@dataclass(frozen=True, kw_only=True)
class ToolChange:
    """Change of the tool point's position, m, or where it only turns, of its orientation, rad.

    Rms, that by chance alone, largest with its uncertainty, and where. alone: the one parameter by which it is
    computed, None for all; file_unit: of the machine file, in which people are told.
    """

    rms: float
    rms_by_chance: float
    largest: float
    std: float
    where: Mapping[str, float]
    count: int
    over: str
    alone: str | None
    turns: bool
    file_unit: Unit

    @property
    def units(self) -> tuple[Unit, Unit]:
        """Of the changes, and of where they are, as programs get them."""
        return (parse_unit("urad"), parse_unit("deg")) if self.turns else (parse_unit("um"), parse_unit("mm"))


class ComparisonReport:
    """A comparison, ready to be shown; alpha: chance of an alarm where nothing has changed."""

    def __init__(
        self, known: Sequence[KnownParameters], compared: Compared, tool: ToolChange | str | None, alpha: float
    ) -> None:
        self.known, self.compared, self.tool, self.alpha = known, compared, tool, alpha
        self.effects = effects_of(known)
        per = compared.course.days if compared.course.rate else 1.0
        self.changes = compared.changes.per(per)
        self.alone = None if compared.alone is None else compared.alone.per(per)

    @property
    def unchanged(self) -> bool:
        """Whether something could be tested, and does not alarm."""
        return self.compared.test.p_value >= self.alpha

    @property
    def named(self) -> tuple[str, ...]:
        """What has changed: parameters by their own tests, or by which one alone explains everything."""
        return self.compared.named(self.alpha)

    def verdict(self) -> str:
        """The verdict in a sentence."""
        t = self.compared.test
        if not t.dof:
            return "NOTHING TO COMPARE: these data determine nothing in common"
        chance = f"F = {t.statistic:.3g} for {t.dof} and {t.freedom:.0f} degrees of freedom, p {t.p_value:.2g}"
        verdict = "no change" if self.unchanged else "CHANGED"
        return f"{verdict}: {chance}, of {count(t.dof, 'combination')} of parameters that all data sets determine"

    def show(self, to: Reporter) -> None:
        """For people."""
        c = self.compared
        (to.say if self.unchanged else to.fail)(self.verdict())
        self._show_alone(to)
        to.say()
        heads = [letter(i) for i in range(len(self.known))]
        for head, k in zip(heads, self.known, strict=True):
            to.say(f"{head}: {k.file}, {date_text(k)}")
        if len(self.known) > 2:
            to.notes(date_notes(self.known, c.course.days))
        change = "change per day" if c.course.rate else "change" + self._between(", ")
        if self.changes.names:
            to.table("Parameters", ("name", *heads, change, "p (Holm)", "remark"), self._parameter_rows())
        if self.effects:
            to.table("Effects", ("effect", *heads, "remark"), [self._effect_row(e) for e in self.effects])
        self._show_tool(to)
        self._show_apart(to)

    def _show_alone(self, to: Reporter) -> None:
        equals = () if self.alone is None else self.alone.equals(self.named)
        if self.unchanged or not self.compared.test.dof or not equals:
            return
        first, *others = equals
        since = self.compared.course.since
        if since is not None:
            to.say(f"a step explains it better than a trend: changed from {letter(since)} on")
        if first.explains:
            to.say(f"explained by one parameter alone: {self._single(first)}")
        else:
            left = f"p {first.p_left:.2g} of what is left"
            to.say(f"no single parameter explains it; most of it: {self._single(first)} ({left})")
        if others:
            to.say(f"or, not told from it, by another alone: {_listed([self._single(r) for r in others])}")

    def _single(self, one: Single) -> str:
        """A parameter with the change by which it alone explains what it explains."""
        unit, per = self.unit(one.name), " per day" if self.compared.course.rate else ""
        return f"{one.name} by {uncertain(one.value / unit.scale, one.std / unit.scale, unit.text)}{per}"

    def _between(self, before: str = " from ") -> str:
        """Between which of more than two files something changes, after a text."""
        since, times = self.compared.course.since, self.compared.course.times
        if since is not None:
            return f" from {letter(since)} on"
        first, last = times.index(min(times)), times.index(max(times))
        return f"{before}{letter(first)} to {letter(last)}" if len(times) > 2 else ""

    def unit(self, name: str) -> Unit:
        """Display unit of a parameter."""
        return next(k.parameters[name].unit for k in self.known if name in k.parameters)

    def _parameter_rows(self) -> list[tuple[str, ...]]:
        changes, rows = self.changes, list[tuple[str, ...]]()
        for k, name in enumerate(changes.names):
            unit = self.unit(name)
            stated = [f.parameters[name] for f in self.known]
            values = [uncertain(unit.from_si(p.value), p.std / unit.scale, unit.text) for p in stated]
            size = uncertain(float(changes.values[k]) / unit.scale, float(changes.std[k]) / unit.scale, unit.text)
            known = bool(changes.determined[k])
            p = f"{changes.holm[k]:.2g}" if known else "-"
            rows.append((name, *values, size, p, self._remark(k)))
        return rows

    def _remark(self, k: int) -> str:
        """What the tests say of a parameter."""
        changes, one, name = self.changes, self.alone, self.changes.names[k]
        by_itself = not self.unchanged and changes.holm[k] < self.alpha
        if name in self.named:
            return "CHANGED" if by_itself else "explains the change"
        if by_itself and one is not None:
            return f"not needed: {one.name} alone explains all"
        return "" if changes.determined[k] else "not determined by all"

    def _effect_row(self, effect: Effect) -> tuple[str, ...]:
        sizes, scale = [effect.sizes.get(i) for i in range(len(self.known))], effect.unit.scale
        shown = ["-" if s is None else uncertain(s[0] / scale, s[1] / scale, effect.unit.text) for s in sizes]
        return (effect.name, *shown, effect.remark(len(self.known), self.alpha))

    def _show_tool(self, to: Reporter) -> None:
        if self.tool is None:
            return
        if isinstance(self.tool, str):
            to.say(f"change of the tool point: not available ({self.tool})")
            return
        t, unit = self.tool, self.tool.file_unit
        alone = f", by {t.alone} alone" if t.alone else ""
        where = ", ".join(f"{axis} = {v / unit.scale:.4g} {unit.text}" for axis, v in t.where.items())
        changed = "the tool point's orientation" if t.turns else "the tool point"
        to.say(
            f"change of {changed}{self._between()} over the {t.over}{alone}: {readable(t.rms, unit)} rms "
            f"({readable(t.rms_by_chance, unit)} by chance alone), largest {readable(t.largest, unit)} "
            f"(u {readable(t.std, unit)}) at {where}" + ("" if t.alone else _UNSEEN)
        )

    def _show_apart(self, to: Reporter) -> None:
        """What was not compared."""
        by_files: dict[tuple[int, ...], list[str]] = {}
        for name, where in self.compared.apart.items():
            by_files.setdefault(where, []).append(name)
        for where, names in by_files.items():
            lone = len(where) < len(self.known)
            label = f"without partner, only in {', '.join(letter(i) for i in where)}" if lone else "not compared"
            to.say(f"{label}: {_listed(names)}")

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        c, t = self.compared, self.compared.test
        return {
            "kind": "parameters",
            "verdict": "no change" if self.unchanged else "changed" if t.dof else "nothing in common",
            "named": list(self.named),
            "files": [
                {
                    "file": k.file,
                    "created": None if k.created is None else k.created.isoformat(),
                    "measured_from": None if k.measured is None else k.measured[0].isoformat(),
                    "measured_to": None if k.measured is None else k.measured[1].isoformat(),
                    "status": k.ending.status,
                }
                for k in self.known
            ],
            "test": {
                "statistic": finite(t.statistic),
                "degrees_of_freedom": t.dof,
                "noise_degrees_of_freedom": finite(t.freedom),
                "p_value": finite(t.p_value),
                "alpha": self.alpha,
            },
            "alone": None if self.alone is None else self._alone_json(self.alone),
            "per": "day" if c.course.rate else None,
            "since": None if c.course.since is None else self.known[c.course.since].file,
            "parameters": [self._parameter_json(k) for k in range(len(self.changes.names))],
            "effects": [e.json(len(self.known), self.alpha) for e in self.effects],
            "tool_point": self._tool_json(),
            "apart": [{"name": n, "files": [self.known[i].file for i in w]} for n, w in c.apart.items()],
        }

    def _alone_json(self, one: Alone) -> dict[str, Any]:
        explains, rivals = not self.unchanged and one.explains, [self._single_json(r) for r in one.rivals]
        return self._single_json(one) | {"explains": explains, "rivals": rivals}

    def _single_json(self, one: Single) -> dict[str, Any]:
        unit = self.unit(one.name)
        return {
            "name": one.name,
            "change": one.value / unit.scale,
            "std": one.std / unit.scale,
            "unit": unit.text,
            "p_value_left": finite(one.p_left),
        }

    def _parameter_json(self, k: int) -> dict[str, Any]:
        changes = self.changes
        name = changes.names[k]
        unit = self.unit(name)
        return {
            "name": name,
            "values": [unit.from_si(f.parameters[name].value) for f in self.known],
            "change": float(changes.values[k]) / unit.scale,
            "std": float(changes.std[k]) / unit.scale,
            "unit": unit.text,
            "determined": bool(changes.determined[k]),
            "p_value": finite(float(changes.p_values[k])),
            "p_value_holm": finite(float(changes.holm[k])),
            "changed": name in self.named,
        }

    def _tool_json(self) -> dict[str, Any] | None:
        if self.tool is None or isinstance(self.tool, str):
            return None
        t, (small, at) = self.tool, self.tool.units
        return {
            "rms": t.rms / small.scale,
            "rms_by_chance": t.rms_by_chance / small.scale,
            "max": t.largest / small.scale,
            "std": t.std / small.scale,
            "unit": small.text,
            "at": {axis: v / at.scale for axis, v in t.where.items()},
            "at_unit": at.text,
            "count": t.count,
            "over": t.over,
            "alone": t.alone,
        }


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more
