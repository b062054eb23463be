"""What data do not determine: named, not moved, without interval; and what of it they do determine.

Two parameters of one rod at one pose: |T - B1| = l1 holds whatever moves the joint, so only l1 + u xb1r is seen, u the
rod's direction along the guide. Moving it moves T across rod 2, by 1 / sin of the angle between the rods.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import (
    combinations,
    directions,
)
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.observability_indices import observability
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.report.parameters import combination_json, determined_sums
from tests.command import run
from tests.support import MACHINES, model

SIGMA = 1e-5
DELTA = """
units: {length: mm, angle: deg, force: kN}
space: spatial
ranges: {length: 1, angle: 0.1}
parameters:
  "R{i}": {each: {i: [1, 2, 3]}, nominal: 300, note: distance of column from axis}
  "r{i}": {each: {i: [1, 2, 3]}, nominal: 60, note: distance of platform joints from TCP}
  "g{i}": {each: {i: [1, 2, 3]}, nominal: 0, note: turn of column about z}
  "l{i}": {each: {i: [1, 2, 3]}, nominal: 500}
frames:
  "column{i}": {each: {i: [1, 2, 3], a: [0, 120, 240]}, turn: [0, 0, "{a} + g{i}"]}
guides:
  "rail{i}": {each: {i: [1, 2, 3]}, frame: "column{i}", along: z}
bodies:
  platform:
    at: [0, 0, -439]
    points:
      P1a: [r1, 40, 0]
      P1b: [r1, -40, 0]
      P2a: [-r2/2 - 40*sin(pi/3), r2*sin(pi/3) - 20, 0]
      P2b: [-r2/2 + 40*sin(pi/3), r2*sin(pi/3) + 20, 0]
      P3a: [-r3/2 + 40*sin(pi/3), -r3*sin(pi/3) - 20, 0]
      P3b: [-r3/2 - 40*sin(pi/3), -r3*sin(pi/3) + 20, 0]
  "c{i}":
    each: {i: [1, 2, 3]}
    guide: "rail{i}"
    at: 0
    points: {"C{i}a": ["R{i}", 40, 0], "C{i}b": ["R{i}", -40, 0]}
bars:
  "arm{i}a": {each: {i: [1, 2, 3]}, between: ["C{i}a", "P{i}a"], length: "l{i}", k: 20}
  "arm{i}b": {each: {i: [1, 2, 3]}, between: ["C{i}b", "P{i}b"], length: "l{i}", k: 20}
actuators:
  "q{i}": {each: {i: [1, 2, 3]}, moves: "c{i}"}
sensors:
  probe: {kind: tcp, at: platform, reads: [z], sigma: 10 um, frame: machine}
