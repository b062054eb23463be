"""Every kind of sensor reads what geometry says at the pose of an independent simulator, with exact derivatives."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Request, Rows, predict
from pkmcal_cli.sensors import sensor_kinds
from pkmcal_cli.units.measurands import Measurand
from tests.support import errors_of, model, overlay, poses_of, truth

SPATIAL = """
parameters:
  {bx: 30 mm, by: -700 mm, bz: -900 mm, w0: {nominal: 5, range: 1}, ws: {nominal: 1, range: 0.01, unit: "1"},
   pz: -560 mm, pa: {nominal: 0.01, range: 0.01, unit: rad}, pb: {nominal: -0.02, range: 0.01, unit: rad},
   ts: {nominal: 1, range: 0.01, unit: "1"}, q0: 2 mm, qs: {nominal: 1, range: 0.01, unit: "1"},
   kt: {nominal: 40, range: 1, unit: N}, i0: {nominal: 3, range: 1, unit: N}, e0: {nominal: 20, range: 1, unit: deg}}
ground: {ball: [bx, by, bz]}
frames: {bed: {at: [0.01, 0.02, pz], turn: [pa, pb, 0]}}
sensors:
  tracker: {at: [P1a, P3b], reads: [x, y, z], frame: fitted, sigma: 10 um, sigma_per_length: 6 um/m,
            scale: ts, correlation: {x_y: 0.3, y_z: -0.2}}
  level: {at: platform, reads: [rx, ry], frame: machine, sigma: 1 urad}
  ballbar: {kind: distance, at: platform, offset: [5, 6, -70], to: ball, sigma: 1 um}
  wire: {kind: distance, at: P2a, to: ball, zero: w0, scale: ws, sigma: 10 um}
  calipers: {kind: span, at: platform, offset: [5, 6, -70], sigma: 20 um}
  probe: {kind: touch, at: platform, offset: [0, 0, -50], surface: bed, zero: q0, scale: qs, sigma: 5 um}
  edge: {kind: touch, at: platform, surface: bed, reads: [y, z], sigma: 5 um}
  current: {kind: force, drive: q4, unit: "1", scale: kt, zero: i0, sigma: 0.01}
  encoder: {kind: angle, at: C2a, to: P2a, axis: y, zero: e0, sigma: 0.001 deg}
  gauge: {kind: bench, of: l1a - l1b, reading: 0.02 mm, sigma: 1 um}
"""
FRAME = {"tx": 0.3, "ty": -1.2, "tz": 0.4, "rx": 0.2, "ry": -0.1, "rz": 2.1}


@cache
def spatial() -> Model:
    return model(overlay("delta4", SPATIAL))


def values_of(machine: Model) -> dict[str, float]:
    """Lengths off by up to 1 mm, the frame of the tracker anywhere."""
    values = errors_of(machine, 1e-3)
    return values | {f"frame@tracker.{k}": v for k, v in FRAME.items()} | {"frame@level.rx": 0.0}


def asked(machine: Model) -> tuple[Array, Rows]:
    values = values_of(machine)
    vector = np.array([values[n] for n in machine.names])
    rows = Rows.at(truth("delta4").inverse(poses_of("delta4", 6)))
    return vector, replace(rows, partner=np.array([-1, 0, 0, -1, 3, 2]))


def closed_forms(machine: Model) -> dict[str, Array]:
    """Readings from the poses of the energy minimisation and textbook geometry."""
    v = values_of(machine)
    _, rows = asked(machine)
    planted = {n: v[n] for n in truth("delta4").nominal}
    found = truth("delta4").forward(rows.readings, planted)
    place, turn = found.tcp[:, :3], exp(found.tcp[:, 3:6])

    def at(point: list[float]) -> Array:
        return place + turn @ np.array(point)

    p1a, p3b = at([v["r1"], 0.04, 0]), at([-v["r3"], 0.04, 0])
    p2a, tip = at([-0.04, v["r2"], 0]), at([0.005, 0.006, -0.07])
    away, moved = (
        exp(np.array([FRAME[k] for k in ("rx", "ry", "rz")])),
        np.array([FRAME[k] for k in ("tx", "ty", "tz")]),
    )
    ball = np.array([v["bx"], v["by"], v["bz"]])
    bed, origin = exp(np.array([v["pa"], v["pb"], 0.0])), np.array([1e-5, 2e-5, v["pz"]])
    out = {}
    for name, p in (("P1a", p1a), ("P3b", p3b)):
        out |= {f"tracker.{name}.{c}": x for c, x in zip("xyz", ((p @ away.T + moved) / v["ts"]).T, strict=True)}
    out |= {"level.rx": found.tcp[:, 3], "level.ry": found.tcp[:, 4]}
    out["ballbar"] = np.linalg.norm(tip - ball, axis=1)
    out["wire"] = (np.linalg.norm(p2a - ball, axis=1) - v["w0"]) / v["ws"]
    partner = rows.partner
    assert partner is not None
    out["calipers"] = np.where(partner < 0, np.nan, np.linalg.norm(tip - tip[partner], axis=1))
    out["probe"] = ((at([0, 0, -0.05]) - origin) @ bed[:, 2] - v["q0"]) / v["qs"]
    out["edge.y"], out["edge.z"] = (place - origin) @ bed[:, 1], (place - origin) @ bed[:, 2]
    out["current"] = (found.drive_force[:, 3] - v["i0"]) / v["kt"]
    column = exp(np.array([0.0, 0.0, v["g2"] + np.pi / 2]))
    c2a = np.array([v["R2"], 0.04, 0.0])
    line = p2a @ column - c2a - np.outer(found.travel[:, 1], [0, 0, 1])  # in the carriage's axes
    out["encoder"] = np.arctan2(line[:, 0], line[:, 2]) - v["e0"]  # about y, from z towards x
    out["gauge"] = np.full(len(place), v["l1a"] - v["l1b"])
    return out


def test_the_machine_has_every_kind() -> None:
    assert {s.kind.keyword for s in spatial().sensors} == set(sensor_kinds())


@pytest.mark.parametrize("name", [c.name for c in spatial().channels])
def test_readings_are_closed_forms_of_the_true_pose(name: str) -> None:
    """The simulator minimises energy without a line of the engine's code: 1e-11 m, rad; forces by stiffness."""
    machine = spatial()
    vector, rows = asked(machine)
    found = predict(machine, vector, rows)
    k = [c.name for c in machine.channels].index(name)
    tolerance = 1e-7 if name == "current" else 2e-11
    assert found.values[:, k] == pytest.approx(closed_forms(machine)[name], abs=tolerance, nan_ok=True)


