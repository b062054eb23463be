"""Names: every reference leads somewhere, every thing is used, points have one name each."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pkmcal_cli.base.errors import FaultList, did_you_mean
from pkmcal_cli.expressions.parse import RESERVED
from pkmcal_cli.language.checks.validation import Aside
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Draft
from pkmcal_cli.language.sections import driven_sections, must_be_used, nouns, sections_with
from pkmcal_cli.language.walk import drafts
from pkmcal_cli.units.unit_text import UNITS
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_POINTS = ("nodes", "ground", "bodies")


@dataclass(kw_only=True)
class NameCheck:
    """Checks the names of a machine with drafts; faults are added at their places.

    Names that occur in entries set aside for other faults are excused.
    """

    machine: Machine
    source: SourceMap
    faults: FaultList
    aside: Aside = field(default_factory=Aside)
    excused: frozenset[str] = frozenset()
    points: dict[str, Path] = field(default_factory=dict)
    used: dict[str, set[str]] = field(default_factory=dict)

    def run(self) -> None:
        """All checks."""
        self.excused = self.aside.words()
        self.used = {section: set() for section in (*nouns(), "points")}
        self._collect_points()
        self._check_references()
        self._check_parameters()
        self._check_unused()

    def _collect_points(self) -> None:
        machine = self.machine
        named: list[tuple[str, Path]] = []
        for section in _POINTS:
            named += [(name, (section, name)) for name in getattr(machine, section)]
        for body, about in machine.bodies.items():
            named += [(name, ("bodies", body, "points", name)) for name in about.points]
        named.sort(key=lambda pair: self.source.key(pair[1]))
        for name, path in named:
            first = self.points.setdefault(name, path)
            if first != path:
                line = self.source.key(first).line
                what = f"the name `{name}` is taken: a {_kind(first)} has it in line {line}"
                hint = "nodes, ground points, bodies and their points share one set of names"
                self._fault("name", what, path, hint, at_key=True)

    def _fault(self, code: str, what: str, path: Path, hint: str | None, **more: Any) -> None:
        self.faults.add(self.source.fault(code, what, path, hint, **more))

    def _check_references(self) -> None:
        machine = self.machine
        for name, guide in machine.guides.items():
            self._refer("frames", guide.frame, ("guides", name, "frame"))
        for name, body in machine.bodies.items():
            self._refer("guides", body.on, ("bodies", name, "on"))
        for section in sections_with("between"):
            things: Mapping[str, Any] = getattr(machine, section)
            for name, thing in things.items():
                self._check_ends(thing.between, (section, name, "between"))
        for name, beam in machine.beams.items():
            self._refer("sections", beam.section, ("beams", name, "section"))
            self._refer("materials", beam.material, ("beams", name, "material"))
        for name, load in machine.loads.items():
            self._point(load.at, ("loads", name, "at"))
        for name, sensor in machine.sensors.items():
            for index, point in enumerate(sensor.at):
                self._point(point, ("sensors", name, "at", index) if len(sensor.at) > 1 else ("sensors", name, "at"))
            if sensor.to is not None:
                self._point(sensor.to, ("sensors", name, "to"))
            self._refer("frames", sensor.on, ("sensors", name, "on"))
            self._refer("actuators", sensor.drive, ("sensors", name, "drive"))
        self._check_targets()

    def _check_ends(self, between: tuple[str, str], path: Path) -> None:
        for index, point in enumerate(between):
            self._point(point, (*path, index))
        if between[0] == between[1]:
            what = f"it joins `{between[0]}` to itself"
            self._fault("value", what, (*path, 1), "between: two different points")

    def _check_targets(self) -> None:
        taken: dict[tuple[str, str], str] = {}
        for name, actuator in self.machine.actuators.items():
            for key, sections in driven_sections().items():
                target: str | None = getattr(actuator, key)
                if target is None:
                    continue
                path: Path = ("actuators", name, key)
                self._refer_any(sections, target, path)
                other = taken.setdefault((sections[0], target), name)
                if other != name:
                    what = f"`{target}` is driven by `{other}` already"
                    self._fault("value", what, path, "one actuator a thing")

    def _refer(self, section: str, name: str | None, path: Path) -> None:
        if name is not None:
            self._refer_any((section,), name, path)

    def _refer_any(self, sections: Iterable[str], name: str, path: Path) -> None:
        """A reference to a thing of one of these sections."""
        sections = tuple(sections)
        known = [section for section in sections if name in getattr(self.machine, section)]
        for section in known:
            self.used[section].add(name)
        kinds = " or ".join(nouns()[section] for section in sections)
        if len(known) > 1:
            what = f"`{name}` is both a {nouns()[known[0]]} and a {nouns()[known[1]]}"
            self._fault("name", what, path, "give one of them another name")
        if known or name in self.excused:
            return
        names = [each for section in sections for each in (*getattr(self.machine, section), *self.aside.names(section))]
        self._fault("unknown-name", f"unknown {kinds} `{name}`", path, self._hint(name, names, kinds))

    def _point(self, name: str, path: Path) -> None:
        """A reference to a node, ground point, body or body's point."""
        where = self.points.get(name)
        if where is not None:
            self.used[str(where[0]) if len(where) == 2 else "points"].add(name)
        elif name not in self.excused:
            also = [n for section in _POINTS for n in self.aside.names(section)]
            hint = self._hint(name, [*self.points, *also], "point")
            self._fault("unknown-name", f"unknown point `{name}`", path, hint)

    def _hint(self, name: str, names: Iterable[str], kind: str) -> str:
        """The nearest name; what else has this name; which names there are."""
        if name.startswith("{"):
            return "names in braces need `each: {i: [...]}` in this entry"
        for section, other in nouns().items():
            if name in getattr(self.machine, section):
                return f"`{name}` is a {other}, not a {kind}"
        if name in self.points:
            return f"`{name}` is a {_kind(self.points[name])}, not a {kind}"
        return did_you_mean(name, names) or f"declare it as a {kind}"

    def _check_parameters(self) -> None:
        for name in self.machine.parameters:
            if name in RESERVED:
                self._fault(
                    "name", f"`{name}` is a reserved word", ("parameters", name),
                    "choose another name", at_key=True,
                )  # fmt: skip
        for index, name in enumerate(self.machine.datum):
            if name not in self.machine.parameters and "@" not in name and name not in self.excused:
                hint = did_you_mean(name, self.machine.parameters)
                self._fault("unknown-name", f"unknown parameter `{name}`", ("datum", index), hint)
        for path, draft in drafts(self.machine):
            if path[0] in ("parameters", "ranges", "effects") or draft.tree is None:
                continue
            for name in draft.names:
                if name in self.machine.parameters:
                    self.used["parameters"].add(name)
                    self._check_per_session(name, path)
                elif name not in self.excused:
                    self._unknown_parameter(name, draft, path)

    def _check_per_session(self, name: str, path: Path) -> None:
        """What every session has for itself belongs to instruments, not to the machine."""
        section, thing = path[0], str(path[1])
        machine = self.machine
        touched = {s.on for s in machine.sensors.values()}
        seen = {s.to for s in machine.sensors.values()}
        mine = (
            section == "sensors"
            or (section == "frames" and thing in touched)
            or (section == "ground" and thing in seen)
        )
        built = {g.frame for g in machine.guides.values()}
        joined = {p for kind in sections_with("between") for t in getattr(machine, kind).values() for p in t.between}
        if machine.parameters[name].per == "session" and (not mine or thing in built | joined):
            what = f"parameter `{name}` has a value for every session, but this is a part of the machine"
            self._fault("value", what, path, "only what belongs to sensors can differ from session to session")

    def _unknown_parameter(self, name: str, draft: Draft, path: Path) -> None:
        assert draft.tree is not None
        places = [n.col_offset for n in ast.walk(draft.tree) if isinstance(n, ast.Name) and n.id == name]
        if name.lower() in ("nan", "inf", "infinity"):
            what, hint = f"`{name}` is no finite number", None
            self._fault("value", what, path, hint, offset=min(places))
            return
        names = [*self.machine.parameters, *self.aside.names("parameters")]
        hint = did_you_mean(name, names, "declare it in `parameters:`")
        if name in UNITS and draft.text != name:
            hint = f"a unit stands after one number only (`12 {name}`), not in an expression"
        self._fault("unknown-name", f"unknown parameter `{name}`", path, hint, offset=min(places))

    def _check_unused(self) -> None:
        for section in must_be_used():
            for name in getattr(self.machine, section):
                if name not in self.used[section] | self.excused | RESERVED:
                    what = f"{nouns()[section]} `{name}` is used by nothing"
                    self._fault("unused-name", what, (section, name), "use it or delete it", at_key=True)
        for body, about in self.machine.bodies.items():
            for name in about.points:
                if name not in self.used["points"] and name not in self.excused:
                    what = f"point `{name}` of body `{body}` is used by nothing"
                    path: Path = ("bodies", body, "points", name)
                    self._fault("unused-name", what, path, "use it or delete it", at_key=True, warning=True)


def _kind(path: Path) -> str:
    if len(path) > 2:
        return f"point of body `{path[1]}`"
    return nouns()[str(path[0])]
