"""What may be missing: every effect at every place that the table can show, and parameters that are held fixed."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.compiler.placed_effects import placed_effect, possible_effects
from pkmcal_cli.effects import Column, Effect, catalogue
from pkmcal_cli.effects.effect import EffectParameter
from pkmcal_cli.loading.covariates import with_covariates
from pkmcal_cli.model.effect_sites import ALL, EffectSite, PlacedEffect, parameters_at, place_and_session, together
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import ModelParameter
from pkmcal_cli.prediction import Rows
from pkmcal_cli.tables.measurement_set import Measurements

RELEASE = "release"
_DECLARED = 2.0  # log odds of a parameter that a machine file names and holds, before any single effect
_SAME = 1e-3  # of a force: what rounding of its column makes
_WORDS: dict[Column, str] = {
    "time": "column `time`",
    "temperature": "column `T` or `T.PART` (temperature)",
    "direction": "columns `dir.ACTUATOR` (approach direction)",
    "payload": "column `payload`",
    "session": "at least two sessions",
    "spindle": "column `spindle` (spindle angle)",
    "force": "column `ACTUATOR.force` in which the force varies",
}


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """One candidate: `KEYWORD@PLACE`, or `release NAME` of a parameter that is held at its start.

    `KEYWORD@each`, `KEYWORD@each:GROUP`: at several places, with values of its own at each; in a session,
    `KEYWORD@each[SESSION]`, or in all of them, `KEYWORD@PLACE[each]`; `members`: what it consists of. `parts`: its
    parameters up to each order but the highest, and of harmonics each by itself, of which the best stands for it.
    """

    effect: str
    at: str
    parameters: tuple[str, ...]
    measurement: bool = False  # a fault of the measurement, not of the machine
    free: tuple[str, ...] = ()  # of its parameters, those that are fitted with it but no evidence for it
    known: tuple[tuple[str, float], ...] = ()  # of its parameters, those that have a value (SI) where it is accepted
    members: tuple[Hypothesis, ...] = ()
    parts: tuple[tuple[str, ...], ...] = field(default=(), compare=False)
    begin: tuple[tuple[str, float], ...] = field(default=(), compare=False)  # values (SI) that fits begin with

    @cached_property
    def nested_parts(self) -> tuple[Hypothesis, ...]:
        """It with fewer numbers, up to each order or of one harmonic, and with all of them."""
        return (*(self._of(names) for names in self.parts), self.whole)

    @property
    def whole(self) -> Hypothesis:
        """It with all its numbers."""
        return replace(self, parts=())

    def without(self, member: Hypothesis) -> Hypothesis:
        """A group without one of its members."""
        gone = set(member.parameters)
        kept = self._of([n for n in self.parameters if n not in gone])
        return replace(kept, members=tuple(m for m in kept.members if m.at != member.at))

    def beyond(self, part: Hypothesis) -> Hypothesis:
        """It with more numbers than a part of it has."""
        return replace(self, parts=tuple(p for p in self.parts if len(p) > len(part.parameters)))

    def _of(self, names: Collection[str]) -> Hypothesis:
        return replace(
            self,
            parameters=tuple(n for n in self.parameters if n in names),
            free=tuple(n for n in self.free if n in names),
            known=tuple(k for k in self.known if k[0] in names),
            members=tuple(m._of(names) for m in self.members),
            parts=(),
        )

    @property
    def unknown(self) -> tuple[str, ...]:
        """Its parameters that a fit finds."""
        known = dict(self.known)
        return tuple(n for n in self.parameters if n not in known)

    @property
    def preference(self) -> float:
        """Log evidence by which it goes before others: a declared parameter, before effects that imitate it. A group
        comes after them: several places at once are less likely than one. What changes between sessions does in all."""
        places = {place_and_session(m.at)[0] for m in self.placed}
        return _DECLARED if self.effect == RELEASE else -float(np.log(len(places)))

    @property
    def placed(self) -> tuple[Hypothesis, ...]:
        """Itself, or the members that it consists of: each is an effect at one place."""
        return self.members or (self,)

    def contains(self, other: Hypothesis) -> bool:
        """Whether another one is among its members, or a part of it."""
        if other.name == self.name:
            return set(other.parameters) < set(self.parameters)
        names, others = {m.name for m in self.members}, {m.name for m in other.members}
        return other.name in names or (bool(others) and others < names)

    def nested(self, other: Hypothesis) -> bool:
        """Whether both are at several places, one at some of the other's."""
        return bool(self.members and other.members) and (self.contains(other) or other.contains(self))

    def akin(self, other: Hypothesis) -> bool:
        """Whether both are the same effect, one of them at several places with values of its own."""
        return self.effect == other.effect and bool(self.members or other.members)

    def spread(self, others: Sequence[Hypothesis]) -> bool:
        """Whether others are the same effect, spread otherwise: a group for one of its places or for `all`; for a group
        most of its places, or one value at several."""
        same, places = [h for h in others if h.effect == self.effect], {h.at for h in self.placed}
        acting = {p.at for h in same for p in h.placed}
        if not self.members:
            return any(h.members for h in same) and bool(places & (acting | {ALL}))
        together = any(not h.members and h.at not in places for h in same)
        return together or 2 * len(places & acting) > len(places)

    @property
    def session(self) -> str:
        """The session of its place in which alone it acts; "" without one."""
        return place_and_session(self.at)[1]

    @property
    def name(self) -> str:
        """How it is called everywhere."""
        return f"{RELEASE} {self.at}" if self.effect == RELEASE else f"{self.effect}@{self.at}"


