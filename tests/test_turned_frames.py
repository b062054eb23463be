"""Orientations by parameters that turn frames, at the base and on bodies: rotations multiplied in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Request, Rows, predict
from tests.command import run

STACK = """
units: {length: mm, angle: deg}
space: spatial
ranges: {length: 1, angle: 1}
parameters: {a1: 5, a2: -3, a3: 12, b1: 20, b2: 7, b3: -9, c1: 3, c2: -30, c3: 4}
frames:
  base: {at: [0, 0, 0], turn: [a1, a2, a3]}
  head: {body: cross, turn: [b1, b2, b3]}
  wrist: {body: ram, turn: [c1, c2, c3]}
guides: {long: {frame: base, along: x}, short: {frame: head, along: y}, fine: {frame: wrist, along: z}}
bodies:
  cross: {guide: long, at: 0}
  ram: {guide: short, at: 0}
  quill: {guide: fine, at: 0, points: {tip: [0, 0, 50]}}
actuators: {X: {moves: cross}, Y: {moves: ram}, Z: {moves: quill}}
sensors: {tracker: {at: tip, reads: [rx, ry, rz], sigma: 1 urad, frame: machine}}
"""
NAMES = ("a1", "a2", "a3", "b1", "b2", "b3", "c1", "c2", "c3")
NOMINAL = np.radians([5.0, -3, 12, 20, 7, -9, 3, -30, 4])
SLIDE = """
units: {length: mm, angle: deg}
space: planar
ranges: {length: 1}
parameters: {turn: {nominal: 0, unit: deg, range: 0.06}}
frames: {base: {at: [0, 0], turn: turn}, head: {body: cross}}
guides: {long: {frame: base, along: x}, short: {frame: head, along: y}}
bodies: {cross: {guide: long, at: 0}, ram: {guide: short, at: 0, points: {tip: [0, 0]}}}
actuators: {X: {moves: cross}, Y: {moves: ram}}
sensors: {tracker: {at: tip, reads: [x, y], sigma: 5 um, frame: machine}}
"""


def turned(vectors: Array) -> Array:
    """Rotation vector of the quill against the drawing, from the rotation vectors (9,) of the three frames."""
    now, drawn = (
        Rotation.from_rotvec(v[:3]) * Rotation.from_rotvec(v[3:6]) * Rotation.from_rotvec(v[6:])
        for v in (vectors, NOMINAL)
    )
    return np.asarray((now * drawn.inv()).as_rotvec())


def test_every_frame_turns_what_it_carries(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(STACK)
    model = load_machine(str(tmp_path / "m.yaml")).model
    at = [model.names.index(n) for n in NAMES]
    values, off = model.nominal.copy(), np.radians(np.random.default_rng(0).normal(size=9) * 5)
    values[at] += off
    told = predict(model, values, Rows.at(np.array([[0.1, 0.2, -0.3]])), Request(parameters=NAMES))
    assert told.jacobian is not None
    assert told.values[0] == pytest.approx(turned(NOMINAL + off), abs=1e-12)
    steps = 1e-5 * np.eye(9)
    slopes = [(turned(NOMINAL + off + h) - turned(NOMINAL + off - h)) / 2e-5 for h in steps]
    assert told.jacobian[0] == pytest.approx(np.transpose(slopes), abs=1e-8)


def test_a_turned_base_is_not_idle(tmp_path: Path) -> None:
    """Where both drives stand at zero it moves no point, but turns all."""
    (tmp_path / "m.yaml").write_text(SLIDE)
    done = run("check", tmp_path / "m.yaml")
    assert done.code == 0, done.err
