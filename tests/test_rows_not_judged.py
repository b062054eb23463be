"""A sheet judges no point by a part of its coordinates, and passes no machine over points that it does not judge."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from pkmcal_cli.workflow import report
from pkmcal_cli.workflow.improve import ImproveRequest
from tests.command import MACHINES, SCISSORS, run
from tests.test_commands_report import UNSEARCHED

BAD, SHIFT = (3, 40, 78), 0.03  # rows, and by how much x is misread in them, mm: sixty times the noise


@pytest.fixture
def unsearched() -> Iterator[None]:
    """No causes are looked for: what is judged does not depend on them."""
    with UNSEARCHED:
        yield


def spoilt(folder: Path, cell: Callable[[str], str]) -> Path:
    """The Scissors' table with three values of x changed."""
    lines = (MACHINES / "scissors.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines if not line.startswith("#")]
    x = next(k for k, name in enumerate(rows[0]) if name.startswith("x"))
    for row in BAD:
        rows[row][x] = cell(rows[row][x])
    table = folder / "t.csv"
    table.write_text("\n".join(",".join(row) for row in rows) + "\n", encoding="utf-8")
    return table


@pytest.mark.parametrize(
    ("tolerance", "code", "verdict"),
    [("5 um", 1, "undecided"), pytest.param("50 um", 0, "pass", marks=pytest.mark.slow)],
)
def test_a_point_of_which_a_loss_leaves_out_one_coordinate_does_not_pass_by_the_other(
    tolerance: str, code: int, verdict: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "ImproveRequest", partial(ImproveRequest, only="backlash@q1"))  # there is no cause
    asked = ("--loss", "tukey", "--tolerance", tolerance, "-o", tmp_path / "s.html", "--json", "-q")
    table = spoilt(tmp_path, lambda cell: f"{float(cell) + SHIFT:.6f}")
    done = run("report", SCISSORS, table, *asked)
    found = done.json
    assert (done.code, found["verdict"]) == (code, verdict)
    assert [row["line"] for row in found["not_judged"]] == [row + 1 for row in BAD]
    assert all(row["error"] == pytest.approx(1e3 * SHIFT, abs=2.0) for row in found["not_judged"])
    assert found["tolerance"]["n_pass"] == 80 - len(BAD)
    (told,) = (line for line in found["lines"] if line.startswith("Not judged"))
    assert all(f"t.csv:{row + 1}" in told for row in BAD)
    assert ("3 points may be further off" in found["headline"]) == (verdict == "undecided")


@pytest.mark.usefixtures("unsearched")
def test_a_row_that_nothing_predicts_leaves_the_verdict_open(tmp_path: Path) -> None:
    """One reading of a drive is out of the machine's reach."""
    lines = (MACHINES / "triglide-nonredundant.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines if not line.startswith("#")][:25]
    drive = next(k for k, name in enumerate(rows[0]) if name.startswith("q2"))
    rows[12][drive] = f"{float(rows[12][drive]) + 2000:.6f}"
    table = tmp_path / "t.csv"
    table.write_text("\n".join(",".join(row) for row in rows) + "\n", encoding="utf-8")
    asked = ("--tolerance", "1 mm", "-o", tmp_path / "s.html", "--json", "-q")
    done = run("report", MACHINES / "triglide-nonredundant.yaml", table, *asked)
    assert (done.code, done.json["verdict"]) == (1, "undecided"), done.err
    assert [(row["line"], row["error"]) for row in done.json["not_judged"]] == [(13, None)]
    assert any("do not predict them: t.csv:13" in line for line in done.json["lines"])


@pytest.mark.usefixtures("unsearched")
def test_points_of_which_a_coordinate_is_missing_are_judged_by_the_others_and_said_to_be(tmp_path: Path) -> None:
    told = "3 points measured only in a part of the coordinates: judged by these alone."
    table = spoilt(tmp_path, lambda _: "")
    done = run("report", SCISSORS, table, "--tolerance", "5 um", "-o", tmp_path / "s.html", "--json", "-q")
    assert (done.code, done.json["verdict"], done.json["not_judged"]) == (0, "pass", [])
    assert done.json["tolerance"]["n_pass"] == 80 and any(told in line for line in done.json["lines"])
    assert run("calibrate", SCISSORS, table, "-o", tmp_path / "p.yaml", "-q").code == 0
    again = run("check", SCISSORS, table, "-p", tmp_path / "p.yaml", "--tolerance", "5 um")
    assert again.code == 0 and told in again.out + again.err
    whole = run("check", SCISSORS, MACHINES / "scissors.csv", "-p", tmp_path / "p.yaml", "--tolerance", "5 um")
    assert whole.code == 0 and "in a part of" not in whole.out + whole.err


@pytest.mark.usefixtures("unsearched")
def test_with_an_instrument_as_uncertain_as_the_tolerance_no_point_can_pass(tmp_path: Path) -> None:
    """U of the Scissors' grid encoder is 1 um."""
    asked = ("--tolerance", "1 um", "-o", tmp_path / "s.html", "--json", "-q")
    done = run("report", SCISSORS, MACHINES / "scissors.csv", *asked)
    assert done.code == 1 and done.json["tolerance"]["n_pass"] == 0
    (line,) = (line for line in done.json["lines"] if "Instrument:" in line)
    assert "100 % of the tolerance: no point can pass, one fails beyond 2 um" in line
