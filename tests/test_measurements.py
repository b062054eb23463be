"""Measurements: tables bound to a machine's columns, everything in SI, all faults at once."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.csv_files import reader as csv_table
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurements import (
    Measurements,
    MeasurementStream,
    columns_of,
    concatenate,
    read_measurements,
)  # fmt: skip
from tests.csv_tables import write_table

BAD = Path(__file__).parent / "bad"
MACHINES = Path(__file__).parents[1] / "machines"
TRIGLIDE = Path(__file__).parent / "data" / "triglide.yaml"

# a point on three ropes in the plane: A, B place it, C is force-controlled; a tracker and a probe
SPOOLS = """
units: {length: mm, angle: deg, force: kN}
space: planar
parameters: {r: {nominal: 75, range: 1}}
ground: {A: [-1000, 0], B: [1000, 0], C: [0, 2000]}
nodes: {tcp: [0, 300]}
ropes: {"line{i}": {each: {i: [A, B, C]}, between: ["{i}", tcp], EA: 20 kN}}
actuators:
  "{i}": {each: {i: [A, B]}, winds: "line{i}", radius: r, zero: home, column: "motor_{i}", sigma: 1 mm}
  C: {winds: lineC, radius: r, zero: home, redundant: true, control: force, sigma: 1 mm, FORCE}
sensors:
  tracker: {at: tcp, reads: {x: X_mm, y: Y_mm}, sigma: 0.1 mm, frame: machine}
  PROBE
