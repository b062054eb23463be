"""The result of `effects --simulate`: what each effect moves, what parameters take up, what moves nothing and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.diagnosis.simulated_effects import Movement, SimulatedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import finite, handy, readable
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.report.sentences import listed
from pkmcal_cli.units.unit_text import Unit, parse_unit

_HEADERS = ("effect", "parameter", "size", "reading", "largest", "rms", "remark")
_NAMED = 8  # places that are named in a line


@dataclass(frozen=True)
class Absent:
    """An effect that was not simulated: at a place, "" for everywhere."""

    effect: str
    at: str
    reason: str


@dataclass(frozen=True)
class EffectsReport:
    """Simulated effects, ready to be shown. `poses`: their number."""

    model: Model
    poses: int
    simulated: tuple[SimulatedEffect, ...]
    absent: tuple[Absent, ...]

    # --- tables ----------------------------------------------------------------------------
    def show(self, to: Reporter) -> None:
        """What moves readings, what parameters take up, what moves nothing."""
        moving = [s for s in self.simulated if not s.reason]
        title = f"Changes of readings by effects of plausible size, {count(self.poses, 'pose')}"
        self._table(to, title, moving, False)
        self._table(to, "Taken up: a calibration moves identified parameters instead", moving, True)
        still = [Absent(s.hypothesis.effect, s.hypothesis.at, s.reason) for s in self.simulated if s.reason]
        rows = self._reasons((*still, *self.absent))
        if rows:
            to.say()
            to.table("Moves nothing", ("effect", "at", "reason"), rows, left=3, folded=("at", "reason"))

    def _table(self, to: Reporter, title: str, moving: Sequence[SimulatedEffect], taken: bool) -> None:
        rows = [self._cells(s) for s in moving if bool(s.taken_up_by) == taken]
        if rows:
            to.say()
            to.table(title, _HEADERS, rows, left=2)

    def _cells(self, s: SimulatedEffect) -> tuple[str, ...]:
        movement, channel = s.leading
        remarks = [f"by {listed(s.taken_up_by, 4)}"] if s.taken_up_by else []
        if movement.lost:
            remarks.append(f"no solution in {count(len(movement.lost), 'pose')}: {next(iter(movement.lost.values()))}")
        return (
            s.hypothesis.name,
            movement.parameter.rpartition(".")[2],
            handy(movement.size, parameter_unit(self.model, movement.parameter)),
            self.model.channels[channel].name,
            readable(float(movement.largest[channel]), self._unit(channel)),
            readable(float(movement.rms[channel]), self._unit(channel)),
            "; ".join(remarks),
        )

    def _reasons(self, absent: Sequence[Absent]) -> list[tuple[str, str, str]]:
        """One line for each effect and reason."""
        places: dict[tuple[str, str], list[str]] = {}
        for a in absent:
            places.setdefault((a.effect, a.reason), []).append(a.at)
        return sorted((effect, listed([p for p in at if p], _NAMED), why) for (effect, why), at in places.items())

    def _unit(self, channel: int) -> Unit:
        """Of a reading: the file's for lengths and angles, which `readable` shortens."""
        return parse_unit(self.model.channels[channel].unit)

    # --- JSON ------------------------------------------------------------------------------
    def json(self) -> dict[str, Any]:
        """The JSON result; values in the units beside them."""
        return {
            "n_poses": self.poses,
            "simulated": [*(self._json(s) for s in self.simulated), *(self._absent_json(a) for a in self.absent)],
        }

    def _json(self, s: SimulatedEffect) -> dict[str, Any]:
        movement, channel = s.leading
        reading = {} if s.reason else self._reading_json(movement, channel)
        return {
            "effect": s.hypothesis.effect,
            "at": s.hypothesis.at,
            "status": "nothing" if s.reason else "taken_up" if s.taken_up_by else "moves",
            "parameter": movement.parameter if reading else None,
            "reading": reading.get("name"),
            "max": reading.get("max"),
            "rms": reading.get("rms"),
            "unit": reading.get("unit"),
            "taken_up_by": list(s.taken_up_by),
            "reason": s.reason or (f"taken up by {', '.join(s.taken_up_by)}" if s.taken_up_by else None),
            "parameters": [self._movement_json(m) for m in s.movements],
        }

    def _movement_json(self, m: Movement) -> dict[str, Any]:
        unit = parameter_unit(self.model, m.parameter)
        return {
            "name": m.parameter,
            "size": m.size / unit.scale,
            "unit": unit.text,
            "n_lost": len(m.lost),
            "readings": [self._reading_json(m, c) for c in range(len(self.model.channels))],
        }

    def _reading_json(self, m: Movement, channel: int) -> dict[str, Any]:
        unit = self._unit(channel)
        largest, rms = (finite(float(x[channel]) / unit.scale) for x in (m.largest, m.rms))
        return {"name": self.model.channels[channel].name, "max": largest, "rms": rms, "unit": unit.text}

    @staticmethod
    def _absent_json(a: Absent) -> dict[str, Any]:
        nothing = dict.fromkeys(("parameter", "reading", "max", "rms", "unit"))
        lists: dict[str, Any] = {"taken_up_by": [], "reason": a.reason, "parameters": []}
        return {"effect": a.effect, "at": a.at or None, "status": "nothing"} | nothing | lists
