"""A head that only turns (two axes through one point), read by an instrument of orientations that stands anywhere.

Its truth is a closed form, R = Rz(q1) Rot(tilted axis, q2 + z), seen from an instrument that is turned by F: F R.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array, exp, log
from tests.command import run

HEAD = """
units: {length: mm, angle: deg}
space: spatial
parameters: {e: {nominal: 0, range: 4e-3}, z: {nominal: 0, range: 0.2, unit: deg}}
ground: {O: [0, 0, 0]}
bodies: {fork: {at: [0, 0, 0]}, head: {at: [0, 0, 0]}}
joints:
  pan: {between: [O, fork], type: revolute, axis: z}
  tilt: {between: [fork, head], type: revolute, axis: [0, 1, e]}
actuators: {q1: {turns: fork}, q2: {turns: tilt, zero: z}}
sensors: {level: {at: head, reads: [rx, ry, rz], sigma: 5 arcsec, frame: fitted}}
workspace: {box: {rz: [-60, 60], ry: [-40, 40]}}
"""
UNITS = {"urad": 1e-6, "mrad": 1e-3, "deg": np.deg2rad(1.0), "rad": 1.0}
ARCSEC = float(np.deg2rad(1 / 3600))
E_, Z = 2e-3, np.deg2rad(0.07)
FRAME = exp(np.array([2.4, -0.9, 1.1]))


def orientation(q: Array, e: float = E_, z: float = Z) -> Array:
    """Where the head looks (n, 3, 3) at readings q (n, 2), rad."""
    axis = np.array([0.0, 1.0, e]) / np.hypot(1.0, e)
    zero = np.zeros(len(q))
    return exp(np.stack([zero, zero, q[:, 0]], axis=1)) @ exp(np.outer(q[:, 1] + z, axis))


def table(path: Path, q: Array, seed: int, **errors: float) -> str:
    """Readings of the instrument with 5 arcsec of noise, written in deg and mrad."""
    rng = np.random.default_rng(seed)
    seen = exp(5 * ARCSEC * rng.normal(size=(len(q), 3))) @ FRAME @ orientation(q, **errors)
    columns = np.hstack([1e3 * log(seen), np.rad2deg(q)])
    lines = [",".join(f"{v:.9g}" for v in row) for row in columns]
    path.write_text("\n".join(["rx [mrad],ry [mrad],rz [mrad],q1 [deg],q2 [deg]", *lines]) + "\n", encoding="utf-8")
    return str(path)


def poses(seed: int, rows: int = 30) -> Array:
    """Drive readings (rows, 2), rad."""
    return np.random.default_rng(seed).uniform([-1.0, -0.6], [1.0, 0.6], size=(rows, 2))


@pytest.fixture(name="head")
def fixture_head(tmp_path: Path) -> str:
    """The machine file."""
    (tmp_path / "head.yaml").write_text(HEAD, encoding="utf-8")
    return str(tmp_path / "head.yaml")


def fitted(head: str, folder: Path, name: str, seed: int, **errors: float) -> str:
    """The parameter file of a campaign."""
    out = str(folder / f"{name}.params.yaml")
    made = run("calibrate", head, table(folder / f"{name}.csv", poses(seed), seed, **errors), "-o", out)
    assert made.code == 0, made.err
    return out


def test_an_instrument_of_orientations_starts_where_its_readings_put_it(head: str, tmp_path: Path) -> None:
    """The error before is that of the machine, of 4 mrad at most; it was that of the instrument's stand, 150 deg."""
    measured = table(tmp_path / "m.csv", poses(1), 1)
    result = run("calibrate", head, measured, "--holdout", "none", "--json").json
    before = result["before"]["orientation"]
    true = orientation(poses(1)) @ orientation(poses(1), 0.0, 0.0).transpose(0, 2, 1)
    left = np.linalg.norm(log(true), axis=1)
    assert before["rms"] * UNITS[before["unit"]] < 1.5 * np.sqrt((left**2).mean())


