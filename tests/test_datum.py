"""What data do not say of the base is found, named, fixed by a stated datum; what they say too little of is refused."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, run

SECOND = HANGPRINTER_DATA.replace("2021-12-16", "2022-04-12")
BELTS = MACHINES / "belt-router"
FIVE_BAR = MACHINES / "five-bar"
ANCHORS = [f"{a}{c}" for a in "ABCD" for c in "xyz"]
WIDE = "parameters: {" + ", ".join(f"{n}: {{range: 5000}}" for n in ANCHORS) + "}\n"


def overlaid(folder: Path, base: Path | str, text: str) -> Path:
    file = folder / "m.yaml"
    file.write_text(f"extends: {base}\n{text}", encoding="utf-8")
    return file


def refused(machine: Path | str, table: Path | str) -> str:
    done = run("calibrate", machine, table)
    assert done.code == 3 and "error[under-determined]" in done.err and "Parameters" not in done.err
    return str(done.err)


def calibrated(machine: Path | str, table: Path | str, *more: str) -> dict[str, Any]:
    done = run("calibrate", machine, table, "--holdout", "none", "--json", *more)
    assert done.code == 0, done.err
    return dict(done.json)


def test_turns_about_the_home_point_are_not_seen_without_a_camera(tmp_path: Path) -> None:
    machine = overlaid(tmp_path, HANGPRINTER, "sensors: {camera: null}\n")
    told = refused(machine, SECOND)
    assert (
        "rotation about x, rotation about y, rotation about z" in told
        and "44 equations, 12 unknowns, 3 null directions" in told
    )


def test_shifts_of_the_frame_are_not_seen_by_belts(tmp_path: Path) -> None:
    """Gravity tells which way is down, only weakly: a turn is weak, not null; two shifts are null."""
    machine = tmp_path / "m.yaml"
    text = BELTS.with_suffix(".yaml").read_text(encoding="utf-8")
    machine.write_text("\n".join(line for line in text.splitlines() if not line.startswith("datum:")), encoding="utf-8")
    assert "(shift along x, shift along y)" in refused(machine, BELTS.with_suffix(".csv"))


def test_the_scale_is_not_seen_by_angles_alone(tmp_path: Path) -> None:
    machine = overlaid(
        tmp_path,
        FIVE_BAR.with_suffix(".yaml"),
        "sensors: {ballbar: null}\nground: {ball: null}\nparameters: {ballx: null, bally: null}\n",
    )
    few, poses = tmp_path / "few.csv", tmp_path / "poses.csv"
    head, *rows = FIVE_BAR.with_suffix(".csv").read_text(encoding="utf-8").splitlines()
    poses.write_text("\n".join([head, *rows[::2], ""]), encoding="utf-8")
    assert run("simulate", machine, poses, "--noise", "declared", "--seed", "1", "-o", few).code == 0
    assert "the data do not fix the base (scale)" in refused(machine, few)
    machine.write_text(machine.read_text(encoding="utf-8") + "datum: [base]\n", encoding="utf-8")
    found = calibrated(machine, few, "--starts", "1")
    assert found["datum"] == ["base"] and found["gauge"] == ["scale"]
    assert all(p["std"] is not None for p in found["parameters"])


@pytest.mark.parametrize("datum", ["[Ax, Az, Bz]", "[Dx, Dy, Bx]", "[Cx, Cy, Az, Dx, Dy]"])
def test_distances_do_not_depend_on_the_datum(tmp_path: Path, datum: str) -> None:
    """Whatever coordinates are held, all distances between anchors (and to home) are the same; as many as freedoms.

    With ranges so wide that no direction is weak, though their scale is estimated (0.2 of 500 mm, say): what is held
    at its prior depends on where that is.
    """
    machine = overlaid(tmp_path, HANGPRINTER, f"sensors: {{camera: null}}\ndatum: {datum}\n{WIDE}")
    found = calibrated(machine, SECOND)
    assert len(found["datum"]) == 3 and found["status"] == "incomplete"
    place = {p["name"]: p["value"] for p in found["parameters"]}
    nominal = {"Ax": 0, "Az": -115, "Bz": -160, "Dx": 0, "Dy": 0, "Bx": 1300, "Cx": -1400, "Cy": 740}
    at = np.array([[place.get(f"{a}{c}", nominal.get(f"{a}{c}")) for c in "xyz"] for a in "ABCD"] + [[0.0] * 3], float)
    distance = np.linalg.norm(at[:, None] - at[None], axis=2)[np.triu_indices(5, 1)]
    assert distance == pytest.approx(expected(), abs=0.02), "mm, by the first datum"


@cache
def expected() -> Any:
    with tempfile.TemporaryDirectory() as folder:
        machine = overlaid(Path(folder), HANGPRINTER, f"sensors: {{camera: null}}\ndatum: [By, Dx, Cz]\n{WIDE}")
        place = {p["name"]: p["value"] for p in calibrated(machine, SECOND)["parameters"]}
    place |= {"By": 1230.0, "Dx": 0.0, "Cz": -150.0}
    at = np.array([[place[f"{a}{c}"] for c in "xyz"] for a in "ABCD"] + [[0.0] * 3])
    return np.linalg.norm(at[:, None] - at[None], axis=2)[np.triu_indices(5, 1)]


def test_with_a_camera_nothing_is_held(tmp_path: Path) -> None:
    machine = overlaid(tmp_path, HANGPRINTER, "datum: [Ax, Az, Bz]\n")
    found = calibrated(machine, HANGPRINTER_DATA)
    assert found["datum"] is None and found["gauge"] == []
    assert [p["name"] for p in found["parameters"]] == ANCHORS


def test_a_datum_too_short_is_refused_with_one_that_is_not(tmp_path: Path) -> None:
    machine = overlaid(tmp_path, HANGPRINTER, "sensors: {camera: null}\ndatum: [Ax]\n")
    told = refused(machine, SECOND)
    proposed = told[told.index("`datum: [") :].split("`")[1]
    assert proposed.startswith("datum: [Ax, ") and len(proposed.split(",")) == 3
    machine.write_text(machine.read_text(encoding="utf-8").replace("datum: [Ax]", proposed), encoding="utf-8")
    assert calibrated(machine, SECOND)["status"] == "incomplete"


def test_an_unknown_name_in_the_datum_is_a_fault(tmp_path: Path) -> None:
    done = run("check", overlaid(tmp_path, HANGPRINTER, "datum: [Ax, Azz]\n"))
    assert done.code == 1 and "unknown parameter `Azz`" in done.err


@pytest.mark.parametrize("name", ["triglide", "scissors", "delta4", "hexapod7", "biglide"])
def test_null_directions_that_move_no_base_are_no_gauge(name: str) -> None:
    found = calibrated(MACHINES / f"{name}.yaml", MACHINES / f"{name}.csv")
    assert found["gauge"] == []


@pytest.mark.slow
def test_heights_of_a_bed_leave_rod_and_stops_weak_and_a_calliper_ends_it(tmp_path: Path) -> None:
    """Eleven heights to 0.01 mm: 0.46 mm for the rod; measured to 0.1 mm, 0.10 mm (so do independent least squares)."""
    machine, table = MACHINES / "delta-printer.yaml", MACHINES / "delta-printer.csv"
    seen = run("observability", machine, table, "--select", "all", "--json").json
    rod = next(p for p in seen["parameters"] if p["name"] == "rod")
    assert rod["std_of_data"] == pytest.approx(0.455, abs=0.01)
    (weak,) = seen["undetermined"]
    assert weak["kind"] == "weak" and {"rod", "stop1", "stop2", "stop3", "radius"} == set(weak["parameters"])
    (proposal,) = run("plan", machine, table, "--json").json["bench"]
    assert proposal["name"] == "rod" and proposal["sigma"] == pytest.approx(0.1)
    assert proposal["std"][0]["before"] == pytest.approx(0.455, abs=0.01)
    assert proposal["std"][0]["after"] == pytest.approx(0.098, abs=0.002)
    measured = overlaid(
        tmp_path,
        machine,
        "sensors: {calliper: {kind: bench, of: rod, reading: 288.1, sigma: 0.1 mm, sigma_is: exact}}\n",
    )
    after = {p["name"]: p for p in calibrated(measured, table)["parameters"]}
    assert after["rod"]["std"] == pytest.approx(0.098, abs=0.002)
