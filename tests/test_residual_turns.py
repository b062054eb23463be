"""Angles that were measured are compared with predictions by the shorter way round, whatever else is measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.calibration.residual import evaluate, residuals
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request, Rows, predict
from tests.command import run
from tests.support import model, overlay, poses_of, truth

TURN = 2 * np.pi


def readings_of(machine: Model, name: str) -> tuple[Rows, np.ndarray]:  # type: ignore[type-arg]
    rows = Rows.at(truth(name).inverse(poses_of(name, 4)))
    found = predict(machine, machine.nominal, rows)
    assert found.solved.all()
    return rows, found.values


@pytest.mark.parametrize(("scale", "unit"), [("1", "deg"), ("0.5", "deg"), ("-2 deg", '"1"')])
def test_an_encoder_that_counts_another_turn(scale: str, unit: str) -> None:
    """Whole turns of the joint, in units of the reading, are no deviation; what is left is."""
    text = f"sensors: {{rod: {{kind: angle, at: B1, to: A1, scale: {scale}, unit: {unit}, sigma: 0.01}}}}"
    machine = model(overlay("scissors", text))
    k = [c.name for c in machine.channels].index("rod")
    rows, true = readings_of(machine, "scissors")
    coefficient = int(machine.sensors[-1].known["scale"].coefficients[0])
    step = TURN / machine.topology.coefficients.constants[coefficient]
    problem = replace(design_problem(machine, rows), readings=true.copy())
    problem.readings[:, k] += 0.003 + step * np.array([0, 1, -1, 2])
    found = residuals(problem, true)
    assert found[:, k] == pytest.approx(0.003, abs=1e-9)


def test_a_full_orientation_beside_a_level() -> None:
    """Two rotation vectors of one rotation, and a second instrument that reads two components of another body's."""
    text = """sensors: {tracker: {frame: machine},
      level: {at: leg1a, reads: [rx, ry], frame: machine, sigma: 1 urad}}"""
    text = text.replace("leg1a", "platform")
    machine = model(overlay("hexapod7", text))
    rows, true = readings_of(machine, "hexapod7")
    turning = [k for k, c in enumerate(machine.channels) if c.name.startswith("tracker.r")]
    assert len(turning) == 3
    measured = true.copy()
    vector = true[:, turning]
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    measured[:, turning] = vector * (1 - TURN / angle)
    problem = replace(design_problem(machine, rows), readings=measured)
    assert residuals(problem, true) == pytest.approx(np.zeros_like(true), abs=1e-12)


TURNTABLE = """
units: {length: mm, angle: deg, force: N}
space: spatial
parameters: {z1: {nominal: 0, range: 1, unit: deg}}
bodies: {table: {at: [0, 0, 0]}}
ground: {O: [0, 0, 0]}
joints: {a: {between: [O, table], type: revolute, axis: [1, 2, 10]}}
actuators: {q1: {turns: table, zero: z1}}
sensors: {level: {at: table, reads: [READS], frame: machine, sigma: 0.001}}
"""
"""A turntable whose axis leans by 12.6 deg: one turn changes rz by 351 deg, ry by 70 deg."""
AXIS = np.array([1.0, 2.0, 10.0]) / np.sqrt(105.0)


def turned(angles: Array, planted: float = 0.0, tilt: Array | None = None) -> Array:
    """Rotation vectors (N, 3), rad, of a turntable at readings (N,), deg, seen by a tilted instrument (SciPy)."""
    turn = Rotation.from_rotvec(np.radians(angles + planted)[:, None] * AXIS)
    seen = turn if tilt is None else Rotation.from_rotvec(tilt) * turn
    return np.asarray(seen.as_rotvec())


@pytest.mark.parametrize("reads", ["rz", "ry", "rx, ry", "rz, ry, rx", "x, rz"])
def test_components_of_an_orientation_are_wrapped_in_space(reads: str, tmp_path: Path) -> None:
    """An encoder zero off by 0.5 deg, read on both sides of half a turn: exact readings leave nothing of it."""
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    sigma = "sigma: {orientation: 0.001, position: 1}" if reads == "x, rz" else "sigma: 0.001"
    file.write_text(TURNTABLE.replace("READS", reads).replace("sigma: 0.001", sigma))
    angles = np.array([179.8, 179.4, -179.9, -60.0, 178.0, -179.6, 30.0])
    vectors = np.degrees(turned(angles, 0.5))
    named = dict(zip(("rx", "ry", "rz", "x"), (*vectors.T, 0 * angles), strict=True))
    columns = reads.split(", ")
    rows = [",".join(map(repr, map(float, r))) for r in zip(angles, *(named[c] for c in columns), strict=True)]
    table.write_text("\n".join([",".join(["q1", *columns]), *rows]))
    done = run("calibrate", file, table, "--holdout", "none", "--json")
    assert done.code == 0 and "look" not in done.err, done.err
    assert done.json["parameters"][0]["value"] == pytest.approx(0.5, abs=1e-9)
    assert done.json["after"]["orientation"]["max"] < 1e-9
    assert done.json["before"]["orientation"]["max"] < 0.6  # 0.5 deg off, never a turn


