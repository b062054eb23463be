"""Error figures against sums by hand: points, turns, readings of drives, line and leg lengths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import channel_figures, error_figures, length_residuals
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.prediction import Rows, predict
from tests.campaigns import shipped
from tests.hangprinter_cases import measured
from tests.support import model, overlay, poses_of, truth
from tests.test_sensors import SPATIAL, asked

UM = 1e-6


def off_by(name: str, positions: Array, errors: Array) -> Problem:
    """A nominal machine that reads its predictions plus errors (N, C); nan: not measured."""
    machine = model(name)
    readings = predict(machine, machine.nominal, Rows.at(positions)).values + errors
    return Problem(
        model=machine,
        rows=Rows.at(positions),
        readings=readings,
        sigma=np.full(errors.shape, 1.0),
        drive_sigma=0 * positions,
        measured=~np.isnan(errors),
    )


def test_a_row_of_unknown_side_is_in_no_figure() -> None:
    """300 um in the row of a drive that came from either side; the others are 5, 2 and 10 um off, x by 3, 0 and 6."""
    errors = np.array([[3, 4], [0, -2], [6, 8], [300, 0]]) * UM
    problem = off_by("triglide", shipped("triglide").positions[:4], errors)
    problem = replace(problem, side_sigma=np.array([[0.0, 0.0, 0.0]] * 3 + [[1e-4, 0.0, 0.0]]))
    evaluation = evaluate(problem, problem.model.nominal)
    kinds, each = error_figures(problem, evaluation), channel_figures(problem, evaluation)
    assert (kinds["position"].largest, kinds["position"].count) == (pytest.approx(10 * UM), 3)
    assert (each["x"].largest, each["x"].count) == (pytest.approx(6 * UM), 3)
    assert each["x"].rms == pytest.approx(np.sqrt((9 + 0 + 36) / 3) * UM)
    assert each["x"].criterion + each["y"].criterion == pytest.approx(kinds["position"].criterion)


def test_points() -> None:
    """Errors (3, 4), (0, -2), (6, 8) um: 5, 2 and 10 um of a point."""
    problem = off_by("triglide", shipped("triglide").positions[:3], np.array([[3, 4], [0, -2], [6, 8]]) * UM)
    found = error_figures(problem, evaluate(problem, problem.model.nominal))
    assert found.keys() == {"position"}
    position = found["position"]
    assert position.criterion == pytest.approx((25 + 4 + 100) * UM**2, rel=1e-9)
    assert position.rms == pytest.approx(np.sqrt(129 / 3) * UM, rel=1e-9)
    assert position.largest == pytest.approx(10 * UM, rel=1e-9)
    assert position.count == 3
    assert position.dimension == "length"


def test_a_point_half_measured_counts_with_what_was_measured() -> None:
    errors = np.array([[3, np.nan], [0, -2], [np.nan, np.nan]]) * UM
    problem = off_by("triglide", shipped("triglide").positions[:3], errors)
    position = error_figures(problem, evaluate(problem, problem.model.nominal))["position"]
    assert position.count == 2
    assert position.criterion == pytest.approx(13 * UM**2, rel=1e-9)
    assert position.rms == pytest.approx(np.sqrt(13 / 2) * UM, rel=1e-9)
    assert position.largest == pytest.approx(3 * UM, rel=1e-9)


def test_turns_have_figures_of_their_own() -> None:
    errors = np.zeros((2, 6))
    errors[0] = [1 * UM, 2 * UM, 2 * UM, 2e-6, 3e-6, 6e-6]
    positions = truth("hexapod7").inverse(poses_of("hexapod7", 2))  # type: ignore[attr-defined]
    problem = off_by("hexapod7", positions, errors)
    found = error_figures(problem, evaluate(problem, problem.model.nominal))
    assert found.keys() == {"position", "orientation"}
    assert found["position"].rms == pytest.approx(np.sqrt(9 / 2) * UM, rel=1e-6)
    assert found["orientation"].largest == pytest.approx(7e-6, rel=1e-6)
    assert found["orientation"].criterion == pytest.approx(49e-12, rel=1e-6)
    assert found["orientation"].dimension == "angle"


def test_drives_and_lines_of_the_hangprinter() -> None:
    """A line asks for |anchor - point| - |anchor|, its spool has wound radius x ratio x angle; in rows with a pose."""
    problem, table = measured("2021-12-16")
    nominal = evaluate(problem, problem.model.nominal)
    found = error_figures(problem, nominal)
    assert found.keys() == {"position", "drive", "length"}
    anchors = problem.model.nominal[:12].reshape(4, 3)
    place = problem.readings[:, :3]
    seen = ~np.isnan(place).any(axis=1)
    asked = np.linalg.norm(anchors - place[:, None], axis=2) - np.linalg.norm(anchors, axis=1)
    turned = np.column_stack([np.asarray(table.actuators)[:, :3], problem.readings[:, 3]])
    wound = 0.075 * turned * np.array([20 / 255 / 2] * 3 + [20 / 255 / 4])
    by_hand = (wound - asked)[seen]
    assert length_residuals(problem, problem.model.nominal)[seen] == pytest.approx(by_hand, abs=1e-9)
    assert found["length"].count == by_hand.size
    assert found["length"].rms == pytest.approx(np.sqrt((by_hand**2).mean()), rel=1e-6)
    assert found["length"].largest == pytest.approx(np.abs(by_hand).max(), rel=1e-6)
    residual = nominal.residual[:, 3]
    assert found["drive"].rms == pytest.approx(np.sqrt((residual**2).mean()), rel=1e-9)
    assert found["drive"].dimension == "angle"


def test_lengths_of_a_telescopic_leg() -> None:
    """The Biglide's leg from (360, 650) to the TCP: l3 + q3 against the distance to the measured point."""
    positions = shipped("biglide").positions[::9]
    errors = np.random.default_rng(0).normal(size=(len(positions), 2)) * 1e-4
    problem = off_by("biglide", positions, errors)
    asked = np.linalg.norm(problem.readings - [0.36, 0.65], axis=1)
    by_hand = 0.3 + positions[:, 2] - asked
    found = error_figures(problem, evaluate(problem, problem.model.nominal))["length"]
    assert length_residuals(problem, problem.model.nominal)[:, 0] == pytest.approx(by_hand, abs=1e-12)
    assert found.criterion == pytest.approx((by_hand**2).sum(), rel=1e-9)


