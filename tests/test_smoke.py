"""Does the installation work? `python -m pytest -m smoke`, a few seconds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.command import HANGPRINTER, HANGPRINTER_DATA, TRIGLIDE, TRIGLIDE_DATA, clean, process, run
from tests.shipped import TABLES, machine_of

pytestmark = pytest.mark.smoke


def test_the_program_starts() -> None:
    done = process("--version")
    assert done.code == 0 and done.out.startswith("pkmcal ")


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.stem)
def test_shipped_machines_and_tables_have_no_faults(table: Path) -> None:
    assert clean(run("check", machine_of(table), table)).code == 0


def test_a_simulated_machine_is_found_again(tmp_path: Path) -> None:
    """The rod l3 made 0.05 mm longer: found within four standard uncertainties and the rounding of the table."""
    longer, table = tmp_path / "longer.yaml", tmp_path / "table.csv"
    longer.write_text("parameters: {l3: 600.05}\n", encoding="utf-8")
    arguments = ("--grid", "x=200:700:6,y=160:390:6", "-p", longer, "--noise", "declared", "--seed", "7")
    assert clean(run("simulate", TRIGLIDE, *arguments, "-o", table)).code == 0
    done = clean(run("calibrate", TRIGLIDE, table, "--select", "l3", "--json"))
    (l3,) = (p for p in json.loads(done.out)["parameters"] if p["name"] == "l3")
    assert abs(l3["value"] - 600.05) < 4 * l3["std_by_data"] < 0.05


def test_real_data_are_calibrated_and_diagnosed() -> None:
    assert clean(run("calibrate", HANGPRINTER, HANGPRINTER_DATA, "--select", "auto,R_*")).code == 0
    found = json.loads(clean(run("diagnose", TRIGLIDE, TRIGLIDE_DATA, "--json")).out)
    assert found["verdict"] == "clean"