@dataclass(frozen=True)
class Candidates:
    """A model with all testable effects at null, the hypotheses, and effects that the table cannot show.

    `lacking`: the same by keyword and place, of every place, and what it needs. `start` (P,): values, SI, that fits
    begin with and that held parameters have; None for nominal ones. `only`: names that alone are tested, those of
    displacements without a name among them; None: all.
    """

    model: Model
    hypotheses: tuple[Hypothesis, ...]
    not_testable: tuple[tuple[str, str], ...]  # (keyword, what it needs)
    lacking: tuple[tuple[str, str, str], ...] = ()
    start: Array | None = field(default=None, compare=False)
    only: tuple[str, ...] | None = None

    def limited_to(self, names: tuple[str, ...]) -> Candidates:
        """The same, of which some alone are tested."""
        return replace(self, only=names, hypotheses=tuple(h for h in self.hypotheses if h.name in names))

    def tests(self, name: str) -> bool:
        """Whether what is called so may be tested."""
        return self.only is None or name in self.only

    def begin(self, accepted: Sequence[Hypothesis] = ()) -> Array:
        """Values (P,), SI, that a fit with effects begins with: the start, what is known of these, or far off."""
        values = self.model.nominal if self.start is None else self.start.copy()
        for name, value in (value for h in accepted for value in (*h.known, *h.begin)):
            values[self.model.names.index(name)] = value
        return values

    @property
    def single(self) -> tuple[Hypothesis, ...]:
        """Those at one place, or with the same value at several."""
        return tuple(h for h in self.hypotheses if not h.members)


def candidates(model: Model, selected: tuple[str, ...], measurements: Measurements) -> Candidates:
    """Hypotheses that a table of measurements can show; see `candidates_of`."""
    rows = replace(Rows.at(measurements.actuators), forces=measurements.forces)
    return candidates_of(model, selected, with_covariates(rows, measurements))


def candidates_of(model: Model, selected: tuple[str, ...], rows: Rows) -> Candidates:
    """Hypotheses for a model that takes effects, of which `selected` parameters are identified anyway."""
    planar = model.topology.planar
    sessions = _in_order(rows)
    sessions = sessions if len(sessions) > 2 else sessions[1:]  # of two, the first is the datum
    declared = {(e.effect.keyword, e.at) for e in model.effects}
    effects: list[PlacedEffect] = []
    parameters: list[ModelParameter] = []
    hypotheses: list[Hypothesis] = []
    lacking: list[tuple[str, str, str]] = []
    for effect, at, sites in possible_effects(model, sessions):
        if (effect.keyword, at) in declared:
            continue
        missing = list(_missing(effect, sites, rows))
        if missing:
            lacking.append((effect.keyword, at, missing[0]))
            continue
        placed, own_parameters = placed_effect(effect, at, sites, planar, size=model.length)
        effects.append(placed)
        parameters += own_parameters
        hypotheses.append(_hypothesis(placed, parameters_at(effect, sites, planar)))
    if not sessions:
        of_sessions = [e.keyword for e in catalogue().values() if e.places == "session" and model.sites.get(e.enters)]
        lacking += [(keyword, "", _WORDS["session"]) for keyword in of_sessions]
    hypotheses += _together(model, hypotheses, sessions)
    held = [p.name for p in model.parameters if p.name not in selected and not p.fixed]
    hypotheses += [Hypothesis(effect=RELEASE, at=name, parameters=(name,)) for name in held]
    tested = {h.effect for h in hypotheses}
    first = {keyword: why for keyword, _, why in reversed(lacking)}
    not_testable = tuple((k, why) for k, why in sorted(first.items()) if k not in tested)
    full = model.with_effects(tuple(effects), tuple(parameters))
    return Candidates(full, tuple(hypotheses), not_testable, tuple(lacking))


