"""Names of others reach neither a terminal as control characters nor a spreadsheet as formulas."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from pkmcal_cli.base.visible import json_safe, visible
from pkmcal_cli.csv_files.guarded import bare, guarded
from tests.command import TRIGLIDE, TRIGLIDE_DATA, run
from tests.terminals import on_terminal

EVIL = "\x1b]0;x\x07\x1b[2J\u202eevil\u2066\x9b31m\x7f\u2028"
FORMULAS = (
    "=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "'=1", "''@x",
    "=", "-", "-1", "+5.5", "a=b", "'quoted'", "#5",
)  # fmt: skip


def has_control(text: str) -> bool:
    return any((ord(c) < 32 and c not in "\n\t\r") or 126 < ord(c) < 160 or c in "\u202e\u2066\u2028" for c in text)


def table_with(name: str, header: str = "") -> str:
    lines = [line for line in Path(TRIGLIDE_DATA).read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    at = names.index("id")
    rows = [line.split(",") for line in lines[1:]]
    rows[0][at] = name
    rows[1][1] = "9999"
    rows[2][at] = name + "2"
    lines = [",".join(cells) for cells in ([*names, header] if header else names, *rows)]
    return "\n".join(line + ("," if header and k else "") for k, line in enumerate(lines)) + "\n"


@pytest.mark.parametrize("command", ["check", "calibrate"])
def test_no_control_character_of_a_table_is_shown(command: str, tmp_path: Path) -> None:
    file = tmp_path / "e\x1b[31m\u202e.csv"
    file.write_text(table_with(EVIL.strip("\u2028"), header="col\x1b[1m\u202e"), encoding="utf-8")
    done = run(command, TRIGLIDE, file, "--json")
    assert not has_control(done.err) and not has_control(done.out)
    assert "\\x1b" in done.err
    json.loads(done.out)


def test_nor_of_a_missing_file_or_an_option(tmp_path: Path) -> None:
    for arguments in (("check", "no\x1b[2J\nerror[x]: y.yaml"), ("check", TRIGLIDE, f"--{EVIL}"), (f"{EVIL}",)):
        done = run(*arguments)
        assert done.code in (2, 3) and not has_control(done.err), done.err
    assert "\\n" in run("check", "no\nerror[x]: y.yaml").err.splitlines()[0]


def test_a_table_on_a_terminal_is_escaped_and_in_a_file_is_not(tmp_path: Path) -> None:
    poses = tmp_path / "poses.csv"
    poses.write_text("id,x [mm],y [mm]\na\x1b[2Jb,400,300\n", encoding="utf-8")
    arguments = ("simulate", TRIGLIDE, str(poses), "-q", "-o", "-")
    ((code, text),) = on_terminal(100, arguments)
    assert code == 0 and "\x1b[2J" not in text
    assert "a\x1b[2Jb" in run(*arguments).out


def test_json_is_the_same_value() -> None:
    value = {"a": EVIL + "\U000e0041\ud7ff"}
    text = json_safe(json.dumps(value, ensure_ascii=False))
    assert json.loads(text) == value and not has_control(text)
    assert visible("plain äöü ✓\n") == "plain äöü ✓\n"


@pytest.mark.parametrize("name", FORMULAS)
def test_formulas_read_back_equal(name: str) -> None:
    assert bare(guarded(name)) == name
    assert guarded(name)[:1] not in "=@#" and (guarded(name)[:1] not in "+-" or float(name) is not None)


def test_ids_that_are_formulas_are_written_inert_and_come_back(tmp_path: Path) -> None:
    poses, first, second = tmp_path / "poses.csv", tmp_path / "first.csv", tmp_path / "second.csv"
    with poses.open("w", newline="") as file:
        csv.writer(file).writerows([("id", "x [mm]", "y [mm]"), *((guarded(n), 400, 300) for n in FORMULAS)])
    assert run("simulate", TRIGLIDE, poses, "-o", first).code == 0
    assert run("simulate", TRIGLIDE, first, "-o", second).code == 0
    for file in (first, second):
        with file.open(newline="") as opened:
            ids = [row[0] for row in csv.reader(opened)][1:]
        assert tuple(map(bare, ids)) == FORMULAS
        assert all(i[0] not in "=@#" and (i[0] not in "+-" or i in ("-1", "+5.5")) for i in ids)
