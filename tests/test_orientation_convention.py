"""Angles of turns and quaternions in columns of rotation vectors are told as that, by rotations of another library."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from pkmcal_cli.gross_errors.orientation_convention import CONVENTIONS, rotation_vectors
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Rows, predict
from tests.command import MACHINES, run

ORDERS = ["".join(order) for order in permutations("xyz")]
TURNS, PLACES = ["rx [rad]", "ry [rad]", "rz [rad]"], ["x [mm]", "y [mm]", "z [mm]"]
HEXAPOD, TABLE = MACHINES / "hexapod7.yaml", MACHINES / "hexapod7.csv"


def angles(rotation: Rotation, order: str) -> np.ndarray:
    """Angles (N, 3), in the order x, y, z, of turns about the fixed axes in this order."""
    return rotation.as_euler(order)[:, [order.index(axis) for axis in "xyz"]]


def written(folder: Path, change: str | Callable[[Rotation], np.ndarray]) -> Path:
    """The shipped table of the hexapod with orientations in another convention."""
    table, path = pd.read_csv(TABLE), folder / "other.csv"
    rotation = Rotation.from_rotvec(table[TURNS].to_numpy())
    if isinstance(change, str):
        table[TURNS] = rotation.as_quat()[:, :3] if change == "quaternion" else angles(rotation, change)
    else:
        table[TURNS] = change(rotation)
    table.to_csv(path, index=False)
    return path


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_rotation_vectors_are_those_of_another_library(convention: str) -> None:
    vectors = np.random.default_rng(3).uniform(-1.2, 1.2, (40, 3))
    rotation = Rotation.from_rotvec(vectors)
    quaternion = rotation.as_quat(canonical=True)[:, :3]
    read = quaternion if convention == "quaternion" else angles(rotation, convention)
    np.testing.assert_allclose(rotation_vectors(read, convention), vectors, atol=1e-14)


def test_what_is_no_orientation_stays_unknown() -> None:
    read = np.array([[0.1, np.nan, 0.2], [0.8, 0.8, 0.8], [0.0, 0.0, 0.0]])
    assert np.isnan(rotation_vectors(read, "quaternion")[:2]).all()
    assert np.isnan(rotation_vectors(read, "xyz")[0]).all()
    for convention in CONVENTIONS:
        np.testing.assert_array_equal(rotation_vectors(read, convention)[2], 0.0)


@pytest.mark.parametrize("order", ORDERS)
def test_the_order_of_the_turns_is_told(order: str, tmp_path: Path) -> None:
    told = run("check", HEXAPOD, written(tmp_path, order)).err
    assert f"look like angles of turns about the fixed axes {', then '.join(order)}, not like" in told, told


def test_a_quaternion_is_told(tmp_path: Path) -> None:
    told = run("check", HEXAPOD, written(tmp_path, "quaternion")).err
    assert "`rx`, `ry`, `rz` look like the vector part of a quaternion" in told, told


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: np.degrees(angles(r, "zyx")), "like angles in degrees of turns about the fixed axes z, then y"),
        (lambda r: (r * r[0].inv()).as_rotvec(), "counted from another orientation, as that of the first row (ANGLE"),
        (lambda r: (r[0].inv() * r).as_rotvec(), "given in other axes (ANGLE"),
        (lambda r: angles(r * r[0].inv(), "xyz"), "not like a rotation vector, and counted from another orientation"),
    ],
)  # fmt: skip
def test_units_and_other_orientations_are_told_beside(
    change: Callable[[Rotation], np.ndarray], words: str, tmp_path: Path
) -> None:
    """The angle is that of the first row, but for the errors of the nominal machine, 0.03 deg rms."""
    told = run("check", HEXAPOD, written(tmp_path, change)).err
    assert re.search(re.escape(words).replace("ANGLE", r"([\d.]+) deg off\)"), told), told
    for angle in re.findall(r"\(([\d.]+) deg off\)", told):
        first = np.linalg.norm(pd.read_csv(TABLE)[TURNS].to_numpy()[0])
        assert float(angle) == pytest.approx(np.degrees(first), abs=0.1)


@pytest.mark.parametrize(("sigma", "place"), [("5 um", True), ("2.5 mm", False)])
def test_an_instrument_that_is_tilted_has_no_other_convention(sigma: str, place: bool, tmp_path: Path) -> None:
    """By 6 deg, points and orientations alike: no convention explains the points, 54 mm off, also where they are rough
    beside orientations."""
    table, path, tilt = pd.read_csv(TABLE), tmp_path / "tilted.csv", Rotation.from_rotvec([0.06, -0.08, 0.04])
    machine = tmp_path / "machine.yaml"
    machine.write_text(HEXAPOD.read_text().replace("position: 5 um", f"position: {sigma}"))
    table[PLACES] = tilt.apply(table[PLACES].to_numpy())
    table[TURNS] = (tilt * Rotation.from_rotvec(table[TURNS].to_numpy())).as_rotvec()
    table.to_csv(path, index=False)
    told = run("check", machine, path).err
    assert ("look taken from another place" in told) == place, told
    assert not any(words in told for words in ("rotation vector", "another orientation", "other axes")), told


def test_a_reflector_that_sits_askew_is_no_convention(tmp_path: Path) -> None:
    """Orientations of a body turned by 1.7 deg: so little is an error of mounting, with a name of its own."""
    told = run("check", HEXAPOD, written(tmp_path, lambda r: (r * Rotation.from_rotvec([0.03, 0, 0])).as_rotvec())).err
    assert "another orientation" not in told and "other axes" not in told, told


def test_a_diagnosis_goes_on_with_rotation_vectors(tmp_path: Path) -> None:
    """With them nothing is left but the noise: 5 um of position."""
    done = run("diagnose", HEXAPOD, written(tmp_path, "zyx"))
    assert done.code == 1
    assert "the measurement is at fault: `rx`, `ry`, `rz` look like angles" in done.out + done.err
    share = re.search(r"are ([\d.]+) times the stated noise", done.out + done.err)
    assert share is not None and float(share[1]) < 1.2


def test_an_instrument_that_stands_anywhere_shows_it_by_its_points(tmp_path: Path) -> None:
    machine, path = tmp_path / "machine.yaml", tmp_path / "turned.csv"
    machine.write_text(HEXAPOD.read_text().replace("frame: machine", "frame: fitted"))
    table = pd.read_csv(TABLE)
    frame = Rotation.from_rotvec([0.7, -1.1, 0.4])
    table[PLACES] = frame.apply(table[PLACES].to_numpy()) + np.array([300.0, -200.0, 100.0])
    table[TURNS] = angles(frame * Rotation.from_rotvec(table[TURNS].to_numpy()), "xyz")
    table.to_csv(path, index=False)
    told = run("check", machine, path).err
    assert "look like angles of turns about the fixed axes x, then y, then z, not like" in told, told


def test_turns_of_two_degrees_show_it_as_well(tmp_path: Path) -> None:
    """Conventions differ by less than ranges explain, 0.3 mrad, but not as parameters would have it."""
    machine, path = tmp_path / "machine.yaml", tmp_path / "small.csv"
    machine.write_text(HEXAPOD.read_text().replace("8.5 deg", "2.5 deg"))
    assert run("simulate", machine, "--grid", "60", "--noise", "declared", "-o", path).code == 0
    table = pd.read_csv(path)
    assert "not like a rotation vector" not in run("check", machine, path).err
    table[TURNS] = angles(Rotation.from_rotvec(table[TURNS].to_numpy()), "zyx")
    table.to_csv(path, index=False)
    assert "fixed axes z, then y, then x, not like a rotation vector" in run("check", machine, path).err


@pytest.mark.parametrize("off", [{"b1x": 5e-3}, {"p3z": -8e-3, "b5y": 4e-3}])
def test_a_machine_that_is_off_has_no_other_convention(off: dict[str, float], tmp_path: Path) -> None:
    """Places of joints that are 40 and 80 ranges off, m, turn the platform."""
    path, table, model = tmp_path / "off.csv", pd.read_csv(TABLE), load_machine(str(HEXAPOD)).model
    values = model.nominal + np.array([off.get(p.name, 0.0) for p in model.parameters])
    read = predict(model, values, Rows.at(table.filter(regex="^q").to_numpy() * 1e-3)).values
    table[PLACES], table[TURNS] = read[:, :3] * 1e3, read[:, 3:]
    table.to_csv(path, index=False)
    told = run("check", HEXAPOD, path).err
    assert "not like a rotation vector" not in told, told
