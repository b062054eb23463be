"""Instruments that stand anywhere (`frame: fitted`): readings in a turned, shifted frame tell the same machine."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pkmcal_cli.base.rotation import Array, best_rotation, exp
from pkmcal_cli.loading.load_machine import load_machine
from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, SCISSORS, run
from tests.pages import all_files

TURN, SHIFT = np.radians(137.0), np.array([2500.0, -1200.0, 700.0])  # mm


def rotation(axes: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """About z, and in space about x before."""
    c, s = np.cos(TURN), np.sin(TURN)
    about_z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) if axes == 3 else np.eye(3)
    return (about_z @ about_x)[:axes, :axes]


def moved(table: str, columns: tuple[str, ...], target: Path) -> Path:
    """The table as an instrument sees it that stands elsewhere; columns in mm."""
    rows = list(csv.reader(line for line in Path(table).read_text(encoding="utf-8").splitlines() if line[:1] != "#"))
    index = [next(k for k, h in enumerate(rows[0]) if h.split(" ")[0] == c) for c in columns]
    for row in rows[1:]:
        if all(row[k] for k in index):
            place = np.array([float(row[k]) for k in index])
            for k, value in zip(index, rotation(len(index)) @ place + SHIFT[: len(index)], strict=True):
                row[k] = f"{value:.9f}"
    with target.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
    return target


def overlay(folder: Path, base: str, sensor: str) -> Path:
    file = folder / "fitted.yaml"
    file.write_text(f"extends: {base}\nsensors: {{{sensor}: {{frame: fitted}}}}\n", encoding="utf-8")
    return file


def calibrated(*arguments: str | Path) -> dict[str, Any]:
    done = run("calibrate", *arguments, "--json", "-q", "--holdout", "none")
    assert done.code in (0, 1), done.err
    return dict(done.json)


def by_name(result: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {p["name"]: p for p in result["parameters"]}


def test_points_of_a_plane_are_turned_not_mirrored() -> None:
    """The third axis of flat points may come out either way; a mirror image is no pose."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        axis = rng.normal(size=(1, 3))
        (turn,) = exp(axis)
        here = np.column_stack([rng.normal(size=(8, 2)), np.zeros(8)])
        found = best_rotation(here, here @ turn.T + 1e-6 * rng.normal(size=(8, 3)))
        assert found == pytest.approx(turn, abs=1e-4)


def test_a_grid_plate_that_stands_anywhere(tmp_path: Path) -> None:
    """2.5 m away and turned by 137 deg: pose and dimensions agree with the known frame's within four uncertainties."""
    table = moved(str(MACHINES / "scissors.csv"), ("x", "y"), tmp_path / "turned.csv")
    machine = overlay(tmp_path, SCISSORS, "grid")
    fitted, known = calibrated(machine, table), calibrated(SCISSORS, MACHINES / "scissors.csv")
    assert fitted["status"] == "converged" and fitted["chi2_per_dof"] < 1.05 * known["chi2_per_dof"]
    found, true = by_name(fitted), by_name(known)
    for name, value in (("tx", SHIFT[0]), ("ty", SHIFT[1]), ("rz", np.degrees(TURN))):
        p = found[f"frame@grid.{name}"]
        assert p["value"] == pytest.approx(value, abs=4 * p["std_by_data"]) and p["std_by_data"] < 0.05, name
    for name, p in true.items():
        if p["std"] is not None:
            spread = 4 * np.hypot(found[name]["std"], p["std"])
            assert found[name]["value"] == pytest.approx(p["value"], abs=spread), name


