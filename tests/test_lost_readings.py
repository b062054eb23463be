"""Readings that a table has and a calibration would miss, or take for others: refused at their place, or warned of."""

from __future__ import annotations

import re
from pathlib import Path
from time import process_time

import pytest

from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, Done, run

TWO = f"""
extends: {MACHINES}/triglide.yaml
ground: {{ball: [0, 0]}}
sensors:
  laser: {{at: tcp, reads: [x, y], sigma: 2 um, frame: machine}}
  tracker: {{at: tcp, reads: [x, y], sigma: 10 um, frame: machine}}
  probe1: {{kind: distance, at: tcp, to: ball, sigma: 10 um}}
  rod: {{kind: bench, of: l1, reading: 300.02, sigma: 10 um}}
"""
"""Two sensors of coordinates, one of a distance, and one whose reading stands in the machine file."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    machine = MACHINES / "triglide.yaml"
    Path("two.yaml").write_text(TWO)
    done = run("simulate", machine, "--grid", "x=200:700:6,y=160:390:8", "--noise", "declared", "-o", "xy.csv")
    assert done.code == 0, done.err
    return tmp_path


def table(name: str, header: str, laser: bool = True) -> str:
    """A table of the drives, the laser's x and y (if `laser`), x, y and the distance under the names of `header`."""
    lines = [line for line in Path("xy.csv").read_text().splitlines() if not line.startswith("#")]
    rows = [line.split(",")[1:] for line in lines[1:]]
    drives = [",".join(row[:3]) for row in rows]
    points = [",".join(row[3:]) for row in rows]
    lengths = [f"{sum(float(c) ** 2 for c in row[3:]) ** 0.5:.6f}" for row in rows]
    columns = zip(drives, *([points] if laser else []), points, lengths, strict=True)
    named = ",".join(["q1,q2,q3", *(["laser.x,laser.y"] if laser else []), header])
    Path(name).write_text("\n".join([named, *(",".join(row) for row in columns)]) + "\n")
    return name


def check(*tables: str) -> Done:
    return run("check", "two.yaml", *tables)


def warnings_of(text: str) -> set[str]:
    """Codes of the warnings in a text, but for what is so of the machine whatever the table."""
    return set(re.findall(r"warning\[([\w-]+)", text)) - {"substructure"}


def refused(header: str, wrong: str, meant: str) -> None:
    """The table is refused at the one column that is wrong, and the right name is told."""
    name = table("t.csv", header)
    done = run("calibrate", "two.yaml", name, "-o", "out.yaml", "--holdout", "none")
    assert done.code == 3, done.err
    assert done.err.count("error[") == 1, done.err
    lines = done.err.splitlines()
    column = len("q1,q2,q3,laser.x,laser.y," + header.partition(wrong)[0]) + 1
    assert lines[0].startswith(f"t.csv:1:{column}: error[csv-missing]: column `{wrong}` is not used")
    assert lines[1][lines[2].index("^") :].startswith(wrong)
    assert f"help: did you mean `{meant}`?" in done.err
    assert not Path("out.yaml").exists()
    assert run("diagnose", "two.yaml", name).code == 3
    assert check(name).code == 1


def test_all_is_there() -> None:
    done = check(table("t.csv", "tracker.x,tracker.y,probe1"))
    assert (done.code, warnings_of(done.err)) == (0, set()), done.err
    assert "241 measured values" in done.err


@pytest.mark.parametrize("plain", ["x,y", "X [mm],Y [mm]", "x_mm,y_mm", "x (mm),y (mm)", "x mm,y mm"])
def test_columns_that_may_be_those_of_a_silent_sensor(plain: str) -> None:
    name = table("t.csv", f"{plain},probe1")
    done = run("calibrate", "two.yaml", name, "--holdout", "none")
    assert done.code == 3
    assert done.err.count("error[csv-missing]") == 2
    assert "t.csv:1:26: error[csv-missing]" in done.err
    assert "is not used and sensor `tracker` has no reading in this table" in done.err
    assert "did you mean `tracker.x" in done.err and "did you mean `tracker.y" in done.err
    assert run("diagnose", "two.yaml", name).code == check(name).code + 2 == 3


