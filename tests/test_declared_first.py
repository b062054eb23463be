"""Parameters that a machine file names and holds go before effects that imitate them, also beside other causes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.command import clean, run

pytestmark = pytest.mark.usefixtures("unsized")

MACHINE = """
units: {length: in, angle: deg, force: lbf}
space: planar
ranges: {length: 0.02, angle: 0.3}
parameters:
  base: {nominal: 10, identify: false}
  "crank{i}": {each: {i: [1, 2]}, nominal: 11}
  "rod{i}": {each: {i: [1, 2]}, nominal: 13}
  "zero{i}": {each: {i: [1, 2]}, nominal: 0}
ground: {O1: [0, 0], O2: [base, 0]}
nodes: {tip: [5, 19]}
bodies:
  arm1: {at: [0, 0], turn: 114.55, points: {E1: [crank1, 0]}}
  arm2: {at: [10, 0], turn: 65.45, points: {E2: [crank2, 0]}}
joints: {"hub{i}": {each: {i: [1, 2]}, between: ["O{i}", "arm{i}"], type: revolute}}
bars: {"link{i}": {each: {i: [1, 2]}, between: ["E{i}", tip], length: "rod{i}"}}
actuators: {"q{i}": {each: {i: [1, 2]}, turns: "arm{i}", zero: "zero{i}", limits: [20, 160]}}
sensors: {cam: {at: tip, reads: [x, y], sigma: 0.0005, frame: machine}}
"""
TRUE: dict[str, float] = {"base": 10.004, "c1": 11.008, "c2": 10.995, "r1": 13.01, "r2": 12.993, "z1": 0.12, "z2": -0.2}
NOMINAL: dict[str, float] = {"base": 10, "c1": 11, "c2": 11, "r1": 13, "r2": 13, "z1": 0, "z2": 0}
PLAY = 0.06  # deg, of the first crank


def tip(drives: np.ndarray, p: dict[str, float]) -> np.ndarray:
    """Where two cranks (deg) hold the tip: the upper point where two circles about the elbows meet."""
    first, second = np.radians(drives[0] + p["z1"]), np.radians(drives[1] + p["z2"])
    elbow = p["c1"] * np.array([np.cos(first), np.sin(first)])
    other = np.array([p["base"] + p["c2"] * np.cos(second), p["c2"] * np.sin(second)])
    apart = float(np.hypot(*(other - elbow)))
    along = (p["r1"] ** 2 - p["r2"] ** 2 + apart**2) / (2 * apart)
    u = (other - elbow) / apart
    return np.asarray(elbow + along * u + np.sqrt(p["r1"] ** 2 - along**2) * np.array([-u[1], u[0]]))


def drives(place: np.ndarray, p: dict[str, float]) -> np.ndarray:
    """The cranks' readings (deg) at a place, elbows outwards: the law of cosines."""
    out = []
    for centre, crank, rod, side in (((0.0, 0.0), p["c1"], p["r1"], 1), ((p["base"], 0.0), p["c2"], p["r2"], -1)):
        d = place - np.array(centre)
        far = float(np.hypot(*d))
        elbow = np.arccos((crank**2 + far**2 - rod**2) / (2 * crank * far))
        out.append(np.degrees(np.arctan2(d[1], d[0]) + side * elbow))
    return np.array(out) - np.array([p["z1"], p["z2"]])


def table(seed: int, play: float) -> str:
    """Sixty rows of the true machine at set values of the nominal one."""
    rng, lines = np.random.default_rng(seed), ["q1 [deg],q2 [deg],dir.q1,dir.q2,x [in],y [in]"]
    for _ in range(60):
        set_values, side = drives(rng.uniform([0, 11], [10, 19]), NOMINAL), rng.choice([-1, 1], 2)
        read = tip(set_values + np.array([-0.5 * side[0] * play, 0.0]), TRUE) + rng.normal(0, 0.0005, 2)
        lines.append(f"{set_values[0]:.5f},{set_values[1]:.5f},{side[0]},{side[1]},{read[0]:.5f},{read[1]:.5f}")
    return "\n".join(lines) + "\n"


def found(folder: Path, select: str, play: float, seed: int = 1) -> list[dict[str, Any]]:
    (folder / "five-bar.yaml").write_text(MACHINE, encoding="utf-8")
    (folder / "table.csv").write_text(table(seed, play), encoding="utf-8")
    done = clean(run("diagnose", folder / "five-bar.yaml", folder / "table.csv", "--select", select, "--json"))
    return list(done.json["effects"])


def test_the_zeros_that_are_held_are_named_not_the_zero_of_all_drives(tmp_path: Path) -> None:
    """All but one parameter are held. Beside one zero, the zero of all drives and the other zero are the same: the
    first was named, with the second as an alternative of equal weight."""
    effects = found(tmp_path, "crank1", PLAY)
    named = {f"{e['effect']}@{e['at']}": e for e in effects}
    assert {"release@zero1", "release@zero2", "backlash@q1"} <= set(named) and "zero@all" not in named
    for name, true in (("zero1", 0.12), ("zero2", -0.2)):
        (size,) = named[f"release@{name}"]["parameters"]
        assert abs(size["value"] - true) < 3 * size["std"] and size["unit"] == "deg"
    weights = {(r["effect"], r["at"]): r["weight"] for r in named["release@zero1"]["credible_set"]}
    assert weights["release", "zero1"] > 5 * weights["zero", "all"]


@pytest.mark.parametrize("seed", range(1, 4))
def test_zeros_alone(tmp_path: Path, seed: int) -> None:
    effects = found(tmp_path, "auto,-zero1,-zero2", 0.0, seed)
    assert {"zero1", "zero2"} <= {e["at"] for e in effects if e["effect"] == "release"}
    assert "zero" not in {e["effect"] for e in effects}
