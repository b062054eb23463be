"""Ropes over points and pulleys for tests and for the table of what is shown: lengths, and derivatives."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.measured import JacobianCheck, jacobian_check
from tests.rope_machines import MACHINES
from tests.support import model
from tests.verification_row import Row

STRAINED = {"platform": 3e-3, "cables": 0.15, "weighted": 0.15, "rolled": 3e-3, "spatial": 2e-3}
"""How much shorter the ropes are than the pose asks for: all of them pull."""
_NAMES = {
    "platform": "platform on four ropes over planar pulleys",
    "cables": "point on three cables m + n, m + 2k, n + 2h",
    "weighted": "the same with weights",
    "rolled": "the same with pulleys",
    "spatial": "platform on eight cables over swivelling pulleys of 25 mm",
}


def length_error(name: str) -> float:
    """Largest deviation of what the drives read at 50 poses from trigonometry, relative; all must be reached."""
    machine = MACHINES[name]
    poses, built = machine.poses(50, 1), model(machine.text)
    found = drive_positions(built, machine.aimed(poses))
    true = np.array([machine.readings(pose) for pose in poses])
    assert found.reached.all()
    off = max(
        np.abs(found.readings - true).max(), np.abs(built.reference_readings - machine.readings(machine.drawn)).max()
    )
    return float(off / true.max())


def derivative_check(name: str) -> JacobianCheck:
    """Derivatives by EA, radii of pulleys and drums, anchors, points of bodies, and drives, at strained poses."""
    machine = MACHINES[name]
    readings = np.array([machine.readings(pose) for pose in machine.poses(3, 5, 0.3)]) - STRAINED[name]
    return jacobian_check(machine.text, readings)


def ropes() -> list[Row]:
    """Machines of `tests/rope_machines.py`."""
    rows = []
    for name, words in _NAMES.items():
        found = derivative_check(name)
        rows.append(Row(f"{words}: drives at 50 poses against trigonometry, relative", "< 1e-9", length_error(name)))
        of = f"{words}: {found.columns} columns of the Jacobian at strained poses"
        rows.append(Row(f"{of}, deviation from finite differences over largest entry", "< 1e-6", found.deviation))
    return rows
