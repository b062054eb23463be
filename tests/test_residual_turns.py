"""Angles that were measured are compared with predictions by the shorter way round, whatever else is measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.calibration.residual import residuals
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows, predict
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
    slot = int(machine.sensors[-1].given["scale"].slots[0])
    step = TURN / machine.layout.slots.constants[slot]
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
