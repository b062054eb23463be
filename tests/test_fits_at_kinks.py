"""Fits that end where a rope is between taut and slack: no step lowers chi-square there, but they need not fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from pkmcal_cli.base.rotation import Array
from tests import test_slack_ropes as five
from tests.command import run


def test_a_fit_that_ends_at_a_kink_goes_on_without_these_rows(tmp_path: Path) -> None:
    """Drives with noise of 0.1 mm, ropes off by 2 mm: in seven of sixty rows a rope may be taut or slack."""
    rng = np.random.default_rng(51)
    places, lengths = (x[:60] for x in five.wound(1))
    off = np.zeros((5, 3))
    off[:, [0, 2]] = rng.uniform(-2e-3, 2e-3, (5, 3))[:, [0, 2]]
    true = np.array([five.minimum(p, l, five.ANCHORS + off) for p, l in zip(places, lengths, strict=True)])
    commanded = lengths + rng.normal(0, 1e-4, lengths.shape)
    rows = np.column_stack([commanded, true + rng.normal(0, 1e-5, true.shape)])
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    machine.write_text(five.text((4, 5)), encoding="utf-8")
    names = ",".join([*(f"q{i} [mm]" for i in range(1, 6)), "x [mm]", "y [mm]", "z [mm]"])
    np.savetxt(table, 1e3 * rows, "%.6f", ",", header=names, comments="")
    found = run("calibrate", machine, table, "--json", "--holdout", "none", "--starts", "1", "-q").json
    assert found["status"] == "converged" and 0.5 < found["chi2_per_dof"] < 1.6
    reasons = {row["reason"] for row in found["failed"]}
    assert reasons == {"a rope is taut or slack (within 2 std)"} and len(found["failed"]) < 20
    for p in found["parameters"]:
        if p["name"] != "EA":
            k, axis = int(p["name"][1]) - 1, "xyz".index(p["name"][0])
            assert abs(p["value"] - 1e3 * (five.ANCHORS + off)[k, axis]) < 4 * p["std"]



# --- a point in the plane on four ropes of which the zeros are forgotten ---------------------------------------------
WINDOWS = np.array([[0, 2.2], [3, 2.2], [0, 0], [3, 0]])
MACHINE = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    gravity: [0, -9.81]
    parameters:
      "zero{i}": {each: {i: [1, 2, 3, 4]}, nominal: 250, range: 200}
      EA: {nominal: 100000, range: 20000, unit: N, identify: false}
    ground: {A1: [0, 2200], A2: [3000, 2200], A3: [0, 0], A4: [3000, 0]}
    nodes: {p: {at: [1500, 1100], mass: 8}}
    ropes:
      "r{i}": {each: {i: [1, 2, 3, 4]}, between: ["A{i}", p], EA: EA}
    actuators:
      "q{i}": {each: {i: [1, 2]}, winds: "r{i}", radius: 25, zero: "zero{i}", unit: deg, sigma: 0.1 mm}
      "q{j}": {each: {j: [3, 4]}, winds: "r{j}", radius: 25, zero: "zero{j}", unit: deg, sigma: 0.1 mm, redundant: true}
    sensors:
      camera: {kind: tcp, at: p, reads: [x, y], sigma: 0.2 mm, frame: machine}
"""


def hung(lengths: Array) -> Array:
    """Where the point (2,) has least energy; ropes pull with EA e / length, and never push."""

    def energy(p: Array) -> tuple[float, Array]:
        to = WINDOWS - p
        long = np.linalg.norm(to, axis=1)
        taut = np.maximum(long - lengths, 0.0)
        pull = 1e5 / lengths * taut
        return float(pull @ taut / 2 + 8 * 9.81 * p[1]), np.array([0.0, 8 * 9.81]) - (pull / long) @ to

    starts = [(1.5, 1.1), (1.5, 0.6), (1.0, 1.0), (2.0, 1.0), (1.5, 1.6)]
    ends = [minimize(energy, start, jac=True, method="BFGS", options={"gtol": 1e-9}) for start in starts]
    return np.asarray(min(ends, key=lambda end: end.fun).x)


SHARES = np.array([0.932220268, 0.347374584, 0.77091157, 0.630781296])
FAR = [(seed, np.full(4, 0.15), 60) for seed in (1, 4, 6, 16)]
NEAR = (31, 0.005 * SHARES, 40)


@pytest.mark.parametrize(
    ("seed", "sizes", "count"), [NEAR, *(pytest.param(*far, marks=pytest.mark.slow) for far in FAR)]
)
def test_zeros_of_ropes_are_found(seed: int, sizes: Array, count: int, tmp_path: Path) -> None:
    """Which ropes carry changes from row to row. What is told to be known is; of a rope that is slack in every row but
    for noise nothing is known, though a row in which it just does not pull stops the fit. `NEAR`: plain descent ends
    with one rope slack in all rows and another one wrong by six standard uncertainties, as a slack rope moves nothing.
    """
    rng = np.random.default_rng(seed)
    off = sizes * rng.choice([-1, 1], 4)
    places = rng.uniform([0.6, 0.5], [2.4, 1.7], (count, 2))
    lengths = np.linalg.norm(WINDOWS - places[:, None], axis=2)
    true = np.array([hung(l + off) for l in lengths])
    slack = np.linalg.norm(WINDOWS - true[:, None], axis=2) < lengths + off
    turns = np.rad2deg((lengths + rng.normal(0, 1e-4, lengths.shape) - 0.25) / 0.025)
    rows = np.column_stack([turns, 1e3 * (true + rng.normal(0, 2e-4, true.shape))])
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    machine.write_text(MACHINE.replace("200}", f"{1300 * sizes.max():.3g}}}"), encoding="utf-8")
    np.savetxt(table, rows, "%.6f", ",", header="q1 [deg],q2 [deg],q3 [deg],q4 [deg],x [mm],y [mm]", comments="")
    found = run("calibrate", machine, table, "--json", "--holdout", "none", "-q").json
    assert found["status"] == "converged" and 0.5 < found["chi2_per_dof"] < 1.5
    assert len(found["failed"]) <= 6 and (seed == 16 or found["starts"] is None)
    known = {p["name"]: p for p in found["parameters"] if p["std"] is not None}
    for k in range(4):
        if f"zero{k + 1}" in known:
            p = known[f"zero{k + 1}"]
            assert abs(p["value"] - 250 - 1e3 * off[k]) < 4 * p["std"] < 4
    assert {k for k in range(4) if slack[:, k].all()} == {k for k in range(4) if f"zero{k + 1}" not in known}