def derivative(machine: Model, vector: Array, rows: Rows, step: Array, drives: Array | None = None) -> Array:
    """Central differences with Richardson extrapolation (N, C) along a step of parameters (P,), of drives (N, A)."""

    def at(factor: float) -> Array:
        moved = rows if drives is None else rows.moved(factor * drives)
        found = predict(machine, vector + factor * step, moved)
        assert found.solved.all()
        return found.values

    wide, near = (at(1.0) - at(-1.0)) / 2, at(0.5) - at(-0.5)
    return np.asarray((4 * near - wide) / 3)


def exact() -> tuple[Model, Array, Rows, Prediction]:
    machine = spatial()
    vector, rows = asked(machine)
    return machine, vector, rows, predict(machine, vector, rows, Request(parameters=machine.names, by_drive=True))


def test_derivatives_by_every_parameter() -> None:
    """To 1e-6 of a column; below 2e-12 m and rad, and what 1e-16 m do to a force at 2e7 N/m, is rounding."""
    machine, vector, rows, found = exact()
    assert found.jacobian is not None
    rounding = np.array([1e-9 if c.measurand is Measurand.FORCE else 2e-12 for c in machine.channels])
    for k, p in enumerate(machine.parameters):
        wide = min(0.05 * p.range, 1e-3) if not p.name.startswith("frame@") else 1e-3
        step = np.eye(len(vector))[k] * wide
        told, seen = found.jacobian[..., k] * wide, derivative(machine, vector, rows, step)
        size = np.nanmax(np.abs(seen), axis=0, keepdims=True)
        assert np.nanmax(np.abs(told - seen) - 1e-6 * size - rounding) < 0, p.name


def test_derivatives_by_the_drives_of_both_rows() -> None:
    machine, vector, rows, found = exact()
    assert found.by_drive is not None and found.by_partner is not None and rows.partner is not None
    steps = 1e-4 * np.random.default_rng(1).normal(size=rows.readings.shape)
    told = (found.by_drive @ steps[..., None])[..., 0]
    told += np.where(rows.partner[:, None] < 0, 0, (found.by_partner @ steps[rows.partner][..., None])[..., 0])
    seen = derivative(machine, vector, rows, np.zeros(len(vector)), steps)
    size = np.nanmax(np.abs(seen), axis=0, keepdims=True)
    assert np.nanmax(np.abs(told - seen) - 1e-6 * size) < 2e-12
