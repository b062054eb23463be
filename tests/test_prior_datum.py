"""The datum of a calibration stays the datum of the next: of a prior file, and where ranges are a prior."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.command import run
from tests.two_slides import MACHINE, Slides

pytestmark = pytest.mark.usefixtures("unsized")

TRUE = Slides()
AFTER = TRUE.repaired()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """m.yaml, its first calibration old.yaml, and eight rows after a repair, new.csv."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.yaml").write_text(MACHINE, encoding="utf-8")
    TRUE.table(tmp_path / "old.csv", 1)
    AFTER.table(tmp_path / "new.csv", 2, 8)
    done = run("calibrate", "m.yaml", "old.csv", "-o", "old.yaml", "-q")
    assert done.code == 0, done.err
    return tmp_path


def after(machine: str, *more: str) -> Any:
    return run("calibrate", machine, "new.csv", "--prior", "old.yaml", "--json", "--holdout", "none", *more)


def held_at_zero(done: Any) -> None:
    """x1 is the datum, and the repair is told as it was: of the second slide against the first."""
    assert done.code == 0 and done.json["datum"] == ["x1"], done.err
    found = {p["name"]: p for p in done.json["parameters"]}
    assert "x1" not in found and found["x2"]["std"] < 0.02
    assert found["x2"]["value"] == pytest.approx(AFTER.x2 - AFTER.x1, abs=4 * found["x2"]["std"])


@pytest.mark.parametrize("loosen", ["x2", "x*", "x2,x1"])
def test_a_prior_keeps_the_datum_of_its_file(folder: Path, loosen: str) -> None:
    """By name, and where what is loosened leaves the base to ranges: half way between two of them is no place."""
    done = after("m.yaml", "--loosen", loosen, "-o", "new.yaml")
    held_at_zero(done)
    assert "without partner" not in done.err
    entry = yaml.safe_load((folder / "new.yaml").read_text(encoding="utf-8"))["parameters"]["x1"]
    assert entry["value"] == 0.0 and entry["std"] is None  # and so does the next


def test_the_datum_stays_where_the_file_has_it(folder: Path) -> None:
    """Not at nominal: the file's other values are true only with it."""
    text = (folder / "old.yaml").read_text(encoding="utf-8")
    moved = text.replace("x1: {value: 0.0,", "x1: {value: 0.25,")
    assert moved != text
    (folder / "old.yaml").write_text(moved, encoding="utf-8")
    done = after("m.yaml", "--loosen", "x2")
    assert "datum of old.yaml, held at the values there: x1" in done.err and done.json["datum"] == ["x1"]
    found = {p["name"]: p for p in done.json["parameters"]}["x2"]
    assert found["value"] == pytest.approx(AFTER.x2 - AFTER.x1 + 0.25, abs=4 * found["std"])


def test_what_no_longer_is_datum_is_named_with_the_remedy(folder: Path) -> None:
    (folder / "free.yaml").write_text(MACHINE.replace("datum: [x1]\n", ""), encoding="utf-8")
    done = after("free.yaml", "--loosen", "x2")
    assert "held in old.yaml, identified here, known to their ranges: x1" in done.err
    assert "only ranges hold the rest: declare `datum: [x" in done.err
    remedy = done.err.split("--select ", 1)[1].split('"')[1]
    held = after("free.yaml", "--loosen", "x2", "--select", remedy)
    assert held.code == 0 and "x1" not in {p["name"] for p in held.json["parameters"]}


@pytest.mark.slow
def test_ranges_as_a_prior_place_no_base(folder: Path) -> None:
    """`improve` and `calibrate --prior ranges` hold the datum as `calibrate` does."""
    done = run("improve", "m.yaml", "old.csv", "-o", "improved.yaml", "--prior", "ranges")
    assert done.code == 0 and "held fixed as datum: x1" in done.err, done.err
    files = {n: yaml.safe_load((folder / n).read_text(encoding="utf-8")) for n in ("improved.params.yaml", "old.yaml")}
    values = {n: f["parameters"] for n, f in files.items()}
    for found in values.values():
        assert found["x1"]["value"] == 0.0
        assert found["x2"]["value"] == pytest.approx(TRUE.x2 - TRUE.x1, abs=4 * found["x2"]["std"])
    both = [v["x2"]["value"] for v in values.values()]
    assert both[0] == pytest.approx(both[1], abs=1e-3)


@pytest.mark.parametrize("command", ["calibrate", pytest.param("diagnose", marks=pytest.mark.slow)])
def test_frames_of_a_parameter_file_are_doubted_where_the_tracker_was_moved(folder: Path, command: str) -> None:
    """Those that the fit identifies are not, nor those of the set-up that the file is of."""
    AFTER.table(folder / "moved.csv", 3)
    told = "warning: frame@tracker is held at the values of old.yaml, but the readings place the instrument elsewhere"
    whole = ("--holdout", "none") if command == "calibrate" else ()
    for table, select, expected in (("moved", "x2", True), ("old", "x2", False), ("moved", "auto", False)):
        done = run(command, "m.yaml", f"{table}.csv", "-p", "old.yaml", "--select", select, *whole)
        assert (told in done.err) == expected, (table, select, done.err)


def test_a_frame_that_is_identified_gives_the_change_of_the_machine(folder: Path) -> None:
    """What the warning advises."""
    AFTER.table(folder / "moved.csv", 3)
    asked = ("--select", "x2,frame@tracker.*", "--json", "--holdout", "none")
    done = run("calibrate", "m.yaml", "moved.csv", "-p", "old.yaml", *asked)
    found = {p["name"]: p for p in done.json["parameters"]}["x2"]
    assert found["value"] == pytest.approx(AFTER.x2 - AFTER.x1, abs=0.05)
