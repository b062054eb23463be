"""A platform in eight tensioned ropes, against statics in closed form: its tensions keep the ropes from their lengths.

Poses and tensions are chosen; what the drives read follows: the lengths that the ropes have without these tensions.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.prediction import Rows, predict
from tests.in_ci import in_ci
from tests.support import model

EA, MASS, G, DRUM = 60e3, 20.0, 9.81, 0.05  # N, kg, m/s^2, m
REDUNDANT = [""] * 6 + [", redundant: true"] * 2
ANCHORS = np.array([(x, y, z) for z in (2.5, 0) for x, y in ((-2, -1.5), (2, -1.5), (2, 1.5), (-2, 1.5))])
CORNERS = np.array([(x, y, -0.15) for x, y in ((0.2, -0.15), (-0.2, -0.15), (-0.2, 0.15), (0.2, 0.15))])
CORNERS = np.vstack([CORNERS, CORNERS[[1, 0, 3, 2]] * (1, 1, -1)])  # crossed: upper ropes hold the lower corners
TEXT = f"""units: {{length: m, angle: rad, force: N}}
space: spatial
gravity: [0, 0, -{G}]
ground: {{{", ".join(f"A{k}: {list(map(float, a))}" for k, a in enumerate(ANCHORS))}}}
bodies:
  platform:
    at: [0, 0, 1.2]
    mass: {MASS}
    points: {{{", ".join(f"P{k}: {list(map(float, p))}" for k, p in enumerate(CORNERS))}}}
ropes: {{{", ".join(f"rope{k}: {{between: [A{k}, P{k}], EA: {EA}}}" for k in range(8))}}}
actuators: {{{", ".join(f"q{k}: {{winds: rope{k}, radius: {DRUM}, zero: 0{REDUNDANT[k]}}}" for k in range(8))}}}
sensors:
  tracker: {{at: platform, reads: [x, y, z, rx, ry, rz], frame: machine, sigma: {{position: 3e-5, orientation: 6e-5}}}}
tool_point: platform
"""


def natural_lengths(pose: Array, tension: float) -> Array | None:
    """Unloaded lengths (8,) of ropes that hold a pose (6,) with tensions near `tension`, N; None if one pushes."""
    corners = Rotation.from_rotvec(pose[3:]).apply(CORNERS)
    away = ANCHORS - pose[:3] - corners
    length = np.linalg.norm(away, axis=1)
    along = away / length[:, None]
    wrench = np.vstack([along.T, np.cross(corners, along).T])  # (6, 8)
    lacking = np.array([0, 0, MASS * G, 0, 0, 0]) - wrench @ np.full(8, tension)
    tensions = tension + np.linalg.pinv(wrench) @ lacking
    return None if tensions.min() < 0 else length / (1 + tensions / EA)


@pytest.mark.parametrize(
    ("tension", "count"), in_ci(["500.0-150"], [(500.0, 150), *((tension, 400) for tension in (150.0, 500.0, 900.0))])
)
def test_the_platform_stands_where_its_ropes_hold_it(tension: float, count: int) -> None:
    """Turned over, with crossed and slack ropes, it would have less energy in some rows: it does not go there."""
    rng = np.random.default_rng(3)
    half = np.array([0.6, 0.45, 0.35, 0.09, 0.09, 0.09])
    drawn = (0, 0, 1.2, 0, 0, 0) + half * rng.uniform(-1, 1, (count, 6))
    held = [(pose, lengths) for pose in drawn if (lengths := natural_lengths(pose, tension)) is not None]
    poses, readings = (np.array(part) for part in zip(*held, strict=True))
    assert len(poses) > count / 2
    machine = model(TEXT)
    found = predict(machine, machine.nominal, Rows.at(readings / DRUM))
    assert found.solved.all()
    assert np.abs(found.values - poses).max() < 1e-9
