"""Where a table comes from stands beside it: the table opens as it is; a file that is not its own does not count."""

from __future__ import annotations

import csv
import hashlib
import os
from pathlib import Path

import pandas as pd
import pytest
import yaml

from tests.command import MACHINES, TRIGLIDE, TRIGLIDE_DATA, run

GRID = ("--grid", "x=300:400:2,y=250:300:2")
SIDE = "t.csv.provenance.yaml"
SIMULATED = "simulated: no measurements"
WRITERS = {
    "simulate": ("simulate", TRIGLIDE, *GRID),
    "correct": ("correct", TRIGLIDE, *GRID),
    "drive tables": ("correct", TRIGLIDE, *GRID, "--as", "csv"),
    "sensitivity": ("sensitivity", TRIGLIDE, *GRID, "--channel", "x"),
    "plan": ("plan", str(MACHINES / "biglide.yaml"), *GRID),
}


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("command", WRITERS)
def test_a_written_table_opens_as_it_is(command: str) -> None:
    """In pandas and in the csv module, as a spreadsheet does it: header first, then rows of as many cells."""
    done = run(*WRITERS[command], "-o", "t.csv", "-q")
    assert done.code == 0, done.err
    frame = pd.read_csv("t.csv")
    with open("t.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert len(frame) == len(rows) - 1 > 0 and len({len(row) for row in rows}) == 1
    assert not any(str(name).startswith(("#", "Unnamed")) for name in frame.columns)


@pytest.mark.parametrize("command", WRITERS)
def test_what_it_is_stands_beside_it(command: str) -> None:
    run(*WRITERS[command], "-o", "t.csv", "-q")
    told = yaml.safe_load(Path(SIDE).read_text(encoding="utf-8"))
    assert list(told) == ["data", "sha256", "kind", "note", "provenance"] and told["data"] == "t.csv"
    assert told["sha256"] == hashlib.sha256(Path("t.csv").read_bytes()).hexdigest()
    machine = WRITERS[command][1]
    digest = hashlib.sha256(Path(machine).read_bytes()).hexdigest()
    assert told["provenance"]["inputs"][machine] == digest
    assert (told["note"] == SIMULATED) == (command == "simulate")


@pytest.mark.parametrize("command", WRITERS)
def test_neither_file_is_replaced_without_force(command: str) -> None:
    Path(SIDE).write_text("mine")
    done = run(*WRITERS[command], "-o", "t.csv", "-q")
    assert done.code == 4 and f"{SIDE}: error[output]: the file already exists" in done.err
    assert os.listdir() == [SIDE] and Path(SIDE).read_text() == "mine"
    assert run(*WRITERS[command], "-o", "t.csv", "-q", "--force").code == 0
    assert Path(SIDE).read_text().startswith("data: t.csv\n")


def test_no_input_is_replaced_by_what_stands_beside() -> None:
    """Neither the machine, nor what stands beside a table that is read."""
    Path(SIDE).write_text(f"extends: {TRIGLIDE}\n")
    done = run("simulate", SIDE, *GRID, "-o", "t.csv", "--force")
    assert done.code == 4 and "this file is an input of the command" in done.err and os.listdir() == [SIDE]
    assert run("simulate", TRIGLIDE, *GRID, "-o", "a.csv", "-q").code == 0
    before = Path("a.csv.provenance.yaml").read_bytes()
    done = run("simulate", TRIGLIDE, "a.csv", "-o", "a.csv.provenance.yaml", "--force")
    assert done.code == 4 and Path("a.csv.provenance.yaml").read_bytes() == before


def test_on_a_stream_the_lines_stay() -> None:
    done = run("simulate", TRIGLIDE, *GRID, "-q")
    lines = done.out.splitlines()
    assert lines[:2] == [f"# {SIMULATED}", "# provenance:"] and os.listdir() == []
    head = yaml.safe_load("\n".join(line[2:] for line in lines[1:] if line.startswith("#")))
    assert head["provenance"]["arguments"] == ["simulate", TRIGLIDE, *GRID, "-q"]
    assert run("simulate", TRIGLIDE, *GRID, "-q", "-o", os.devnull).code == 0
    assert not Path(f"{os.devnull}.provenance.yaml").exists()


def notes_of(table: str, stdin: str | None = None) -> list[str]:
    done = run("check", TRIGLIDE, table, stdin=stdin)
    assert done.code == 0, done.err
    return [line.removeprefix("note: ") for line in done.err.splitlines() if line.startswith("note: ")]


def test_both_forms_say_that_nothing_was_measured() -> None:
    streamed = run("simulate", TRIGLIDE, *GRID, "-q").out
    assert any(SIMULATED in note for note in notes_of("-", streamed))
    earlier = streamed.replace(f"# {SIMULATED}", "# simulated by pkmcal, not measured")
    assert any(SIMULATED in note for note in notes_of("-", earlier))
    run("simulate", TRIGLIDE, *GRID, "-q", "-o", "t.csv")
    assert any(f"{SIMULATED} ({SIDE})" in note for note in notes_of("t.csv"))
    assert any(SIMULATED in note for note in notes_of(TRIGLIDE_DATA))


@pytest.mark.parametrize(
    ("beside", "told"),
    [
        ("data: t.csv\nsha256: " + "0" * 64 + "\nkind: simulated\n", "was written for another content of this table"),
        ("kind: simulated\n", "has no `sha256` of this table"),
        ("", "has no `sha256` of this table"),
        ("&a [*a, *a]\n\0\udcff".encode("utf-8", "surrogateescape").decode("latin-1"), "has no `sha256`"),
    ],
)  # fmt: skip
def test_a_file_that_is_not_its_own_is_told_and_does_not_count(beside: str, told: str) -> None:
    run("simulate", TRIGLIDE, *GRID, "-q", "-o", "t.csv")
    Path(SIDE).write_text(beside, encoding="utf-8")
    notes = notes_of("t.csv")
    assert any(f"{SIDE} {told}" in note and note.endswith("ignored") for note in notes)
    assert not any(SIMULATED in note for note in notes)


def test_a_table_that_was_filled_in_is_another() -> None:
    """Measured values in place of simulated ones, under the same name: nothing says any longer that it is simulated."""
    run("simulate", TRIGLIDE, *GRID, "-q", "-o", "t.csv")
    Path("t.csv").write_text(Path("t.csv").read_text().replace("\n1,", "\n01,"))
    assert not any(SIMULATED in note for note in notes_of("t.csv"))
    Path(SIDE).unlink()
    assert not any(SIDE in note for note in notes_of("t.csv"))


def test_a_kept_run_has_both_files() -> None:
    assert run("correct", TRIGLIDE, *GRID, "-o", "t.csv", "--run", "runs", "-q").code == 0
    (kept,) = Path("runs").iterdir()
    assert (kept / "commands.csv").read_bytes() == Path("t.csv").read_bytes()
    told = yaml.safe_load((kept / "commands.csv.provenance.yaml").read_text())
    assert told["sha256"] == hashlib.sha256((kept / "commands.csv").read_bytes()).hexdigest()


@pytest.mark.parametrize("table", sorted(MACHINES.glob("*.csv.provenance.yaml")), ids=lambda f: str(f.name))
def test_what_stands_beside_a_shipped_table_is_its_own(table: Path) -> None:
    told = yaml.safe_load(table.read_text(encoding="utf-8"))
    assert told["sha256"] == hashlib.sha256((MACHINES / told["data"]).read_bytes()).hexdigest()