@pytest.mark.parametrize("plain", ["x,y,z", "X,Y,Z", "x [mm],y [mm],z [mm]"])
def test_columns_of_a_silent_sensor_that_has_headers_of_its_own(plain: str) -> None:
    """The reading of the force-controlled drive is there, the camera's are under other names."""
    Path("t.csv").write_text(Path(HANGPRINTER_DATA).read_text().replace("x_mm,y_mm,z_mm", plain))
    done = run("calibrate", HANGPRINTER, "t.csv", "--holdout", "none")
    assert done.code == 3
    assert done.err.count("error[csv-missing]") == 3
    assert "sensor `camera` has no reading" in done.err


def test_an_empty_column_of_the_right_name_is_no_reading() -> None:
    Path("t.csv").write_text("q1,q2,q3,laser.x,laser.y,tracker.x,x,probe1\n200,700,950,400,250,,400,1\n")
    done = check("t.csv")
    assert done.code == 1
    assert "column `x` is not used and sensor `tracker` has no reading" in done.err


NEAR = {
    "tracker.xx,tracker.y,probe1": ("tracker.xx", "tracker.x"),
    "traker.x,tracker.y,probe1": ("traker.x", "tracker.x"),
    "trakcer.x,tracker.y,probe1": ("trakcer.x", "tracker.x"),
    "tracker.x,tracker_y,probe1": ("tracker_y", "tracker.y"),
    "Tracker.X [um],tracker.y,probe1": ("Tracker.X [um]", "tracker.x [um]"),
    "tracker.x [mm,tracker.y,probe1": ("tracker.x [mm", "tracker.x [mm]"),
    "tracker.x [um,tracker.y,probe1": ("tracker.x [um", "tracker.x [um]"),
    "tracker.x mm],tracker.y,probe1": ("tracker.x mm]", "tracker.x [mm]"),
    "tracker.x (mm),tracker.y,probe1": ("tracker.x (mm)", "tracker.x [mm]"),
    "tracker.x [,tracker.y,probe1": ("tracker.x [", "tracker.x [mm]"),
    "tracker.x,tracker.y,Probe1": ("Probe1", "probe1"),
    "tracker.x,tracker.y,prob1": ("prob1", "probe1"),
    "tracker.x,tracker.y,probe_1": ("probe_1", "probe1"),
}


@pytest.mark.parametrize("header", NEAR)
def test_a_header_near_a_channel_that_the_table_lacks(header: str) -> None:
    refused(header, *NEAR[header])


@pytest.mark.parametrize("header", ["X", "yy", "y [mm", "y mm)", "Y [mm]"])
def test_a_near_header_of_a_machine_with_one_sensor(header: str) -> None:
    Path("t.csv").write_text(f"q1,q2,q3,{'y' if header == 'X' else 'x'},{header}\n200,700,950,400,250\n")
    done = run("check", MACHINES / "triglide.yaml", "t.csv")
    assert done.code == 1
    assert f"t.csv:1:12: error[csv-missing]: column `{header}` is not used and channel" in done.err


@pytest.mark.parametrize(
    "columns",
    [
        "x,,n",
        "x,y,x1",
        "x,y,X",
        "x,y,y_mm",
        "x,n",
        "x,t,T",
        "x,z",
        "y,rx",
        "x,y_ref",
        "x,y_ref (mm)",
        "y,x [mm]",
        "x,y [um],xx",
    ],
)
def test_unused_columns_that_are_something_else(columns: str) -> None:
    """The channel is there, or its name is too far off: another letter, another coordinate."""
    cells = ",".join(["250"] * (columns.count(",") + 1))
    Path("t.csv").write_text(f"q1,q2,q3,{columns}\n200,700,950,{cells}\n")
    done = run("check", MACHINES / "triglide.yaml", "t.csv")
    assert "csv-missing" not in done.err, done.err
    assert not warnings_of(done.err)


