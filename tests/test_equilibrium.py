"""Equilibrium of the shipped machines against their independent simulators, and against itself.

The simulators are good to 1e-15 m; coordinates of about 0.5 m round to 1e-16 m, and softness multiplies the
rounding of forces of 1e4 N to about 1e-14 m. 1e-5 um = 1e-11 m leaves room for 1000 times that.
"""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests import measured, structures
from tests.in_ci import in_ci
from tests.measured import REDUNDANT, against_force_control, against_truth, hangprinter, hangprinter_readings
from tests.support import UM, at, errors_of, model, overlay, poses_of, truth
from tests.truth.machines import PINNED, Hangprinter


@pytest.mark.parametrize("name", PINNED)
def test_exact_is_the_least_energy(name: str) -> None:
    """Errors up to 1 mm, a force on the platform: pose, drive forces and strain energy."""
    found = against_truth(name)
    assert found.position < 1e-5
    assert found.force < 1e-9
    assert found.energy < 1e-9


def test_exact_is_the_equilibrium_of_the_bending_hexapod() -> None:
    """16 springs a beam leave 1e-8 of the energy. The platform's axes are those of the drawing to 1e-11 rad."""
    found = against_truth("hexapod7", 1e-4)
    assert found.position < 1e-5
    assert found.orientation < 1e-10
    assert found.force < 1e-7
    assert found.energy < 1e-6


def test_the_hexapods_legs_bend_under_their_weight() -> None:
    """Strain energy at nominal is half bending; legs 1e4 times stiffer across put the TCP elsewhere, by 1e-11 m.

    16 springs a beam leave (1/16)^2 / 4 of the bending energy.
    """
    simulator, machine = truth("hexapod7"), model("hexapod7")
    readings = simulator.inverse(poses_of("hexapod7", 2))
    found, true = at(machine, readings, Request(forces=True)), simulator.forward(readings)
    assert found.energy == pytest.approx(true.energy, rel=1e-3)
    assert (true.bending > 0.3 * true.energy).all()
    area = np.pi / 4 * (30**2 - 20**2)
    beams = [
        f'"{beam}{{i}}": {{each: {{i: [1, 2, 3, 4, 5, 6, 7]}}, section: null, material: null, EA: {210e3 * area},'
        f" EI: 6.7e13, GJ: 6.7e13, mass: {7.85e-6 * area * length}}}"
        for beam, length in (("lower", 300), ("upper", 200))
    ]
    unused = "sections: {strut: null}\nmaterials: {steel: null}"
    stiff = model(overlay("hexapod7", f"{unused}\nbeams: {{{', '.join(beams)}}}"))
    shift = np.linalg.norm(at(stiff, readings).values[:, :3] - found.values[:, :3], axis=1)
    assert ((shift > 1e-12) & (shift < 1e-10)).all()


@pytest.mark.parametrize("name", in_ci([name for name in REDUNDANT if name != "hexapod7"], REDUNDANT))
def test_linear_is_off_by_second_order(name: str) -> None:
    """Ten times the errors, a hundred times the deviation of the paper's one step; the next order adds to it."""
    large, small = (against_truth(name, size, loaded=False) for size in (1e-3, 1e-4))
    assert small.linear > 1e3 * small.position
    assert 70 < large.linear / small.linear < 140


def test_linear_is_exact_without_strain() -> None:
    """No redundant drive, no load: nothing to step over."""
    assert against_truth("triglide-nonredundant", loaded=False).linear < 1e-8


@pytest.mark.parametrize("name", in_ci([name for name in REDUNDANT if name != "hexapod7"], REDUNDANT))
def test_exact_does_not_depend_on_what_is_called_redundant(name: str) -> None:
    spread, choices = measured.spread_over_substructures(name)
    assert choices >= 3
    assert spread < 1e-8


def test_linear_depends_on_what_is_called_redundant() -> None:
    """The paper's step, from another substructure, differs by second order: not by rounding."""
    readings, found = truth("triglide").inverse(poses_of("triglide", 8)), []
    for chosen in ("q1", "q3"):
        text = overlay("triglide", structures.redundant(("q1", "q2", "q3"), chosen))
        machine = model(text)
        found.append(at(machine, readings, Request(method="linear"), **errors_of(machine, 3e-4)).values)
    assert 0.01 * UM < np.abs(found[0] - found[1]).max() < 100 * UM


@pytest.mark.parametrize("name", REDUNDANT)
def test_force_controlled_redundant_drives(name: str) -> None:
    """The paper's last test: positions of the redundant drives, which go where force and errors send them."""
    tcp, turned, travel, moved = against_force_control(name)
    assert travel < 1e-5
    assert tcp < 1e-5
    assert turned < 1e-10
    assert moved > 100


