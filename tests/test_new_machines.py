"""Shipped machines that measure themselves: engine against independent simulators, and calibration of their data."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.observability_indices import observability
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.tables.measurements import read_measurements
from tests.command import MACHINES, run
from tests.in_ci import in_ci
from tests.support import errors_of, model
from tests.truth.belts import BeltRouter
from tests.truth.self_measured_tables import DIGITS, Table, tables

TABLES = tables()
NAMES = tuple(TABLES)
COUNTS = {"belt-router": (2, 4, 2, 116), "five-bar": (2, 2, 0, 120), "delta-printer": (3, 3, 0, 11)}
"""Degrees of freedom, drives, redundancy, measured values: 52 rows with two lower belts and 12 distances; 40 rows with
three readings; 11 heights."""

AGREE = {"belt-router": 3e-13, "five-bar": 1e-14, "delta-printer": 1e-14}


def vector(machine: Model, values: dict[str, float]) -> Array:
    """Parameter values (P,) by name."""
    return np.array([values[n] for n in machine.names])


def rows_of(table: Table) -> Rows:
    """Where the drives really are."""
    return replace(Rows.at(table.positions()), partner=table.partner)


@cache
def shipped(name: str) -> Problem:
    """The shipped data as read by the engine."""
    machine = read_machine(MACHINES / f"{name}.yaml")
    return problem_of(model(name), read_measurements([MACHINES / f"{name}.csv"], machine))


def selected(name: str) -> tuple[str, ...]:
    """What is identified: without the origin of the belt router's frame."""
    return tuple(n for n in select(model(name), "auto") if n in TABLES[name].machine.ranges)


def largest(name: str, values: dict[str, float]) -> Array:
    """Largest deviation (C,) of the engine from the simulator by channel over the rows, m (belts: travel) and rad."""
    machine, table = model(name), TABLES[name]
    found = predict(machine, vector(machine, values), rows_of(table))
    assert found.solved.all()
    true = table.machine.read(table.positions(), values, table.partner)
    assert [c.name for c in machine.channels] == list(table.machine.channels)
    assert (np.isnan(found.values) == np.isnan(true)).all()
    gains = dict(zip(table.machine.drives, table.machine.gains(values), strict=True))
    travel = np.array([gains.get(c, 1.0) for c in table.machine.channels])
    return np.asarray(np.nanmax(np.abs(found.values - true) * travel, axis=0))


@pytest.mark.parametrize("name", NAMES)
def test_the_planted_machine_reads_as_the_independent_simulator_says(name: str) -> None:
    """All channels in all rows; 9e-14 m for belts of up to 3 m, 1e-15 m and rad for the closed forms."""
    assert largest(name, TABLES[name].planted()).max() < AGREE[name]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(3))
def test_machines_with_errors_everywhere_read_so_too(name: str, seed: int) -> None:
    """Every parameter is off, those that are not identified too: drums, stiffness of belts, the origin."""
    values = errors_of(model(name), 3e-4, seed)
    assert largest(name, values).max() < AGREE[name]


@pytest.mark.parametrize("name", NAMES)
def test_check_has_nothing_to_say(name: str) -> None:
    done = run("check", MACHINES / f"{name}.yaml", MACHINES / f"{name}.csv", "--json")
    assert done.code == 0 and done.json["faults"] == [] == done.json["warnings"], done.err
    told = [done.json[k] for k in ("degrees_of_freedom", "actuators", "degree_of_redundancy")]
    assert (*told, done.json["measurements"]["n_values"]) == COUNTS[name]
    assert done.json["self_stress"] == 0


@cache
def calibrated(name: str) -> dict[str, Any]:
    done = run("calibrate", MACHINES / f"{name}.yaml", MACHINES / f"{name}.csv", "--json", "-q", "--holdout", "none")
    assert done.code == 0, done.err
    return dict(done.json)


@pytest.mark.parametrize("name", in_ci(["belt-router", "delta-printer"], NAMES))
def test_calibration_finds_the_planted_values(name: str) -> None:
    """All within four standard uncertainties; chi-square within three standard deviations of its expectation."""
    result, table = calibrated(name), TABLES[name]
    assert result["status"] == "converged"
    dof = result["chi2"] / result["chi2_per_dof"]
    assert result["chi2"] == pytest.approx(dof, abs=3 * np.sqrt(2 * dof))
    scale = {p.name: p.unit for p in model(name).parameters}
    found = {p["name"]: p for p in result["parameters"] if p["name"] in table.machine.ranges}
    assert found.keys() == table.machine.ranges.keys()
    for n, true in table.planted().items():
        if n in found:
            assert found[n]["std"] is not None, n
            assert scale[n] == table.machine.unit(n)
            off = found[n]["value"] - true / UNIT[scale[n]]
            assert abs(off) < 4 * found[n]["std"], n


UNIT = {"mm": 1e-3, "deg": np.pi / 180, "N": 1.0}
WEAK = {"belt-router": {"TLx", "TRx", "TRy", "BRy"}, "delta-printer": {"rod", "radius", "stop1", "stop2", "stop3"}}
"""What the data hardly tell: a turn of the belt router against gravity; the delta's rod against its stops."""
NEARLY_WEAK = {"belt-router": {"TLx", "BRx", "zeroTL", "zeroTR", "zeroBL", "zeroBR"}}
"""What they tell to 0.556 ranges, where half a range is the limit: all zeros together against the width."""


