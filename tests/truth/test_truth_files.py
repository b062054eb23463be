"""The shipped measurement files are what the generator writes, and their sidecars say how they came about."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from tests.in_ci import in_ci

from . import dimensions as dim
from . import self_measured_tables as own
from .generate import FOLDER, campaigns, provenance
from .sidecar import sha256_of

CAMPAIGNS = campaigns()
LONG = ("gantry", "gantry-bow", "hexapod7")
"""Tables whose simulator takes seconds: frames of beam elements."""
TABLES = own.tables()
UNITS = {"mm": dim.MM, "rad": 1.0, "deg": np.radians(1), "kN/mm": dim.KN_PER_MM, "1": 1.0}


@pytest.mark.parametrize("name", in_ci([n for n in CAMPAIGNS if n not in LONG], CAMPAIGNS))
def test_shipped_file_is_the_generators(name: str) -> None:
    campaign = CAMPAIGNS[name]
    channels = campaign.channels
    table = np.loadtxt(FOLDER / f"{name}.csv", delimiter=",", skiprows=1)
    travel, readings = np.split(table[:, 1:], [len(campaign.machine.drives)], axis=1)
    scale = np.array([{"r": 1.0, "f": 1e3}.get(c[0], dim.MM) for c in channels])  # of the file's units, SI
    last = np.array([1e-9 if c.startswith("r") else 1e-6 for c in channels])  # digit of the file
    assert np.abs(travel * dim.MM - campaign.set_values()).max() < 1.1e-9
    assert (np.abs(readings - campaign.readings() / scale) / last).max() < 1.1
    noise = readings * scale - campaign.true_readings()
    sigma = np.array([campaign.sigma(c) for c in channels])
    assert np.sqrt((noise**2).mean(0)) / sigma == pytest.approx(1, abs=0.25)


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_sidecar_holds_the_planted_values(name: str) -> None:
    campaign = CAMPAIGNS[name]
    sidecar = yaml.safe_load((FOLDER / f"{name}.csv.provenance.yaml").read_text(encoding="utf-8"))
    told, digest = sidecar["planted"].pop("parameters"), sidecar.pop("sha256")
    assert digest == sha256_of(FOLDER / f"{name}.csv")
    expected = {**provenance(name, campaign)}
    expected["planted"] = {n: v for n, v in expected["planted"].items() if n != "parameters"}
    assert sidecar == expected
    values = {n: entry["value"] * UNITS[entry["unit"]] for n, entry in told.items()}
    assert values == pytest.approx(campaign.planted(), rel=1e-12)
    for parameter, value in values.items():
        deviation = abs(value - campaign.machine.nominal[parameter])
        assert deviation <= 2 * campaign.machine.ranges[parameter]


@pytest.mark.parametrize("name", TABLES)
def test_shipped_file_of_a_machine_that_measures_itself(name: str) -> None:
    """To the last digit of the file; noise as declared."""
    table = TABLES[name]
    header, rows = own.cells(table)
    lines = [line.split(",") for line in (FOLDER / f"{name}.csv").read_text(encoding="utf-8").splitlines()]
    assert lines[0] == header and len(lines) == len(rows) + 1
    for told, made in zip(lines[1:], rows, strict=True):
        for a, b in zip(told, made, strict=True):
            assert a == b or float(a) == pytest.approx(float(b), abs=1.1 * 10**-own.DIGITS)
    noise = (table.readings() - table.true_readings()) / table.channel_sigma()
    drives = (table.positions() - table.set_values())[:, table.drive_sigma() > 0]
    drives /= table.drive_sigma()[table.drive_sigma() > 0]
    for column in (*noise.T, *drives.T):
        seen = column[~np.isnan(column)]
        assert np.sqrt((seen**2).mean()) == pytest.approx(1, abs=3 / np.sqrt(2 * len(seen)))


@pytest.mark.parametrize("name", TABLES)
def test_sidecar_of_a_machine_that_measures_itself(name: str) -> None:
    table = TABLES[name]
    sidecar = yaml.safe_load((FOLDER / f"{name}.csv.provenance.yaml").read_text(encoding="utf-8"))
    told, made = sidecar["planted"].pop("parameters"), dict(own.provenance(table))
    made["planted"] = {k: v for k, v in made["planted"].items() if k != "parameters"}
    assert sidecar.pop("sha256") == sha256_of(FOLDER / f"{name}.csv")
    assert sidecar == made
    values = {n: entry["value"] * dim.UNITS[entry["unit"]] for n, entry in told.items()}
    assert values == pytest.approx(table.planted(), rel=1e-12)
    for parameter, value in values.items():
        deviation = abs(value - table.machine.nominal[parameter])
        assert deviation <= 2 * table.machine.ranges.get(parameter, 0.0)


def test_both_triglides_are_one_machine() -> None:
    redundant, part = (CAMPAIGNS[name] for name in ("triglide", "triglide-nonredundant"))
    assert part.planted().items() <= redundant.planted().items()
