"""Sense: keys that go together, exclude one another, or mean nothing in the plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.channels import SensorChannel, channels_of
from pkmcal_cli.language.checks.guides import check_guides
from pkmcal_cli.language.checks.sensors import check_sensor
from pkmcal_cli.language.checks.validation import Quarantine
from pkmcal_cli.language.checks.workspaces import check_workspace
from pkmcal_cli.language.fields import PLANAR
from pkmcal_cli.language.instruments import KINDS, Actuator
from pkmcal_cli.language.machine import Axial, Bar, Beam, Stiffness, WrittenMachine
from pkmcal_cli.language.members import PLANAR_JOINTS, End, Joint, Pulley
from pkmcal_cli.language.quantities import Written, WrittenValue
from pkmcal_cli.language.sections import sections_of, sections_with
from pkmcal_cli.units.dimensions import LENGTH
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.yaml_source.tree import Path, SourceMap

RESERVED = frozenset(["id", "session", "tool", "part", "to", "time", "T", "payload", "replicate"])
"""Labels and covariates: columns that every table may have."""


@dataclass
class ConsistencyCheck:
    """Checks the entries of a machine with values as written one by one; faults are added at their places."""

    machine: WrittenMachine
    source: SourceMap
    faults: FaultList
    quarantined: Quarantine

    def run(self) -> None:
        """All checks."""
        machine = self.machine
        self._check_bodies()
        for name, parameter in machine.parameters.items():
            if parameter.adjustable and parameter.per:
                message = "an adjusted value is the same in all sessions"
                self._fault(message, ("parameters", name, "adjustable"), "delete `adjustable` or `per`", at_key=True)
        for name, section in machine.sections.items():
            self._check_section(("sections", name), section)
        for name, beam in machine.beams.items():
            self._check_beam(("beams", name), beam)
        for name, rope in machine.ropes.items():
            for point, pulley in rope.pulleys.items():
                self._check_pulley(("ropes", name, "pulleys", point), pulley)
        for kind in sections_of(Axial):
            for name, bar in getattr(machine, kind).items():
                if bar.EA is not None and bar.k is not None:
                    self._fault(
                        "`EA` and `k` cannot both be given", (kind, name, "k"), "delete one of them", at_key=True
                    )
        for name, bar in machine.bars.items():
            if bar.spring:
                self._check_spring(name, bar)
        for name, joint in machine.joints.items():
            self._check_joint(("joints", name), joint.type, joint)
            self._check_stiffness(("joints", name, "stiffness"), joint.stiffness)
        for name, guide in machine.guides.items():
            self._check_stiffness(("guides", name, "stiffness"), guide.stiffness)
        check_guides(machine, self._fault)
        for name, actuator in machine.actuators.items():
            self._check_actuator(("actuators", name), name, actuator)
        for name, sensor in machine.sensors.items():
            check_sensor(machine, ("sensors", name), sensor, self._fault)
        check_workspace(machine, self._fault)
        self._check_columns()
        self._check_weight()

    def _check_spring(self, name: str, bar: Bar[Written]) -> None:
        """A spring states how stiff it is and how long unstressed, and no drive holds its length."""
        path: Path = ("bars", name, "spring")
        if bar.length is None or (bar.k is None and bar.EA is None):
            lacks = "length" if bar.length is None else "k"
            self._missing(f"a spring needs `{lacks}`", path, "state `k`, and `length`, which is unstressed")
        for drive, actuator in self.machine.actuators.items():
            if actuator.drives == name:
                hint = "delete `spring`, or let the drive act on another member"
                self._fault(f"`{drive}` drives a spring, which holds nothing in place", path, hint, at_key=True)

    @property
    def planar(self) -> bool:
        """Whether the machine is planar."""
        return self.machine.space == "planar"

    def _fault(self, message: str, path: Path, hint: str | None = None, *, code: str = "value", **more: Any) -> None:
        if self.quarantined.touches(path[:2]):
            return
        self.faults.add(self.source.fault(code, message, path, hint, **more))

    def _missing(self, message: str, path: Path, hint: str) -> None:
        """The fault of a key that others make necessary; the path is that of one of them, or of the entry."""
        self._fault(message, path, hint, code="missing-key", at_key=True)

    def _check_bodies(self) -> None:
        for name, body in self.machine.bodies.items():
            path: Path = ("bodies", name, "at")
            if body.guide is not None and len(body.at) != 1:
                self._fault(
                    "`at` of a body on a guide must be one number, the travel", path, "write, for example, `at: 100`"
                )
            if body.guide is None and len(body.at) == 1:
                count = self.machine.dimensions
                message = f"`at` of a body without a guide must be a point of {count} numbers"
                self._fault(message, path, "give a point, or add `guide: GUIDE`")
            self._check_directions(body.fixed, ("bodies", name, "fixed"))
        for name, node in self.machine.nodes.items():
            self._check_directions(node.fixed, ("nodes", name, "fixed"))

    def _check_directions(self, directions: tuple[str, ...], path: Path) -> None:
        for index, direction in enumerate(directions):
            if self.planar and direction not in PLANAR:
                message = f"`{direction}` does not exist in a planar machine"
                self._fault(message, (*path, index), "use `x`, `y` or `rz`")

    def _check_section(self, path: Path, section: Any) -> None:
        forms = ("square", "rectangle", "round", "tube", "area")
        stated = [form for form in forms if getattr(section, form) is not None]
        if len(stated) != 1:
            message = "a section needs exactly one of square, rectangle, round, tube, area"
            hint = f"keep only one of {', '.join(stated)}" if stated else "add, for example, `square: 20 mm`"
            self._fault(message, path, hint, code="value" if stated else "missing-key", at_key=True)
        elif stated != ["area"]:
            for extra in ("Iy", "Iz", "J"):
                if getattr(section, extra) is not None:
                    message = f"`{extra}` is already determined by `{stated[0]}`"
                    self._fault(
                        message, (*path, extra), f"delete it, or use `area` instead of `{stated[0]}`", at_key=True
                    )

    def _check_beam(self, path: Path, beam: Beam[Written]) -> None:
        if (beam.section is None) != (beam.material is None):
            has, lacks = ("section", "material") if beam.section else ("material", "section")
            self._missing(f"a beam with `{has}` needs `{lacks}`", (*path, has), f"add `{lacks}: NAME`")
        for key in ("EA", "EI", "EIy", "EIz", "GJ"):
            if getattr(beam, key) is None:
                continue
            if beam.section is not None:
                hint = "delete it, or give stiffnesses instead of `section` and `material`"
                message = f"`{key}` is already determined by `section` and `material`"
                self._fault(message, (*path, key), hint, at_key=True)
            elif beam.EI is not None and key in ("EIy", "EIz"):
                self._fault(f"`EI` and `{key}` cannot both be given", (*path, key), "delete one of them", at_key=True)
            elif self.planar and key in ("EIy", "GJ"):
                message = f"`{key}` does not exist in a planar machine"
                self._fault(message, (*path, key), "use `EA` and `EI`", at_key=True)
        for index, end in enumerate(beam.ends):
            self._check_joint((*path, "ends", index), end.joint, end)
            self._check_stiffness((*path, "ends", index, "stiffness"), end.stiffness)

    def _check_pulley(self, path: Path, pulley: Pulley[Written]) -> None:
        """In the plane a pulley is on one side of the rope; in space it swivels."""
        if self.planar and pulley.side is None:
            hint = "add `side: left` or `right`: where its centre is, seen along the rope in the order of `between`"
            self._missing("a pulley in a planar machine needs `side`", path, hint)
        if not self.planar and pulley.axis is None:
            hint = "add, for example, `axis: z` if it swivels about z and the rope comes to it in the direction of z"
            self._missing("a pulley in a spatial machine needs `axis`", path, hint)
        for key, foreign in (("axis", self.planar), ("side", not self.planar)):
            if foreign and getattr(pulley, key) is not None:
                message = f"a pulley in a {self.machine.space} machine has no `{key}`"
                self._fault(message, (*path, key), "delete it", at_key=True)

    def _check_winding(self, path: Path, winds: dict[str, Written]) -> None:
        """A drive winds one rope or several, by weights that are numbers."""
        if not winds:
            self._fault("`winds` names no rope", path, "write, for example, `winds: rope1`")
        for rope, weight in winds.items():
            if isinstance(weight, WrittenValue) and any(n in self.machine.parameters for n in weight.names):
                message = f"the weight of `{rope}` must not depend on parameters"
                self._fault(message, (*path, rope), "give a number")

    def _check_joint(self, path: Path, kind: str, joint: Joint[Written] | End[Written]) -> None:
        where = (*path, "type") if isinstance(joint, Joint) else (*path, "joint")
        if self.planar and kind not in PLANAR_JOINTS:
            hint = "use one of " + ", ".join(PLANAR_JOINTS)
            self._fault(f"a {kind} joint does not exist in a planar machine", where, hint)
        if joint.axes is not None and kind != "universal":
            self._fault(
                "only a universal joint has `axes`", (*path, "axes"), "write, for example, `axis: z`", at_key=True
            )
        if self.planar and kind == "revolute" and joint.axis not in (None, "z"):
            self._fault("in a planar machine every revolute joint turns about z", (*path, "axis"), "delete `axis`")
        if joint.axis is not None and kind in ("universal", "spherical", "fixed"):
            hint = "write, for example, `axes: [x, y]`" if kind == "universal" else "delete it"
            self._fault(f"a {kind} joint has no `axis`", (*path, "axis"), hint, at_key=True)

    def _check_stiffness(self, path: Path, stiffness: Stiffness[Written] | None) -> None:
        if stiffness is None:
            return
        stated = [key for key in Stiffness.model_fields if getattr(stiffness, key) is not None]
        for key in stated:
            parts = key.split("_")
            if self.planar and key != "radial" and not set(parts) <= set(PLANAR):
                self._fault(f"`{key}` does not exist in a planar machine", (*path, key), "delete it", at_key=True)
            missing = [part for part in parts if part not in stated]
            if len(parts) == 2 and missing:
                message = f"coupling `{key}` needs the stiffness `{missing[0]}`"
                self._missing(message, (*path, key), f"give both `{parts[0]}` and `{parts[1]}`")
            if "radial" in stated and key in ("x", "y", "z"):
                message = f"`{key}` and `radial` cannot both be given"
                self._fault(message, (*path, key), "delete one of them", at_key=True)

    def _check_actuator(self, path: Path, name: str, actuator: Actuator[Written]) -> None:
        keys = [key for key in KINDS if getattr(actuator, key) is not None]
        if len(keys) != 1:
            message = f"actuator `{name}` needs exactly one of moves, drives, turns, winds"
            hint = f"keep only one of {', '.join(keys)}" if keys else "add, for example, `moves: BODY`"
            self._fault(message, path, hint, code="value" if keys else "missing-key", at_key=True)
            return
        key = keys[0]
        if "kind" in actuator.model_fields_set and actuator.kind != KINDS[key]:
            message = f"`{key}` implies `kind: {KINDS[key]}`, not `kind: {actuator.kind}`"
            self._fault(message, (*path, "kind"), "delete `kind`")
        for extra, owner in (("radius", "winds"), ("folds", "winds"), ("offset", "drives")):
            if getattr(actuator, extra) is not None and key != owner:
                message = f"`{extra}` applies only to an actuator with `{owner}`"
                self._fault(message, (*path, extra), "delete it", at_key=True)
        if actuator.winds is not None:
            self._check_winding((*path, "winds"), actuator.winds)
        if actuator.control == "passive" and actuator.force is not None:
            self._fault("a passive actuator has no force", (*path, "force"), "delete it", at_key=True)
        if "sigma_is" in actuator.model_fields_set and actuator.sigma is None:
            idle = f"`sigma_is` says nothing where the actuator has no `sigma` and the table no `sigma.{name}`"
            hint = "add the uncertainty of the reading, for example `sigma: 10 um`, or delete `sigma_is`"
            self._fault(idle, (*path, "sigma_is"), hint, code="missing-key", at_key=True, warning=True)
        self._check_scale(path, actuator)
        self._check_target(path, key, actuator)

    def _check_scale(self, path: Path, actuator: Actuator[Written]) -> None:
        same = actuator.reading_dimension == actuator.travel_dimension
        name = parse_unit(actuator.unit or "1").text
        if not same and actuator.radius is None and "scale" not in actuator.model_fields_set:
            unit = "mm" if actuator.travel_dimension == LENGTH else "deg"
            message = f"a reading in {name} needs `scale`, the travel per {name}"
            hint = f"add, for example, `scale: 5/360` ({unit} per {name})"
            self._fault(message, (*path, "unit"), hint, code="missing-key")
        if actuator.radius is not None and actuator.reading_dimension == LENGTH:
            message = f"the reading of a spool with `radius` is an angle, but its unit is {name}"
            self._fault(message, (*path, "unit"), "use `unit: deg`, or delete `radius`")

    def _check_target(self, path: Path, key: str, actuator: Actuator[Written]) -> None:
        body = self.machine.bodies.get(actuator.moves or "")
        if body is not None and body.guide is None and not self.quarantined.touches(("bodies", actuator.target)):
            message = f"body `{actuator.moves}` is not on a guide"
            self._fault(message, (*path, "moves"), "add `guide: GUIDE` to the body")
        joint = self.machine.joints.get(actuator.target) if key in ("drives", "turns") else None
        expected_type = "prismatic" if key == "drives" else "revolute"
        if joint is not None and joint.type != expected_type:
            message = f"joint `{actuator.target}` is {joint.type}; `{key}` needs a {expected_type} joint"
            self._fault(message, (*path, key), f"use `type: {expected_type}` for the joint")

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
                self._fault(f"the column name `{column}` is reserved", path, "choose another column name")
            other = taken.setdefault(column, path)
            if other != path:
                message = f"column `{column}` is already used by {other[0]}.{other[1]}"
                self._fault(message, path, "choose another column name")

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
            fault = self.source.fault(
                "gravity",
                "`gravity` is missing: the given masses have no weight",
                ("space",),
                "add `gravity: [0, 0, -9.81]`, or `own_weight: false`",
                at_key=True,
                warning=True,
            )
            self.faults.add(fault)
