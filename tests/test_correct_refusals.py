"""`pkmcal correct`: what is wrong is said, with the exit code of its kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import HANGPRINTER, MACHINES, SCISSORS, TRIGLIDE, clean, run

BIGLIDE = str(MACHINES / "biglide.yaml")
GRID = "x=250:450:3,y=220:320:3"

BAD = {
    "another machine": (["-p", "p.yaml", TRIGLIDE], 3, "these values belong to another machine"),
    "out of reach": ([BIGLIDE, "far.csv"], 1, "far.csv:2 (f): out of reach"),
    "no target": ([BIGLIDE, "drives.csv"], 3, "the table has no targets: none of the TCP coordinates `x`, `y`, `rz`"),
    "too many": ([SCISSORS, "turned.csv"], 3, "no degree of freedom moves `rz` of tool point `platform`"),
    "freedoms": ([HANGPRINTER, "six.csv"], 3, "has no `rx`"),
    "empty": ([BIGLIDE, "empty.csv"], 3, "empty cell in column `y`"),
    "unfilled": ([BIGLIDE, "unfilled.csv"], 3, "the table has no targets: nothing stands in `x`, `y`"),
    "choice": ([BIGLIDE, "t.csv", "--redundant", "minforce"], 2, "did you mean `min-force`?"),
    "nothing": ([BIGLIDE], 2, "give either a table of targets or --grid"),
    "both": ([BIGLIDE, "t.csv", "--grid", GRID], 2, "give either a table of targets or --grid"),
    "json": ([BIGLIDE, "t.csv", "--json"], 2, "--json and the table both write to stdout"),
    "circumstance": ([BIGLIDE, "t.csv", "--at", "speed=3"], 2, "unknown circumstance `speed`"),
    "unit": ([BIGLIDE, "t.csv", "--at", "T=3 mm"], 2, "`mm` is a unit of length"),
    "side": ([BIGLIDE, "t.csv", "--at", "dir.q1=2"], 2, "`dir.q1` is 1 or -1"),
    "twice": ([BIGLIDE, "warm.csv", "--at", "T=20"], 2, "the table has a column `T`"),
    "no value": ([BIGLIDE, "t.csv", "--at", "T"], 2, "`T` is not a circumstance"),
    "grid": ([BIGLIDE, "--grid", "x=0:1:2,y=5000:6000:2"], 3, "none of 4 grid points can be used"),
    "input": ([BIGLIDE, "t.csv", "-o", "t.csv", "--force"], 4, "t.csv"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_said(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    data = str(MACHINES / "biglide.csv")
    assert run("calibrate", BIGLIDE, data, "-q", "--holdout", "none", "-o", "p.yaml").code == 0
    for name, text in {
        "t": "x,y\n300,250\n", "far": "id,x,y\nf,300,5000\n", "drives": "q1,q2\n1,2\n", "turned": "x,y,rz\n0,0,0\n",
        "six": "x,y,z,rx\n0,0,100,0\n", "empty": "x,y\n300,250\n310,\n", "warm": "x,y,T\n300,250,22\n",
        "unfilled": "id,x,y\na,,\nb,,\n",
    }.items():  # fmt: skip
        Path(f"{name}.csv").write_text(text)
    arguments, code, said = BAD[case]
    if case == "another machine":
        arguments = [TRIGLIDE, "t.csv", "-p", "p.yaml"]
    done = clean(run("correct", *arguments))
    assert done.code == code and said in done.err, done.err


@pytest.mark.parametrize("text", ["id,x,y\n", "\ufeffid,x,y\r\n", "id,x,y\n\n  \n", "id;x;y\n;;\n"])
@pytest.mark.parametrize("command", ["correct", "simulate", "draw", "plan", "observability", "sensitivity"])
def test_a_table_of_poses_without_rows_is_told_as_that(command: str, text: str, tmp_path: Path) -> None:
    """Columns of the tool point are there; before, they were told to be missing."""
    (table := tmp_path / "t.csv").write_bytes(text.encode())
    out = ("-o", tmp_path / "o.svg") if command == "draw" else ()
    done = clean(run(command, BIGLIDE, table, *out))
    assert done.code == 3, done.err
    assert f"{table}:1: error[csv-empty]: the table has no rows below the header" in done.err


def test_poses_that_nothing_states_are_told(tmp_path: Path) -> None:
    (table := tmp_path / "t.csv").write_text("id,x,y\na,,\nb,,\n")
    done = clean(run("simulate", BIGLIDE, table))
    assert done.code == 3 and "the table has no poses: nothing stands in `x`, `y`" in done.err, done.err


def test_an_empty_cell_of_a_circumstance_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A column that is there is to be filled in; one that is not there is to be logged."""
    monkeypatch.chdir(tmp_path)
    heavy = "gravity: [0, -9.81]\neffects: {payload@tracker: {m: 1}}\n"
    Path("m.yaml").write_text(f"extends: {BIGLIDE}\n{heavy}")
    Path("t.csv").write_text("x,y,payload\n300,250,5\n310,250,\n")
    done = clean(run("correct", "m.yaml", "t.csv"))
    assert done.code == 3 and "needs the column `payload` in every row, and cells of it are empty" in done.err
    assert "help: fill in the empty cells" in done.err


@pytest.mark.parametrize(
    ("unit", "factor", "stated"), [("m", 1e-3, "1000"), ("um", 1e3, "0.001"), ("in", 1 / 25.4, "25.4")]
)
def test_targets_in_another_unit_are_told(unit: str, factor: float, stated: str, tmp_path: Path) -> None:
    """A table without units is in those of the machine, and a stated one may be wrong: the factor is named.

    The machine can go to targets of a thousandth: there they crowd far from where it is drawn.
    """
    near = factor < 1.0
    words = ", the targets would lie about the reference" if near else ", 2 of 2 targets would be within reach"
    rows = "".join(f"{x * factor:.6g},{y * factor:.6g}\n" for x, y in ((400, 300), (450, 280)))
    table = tmp_path / "t.csv"
    for head, told in (("x,y", True), ("x [mm],y [mm]", True), (f"x [{unit}],y [{unit}]", False)):
        table.write_text(f"{head}\n{rows}", encoding="utf-8")
        done = run("correct", TRIGLIDE, table, "-o", tmp_path / "c.csv", "--force")
        assert (done.code == 1) is (told and not near)
        assert (f"warning: {stated} times as large{words}" in done.err) is told


def test_only_coordinates_that_are_given_are_tried_in_another_unit(tmp_path: Path) -> None:
    """A hexapod's height stays that of its reference, which nobody wrote in a wrong unit."""
    table = tmp_path / "t.csv"
    table.write_text("x [mm],y [mm]\n0.02,0.01\n20000,10000\n", encoding="utf-8")
    assert "times as large" not in run("correct", MACHINES / "hexapod7.yaml", table, "-o", tmp_path / "c.csv").err
    table.write_text("x [mm],y [mm]\n20000,10000\n", encoding="utf-8")
    done = run("correct", MACHINES / "hexapod7.yaml", table, "-o", tmp_path / "d.csv")
    assert "0.001 times as large, 1 of 1 target would be within reach" in done.err
