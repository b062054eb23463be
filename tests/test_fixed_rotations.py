"""Bodies and nodes of which some rotations are fixed: against closed forms of the legs and of a bent beam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.command import clean, column, run

BASE = np.array([[300.0, 0, 0], [-150, 260, 0], [-150, -260, 0]])
HEAD = np.array([[120.0, 0, 0], [-60, 104, 20], [-60, -104, -20]])
AT = np.array([10.0, -5.0, 400.0])
POSES = {  # fixed directions, and rotation vectors that they allow
    "x, y, rz": [(0.1, 0.2, 0.0), (-0.3, 0.25, 0.0), (0.4, 0.0, 0.0)],
    "y, z, rx": [(0.0, 0.1, 0.2), (0.0, -0.3, 0.25), (0.0, 0.4, 0.0)],
    "x, rx, rz": [(0.0, 0.3, 0.0), (0.0, -0.6, 0.0), (0.0, 1.0, 0.0)],
    "y, ry, rz": [(0.3, 0.0, 0.0), (-0.6, 0.0, 0.0), (0.9, 0.0, 0.0)],
}
MOVES = {"x, y, rz": (0, 0, 15.0), "y, z, rx": (-20.0, 0, 0), "x, rx, rz": (0, 12.0, 25.0), "y, ry, rz": (9.0, 0, 18.0)}


def drawn(fixed: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Base points, points of the head (3, 3) and its place (3,); legs along x where it turns about y and z."""
    turn = 1 if fixed == "y, z, rx" else 0
    return np.roll(BASE, turn, axis=1), np.roll(HEAD, turn, axis=1), np.roll(AT, turn)


def written(path: Path, fixed: str) -> Path:
    base, head, at = drawn(fixed)
    legs = "".join(f"  B{i}: {list(map(float, b))}\n" for i, b in enumerate(base, 1))
    points = ", ".join(f"P{i}: {list(map(float, p))}" for i, p in enumerate(head, 1))
    path.write_text(
        "units: {length: mm, angle: rad, force: N}\nspace: spatial\nground:\n" + legs
        + f"bodies: {{head: {{at: {at.tolist()}, fixed: [{fixed}], points: {{{points}}}}}}}\n"
        + 'bars: {"l{i}": {each: {i: [1, 2, 3]}, between: ["B{i}", "P{i}"]}}\n'
        + 'actuators: {"q{i}": {each: {i: [1, 2, 3]}, drives: "l{i}"}}\n'
        + "sensors: {camera: {at: head, reads: [x, y, z, rx, ry, rz], sigma: {position: 1 um, orientation: 1 urad},"
        + " frame: machine}}\n"
    )  # fmt: skip
    return path


@pytest.mark.parametrize("fixed", POSES)
def test_a_body_moves_only_as_it_is_not_fixed(fixed: str, tmp_path: Path) -> None:
    """Leg lengths of poses that the fixed directions allow bring the body there, also at large angles."""
    machine, table, out = written(tmp_path / "m.yaml", fixed), tmp_path / "t.csv", tmp_path / "o.csv"
    base, head, start = drawn(fixed)
    places = [start + k * np.array(MOVES[fixed]) for k in (1.0, -0.5, 0.3)]
    lengths = [
        np.linalg.norm(at + Rotation.from_rotvec(turn).apply(head) - base, axis=1)
        for at, turn in zip(places, POSES[fixed], strict=True)
    ]
    rows = [",".join(f"{x:.15g}" for x in length) for length in lengths]
    table.write_text("q1,q2,q3\n" + "\n".join(rows) + "\n")
    checked = clean(run("check", machine))
    assert checked.code == 0 and "3 degrees of freedom, 3 actuators; not redundant" in checked.out + checked.err
    assert clean(run("simulate", machine, table, "-o", out)).code == 0
    for k, name in enumerate(("x", "y", "z")):
        assert column(out, name) == pytest.approx([p[k] for p in places], abs=1e-8)
    for k, name in enumerate(("rx", "ry", "rz")):
        assert column(out, name) == pytest.approx([turn[k] for turn in POSES[fixed]], abs=1e-11)
    assert np.abs(np.array(lengths) - np.linalg.norm(start + head - base, axis=1)).max() > 10.0


@pytest.mark.parametrize(("fixed", "turned"), [("y, z, rx, ry", (0, 1)), ("y, z, rz", (1, 0)), ("y, z", (1, 1))])
def test_a_beam_end_bends_only_as_it_is_not_fixed(fixed: str, turned: tuple[int, int], tmp_path: Path) -> None:
    """A cantilever whose tip is held across, with a moment: rotated by M L / 4 EI about the axes that are free."""
    machine, table, out = tmp_path / "m.yaml", tmp_path / "t.csv", tmp_path / "o.csv"
    machine.write_text(
        "units: {length: mm, angle: mrad, force: N}\nspace: spatial\nground: {W: [0, 0, 0]}\n"
        f"nodes: {{n: {{at: [100, 0, 0], fixed: [{fixed}]}}}}\n"
        "beams: {b: {between: [W, n], EA: 1 MN, EI: 100 N*m^2, GJ: 100 N*m^2}}\n"
        "loads: {l: {at: n, moment: [0, 1 Nm, 1 Nm]}}\n"
        "sensors: {gauge: {at: n, reads: [x, ry, rz], sigma: {position: 1 um, orientation: 10 urad}, frame: machine}}\n"
    )
    table.write_text("id\n1\n")
    assert clean(run("simulate", machine, table, "-o", out)).code == 0
    for name, on in zip(("ry", "rz"), turned, strict=True):
        assert column(out, name)[0] == pytest.approx(on * 1.0 * 0.1 / (4 * 100.0) * 1000, rel=1e-6, abs=1e-9)