"""


def measured(machine: Model, q: Array, errors: dict[str, float], noise: int | None = None) -> Problem:
    """Readings of a machine with errors (m, rad) at drive positions (N, A), with noise of a seed or without."""
    values = machine.nominal + np.array([errors.get(n, 0.0) for n in machine.names])
    readings = predict(machine, values, Rows.at(q)).values
    if noise is not None:
        readings = readings + np.random.default_rng(noise).normal(size=readings.shape) * SIGMA
    return Problem(
        model=machine,
        rows=Rows.at(q),
        readings=readings,
        sigma=np.full(readings.shape, SIGMA),
        drive_sigma=np.zeros(q.shape),
        measured=~np.isnan(readings),
    )


def moved(fit: Fit, model: Model) -> Array:
    """Change of the selected parameters (p,) in ranges."""
    index = [model.names.index(n) for n in fit.selected]
    return np.asarray((fit.values - model.nominal)[index] / model.ranges[index])


# the Triglide with l1 and xb1r at one pose ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["triglide", "triglide-nonredundant"])
def test_a_rod_and_its_joint_at_one_pose(name: str) -> None:
    """With errors in both: in the redundant machine these strain it, and the strain tells them apart, to second
    order, by 6e4 ranges."""
    machine = model(name)
    pose = np.array([[0.36, 0.275, 0, 0, 0, 0]])
    q = drive_positions(machine, pose).readings
    problem = measured(machine, q, {"l1": 4e-5, "xb1r": -7e-5})
    fit = identify(problem, ("l1", "xb1r"))
    assert fit.status == "converged"
    assert np.isnan(fit.std).all()
    (found,) = combinations(fit.directions)
    assert found.kind == "null"
    assert set(found.names) == {"l1", "xb1r"}
    assert np.abs(fit.directions.vectors[fit.directions.null] @ moved(fit, machine)).max() < 1e-3  # both turn a little
    ((coefficients, value, std, unit),) = determined_sums(machine, found, fit)
    along = (0.36 - q[0, 0]) / 0.3
    assert unit == "mm"
    assert coefficients["l1"] == pytest.approx(1)
    assert coefficients["xb1r"] == pytest.approx(along, abs=1e-4)  # a rod turned by errors of 0.1 mm
    assert value == pytest.approx(300.04 - 0.07 * along, abs=3e-5)  # and (0.1 mm)^2 / 300 mm
    if name == "triglide-nonredundant":
        rods = np.array([[0.36, 0.275], [0.36, 0.275]]) - np.array([[q[0, 0], 0.1], [q[0, 1], 0.1]])
        (ax, ay), (bx, by) = rods / 0.3
        assert std == pytest.approx(abs(ax * by - ay * bx) * SIGMA * 1e3, rel=1e-3)


@pytest.mark.parametrize("name", ["triglide", "triglide-nonredundant"])
def test_the_command_tells_it(name: str, tmp_path: object) -> None:
    """JSON: std null, the combination, its value and std; exit code 1, as both were named."""
    machine = model(name)
    q = drive_positions(machine, np.array([[0.36, 0.275, 0, 0, 0, 0]])).readings
    problem = measured(machine, q, {"l1": 4e-5, "xb1r": -7e-5}, noise=1)
    cells = [*q[0] * 1e3, *problem.readings[0] * 1e3]
    file = f"{tmp_path}/one.csv"
    with open(file, "w", encoding="utf-8") as out:
        out.write(f"{','.join(a.name for a in machine.actuators)},x,y\n{','.join(repr(float(c)) for c in cells)}\n")
    done = run("calibrate", str(MACHINES / f"{name}.yaml"), file, "--select", "l1,xb1r", "--json", "--holdout", "none")
    result = json.loads(done.out)
    assert (done.code, result["status"]) == (1, "converged")
    assert result["rank"] == 1
    for parameter in result["parameters"]:
        assert parameter["std"] is None
        assert not parameter["identified"]
        assert "undetermined" in parameter["reason"]
    (found,) = result["undetermined"]
    assert found["kind"] == "null"
    assert found["parameters"].keys() == {"l1", "xb1r"}
    (sum_,) = found["determined"]
    true = sum_["coefficients"]["l1"] * 300.04 + sum_["coefficients"]["xb1r"] * -0.07
    assert abs(sum_["value"] - true) < 4 * sum_["std"]
    assert 0.02 < sum_["std"] < 0.1, "the others, which are held, may be 0.1 mm off"
    assert "The data cannot separate these parameters." in done.err
    told = re.search(r"; determined: l1 \+1, xb1r (\S+): (-?[\d.]+)\(\d+\) mm from nominal", done.err)
    assert told and float(told[2]) == pytest.approx(0.04 - float(told[1]) * 0.07, abs=4 * sum_["std"])
    assert float(told[2]) == pytest.approx(sum_["value"] - 300, abs=1e-3)


def test_where_what_is_told_to_hold_is_held_the_others_are_seen() -> None:
    """Of four, a - b and b - c + d are seen: with a and b held, c and d would still go together."""
    jacobian, ranges = 1e3 * np.array([[1.0, -1, 0, 0], [0, 1, -1, 1]]), np.ones(4)
    (found,) = combinations(directions(jacobian, tuple("abcd"), ranges))
    assert (found.kind, found.names, len(found.hold)) == ("null", tuple("abcd"), 2)
    rest = ["abcd".index(n) for n in found.names if n not in found.hold]
    assert np.linalg.matrix_rank(jacobian[:, rest]) == 2


def test_one_more_pose_determines_them() -> None:
    machine = model("triglide-nonredundant")
    q = drive_positions(machine, np.array([[0.36, 0.2, 0, 0, 0, 0], [0.36, 0.35, 0, 0, 0, 0]])).readings
    fit = identify(measured(machine, q, {"l1": 4e-5, "xb1r": -7e-5}), ("l1", "xb1r"))
    assert not fit.directions.null.any()
    assert np.isfinite(fit.std).all()


@pytest.mark.parametrize(("trace", "lost"), [(1e-4, False), (1e-2, True)])
def test_traces_below_noise_leave_a_parameter_determined(trace: float, lost: bool) -> None:
    """b is known to 1e-3 of its range; a, not seen, moves it by `trace` of its range for each range of its own."""
    jacobian = 1e3 * np.array([[-trace, 1.0, 0.0], [0.0, 0.0, 1.0]])
    found = directions(jacobian, ("a", "b", "c"), np.ones(3))
    assert found.undetermined().tolist() == [True, lost, False]
    variance = 1e-6 + (trace / 2) ** 2  # noise, and a known to half its range
    assert found.determined_covariance()[1, 1] == pytest.approx(variance, rel=1e-3)


# a delta with heights only --------------------------------------------------------------------------------------------


def delta_problem(errors: dict[str, float], noise: int | None = None) -> tuple[Model, Problem]:
    """60 heights over the workspace."""
    machine = model(DELTA)
    poses = np.full((60, 6), np.nan)
    poses[:, :3] = np.random.default_rng(0).uniform([-0.15, -0.15, -0.54], [0.15, 0.15, -0.34], (60, 3))
    found = drive_positions(machine, poses)
    assert (found.status == 0).all()
    return machine, measured(machine, found.readings, errors, noise)


def test_a_delta_of_which_only_heights_are_known() -> None:
    """R and r of a column: only R - r. The three columns' turns: turning all of them turns what was not measured."""
    rng = np.random.default_rng(3)
    machine = model(DELTA)
    errors = {n: rng.normal() * r / 2 for n, r in zip(machine.names, machine.ranges, strict=True)}
    errors["g1"] = errors["g2"] = errors["g3"] = 0.0
    machine, problem = delta_problem(errors)
    names = tuple(n for n in machine.names if n[0] != "g")
    fit = identify(problem, names)
    assert fit.status == "converged"
    assert fit.directions.null.sum() == 3
    found = {c.names: c for c in combinations(fit.directions) if c.kind == "null"}
    assert {frozenset(n) for n in found} == {frozenset({f"R{i}", f"r{i}"}) for i in (1, 2, 3)}
    change = dict(zip(names, moved(fit, machine), strict=True))
    for pair, combination in found.items():
        column = pair[0][1]
        assert change[f"R{column}"] == pytest.approx(
            -change[f"r{column}"], abs=1e-9
        )  # nothing along the null direction
        ((coefficients, value, _, _),) = determined_sums(machine, combination, fit)
        assert coefficients == pytest.approx({f"R{column}": 1, f"r{column}": -1}, abs=1e-9)
        assert value == pytest.approx(240 + 1e3 * (errors[f"R{column}"] - errors[f"r{column}"]), abs=1e-6)
    for name, std in zip(names, fit.std, strict=True):
        assert np.isnan(std) == (name[0] in "Rr")
        if name[0] == "l":
            k = names.index(name)
            true = machine.nominal[machine.names.index(name)] + errors[name]
            assert fit.values[machine.names.index(name)] == pytest.approx(true, abs=1e-9)
            assert fit.covariance[k, k] > 0


