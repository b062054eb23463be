"""What is said about the shipped tables is true: units of planted values, digits of real readings."""

from __future__ import annotations

import csv

import pytest
import yaml

from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.language.machine_yaml import read_machine
from tests.command import MACHINES

SIDECARS = sorted(MACHINES.glob("*.provenance.yaml"))
KINDS = {"mm": "length", "rad": "angle", "deg": "angle", "N": "force", "kN/mm": "stiffness", "1": "plain number"}


@pytest.mark.parametrize("file", SIDECARS, ids=lambda f: str(f.name).partition(".")[0])
def test_planted_values_have_the_units_of_the_machines_parameters(file) -> None:  # type: ignore[no-untyped-def]
    told = yaml.safe_load(file.read_text(encoding="utf-8"))
    name = told["data"].removesuffix(".csv").removesuffix("-shopfloor").removesuffix("-bow")
    machine = compile_machine(read_machine(MACHINES / f"{name}.yaml")).model
    kinds = {p.name: p.dimension for p in machine.parameters}
    for parameter, entry in told["planted"]["parameters"].items():
        assert KINDS[entry["unit"]] == kinds[parameter], parameter


@pytest.mark.parametrize("session", ["2021-12-16", "2022-04-12"])
def test_motor_readings_are_not_rounded(session: str) -> None:
    """The encoders were written to 0.01 deg. Rounded to six digits, those of 10000 deg and more would end with 0."""
    with (MACHINES / f"hangprinter_{session}.csv").open(encoding="utf-8") as file:
        readings = [row[f"motor_{d}_deg"] for row in csv.DictReader(file) for d in "abcd"]
    large = [r for r in readings if len(r.lstrip("-").partition(".")[0]) == 5]
    fine = [r for r in large if len(r.partition(".")[2]) == 2]
    assert len(large) > 20 and len(fine) > 0.8 * len(large)
