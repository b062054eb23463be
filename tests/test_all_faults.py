"""A machine and its tables are read whole, whichever of them is wrong: all faults are told in one run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import MACHINES, run

RANGE, NUMBER = "m.yaml:2:26: error[range]", "t.csv:{}:3: error[csv-number]"
WRONG = "parameters: {l1: {range: -3 mm}}\n"


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine with a wrong range, and a table with two wrong cells, of which one is the first of its column, and
    remarks in a column with brackets."""
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(f"extends: {MACHINES}/triglide-nonredundant.yaml\n{WRONG}", encoding="utf-8")
    table = (MACHINES / "triglide-nonredundant.csv").read_text(encoding="utf-8")
    head, *rows = [line.split(",") for line in table.splitlines() if not line.startswith("#")][:12]
    rows[0][1], rows[4][1] = "1d3", "O.5"
    table = [[*head, "remark [who]"], *([*row, "good"] for row in rows)]
    Path("t.csv").write_text("\n".join(map(",".join, table)) + "\n", encoding="utf-8")


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(
    "command", ["check", "calibrate", "diagnose", "improve", "report", "compare m.yaml", "plan --next --budget 40"]
)
def test_faults_of_the_machine_and_of_the_table_are_told_together(command: str) -> None:
    name, *more = command.split()
    done = run(name, *more, "m.yaml", "t.csv")
    assert done.code == (1 if command == "check" else 3)
    assert all(fault in done.err for fault in (RANGE, NUMBER.format(2), NUMBER.format(6)))
    assert done.err.count("error[") == 3


@pytest.mark.usefixtures("files")
def test_a_machine_that_cannot_be_opened_is_the_only_fault() -> None:
    done = run("calibrate", "nowhere.yaml", "t.csv")
    assert done.code == 3 and done.err.count("error[") == 1 and "nowhere.yaml: error[file]" in done.err


@pytest.mark.usefixtures("files")
def test_a_table_that_cannot_be_opened_is_told_beside_the_machine() -> None:
    done = run("calibrate", "m.yaml", "nowhere.csv")
    assert done.code == 3 and RANGE in done.err and "nowhere.csv:1: error[file]" in done.err


def test_a_row_with_other_separators_is_told_by_them(tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    head, *rows = [line for line in (MACHINES / "scissors.csv").read_text().splitlines() if line[:1] != "#"][:6]
    for line, mark, name in ((rows[2], ";", "semicolon"), (rows[3], "\t", "tab")):
        table.write_text("\n".join([head, *rows]).replace(line, line.replace(",", mark, 2)) + "\n", encoding="utf-8")
        done = run("check", MACHINES / "scissors.yaml", table)
        assert "error[csv-width]" in done.err and f"help: write a comma between cells, not a {name}" in done.err