def test_a_force_is_no_coordinate_of_the_measured_pose() -> None:
    """The leg of the Biglide again, whose drive also reads a force."""
    name = overlay("biglide", "sensors: {motor: {kind: force, drive: q3, sigma: 1}}")
    positions = shipped("biglide").positions[::9]
    errors = np.random.default_rng(0).normal(size=(len(positions), 3)) * [1e-4, 1e-4, 50.0]
    problem = off_by(name, positions, errors)
    by_hand = 0.3 + positions[:, 2] - np.linalg.norm(problem.readings[:, :2] - [0.36, 0.65], axis=1)
    assert [c.name for c in problem.model.channels][2] == "motor"
    assert length_residuals(problem, problem.model.nominal)[:, 0] == pytest.approx(by_hand, abs=1e-12)


def test_each_kind_of_instrument_has_figures_of_its_own() -> None:
    """A ballbar 3 um off and a wire -4 um are one kind, calipers, probes, a current and a torque are others."""
    more = """
  motor: {kind: force, drive: q1, sigma: 1}
  second: {kind: bench, of: kt, reading: 41 N, sigma: 1 N}
"""
    machine = model(overlay("delta4", SPATIAL + more))
    _, rows = asked(machine)
    errors = {
        "ballbar": 3e-6, "wire": -4e-6, "calipers": 7e-6, "probe": 1e-6, "edge.y": 2e-6, "edge.z": -2e-6,
        "current": 0.5, "motor": 2.0, "encoder": 1e-3, "gauge": 5e-6, "second": 3.0,
    }  # fmt: skip
    off = np.array([[errors.get(c.name, 0.0) for c in machine.channels]] * len(rows))
    readings = predict(machine, machine.nominal, rows).values + off
    problem = Problem(
        model=machine,
        rows=rows,
        readings=readings,
        sigma=np.ones(off.shape),
        drive_sigma=np.zeros(rows.readings.shape),
        measured=~np.isnan(readings),
    )
    found = error_figures(problem, evaluate(problem, machine.nominal), lengths=False)
    rms = {
        "position": 0.0, "orientation": 0.0, "distance": np.sqrt(12.5e-12), "span": 7e-6, "touch": np.sqrt(3e-12),
        "angle": 1e-3, "force (plain number)": 0.5, "force (force)": 2.0, "bench (length)": 5e-6, "bench (force)": 3.0,
    }  # fmt: skip
    assert list(found)[:2] == ["position", "orientation"]
    assert {k: f.rms for k, f in found.items()} == pytest.approx(rms, rel=1e-8, abs=1e-12)
    assert {k: f.dimension for k, f in found.items()}["bench (force)"] == "force"
    assert found["span"].count == int((rows.partner >= 0).sum())  # type: ignore[operator]
