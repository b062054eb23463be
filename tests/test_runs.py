"""`--run DIR`: inputs, results and versions as plain files, whole or absent; `compare DIR` lists them."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest
import yaml

from pkmcal_cli.workflow.run_folder import copy_of
from tests.campaign_tables import true_values, write_table
from tests.command import MACHINES, SCISSORS, SHOPFLOOR, run

BIGLIDE = (MACHINES / "biglide.yaml").read_text()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine that extends another, and a table."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shop").mkdir()
    (tmp_path / "shop" / "biglide.yaml").write_text(BIGLIDE)
    (tmp_path / "mine.yaml").write_text("extends: shop/biglide.yaml\n")
    write_table(tmp_path / "rows.csv", "biglide", true_values("biglide", 1), 1, 40)
    return tmp_path


def only(folder: Path) -> Path:
    (found,) = (folder / "runs").iterdir()
    return found


def test_a_calibration_is_kept(folder: Path) -> None:
    done = run("calibrate", "mine.yaml", "rows.csv", "--holdout", "none", "--run", "runs", "-o", "p.yaml", "--json")
    assert done.code == 0
    kept = only(folder)
    assert f"run kept: runs/{kept.name}" in done.err and kept.name.endswith("_calibrate")
    record = yaml.safe_load((kept / "run.yaml").read_text())
    assert record["inputs"].keys() == {"mine.yaml", "shop/biglide.yaml", "rows.csv"}
    for name, about in record["inputs"].items():
        assert (kept / about["file"]).read_bytes() == (folder / name).read_bytes()
        assert about["sha256"] == hashlib.sha256((folder / name).read_bytes()).hexdigest()
    assert json.loads((kept / "result.json").read_text()) == done.json
    assert record["exit_code"] == 0 and record["verdict"].startswith("converged") and "um" in record["rms"]
    assert record["arguments"][0] == "calibrate" and record["versions"]["program"].startswith("pkmcal ")
    values = [yaml.safe_load(p.read_text())["parameters"] for p in (kept / "params.yaml", folder / "p.yaml")]
    assert values[0] == values[1]


def test_what_is_told_of_a_table_is_kept_with_it(folder: Path) -> None:
    """A copy of a simulated table is simulated too; what belongs to other content is told of the copy as well."""
    grid = "x=250:450:4,y=220:320:4"
    run("simulate", "mine.yaml", "--grid", grid, "--noise", "declared", "--seed", "1", "-q", "-o", "made.csv")
    run("calibrate", "mine.yaml", "made.csv", "--holdout", "none", "--run", "runs", "-q")
    done = run("check", "mine.yaml", only(folder) / "inputs" / "made.csv")
    assert "made.csv: simulated: no measurements" in done.err


def test_a_run_can_be_run_again(folder: Path) -> None:
    """From its own copies alone, to the same digits."""
    run("calibrate", "mine.yaml", "rows.csv", "--holdout", "none", "--run", "runs", "-q")
    kept = only(folder)
    copies = kept / "inputs"
    done = run("calibrate", copies / "mine.yaml", copies / "rows.csv", "--holdout", "none", "--json", "-q")
    assert done.json["parameters"] == json.loads((kept / "result.json").read_text())["parameters"]


def test_the_history_of_runs(folder: Path) -> None:
    for options in (["--holdout", "none"], ["--holdout", "none", "--max-rms", "1 nm"]):
        run("calibrate", "mine.yaml", "rows.csv", "--run", "runs", "-q", *options, "--holdout", "none")
    run("correct", "mine.yaml", "--grid", "x=300:400:2,y=250:300:2", "-o", "c.csv", "--run", "runs", "-q")
    found = run("compare", "runs", "--json")
    listed = found.json["runs"]
    assert sorted(r["command"] for r in listed) == ["calibrate", "calibrate", "correct"]
    assert all(r["intact"] for r in listed)
    assert sorted(r["exit_code"] for r in listed) == [0, 0, 1]
    assert "4 of 4 targets corrected" in found.err and "mine.yaml" in found.err
    assert found.err.count("(exit code 1)") == 1, "a limit that was missed is seen in the list"
    table = next(Path(r["folder"]) / "commands.csv" for r in listed if r["command"] == "correct")
    rows = [[ln for ln in f.read_text().splitlines() if not ln.startswith("#")] for f in (table, folder / "c.csv")]
    assert rows[0] == rows[1] and len(rows[0]) == 5


@pytest.mark.parametrize(
    ("form", "suffix", "parts"),
    [("csv", ".csv", ()), ("linuxcnc", ".comp", ("q1", "q2", "q3")), ("gcode-drives", ".ngc", ())],
)
def test_what_a_control_takes_is_kept(folder: Path, form: str, suffix: str, parts: tuple[str, ...]) -> None:
    """All files that `correct --as` wrote, but for lines of remarks: whole, as with every run."""
    grid = "x=250:450:4,y=220:320:4"
    done = run("correct", "mine.yaml", "--grid", grid, "--as", form, "-o", f"new{suffix}", "--run", "runs", "-q")
    assert done.code == 0
    kept = only(folder)
    for part in [f".{p}" for p in parts] or [""]:
        texts = [f.read_text() for f in (folder / f"new{part}{suffix}", kept / f"export{part}{suffix}")]
        plain = [[line for line in text.splitlines() if line[:1] not in "#;("] for text in texts]
        assert plain[0] == plain[1] and len(plain[0]) > 2
    assert run("compare", "runs", "--json").json["runs"][0]["intact"]


def test_runs_are_compared(folder: Path) -> None:
    """Their machine is among their copies, so the tool point is predicted wherever they lie."""
    write_table(folder / "more.csv", "biglide", true_values("biglide", 1), 2, 40)
    for rows in ("rows.csv", "more.csv"):
        run("calibrate", "mine.yaml", rows, "--holdout", "none", "--run", "runs", "-q")
    (folder / "mine.yaml").unlink()
    done = run("compare", *sorted((folder / "runs").iterdir()), "--json")
    assert done.code == 0 and done.json["tool_point"] is not None


def test_a_run_without_parameters_is_left_out(folder: Path) -> None:
    """Of `compare runs/*`: a correction has none, and calibrations are compared all the same."""
    write_table(folder / "more.csv", "biglide", true_values("biglide", 1), 2, 40)
    for rows in ("rows.csv", "more.csv"):
        run("calibrate", "mine.yaml", rows, "--holdout", "none", "--run", "runs", "-q")
    run("correct", "mine.yaml", "--grid", "x=300:400:2,y=250:300:2", "-o", "c.csv", "--run", "runs", "-q")
    *calibrations, correction = sorted((folder / "runs").iterdir(), key=lambda kept: kept.name.endswith("_correct"))
    done = run("compare", *calibrations, correction, "--json")
    assert done.code == 0 and len(done.json["files"]) == 2
    assert f"{correction}: a run of `correct` has no parameters" in done.err
    done = run("compare", calibrations[0], correction)
    assert done.code == 2 and "nothing to compare it with" in done.err


def test_a_result_that_was_changed_is_told(folder: Path) -> None:
    run("calibrate", "mine.yaml", "rows.csv", "--holdout", "none", "--run", "runs", "-q")
    file = only(folder) / "params.yaml"
    file.write_text(file.read_text().replace("l1", "l9"))
    done = run("compare", "runs", "--json")
    assert not done.json["runs"][0]["intact"] and "changed since" in done.err
    assert "changed since" in run("compare", file.parent, file.parent).err


def test_nothing_is_left_of_a_run_that_fails(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pkmcal_cli.workflow.run_folder.os.rename", full)
    done = run("calibrate", "mine.yaml", "rows.csv", "--holdout", "none", "--run", "runs")
    assert done.code == 4 and "No space left" in done.err
    assert list((folder / "runs").iterdir()) == []


def test_an_input_that_changes_meanwhile_is_not_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pkmcal_cli.workflow import run_folder

    def changed(name: str, target: Path) -> None:
        Path(target).write_text("other")

    monkeypatch.setattr(run_folder.shutil, "copyfile", changed)
    done = run("calibrate", "mine.yaml", "rows.csv", "--holdout", "none", "--run", "runs")
    assert done.code == 4 and "has changed while the command ran" in done.err
    assert list((folder / "runs").iterdir()) == []


@pytest.mark.parametrize(
    ("where", "code", "told"),
    [
        *[(name, 4, "not a folder") for name in ("rows.csv", "rows.csv/x")],
        ("", 4, "is empty"), ("-", 2, "no folder"), ("new/deep", 0, ""),
    ],
)
def test_where_runs_are_kept(folder: Path, where: str, code: int, told: str) -> None:
    done = run("calibrate", "mine.yaml", "rows.csv", "--holdout", "none", "--run", where)
    assert done.code == code and told in done.err
    assert code or len(os.listdir(folder / where)) == 1


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "improve", "correct"])
@pytest.mark.parametrize("where", ["rows.csv/x", "nowhere", "read-only/x", "new/" + 300 * "x", "result.svg"])
def test_a_folder_that_cannot_be_made_is_told_before_the_work(
    folder: Path, where: str, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below a file, a link to nowhere, a file system that is read-only, a name that is too long, another result; of
    the attempt nothing is left."""
    (folder / "nowhere").symlink_to("gone/x")
    (folder / "read-only").mkdir()
    make = Path.mkdir

    def guarded(path: Path, *options: Any, **more: Any) -> None:
        if path.parent.name == "read-only":
            raise OSError(30, "Read-only file system")
        make(path, *options, **more)

    def begun(*_: object, **__: object) -> None:
        raise AssertionError("the work has begun")

    monkeypatch.setattr(Path, "mkdir", guarded)
    monkeypatch.setattr("pkmcal_cli.loading.load_machine.compile_machine", begun)
    rows = ["--grid", "x=300:400:2,y=250:300:2"] if command == "correct" else ["rows.csv"]
    result = "-o" if command == "improve" else "--plot"
    before = sorted(os.listdir(folder))
    done = run(command, "mine.yaml", *rows, result, "result.svg", "--run", where)
    assert done.code == (2 if where == "result.svg" else 4) and "error[" in done.err
    assert sorted(os.listdir(folder)) == before and not os.listdir(folder / "read-only")