def test_its_determined_sums_are_as_sure_as_they_say() -> None:
    """Against the fit of a machine whose r are known: the same sums and standard uncertainties."""
    machine, problem = delta_problem({"R1": 4e-4, "r2": -3e-4, "l3": 5e-4}, noise=2)
    every = ("R1", "R2", "R3", "r1", "r2", "r3", "l1", "l2", "l3")
    both, known = identify(problem, every), identify(problem, ("R1", "R2", "R3", "l1", "l2", "l3"))
    for combination in combinations(both.directions):
        ((coefficients, value, std, _),) = determined_sums(machine, combination, both)
        column = next(iter(coefficients))[1]
        alone = known.values[machine.names.index(f"R{column}")] - 0.06
        assert value == pytest.approx(alone * 1e3, abs=1e-6)
        assert std == pytest.approx(known.std[known.selected.index(f"R{column}")] * 1e3, rel=1e-6)
    assert both.chi2 == pytest.approx(known.chi2, rel=1e-9)
    assert both.dof == known.dof


def test_the_turn_of_the_whole_machine() -> None:
    """About z, no height changes: one direction of three parameters, two sums of them are determined."""
    _, problem = delta_problem({})
    fit = identify(problem, ("g1", "g2", "g3", "l1", "l2", "l3"))
    null = [c for c in combinations(fit.directions) if c.kind == "null"]
    assert [set(c.names) for c in null] == [{"g1", "g2", "g3"}]
    assert np.abs(null[0].motions) == pytest.approx(np.ones((1, 3)), abs=1e-6)
    assert null[0].determined.shape == (2, 3)
    assert null[0].determined @ np.ones(3) == pytest.approx([0, 0], abs=1e-6)
    assert np.isnan(fit.std[:3]).all()
    assert np.isfinite(fit.std[3:]).all()


