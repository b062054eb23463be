"""The shipped measurement files are what the generator writes, and their sidecars say how they came about."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from . import dimensions as dim
from .generate import FOLDER, campaigns, provenance

CAMPAIGNS = campaigns()
UNITS = {"mm": dim.MM, "rad": 1.0, "deg": np.radians(1), "kN/mm": dim.KN_PER_MM}


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_shipped_file_is_the_generators(name: str) -> None:
    campaign = CAMPAIGNS[name]
    channels = campaign.machine.channels
    table = np.loadtxt(FOLDER / f"{name}.csv", delimiter=",", skiprows=1)
    travel, readings = np.split(table[:, 1:], [len(campaign.machine.drives)], axis=1)
    scale = np.array([1.0 if c.startswith("r") else dim.MM for c in channels])
    assert np.abs(travel * dim.MM - campaign.set_values()).max() < 1.1e-9
    assert np.abs(readings * scale - campaign.readings()).max() < 1.1e-9
    noise = readings * scale - campaign.true_readings()
    sigma = np.array([campaign.noise_angle if c.startswith("r") else campaign.noise for c in channels])
    assert np.sqrt((noise**2).mean(0)) / sigma == pytest.approx(1, abs=0.25)


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_sidecar_holds_the_planted_values(name: str) -> None:
    campaign = CAMPAIGNS[name]
    sidecar = yaml.safe_load((FOLDER / f"{name}.csv.provenance.yaml").read_text(encoding="utf-8"))
    told = sidecar["planted"].pop("parameters")
    expected = {**provenance(name, campaign)}
    expected["planted"] = {n: v for n, v in expected["planted"].items() if n != "parameters"}
    assert sidecar == expected
    values = {n: entry["value"] * UNITS[entry["unit"]] for n, entry in told.items()}
    assert values == pytest.approx(campaign.planted(), rel=1e-12)
    for parameter, value in values.items():
        deviation = abs(value - campaign.machine.nominal[parameter])
        assert deviation <= 2 * campaign.machine.ranges[parameter]


def test_both_triglides_are_one_machine() -> None:
    redundant, part = (CAMPAIGNS[name] for name in ("triglide", "triglide-nonredundant"))
    assert part.planted().items() <= redundant.planted().items()
