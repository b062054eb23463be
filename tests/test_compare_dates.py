"""Parameter files say when their rows were measured, where the table's times are dates; trends go by that."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from tests.command import Done, run
from tests.two_slides import MACHINE, Slides

ISO = tuple(f"2021-12-{day}T{{hour}}:{{minute:02d}}:00" for day in ("06", "16", "26"))
SERIAL = (44536.0, 44546.0, 44556.0)
"""The same days in a spreadsheet."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(MACHINE, encoding="utf-8")
    return tmp_path


def calibrated(name: str, times: list[str], x2: float = 0.0) -> Done:
    """A table with these times, of the second slide moved by so much; NAME.yaml."""
    table = replace(Slides(), x2=x2).table(Path(f"{name}.csv"), len(name) + int(100 * abs(x2)), len(times))
    lines = table.read_text(encoding="utf-8").splitlines()
    rows = [f"{time},{line}" for time, line in zip(["time", *times], lines, strict=True)]
    table.write_text("\n".join([*rows, ""]), encoding="utf-8")
    done = run("calibrate", "m.yaml", table, "-o", f"{name}.yaml", "--holdout", "none", "--json")
    assert done.code == 0, done.err
    return done


def times(day: int, form: str) -> list[str]:
    """Of 30 rows from 10:00 to 12:25 of a day."""
    minutes = [5 * k for k in range(30)]
    if form == "iso":
        return [ISO[day].format(hour=10 + m // 60, minute=m % 60) for m in minutes]
    return [f"{SERIAL[day] + (10 + m / 60) / 24:.7f}" if form == "serial" else str(60 * m) for m in minutes]


@pytest.mark.parametrize("form", ["iso", "serial"])
def test_a_parameter_file_says_when_its_rows_were_measured(form: str) -> None:
    done = calibrated("one", times(1, form))
    head = yaml.safe_load(Path("one.yaml").read_text(encoding="utf-8"))["provenance"]
    assert (head["measured_from"], head["measured_to"]) == ("2021-12-16T10:00:00+00:00", "2021-12-16T12:25:00+00:00")
    assert done.json["provenance"]["measured_to"] == head["measured_to"]
    assert ("looks like a spreadsheet's day (2021-12-16)" in done.err) == (form == "serial")


def test_seconds_since_the_start_are_no_date() -> None:
    calibrated("one", times(0, "seconds"))
    assert "measured_" not in Path("one.yaml").read_text(encoding="utf-8")


def test_a_trend_goes_by_the_dates_of_the_tables() -> None:
    """10 um a day in 20 days, whenever calibrated: these three files are made within seconds."""
    for day in range(3):
        calibrated(f"p{day}", times(day, "iso"), 0.1 * day)
    done = run("compare", "p0.yaml", "p1.yaml", "p2.yaml", "--json")
    (change,) = (p for p in done.json["parameters"] if p["name"] == "x2")
    assert done.json["per"] == "day" and change["changed"]
    assert change["change"] == pytest.approx(0.01, abs=4 * change["std"]) and change["std"] < 1e-3
    assert [f["measured_from"][:10] for f in done.json["files"]] == ["2021-12-06", "2021-12-16", "2021-12-26"]
    assert "B: p1.yaml, measured 2021-12-16 11:12" in done.err and "within a day" not in done.err


def test_files_of_tables_without_dates_are_told_beside_others() -> None:
    """One of three has only the date of its calculation; three of one afternoon are in the order given."""
    for day in range(3):
        calibrated(f"p{day}", times(day, "iso" if day else "seconds"), 0.1 * day)
    done = run("compare", "p0.yaml", "p1.yaml", "p2.yaml")
    assert "not all tables had dates: A by the date of the calculation (`created:`)" in done.err
    for k in range(3):
        calibrated(f"q{k}", times(1, "iso"), 0.1 * k)
    done = run("compare", "q0.yaml", "q1.yaml", "q2.yaml", "--json")
    assert done.json["per"] is None and "these files were measured within a day: changes are told" in done.err
