"""`improve --only`: what is not listed is not tested, and it is said that only some effects were."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.diagnosis import report_rows
from tests.command import TRIGLIDE, clean, run
from tests.computed_once import run_once
from tests.truth.campaigns import Planted, campaign

pytestmark = pytest.mark.usefixtures("unsized")

SIMULATED = {
    "scaled": Planted("scale", "q1", {"s": 400e-6}),
    "step": Planted("odd_tanh", "q2", {"h": 60e-6}),
}


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Tables of the Triglide by an independent simulator, each with one fault."""
    folder = tmp_path_factory.mktemp("only")
    for name, planted in SIMULATED.items():
        (folder / f"{name}.csv").write_text(campaign("triglide", [planted], 3).csv_text(), encoding="utf-8")
    return {name: folder / f"{name}.csv" for name in SIMULATED}


def test_a_displacement_without_a_name_is_not_added_unless_it_is_listed(tables: dict[str, Path]) -> None:
    """A step of one drive, of which play of all is the only listed cause."""
    done = clean(run_once("improve", TRIGLIDE, tables["step"], "--only", "backlash@all", "--json"))
    assert {f"{s['effect']}@{s['at']}" for s in done.json["steps"]} <= {"backlash@all"}
    assert done.json["only"] == ["backlash@all"]
    assert "of the catalogue" not in done.err and "only backlash@all was tested" in done.err


def test_what_is_only_shown_is_fitted_only_where_it_is_shown(
    tables: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error on rows that chose takes three fits of each rotation and step."""
    made, plain = [], report_rows._inner
    monkeypatch.setattr(report_rows, "_inner", lambda fold: made.append(fold) or plain(fold))
    asked = ("improve", TRIGLIDE, tables["scaled"], "--only", "scale@q1")
    assert run(*asked, "-q").code == 0 and not made
    done = run(*asked)
    assert "rms selection" in done.err and "+ scale@q1" in done.err and len(made) == 10, "rotations, before and with it"


@pytest.mark.slow
def test_a_displacement_without_a_name_can_be_listed(tables: dict[str, Path]) -> None:
    done = clean(run_once("improve", TRIGLIDE, tables["step"], "--only", "unexplained@q2", "--json"))
    assert [(s["effect"], s["at"], s["accepted"]) for s in done.json["steps"]] == [("unexplained", "q2", True)]
    other = clean(run_once("improve", TRIGLIDE, tables["step"], "--only", "unexplained@q3", "--json"))
    assert not [s for s in other.json["steps"] if s["at"] != "q3"]


@pytest.mark.slow
def test_the_verdict_and_the_end_say_that_only_some_were_tested(tables: dict[str, Path]) -> None:
    """A scale of q1 looks like noise to that of q3 alone; no verdict is one about all effects."""
    done = clean(run_once("improve", TRIGLIDE, tables["scaled"], "--only", "scale@q3"))
    lines = done.out.splitlines() + done.err.splitlines()
    for lead in ("diagnosis: ", "stopped: "):
        (line,) = [line for line in lines if line.startswith(lead)]
        assert "only scale@q3 was tested" in line, line
    assert not [line for line in lines if line.startswith("nothing to improve")]


@pytest.mark.parametrize(
    ("name", "message", "remedy"),
    [
        ("unexplained@q4", "has no effect `unexplained@q4`", "name one of unexplained@q1, unexplained@q2, "),
        ("unexplained@q2:time", "this table cannot show `unexplained@q2:time`", "column `time`"),
    ],
)
def test_places_that_cannot_be_tested_are_refused(
    tables: dict[str, Path], tmp_path: Path, name: str, message: str, remedy: str
) -> None:
    lines = [line.split(",") for line in tables["step"].read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    kept = [k for k, cell in enumerate(lines[0]) if not cell.startswith("time")]
    table = tmp_path / "t.csv"
    table.write_text("".join(",".join(line[k] for k in kept) + "\n" for line in lines), encoding="utf-8")
    done = clean(run("improve", TRIGLIDE, table, "--only", name))
    assert done.code == 2 and message in done.err and remedy in done.err