def test_a_whole_orientation_of_which_a_row_has_one_component() -> None:
    """Cells of a level that reads all three may be empty."""
    machine = model(TURNTABLE.replace("READS", "rx, ry, rz"))
    angles = np.array([179.9, -179.9, 170.0])
    rows = Rows.at(np.radians(angles)[:, None])
    seen = turned(-angles[:2])  # the other way round: -179.9 where 179.9 is predicted
    readings = np.full((3, 3), np.nan)
    readings[0, 2], readings[1, 1], readings[2] = seen[0, 2], seen[1, 1], turned(angles[2:])[0]
    problem = replace(design_problem(machine, rows, np.isfinite(readings)), readings=readings)
    found = evaluate(problem, machine.nominal).residual
    step = np.radians(0.2) * AXIS
    assert found == pytest.approx(np.array([[0, 0, step[2]], [0, -step[1], 0], [0, 0, 0]]), abs=1e-12)
    rough = residuals(problem, turned(angles))  # of any prediction, as gross errors are looked for
    assert np.abs(rough[0, 2]) < TURN * (1 - AXIS[2]) + 0.01


@pytest.mark.parametrize("reads", ["rz", "ry", "rx, rz", "rx, ry, rz"])
def test_derivatives_of_what_is_told_the_other_way_round(reads: str) -> None:
    """By the drive and by a tilt of the instrument, against differences of SciPy's rotation vectors less a turn."""
    machine = model(TURNTABLE.replace("READS", reads) + "effects: {frame@level: {rx: 3 mrad, ry: -4 mrad, rz: 0}}\n")
    columns = ["xyz".index(c[1]) for c in reads.split(", ")]
    angles, tilt = np.array([179.9, -176.0]), np.array([3e-3, -4e-3, 0.0])

    def other(angles: Array, planted: float, tilt: Array) -> Array:
        """Rotation vectors of the same rotations the other way round."""
        vector = turned(angles, planted, tilt)
        return np.asarray(vector - TURN * vector / np.linalg.norm(vector, axis=1, keepdims=True))

    true = other(angles, 0.0, tilt)
    measured = true.copy()
    if len(columns) == 3:
        measured[:, 0] = np.nan  # else all are compared as one
    rows = replace(Rows.at(np.radians(angles)[:, None]), measured=measured[:, columns])
    names = ("z1", "frame@level.rx", "frame@level.ry", "frame@level.rz")
    found = predict(machine, machine.nominal, rows, Request(parameters=names, by_drive=True))
    assert found.values == pytest.approx(true[:, columns], abs=1e-12)
    assert found.jacobian is not None and found.by_drive is not None
    h = 1e-5
    ends = [other(angles, np.degrees(s * h), tilt) for s in (1, -1)]
    by_drive = (ends[0] - ends[1])[:, columns] / (2 * h)
    assert found.jacobian[..., 0] == pytest.approx(by_drive, abs=1e-8)
    assert found.by_drive[..., 0] == pytest.approx(by_drive, abs=1e-8)
    for k in range(3):
        ends = [other(angles, 0.0, tilt + s * h * np.eye(3)[k]) for s in (1, -1)]
        assert found.jacobian[..., 1 + k] == pytest.approx((ends[0] - ends[1])[:, columns] / (2 * h), abs=1e-7)


def test_a_small_component_of_a_small_turn_is_told_one_way_only() -> None:
    """At 30 deg the other way round reads ry = -63 deg: a gross error of that size stays one."""
    machine = model(TURNTABLE.replace("READS", "ry"))
    here = turned(np.array([30.0]))
    other = here - TURN * here / np.linalg.norm(here)
    rows = replace(Rows.at(np.radians([[30.0]])), measured=other[:, 1:2])
    assert predict(machine, machine.nominal, rows).values == pytest.approx(here[:, 1:2], abs=1e-12)