def test_hangprinter_with_its_upper_line_in_force_control() -> None:
    """Ropes whose stiffness ES/L changes by what is wound: pose, line, tensions, energy."""
    found = measured.against_hangprinter()
    assert found.tcp < 1e-5
    assert found.line < 1e-5
    assert found.tension < 1e-8
    assert found.energy < 1e-9


def test_a_slack_line_carries_nothing() -> None:
    """The pose, tensions and energy of an independent simulator, whose slack line holds no force."""
    simulator, machine = Hangprinter(), model(hangprinter(40.0))
    readings = hangprinter_readings(simulator, np.array([[0.3, 0.2, 0.5], [0.5, -0.3, 0.2]]))
    true = simulator.forward(readings, tension={"D": 40.0})
    assert (true.tension > 0).tolist() == [[True] * 4, [True, True, False, True]]
    found = predict(machine, machine.nominal, Rows.at(readings), Request(forces=True))
    assert found.slack == {1: ("lineC",)}
    assert np.abs(found.values[:, :3] - true.tcp).max() < 1e-11
    assert np.abs(found.forces - true.tension).max() < 1e-8


@pytest.mark.parametrize("name", [*PINNED, "hexapod7"])
def test_inverse_positions(name: str) -> None:
    """Set values for TCP poses with no drive strained: the closed form, and back again."""
    machine, poses = model(name), poses_of(name, 20)
    given = np.full((len(poses), 6), np.nan)
    given[:, : poses.shape[1]] = poses
    found = drive_positions(machine, given)
    assert np.abs(found.readings - truth(name).inverse(poses)).max() < 1e-10
    back = at(machine, found.readings, Request(method="rigid")).values
    channels = min(poses.shape[1], back.shape[1])
    assert np.abs(back[:, :channels] - poses[:, :channels]).max() < 1e-10


def test_inverse_positions_of_the_hangprinter() -> None:
    places = np.array([[0.0, 0.0, 0.0], [0.3, 0.2, 0.5]])
    found = drive_positions(model("hangprinter"), np.column_stack([places, np.full((2, 3), np.nan)]))
    assert np.abs(found.readings - hangprinter_readings(Hangprinter(), places)).max() < 1e-10


def test_rows_without_a_solution_say_why() -> None:
    """Rods too short, the platform beyond its singular position: no numbers, and the other rows stand."""
    machine = model("triglide-nonredundant")
    readings = np.array([[0.1, 0.6], [0.0, 0.61], [0.1, 0.6]])
    found = predict(machine, machine.nominal, Rows.at(readings), Request(parameters=("l1",), forces=True))
    assert found.solved.tolist() == [True, False, True]
    assert "out of reach" in found.reason(1)
    for part in (found.values, found.jacobian, found.forces, found.energy):
        assert np.isnan(part[1]).all()
        assert np.array_equal(part[0], part[2])


@pytest.mark.parametrize("name", ["scissors", "hexapod7"])
def test_rows_do_not_feel_each_other(name: str) -> None:
    """Alone, together, or started from the last result: the same pose to rounding of a solve."""
    machine, readings = model(name), truth(name).inverse(poses_of(name, 6))
    values = np.array(list(errors_of(machine, 1e-4).values()))
    together = predict(machine, values, Rows.at(readings))
    alone = np.concatenate([predict(machine, values, Rows.at(row[None])).values for row in readings])
    again = predict(machine, values, Rows.at(readings), start=together.start)
    assert np.abs(together.values - alone).max() < 1e-13
    assert np.abs(together.values - again.values).max() < 1e-13
    assert again.steps <= 2 * len(readings) < together.steps


@pytest.mark.parametrize("far", [1.0, 5.0, 10.0, 20.0, 1e3])
def test_a_row_that_is_far_away_costs_the_others_nothing(far: float) -> None:
    """An encoder that reads metres too much: the way there may take more steps than are allowed."""
    machine = model("triglide-nonredundant")
    readings = truth("triglide-nonredundant").inverse(poses_of("triglide-nonredundant", 12))
    alone = predict(machine, machine.nominal, Rows.at(readings))
    beside = predict(machine, machine.nominal, Rows.at(np.vstack([readings, [far, far]])))
    assert alone.solved.all() and beside.solved.tolist() == [True] * 12 + [False]
    assert np.abs(beside.values[:12] - alone.values).max() < 1e-13


def test_a_guide_has_no_ends() -> None:
    """Five metres along the common rail the tool point is five metres further, and nothing else changes."""
    machine = model("triglide-nonredundant")
    readings = truth("triglide-nonredundant").inverse(poses_of("triglide-nonredundant", 12))
    near, far = (predict(machine, machine.nominal, Rows.at(readings + along)) for along in (0.0, 5.0))
    assert far.solved.all()
    assert np.abs(far.values - near.values - [5.0, 0.0]).max() < 1e-13  # m; rounding of 5 m: 1e-15