@pytest.mark.parametrize("name", NAMES)
def test_what_is_not_determined_is_told(name: str) -> None:
    told = calibrated(name)["undetermined"]
    expected = [s[name] for s in (WEAK, NEARLY_WEAK) if name in s]
    assert all(u["kind"] == "weak" for u in told)
    assert sorted(sorted(u["parameters"]) for u in told) == sorted(sorted(names) for names in expected)


@pytest.mark.parametrize("name", NAMES)
def test_without_noise_the_planted_values_come_back(name: str) -> None:
    """Also what is weak in the shipped data: to 1e-6 of the range, the turn of the belt router to 1e-4."""
    problem, table = shipped(name), TABLES[name]
    exact = replace(
        problem,
        rows=rows_of(table),
        readings=table.true_readings(),
        sigma=np.full(problem.sigma.shape, 1e-12),
        drive_sigma=np.zeros_like(problem.drive_sigma),
    )
    fit = identify(exact, selected(name))
    assert fit.status == "converged" and not fit.directions.held.any()
    k = [problem.model.names.index(n) for n in fit.selected]
    off = (fit.values - vector(problem.model, table.planted()))[k] / problem.model.ranges[k]
    assert np.abs(off).max() < (1e-4 if name == "belt-router" else 1e-6)


def test_the_shipped_tables_are_read_as_they_were_made() -> None:
    """Units, the rows that distances join, and that nothing else is measured."""
    for name, table in TABLES.items():
        problem = shipped(name)
        digit = 10.0**-DIGITS
        assert problem.readings == pytest.approx(table.readings(), nan_ok=True, abs=2 * np.pi * digit)
        held = [k for k, d in enumerate(table.machine.drives) if d not in table.machine.channels]
        assert problem.rows.readings[:, held] == pytest.approx(table.set_values()[:, held], rel=1e-14)
        placed = np.isin(np.arange(len(table.drive_sigma())), held)  # what the others read is measured
        assert problem.drive_sigma / table.machine.gains(table.machine.nominal) == pytest.approx(
            np.tile(np.where(placed, table.drive_sigma(), 0.0), (len(problem), 1))
        )
        stated = np.where(np.isnan(table.readings()), np.nan, table.channel_sigma())
        assert np.where(problem.measured, problem.sigma, np.nan)[:, :1] == pytest.approx(stated[:, :1], nan_ok=True)
        if (table.partner >= 0).any():
            assert problem.rows.partner is not None and (problem.rows.partner == table.partner).all()


def test_all_belts_stay_taut() -> None:
    """The nominal machine and the planted one: more than 10 N in every belt in every row."""
    table = TABLES["belt-router"]
    assert isinstance(table.machine, BeltRouter)
    for values in (dict(table.machine.nominal), table.planted()):
        _, tension = table.machine.places(table.positions(), values)
        assert tension.min() > 10.0
    found = predict(model("belt-router"), model("belt-router").nominal, rows_of(table), Request(forces=True))
    assert found.forces is not None and found.forces.min() > 10.0


def test_distances_of_the_belt_routers_anchors() -> None:
    """The turn that only gravity sees takes no part in them: known to 2 mm where the anchors are known to 6 mm."""
    problem, table = shipped("belt-router"), TABLES["belt-router"]
    names = selected("belt-router")
    fit = identify(problem, names)
    corners = table.machine.drives

    def distances(values: Array) -> Array:
        given = problem.model.by_name(values)
        place = np.array([[given[f"{c}x"], given[f"{c}y"]] for c in corners])
        first, second = np.triu_indices(4, 1)
        return np.asarray(np.linalg.norm(place[first] - place[second], axis=1))

    off = distances(fit.values) - distances(vector(problem.model, table.planted()))
    steps = [1e-4 * np.eye(len(fit.values))[problem.model.names.index(n)] for n in names]
    slope = np.stack([(distances(fit.values + s) - distances(fit.values - s)) / 2e-4 for s in steps], axis=1)
    std = np.sqrt(np.einsum("dp,pq,dq->d", slope, fit.covariance, slope))
    assert (np.abs(off) < 4 * std).all() and std.max() < 2e-3
    assert fit.std.max() > 5e-3


def test_eleven_heights_hardly_know_the_rod() -> None:
    """Least squares by differences of the closed form: the rod to 0.455 mm, and the engine's directions say so too."""
    table, machine = TABLES["delta-printer"], model("delta-printer")
    truth = table.machine
    columns = []
    for n in machine.names:
        step = {"mm": 1e-6, "deg": 1e-5}[truth.unit(n)]
        sides = [truth.read(table.set_values(), {n: truth.nominal[n] + s})[:, 0] for s in (step, -step)]
        columns.append((sides[0] - sides[1]) / (2 * step))
    normal = np.stack(columns, axis=1) / truth.si_sigma("probe")
    std = np.sqrt(np.diag(np.linalg.inv(normal.T @ normal)))
    rod = machine.names.index("rod")
    assert std[rod] == pytest.approx(0.4546e-3, rel=1e-3)
    problem = replace(shipped("delta-printer"), rows=rows_of(table))
    found = observability(problem, machine.nominal, machine.names).directions
    data = np.sqrt((found.vectors**2 / found.singular_values[:, None] ** 2).sum(axis=0)) * found.ranges
    assert data == pytest.approx(std, rel=1e-5)
    assert 1 / found.singular_values[-1] > 0.5 and found.weak.sum() == 1, "worse than its prior: held"