@pytest.mark.slow
def test_a_camera_that_stands_anywhere(tmp_path: Path) -> None:
    """Real data in a turned frame: nothing says how the base is turned; refused, with the way out; then as before."""
    table = moved(HANGPRINTER_DATA, ("x_mm", "y_mm", "z_mm"), tmp_path / "turned.csv")
    machine = overlay(tmp_path, HANGPRINTER, "camera")
    refused = run("calibrate", machine, table)
    assert refused.code == 3 and "rotation about x, rotation about y, rotation about z" in refused.err
    datum = refused.err[refused.err.index("`datum: [") :].split("`")[1]
    assert len(datum.split(",")) == 3
    machine.write_text(machine.read_text(encoding="utf-8") + datum + "\n", encoding="utf-8")
    fitted, known = calibrated(machine, table), calibrated(HANGPRINTER, HANGPRINTER_DATA)
    assert fitted["status"] == known["status"] == "converged"  # the radii, which are held, explain what is left
    assert fitted["after"]["length"]["rms"] < 1.02 * known["after"]["length"]["rms"]
    assert not any(u["kind"] == "null" for u in fitted["undetermined"])


def test_the_parameter_file_holds_the_pose(tmp_path: Path) -> None:
    """Simulated with it, the machine reads in the instrument's frame."""
    table = moved(str(MACHINES / "scissors.csv"), ("x", "y"), tmp_path / "turned.csv")
    machine, params = overlay(tmp_path, SCISSORS, "grid"), tmp_path / "p.yaml"
    first = by_name(calibrated(machine, table, "-o", params))
    done = run("simulate", machine, table, "-p", params, "-q")
    read = [line.split(",") for line in done.out.splitlines() if line and line[0] not in "#i"]
    measured = [line.split(",") for line in table.read_text(encoding="utf-8").splitlines()[1:]]
    x = [
        next(k for k, h in enumerate(line.split(",")) if h.split(" ")[0] == "x")
        for line in (
            next(line for line in done.out.splitlines() if line.startswith("id")),
            table.read_text().splitlines()[0],
        )
    ]
    error = np.array([float(r[x[0]]) - float(m[x[1]]) for r, m in zip(read, measured, strict=True)])
    assert np.sqrt((error**2).mean()) < 2e-3, "mm"
    again = run("calibrate", machine, table, "-p", params, "--json", "-q", "--holdout", "none")
    for name, value in by_name(again.json).items():
        spread = first[name]["std"] or 0.0
        assert value["value"] == pytest.approx(first[name]["value"], abs=0.01 * spread + 1e-9), name


def test_an_instrument_that_stands_anywhere_reads_large_numbers(tmp_path: Path) -> None:
    """A kilometre away is no slip of the pen there; in the machine's frame it is, and the place is told."""
    turned = moved(str(MACHINES / "scissors.csv"), ("x", "y"), tmp_path / "t.csv")
    rows = list(csv.reader(turned.read_text(encoding="utf-8").splitlines()))
    k = next(k for k, h in enumerate(rows[0]) if h.split(" ")[0] == "x")
    for row in rows[1:]:
        row[k] = f"{float(row[k]) + 1e6:.9f}"
    table = tmp_path / "far.csv"
    with table.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
    far = calibrated(overlay(tmp_path, SCISSORS, "grid"), table)
    assert far["status"] == "converged" and far["after"]["position"]["rms"] < 1.5e-3
    wrong = run("calibrate", SCISSORS, table)
    assert wrong.code == 3 and "far outside the machine" in wrong.err and "far.csv:2" in wrong.err


@pytest.mark.parametrize(("cell", "code"), [("9.91E+37", 3), pytest.param("1e6", 0, marks=pytest.mark.slow)])
def test_what_an_instrument_writes_where_it_read_nothing_is_no_coordinate(tmp_path: Path, cell: str, code: int) -> None:
    """Beside such a number all others vanish in rounding; a kilometre off is a bad row."""
    turned = moved(str(MACHINES / "scissors.csv"), ("x", "y"), tmp_path / "t.csv")
    rows = list(csv.reader(turned.read_text(encoding="utf-8").splitlines()))
    k = next(k for k, h in enumerate(rows[0]) if h.split(" ")[0] == "x")
    rows[5][k] = cell
    table = tmp_path / f"{cell}.csv"
    table.write_text("\n".join(",".join(row) for row in rows), encoding="utf-8")
    done = run("calibrate", overlay(tmp_path, SCISSORS, "grid"), table, "--holdout", "none", "--loss", "tukey")
    assert done.code == code, done.err
    assert (f"{cell}.csv:6: error[row]: row `5`: the reading of `x` is far outside" in done.err) == (code == 3)


