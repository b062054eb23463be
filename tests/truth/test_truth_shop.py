"""The campaigns with undeclared effects: curves, noise, bad rows, circumstances, tables, the shop-floor file."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from numpy.polynomial import Legendre

from . import shopfloor
from .campaigns import MACHINES, Planted, Scenario, campaign, unit, unknown_families
from .noise_true import unit_noise
from .shop_shapes import curve, settling
from .test_truth_campaigns import rms


@pytest.mark.parametrize("order", range(1, 7))
def test_curves_have_the_named_coefficient_and_a_ripple(order: int) -> None:
    u = np.linspace(-1, 1, 2001)
    named = Legendre.basis(order)(u)
    pure, rippled = curve(u, {order: 1.0}, 0), curve(u, {order: 1.0})
    assert rms(pure - named) < 0.11 * rms(named)
    assert 0.1 < rms(rippled - named) / rms(named) < 0.25
    assert 0.1 < rms(settling(u, 1.0) - u) / rms(u) < 0.25


@pytest.mark.parametrize(("kind", "fourth"), [("normal", 3.0), ("t4", 6.0), ("ar1", 3.0)])
def test_noise_has_variance_one(kind: str, fourth: float) -> None:
    drawn = unit_noise(kind, 40000, 2, np.random.default_rng(1))
    assert drawn.var(0) == pytest.approx(1, abs=0.08)
    assert (drawn**4).mean() > fourth - 0.3
    neighbours = (drawn[1:] * drawn[:-1]).mean(0)
    assert neighbours == pytest.approx(0.7 if kind == "ar1" else 0, abs=0.05)


def test_noise_and_bad_rows_of_a_campaign() -> None:
    measured = campaign("scissors", [], 1, 2000, Scenario(sigma_factor=1.2))
    assert rms(measured.readings - measured.true_readings) == pytest.approx(1.2 * 0.5e-6, rel=0.05)
    assert measured.sigma == pytest.approx(0.5e-6) and not measured.outlier.any()
    spoilt = campaign("scissors", [], 1, 2000, Scenario(outliers=0.015))
    plain = campaign("scissors", [], 1, 2000)
    assert spoilt.outlier.sum() == 30
    shift = np.linalg.norm(spoilt.readings - plain.readings, axis=1) / 0.5e-6
    assert (shift[~spoilt.outlier] == 0).all()
    assert shift[spoilt.outlier].min() >= 8 and shift[spoilt.outlier].max() <= 30


@pytest.mark.parametrize("machine", MACHINES)
def test_unknown_effects_have_their_rms(machine: str) -> None:
    plain = campaign(machine, [], 1).true_readings
    for keyword, at in unknown_families(machine):
        step = campaign(machine, [Planted(keyword, at, {"rms": 7e-6})], 1).true_readings - plain
        assert rms(step) == pytest.approx(7e-6, rel=0.05), keyword


def test_a_seed_gives_a_campaign_and_a_stream_another_day_hour() -> None:
    planted = [unit("delta4", "pitch_curve", "q1", 1), unit("delta4", "smooth_field", "tracker", 1)]
    first, same = (campaign("delta4", planted, 1).csv_text() for _ in range(2))
    other = campaign("delta4", planted, 1, scenario=Scenario(stream=1))
    assert first == same != other.csv_text()
    assert other.parameters == campaign("delta4", [], 1).parameters != campaign("delta4", [], 2).parameters


@pytest.mark.parametrize("machine", MACHINES)
def test_circumstances_are_independent_of_each_other_and_of_the_pose(machine: str) -> None:
    rows = campaign(machine, [], 1, 2000).conditions
    circumstances = np.column_stack([rows.payload, rows.direction])
    rest = np.column_stack([rows.time, rows.temperature, rows.poses[:, :2]])
    related = np.corrcoef(np.column_stack([circumstances, rest]).T) - np.eye(circumstances.shape[1] + 4)
    assert np.abs(related[: circumstances.shape[1]]).max() < 0.1
    assert np.abs(related[-4:-2, -2:]).max() < 0.1 and abs(related[-4, -3]) < 0.6


def test_columns_of_the_table() -> None:
    text = campaign("triglide", [], 1, 9, Scenario(omit=("T", "dir.*"), sessions=3)).csv_text().splitlines()
    assert text[0] == "id,time [s],session,payload [kg],q1 [mm],q2 [mm],q3 [mm],x [mm],y [mm]"
    assert [line.split(",")[2] for line in text[1:]] == ["s1"] * 3 + ["s2"] * 3 + ["s3"] * 3
    sequential = campaign("triglide", [], 1, 60, Scenario(ordering="sequential")).conditions
    assert (np.diff(sequential.payload) >= 0).all()
    assert (np.sign(np.diff(sequential.q, axis=0)) == sequential.direction[1:]).all()
    twice = campaign("triglide", [], 1, 60, Scenario(repeated=10)).conditions
    assert len(twice.q) == 60 and (np.diff(twice.q[:, 0]) == 0).sum() == 10


def test_the_shop_floor_table_is_the_generators() -> None:
    shipped = (shopfloor.FOLDER / f"{shopfloor.NAME}.csv").read_text(encoding="utf-8")
    measured = shopfloor.shopfloor()
    table, here = (np.genfromtxt(t.splitlines()[1:], delimiter=",")[:, 1:] for t in (shipped, measured.csv_text()))
    assert shipped.splitlines()[0].startswith("id,time [s],T [degC],dir.q1,")
    assert np.abs(table - here).max() < 1.1e-6
    assert np.flatnonzero(measured.outlier).tolist() == [36]


def test_the_sidecar_of_the_shop_floor_does_not_tell_the_answer() -> None:
    text = (shopfloor.FOLDER / f"{shopfloor.NAME}.csv.provenance.yaml").read_text(encoding="utf-8")
    assert not any(effect.keyword in text for effect in shopfloor.PLANTED)
    true = yaml.safe_load(text)["planted"]["parameters"]
    measured = shopfloor.shopfloor().parameters
    units = {"mm": 1e-3, "rad": 1.0}
    assert {n: v["value"] * units[v["unit"]] for n, v in true.items()} == pytest.approx(measured, rel=1e-12)
