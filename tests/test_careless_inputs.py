"""Small wrong inputs of somebody in a hurry: place, remedy and exit code, within a moment."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.command import MACHINES, clean, run

TRIGLIDE = MACHINES / "triglide.yaml"
TABLE = MACHINES / "triglide.csv"


def test_a_long_table_of_words_is_refused_at_once(tmp_path: Path) -> None:
    """Each of its cells was given a remedy of its own: half a minute, for fifty that are shown."""
    (table := tmp_path / "t.csv").write_text(
        "q1 [mm],q2 [mm],q3 [mm],x [mm],y [mm]\n" + "abc,def,ghi,foo,bar\n" * 100_000, encoding="utf-8"
    )
    begin = time.process_time()
    done = clean(run("calibrate", TRIGLIDE, table))
    assert time.process_time() - begin < 8
    assert done.code == 3 and f"{table}:2:1: error[csv-number]: `abc` in column `q1` is not a number" in done.err
    assert "... and 499950 more faults" in done.err


@pytest.mark.parametrize("head", ["", "# Written by `pkmcal calibrate`\n\n"])
@pytest.mark.parametrize("text", ["parameters: {l1: 300.05, l2: 299.9}\n", "units: {length: mm}\nspace: planar\n"])
def test_a_yaml_file_is_no_table(text: str, head: str, tmp_path: Path) -> None:
    (file := tmp_path / "p.yaml").write_text(head + text, encoding="utf-8")
    done = clean(run("calibrate", TRIGLIDE, file))
    line = 1 + head.count("\n")
    assert done.code == 3 and f"{file}:{line}:1: error[csv-header]: this is a machine or parameter file" in done.err
    assert "help: name the machine file first, then tables; a parameter file is given by `-p`" in done.err
    assert "missing column" not in done.err


def test_a_folder_is_no_machine(tmp_path: Path) -> None:
    done = clean(run("calibrate", tmp_path, TABLE))
    assert done.code == 3 and "help: give a file in this folder" in done.err


def test_a_decimal_comma_of_an_option_is_told() -> None:
    done = clean(run("calibrate", TRIGLIDE, TABLE, "--fail-above", "heldout 0,02 mm"))
    assert done.code == 2 and "help: write a decimal point, not a comma" in done.err, done.err


def test_a_key_in_the_wrong_place_is_told_where_it_belongs(tmp_path: Path) -> None:
    """The list of all sections helped nobody who wrote `sigma: 10 um` for the whole machine."""
    for key, home in (("sigma: 10 um", "`actuators`, `sensors`"), ("nominal: 3", "`parameters`")):
        (file := tmp_path / "m.yaml").write_text(f"extends: {TRIGLIDE}\n{key}\n", encoding="utf-8")
        done = clean(run("check", file))
        word = key.partition(":")[0]
        assert done.code == 1 and f"m.yaml:2:1: error[unknown-key]: unknown key `{word}`" in done.err
        assert f"help: `{word}` is a key of the entries of {home}\n" in done.err


def test_more_folds_than_poses(tmp_path: Path) -> None:
    """The message says how many there are: two rows are of one pose."""
    head, *rows = TABLE.read_text(encoding="utf-8").splitlines()
    (table := tmp_path / "t.csv").write_text("\n".join([head, *rows[:12], rows[0]]) + "\n", encoding="utf-8")
    done = clean(run("calibrate", TRIGLIDE, table, "--holdout", "13"))
    assert done.code == 2 and "13 folds are not possible with 12 distinct poses; ask for 2 to 12, or none" in done.err