def test_an_input_that_is_no_file_cannot_be_kept(folder: Path) -> None:
    """Pipes are read once."""
    done = run("calibrate", "mine.yaml", os.devnull, "--run", "runs")
    assert done.code == 2 and f"`{os.devnull}` is no file" in done.err and not (folder / "runs").exists()


def test_stdin_cannot_be_kept(folder: Path) -> None:
    done = run("calibrate", "mine.yaml", "-", "--run", "runs", stdin=(folder / "rows.csv").read_text())
    assert done.code == 2 and "stdin" in done.err and not (folder / "runs").exists()


def test_copies_lie_as_inputs_did() -> None:
    inputs = ["/a/b/m.yaml", "/a/c/base.yaml", "/a/b/t.csv"]
    assert [copy_of(n, inputs) for n in inputs] == ["inputs/b/m.yaml", "inputs/c/base.yaml", "inputs/b/t.csv"]


@pytest.mark.slow
def test_an_improved_machine_is_kept(folder: Path) -> None:
    """It extends the kept copy, and its parameters fit it."""
    assert run("diagnose", SCISSORS, SHOPFLOOR, "--run", "runs", "-q").code == 1
    diagnosed = only(folder)
    assert (diagnosed / "result.json").exists()
    run("improve", SCISSORS, SHOPFLOOR, "--run", "runs", "-q")
    (kept,) = (p for p in (folder / "runs").iterdir() if p != diagnosed)
    params = kept / "params.yaml"
    rms = json.loads((kept / "result.json").read_text())["after"]["position"]["rms"]
    assert f"{1e3 * rms:.4g} um (held out)" in (kept / "run.yaml").read_text(), "as that of a calibration"
    done = run("calibrate", kept / "improved.yaml", SHOPFLOOR, "-p", params, "--json", "-q", "--accept")
    assert done.code == 0 and done.json["after"]["position"]["rms"] < 0.002  # mm, with its bad row