@pytest.mark.parametrize("other", ["probe2", "probe12", "trk.x", "laser.z", "tracker.z"])
def test_names_of_other_things_are_a_warning(other: str) -> None:
    """Numbered neighbours, other coordinates and other instruments are not taken for a misspelt name."""
    done = check(table("t.csv", f"a,b,{other}"))
    assert done.code == 0, done.err
    assert done.err.count("warning[no-reading]") == 2
    assert "two.yaml:6:3: warning[no-reading]: sensor `tracker` has no reading in any table" in done.err
    assert "sensor `probe1` has no reading" in done.err
    assert "`rod`" not in done.err
    assert f"`{other}`" in done.err


def test_the_warning_is_shown_by_every_command() -> None:
    name = table("t.csv", "a,b,probe1")
    words = "warning[no-reading]: sensor `tracker` has no reading in any table"
    for command in ("check", "calibrate", "diagnose"):
        assert words in run(command, "two.yaml", name).err, command
    assert run("check", "two.yaml", name, "--json").json["measurements"]["warnings"] == [words.partition(": ")[2]]


def test_sensors_of_several_sessions() -> None:
    """A sensor may have been used in one of them only; a column that may be its own is told all the same."""
    whole, laser = table("a.csv", "tracker.x,tracker.y,probe1"), table("b.csv", "a,b,c")
    assert not warnings_of(check(whole, laser).err)
    plain = check(whole, table("c.csv", "x,y,c"))
    assert plain.code == 0
    assert plain.err.count("c.csv:1:") == plain.err.count("warning[csv-missing]: column") == 2
    near = check(whole, table("d.csv", "tracker.xx,b,c"))
    assert near.code == 1
    assert "d.csv:1:26: error[csv-missing]: column `tracker.xx`" in near.err
    alone = check(laser, table("e.csv", "x,y,c"))
    assert alone.code == 1
    assert alone.err.count("error[csv-missing]") == 2


def test_columns_that_hold_nothing_are_not_missed() -> None:
    Path("t.csv").write_text("q1,q2,q3,laser.x,laser.y,x,y,probe1\n200,700,950,400,250,,,1\n")
    done = check("t.csv")
    assert "csv-missing" not in done.err
    assert "sensor `tracker` has no reading in any table" in done.err


@pytest.mark.parametrize("channel", ["x", "a"], ids=["measured", "nothing measured"])
def test_headers_of_many_blanks_are_read_at_once(channel: str) -> None:
    """Patterns that look for a unit after blanks must not begin anew at each of them: that took a minute."""
    Path("t.csv").write_text(f"q1,q2,q3,{channel},x{' ' * 60_000}] a\n200,700,950,400,1\n")
    start = process_time()
    run("check", MACHINES / "triglide.yaml", "t.csv")
    assert process_time() - start < 5


def test_coordinates_that_no_sensor_reads_are_said_to_be_unused() -> None:
    done = check(table("t.csv", "tracker.x,tracker.y,x"))
    assert "columns not used: `x`" in done.err


@pytest.mark.parametrize("ends", ["", ","], ids=["no separators at the ends", "separators at the ends of rows"])
@pytest.mark.parametrize("cell", range(8))
def test_a_cell_more_or_less_moves_no_numbers(cell: int, ends: str) -> None:
    """The last four columns of the file are empty: a cell too many anywhere leaves a row that looks complete."""
    header, *rows = Path(HANGPRINTER_DATA).read_text().splitlines()
    rows = [row + ends for row in rows]
    Path("t.csv").write_text("\n".join([header, *rows]))
    assert run("check", HANGPRINTER, "t.csv").code == 0
    cells = rows[7].split(",")
    for odd in ([*cells[:cell], "0", *cells[cell:]], [*cells[:cell], *cells[cell + 1 :]]):
        Path("t.csv").write_text("\n".join([header, *rows[:7], ",".join(odd), *rows[8:]]))
        done = run("calibrate", HANGPRINTER, "t.csv", "--holdout", "none")
        assert done.code == 3
        assert done.err.startswith(f"t.csv:9:1: error[csv-width]: the row has {len(odd)} cells")
        assert done.err.count("error[") == 1
