"""Tables that are of another machine, or that a whole column spoils: what is told asks for the one cause."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import MACHINES, SCISSORS, TRIGLIDE, TRIGLIDE_DATA, clean, run

QUESTION = "help: is this a table of this machine? It needs `q1 [mm]`, `q2 [mm]`, `q3 [mm]`"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("header", "asked"),
    [
        ("q1 [step],q2 [step],z", True),
        ("m1 [deg],m2 [deg],m3 [deg]", True),
        ("q1 [deg],q2 [deg],q3 [deg]", True),
        ("q1 [deg],q2 [deg],q3 [mm]", False),  # slips of the unit
        ("q1 [mm],q2 [mm],z", False),
        ("Q1 [mm],Q2 [mm],Q3 [mm]", False),  # what was meant is clear
    ],
)
def test_whether_a_table_is_of_this_machine_is_asked_last(header: str, asked: bool) -> None:
    Path("t.csv").write_text(f"{header},x [mm],y [mm]\n1,2,3,4,5\n")
    done = clean(run("check", TRIGLIDE, "t.csv", "-q"))
    assert done.code == 1 and done.err.count("is this a table of this machine?") == asked
    if asked:
        assert done.err.rstrip().splitlines()[-1] == f"{QUESTION}, and what was measured: `x [mm]`, `y [mm]`"


def test_one_cause_is_asked_for_where_most_rows_have_no_pose() -> None:
    """Nobody shall remove all rows; with parameters the drive that is the cause is named as without."""
    assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", "p.yaml", "-q", "--holdout", "none").code == 0
    Path("t.csv").write_text(Path(TRIGLIDE_DATA).read_text().replace("q1 [mm]", "q1 [m]"))
    for command in (("check", TRIGLIDE, "t.csv", "-p", "p.yaml"), ("calibrate", TRIGLIDE, "t.csv", "-o", "n.yaml")):
        done = clean(run(*command))
        assert done.code in (1, 3) and "`q1` looks 1000 times too large" in done.err
        assert "remove the row" not in done.err and done.err.count("look for one cause: sign, zero or unit") == 1


def test_a_single_row_without_a_pose_may_be_removed() -> None:
    table = Path(str(MACHINES / "scissors.csv")).read_text().splitlines()
    row = next(k for k, line in enumerate(table) if not line.startswith("#")) + 1
    cells = table[row].split(",")
    table[row] = ",".join(["far", "9999", "-9999", *cells[3:]])
    Path("t.csv").write_text("\n".join([*table, ""]))
    done = clean(run("check", SCISSORS, "t.csv", "-q"))
    assert done.code == 1 and done.err.count("or remove the row") == 1 and "one cause" not in done.err
