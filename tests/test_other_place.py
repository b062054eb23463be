"""Tables of an instrument that stands elsewhere than the machine file says: one shift or turn is told, not a fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.gross_errors.displaced import OtherPlace
from pkmcal_cli.gross_errors.hints import sample_at, suspicions
from pkmcal_cli.gross_errors.other_place import _Seen
from pkmcal_cli.gross_errors.plausibility import Hint
from pkmcal_cli.gross_errors.put_right import put_right
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.tables.measurement_set import Measurements
from tests.command import MACHINES, run

TOLD = "the readings of `tracker` look taken from another place, "


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def table(machine: str, change: Callable[[dict[str, float]], None], rows: slice = slice(None)) -> str:
    """A shipped table with changed readings, by name, in the units of the file."""
    lines = [line for line in (MACHINES / f"{machine}.csv").read_text().splitlines() if not line.startswith("#")]
    names = [cell.split(" ")[0] for cell in lines[0].split(",")]
    out = [lines[0]]
    for line in lines[1:][rows]:
        cells = line.split(",")
        read = {n: float(c) for n, c in zip(names, cells, strict=True) if n != "id"}
        change(read)
        out.append(",".join(cells[0] if n == "id" else f"{read[n]:.9f}" for n in names))
    Path("t.csv").write_text("\n".join([*out, ""]))
    return "t.csv"


def shifted(read: dict[str, float]) -> None:
    """By 30 mm in x."""
    read["x"] += 30.0


def suspected(machine: str, file: str) -> tuple[tuple[Hint, ...], Measurements]:
    """Hints of a table, and the table."""
    loaded = load_machine(str(MACHINES / f"{machine}.yaml"))
    measured = load_measurements(loaded, [file])
    problem = problem_of(loaded.model, measured)
    return suspicions(loaded, problem, problem.model.nominal, measured), measured


@pytest.mark.parametrize("machine", ["triglide", "delta4"])
def test_a_shift_is_told_and_nothing_else_is_found(machine: str) -> None:
    """Of the delta, whose table moves its points by 0.3 mm on average, the shift is found beside its parameters."""
    file, path = table(machine, shifted), MACHINES / f"{machine}.yaml"
    done = run("diagnose", path, file, "--json")
    assert done.code == 1 and f"{TOLD}shifted by `x` 30 mm: residual rms" in done.err
    assert done.json["verdict"] == "measurement_fault" and done.json["effects"] == [] == done.json["unexplained"]
    assert run("check", path, file).code == 1
    if machine == "triglide":
        done = run("improve", path, file, "-o", "m.yaml", "--json")
        assert done.code == 1 and done.json["diagnosis"] == "measurement_fault"
        assert f"the measurement is at fault: {TOLD}shifted by `x` 30 mm" in done.err


def test_who_follows_the_advice_gets_the_place_of_the_instrument() -> None:
    """Turned by 2 deg about the origin, then 5 mm in x: within three standard deviations."""
    turn = Rotation.from_euler("z", 2, degrees=True)

    def moved(read: dict[str, float]) -> None:
        x, y, _ = turn.apply([read["x"], read["y"], 0.0])
        read["x"], read["y"] = x + 5.0, y

    file, machine = table("triglide", moved), MACHINES / "triglide.yaml"
    done = run("calibrate", machine, file, "-o", "n.yaml")
    assert done.code == 1 and "NOT FITTED" in done.err and f"{TOLD}turned by 2 deg and shifted by `x` " in done.err
    Path("m.yaml").write_text(f"extends: {machine}\nsensors: {{tracker: {{frame: fitted}}}}\n")
    done = run("calibrate", "m.yaml", file, "-o", "p.yaml", "--json")
    frame = {e["name"]: e for e in done.json["parameters"]}
    for name, value in (("frame@tracker.tx", 5.0), ("frame@tracker.ty", 0.0), ("frame@tracker.rz", 2.0)):
        assert abs(frame[name]["value"] - value) < 3 * frame[name]["std"]


def test_poses_of_a_turned_instrument_are_turned_back() -> None:
    """Positions and orientations of the hexapod, turned by 3.2 deg: put right, they are those of the shipped table but
    for what its parameters' errors may turn and shift."""
    turn, shift = Rotation.from_rotvec(np.radians([0.5, -1.0, 3.0])), np.array([4.0, -20.0, 7.0])
    names = ("x", "y", "z"), ("rx", "ry", "rz")

    def moved(read: dict[str, float]) -> None:
        place, pose = ([read[n] for n in each] for each in names)
        read.update(zip(names[0], turn.apply(place) + shift, strict=True))
        read.update(zip(names[1], (turn * Rotation.from_rotvec(pose)).as_rotvec(), strict=True))

    hints, measured = suspected("hexapod7", table("hexapod7", moved))
    (hint,) = hints
    place = hint.places[0]
    assert isinstance(place, OtherPlace)
    assert (Rotation.from_matrix(place.rotation) * turn).magnitude() < 1e-3
    right = put_right(measured, hints)
    assert right is not None
    unmoved = suspected("hexapod7", table("hexapod7", lambda read: None))[1].readings
    assert np.abs(right.readings - unmoved)[:, :3].max() < 0.2e-3
    assert np.abs(right.readings - unmoved)[:, 3:].max() < 1e-3


