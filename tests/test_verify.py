"""`check -p`: a second table against parameters, whose truth an independent simulator knows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.point_errors import Judged, PointErrors
from pkmcal_cli.calibration.verification import Known, judged, verified
from tests.campaign_tables import MM, true_values, write_table
from tests.campaigns import shipped
from tests.command import MACHINES, run
from tests.test_commands_report import UNSEARCHED
from tests.truth import generate

BIGLIDE = str(MACHINES / "biglide.yaml")
WHOLE = ("-q", "--holdout", "none")


@pytest.fixture
def calibration(tmp_path: Path) -> str:
    """Parameters of a Biglide."""
    table = write_table(tmp_path / "before.csv", "biglide", true_values("biglide", 1), 1, 60)
    params = str(tmp_path / "params.yaml")
    assert run("calibrate", BIGLIDE, table, "-o", params, "-q", "--holdout", "none").code == 0
    return params


def test_the_same_machine_agrees(calibration: str, tmp_path: Path) -> None:
    after = write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1), 2, 30)
    done = run("check", BIGLIDE, after, "-p", calibration, "--json")
    found = done.json["verification"]
    assert done.code == 0 and found["compatible"] and found["degrees_of_freedom"] == 60
    assert sum(c["n_above"] for c in found["channels"]) == len(found["above"]) <= 8  # 5 % of 60 are 3
    assert all(c["u_measured"] == pytest.approx(0.02) for c in found["channels"])  # twice 10 um
    assert "compatible with the parameters" in done.err and found["tolerance"] is None


def test_a_changed_strut_does_not(calibration: str, tmp_path: Path) -> None:
    changed = write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1, l1=0.3 * MM), 2, 30)
    done = run("check", BIGLIDE, changed, "-p", calibration, "--json", "-q")
    assert done.code == 1 and not done.json["verification"]["compatible"] and done.json["ok"]
    assert "NOT COMPATIBLE" in done.err and done.json["verification"]["p_value"] < 1e-6


def test_the_reading_that_does_not_agree_is_named(calibration: str, tmp_path: Path) -> None:
    """One cell 1 mm off makes the table disagree: which one, with its file, also on the sheet."""
    after = Path(write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1), 2, 30))
    head, *rows = after.read_text(encoding="utf-8").splitlines()
    k = [cell.split(" ")[0] for cell in head.split(",")].index("y")
    cells = rows[4].split(",")
    cells[k] = repr(float(cells[k]) + 1.0)
    after.write_text("\n".join([head, *rows[:4], ",".join(cells), *rows[5:], ""]), encoding="utf-8")
    done = run("check", BIGLIDE, after, "-p", calibration)
    assert done.code == 1 and f"furthest off by its uncertainty: y at {after}:6" in done.err
    page = ("--tolerance", "50 um", "-o", tmp_path / "r.html")
    with UNSEARCHED:
        sheet = run("report", BIGLIDE, tmp_path / "before.csv", "--after", after, *page)
    assert sheet.code == 1 and "largest at after.csv:6" in sheet.err + sheet.out


@pytest.mark.slow
def test_readings_that_disagree_together_and_not_each(calibration: str, tmp_path: Path) -> None:
    """Each is 1.5 sigma off, to either side by turns: within twice sigma, and far too much for all."""
    plan, simulator = shipped("biglide"), generate.campaigns()["biglide"].machine
    given, positions = plan.model.by_name(true_values("biglide", 1)), plan.positions[::3]
    truth = simulator.forward(positions, {n: given.get(n, v) for n, v in simulator.nominal.items()}).tcp[:, :2]
    off = 1.5 * np.asarray(plan.sigma) * np.where(np.indices(truth.shape).sum(axis=0) % 2, 1.0, -1.0)
    head = ",".join(f"{n} [mm]" for n in (*(a.name for a in plan.model.actuators), "x", "y"))
    np.savetxt(tmp_path / "a.csv", np.hstack([positions, truth + off]) / MM, delimiter=",", header=head, comments="")
    done = run("check", BIGLIDE, tmp_path / "a.csv", "-p", calibration)
    assert done.code == 1 and "; each is within 1, but not all together" in done.err


def test_chi_square_has_its_level() -> None:
    """Errors of parameters are common to all rows: without their correlation the test would alarm much too often."""
    plan, machine = shipped("biglide"), generate.campaigns()["biglide"].machine
    ratios = []
    for seed in range(25):
        rng = np.random.default_rng([33, seed])
        true, some = plan.drawn(rng), rng.permutation(len(plan.positions))
        planted = {n: plan.model.by_name(true).get(n, v) for n, v in machine.nominal.items()}
        parts = []
        for rows in (some[:30], some[30:50]):
            part = replace(plan, positions=plan.positions[rows])
            readings = machine.forward(part.positions, planted).tcp[:, : len(machine.channels)]
            parts.append(part.problem(readings + rng.normal(size=readings.shape) * plan.sigma))
        found = calibrated(parts[0], plan.selected, plan.model.nominal, FitOptions(), np.zeros(30))
        budget = found.budget
        known = Known((*budget.names, *budget.held), budget.joint_covariance, {})
        v = verified(parts[1], found.robust.fit.values, known)
        ratios.append(v.chi2 / v.dof)
    assert 0.85 < np.mean(ratios) < 1.1  # standard deviation of the mean: 0.045; the covariance is a little large


def test_an_instrument_may_stand_elsewhere(tmp_path: Path) -> None:
    """Its place is fitted to the rows of each table, and costs three degrees of freedom."""
    machine = tmp_path / "anywhere.yaml"
    machine.write_text(f"extends: {BIGLIDE}\nsensors: {{tracker: {{frame: fitted}}}}\ndatum: [x8, y8, yb1r]\n")
    before = write_table(tmp_path / "before.csv", "biglide", true_values("biglide", 1), 1, 60, turn=0.3)
    assert run("calibrate", machine, before, "-o", tmp_path / "p.yaml", *WHOLE).code == 0
    after = write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1), 2, 30, turn=-2.0)
    done = run("check", machine, after, "-p", tmp_path / "p.yaml", "--json", "-q")
    found = done.json["verification"]
    assert done.code == 0 and found["degrees_of_freedom"] == 57 and len(found["fitted"]) == 3
    aligned = write_table(tmp_path / "aligned.csv", "biglide", true_values("biglide", 1), 2, 30)
    for file, told in ((machine, True), (BIGLIDE, False)):  # what then cannot be judged is said beside the verdict
        parameters = tmp_path / f"{told}.yaml"
        assert run("calibrate", file, before if told else aligned, "-o", parameters, *WHOLE).code == 0
        shown = run("check", file, after if told else aligned, "-p", parameters).err
        assert ("where the machine as a whole is cannot be judged" in shown) == told
        assert "Actuators in the reference configuration" not in shown


def test_iso_14253() -> None:
    """|e| + U within the tolerance passes, |e| - U beyond it fails."""
    rows = np.arange(4)
    points = PointErrors(rows, np.array([10.0, 17.0, 23.0, 27.0]), np.full(4, 4.0))
    found = Judged(points, 22.0)
    assert found.passed.tolist() == [True, True, False, False] and found.failed.tolist() == [False, False, False, True]
    assert found.verdict == "fail"
    for number, verdict in ((3, "undecided"), (2, "pass"), (0, "undecided")):
        some = PointErrors(rows[:number], points.errors[:number], points.expanded[:number])
        assert Judged(some, 22.0).verdict == verdict


@pytest.mark.parametrize(("tolerance", "verdict", "code"), [("0.2 mm", "pass", 0), ("30 um", "undecided", 1)])
def test_a_tolerance_decides(calibration: str, tmp_path: Path, tolerance: str, verdict: str, code: int) -> None:
    after = write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1), 2, 30)
    done = run("check", BIGLIDE, after, "-p", calibration, "--tolerance", tolerance, "--json", "-q")
    found = done.json["verification"]["tolerance"]
    assert (done.code, found["verdict"]) == (code, verdict)
    assert found["n_pass"] + found["n_fail"] + found["n_undecided"] == 30
    assert found["largest"]["expanded_uncertainty"] == pytest.approx(0.02 if "mm" in tolerance else 20)


@pytest.mark.parametrize(("tolerance", "told"), [("20.1 um", False), ("19 um", True)])
def test_a_tolerance_below_the_uncertainty_cannot_be_met(
    calibration: str, tmp_path: Path, tolerance: str, told: bool
) -> None:
    """The tracker's U is 20 um: whatever the errors are, no point passes below it, and that is said."""
    after = write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1), 2, 30)
    done = run("check", BIGLIDE, after, "-p", calibration, "--tolerance", tolerance)
    sentence = f"no point can pass: U is 20 um (k = 2) or more, the tolerance {tolerance}; a finer instrument is needed"
    assert (sentence in done.err) == told and done.code == 1


