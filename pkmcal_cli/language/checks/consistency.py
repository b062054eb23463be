"""Sense: keys that go together, exclude one another, or mean nothing in the plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.channels import SensorChannel, channels_of
from pkmcal_cli.language.checks.sensors import check_sensor
from pkmcal_cli.language.checks.validation import Aside
from pkmcal_cli.language.fields import PLANAR
from pkmcal_cli.language.instruments import KINDS, Actuator
from pkmcal_cli.language.machine import Bar, Beam, Machine, Stiffness
from pkmcal_cli.language.members import PLANAR_JOINTS, End, Joint
from pkmcal_cli.language.sections import sections_of, sections_with
from pkmcal_cli.units.dimensions import LENGTH
from pkmcal_cli.yaml_source.tree import Path, SourceMap

RESERVED = frozenset(["id", "session", "tool", "part", "to", "time", "T", "payload", "replicate"])
"""Labels and covariates: columns that every table may have."""


@dataclass
class SenseCheck:
    """Checks the entries of a machine with drafts one by one; faults are added at their places."""

    machine: Machine
    source: SourceMap
    faults: FaultList
    aside: Aside

    def run(self) -> None:
        """All checks."""
        machine = self.machine
        self._check_bodies()
        for name, section in machine.sections.items():
            self._check_section(("sections", name), section)
        for name, beam in machine.beams.items():
            self._check_beam(("beams", name), beam)
        for kind in sections_of(Bar):
            for name, bar in getattr(machine, kind).items():
                if bar.EA is not None and bar.k is not None:
                    self._fault("give `EA` or `k`, not both", (kind, name, "k"), "delete one of them", at_key=True)
        for name, joint in machine.joints.items():
            self._check_joint(("joints", name), joint.type, joint)
            self._check_stiffness(("joints", name, "stiffness"), joint.stiffness)
        for name, guide in machine.guides.items():
            self._check_stiffness(("guides", name, "stiffness"), guide.stiffness)
        for name, actuator in machine.actuators.items():
            self._check_actuator(("actuators", name), name, actuator)
        for name, sensor in machine.sensors.items():
            check_sensor(machine, ("sensors", name), sensor, self._fault)
        self._check_columns()
        self._check_weight()

    @property
    def planar(self) -> bool:
        """Whether the machine is planar."""
        return self.machine.space == "planar"

    def _fault(self, what: str, path: Path, hint: str | None = None, **more: Any) -> None:
        if self.aside.touches(path[:2]):
            return
        self.faults.add(self.source.fault("value", what, path, hint, **more))

    def _check_bodies(self) -> None:
        for name, body in self.machine.bodies.items():
            path: Path = ("bodies", name, "at")
            if body.on is not None and len(body.at) != 1:
                self._fault("on a guide `at` is the travel, one number", path, "at: 100")
            if body.on is None and len(body.at) == 1:
                count = self.machine.dimensions
                what = f"`at` of a body that is on no guide is a point of {count} numbers"
                self._fault(what, path, "give the point, or `on: GUIDE`")
            self._check_directions(body.fixed, ("bodies", name, "fixed"))
        for name, node in self.machine.nodes.items():
            self._check_directions(node.fixed, ("nodes", name, "fixed"))

    def _check_directions(self, directions: tuple[str, ...], path: Path) -> None:
        for index, direction in enumerate(directions):
            if self.planar and direction not in PLANAR:
                what = f"there is no `{direction}` in the plane"
                self._fault(what, (*path, index), "one of `x`, `y`, `rz`")

    def _check_section(self, path: Path, section: Any) -> None:
        forms = ("square", "rectangle", "round", "tube", "area")
        given = [form for form in forms if getattr(section, form) is not None]
        if len(given) != 1:
            what = "a section is exactly one of square, rectangle, round, tube, area"
            hint = f"it has {', '.join(given)}: delete the others" if given else "for example square: 20 mm"
            self._fault(what, path, hint, at_key=True)
        elif given != ["area"]:
            for extra in ("Iy", "Iz", "J"):
                if getattr(section, extra) is not None:
                    what = f"`{extra}` follows from `{given[0]}`"
                    self._fault(what, (*path, extra), "delete it, or give `area` instead", at_key=True)

    def _check_beam(self, path: Path, beam: Beam) -> None:
        if (beam.section is None) != (beam.material is None):
            has, lacks = ("section", "material") if beam.section else ("material", "section")
            self._fault(f"a beam with `{has}` needs `{lacks}`", (*path, has), f"add `{lacks}: NAME`", at_key=True)
        for key in ("EA", "EI", "EIy", "EIz", "GJ"):
            if getattr(beam, key) is None:
                continue
            if beam.section is not None:
                hint = "give section and material, or the stiffnesses"
                what = f"`{key}` follows from section and material"
                self._fault(what, (*path, key), hint, at_key=True)
            elif beam.EI is not None and key in ("EIy", "EIz"):
                self._fault(f"give `EI` or `{key}`, not both", (*path, key), "delete one of them", at_key=True)
            elif self.planar and key in ("EIy", "GJ"):
                what = f"`{key}` means nothing in the plane"
                self._fault(what, (*path, key), "the plane knows `EA` and `EI`", at_key=True)
        for index, end in enumerate(beam.ends):
            self._check_joint((*path, "ends", index), end.joint, end)
            self._check_stiffness((*path, "ends", index, "stiffness"), end.stiffness)

    def _check_joint(self, path: Path, kind: str, joint: Joint | End) -> None:
        where = (*path, "type") if isinstance(joint, Joint) else (*path, "joint")
        if self.planar and kind not in PLANAR_JOINTS:
            hint = "in the plane: " + ", ".join(PLANAR_JOINTS)
            self._fault(f"there is no {kind} joint in the plane", where, hint)
        if joint.axes is not None and kind != "universal":
            self._fault("only a universal joint has `axes`", (*path, "axes"), "axis: z", at_key=True)
        if joint.axis is not None and kind in ("universal", "spherical", "fixed"):
            hint = "axes: [x, y]" if kind == "universal" else "delete it"
            self._fault(f"a {kind} joint has no `axis`", (*path, "axis"), hint, at_key=True)

    def _check_stiffness(self, path: Path, stiffness: Stiffness | None) -> None:
        if stiffness is None:
            return
        given = [key for key in Stiffness.model_fields if getattr(stiffness, key) is not None]
        for key in given:
            parts = key.split("_")
            if self.planar and key != "radial" and not set(parts) <= set(PLANAR):
                self._fault(f"there is no `{key}` in the plane", (*path, key), "delete it", at_key=True)
            missing = [part for part in parts if part not in given]
            if len(parts) == 2 and missing:
                what = f"coupling `{key}` needs the stiffness `{missing[0]}`"
                self._fault(what, (*path, key), f"give `{parts[0]}` and `{parts[1]}`", at_key=True)
            if "radial" in given and key in ("x", "y", "z"):
                what = f"`{key}` and `radial` exclude one another"
                self._fault(what, (*path, key), "delete one of them", at_key=True)

    def _check_actuator(self, path: Path, name: str, actuator: Actuator) -> None:
        keys = [key for key in KINDS if getattr(actuator, key) is not None]
        if len(keys) != 1:
            what = f"actuator `{name}` needs exactly one of moves, drives, turns, winds"
            hint = f"it has {' and '.join(keys)}" if keys else "for example moves: BODY"
            self._fault(what, path, hint, at_key=True)
            return
        key = keys[0]
        if "kind" in actuator.model_fields_set and actuator.kind != KINDS[key]:
            what = f"`{key}` makes it a {KINDS[key]}, not a {actuator.kind}"
            self._fault(what, (*path, "kind"), "delete `kind`, it is implied")
        for extra, owner in (("radius", "winds"), ("offset", "drives")):
            if getattr(actuator, extra) is not None and key != owner:
                what = f"`{extra}` belongs to an actuator that {owner}"
                self._fault(what, (*path, extra), "delete it", at_key=True)
        if actuator.control == "passive" and actuator.force is not None:
            self._fault("a passive actuator has no force", (*path, "force"), "delete it", at_key=True)
        self._check_scale(path, actuator)
        self._check_target(path, key, actuator)

    def _check_scale(self, path: Path, actuator: Actuator) -> None:
        same = actuator.reading_dimension == actuator.travel_dimension
        if not same and actuator.radius is None and "scale" not in actuator.model_fields_set:
            unit = "mm" if actuator.travel_dimension == LENGTH else "deg"
            what = f"a reading in {actuator.unit} needs `scale`, the travel per {actuator.unit}"
            hint = f"for example scale: 5/360 ({unit} per {actuator.unit})"
            self._fault(what, (*path, "unit"), hint)
        if actuator.radius is not None and actuator.reading_dimension == LENGTH:
            what = f"a spool with radius is read as an angle, not in {actuator.unit}"
            self._fault(what, (*path, "unit"), "unit: deg, or delete `radius`")

    def _check_target(self, path: Path, key: str, actuator: Actuator) -> None:
        body = self.machine.bodies.get(actuator.moves or "")
        if body is not None and body.on is None:
            what = f"body `{actuator.moves}` is on no guide"
            self._fault(what, (*path, "moves"), "give the body `on: GUIDE`")
        joint = self.machine.joints.get(actuator.target) if key in ("drives", "turns") else None
        wanted = "prismatic" if key == "drives" else "revolute"
        if joint is not None and joint.type != wanted:
            what = f"joint `{actuator.target}` is {joint.type}, `{key}` wants a {wanted} one"
            self._fault(what, (*path, key), f"give the joint `type: {wanted}`")

    def _check_columns(self) -> None:
        columns: list[tuple[str, Path]] = []
        for name, actuator in self.machine.actuators.items():
            columns.append((actuator.column or name, ("actuators", name, "column")))
            if actuator.force is not None and actuator.force.column:
                columns.append((actuator.force.column, ("actuators", name, "force", "column")))
        for channel in channels_of(self.machine):
            if channel.column:
                columns.append((channel.column, self._column_path(channel)))
        taken: dict[str, Path] = {}
        for column, path in columns:
            if column in RESERVED:
                self._fault(f"column `{column}` has a meaning of its own in every table", path, "name another column")
            other = taken.setdefault(column, path)
            if other != path:
                what = f"column `{column}` is read by {other[0]}.{other[1]} already"
                self._fault(what, path, "name another column")

    def _column_path(self, channel: SensorChannel) -> Path:
        """Where the column of a sensor's channel is named."""
        path: Path = ("sensors", channel.sensor)
        sensor = self.machine.sensors[channel.sensor]
        if channel.direction in sensor.reads:
            return (*path, "reads", channel.direction)
        return (*path, "column") if sensor.column else path

    def _check_weight(self) -> None:
        machine = self.machine
        heavy = any(t.mass is not None for s in sections_with("mass") for t in getattr(machine, s).values())
        if heavy and not self.planar and machine.own_weight and machine.gravity == ():
            found = self.source.fault(
                "gravity",
                "masses are given, but no gravity: they weigh nothing",
                ("space",),
                "gravity: [0, 0, -9.81], or own_weight: false",
                at_key=True,
                warning=True,
            )
            self.faults.add(found)
