"""`compare` of machine files by a table that has gross mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

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
