"""Names: every reference leads somewhere, every thing is used, points have one name each."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from pkmcal_cli.base.errors import FaultList, Location, did_you_mean
from pkmcal_cli.base.plural import with_article
from pkmcal_cli.expressions.parser import RESERVED
from pkmcal_cli.language.checks.groups import check_groups
from pkmcal_cli.language.checks.validation import Quarantine
from pkmcal_cli.language.fields import NAME
from pkmcal_cli.language.machine import Rope, WrittenMachine
from pkmcal_cli.language.quantities import Written, WrittenValue
from pkmcal_cli.language.sections import GROUND, driven_sections, must_be_used, nouns, sections_with
from pkmcal_cli.language.walk import written_values
from pkmcal_cli.units.unit_text import UNITS
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_POINTS = ("nodes", "ground", "bodies")
_LISTED = 6


@dataclass(kw_only=True)
class NameCheck:
    """Checks the names of a machine with values as written; faults are added at their places.

    Names that occur in entries quarantined for other faults are excused.
    """

    machine: WrittenMachine
    source: SourceMap
    faults: FaultList
    quarantined: Quarantine = field(default_factory=Quarantine)
    excused: frozenset[str] = frozenset()
    points: dict[str, Path] = field(default_factory=dict)
    used: dict[str, set[str]] = field(default_factory=dict)

    def run(self) -> None:
        """All checks."""
        self.excused = self.quarantined.words()
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
                message = f"the name `{name}` is already used by {with_article(_kind(first))} in line {line}"
                hint = "choose another name: nodes, ground points, bodies and their points share one set of names"
                self._fault("name", message, path, hint, at_key=True)

    def _fault(self, code: str, message: str, path: Path, hint: str | None, **more: Any) -> None:
        self.faults.add(self.source.fault(code, message, path, hint, **more))

    def _is_excused(self, name: str) -> bool:
        return name in self.excused or self.quarantined.makes(name)

    def _check_references(self) -> None:
        machine = self.machine
        for name, guide in machine.guides.items():
            self._refer("frames", guide.frame, ("guides", name, "frame"))
            self._refer("bodies", guide.body, ("guides", name, "body"))
            self._refer("beams", guide.beam, ("guides", name, "beam"))
        for name, frame in machine.frames.items():
            self._refer("bodies", frame.body, ("frames", name, "body"))
        for name, body in machine.bodies.items():
            self._refer("guides", body.guide, ("bodies", name, "guide"))
        for section in sections_with("between"):
            entries: Mapping[str, Any] = getattr(machine, section)
            for name, entry in entries.items():
                self._check_points(entry.between, (section, name, "between"))
        for name, rope in machine.ropes.items():
            self._check_pulleys(rope, ("ropes", name, "pulleys"))
        for name, beam in machine.beams.items():
            self._refer("sections", beam.section, ("beams", name, "section"))
            self._refer("materials", beam.material, ("beams", name, "material"))
        for name, load in machine.loads.items():
            self._point(load.at, ("loads", name, "at"))
        self._check_tool_point()
        for name in machine.workspace.drives if machine.workspace is not None else ():
            self._refer("actuators", name, ("workspace", "drives", name))
        for name, sensor in machine.sensors.items():
            for index, point in enumerate(sensor.at):
                self._point(point, ("sensors", name, "at", index) if len(sensor.at) > 1 else ("sensors", name, "at"))
            if sensor.to is not None:
                self._point(sensor.to, ("sensors", name, "to"))
            self._refer("frames", sensor.surface, ("sensors", name, "surface"))
            self._refer("actuators", sensor.drive, ("sensors", name, "drive"))
        self._check_targets()
        check_groups(machine, self.source, self.faults, self.excused)

    def _check_tool_point(self) -> None:
        name, path = self.machine.tool_point, ("tool_point",)
        if name is None:
            return
        self._point(name, path)
        if name in self.machine.ground and self.points.get(name, ("",))[0] == "ground":
            message = f"`{name}` is a ground point: it does not move"
            self._fault("value", message, path, "name a node, a body or a point of a body")

    def _check_points(self, between: tuple[str, ...], path: Path) -> None:
        for index, point in enumerate(between):
            self._point(point, (*path, index))
        for index, (first, second) in enumerate(pairwise(between), start=1):
            if first == second and len(between) == 2:
                self._fault("value", f"both ends are `{first}`", (*path, 1), "give two different points")
            elif first == second:
                message = f"`{first}` is listed twice in succession"
                self._fault("value", message, (*path, index), "delete one of the two, or name the point between them")

    def _check_pulleys(self, rope: Rope[Written], path: Path) -> None:
        for point in rope.pulleys:
            if point in rope.between:
                continue
            if point in self.points:
                message = f"the rope does not run over `{point}`"
                hint = f"{_use_one_of(rope.between)}, or add it to `between`"
                self._fault("value", message, (*path, point), hint, at_key=True)
            elif point not in self.excused:
                near = did_you_mean(point, rope.between, _use_one_of(rope.between))
                self._fault("unknown-name", f"unknown point `{point}`", (*path, point), near, at_key=True)

    def _check_targets(self) -> None:
        taken: dict[tuple[str, str], str] = {}
        for name, actuator in self.machine.actuators.items():
            for key, sections in driven_sections().items():
                driven: str | dict[str, Written] | None = getattr(actuator, key)
                for target in (driven,) if isinstance(driven, str) else tuple(driven or ()):
                    path: Path = ("actuators", name, key, target)
                    listed = isinstance(self.source.node(path[:3]).value, dict)
                    self._refer_any(sections, target, path, at_key=listed)
                    other = taken.setdefault((sections[0], target), name)
                    if other != name:
                        message = f"`{target}` is already driven by actuator `{other}`"
                        self._fault("value", message, path, "keep only one of the two actuators", at_key=listed)

    def _refer(self, section: str, name: str | None, path: Path) -> None:
        if name is not None:
            self._refer_any((section,), name, path)

    def _refer_any(self, sections: Iterable[str], name: str, path: Path, *, at_key: bool = False) -> None:
        """A reference to a thing of one of these sections."""
        sections = tuple(sections)
        known = [section for section in sections if name in getattr(self.machine, section)]
        for section in known:
            self.used[section].add(name)
        kinds = " or ".join(nouns()[section] for section in sections)
        if len(known) > 1:
            message = f"`{name}` is both {with_article(nouns()[known[0]])} and {with_article(nouns()[known[1]])}"
            self._fault("name", message, path, "rename one of them", at_key=at_key)
        if known or self._is_excused(name):
            return
        names = [
            each for section in sections for each in (*getattr(self.machine, section), *self.quarantined.names(section))
        ]
        self._fault("unknown-name", f"unknown {kinds} `{name}`", path, self._hint(name, names, kinds), at_key=at_key)

    def _point(self, name: str, path: Path) -> None:
        """A reference to a node, ground point, body or body's point."""
        where = self.points.get(name)
        if where is not None:
            self.used[str(where[0]) if len(where) == 2 else "points"].add(name)
        elif not self._is_excused(name):
            also = [n for section in _POINTS for n in self.quarantined.names(section)]
            hint = self._hint(name, [*self.points, *also], "point")
            body, _, point = name.rpartition(".")
            if self.points.get(point) == ("bodies", body, "points", point):
                self.used["points"].add(point)
                hint = f"did you mean `{point}`?"
            self._fault("unknown-name", f"unknown point `{name}`", path, hint)

    def _hint(self, name: str, names: Iterable[str], kind: str) -> str:
        """The nearest name; what else has this name; which names there are."""
        if name.startswith("{"):
            return "add `each: {i: [...]}` to this entry"
        for section, other in nouns().items():
            if name in getattr(self.machine, section):
                return f"`{name}` is {with_article(other)}, not {with_article(kind)}"
        if name in self.points:
            return f"`{name}` is {with_article(_kind(self.points[name]))}, not {with_article(kind)}"
        return did_you_mean(name, names) or f"declare it as {with_article(kind)}"

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
        for path, written in written_values(self.machine):
            if path[0] in ("parameters", "ranges", "effects"):
                continue
            if written.tree is None:  # what stands where a unit should is a fault, but it is named
                self.used["parameters"].update(NAME.findall(written.unknown_unit))
                continue
            for name in written.names:
                if name in self.machine.parameters:
                    self.used["parameters"].add(name)
                    self._check_per_session(name, path)
                elif not self._is_excused(name):
                    self._unknown_parameter(name, written, path)

    def _check_per_session(self, name: str, path: Path) -> None:
        """What every session has for itself belongs to instruments, or is the zero of a drive; not the machine."""
        if self.machine.parameters[name].per == "session" and not self._of_sessions(path):
            message = f"parameter `{name}` has one value per session, but this is a part of the machine"
            self._fault(
                "value", message, path, "use `per: session` only for sensors, and for `zero` and `offset` of actuators"
            )

    def _of_sessions(self, path: Path) -> bool:
        """Whether the value at a path may differ from session to session."""
        section, owner, machine = path[0], str(path[1]), self.machine
        if section == "actuators":
            return path[2] in ("zero", "offset")
        if section == "frames":
            built = {g.frame for g in machine.guides.values()}
            return owner in {s.surface for s in machine.sensors.values()} - built
        if section == "ground":
            members = (m for kind in sections_with("between") for m in getattr(machine, kind).values())
            return owner in {s.to for s in machine.sensors.values()} - {p for m in members for p in m.between}
        return section == "sensors"

    def _unknown_parameter(self, name: str, written: WrittenValue, path: Path) -> None:
        assert written.tree is not None
        places = [n.col_offset for n in ast.walk(written.tree) if isinstance(n, ast.Name) and n.id == name]
        if name.lower() in ("nan", "inf", "infinity"):
            message, hint = f"`{name}` is not a finite number", None
            self._fault("value", message, path, hint, offset=min(places))
            return
        names = [*self.machine.parameters, *self.quarantined.names("parameters")]
        hint = did_you_mean(name, names, "declare it in `parameters:`")
        if name in UNITS and written.text != name:
            hint = f"write a unit only after a single number (`12 {name}`), not in an expression"
        self._fault("unknown-name", f"unknown parameter `{name}`", path, hint, offset=min(places))

    def _check_unused(self) -> None:
        """What nothing uses, once for each entry of the file: an entry with `each` stands for several things."""
        unused: dict[Location, list[Path]] = {}
        for section in must_be_used():
            for name in getattr(self.machine, section):
                if name not in self.used[section] | self.excused | RESERVED:
                    unused.setdefault(self.source.key((section, name)), []).append((section, name))
        for body, about in self.machine.bodies.items():
            for name in about.points:
                if name not in self.used["points"] | self.excused:
                    path: Path = ("bodies", body, "points", name)
                    unused.setdefault(self.source.key(path), []).append(path)
        for paths in unused.values():
            self._tell_unused(paths)

    def _tell_unused(self, paths: list[Path]) -> None:
        point = len(paths[0]) > 2
        noun, many = "point" if point else nouns()[str(paths[0][0])], len(paths) > 1
        named = [f"`{path[-1]}` of body `{path[1]}`" if point else f"`{path[-1]}`" for path in paths]
        more = f" and {len(named) - _LISTED} more" if len(named) > _LISTED else ""
        message = f"{noun}{'s' if many else ''} {', '.join(named[:_LISTED])}{more} {'are' if many else 'is'} not used"
        hint = f"use {'them' if many else 'it'} or delete {'them' if many else 'it'}"
        self._fault("unused-name", message, paths[0], hint, at_key=True, warning=point or paths[0][0] == GROUND)


def _use_one_of(names: Iterable[str]) -> str:
    return "use one of " + ", ".join(f"`{name}`" for name in dict.fromkeys(names))


def _kind(path: Path) -> str:
    if len(path) > 2:
        return f"point of body `{path[1]}`"
    return nouns()[str(path[0])]
