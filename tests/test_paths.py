"""Any text as a path, in every place where a command takes one: a documented end, never an internal error."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pkmcal_cli.base.outputs import make_folder
from tests.command import GRID, TRIGLIDE, TRIGLIDE_DATA, Done, clean, run

TEXTS = {
    "300": "x" * 300,
    "300 with a suffix": "x" * 300 + ".csv",
    "5000": "x" * 5000,
    "5000 with a suffix": "x" * 5000 + ".csv",
    "zero byte": "a\0b",
    "zero byte and suffix": "a\0b.csv",
    "below a file": "file/x.csv",
    "deep": "a/" * 3000 + "b",
    "deep, and short enough": "/".join("a" * 1800),
}
INPUTS: dict[str, tuple[list[str], int]] = {
    "machine": (["check", "{}"], 3),
    "machine of effects": (["effects", "{}"], 3),
    "machine of improve": (["improve", "{}", TRIGLIDE_DATA], 3),
    "table of check": (["check", TRIGLIDE, "{}"], 3),
    "table": (["calibrate", TRIGLIDE, "{}"], 3),
    "two tables": (["calibrate", TRIGLIDE, TRIGLIDE_DATA, "{}"], 3),
    "poses": (["simulate", TRIGLIDE, "{}"], 3),
    "table of diagnose": (["diagnose", TRIGLIDE, "{}"], 3),
    "--validation": (["improve", TRIGLIDE, TRIGLIDE_DATA, "--validation", "{}"], 3),
    "-p": (["sensitivity", TRIGLIDE, "-p", "{}"], 3),
}
OUTPUTS: dict[str, list[str]] = {
    "calibrate": ["calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", "{}"],
    "simulate": ["simulate", TRIGLIDE, "--grid", GRID, "-o", "{}"],
    "plan": ["plan", TRIGLIDE, "--grid", GRID, "-o", "{}"],
    "improve": ["improve", TRIGLIDE, TRIGLIDE_DATA, "-o", "{}"],
    "schema": ["schema", "-o", "{}"],
    "diagnose": ["diagnose", TRIGLIDE, TRIGLIDE_DATA, "--plots", "{}"],
}


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("x")


def ended(command: list[str], text: str) -> Done:
    return clean(run(*(text if part == "{}" else part for part in command)))


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("place", INPUTS)
def test_no_such_input(place: str, text: str) -> None:
    command, code = INPUTS[place]
    done = ended(command, TEXTS[text])
    assert done.code == code and "error[file]: " in done.err


@pytest.mark.parametrize("text", TEXTS)
def test_no_such_holdout(text: str) -> None:
    """What may be a slip of a scheme's name is usage, a name with a suffix is a file."""
    done = ended(["calibrate", TRIGLIDE, TRIGLIDE_DATA, "--holdout", "{}"], TEXTS[text])
    if "." in TEXTS[text]:
        assert done.code == 3 and "error[file]: " in done.err
    else:
        assert (
            done.code == 2
            and "is not a scheme\nhelp: give a number of folds, session, cells, FILE.csv or none" in done.err
        )


@pytest.mark.parametrize("text", [name for name in TEXTS if name != "deep, and short enough"])
@pytest.mark.parametrize("command", OUTPUTS)
def test_no_such_output(command: str, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Refused before the work."""

    def begun(*_: object, **__: object) -> None:
        raise AssertionError("the work has begun")

    monkeypatch.setattr("pkmcal_cli.loading.load_machine.compile_machine", begun)
    for force in ([], ["--force"] if command != "diagnose" else []):
        done = ended([*OUTPUTS[command], *force], TEXTS[text])
        assert done.code == 4 and "error[output]: " in done.err and done.out == ""
    assert [p.name for p in Path().iterdir()] == ["file"]


def test_a_deep_folder_for_pictures() -> None:
    make_folder(TEXTS["deep, and short enough"])
    os.removedirs(TEXTS["deep, and short enough"])  # it was there


def test_a_file_where_pictures_should_go() -> None:
    done = ended(OUTPUTS["diagnose"], "file")
    assert done.code == 4 and "file: error[output]: this is not a folder" in done.err


def test_a_long_name_of_many_bytes_can_be_written() -> None:
    name = "\u00e4\u6e2c" * 49 + ".json"  # 250 bytes, of 255 that a file system takes
    assert run("schema", "-o", name).code == 0 and Path(name).is_file()


def test_what_is_written_under_a_name_that_is_no_text_is_read_again() -> None:
    name = "t\udcff.csv"
    Path(name).write_bytes(Path(TRIGLIDE_DATA).read_bytes())
    made = ended(["calibrate", TRIGLIDE, "{}", "--select", "l1,l2", "--holdout", "none", "-o", "p.yaml"], name)
    assert made.code == 0 and run("sensitivity", TRIGLIDE, "-p", "p.yaml").code == 0
    assert run("simulate", TRIGLIDE, name, "-o", "s.csv").code == 0 and run("check", TRIGLIDE, "s.csv").code == 0


def test_a_table_under_two_names_is_given_twice() -> None:
    Path("a.csv").write_bytes(Path(TRIGLIDE_DATA).read_bytes())
    Path("b.csv").hardlink_to("a.csv")
    done = ended(["calibrate", TRIGLIDE, "a.csv", "{}"], "b.csv")
    assert done.code == 3 and "b.csv:1: error[file]: this file is given twice" in done.err
