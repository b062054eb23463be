"""Rows that are wrong by far in tables of any size: they are named, nothing else is, and effects are no such rows."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pkmcal_cli.diagnosis.gross_rows import gross_rows
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from tests.benchmark.setting import diagnosed, ready
from tests.in_ci import in_ci
from tests.truth.campaigns import MACHINES, Campaign, Planted, Scenario, campaign

ALPHA = 1e-3


def spoilt(machine: str, rows: int, seed: int, count: int = 3) -> tuple[Campaign, set[int]]:
    """A campaign without anything missing, of which some rows are 20 to 60 sigma off in any direction."""
    measured = campaign(machine, [], seed, rows=rows, scenario=Scenario(sessions=1))
    rng = np.random.default_rng([seed, 5])
    bad = rng.choice(rows, count, replace=False)
    shift = rng.normal(size=(count, measured.readings.shape[1]))
    shift *= rng.uniform(20, 60, (count, 1)) / np.linalg.norm(shift, axis=1, keepdims=True)
    readings = measured.readings.copy()
    readings[bad] += shift * measured.sigma
    return replace(measured, readings=readings), {int(r) for r in bad}


def named(d: Diagnosis) -> list[str]:
    return [f.hypothesis.name for f in d.findings] + ["unknown"] * len(d.unknown)


@pytest.mark.parametrize(
    ("machine", "rows"), in_ci(["triglide-12", "scissors-30", "delta4-12"], product(MACHINES, [12, 30]))
)
def test_three_rows_are_found_in_small_tables(machine: str, rows: int) -> None:
    measured, bad = spoilt(machine, rows, 1)
    found = diagnosed(measured, 1)
    assert set(found.bad_rows) == bad and found.verdict == "measurement_fault" and not named(found)


@pytest.mark.parametrize("machine", in_ci(["scissors"], MACHINES))
def test_five_rows_of_sixty_are_no_noise(machine: str) -> None:
    """A beam that was lost now and then: up to a tenth of the rows, not "sigma is too small"."""
    measured, bad = spoilt(machine, 60, 1, count=5)
    found = diagnosed(measured, 1)
    assert set(found.bad_rows) == bad and found.verdict == "measurement_fault" and not named(found)


@pytest.mark.slow
@pytest.mark.parametrize("rows", [12, 30])
def test_rows_of_many_small_tables(rows: int) -> None:
    """At least 95 % of the rows in tables of 12, all in tables of 30, fewer than 0.5 % of the good ones lost."""
    found = lost = good = planted = 0
    names: list[str] = []
    for machine in MACHINES:
        for seed in range(25):
            measured, bad = spoilt(machine, rows, seed)
            d = diagnosed(measured, seed)
            found, planted = found + len(bad & set(d.bad_rows)), planted + len(bad)
            lost, good = lost + len(set(d.bad_rows) - bad), good + rows - len(bad)
            names += named(d)
    assert found >= (0.95 if rows == 12 else 1.0) * planted
    assert lost < 0.005 * good and names == []


def test_rows_of_a_long_table() -> None:
    """Starts are tried on a sample of it; all rows are judged."""
    measured, bad = spoilt("triglide-nonredundant", 2600, 3, count=60)
    r = ready(measured)
    rows, fit = gross_rows(r.problem, r.selected, ALPHA, 0)
    assert set(rows) == bad and fit is not None and fit.chi2_per_dof < 1.1


@pytest.mark.parametrize("noise", ["normal", "t4"])
def test_good_tables_lose_no_row(noise: str) -> None:
    for machine in MACHINES:
        for rows in (12, 30, 192):
            measured = campaign(machine, [], 2, rows=rows, scenario=Scenario(sessions=1, noise=noise))
            r = ready(measured)
            assert gross_rows(r.problem, r.selected, ALPHA, 0) == ((), None), (machine, rows)


def test_an_effect_that_few_rows_feel_is_no_gross_row() -> None:
    """A zero that is off by 40 sigma in a session of three rows: one cause, not three wrong rows."""
    planted = [Planted("zero", "q1[s2]", {"o": 400e-6})]
    whole = campaign("triglide-nonredundant", planted, 3, rows=192)
    second = np.nonzero(whole.conditions.session == 2)[0][:3]
    first = np.nonzero(whole.conditions.session == 1)[0][:40]
    keep = np.concatenate([first, second])
    lines = whole.csv_text().splitlines()
    text = "\n".join([lines[0], *(lines[1 + k] for k in keep), ""])
    found = diagnosed(_Text(whole, text), 3)  # type: ignore[arg-type]
    assert not found.bad_rows and "zero@q1[s2]" in named(found)


class _Text:
    """A campaign's table with some of its rows."""

    def __init__(self, measured: Campaign, text: str) -> None:
        self.machine, self.text = measured.machine, text

    def csv_text(self) -> str:
        """The table."""
        return self.text