def test_errors_of_the_tool_point_are_those_of_its_coordinates(calibration: str, tmp_path: Path) -> None:
    far = write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1, l2=2 * MM), 2, 30)
    done = run("check", BIGLIDE, far, "-p", calibration, "--tolerance", "0.2 mm", "--json", "-q")
    assert done.code == 1 and done.json["verification"]["tolerance"]["verdict"] == "fail"
    worst = done.json["verification"]["tolerance"]["largest"]
    parts = [a["error"] for a in done.json["verification"]["above"] if a["line"] == worst["line"]]
    assert np.hypot(*parts) == pytest.approx(worst["error"])


def test_only_what_was_measured_counts(calibration: str, tmp_path: Path) -> None:
    """A probe of y alone: errors along y, and the uncertainty of y."""
    plan = shipped("biglide")
    readings = plan.simulate(plan.model.nominal)[:5]
    problem = replace(plan, positions=plan.positions[:5]).problem(readings + np.array([0.0, 5e-6]))
    problem = replace(problem, measured=np.array([[False, True]] * 5))
    nothing = Known((), np.zeros((0, 0)), {})
    found = judged(verified(problem, plan.model.nominal, nothing), 1e-3).points
    assert found.errors == pytest.approx(5e-6, rel=1e-2) and found.expanded == pytest.approx(2e-5)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--tolerance", "5 um"], "needs parameters"),
        (["-p", "params.yaml", "--tolerance", "5 N"], "not a positive length"),
        (["-p", "params.yaml", "--tolerance", "-5 um"], "not a positive length"),
    ],
)
def test_half_of_what_it_needs(arguments: list[str], told: str, tmp_path: Path) -> None:
    done = run("check", BIGLIDE, str(MACHINES / "biglide.csv"), *arguments)
    assert done.code == 2 and told in done.err