"""
PROBE = "probe: {at: tcp, reads: [y], sigma: 1 um, frame: machine}"


@pytest.fixture
def triglide() -> Machine:
    return read_machine(TRIGLIDE)


@pytest.fixture
def spools(tmp_path: Path) -> Callable[..., Machine]:
    def make(force: str = "force: {column: F, otherwise: 20 N, scale: 0.001}", probe: str = PROBE) -> Machine:
        path = tmp_path / "spools.yaml"
        path.write_text(SPOOLS.replace("FORCE", force).replace("PROBE", probe))
        return read_machine(path)

    return make


@pytest.fixture
def read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Measurements]:
    monkeypatch.chdir(tmp_path)

    def reader(machine: Machine, *contents: str, require: str = "measured") -> Measurements:
        names = [f"s{i}.csv" for i in range(1, 1 + len(contents))]
        for name, content in zip(names, contents, strict=True):
            (tmp_path / name).write_text(content)
        return read_measurements(names, machine, require)  # type: ignore[arg-type]

    return reader


@pytest.mark.parametrize("path", sorted(BAD.glob("table-*.csv")), ids=lambda p: p.stem)
def test_bad_tables(path: Path, triglide: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(BAD)
    with pytest.raises(BadInput) as caught:
        read_measurements([path.name], triglide)
    assert caught.value.text() + "\n" == path.with_suffix(".expected").read_text()
    assert caught.value.exit_code == 3


def test_everything_in_si(triglide: Machine, read: Callable[..., Measurements]) -> None:
    found = read(
        triglide,
        "id,q1,q2 [m],q3,x,y [um],sigma.x,sigma.q2,T,T.base [K],time [min],dir.q1,payload [g],q1.force,n\n"
        "p1,100,0.6,950,360,275000,0.01,0.02,20,300,1,-1,500,12,0\n"
        "p2,101,0.6,950,361,,,,21,,2,0,,,1\n",
    )
    nan = np.nan
    assert len(found) == 2
    assert found.actuator_names == ("q1", "q2", "q3")
    np.testing.assert_allclose(found.actuators, [[0.1, 0.6, 0.95], [0.101, 0.6, 0.95]], rtol=1e-15)
    np.testing.assert_allclose(found.forces, [[12, nan, nan], [nan] * 3])
    assert found.channels == ("x", "y")
    np.testing.assert_allclose(found.readings, [[0.36, 0.275], [0.361, nan]], rtol=1e-15)
    np.testing.assert_allclose(found.sigma, [[1e-5, nan], [nan, nan]])
    np.testing.assert_allclose(found.actuator_sigma, [[nan, 2e-5, nan], [nan] * 3])
    expected = {
        "T": [293.15, 294.15], "T.base": [300, nan], "time": [60, 120], "dir.q1": [-1, 0],
        "payload": [0.5, nan],
    }  # fmt: skip
    for name, values in expected.items():
        np.testing.assert_allclose(found.covariates[name], values, err_msg=name)
    assert found.labels == {"id": ("p1", "p2")}
    assert (found.sessions, found.files, found.ids) == (("s1",), ("s1.csv",), ("p1", "p2"))
    assert found.line.tolist() == [2, 3]
    assert found.row_origin(1) == "s1.csv:3 (p2)"
    assert found.has_actuators and found.measured.any()
    assert found.notes == (
        "s1.csv: columns not used: `n`",
        "s1.csv: no units in the header; the units of the machine file are used: mm (q1, q3, x, sigma.x, sigma.q2), "
        "degC (T), N (q1.force)",
        "s1.csv: `y` not measured in 1 of 2 rows",
    )


def test_foreign_columns_forces_and_two_sensors(
    spools: Callable[..., Machine], read: Callable[..., Measurements]
) -> None:
    text = "motor_A;motor_B [rad];C;X_mm;Y_mm;probe.y;F\n90;1,5;;1;2;3;7\n180;1,5;-90;1;;;\n"
    found = read(spools(), text)
    np.testing.assert_allclose(found.actuators, [[np.pi / 2, 1.5, np.nan], [np.pi, 1.5, -np.pi / 2]], rtol=1e-15)
    assert found.channels == ("tracker.x", "tracker.y", "probe.y", "C")
    np.testing.assert_allclose(found.readings, [[1e-3, 2e-3, 3e-3, np.nan], [1e-3, np.nan, np.nan, -np.pi / 2]])
    np.testing.assert_allclose(found.forces[:, 2], [7, np.nan])
    assert np.isnan(found.forces[:, :2]).all()
    assert np.isnan(found.targets).all()  # two sensors: neither is the target
    assert "s1.csv: no force of C in 1 of 2 rows: the force of the machine file is used, 0.02 kN" in found.notes


def test_a_force_without_a_constant_is_needed(
    spools: Callable[..., Machine], read: Callable[..., Measurements]
) -> None:
    machine = spools("force: {column: F}")
    with pytest.raises(BadInput) as caught:
        read(machine, "motor_A,motor_B,X_mm,f\n1,2,3,4\n", "motor_A,motor_B,X_mm,F\n1,2,3,\n")
    text = caught.value.text()
    assert "s1.csv:1: error[csv-missing]: missing column `F` (force of actuator C)\nhelp: did you mean `f`?" in text
    assert "s2.csv:2:7: error[csv-empty-cell]: empty cell in column `F`" in text


def test_poses_by_coordinates(triglide: Machine, read: Callable[..., Measurements]) -> None:
    found = read(triglide, "x,y,rz\n1,2,90\n3,4,0\n", require="poses")
    assert not found.has_actuators
    assert found.coordinates == ("x", "y", "rz")
    np.testing.assert_allclose(found.targets, [[1e-3, 2e-3, np.pi / 2], [3e-3, 4e-3, 0]])
    both = read(triglide, "x,y,q1,q2,q3\n1,2,3,4,5\n", require="poses")
    assert both.has_actuators and np.isfinite(both.targets).any()
    assert "s1.csv: the actuator columns give the poses; the TCP coordinates are not used" in both.notes
    assert not read(triglide, "x,y,q1,q2,q3\n1,2,,,\n", require="poses").has_actuators


def test_poses_by_coordinates_beside_a_foreign_sensor(
    spools: Callable[..., Machine], read: Callable[..., Measurements]
) -> None:
    one = spools(probe="")
    np.testing.assert_allclose(read(one, "X_mm,y\n1,2\n", require="poses").targets[0, :2], [1e-3, 2e-3])
    np.testing.assert_allclose(read(spools(), "x,y\n1,2\n", require="poses").targets[0, :2], [1e-3, 2e-3])


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("a,b\n1,2\n", "the table has no poses: neither actuators (`q1`, `q2`, `q3`) nor TCP coordinates"),
        ("x,y,q1\n1,2,3\n", "missing column `q2` (actuator q2)"),
        ("x,y\n1,2\n3,\n", "s1.csv:3:3: error[csv-empty-cell]: empty cell in column `y`"),
        ("q1,q2,q3\n1,2,3\n4,,6\n", "s1.csv:3:3: error[csv-empty-cell]: empty cell in column `q2`"),
        ("x,q1\n1,\n" + "2,\n" * 40_000 + "3,4\n", "s1.csv:40003:3: error[csv-value]: `4` in column `q1`"),
    ],
)
def test_poses_that_are_none(triglide: Machine, read: Callable[..., Measurements], content: str, expected: str) -> None:
    with pytest.raises(BadInput) as caught:
        read(triglide, content, require="poses")
    assert expected in caught.value.text()


def test_actuators_only(triglide: Machine, read: Callable[..., Measurements]) -> None:
    found = read(triglide, "q1,q2,q3\n1,2,3\n", require="actuators")
    assert found.has_actuators and not found.measured.any()
    with pytest.raises(BadInput, match="no measurements"):
        read(triglide, "q1,q2,q3\n1,2,3\n")


def test_rows_with_nothing_measured_are_counted(triglide: Machine, read: Callable[..., Measurements]) -> None:
    found = read(triglide, "q1,q2,q3,x\n1,2,3,4\n1,2,3,\n1,2,3,5\n")
    assert len(found) == 3
    assert "s1.csv: no columns for channels: `y`" in found.notes
    assert "s1.csv: no measurements in 1 of 3 rows" in found.notes


ROW = "q1,q2,q3,x,y\n1,2,3,4,5\n"


def test_files_are_sessions(triglide: Machine, read: Callable[..., Measurements]) -> None:
    found = read(triglide, ROW, "q1,q2,q3,x,y,session,T\n1,2,3,4,5,s1,20\n1,2,3,4,5,night,21\n")
    assert found.sessions == ("s1", "night")
    assert found.session.tolist() == [0, 0, 1]
    assert found.file_index.tolist() == [0, 1, 1]
    assert found.files == ("s1.csv", "s2.csv")
    assert found.labels["session"] == ("", "s1", "night")
    np.testing.assert_allclose(found.covariates["T"], [np.nan, 293.15, 294.15])


def test_files_of_one_name(triglide: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("a", "b"):
        Path(folder).mkdir()
        Path(folder, "m.csv").write_text(ROW)
    found = read_measurements(["a/m.csv", "b/m.csv"], triglide)
    assert found.sessions == ("a/m", "b/m")
    with pytest.raises(BadInput, match="this file is given twice"):
        read_measurements(["a/m.csv", "./a/m.csv"], triglide)


def test_faults_of_all_files_at_once(triglide: Machine, read: Callable[..., Measurements]) -> None:
    with pytest.raises(BadInput) as caught:
        read(triglide, "q1,q2,q3,x\n1,2,3,NA\n" * 1, ROW, "q1,q2,x\n1,,3\n")
    places = [str(fault.where) for fault in caught.value.faults]
    assert places == ["s1.csv:2:7", "s3.csv:1", "s3.csv:2:3"]


def test_stdin(triglide: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(ROW.encode())))
    assert read_measurements(["-"], triglide).sessions == ("stdin",)


def test_times(triglide: Machine, read: Callable[..., Measurements]) -> None:
    head = "q1,q2,q3,x,time\n"
    found = read(
        triglide,
        head + "1,2,3,4,2021-12-16T10:00:00\n1,2,3,4,\n1,2,3,4,2021-12-16 10:00:01.5\n",
        head + "1,2,3,4,2021-12-17\n",
    )
    np.testing.assert_allclose(found.covariates["time"], [0, np.nan, 1.5, 14 * 3600])
    assert found.notes[-1] == "`time` is counted from 2021-12-16T10:00:00, the first row of s1.csv"
    zoned = read(triglide, head + "1,2,3,4,2021-12-16T10:00:00Z\n1,2,3,4,2021-12-16T10:00:00-01:00\n")
    assert zoned.covariates["time"].tolist() == [0, 3600]
    with pytest.raises(BadInput, match="dates in one file and numbers in another"):
        read(triglide, head + "1,2,3,4,5\n", head + "1,2,3,4,2021-12-16T10:00:00\n")
    with pytest.raises(BadInput, match="lacks the offset from UTC"):
        read(triglide, head + "1,2,3,4,2021-12-16T10:00:00Z\n1,2,3,4,2021-12-16T10:00:01\n")


def test_take_and_concatenate(triglide: Machine, read: Callable[..., Measurements]) -> None:
    found = read(triglide, "id,q1,q2,q3,x,y\n" + "".join(f"p{i},{i},2,3,4,5\n" for i in range(6)), ROW)
    some = found.take([4, 0, 6])
    assert some.ids == ("p4", "p0", "")
    np.testing.assert_allclose(some.actuators[:, 0], [0.004, 0, 0.001])
    assert some.row_origin(0) == "s1.csv:6 (p4)"
    assert some.session.tolist() == [0, 0, 1]
    assert len(found.take(found.session == 1)) == 1
    assert len(found.take([])) == 0
    whole = concatenate([found.take(slice(0, 3)), found.take(slice(3, None))])
    for name in ("actuators", "readings", "forces", "session", "file_index", "line"):
        assert np.array_equal(getattr(whole, name), getattr(found, name), equal_nan=True), name
    assert (whole.ids, whole.sessions, whole.files) == (found.ids, found.sessions, found.files)


@pytest.mark.parametrize("path", sorted(MACHINES.glob("*.csv")), ids=lambda p: p.stem)
def test_shipped_files_are_read(path: Path) -> None:
    machine = max((m for m in MACHINES.glob("*.yaml") if path.stem.startswith(m.stem)), key=lambda m: len(m.stem))
    found = read_measurements([path], read_machine(machine))
    assert found.has_actuators and found.measured.any()
    assert not np.isnan(found.actuators).any()


def test_blocks_and_the_whole_are_the_same(triglide: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "big.csv"
    names = {c.name: c for c in columns_of(triglide)}
    values = {name: rng.normal(size=5000) for name in ("q1", "q2", "q3", "x", "y")}
    values["y"][::7] = np.nan
    write_table(path, [(name, names[name].unit, v) for name, v in values.items()])
    plain = read_measurements([path], triglide)
    monkeypatch.setattr(csv_table, "_LARGE", 0)
    monkeypatch.setattr(csv_table, "_BLOCK", 10_000)
    stream = MeasurementStream([path], triglide)
    parts = list(stream)
    assert len(parts) > 20
    whole = concatenate(parts)
    assert np.array_equal(whole.line, np.arange(2, 5002))
    assert np.array_equal(whole.readings, plain.readings, equal_nan=True)
    assert np.array_equal(whole.actuators, plain.actuators)
    np.testing.assert_allclose(whole.readings, np.column_stack([values["x"], values["y"]]), rtol=1e-15)
    assert stream.notes == plain.notes


def test_labels_that_are_hardly_meant_are_told(tmp_path: Path, triglide: Machine) -> None:
    file, row = tmp_path / "t.csv", "-294,294,600,0,160"
    file.write_text("\n".join(["session,id,q1 [mm],q2 [mm],q3 [mm],x,y", *(f"{s},1,{row}" for s in ("A", "B", "a"))]))
    notes = read_measurements([file], triglide).notes
    assert "all 3 rows have the same `id`, `1`" in notes
    assert "sessions `A` and `a` differ only in case or blanks; each is one of its own" in notes
