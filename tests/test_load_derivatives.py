"""Derivatives of drive forces, tensions and strain energy by drive readings and parameters: central differences."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import with_loads
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.five_ropes import rope_text
from tests.support import errors_of, model
from tests.truth.pinned import Array

ROPES = rope_text().replace("EA: 20 kN", "EA: 2 kN")  # strained by some per cent: what is of second order shows


def strained(machine: Model, tight: float) -> tuple[Array, Array]:
    """Parameter values off nominal, and drive readings near a pose, redundant drives pulled by `tight` m or rad."""
    values = np.array(list(errors_of(machine, 3e-4, seed=2).values()))
    pose = np.full((2, 6), np.nan)
    columns = [DIRECTIONS.index(c) for c in machine.independent_coordinates]
    pose[:, columns] = machine.tool.reference[columns] + [[0.01], [-0.02]]
    readings = drive_positions(machine, pose).readings
    readings[:, [a for a, d in enumerate(machine.topology.drives) if d.redundant]] -= tight
    return values, readings


@pytest.mark.parametrize(
    ("name", "tight"),
    [("biglide", 1e-4), ("scissors", 1e-5), ("hexapod7", 1e-4), ("gantry", 1e-4), ("delta4", 1e-5), (ROPES, 0.05)],
    ids=["biglide", "scissors", "hexapod7", "gantry", "delta4", "ropes"],
)
def test_loads_follow_readings_and_parameters(name: str, tight: float) -> None:
    machine = model(name)
    loaded = with_loads(machine)
    values, readings = strained(machine, tight)
    names = machine.names[:: max(len(machine.names) // 6, 1)]
    rows = Rows.at(readings)
    found = predict(loaded, values, rows, Request(parameters=names, by_drive=True))
    assert found.solved.all() and found.by_drive is not None and found.jacobian is not None

    def at(shift: Array, offset: Array) -> Array:
        return predict(loaded, values + offset, rows.moved(shift), None, found.start).values

    forces = [k for k, c in enumerate(loaded.channels) if c.name.startswith("force.")]
    size = np.nanmax(np.abs(found.by_drive), axis=(0, 2))
    size[forces] = size[forces].max()  # rounding of the pose is felt by the stiffest
    for a in range(readings.shape[1]):
        h = 1e-6 * np.eye(readings.shape[1])[a]
        change = (at(h, 0 * values) - at(-h, 0 * values)) / 2e-6
        assert (np.abs(change - found.by_drive[..., a]) < 2e-6 * size).all(), machine.actuators[a].name
    for k, parameter in enumerate(names):
        place = machine.names.index(parameter)
        step = 1e-2 * machine.ranges[place]
        h = step * np.eye(len(values))[place]
        change = (at(0 * readings, h) - at(0 * readings, -h)) / (2 * step)
        size = np.abs(found.jacobian[..., k]).max(axis=0) + np.abs(found.values).max(axis=0) * 1e-8 / step
        size[forces] += 1e-2 / step  # rounding of the pose, where 1e8 N/m hold it, is 1e-7 N
        assert (np.abs(change - found.jacobian[..., k]) < 1e-5 * size).all(), parameter