def test_parameters_without_a_table() -> None:
    done = run("check", BIGLIDE, "-p", "params.yaml")
    assert done.code == 2 and "no table" in done.err


def test_a_machine_far_from_its_drawing(tmp_path: Path) -> None:
    """Rows that look like gross mistakes at nominal values are judged by the parameters."""
    far = tmp_path / "far.yaml"
    drawn = "l1: {nominal: 330, range: 50}, x8: {nominal: 380, range: 40}"
    far.write_text(f"extends: {BIGLIDE}\nparameters: {{{drawn}}}\n")
    before = write_table(tmp_path / "before.csv", "biglide", true_values("biglide", 1), 1, 60)
    assert run("calibrate", far, before, "-o", tmp_path / "p.yaml", "-q", "--accept", "--holdout", "none").code == 0
    after = write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1), 2, 30)
    done = run("check", far, after, "-p", tmp_path / "p.yaml", "-q")
    assert done.code == 0, done.err


def test_few_rows_of_an_instrument_that_stands_anywhere_decide_nothing(tmp_path: Path) -> None:
    """Its place is fitted to them: one row is met whatever it reads, two are met by most."""
    machine = tmp_path / "anywhere.yaml"
    machine.write_text(f"extends: {BIGLIDE}\nsensors: {{tracker: {{frame: fitted}}}}\ndatum: [x8, y8, yb1r]\n")
    before = write_table(tmp_path / "before.csv", "biglide", true_values("biglide", 1), 1, 60, turn=0.3)
    parameters = tmp_path / "p.yaml"
    assert run("calibrate", machine, before, "-o", parameters, "-q", "--holdout", "none").code == 0
    after = Path(write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1), 2, 30)).read_text()
    few = tmp_path / "few.csv"
    verdicts = []
    for rows in (1, 2, 30):
        few.write_text("\n".join(after.splitlines()[: rows + 1]) + "\n")
        done = run("check", machine, few, "-p", parameters, "--tolerance", "0.2 mm", "--json")
        assert ("UNDECIDED" in done.err) == (rows < 3) and done.code == (rows < 3)
        verdicts.append(done.json["verification"]["tolerance"]["verdict"])
        assert run("check", machine, few, "-p", parameters).code == (rows == 1)
    assert verdicts == ["undecided", "undecided", "pass"]


def test_rows_that_the_calibration_had_do_not_check_it(calibration: str, tmp_path: Path) -> None:
    table = write_table(tmp_path / "t.csv", "biglide", true_values("biglide", 1), 5, 30)
    parameters = tmp_path / "own.yaml"
    assert run("calibrate", BIGLIDE, table, "-o", parameters, "-q", "--holdout", "none").code == 0
    assert "fitted to these rows, so they do not check it" in run("check", BIGLIDE, table, "-p", parameters).err
    twice = run("calibrate", BIGLIDE, table, "--prior", parameters, "--holdout", "none")
    assert "fitted to these rows, so they count twice" in twice.err
    assert "fitted to these rows" not in run("check", BIGLIDE, table, "-p", calibration).err


def test_a_row_without_a_prediction_is_told_once_and_passes_nothing(calibration: str, tmp_path: Path) -> None:
    """Points of the other rows may all be within the tolerance; the verdict stands at the line that is furthest off."""
    after = Path(write_table(tmp_path / "after.csv", "biglide", true_values("biglide", 1), 2, 30))
    lines = after.read_text().splitlines()
    cells, headers = lines[3].split(","), lines[0].split(",")
    cells[next(k for k, header in enumerate(headers) if header.startswith("q1"))] = "9000"
    after.write_text("\n".join([*lines[:3], ",".join(cells), *lines[4:], ""]))
    done = run("check", BIGLIDE, after, "-p", calibration, "--tolerance", "1 mm", "--json", "--format", "github")
    found = done.json["verification"]
    assert done.code == 1 and found["tolerance"]["verdict"] == "undecided" and found["tolerance"]["n_pass"] == 29
    assert "UNDECIDED (ISO 14253-1, tolerance 1 mm): 29 points: 29 pass, 0 fail, 0 undecided; 1 row without" in done.err
    assert "NOT COMPATIBLE" not in done.err, "the other rows agree"
    shown = [line for line in done.err.splitlines() if not line.startswith("::")]
    assert sum("out of reach" in line for line in shown) == 1
    furthest = found["tolerance"]["largest"]["line"]
    assert f"::error file={after},line={furthest}::UNDECIDED" in done.err
