"""Resolution of a machine: dimensions of parameters, every value as written bound, defaults filled in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.binding import Binder, Slip, article
from pkmcal_cli.language.channels import kind_of_sensor
from pkmcal_cli.language.checks.bench_sensors import check_bench
from pkmcal_cli.language.checks.expected_dimensions import ExpectedDimension, expected_dimension
from pkmcal_cli.language.checks.magnitudes import MagnitudeCheck, radian_warning
from pkmcal_cli.language.checks.validation import Quarantine
from pkmcal_cli.language.effect_entries import EffectResolver
from pkmcal_cli.language.effect_numbers import Turning
from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.inference import Inference
from pkmcal_cli.language.instruments import KINDS, Actuator
from pkmcal_cli.language.machine import Machine, WrittenMachine
from pkmcal_cli.language.parameter_values import ParameterResolver, stated_dimension, unknown_units
from pkmcal_cli.language.parts import Body, Frame, Guide, Load, Parameter
from pkmcal_cli.language.quantities import Quantity, WrittenValue
from pkmcal_cli.language.sensing import Sensor
from pkmcal_cli.language.walk import replaced, written_values
from pkmcal_cli.units.dimensions import ACCELERATION, ANGLE, FORCE, LENGTH, TORQUE, Dimension
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.limits import SMALLEST
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_PLAIN = ("parameters", "ranges", "effects")


@dataclass(kw_only=True)
class Resolver:
    """Binds the values as written of one machine; faults are added at their places."""

    machine: WrittenMachine
    source: SourceMap
    faults: FaultList
    quarantined: Quarantine
    units: FileUnits = field(init=False)
    uses: list[tuple[Path, WrittenValue, ExpectedDimension]] = field(init=False)
    origin: dict[str, Path] = field(default_factory=dict)
    slipped: set[Path] = field(default_factory=set)
    known: dict[str, Dimension] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.units = self.machine.file_units
        self.uses = [
            (path, written, expected_dimension(self.machine, path, written, self.units))
            for path, written in written_values(self.machine)
            if path[0] not in _PLAIN
        ]
        self.uses.sort(key=lambda use: self.source[use[0]])

    def run(self) -> Machine:
        """The machine with quantities and parameters resolved."""
        dimensions = self._dimensions()
        binder = Binder(self.units, dimensions)
        ranges = replaced(self.machine.ranges, self._constant, ("ranges",))
        names = frozenset(self.machine.parameters)
        resolver = ParameterResolver(self.units, ranges, self.source, self.faults, self.quarantined, names)
        parameters = {
            name: resolver.resolve(name, parameter, dimensions[name])
            for name, parameter in self.machine.parameters.items()
            if name in dimensions
        }
        bound = {path: self._bind(binder, path, written, expected) for path, written, expected in self.uses}
        self._check_values(bound, parameters)
        to_bind = self.machine.model_copy(
            update={"ranges": ranges, "parameters": {}, "effects": {}},
        )
        made: Machine = replaced(to_bind, lambda path, written: bound[path])
        check_bench(made, parameters, self.slipped, self.source, self.faults)
        drives = {name: drive.turns is not None for name, drive in self.machine.actuators.items()}
        kinds = {name: kind_of_sensor(sensor) for name, sensor in self.machine.sensors.items()}
        angles = {name: kind.measurand.dimension == ANGLE for name, kind in kinds.items()}
        turning, angular = (Turning(some, self.machine.groups) for some in (drives, angles))
        effects = EffectResolver(self.units, turning, angular, self.source, self.faults).run(self.machine.effects)
        return filled(made.model_copy(update={"parameters": parameters, "effects": effects}))

    def _check_values(self, bound: Mapping[Path, Quantity], parameters: Mapping[str, Parameter]) -> None:
        """Values at nominal: finite, sign, magnitude; pi in a file of degrees."""
        declared = self.machine.parameters
        check = MagnitudeCheck(
            parameters=parameters, declared=declared, units=self.units, source=self.source, faults=self.faults,
            length_declared="length" in self.machine.units.model_fields_set,
        )  # fmt: skip
        for path, written, _ in self.uses:
            if path in self.slipped:
                continue
            check.check(path, written, bound[path])
            doubt = radian_warning(path, written, self.units, self.source)
            if doubt is not None:
                self.faults.add(doubt)
        check.finish()

    def _dimensions(self) -> dict[str, Dimension]:
        """The dimension of every parameter: as stated, else inferred from its uses."""
        known = self.known
        for name, parameter in self.machine.parameters.items():
            stated = stated_dimension(parameter)
            if stated is not None:
                known[name] = stated
                self.origin[name] = ("parameters", name)
        inference = Inference(known)
        plain = [(use, written, w) for use, written, w in self.uses if written.tree and use[2:] != ("of",)]
        trees = [(use, written.tree, w.dimensions[0]) for use, written, w in plain if written.tree]
        inference.run((tree, dimension) for _, tree, dimension in trees)
        for name, index in inference.origin.items():
            self.origin[name] = trees[index][0]
        used = {name for _, written, _ in self.uses for name in written.names}
        for name, parameter in self.machine.parameters.items():
            slips = [] if name in known else list(unknown_units(parameter))
            for key, slip in slips:
                self.faults.add(self.source.fault(slip.code, slip.message, ("parameters", name, *key), slip.hint))
            if name not in known and name in used and not slips:
                message = f"the dimension of parameter `{name}` cannot be inferred from its uses"
                fault = self.source.fault("dimension", message, ("parameters", name), "add `unit:`", at_key=True)
                self.faults.add(fault)
        return {name: known[name] for name in self.machine.parameters if name in known}

    def _constant(self, path: Path, written: WrittenValue) -> Quantity:
        """A quantity of numbers only (default ranges)."""
        if written.names:
            message = f"a range must be a number, not an expression of `{written.names[0]}`"
            self.faults.add(self.source.fault("range", message, path, "give a number"))
            return Quantity.constant(1.0, written.measure.dimension)
        made = self._bind(Binder(self.units, {}), path, written, ExpectedDimension(written.measure.dimensions))
        if not made.number({}) >= SMALLEST:
            self.faults.add(
                self.source.fault("range", "a range must be positive", path, "give the half-width about nominal")
            )
        return made

    def _bind(self, binder: Binder, path: Path, written: WrittenValue, expected: ExpectedDimension) -> Quantity:
        """The bound value as written; a placeholder where a name is unknown or after a fault."""
        placeholder = Quantity(written.text, expected.dimensions[0], (), ("number", 1.0))
        if any(name not in binder.dimensions for name in written.names):
            self.slipped.add(path)
            return placeholder
        try:
            return binder.bind(written, expected.dimensions, expected.bare)
        except Slip as slip:
            self.slipped.add(path)
            hint = slip.hint or self._first_uses(written, path)
            self.faults.add(self.source.fault(slip.code, slip.message, path, hint, slip.offset))
            return placeholder

    def _first_uses(self, written: WrittenValue, path: Path) -> str | None:
        """Where the dimensions of the names in a value as written come from."""
        texts = []
        for name in written.names:
            origin = self.origin.get(name)
            if origin is None or origin == path:
                continue
            kind, line = article(self.known[name]), self.source[origin].line
            how = "declared in" if origin[0] == "parameters" else "inferred from"
            texts.append(f"`{name}` is {kind} ({how} line {line})")
        return "; ".join(texts) or None


_ZEROS: dict[type[Entity], tuple[tuple[str, Dimension, str], ...]] = {
    Frame: (("at", LENGTH, "point"), ("turn", ANGLE, "turn")),
    Guide: (("at", LENGTH, "point"),),
    Body: (("turn", ANGLE, "turn"), ("centre", LENGTH, "point")),
    Load: (("force", FORCE, "point"), ("moment", TORQUE, "turn")),
    Sensor: (("offset", LENGTH, "point"),),
}


def filled(machine: Machine) -> Machine:
    """The machine with the defaults filled in that depend on its space or on names."""
    counts = {"point": machine.dimensions, "turn": 1 if machine.space == "planar" else 3}
    updates: dict[str, Any] = {}
    if machine.gravity == ():
        updates["gravity"] = _zeros(ACCELERATION, counts["point"])
    for section in ("frames", "guides", "bodies", "loads", "sensors"):
        entries: Mapping[str, Entity] = getattr(machine, section)
        updates[section] = {name: _with_zeros(entry, counts) for name, entry in entries.items()}
    updates["actuators"] = {n: _filled_actuator(n, a) for n, a in machine.actuators.items()}
    return machine.model_copy(update=updates)


def _zeros(dimension: Dimension, count: int) -> tuple[Quantity, ...]:
    return (Quantity.constant(0.0, dimension),) * count


def _with_zeros(entry: Entity, counts: Mapping[str, int]) -> Entity:
    empty = {
        name: _zeros(dimension, counts[kind])
        for name, dimension, kind in _ZEROS[type(entry)]
        if getattr(entry, name) == ()
    }
    return entry.model_copy(update=empty) if empty else entry


def _filled_actuator(name: str, actuator: Actuator) -> Actuator:
    key = next((key for key in KINDS if getattr(actuator, key) is not None), None)
    update: dict[str, Any] = {"column": actuator.column or name}
    if key is not None:
        update["kind"] = KINDS[key]
    return actuator.model_copy(update=update)