@pytest.mark.slow
def test_a_level_that_stands_anywhere_has_a_turn_and_no_place(tmp_path: Path) -> None:
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    level = "{at: platform, reads: [rx, ry], frame: fitted, sigma: 1 urad}"
    machine.write_text(
        f"extends: {MACHINES / 'hexapod7.yaml'}\nsensors: {{tracker: {{frame: machine}}, level: {level}}}\n",
        encoding="utf-8",
    )
    assert run("simulate", machine, MACHINES / "hexapod7.csv", "--noise", "declared", "-o", table).code == 0
    found = run("calibrate", machine, table, "--holdout", "none", "--json").json["parameters"]
    assert {p["name"] for p in found if p["name"][:5] == "frame"} == {f"frame@level.r{c}" for c in "xyz"}
    assert all(p["std"] is not None for p in found)


def test_other_nominal_values_are_another_reference() -> None:
    """A length that is 10 mm larger by other nominal values is so by the file too."""
    model = load_machine(SCISSORS).model
    before, values = model.reference_coefficients, model.nominal
    values[model.names.index("l3")] += 0.01
    after = model.with_nominal(values).reference_coefficients
    changed = np.abs(after - before)[0]
    assert changed.max() == pytest.approx(0.01, rel=1e-9) and (changed > 0).sum() == 1
    assert model.with_ranges(2 * model.ranges).reference_coefficients is before


def _simulated(machine: Path | str, more: str = "") -> Array:
    """Positions (n, 3), mm, that are read of delta4."""
    poses = ("--grid", "x=-100:100:2,y=-80:90:2,z=-480:-420:2", "-q")
    done = run("simulate", machine, *poses, *(("-p", more) if more else ()))
    assert done.code == 0, done.err
    rows = csv.DictReader(line for line in done.out.splitlines() if line[:1] != "#")
    return np.array([[float(row[f"{c} [mm]"]) for c in "xyz"] for row in rows])


def test_a_frame_is_the_pose_of_the_base_in_the_axes_of_the_instrument(tmp_path: Path) -> None:
    """reading = R p + t, with Rodrigues' formula written anew; not the pose of the instrument in the base."""
    aligned, tracked, file = tmp_path / "aligned.yaml", tmp_path / "tracked.yaml", tmp_path / "planted.yaml"
    for machine, frame in ((aligned, "machine"), (tracked, "fitted")):
        sensor = f"sensors: {{tracker: {{reads: [x, y, z], sigma: 8 um, frame: {frame}}}}}\n"
        machine.write_text(f"extends: {MACHINES / 'delta4.yaml'}\n{sensor}", encoding="utf-8")
    t, v = np.array([700.0, -1900.0, 350.0]), np.radians([20.0, -35.0, 110.0])
    numbers = {f"t{c}": f"{x} mm" for c, x in zip("xyz", t, strict=True)}
    numbers |= {f"r{c}": f"{np.degrees(x)} deg" for c, x in zip("xyz", v, strict=True)}
    entries = ", ".join(f'"frame@tracker.{n}": {text}' for n, text in numbers.items())
    file.write_text(f"parameters: {{{entries}}}\n", encoding="utf-8")
    angle = float(np.linalg.norm(v))
    x, y, z = v / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k
    places = _simulated(aligned)
    assert _simulated(tracked, str(file)) == pytest.approx(places @ turn.T + t, abs=1e-6)


def test_the_example_of_the_page_stands_where_the_page_says() -> None:
    """3 m along x and -0.5 m along y of the base, its x axis along y of the base: -R^T t, and the first row of R."""
    entries = yaml.safe_load(all_files()["standing.yaml"])["parameters"]
    t = 1e3 * np.array([float(entries[f"frame@tracker.{n}"].split()[0]) for n in ("tx", "ty")])
    angle = np.radians(float(entries["frame@tracker.rz"].split()[0]))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert -turn.T @ t == pytest.approx([3000.0, -500.0]) and turn[0] == pytest.approx([0.0, 1.0])
    assert turn @ [100.0, 0.0] + t == pytest.approx([500.0, 2900.0])