def test_observability_tells_it_before_anything_is_measured() -> None:
    machine, problem = delta_problem({})
    plan = design_problem(machine, problem.rows)
    found = observability(plan, machine.nominal, ("R1", "r1", "l1", "l2"))
    assert found.directions.rank == 3
    assert found.directions.condition_number == np.inf
    assert np.isnan(found.std).tolist() == [True, True, False, False]
    assert [c.kind for c in found.undetermined] == ["null"]
    assert found.indices["O1"] == 0


def test_json_of_a_combination() -> None:
    machine, problem = delta_problem({"R1": 2e-4})
    fit = identify(problem, ("R1", "r1", "l1"))
    (combination,) = combinations(fit.directions)
    (shown,) = combination_json(machine, combination, fit)
    assert shown["kind"] == "null"
    assert shown["std_in_ranges"] is None
    assert shown["determined"][0]["value"] == pytest.approx(240.2, abs=1e-6)  # type: ignore[index]
    assert json.loads(json.dumps(shown)) == shown
    assert replace(combination, kind="weak").text.endswith("can hardly be separated")


def test_sums_of_lengths_and_angles_are_of_values_as_shown() -> None:
    """A turn of the guide in degrees, a length in mm, at one pose: the coefficients are in mm and mm per degree."""
    machine = model("triglide-nonredundant")
    q = drive_positions(machine, np.array([[0.36, 0.275, 0, 0, 0, 0]])).readings
    fit = identify(measured(machine, q, {"l1": 4e-5, "gamma": 1e-3}), ("l1", "xb1r", "gamma"))
    (combination,) = combinations(fit.directions)
    shown = dict(zip(fit.selected, (fit.values[machine.names.index(n)] for n in fit.selected), strict=True))
    values = {"l1": shown["l1"] * 1e3, "xb1r": shown["xb1r"] * 1e3, "gamma": np.degrees(shown["gamma"])}
    for coefficients, value, std, unit in determined_sums(machine, combination, fit):
        assert unit == "mm"
        assert sum(c * values[n] for n, c in coefficients.items()) == pytest.approx(value, rel=1e-12)
        assert std > 0


@pytest.mark.parametrize("seed", range(6))
def test_null_directions_come_in_the_order_of_the_parameters(seed: int) -> None:
    """Singular values of 0 have no order, and their vectors no directions: both are the rounding of a processor."""
    jacobian = np.zeros((6, 4))
    jacobian[:, 1] = 1.0
    spectrum = directions(jacobian, ("a", "b", "c", "d"), np.ones(4))
    null = np.nonzero(spectrum.null)[0]
    turned = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    vectors = spectrum.vectors.copy()
    vectors[null] = turned @ vectors[null]
    assert [c.names for c in combinations(replace(spectrum, vectors=vectors))] == [("a",), ("c",), ("d",)]
