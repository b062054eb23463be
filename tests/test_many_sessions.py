"""Many sessions: what is counted, what repeats, and fits that leave nothing but frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.calibration import condensed
from pkmcal_cli.calibration.determinacy import determinacy
from pkmcal_cli.calibration.eliminated_frames import frame_uncertainties, without_frames
from pkmcal_cli.calibration.fit import ABANDONED
from pkmcal_cli.calibration.holdout import cross_validate, enough_values
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.replicates import repeated_poses
from pkmcal_cli.prediction import Request, Rows, predict
from tests.support import model, overlay
from tests.test_session_frames import NAMES, PER_SESSION, RODS, SESSIONS, campaign, frames, measured_by, of_frames


def test_frames_count_among_the_unknowns() -> None:
    """One row a session: 44 readings for 69 unknowns; two: less than three readings for each."""
    problem = measured_by(PER_SESSION, NAMES, 3, each=1)
    less, left = without_frames(problem, (*RODS, *of_frames(problem)), plain=True)
    assert "44 equations, 69 unknowns" in determinacy(less, problem.model.nominal, left).refusal
    two = measured_by(PER_SESSION, NAMES, 3, each=2)
    assert not enough_values(without_frames(two, (*RODS, *of_frames(two)), plain=True)[0], left)
    assert enough_values(two, left), "without its frames"


def test_a_fit_that_is_given_up_tells_nothing_of_frames() -> None:
    _, done = campaign(3)
    fit = replace(done.robust.fit, stopped=ABANDONED)
    assert done.frames and not frame_uncertainties(done.robust.problem, fit, done.budget)


def test_frames_are_fitted_where_nothing_else_is_identified() -> None:
    """Where a datum holds all that was selected; the rods are 30 um off, so frames are, by no more than a few."""
    problem = measured_by(PER_SESSION, NAMES, 3)
    less, _ = without_frames(problem, (*RODS, *of_frames(problem)), plain=True)
    fit, dense = identify(less, ()), identify(problem, of_frames(problem))
    assert fit.status == "converged" and fit.dof == problem.count - 3 * SESSIONS
    assert fit.values == pytest.approx(dense.values, abs=1e-12)
    index = [problem.model.names.index(f"frame@tracker.tx[{name}]") for name in NAMES]
    assert fit.values[index] == pytest.approx(frames(3)[:, 0], abs=2e-4)


def test_the_same_pose_in_another_session_is_no_repeat() -> None:
    """Also of sessions whose numbers have a digit in common: the first and the 31st, of 901."""
    problem = measured_by(PER_SESSION, tuple(f"day {k}" for k in range(901)), 3, each=1)
    readings, session = problem.rows.readings.copy(), problem.rows.session
    first, same_digit, same_other = (int(np.nonzero(session == k)[0][0]) for k in (0, 30, 900))
    readings[[same_digit, same_other]] = readings[first]
    alike = replace(problem, rows=replace(problem.rows, readings=readings))
    assert (repeated_poses(alike) < 0).all()
    flags = {**problem.rows.columns, "session.day 0": problem.rows.columns["session.day 0"].copy()}
    flags["session.day 30"] = flags["session.day 30"] * 0.0
    flags["session.day 0"][same_digit] = 1.0
    repeat = repeated_poses(replace(problem, rows=replace(problem.rows, readings=readings, columns=flags)))
    assert np.nonzero(repeat >= 0)[0].tolist() == sorted([first, same_digit])


def test_two_effects_of_one_name_both_act() -> None:
    """As searches have them beside each other, with parameters of their own: readings move by the sum."""
    machine = model(overlay("triglide", "effects: {scale@q1: {s: 0}}\n"))
    (placed,), name = machine.effects, "scale@q1.s"
    declared = machine.parameters[machine.names.index(name)]
    twin = replace(placed, parameters=("other.s",))
    both = machine.with_effects((twin,), (replace(declared, name="other.s"),))
    rows = Rows.at(machine.reference_readings[None] + np.linspace(0.0, 0.05, 4)[:, None])
    jacobian = predict(both, both.nominal, rows, Request(parameters=(name, "other.s"))).jacobian
    assert jacobian is not None and np.abs(jacobian[..., 0]).max() > 1e-3
    assert jacobian[..., 1] == pytest.approx(jacobian[..., 0], abs=0.0)
    values = both.nominal
    values[[both.names.index(name), both.names.index("other.s")]] = 1e-3, 2e-3
    alone = machine.nominal
    alone[machine.names.index(name)] = 3e-3
    assert predict(both, values, rows).values == pytest.approx(predict(machine, alone, rows).values, abs=1e-15)


def test_sessions_that_are_held_out_fit_their_frames_and_few_are_named() -> None:
    """Errors there are as noise makes them, with what 126 readings of the others leave of the rods."""
    problem = measured_by(PER_SESSION, NAMES, 7)
    less, left = without_frames(problem, (*RODS, *of_frames(problem)), plain=True)
    held = cross_validate(less, identify(less, left), problem.rows.session, "by session")
    assert "rz[day 3] and 54 more fitted to the held-out rows" in held.scheme
    square = (held.after["position"].rms / 1e-6) ** 2 / 2  # of both coordinates
    assert square == pytest.approx(held.noise["position"], rel=3 * np.sqrt(2 / problem.count))


def test_a_long_table_of_sessions_is_worked_on_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """A chunk of rows would tear sessions apart: frames have to be eliminated by all rows of a session together."""
    problem = measured_by(PER_SESSION, NAMES, 3)
    less, left = without_frames(problem, (*RODS, *of_frames(problem)), plain=True)
    short = identify(less, left)
    monkeypatch.setattr(condensed, "LONG", 50)
    assert condensed.is_long(problem)
    long = identify(less, left)
    assert long.values == pytest.approx(short.values, abs=1e-14) and long.dof == short.dof
    assert long.chi2 == pytest.approx(short.chi2, rel=1e-12)
