"""Readings that look wrong: a fit that does not soon explain them is given up, and nothing is identified."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from pkmcal_cli.calibration import identify, step
from pkmcal_cli.calibration.fit import ABANDONED
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.prediction import solving
from pkmcal_cli.workflow import calibration
from tests.command import MACHINES, clean, run
from tests.hangprinter_cases import measured

ENOUGH = 4 * 3
"""Trials of four steps, each refused twice before; a fit to the end takes 45 and more."""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def trials(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """A list that grows with each prediction that a step tries."""
    tried: list[Any] = []
    plain = step._moved
    monkeypatch.setattr(step, "_moved", lambda *given: tried.append(None) or plain(*given))
    return tried


def exchanged(machine: str, one: str, other: str) -> tuple[Path, str]:
    """The machine's file, and its table with two columns exchanged."""
    text = (MACHINES / f"{machine}.csv").read_text()
    head = next(line for line in text.splitlines() if not line.startswith("#"))
    swapped = head.replace(f"{one} [", "? [").replace(f"{other} [", f"{one} [").replace("? [", f"{other} [")
    Path("t.csv").write_text(text.replace(head, swapped))
    return MACHINES / f"{machine}.yaml", "t.csv"


@pytest.mark.parametrize(("one", "other", "why"), [("x", "y", "needs damping"), ("y", "z", "gains little")])
def test_nothing_is_identified_from_columns_that_look_exchanged(
    one: str, other: str, why: str, trials: list[Any]
) -> None:
    """The fit of each takes over a minute to its end, which is none."""
    done = clean(run("calibrate", *exchanged("gantry", one, other), "-o", "p.yaml", "--json"))
    assert done.code == 1 and 3 <= len(trials) <= ENOUGH, why
    found = done.json
    assert (found["status"], found["stopped"], found["parameters"]) == ("not_converged", "abandoned", [])
    assert found["before"] == found["after"] and f"`{one}`" in done.err and f"`{other}`" in done.err
    kept = yaml.safe_load(Path("p.yaml").read_text())["parameters"]
    assert {(p["std"], p["identified"]) for p in kept.values()} == {(None, False)}
    assert kept["sx"]["value"] == 1.0 and kept["x0"]["value"] == 0.0, "as they were at the start"


@pytest.mark.parametrize("machine", ["biglide", "hexapod7"])  # with parameters that are held, and without any
def test_people_read_what_to_do(machine: str) -> None:
    done = clean(run("calibrate", *exchanged(machine, "x", "y"), "-o", "p.yaml"))
    assert done.code == 1 and "NOT FITTED" in done.err and "`--accept`" in done.err
    assert "Parameters" not in done.err and "of freedom" not in done.err


def test_rows_without_a_prediction_are_not_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """With two drives exchanged some rows have no pose; fits of the others would lead nowhere."""
    sought: list[Any] = []
    monkeypatch.setattr(identify, "led", lambda *given: sought.append(given) or given[2])
    done = clean(run("calibrate", *exchanged("five-bar", "q1", "q2"), "-o", "p.yaml"))
    assert done.code == 1 and not sought and "11 of 40 rows are not used" in done.err


def test_what_is_lost_at_some_values_is_not_looked_for_again_at_them(monkeypatch: pytest.MonkeyPatch) -> None:
    machine, table = exchanged("five-bar", "q1", "q2")
    loaded = load_machine(str(machine))
    problem = problem_of(loaded.model, load_measurements(loaded, [table]))
    first = evaluate(problem, problem.model.nominal)
    lost = ~first.prediction.solved
    assert lost.sum() == 11
    monkeypatch.setattr(solving, "_from_reference", lambda *given: pytest.fail("looked for"))
    again = evaluate(problem, problem.model.nominal, None, first.start)
    assert (again.prediction.solved == ~lost).all()
    assert again.prediction.values[~lost] == pytest.approx(first.prediction.values[~lost], abs=1e-12)


def test_an_abandoned_fit_is_none_even_where_chi_square_stood_still() -> None:
    problem, _ = measured("2021-12-16")
    settled = identify.identify(problem, select(problem.model, "auto"))
    fit = replace(settled, status="not_converged", flat=True)
    assert fit.usable and not replace(fit, stopped=ABANDONED).usable


@pytest.mark.parametrize(("more", "wrong_table"), [((), True), (("--accept",), False)])
def test_who_accepts_readings_has_them_fitted(
    more: tuple[str, ...], wrong_table: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[bool] = []
    plain = calibration.calibrated

    def asked(*given: Any, **options: Any) -> Any:
        told.append(options["wrong_table"])
        return plain(*given, **options)

    monkeypatch.setattr(calibration, "calibrated", asked)
    run("calibrate", *exchanged("five-bar", "q1", "q2"), "-o", "p.yaml", *more)
    assert told == [wrong_table]
