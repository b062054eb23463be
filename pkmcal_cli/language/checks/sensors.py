"""Sense of sensors: which keys go with which kind, which channels there are, which sigma belongs to what."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pkmcal_cli.base.errors import did_you_mean
from pkmcal_cli.language.binding import article
from pkmcal_cli.language.channels import ORIENTATION, kind_of_sensor, measured_dimension, reading_unit
from pkmcal_cli.language.fields import PLANAR, SPATIAL
from pkmcal_cli.language.machine import WrittenMachine
from pkmcal_cli.language.quantities import Written, WrittenValue
from pkmcal_cli.language.sensing import Sensor
from pkmcal_cli.sensors import sensor_kinds
from pkmcal_cli.units.dimensions import NUMBER
from pkmcal_cli.yaml_source.tree import Path

_EXAMPLES = {
    "at": "at: platform", "to": "to: POINT", "surface": "surface: FRAME", "drive": "drive: q1", "of": "of: l1",
    "reading": "reading: 288.1 mm", "reads": "reads: [x, y]", "frame": "frame: machine` or `frame: fitted",
}  # fmt: skip


def check_sensor(machine: WrittenMachine, path: Path, sensor: Sensor[Written], fault: Callable[..., Any]) -> None:
    """Checks one sensor of a machine as written; `fault(what, path, hint, at_key=...)` takes each fault."""
    _check_keys(path, sensor, fault)
    planar = machine.space == "planar"
    for channel in sensor.reads:
        kind = kind_of_sensor(sensor)
        if planar and channel not in PLANAR:
            fault(f"`{channel}` does not exist in a planar machine", (*path, "reads"), "use `x`, `y` or `rz`")
        elif kind.channels != ("",) and channel not in kind.channels:
            fault(
                f"sensor kind `{kind.keyword}` does not read `{channel}`",
                (*path, "reads"),
                f"write, for example, `reads: [{kind.normal[planar] or kind.channels[0]}]`",
            )
    if len(sensor.at) > 1 and sensor.kind != "tcp":
        fault("only sensor kind `tcp` can measure several points", (*path, "at"), "give one point: `at: POINT`")
    if sensor.unit is not None and reading_unit(machine, sensor).dimension == NUMBER and sensor.scale is None:
        fault(
            "plain numbers need `scale`, the measured value per unit",
            (*path, "unit"),
            "add, for example, `scale: 120 N`",
            code="missing-key",
        )
    _check_geometry(planar, path, sensor, fault)
    _check_unit(machine, path, sensor, fault)
    _check_sigma(path, sensor, fault)
    _check_growth(path, sensor, fault)
    _check_correlation(path, sensor, fault)


def _constant(value: Any) -> float | None:
    """The number of a value as written that names no parameter, else None."""
    return value.number if isinstance(value, WrittenValue) and value.tree is None else None


def _check_geometry(planar: bool, path: Path, sensor: Sensor[Written], fault: Callable[..., Any]) -> None:
    if sensor.to is not None and sensor.to in sensor.at:
        fault(f"`to` is the measured point `{sensor.to}` itself", (*path, "to"), "give another point")
    if sensor.axis is not None and planar:
        fault(
            "`axis` does not exist in a planar machine: all angles are about z",
            (*path, "axis"),
            "delete it",
            at_key=True,
        )
    elif isinstance(sensor.axis, tuple) and all(_constant(part) == 0.0 for part in sensor.axis):
        fault("`axis` has length 0", (*path, "axis"), "write, for example, `axis: z`")
    if sensor.column and any(sensor.reads.values()):
        fault("the column is given in both `column` and `reads`", (*path, "column"), "delete `column`", at_key=True)
    once = kind_of_sensor(sensor).measurand.once
    if not once and isinstance(sensor.reading, WrittenValue) and sensor.reading.names:
        message = "`reading` is what the probe reads where it touches, not a parameter"
        fault(message, (*path, "reading"), "write `reading: 0`; an unknown offset is the parameter of `zero`")
    if once and isinstance(sensor.of, WrittenValue) and not sensor.of.names:
        fault("`of` contains no parameter", (*path, "of"), "give a parameter, or an expression of parameters")


def _check_unit(machine: WrittenMachine, path: Path, sensor: Sensor[Written], fault: Callable[..., Any]) -> None:
    """A unit of what is measured, or any with a scale."""
    if sensor.unit is None:
        return
    measured, unit = measured_dimension(machine, sensor), reading_unit(machine, sensor)
    if unit.dimension not in (measured, NUMBER) and sensor.scale is None:
        hint = f"use a unit of {measured}, or add `scale`, the measured value per {unit.text}"
        fault(
            f"`{unit.text}` is a unit of {unit.dimension}, but the sensor measures {article(measured)}",
            (*path, "unit"),
            hint,
        )


def _check_keys(path: Path, sensor: Sensor[Written], fault: Callable[..., Any]) -> None:
    kind, stated = kind_of_sensor(sensor), sensor.model_fields_set
    for key in kind.needs:
        if key not in stated:
            fault(
                f"sensor kind `{kind.keyword}` needs `{key}`",
                path,
                f"add, for example, `{_EXAMPLES[key]}`",
                code="missing-key",
                at_key=True,
            )
    for key in stated:
        if key not in (*kind.keys, "kind"):
            others = ", ".join(f"`{k.keyword}`" for k in sensor_kinds().values() if key in k.keys)
            hint = f"delete it; keys of this kind: {', '.join(kind.keys)}; kinds with `{key}`: {others}"
            fault(f"sensor kind `{kind.keyword}` has no `{key}`", (*path, key), hint, at_key=True)


def _check_sigma(path: Path, sensor: Sensor[Written], fault: Callable[..., Any]) -> None:
    rotations = [channel in ORIENTATION for channel in sensor.reads]
    if "" in sensor.sigma:
        if any(rotations) and not all(rotations):
            message = "one `sigma` is given for both coordinates and orientation"
            fault(message, (*path, "sigma"), "write, for example, `sigma: {position: 10 um, orientation: 0.1 mrad}`")
        return
    if not sensor.reads:
        fault(
            "this sensor has one reading and needs one `sigma`", (*path, "sigma"), "write, for example, `sigma: 10 um`"
        )
        return
    keys = ("position", "orientation", *SPATIAL)
    unknown = [key for key in sensor.sigma if key not in keys or (key in SPATIAL and key not in sensor.reads)]
    for key in unknown:
        message = f"`{key}` is not a channel of this sensor"
        hint = did_you_mean(key, ["position", "orientation", *sensor.reads])
        fault(message, (*path, "sigma", key), hint, code="unknown-key", at_key=True)
    for channel in () if unknown else sensor.reads:  # else it may be one of these, misspelt
        kind = "orientation" if channel in ORIENTATION else "position"
        if channel not in sensor.sigma and kind not in sensor.sigma:
            hint = f"add `sigma: {{{kind}: ...}}`"
            fault(f"channel `{channel}` has no `sigma`", (*path, "sigma"), hint, code="missing-key")


def _check_growth(path: Path, sensor: Sensor[Written], fault: Callable[..., Any]) -> None:
    """A part of sigma that grows with length: where there is a length, and stated once."""
    kind, growing = kind_of_sensor(sensor), [k for k, s in sensor.sigma.items() if s.per_length is not None]
    turning = all(channel in ORIENTATION for channel in sensor.reads) and bool(sensor.reads)
    for key in growing:
        where = (*path, "sigma", key) if key else (*path, "sigma")
        if not kind.measurand.once and "sigma_per_length" not in kind.may:
            kinds = ", ".join(f"`{k.keyword}`" for k in sensor_kinds().values() if "sigma_per_length" in k.may)
            message = f"the `sigma` of sensor kind `{kind.keyword}` cannot grow with length: it measures none"
            fault(message, where, f"give a constant; it can grow for {kinds} and `bench`")
        elif key in (*ORIENTATION, "orientation") or (key == "" and turning):
            fault("the `sigma` of an orientation cannot grow with length", where, "give a constant")
        elif sensor.sigma_per_length is not None:
            message = "the growth of `sigma` with length is given twice: in `sigma` and in `sigma_per_length`"
            fault(message, where, "keep the sum of `sigma`, or `sigma_per_length` for growth in quadrature")


def _check_correlation(path: Path, sensor: Sensor[Written], fault: Callable[..., Any]) -> None:
    known = [f"{a}_{b}" for i, a in enumerate(sensor.reads) for b in list(sensor.reads)[i + 1 :]]
    for key in sensor.correlation:
        if key not in known:
            hint = did_you_mean(key, known, f"use one of {', '.join(known)}" if known else "read at least two channels")
            fault(f"`{key}` is not a pair of channels", (*path, "correlation", key), hint, at_key=True)
        share = _constant(sensor.correlation[key])
        if share is not None and not -1 < share < 1:
            fault("a correlation must be between -1 and 1", (*path, "correlation", key), "write, for example, 0.3")
