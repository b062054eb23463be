"""What may be missing: every effect at every place that the table can show, and parameters that are held fixed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.compiler.effects import placed_effect, possible_effects
from pkmcal_cli.effects import Column, Effect, catalogue
from pkmcal_cli.loading.covariates import with_covariates
from pkmcal_cli.model.effect_sites import PlacedEffect, Socket
from pkmcal_cli.model.model import Model, ModelParameter
from pkmcal_cli.prediction import Rows
from pkmcal_cli.tables.measurement_set import Measurements

RELEASE = "release"
_WORDS: dict[Column, str] = {
    "time": "column `time`",
    "temperature": "column `T` or `T.PART` (temperature)",
    "direction": "columns `dir.ACTUATOR` (direction of approach)",
    "payload": "column `payload`",
    "session": "at least two sessions",
    "spindle": "column `spindle` (angle of the spindle)",
}


@dataclass(frozen=True)
class Hypothesis:
    """One candidate: `KEYWORD@PLACE`, or `release NAME` of a parameter that is held at nominal."""

    effect: str
    at: str
    parameters: tuple[str, ...]
    measurement: bool = False  # a fault of the measurement, not of the machine

    @property
    def name(self) -> str:
        """How it is called everywhere."""
        return f"{RELEASE} {self.at}" if self.effect == RELEASE else f"{self.effect}@{self.at}"


@dataclass(frozen=True)
class Candidates:
    """A model with all testable effects at null, the hypotheses, and effects that the table cannot show."""

    model: Model
    hypotheses: tuple[Hypothesis, ...]
    not_testable: tuple[tuple[str, str], ...]  # (keyword, what it needs)


def candidates(model: Model, selected: tuple[str, ...], measurements: Measurements) -> Candidates:
    """Hypotheses that a table of measurements can show; see `candidates_of`."""
    return candidates_of(model, selected, with_covariates(Rows.at(measurements.actuators), measurements))


def candidates_of(model: Model, selected: tuple[str, ...], rows: Rows) -> Candidates:
    """Hypotheses for a model that takes effects, of which `selected` parameters are identified anyway."""
    planar = model.layout.planar
    names = [name.removeprefix("session.") for name in rows.columns if name.startswith("session.")]
    sessions = tuple(names) if len(names) > 2 else tuple(names[1:])  # of two, the first is the datum
    declared = {(e.effect.keyword, e.at) for e in model.effects}
    effects: list[PlacedEffect] = []
    parameters: list[ModelParameter] = []
    found: list[Hypothesis] = []
    lacking: dict[str, str] = {}
    for effect, at, sockets in possible_effects(model, sessions):
        if (effect.keyword, at) in declared:
            continue
        missing = list(_missing(effect, sockets, rows))
        if missing:
            lacking.setdefault(effect.keyword, missing[0])
            continue
        placed, mine = placed_effect(effect, at, sockets, planar)
        effects.append(placed)
        parameters += mine
        found.append(Hypothesis(effect.keyword, at, placed.parameters, effect.measurement))
    if not sessions:
        lacking |= {e.keyword: _WORDS["session"] for e in catalogue().values() if e.places == "session"}
    held = [p.name for p in model.parameters if p.name not in selected]
    found += [Hypothesis(RELEASE, name, (name,)) for name in held]
    tested = {h.effect for h in found}
    not_testable = tuple((k, why) for k, why in sorted(lacking.items()) if k not in tested)
    return Candidates(model.with_effects(tuple(effects), tuple(parameters)), tuple(found), not_testable)


def _missing(effect: Effect, sockets: tuple[Socket, ...], rows: Rows) -> Iterator[str]:
    """What the table or the machine file lacks for an effect at these sockets."""
    columns = {name: bool(np.isfinite(values).all()) for name, values in rows.columns.items()}
    parts = {s.part for s in sockets}
    for need in effect.needs:
        if need == "temperature":
            if not columns.get("T") and not all(columns.get(f"T.{part}") for part in parts):
                yield _WORDS[need]
        elif need in ("time", "payload", "spindle") and not columns.get(need):
            yield _WORDS[need]
    for option in effect.options:
        if option.name == "period" and any(np.isnan(s.period) for s in sockets):
            yield "`period` of the actuator in the machine file"