def test_a_point_that_stays_does_not_tell_how_the_instrument_is_turned(head: str, tmp_path: Path) -> None:
    """The middle of the head, read besides: the rotation between points that are one is anything, up to half a turn."""
    each = "sigma: {x: 5 um, y: 5 um, z: 5 um, rx: 5 arcsec, ry: 5 arcsec, rz: 5 arcsec}"
    text = HEAD.replace("reads: [rx, ry, rz], sigma: 5 arcsec", f"reads: [x, y, z, rx, ry, rz], {each}")
    Path(head).write_text(text, encoding="utf-8")
    lines = Path(table(tmp_path / "m.csv", poses(1), 1)).read_text(encoding="utf-8").splitlines()
    places = np.array([120.0, -45.0, 300.0]) + 5e-3 * np.random.default_rng(5).normal(size=(len(lines) - 1, 3))  # mm
    rows = [f"{x:.5f},{y:.5f},{z:.5f},{line}" for (x, y, z), line in zip(places, lines[1:], strict=True)]
    (tmp_path / "p.csv").write_text("\n".join([f"x [mm],y [mm],z [mm],{lines[0]}", *rows, ""]), encoding="utf-8")
    result = run("calibrate", head, tmp_path / "p.csv", "--holdout", "none", "--json").json
    before = result["before"]["orientation"]
    assert result["status"] == "converged" and before["rms"] * UNITS[before["unit"]] < 5e-3
    assert result["before"]["position"]["rms"] < 20, "um"


def test_errors_seen_from_anywhere_are_those_of_poses_to_each_other(head: str, tmp_path: Path) -> None:
    params = fitted(head, tmp_path, "a", 1)
    done = run("check", head, table(tmp_path / "b.csv", poses(7), 7), "-p", params)
    assert "Errors are those of poses to each other: the instrument stands anywhere" in done.err


def test_an_angle_is_a_tolerance_of_orientations(head: str, tmp_path: Path) -> None:
    """The same machine passes 60 arcsec; one whose zero moved by 0.05 deg fails; a length judges nothing here."""
    params = fitted(head, tmp_path, "a", 1)
    same, moved = (table(tmp_path / f"{z}.csv", poses(7), 7, z=Z + z) for z in (0.0, np.deg2rad(0.05)))
    good = run("check", head, same, "-p", params, "--tolerance", "60 arcsec")
    assert good.code == 0 and "PASS (ISO 14253-1, tolerance 60 arcsec): 30 orientations" in good.err
    assert "largest orientation error: " in good.err
    bad = run("check", head, moved, "-p", params, "--tolerance", "1 arcmin", "--json")
    assert bad.code == 1 and bad.json["verification"]["tolerance"]["unit"] == "arcmin"
    none = run("check", head, same, "-p", params, "--tolerance", "20 um")
    assert none.code == 2 and "no positions or distances were measured" in none.err and "arcsec" in none.err


def test_a_change_of_a_machine_that_only_turns_is_an_angle(head: str, tmp_path: Path) -> None:
    """A zero that moves by 0.05 deg turns the head by that much everywhere; its place, 0 mm, tells nothing."""
    old, new = fitted(head, tmp_path, "a", 1), fitted(head, tmp_path, "b", 2, z=Z + np.deg2rad(0.05))
    moved = run("compare", old, new, "--machine", head, "--json", "--fail-above", "change 1 mrad")
    point = moved.json["tool_point"]
    assert (point["unit"], point["at_unit"]) == ("urad", "deg") and set(point["at"]) == {"rx", "ry", "rz"}
    assert point["max"] == pytest.approx(1e6 * np.deg2rad(0.05), rel=0.05)
    assert moved.json["gates"][0]["kept"]
    small = run("compare", old, new, "--machine", head, "--fail-above", "change 500 urad", "--json")
    assert not small.json["gates"][0]["kept"]
    assert "change of the tool point's orientation" in run("compare", old, new, "--machine", head).err


def test_a_study_of_a_machine_that_only_turns_tells_angles(head: str) -> None:
    """From 30 readings of 5 arcsec some arcsec are left, and with four times the points about half of that."""
    asked = ("study", head, "--points", "10,40", "--repeat", "30", "--jobs", "1", "--json")
    few, many = (c["tool"] for c in run(*asked).json["cases"])
    assert few["unit"] == many["unit"] == "urad"
    assert 0.2 * 5 < few["mean"] * 1e-6 / ARCSEC < 2 * 5
    assert many["mean"] / few["mean"] == pytest.approx(0.5, abs=0.15)
