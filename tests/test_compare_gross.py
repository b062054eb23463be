"""`compare` of machine files by a table that has gross mistakes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from pkmcal_cli.calibration import paired_errors
from pkmcal_cli.calibration.fit import Fit
from tests.campaign_tables import true_values, write_table
from tests.command import MACHINES, run

BIGLIDE = str(MACHINES / "biglide.yaml")


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Forty rows of a Biglide."""
    return Path(write_table(tmp_path / "a.csv", "biglide", true_values("biglide", 5), 1, 40))


def test_a_gross_row_is_left_out_of_the_same_rows(table: Path, tmp_path: Path) -> None:
    """Else its fits take a minute, and end with 60 mm of held-out error."""
    lines = table.read_text().splitlines()
    column = next(k for k, name in enumerate(lines[0].split(",")) if name.startswith("x"))
    cells = lines[5].split(",")
    cells[column] = str(float(cells[column]) + 100)  # mm
    wrong = tmp_path / "b.csv"
    wrong.write_text("\n".join([*lines[:5], ",".join(cells), *lines[6:]]) + "\n")
    done = [run("compare", BIGLIDE, BIGLIDE, file, "--json") for file in (table, wrong)]
    assert "1 row far from what the others predict left out" in done[1].err and "b.csv:6" in done[1].err
    rms = [json.loads(one.out)["rms"][0] for one in done]
    assert rms[1] == pytest.approx(rms[0], rel=0.1)


def test_a_table_with_gross_mistakes_compares_nothing(table: Path) -> None:
    text = table.read_text()
    table.write_text(text.replace("x [", "z [").replace("y [", "x [").replace("z [", "y ["))
    done = run("compare", BIGLIDE, BIGLIDE, table)
    assert done.code == 3 and "error[plausibility]" in done.err


def test_rows_that_neither_machine_explains_compare_nothing(table: Path) -> None:
    """Units of two columns changed: fits of the folds took half a minute, and ended with "no difference"."""
    head, *rows = table.read_text().splitlines()
    table.write_text("\n".join([head.replace("q2 [mm]", "q2 [um]").replace("x [mm]", "x [um]"), *rows[:11]]) + "\n")
    done = run("compare", BIGLIDE, BIGLIDE, table)
    assert done.code == 3 and "error[plausibility]" in done.err and "neither machine explains these rows" in done.err


def ending(monkeypatch: pytest.MonkeyPatch, folds: int, status: str, flat: bool) -> None:
    """The first fits without a fold end otherwise than they do."""
    real: Callable[..., Fit] = paired_errors.refit
    fits: list[Fit] = []

    def odd(*arguments: object) -> Fit:
        fits.append(real(*arguments))
        return replace(fits[-1], status=status, flat=flat) if len(fits) <= folds else fits[-1]

    monkeypatch.setattr(paired_errors, "refit", odd)


def test_a_few_rows_of_many_tell_of_no_machine(table: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that the fits of other folds leave need not be like the rest; it is told why these are not predicted."""
    short = tmp_path / "short.yaml"
    held = "x8: {nominal: 361, identify: false}, l3: {identify: false}"
    short.write_text(f"extends: {BIGLIDE}\nparameters: {{{held}}}\n")
    ending(monkeypatch, 3, "not_converged", flat=False)
    done = run("compare", BIGLIDE, short, table, "-q", "--json", "--fail-above", "heldout 1 m")
    assert done.code == 1 and done.json["verdict"] == "too few rows" and done.json["better"] is None
    assert (done.json["count"], done.json["rows"]) == (16, 40) and not done.json["gates"][0]["kept"]
    assert "NOTHING TO COMPARE: 24 of 40 rows are not predicted by both" in done.err
    assert f"{BIGLIDE}: 3 of 5 fits without a fold failed (not converged)" in done.err


def test_a_fit_that_creeps_where_nothing_changes_predicts(table: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ending(monkeypatch, 3, "not_converged", flat=True)
    done = run("compare", BIGLIDE, BIGLIDE, table, "--json")
    assert done.code == 0 and done.json["count"] == 40 and "not predicted" not in done.err
