"""Sense of sensors: which keys go with which kind, which channels there are, which sigma belongs to what."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pkmcal_cli.base.errors import did_you_mean
from pkmcal_cli.language.binding import article
from pkmcal_cli.language.channels import ORIENTATION, kind_of_sensor, measured_dimension, reading_unit
from pkmcal_cli.language.fields import PLANAR, SPATIAL
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Draft
from pkmcal_cli.language.sensing import Sensor
from pkmcal_cli.units.dimensions import NUMBER
from pkmcal_cli.yaml_source.tree import Path

_EXAMPLES = {
    "at": "at: platform", "to": "to: POINT", "on": "on: FRAME", "drive": "drive: q1", "of": "of: l1",
    "reading": "reading: 288.1 mm", "reads": "reads: [x, y]", "frame": "frame: machine, or fitted",
}  # fmt: skip


def check_sensor(machine: Machine, path: Path, sensor: Sensor, fault: Callable[..., Any]) -> None:
    """Checks one entry of a machine with drafts; `fault(what, path, hint, at_key=...)` takes what is wrong."""
    _check_keys(path, sensor, fault)
    planar = machine.space == "planar"
    for channel in sensor.reads:
        kind = kind_of_sensor(sensor)
        if planar and channel not in PLANAR:
            fault(f"there is no `{channel}` in the plane", (*path, "reads"), "one of `x`, `y`, `rz`")
        elif kind.channels != ("",) and channel not in kind.channels:
            fault(
                f"a sensor of kind {kind.keyword} does not read `{channel}`",
                (*path, "reads"),
                f"reads: [{kind.normal[planar] or kind.channels[0]}]",
            )
    if len(sensor.at) > 1 and sensor.kind != "tcp":
        fault("only a sensor of kind tcp sees several points", (*path, "at"), "at: POINT")
    if sensor.unit is not None and reading_unit(machine, sensor).dimension == NUMBER and sensor.scale is None:
        fault("plain numbers need `scale`, what is measured per unit", (*path, "unit"), "scale: 120 N")
    _check_geometry(planar, path, sensor, fault)
    _check_unit(machine, path, sensor, fault)
    _check_sigma(path, sensor, fault)
    _check_correlation(path, sensor, fault)


def _constant(value: Any) -> float | None:
    """The number of a draft that names no parameter, else None."""
    return value.number if isinstance(value, Draft) and value.tree is None else None


def _check_geometry(planar: bool, path: Path, sensor: Sensor, fault: Callable[..., Any]) -> None:
    if sensor.to is not None and sensor.to in sensor.at:
        fault(f"it measures from `{sensor.to}` to itself", (*path, "to"), "to: another point")
    if sensor.axis is not None and planar:
        fault("in the plane angles are about z", (*path, "axis"), "delete it", at_key=True)
    elif isinstance(sensor.axis, tuple) and all(_constant(part) == 0.0 for part in sensor.axis):
        fault("an axis of length 0", (*path, "axis"), "axis: z")
    if sensor.column and any(sensor.reads.values()):
        fault("its column is named twice", (*path, "column"), "delete `column`, `reads` names it", at_key=True)
    if kind_of_sensor(sensor).quantity == "bench" and isinstance(sensor.of, Draft) and not sensor.of.names:
        fault("a constant is known without measuring", (*path, "of"), "of: a parameter, or an expression of some")


def _check_unit(machine: Machine, path: Path, sensor: Sensor, fault: Callable[..., Any]) -> None:
    """A unit of what is measured, or any with a scale."""
    if sensor.unit is None:
        return
    measured, unit = measured_dimension(machine, sensor), reading_unit(machine, sensor)
    if unit.dimension not in (measured, NUMBER) and sensor.scale is None:
        hint = f"a unit of {measured}, or `scale`, what is measured per {unit.text}"
        fault(f"{unit.text} is a unit of {unit.dimension}, but it measures {article(measured)}", (*path, "unit"), hint)


def _check_keys(path: Path, sensor: Sensor, fault: Callable[..., Any]) -> None:
    kind, given = kind_of_sensor(sensor), sensor.model_fields_set
    for key in kind.needs:
        if key not in given:
            fault(f"a sensor of kind {kind.keyword} needs `{key}`", path, _EXAMPLES[key], at_key=True)
    for key in given:
        if key not in (*kind.keys, "kind"):
            hint = "it has " + ", ".join(kind.keys)
            fault(f"a sensor of kind {kind.keyword} has no `{key}`", (*path, key), hint, at_key=True)


def _check_sigma(path: Path, sensor: Sensor, fault: Callable[..., Any]) -> None:
    rotations = [channel in ORIENTATION for channel in sensor.reads]
    if "" in sensor.sigma:
        if any(rotations) and not all(rotations):
            what = "one sigma for coordinates and orientation"
            fault(what, (*path, "sigma"), "sigma: {position: 10 um, orientation: 0.1 mrad}")
        return
    if not sensor.reads:
        fault("it reads one number and has one sigma", (*path, "sigma"), "sigma: 10 um")
        return
    keys = ("position", "orientation", *SPATIAL)
    for key in sensor.sigma:
        if key not in keys or (key in SPATIAL and key not in sensor.reads):
            what = f"`{key}` is no channel of this sensor"
            hint = did_you_mean(key, ["position", "orientation", *sensor.reads])
            fault(what, (*path, "sigma", key), hint, at_key=True)
    for channel in sensor.reads:
        kind = "orientation" if channel in ORIENTATION else "position"
        if channel not in sensor.sigma and kind not in sensor.sigma:
            fault(f"channel `{channel}` has no sigma", (*path, "sigma"), f"sigma: {{{kind}: ...}}")


def _check_correlation(path: Path, sensor: Sensor, fault: Callable[..., Any]) -> None:
    known = [f"{a}_{b}" for i, a in enumerate(sensor.reads) for b in list(sensor.reads)[i + 1 :]]
    for key in sensor.correlation:
        if key not in known:
            hint = did_you_mean(key, known, f"one of {', '.join(known)}" if known else "it needs two channels")
            fault(f"`{key}` is no pair of channels", (*path, "correlation", key), hint, at_key=True)
        share = _constant(sensor.correlation[key])
        if share is not None and not -1 < share < 1:
            fault("a correlation lies between -1 and 1", (*path, "correlation", key), "for example 0.3")