def _in_order(rows: Rows) -> tuple[str, ...]:
    """Sessions by the clock, where there is one, else as they come in the table, which may be shuffled."""
    time = rows.columns.get("time")
    if time is None or not np.isfinite(time).all():
        return rows.session_names
    begun = {s: time.min(where=rows.columns[f"session.{s}"] > 0, initial=np.inf) for s in rows.session_names}
    return tuple(sorted(begun, key=lambda s: float(begun[s])))


def _hypothesis(placed: PlacedEffect, specs: Sequence[EffectParameter]) -> Hypothesis:
    by_name = dict(zip(placed.parameters, specs, strict=True))
    orders = sorted({spec.order for spec in specs if not spec.free})
    some = [range(k + 1) for k in orders[:-1]]
    if placed.effect.harmonics:
        some += [range(k, k + 1) for k in orders[1:]]
    return Hypothesis(
        effect=placed.effect.keyword,
        at=placed.at,
        parameters=placed.parameters,
        measurement=placed.effect.measurement,
        free=tuple(n for n, spec in by_name.items() if spec.free),
        known=tuple((n, spec.known) for n, spec in by_name.items() if spec.known is not None),
        parts=tuple(tuple(n for n, spec in by_name.items() if spec.order in part) for part in some),
    )


def _together(model: Model, single: Sequence[Hypothesis], sessions: tuple[str, ...]) -> Iterator[Hypothesis]:
    """The same effects at several places with values of their own, where they can be at all of these."""
    by_name = {h.name: h for h in single}
    for effect in catalogue().values():
        for at, inside in together(model.sites, effect, model.effect_groups, sessions).items():
            members = tuple(by_name[n] for p in inside if (n := f"{effect.keyword}@{p}") in by_name)
            if len(members) == len(inside):
                yield Hypothesis(
                    effect=effect.keyword,
                    at=at,
                    parameters=tuple(n for h in members for n in h.parameters),
                    measurement=effect.measurement,
                    free=tuple(n for h in members for n in h.free),
                    known=tuple(k for h in members for k in h.known),
                    members=members,
                    parts=tuple(_up_to(members, level) for level in range(max(len(h.parts) for h in members))),
                )


def beside_unknown_sides(problem: Problem, declared: Collection[str], accepted: Sequence[Hypothesis]) -> Problem:
    """The problem in whose rows without a side reversal errors are part of the uncertainty: declared and accepted."""
    return with_unknown_sides(problem, {*declared, *(n for h in accepted for n in h.unknown)})


def _up_to(members: Sequence[Hypothesis], level: int) -> tuple[str, ...]:
    """The parameters of members in their parts up to some order, counted from the lowest."""
    return tuple(n for h in members for n in ((*h.parts, h.parameters)[min(level, len(h.parts))]))


def _missing(effect: Effect, sites: tuple[EffectSite, ...], rows: Rows) -> Iterator[str]:
    """What the table or the machine file lacks for an effect at these effect sites."""
    columns = {name: bool(np.isfinite(values).all()) for name, values in rows.columns.items()}
    parts = {s.part for s in sites}
    for need in effect.needs:
        if need == "temperature":
            if not columns.get("T") and not all(columns.get(f"T.{part}") for part in parts):
                yield _WORDS[need]
        elif need == "force":
            if not _vary(rows, sites):
                yield _WORDS[need]
        elif need in ("time", "payload", "spindle") and not columns.get(need):
            yield _WORDS[need]
    for option in effect.options:
        if option.name == "period" and any(np.isnan(s.period) for s in sites):
            yield "`period` of the actuator in the machine file"


def _vary(rows: Rows, sites: Sequence[EffectSite]) -> bool:
    """Whether the force of some drive takes several values, so that its scale is not an offset."""
    forces = rows.forces[:, [site.actuator for site in sites]]
    known = [force[np.isfinite(force)] for force in forces.T]
    return any(bool(f.size) and float(np.ptp(f)) > _SAME * float(np.abs(f).max()) for f in known)