def test_a_tool_of_another_length_is_another_point_of_the_body() -> None:
    """30 mm along z of the platform, which tilts: put right, the readings are those of the shipped table."""
    def longer(read: dict[str, float]) -> None:
        away = Rotation.from_rotvec([read[n] for n in ("rx", "ry", "rz")]).apply([0.0, 0.0, 30.0])
        for name, value in zip("xyz", away, strict=True):
            read[name] += value

    hints, measured = suspected("hexapod7", table("hexapod7", longer))
    assert "at another point of the body, away by `z` 30" in hints[0].message
    right, unmoved = put_right(measured, hints), suspected("hexapod7", table("hexapod7", lambda read: None))[1]
    assert right is not None and np.abs(right.readings - unmoved.readings).max() < 0.2e-3
    done = run("diagnose", MACHINES / "hexapod7.yaml", table("hexapod7", longer), "--json", "-q")
    assert done.json["verdict"] == "measurement_fault" and done.json["effects"] == []


@pytest.mark.parametrize("size", [0.5, 1.3])
def test_small_shifts_may_be_of_parameters_whose_ranges_were_guessed(size: float) -> None:
    def moved(read: dict[str, float]) -> None:
        read["x"] += size

    assert suspected("triglide", table("triglide", moved))[0] == ()


def test_a_rod_of_another_length_is_no_other_place() -> None:
    """340 mm where 300 are declared: points move by different amounts."""
    Path("m.yaml").write_text(f"extends: {MACHINES / 'triglide-nonredundant.yaml'}\nparameters: {{l1: 340}}\n")
    done = run("check", "m.yaml", MACHINES / "triglide-nonredundant.csv")
    assert "another place" not in done.err


@pytest.mark.parametrize(("size", "told"), [(40.0, True), (14.0, False)])
def test_a_shift_beside_a_rod_that_is_off_is_told_where_it_is_nearly_all(size: float, told: bool) -> None:
    """The rod is 1 mm longer, ten ranges, which moves points by some 0.7 mm; of 14 mm some may be of parameters too."""
    Path("m.yaml").write_text(f"extends: {MACHINES / 'triglide-nonredundant.yaml'}\nparameters: {{l1: 299}}\n")

    def moved(read: dict[str, float]) -> None:
        read["x"] += size

    done = run("check", "m.yaml", table("triglide-nonredundant", moved))
    assert (TOLD in done.err) == told


def test_a_place_nearby_is_moved_to_the_right_one() -> None:
    """From one that is turned by 0.01 rad and 2 mm away, as the stated parameters turn and shift points too."""
    loaded = load_machine(str(MACHINES / "hexapod7.yaml"))
    measured = load_measurements(loaded, [table("hexapod7", lambda read: None)])
    problem = problem_of(loaded.model, measured)
    sample = sample_at(loaded, problem, problem.model.nominal)
    seen = _Seen(sample, "tracker", *sample.standing["tracker"])
    wrong = replace(seen._place(), rotation=Rotation.from_rotvec([0.006, -0.008, 0.0]).as_matrix())
    right = seen._refined(replace(wrong, shift=np.array([2e-3, 0.0, 0.0])), True)
    assert Rotation.from_matrix(right.rotation).magnitude() < 1e-3
    assert np.abs(right.put_back(measured.readings, seen.names) - measured.readings)[:, :3].max() < 0.3e-3


def test_a_session_in_which_the_instrument_was_moved_is_named() -> None:
    lines = Path(table("triglide", lambda read: None)).read_text().splitlines()
    late = Path(table("triglide", shifted)).read_text().splitlines()
    rows = [f"a,{line}" for line in lines[1:120]] + [f"b,{line}" for line in late[120:]]
    Path("s.csv").write_text("\n".join([f"session,{lines[0]}", *rows, ""]))
    hints, measured = suspected("triglide", "s.csv")
    assert put_right(measured, hints) is None, "which would move the other session too"
    done = run("check", MACHINES / "triglide.yaml", "s.csv")
    assert done.code == 1 and f"in session `b` {TOLD}shifted by `x` 30 mm" in done.err


def test_of_one_coordinate_a_shift_is_told_too() -> None:
    lines = [line.split(",") for line in Path(table("triglide", shifted)).read_text().splitlines()]
    Path("x.csv").write_text("\n".join([*(",".join(cells[:5]) for cells in lines), ""]))
    assert f"{TOLD}shifted by `x` 30 mm" in run("check", MACHINES / "triglide.yaml", "x.csv").err


def test_orientations_that_hardly_vary_do_not_hide_a_shift() -> None:
    """Of a platform that only translates: its rods are off, so its orientation differs by many times its spread."""
    (Path("turns.yaml")).write_text(
        f"extends: {MACHINES / 'delta4.yaml'}\nsensors: {{tracker: {{reads: [x, y, z, rx, ry, rz], "
        "sigma: {position: 10 um, orientation: 20 urad}}}\n"
    )
    Path("true.yaml").write_text("parameters: {l1a: 500.08, l2b: 499.93, l3a: 500.06, l4b: 500.05}\n")
    done = run("simulate", "turns.yaml", "--grid", "40", "-p", "true.yaml", "--noise", "declared")
    head, *rows = (line for line in done.out.splitlines() if not line.startswith("#"))
    column = next(k for k, name in enumerate(head.split(",")) if name.startswith("x "))
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[column] = str(float(row[column]) + 30.0)
    Path("t.csv").write_text("\n".join([head, *(",".join(row) for row in cells), ""]))
    done = run("check", "turns.yaml", "t.csv")
    assert done.code == 1 and f"{TOLD}shifted by `x` 30 mm: residual rms" in done.err
