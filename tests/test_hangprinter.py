"""The hangprinter's real data: two sessions, whichever three drives are the inputs.

The anchors of one session differ by hundreds of standard uncertainties from those with other radii, and by some
30 mm between choices of inputs when the drives' errors are left out; so the tolerances below have room to fail.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pkmcal_cli.calibration.errors_before_after import error_figures
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.calibration.selection import select
from tests.hangprinter_cases import (
    ANCHORS,
    LINES,
    RADII,
    RMS,
    SESSIONS,
    calibrated,
    disagreement,
    held_out,
    measured,
)
from tests.in_ci import in_ci
from tests.support import at, model

EVERY = [(s, line, sel) for s in SESSIONS for line in LINES for sel in (ANCHORS, RADII)]


@pytest.mark.parametrize(("session", "line", "selection"), EVERY)
def test_line_lengths(session: str, line: str, selection: str) -> None:
    """Within 3 %: weights differ (camera and lines against lines alone), and elasticity takes part."""
    found = calibrated(session, line, selection)
    assert found.fit.status == "converged"
    assert found.after == pytest.approx(RMS[session, selection], rel=0.03)
    assert found.before == pytest.approx({"2021-12-16": 6.70, "2022-04-12": 7.81}[session], rel=1e-3)


@pytest.mark.parametrize(
    ("line", "selection", "session"),
    in_ci([f"D-{RADII}-{SESSIONS[0]}", f"D-{ANCHORS}-{SESSIONS[1]}"], product(["D", "C"], [ANCHORS, RADII], SESSIONS)),
)
def test_held_out_error_stands_beside(session: str, line: str, selection: str) -> None:
    """Above the fit's; by less than half, as there are 5 to 12 readings a parameter. No fold fails."""
    held, failed = held_out(session, line, selection)
    assert failed == 0
    fitted = calibrated(session, line, selection).after
    assert fitted < held < 1.5 * fitted


@pytest.mark.parametrize("session", SESSIONS)
@pytest.mark.parametrize("selection", [ANCHORS, RADII])
def test_choice_of_inputs_does_not_matter(session: str, selection: str) -> None:
    """To first order; residuals of 1 to 10 mm on lines of 1 to 2 m leave a second order of some 1 %."""
    assert disagreement(session, selection) < 0.1


def test_without_errors_of_the_drives_the_choice_matters() -> None:
    """Anchors then differ by many standard uncertainties: the drives' sigma is what makes the choices agree."""
    values = []
    for line in ("D", "A"):
        problem, _ = measured("2021-12-16", line)
        blind = replace(problem, drive_sigma=np.zeros_like(problem.drive_sigma))
        values.append(identify(blind, select(problem.model, ANCHORS)).values)
    reference = calibrated("2021-12-16", "D", ANCHORS)
    moved = np.abs(values[1] - values[0])[[problem.model.names.index(n) for n in reference.fit.selected]]
    assert (moved / reference.fit.std).max() > 5


@pytest.mark.parametrize("session", SESSIONS)
@pytest.mark.parametrize("seed", range(4))
def test_anchors_300_mm_off_are_found(session: str, seed: int) -> None:
    """In any direction. Some rows cannot be predicted there: the lines do not meet, or one is slack.

    A fit ends when its next step is below 1e-8 ranges or lowers chi-square by less than rounding: some 1e-6 standard
    uncertainties from the minimum, more where the residuals are large.
    """
    problem, _ = measured(session)
    way = np.random.default_rng(seed).normal(size=(4, 3))
    start = problem.model.nominal
    start[:12] += (0.3 * way / np.linalg.norm(way, axis=1)[:, None]).ravel()
    found = identify(problem, select(problem.model, RADII), start)
    reference = calibrated(session, "D", RADII)
    assert found.status == "converged"
    values = found.values[[problem.model.names.index(n) for n in found.selected]]
    assert (np.abs(values - reference.values) / reference.fit.std).max() < 1e-3


def test_line_stiffness_is_not_identifiable() -> None:
    """The tensions are too small to stretch the lines: EA is held, no better known than before, the rest unchanged."""
    problem, _ = measured("2022-04-12")
    found = identify(problem, select(problem.model, f"{RADII},EA"))
    k = found.selected.index("EA")
    assert found.directions.held[-1]
    assert found.values[problem.model.names.index("EA")] == pytest.approx(20000, abs=0.01 * 10000)
    assert found.std[k] == pytest.approx(10000 / 2, rel=1e-3)
    assert np.delete(found.std, k) == pytest.approx(calibrated("2022-04-12", "D", RADII).fit.std, rel=1e-3)


def test_parameters_of_one_session_on_the_other() -> None:
    """Better than nominal (7.81 mm) by far, worse than its own fit (2.82 mm)."""
    problem, _ = measured("2022-04-12")
    values = calibrated("2021-12-16", "D", RADII).fit.values
    rms = error_figures(problem, evaluate(problem, values))["length"].rms * 1e3
    assert 2.9 < rms < 4.5


def test_unknown_poses_count_as_measurements_of_the_lines() -> None:
    """Three rows of 2022-04-12 have motor angles only: four readings for three coordinates tell one thing each."""
    problem, _ = measured("2022-04-12")
    seen = problem.measured[:, :3].all(axis=1)
    assert (~seen).sum() == 3
    with_all = calibrated("2022-04-12", "D", RADII).fit
    camera = identify(problem.take(np.nonzero(seen)[0]), with_all.selected)
    assert with_all.dof == camera.dof + 3
    assert (with_all.std < camera.std * (1 + 1e-3)).all()


def test_lines_that_hardly_carry_are_taut() -> None:
    """Next to the drawing D pulls up with 0.1 N and A, B, C hold it down: by the balance of forces all are taut."""
    readings = np.zeros((3000, 4))
    readings[:, :3] = np.random.default_rng(0).uniform(-1e-3, 1e-3, (3000, 3))
    found = at(model("hangprinter"), readings)  # asserts that every row is solved
    assert np.abs(found.values[:, :3]).max() < 2e-3  # m
